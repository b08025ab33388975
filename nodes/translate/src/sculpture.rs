//! Marble: the painting's height, lit again.
//!
//! `v = tone·(amb + (1 − amb)·max(n·l, 0))·cavity + spec·max(n·h, 0)²⁴`. The key light has the painting's own azimuth
//! as far as the light fit is sure of it (r²), else it comes from the upper left; its elevation is fixed so that
//! relief stays visible. *It must follow the painting's light*: grounding multiplies the new shading onto the old.

use gear_image::filter::gaussian;
use gear_image::{Mask, SrgbImage, colour};
use gear_relief::base::BaseSettings;
use gear_relief::fields::{dot, normals};
use gear_relief::height::{HeightSettings, Relief, estimate};
use gear_relief::layers::LayerSettings;
use gear_relief::light::{Calibration, LightFit};

use crate::length;

const TONE: f32 = 0.85;
const AMBIENT: f32 = 0.18;
const SPECULAR: f32 = 0.12;
/// Linear-light tint of marble.
const MARBLE: [f32; 3] = [1.0, 0.985, 0.95];
/// Towards the canonical light, in the picture (x right, y down).
const CANONICAL: [f32; 2] = [-0.5, -0.6];
/// z of the key light.
const ELEVATION: f32 = 0.6;

pub(crate) fn carve(painting: &SrgbImage, mask: &Mask) -> SrgbImage {
    let settings = HeightSettings {
        calibration: Calibration::PAINTED,
        base: BaseSettings::default().round(),
        // Light falls on forms; where one thing stands before another, a contour says so already.
        layers: LayerSettings {
            step: 0.0,
            ..LayerSettings::default()
        },
        ..HeightSettings::default()
    };
    let relief = estimate(&colour::light(painting), mask, &settings);
    let light = key_light(relief.light.as_ref());
    relight(&relief, light)
}

/// The painting's azimuth where it is sure, the canonical one where it is not.
pub(crate) fn key_light(fit: Option<&LightFit>) -> [f32; 3] {
    let unit = |[x, y]: [f32; 2]| {
        let length = (x * x + y * y).sqrt();
        (length, [x / length.max(1e-9), y / length.max(1e-9)])
    };
    // The canonical light weighs in with its full three-dimensional length, as it was measured.
    let (_, canonical) = unit(CANONICAL);
    let weak = CANONICAL.map(|c| c / (0.5f32 * 0.5 + 0.6 * 0.6 + 0.63 * 0.63).sqrt());
    let (sure, fitted) = fit.map_or((0.0, [0.0; 2]), |fit| (fit.r2, [fit.direction[0], fit.direction[1]]));
    let mixed = [0, 1].map(|i| sure * fitted[i] + (1.0 - sure) * weak[i]);
    let (size, azimuth) = unit(mixed);
    let azimuth = if size > 0.15 { azimuth } else { canonical };
    let across = (1.0 - ELEVATION * ELEVATION).sqrt();
    [azimuth[0] * across, azimuth[1] * across, ELEVATION]
}

fn relight(relief: &Relief, light: [f32; 3]) -> SrgbImage {
    let side = relief.height.longer_side();
    let normals = normals(&gaussian(&relief.height, length(0.8, side)));
    let surroundings = gaussian(&relief.height, length(6.0, side));
    // Heights are pixels: a hollow of a larger picture is deeper by as much.
    let hollow = 0.04 * 512.0 / side.max(192) as f32;
    let half = {
        let h = [light[0], light[1], light[2] + 1.0];
        let size = dot(h, h).sqrt();
        h.map(|c| c / size)
    };
    let flat = TONE * (AMBIENT + (1.0 - AMBIENT) * light[2]);
    let data = (0..normals.len())
        .map(|p| {
            let value = if relief.mask.data()[p] {
                let depth = (surroundings.data()[p] - relief.height.data()[p]).max(0.0);
                let cavity = (1.0 - hollow * depth).clamp(0.5, 1.0);
                let diffuse = AMBIENT + (1.0 - AMBIENT) * dot(normals[p], light).max(0.0);
                let gloss = {
                    let c = dot(normals[p], half).max(0.0);
                    let c4 = (c * c) * (c * c);
                    let c8 = c4 * c4;
                    c8 * c8 * c8
                };
                TONE * diffuse * cavity + SPECULAR * gloss
            } else {
                flat
            };
            MARBLE.map(|tint| colour::to_srgb((value * tint).clamp(0.0, 1.0)))
        })
        .collect();
    SrgbImage::from_vec(relief.height.width(), relief.height.height(), data)
}
