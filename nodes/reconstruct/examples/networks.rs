//! Errors against the true height and normals of the samples: inflation, shading, and a network, as a table:
//! `cargo run -p node-reconstruct --example networks -- MODEL.onnx [SIDE]`.
//!
//! Height: RMS of the difference after the best scale and offset, over the deviation of the truth. Normals: mean angle.
//! True masks; the painting itself is given, not a grounded picture.

use std::sync::Arc;
use std::time::Instant;

use gear_graph::{Context, FileSource, Lazy, Loader, testing};
use gear_image::{Field, Image};
use gear_onnx::ModelFile;
use gear_sample::{Options, Sample};
use node_reconstruct::{In, Reconstruct};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let model = ModelFile {}.load(&FileSource::path(&arguments[0]), &Context::detached())?;
    let longer_side = arguments.get(1).map_or(Ok(256), |side| side.parse())?;
    let methods = [
        ("inflation", serde_json::json!("inflation")),
        ("shading", serde_json::json!("shading")),
        ("network", serde_json::json!({"depth-network": {"iterations": 0}})),
        ("network + shading", serde_json::json!("depth-network")),
    ];
    println!("| sample | {} |", methods.each_ref().map(|(name, _)| *name).join(" | "));
    println!("|---{}|", "|---".repeat(methods.len()));
    let mut sums = [[0.0; 3]; 4];
    let mut count = 0.0;
    for name in gear_sample::names() {
        let sample = gear_sample::paint(
            name,
            &Options {
                longer_side,
                ..Options::default()
            },
        )?;
        let mut row = format!("| {name}");
        for ((_, method), sum) in methods.iter().zip(&mut sums) {
            let params = serde_json::json!({ "method": method });
            let node: Reconstruct = testing::read(&params).map_err(|_| "parameters")?;
            let start = Instant::now();
            let out = testing::run(
                &node,
                In {
                    image: Arc::new(sample.painting.clone()),
                    mask: Arc::new(sample.mask.clone()),
                    model: Some(Lazy::given(model.clone())),
                },
            )?;
            let seconds = start.elapsed().as_secs_f64();
            let errors = [
                height_error(&out.depth.unwrap(), &sample),
                normal_error(&out.normals.unwrap(), &sample),
                seconds,
            ];
            row += &format!(" | {:.3}, {:.1}°", errors[0], errors[1]);
            sum.iter_mut().zip(errors).for_each(|(sum, error)| *sum += error);
        }
        count += 1.0;
        println!("{row} |");
    }
    let means = sums.map(|sum| format!("{:.3}, {:.1}°, {:.2} s", sum[0] / count, sum[1] / count, sum[2] / count));
    println!("| mean | {} |", means.join(" | "));
    Ok(())
}

fn height_error(depth: &Field, sample: &Sample) -> f64 {
    let pairs: Vec<(f64, f64)> = (0..depth.len())
        .filter(|p| sample.mask.data()[*p] && depth.data()[*p].is_finite())
        .map(|p| (f64::from(depth.data()[p]), f64::from(sample.height.data()[p])))
        .collect();
    let n = pairs.len() as f64;
    let (mx, my) = pairs.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (x, y) in &pairs {
        xx += (x - mx) * (x - mx);
        xy += (x - mx) * (y - my);
        yy += (y - my) * (y - my);
    }
    // With the best non-negative scale the residual is yy − xy²/xx.
    let explained = if xy > 0.0 { xy * xy / xx } else { 0.0 };
    ((yy - explained).max(0.0) / yy).sqrt()
}

fn normal_error(normals: &Image, sample: &Sample) -> f64 {
    let mut sum = 0.0;
    let mut count = 0.0;
    for p in (0..sample.mask.len()).filter(|p| sample.mask.data()[*p]) {
        let n = normals.rgb.data()[p].map(|c| f64::from(2.0 * c - 1.0));
        let t = sample.normals[p].map(f64::from);
        let dot: f64 = n.iter().zip(t).map(|(a, b)| a * b).sum();
        sum += libm::acos(dot.clamp(-1.0, 1.0)).to_degrees();
        count += 1.0;
    }
    sum / count
}
