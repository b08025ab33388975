//! What the adaptive number of surfels costs in the picture: `cargo bench -p gear-relief --bench surfels [-- SIDE]`.
//!
//! Every sample is lifted with one surfel a pixel (both tolerances 0) and with blocks within several tolerances; the views of
//! the second are compared with those of the first. PSNR is over the pixels that either covers, of colour over white; depth is
//! compared where both cover more than half, in pixels of the front view. It is an error study, not a timing: any build
//! profile gives the same table.

use gear_image::colour::light;
use gear_relief::height::{HeightSettings, estimate};
use gear_relief::surfels::{SurfelSettings, lift};
use gear_sample::{Options, names, paint};
use gear_splat::{Camera, Outputs, RenderOptions, Rendering, Scene, orbit, render};

/// Plane tolerance in pixels and colour tolerance; the default among them.
const TOLERANCES: [(f32, f32); 8] = [
    (0.05, 0.005),
    (0.1, 0.015),
    (0.25, 0.005),
    (0.25, 0.015),
    (0.25, 0.03),
    (0.25, 0.06),
    (0.5, 0.03),
    (1.0, 0.06),
];
const YAWS: [f64; 7] = [0.0, -30.0, 30.0, -60.0, 60.0, -90.0, 90.0];

fn main() {
    let side = std::env::args().find_map(|a| a.parse().ok()).unwrap_or(512);
    println!("longer side {side} px");
    println!("sample            plane px  colour  surfels  share  PSNR front  yaw ±30..90  depth rms px  worst");
    for name in names() {
        let sample = paint(
            name,
            &Options {
                longer_side: side,
                ..Options::default()
            },
        )
        .expect("the sample is known and the side is within its limits");
        let picture = &sample.painting.rgb;
        let relief = estimate(&light(picture), &sample.mask, &HeightSettings::default());
        let (width, height) = picture.size();
        let camera = Camera::front(width as u32, height as u32);
        let lifted = |plane_tolerance: f32, colour_tolerance: f32| {
            let settings = SurfelSettings {
                plane_tolerance,
                colour_tolerance,
                max_gaussians: usize::MAX,
                ..SurfelSettings::default()
            };
            lift(&relief, picture, &camera, &settings).0
        };
        let full = lifted(0.0, 0.0);
        let cameras = orbit::cameras(&full, &YAWS, 0);
        let expected = views(&full, &cameras);
        println!("{name:<18}{:>8}{:>8}{:>9}{:>7}", 0, 0, full.len(), "1");
        for (plane, colour) in TOLERANCES {
            let scene = lifted(plane, colour);
            let errors: Vec<Error> = views(&scene, &cameras)
                .iter()
                .zip(&expected)
                .map(|(a, b)| Error::between(a, b, side as f64))
                .collect();
            let aside: Vec<f64> = errors[1..].iter().map(|e| e.mean_square).collect();
            let mean = aside.iter().sum::<f64>() / aside.len() as f64;
            let depth = errors[0].depth_px;
            println!(
                "{name:<18}{plane:>8}{colour:>8}{:>9}{:>7.2}{:>12.1}{:>13.1}{:>14.2}{:>7.1}",
                scene.len(),
                scene.len() as f64 / full.len() as f64,
                psnr(errors[0].mean_square),
                psnr(mean),
                depth.0,
                depth.1
            );
        }
    }
}

fn views(scene: &Scene, cameras: &[Camera]) -> Vec<Rendering> {
    let draw = |camera| render(scene, camera, &RenderOptions::default(), Outputs::ALL);
    cameras.iter().map(draw).collect()
}

fn psnr(mean_square: f64) -> f64 {
    -10.0 * libm::log10(mean_square.max(1e-12))
}

struct Error {
    mean_square: f64,
    /// Root of the mean square, and the largest.
    depth_px: (f64, f64),
}

impl Error {
    fn between(a: &Rendering, b: &Rendering, pixels_per_unit: f64) -> Self {
        let [a_alpha, b_alpha] = [a, b].map(|r| r.alpha.as_ref().expect("everything was wanted").data());
        let [a_rgb, b_rgb] = [a, b].map(|r| r.rgb.as_ref().expect("everything was wanted").data());
        let [a_depth, b_depth] = [a, b].map(|r| r.surface_depth().expect("everything was wanted"));
        let (mut sum, mut covered) = (0.0, 0usize);
        let (mut depth, mut both, mut worst) = (0.0, 0usize, 0.0f64);
        for i in 0..a_rgb.len() {
            if a_alpha[i].max(b_alpha[i]) < 1.0 / 255.0 {
                continue;
            }
            covered += 1;
            let off = (0..3).map(|c| f64::from(a_rgb[i][c] - b_rgb[i][c]));
            sum += off.map(|x| x * x).sum::<f64>() / 3.0;
            if a_alpha[i].min(b_alpha[i]) > 0.5 {
                let off = f64::from(a_depth.data()[i] - b_depth.data()[i]).abs() * pixels_per_unit;
                depth += off * off;
                worst = worst.max(off);
                both += 1;
            }
        }
        Self {
            mean_square: sum / covered.max(1) as f64,
            depth_px: ((depth / both.max(1) as f64).sqrt(), worst),
        }
    }
}
