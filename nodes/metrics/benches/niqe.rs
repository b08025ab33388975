//! How fine the grid of shapes is on which NIQE's fits are looked up. Writes a table that `gear curve` draws:
//!
//!     cargo bench -p node-metrics --bench niqe -- docs/src/curves
//!
//! The mean error over six painted samples, against a grid ten times as fine as the reference's. The cost is the number of shapes,
//! each with three gamma functions; they are computed once in the life of a program. Nothing is timed.

#[path = "../../../crates/gear-image/benches/shared/table.rs"]
mod table;

use gear_image::SrgbImage;
use gear_sample::{Condition, Options};
use node_metrics::niqe::{SHAPE_STEP, niqe_with_step};
use table::Table;

fn paintings() -> Vec<SrgbImage> {
    let motifs = ["court-lady", "vessel", "landscape-relief"];
    let conditions = [Condition::Paint, Condition::Flat];
    let each = motifs
        .iter()
        .flat_map(|motif| conditions.map(|condition| (motif, condition)));
    each.map(|(motif, condition)| {
        let options = Options {
            longer_side: 384,
            condition,
            ..Options::default()
        };
        gear_sample::paint(motif, &options).expect("a motif").painting.rgb
    })
    .collect()
}

fn main() -> std::io::Result<()> {
    let paintings = paintings();
    let scores = |step: f64| -> (Vec<f64>, usize) {
        let scored: Vec<_> = paintings
            .iter()
            .map(|painting| niqe_with_step(painting, step))
            .collect();
        let shapes = scored[0].1;
        (scored.into_iter().filter_map(|(niqe, _)| niqe).collect(), shapes)
    };
    let (exact, _) = scores(1e-4);
    let norm = format!("mean abs of NIQE over {} pictures against a step of 1e-4", exact.len());
    let mut table = Table::new("NIQE; the grid of shapes", &norm, "any").counting("shapes");
    for step in [0.3, 0.1, 0.03, 0.01, 0.003, SHAPE_STEP, 0.0003] {
        let (found, shapes) = scores(step);
        let off: f64 = found.iter().zip(&exact).map(|(a, b)| (a - b).abs()).sum();
        let shipped = step == SHAPE_STEP;
        let label = format!("step {step}{}", if shipped { " (shipped)" } else { "" });
        table.add(&label, "", 0.0, Some(shapes as u64), off / exact.len() as f64, shipped);
    }
    table.write("niqe-shapes")
}
