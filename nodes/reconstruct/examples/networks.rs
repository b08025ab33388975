//! Errors against scenes of known shape: inflation, shading, and a network, as a table:
//! `cargo run -p node-reconstruct --example networks -- MODEL.onnx [SIDE] [SCENES]`.
//!
//! Depth: RMS of the difference after the best scale and offset, over the deviation of the truth. Normals: mean angle.
//! Detail: correlation of the high-passed heights. Means over the first SCENES of each family, painted and photographed,
//! from two lights; true masks; the picture itself is given, not a grounded one. The declaration lies beside the model.

use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

use gear_graph::{Context, FileSource, Lazy, Loader, testing};
use gear_image::Field;
use gear_onnx::{Model, ModelFile};
use gear_relief::truth::surface_error;
use gear_sample::{Condition, Options, Sample, paint};
use node_reconstruct::{In, Reconstruct};

const FAMILIES: [&str; 4] = ["figure", "vessel", "relief", "landscape"];
const CONDITIONS: [Condition; 2] = [Condition::Paint, Condition::Photo];
const LIGHTS: [[f64; 3]; 2] = [[-0.5, 0.55, 0.67], [0.6, 0.3, 0.74]];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let model = ModelFile::default().load(&FileSource::path(&arguments[0]), &Context::detached())?;
    let longer_side = arguments.get(1).map_or(Ok(256), |side| side.parse())?;
    let scenes: usize = arguments.get(2).map_or(Ok(4), |scenes| scenes.parse())?;
    let methods = [
        ("inflation", serde_json::json!("inflation")),
        ("shading", serde_json::json!("shading")),
        ("network", serde_json::json!({"depth-network": {"iterations": 0}})),
        ("network + shading", serde_json::json!("depth-network")),
    ];
    println!("| family | {} |", methods.each_ref().map(|(name, _)| *name).join(" | "));
    println!("|---{}|", "|---".repeat(methods.len()));
    let mut seconds = [0.0; 4];
    for family in FAMILIES {
        let mut sums = [[0.0; 3]; 4];
        let mut count = 0.0;
        for (scene, condition, light) in each(scenes) {
            let options = Options {
                longer_side,
                condition,
                light,
                ..Options::default()
            };
            let sample = paint(&format!("{family}-{scene}"), &options)?;
            for (i, (_, method)) in methods.iter().enumerate() {
                let start = Instant::now();
                let depth = reconstructed(method, &sample, &model)?;
                seconds[i] += start.elapsed().as_secs_f64();
                let error = surface_error(&depth, &sample.front());
                for (sum, error) in sums[i]
                    .iter_mut()
                    .zip([error.depth, error.normals_degrees, error.detail])
                {
                    *sum += error.ok_or("nothing to compare")?;
                }
            }
            count += 1.0;
        }
        let mean = sums.map(|sum| format!("{:.3} {:.1}° {:.3}", sum[0] / count, sum[1] / count, sum[2] / count));
        println!("| {family} | {} |", mean.join(" | "));
    }
    let runs = (FAMILIES.len() * each(scenes).count()) as f64;
    println!(
        "| seconds | {} |",
        seconds.map(|s| format!("{:.3}", s / runs)).join(" | ")
    );
    Ok(())
}

/// Scenes from 1, under every condition and light.
fn each(scenes: usize) -> impl Iterator<Item = (usize, Condition, [f64; 3])> {
    let lit = |(scene, condition)| LIGHTS.map(|light| (scene, condition, light));
    (1..=scenes)
        .flat_map(|scene| CONDITIONS.map(|condition| (scene, condition)))
        .flat_map(lit)
}

fn reconstructed(method: &serde_json::Value, sample: &Sample, model: &Model) -> Result<Arc<Field>, Box<dyn Error>> {
    let node: Reconstruct = testing::read(&serde_json::json!({ "method": method })).map_err(|_| "parameters")?;
    let inputs = In {
        image: Arc::new(sample.painting.clone()),
        mask: Arc::new(sample.mask.clone()),
        model: Some(Lazy::given(model.clone())),
    };
    Ok(testing::run(&node, inputs)?.depth.unwrap())
}
