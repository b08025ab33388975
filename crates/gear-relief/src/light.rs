//! Light: the direction that explains the shading on the base, and how far to believe it.
//!
//! `S ≈ a + b·n` over the inside, by iteratively reweighted least squares (L1) with a light ridge; `g = |b|`,
//! `l = b/g`. A picture without visible shading has `g → 0`, `r² → 0`; then trust is 0 and nothing needs
//! to be switched off:
//!
//! ```text
//! trust = clamp((r² − .1)/.4, 0, 1) · ( g² / (g² + (k·noise)² + floor²) )²
//! ```
//!
//! A light that explains less than a tenth of the shading is none: on whole canvases one always fits a little.

use gear_image::filter::gaussian;
use gear_image::{Field, LinearImage, Mask, stats};

use crate::base::{self, BaseSettings};
use crate::fields::normals;
use crate::ink::{self, InkSettings};
use crate::shading::{self, Shading, ShadingSettings};

/// What shading contrast is expected, and so how much of it is believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// Gain below which shading is not believed. Physical shading has a gain of .5 to 1, painted .1 to .2.
    pub gain_floor: f32,
    /// Noise counts this many times.
    pub noise: f32,
    /// Width of the dead zone of detail, in units of noise over gain.
    pub core: f32,
    /// Step of shading that flat tones may hide: widens the dead zone, the more the weaker the gain.
    pub tone: f32,
    /// RMS of the shading that the base does not explain, below which it is no detail; believed in full from half
    /// as much again. A painter's tones and brush leave up to .04 on any body, however smooth (measured on spheres
    /// and tori with four tones), and photographs of smooth bodies as much; folds leave .06 and more.
    pub visible: f32,
}

impl Calibration {
    /// For pictures that should look natural: photographs, grounded paintings.
    pub const NATURAL: Self = Self {
        gain_floor: 0.25,
        noise: 3.0,
        core: 3.0,
        tone: 0.02,
        visible: 0.042,
    };
    /// For paintings: flat shading is their way, not a reason for distrust.
    pub const PAINTED: Self = Self {
        gain_floor: 0.03,
        noise: 2.0,
        core: 2.0,
        tone: 0.01,
        visible: 0.0,
    };
}

/// The light that a picture's shading suggests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightFit {
    /// Unit vector towards the light in image space (x right, y down, z to the viewer); 0 when there is none.
    pub direction: [f32; 3],
    /// Shading of a surface that the light does not reach.
    pub ambient: f32,
    /// Contrast of the shading, 0 none.
    pub gain: f32,
    /// Share of the shading's variance that the light explains, in [0, 1].
    pub r2: f32,
    /// How far detail from shading is believed, in [0, 1].
    pub trust: f32,
}

/// Below this trust there is no detail worth solving for.
pub const LEAST_TRUST: f32 = 0.02;

