//! The chain against an independent implementation.
//!
//! `chain.json` was made in numpy and scipy (f64, sparse LDLᵀ solves): a 64×64 picture
//! `(.5 + .3 sin(x/5) cos(y/7))·(.8, .5, .3)` with column 40 at a fifth, in an elliptic mask; ink with floor 0, the
//! inflated base, shading with absorption .75/64² and ε = .1, the light fit. Values are
//! given at every 37th pixel inside.

use gear_image::{LinearImage, Mask, Rgb};
use gear_relief::base::{BaseSettings, inflated};
use gear_relief::ink::{InkSettings, ink_lines, two_sided_darkness};
use gear_relief::light::{Calibration, fit};
use gear_relief::shading::{ShadingSettings, shading};
use serde::Deserialize;

#[derive(Deserialize)]
struct Oracle {
    pixels: Vec<usize>,
    ink: Vec<f32>,
    base: Vec<f32>,
    shading: Vec<f32>,
    noise: f32,
    light: [f32; 3],
    ambient: f32,
    gain: f32,
    r2: f32,
}

fn worst(ours: &[f32], pixels: &[usize], oracle: &[f32]) -> f32 {
    pixels
        .iter()
        .zip(oracle)
        .map(|(&p, o)| (ours[p] - o).abs())
        .fold(0.0, f32::max)
}

#[test]
fn ink_base_shading_and_light_agree_with_numpy() {
    let oracle: Oracle = serde_json::from_str(include_str!("chain.json")).unwrap();
    let picture: LinearImage = Rgb::from_fn(64, 64, |x, y| {
        let tone = 0.5 + 0.3 * libm::sin(x as f64 / 5.0) * libm::cos(y as f64 / 7.0);
        let tone = tone * if x == 40 { 0.2 } else { 1.0 };
        [0.8, 0.5, 0.3].map(|c: f64| (c * tone) as f32)
    });
    let mask = Mask::from_fn(64, 64, |x, y| {
        let (u, v) = ((x as f64 - 31.5) / 26.0, (y as f64 - 31.5) / 29.0);
        u * u + v * v < 1.0
    });
    let settings = InkSettings {
        floor: 0.0,
        ..InkSettings::default()
    };
    let free = two_sided_darkness(&picture.luminance(), &settings);
    assert!(worst(free.data(), &oracle.pixels, &oracle.ink) < 1e-4);

    let ink = ink_lines(&picture, &mask, &settings);
    let base = inflated(&mask, &BaseSettings::default().round());
    assert!(worst(base.data(), &oracle.pixels, &oracle.base) < 2e-3);

    let shading = shading(&picture, &mask, &ink, &ShadingSettings::default());
    assert!(worst(shading.shading.data(), &oracle.pixels, &oracle.shading) < 2e-3);
    assert!((shading.noise - oracle.noise).abs() < 1e-3);

    let light = fit(&shading, &base, &mask, &Calibration::NATURAL);
    let turned: f32 = light.direction.iter().zip(oracle.light).map(|(a, b)| a * b).sum();
    assert!(turned > 0.999, "{:?} for {:?}", light.direction, oracle.light);
    assert!((light.gain - oracle.gain).abs() < 0.01 && (light.ambient - oracle.ambient).abs() < 0.01);
    assert!((light.r2 - oracle.r2).abs() < 0.01);
}
