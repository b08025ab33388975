//! How the anchor of the refinement is taken: explicitly, or by a proximal step in one metric or another. Writes tables that
//! `gear curve` draws:
//!
//!     cargo bench -p gear-splat --bench anchor -- docs/src/curves
//!
//! * `anchor.csv`: a weight of 1, as shipped.
//! * `anchor-stiff.csv`: a weight of 10⁶. What diverged has an infinite error, and is not drawn.
//!
//! The problem is the toy of the tests, 200 coordinates with curvatures over four decades and noisy gradients, whose minimum is
//! known. Nothing is timed: the tables are the same on every machine.

#[path = "../../gear-image/benches/shared/table.rs"]
mod table;
#[path = "../src/refine/prox/toy.rs"]
mod toy;

use gear_splat::refine::prox::ProxAdam;
use table::Table;
use toy::{Method, distance};

/// Steps of a refinement with the shipped defaults: colours, then everything.
const SHIPPED: usize = 300;

fn main() -> std::io::Result<()> {
    schemes(1.0, "1").write("anchor")?;
    // It says why the number of steps is off this front.
    schemes(1e6, "10⁶").decided("0008").write("anchor-stiff")
}

/// An error as large as this is none of a method any more.
const DIVERGED: f64 = 1e6;

fn schemes(lambda: f64, weight: &str) -> Table {
    let title = format!("Refine; the anchor with a weight of {weight}");
    let mut table = Table::new(&title, "rms distance to the minimum", "any").counting("steps");
    for (family, method) in [
        ("metric prox (shipped)", Method::MetricProx),
        ("unit-metric prox", Method::UnitMetricProx),
        ("within Adam", Method::AdamWithAnchor),
        ("explicit descent", Method::ExplicitSgd),
    ] {
        for steps in [25, 50, 100, 200, SHIPPED, 600, 1200] {
            let default = method == Method::MetricProx && steps == SHIPPED;
            let error = distance(lambda, method, steps);
            let error = if error < DIVERGED { error } else { f64::INFINITY };
            table.add(
                &format!("{steps} steps"),
                family,
                0.0,
                Some(steps as u64),
                error,
                default,
            );
        }
    }
    table
}