/// Fits the light to `shading` on the normals of `base`. Empty masks give no light.
pub fn fit(shading: &Shading, base: &Field, mask: &Mask, calibration: &Calibration) -> LightFit {
    let normals = base_normals(base, mask);
    let facing = |p: usize| mask.data()[p] && normals[p][2] > 0.25;
    let mut chosen: Vec<usize> = (0..mask.len()).filter(|&p| facing(p)).collect();
    if chosen.len() < 50 {
        chosen = (0..mask.len()).filter(|&p| mask.data()[p]).collect();
    }
    let mut fit = LightFit {
        direction: [0.0; 3],
        ambient: 1.0,
        gain: 0.0,
        r2: 0.0,
        trust: 0.0,
    };
    if chosen.is_empty() {
        return fit;
    }
    let row = |p: usize| {
        let n = normals[p].map(f64::from);
        [1.0, n[0], n[1], n[2]]
    };
    let value = |p: usize| f64::from(shading.shading.data()[p]);
    let mut weights = vec![1.0f64; chosen.len()];
    let mut c = [0.0f64; 4];
    let mut residuals = vec![0.0f64; chosen.len()];
    for _ in 0..6 {
        let mut a = [[0.0f64; 5]; 4];
        for (&p, &w) in chosen.iter().zip(&weights) {
            let x = row(p);
            for i in 0..4 {
                for j in i..4 {
                    a[i][j] += w * x[i] * x[j];
                }
                a[i][4] += w * x[i] * value(p);
            }
        }
        let ridge = 1e-3 * weights.iter().sum::<f64>();
        for i in 0..4 {
            for j in 0..i {
                a[i][j] = a[j][i];
            }
            if i > 0 {
                a[i][i] += ridge;
            }
        }
        let Some(solution) = eliminate(a) else { return fit };
        c = solution;
        for (r, &p) in residuals.iter_mut().zip(&chosen) {
            let x = row(p);
            *r = value(p) - (c[0] * x[0] + c[1] * x[1] + c[2] * x[2] + c[3] * x[3]);
        }
        let sizes: Vec<f32> = residuals.iter().map(|r| r.abs() as f32).collect();
        let least = 0.1 * f64::from(stats::median(&sizes).unwrap_or(0.0)) + 1e-6;
        for (w, r) in weights.iter_mut().zip(&residuals) {
            *w = least / r.abs().max(least);
        }
    }
    let mean = chosen.iter().map(|&p| value(p)).sum::<f64>() / chosen.len() as f64;
    let total: f64 = chosen.iter().map(|&p| (value(p) - mean) * (value(p) - mean)).sum();
    let left: f64 = residuals.iter().map(|r| r * r).sum();
    let gain = (c[1] * c[1] + c[2] * c[2] + c[3] * c[3]).sqrt();
    fit.direction = [c[1], c[2], c[3]].map(|b| (b / gain.max(1e-9)) as f32);
    fit.ambient = c[0] as f32;
    fit.gain = gain as f32;
    fit.r2 = (1.0 - left / total.max(1e-12)).clamp(0.0, 1.0) as f32;
    let doubt = calibration.noise * shading.noise;
    let signal = fit.gain * fit.gain;
    let floor = calibration.gain_floor * calibration.gain_floor;
    let believed = signal / (signal + doubt * doubt + floor).max(1e-12);
    fit.trust = ((fit.r2 - 0.1) / 0.4).clamp(0.0, 1.0) * believed * believed;
    fit
}

/// The normals light is fitted on: a whole canvas is smoothed first, its base follows every contour.
pub(crate) fn base_normals(base: &Field, mask: &Mask) -> Vec<[f32; 3]> {
    if mask.is_full() {
        normals(&gaussian(base, 1.5))
    } else {
        normals(base)
    }
}

/// Gaussian elimination with pivoting of a 4×4 system; `None` when singular.
fn eliminate(mut a: [[f64; 5]; 4]) -> Option<[f64; 4]> {
    for i in 0..4 {
        let pivot = (i..4).max_by(|&j, &k| a[j][i].abs().total_cmp(&a[k][i].abs()))?;
        a.swap(i, pivot);
        if !(a[i][i].abs() > 1e-12 && a[i][i].is_finite()) {
            return None;
        }
        for j in i + 1..4 {
            let f = a[j][i] / a[i][i];
            for k in i..5 {
                a[j][k] -= f * a[i][k];
            }
        }
    }
    let mut x = [0.0; 4];
    for i in (0..4).rev() {
        let known: f64 = (i + 1..4).map(|k| a[i][k] * x[k]).sum();
        x[i] = (a[i][4] - known) / a[i][i];
    }
    Some(x)
}

/// How far a picture already has natural light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence {
    /// Contrast of the shading explained by one light: .5 to 1 in photographs, .1 to .2 in flat paintings.
    pub gain: f32,
    /// Share of the shading's variance that one light on the inflated silhouette explains, in [0, 1].
    pub r2: f32,
    /// Brushwork and grain, robust standard deviation of log luminance.
    pub noise: f32,
    /// The trust that a reconstruction would put into the shading as it is, in [0, 1].
    pub trust: f32,
    /// Unit vector towards the light (x right, y down, z to the viewer); 0 when there is none.
    pub direction: [f32; 3],
}

/// Looks for natural light in a picture: ink, base, shading and light fit with default settings, no detail.
pub fn evidence(image: &LinearImage, mask: &Mask) -> Evidence {
    let whole = mask.is_full() || mask.count() == 0;
    let mask = if whole {
        &Mask::filled(mask.width(), mask.height(), true)
    } else {
        mask
    };
    let lines = ink::ink_lines(image, mask, &InkSettings::default());
    let body = base::body(image, mask, &BaseSettings::default().round());
    let shading = shading::shading(image, mask, &lines, &ShadingSettings::default());
    let fit = fit(&shading, &body, mask, &Calibration::NATURAL);
    Evidence {
        gain: fit.gain,
        r2: fit.r2,
        noise: shading.noise,
        trust: fit.trust,
        direction: fit.direction,
    }
}
