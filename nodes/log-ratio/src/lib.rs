//! Log-ratio illumination field (paper, Eq. 4–5).
//!
//! With L the luminance of the image in linear light, and Ω(p) the window around p cut by the image's rim:
//!
//! ```text
//! R(p)        = log(L(p) + ε) − mean log(L + ε)
//! R_smooth(p) = mean of R over Ω(p)
//! ```
//!
//! R says how much brighter than the picture as a whole a pixel is lit. The geometric mean of the paper is taken
//! as the mean of logs, which it equals: the product of the 512² luminances of a picture underflows to zero even
//! in f64. ε keeps pure black from ruling the spread of R, to which the gain later adapts: on a dark photograph
//! σ_R is 4.0, 2.8, 2.2, 1.5 for ε = 10⁻⁶, 10⁻⁴, 10⁻³, 10⁻²; 10⁻³ is about three codes of 8-bit black.

use std::sync::Arc;

use gear_graph::{Choice, Context, Inputs, Node, NodeError, Outputs, Params, Registry, Want, Wanted};
use gear_image::filter::box_mean;
use gear_image::{Field, Image, Rgb, Srgb, colour, math, stats};
use multiversion::multiversion;
use rayon::prelude::*;

/// Illumination of every pixel relative to the picture as a whole, and its local mean.
///
/// Feed it the translated picture, in which surfaces are lit as a solid thing would be.
#[derive(Clone, Debug, Params)]
pub struct LogRatio {
    /// Radius of the square window of `smooth`; at least one pixel, unless it is 0 (no smoothing).
    #[param(default = 0.03, range = 0.0..=50.0, unit = "share of the longer side")]
    pub radius: f64,

    /// What is added to the luminance before its logarithm.
    #[param(default = 1e-3, above = 0.0, range = 0.0..=1.0)]
    pub epsilon: f64,

    /// What `epsilon` is measured in.
    #[param(default = Scale::Display)]
    pub scale: Scale,
}

/// What luminances are compared with.
#[derive(Clone, Debug, PartialEq, Choice)]
pub enum Scale {
    /// Display white is 1.
    Display,
    /// The geometric mean of the positive luminances is 1: for scene-linear and HDR pictures.
    Relative,
}

/// Input ports.
#[derive(Inputs)]
pub struct In {
    /// The picture whose illumination is measured.
    pub image: Arc<Image>,
}

/// Output ports.
#[derive(Outputs)]
pub struct Out {
    /// Log of the luminance against its geometric mean; natural logarithm, mean 0.
    pub ratio: Wanted<Field>,
    /// Mean of `ratio` over the window around each pixel.
    pub smooth: Wanted<Field>,
}

impl Node for LogRatio {
    const NAME: &str = "LogRatio";
    const VERSION: u32 = 1;
    type Inputs = In;
    type Outputs = Out;

    fn run(&self, inputs: In, want: &Want, ctx: &Context) -> Result<Out, NodeError> {
        let luminance = luminance(&inputs.image.rgb);
        ctx.checkpoint()?;
        let epsilon = match self.scale {
            Scale::Display => self.epsilon,
            Scale::Relative => self.epsilon * geometric_mean_of_positive(&luminance),
        };
        let ratio = log_ratio(luminance, epsilon as f32);
        let smooth = want.compute("smooth", || {
            box_mean(&ratio, radius_px(self.radius, ratio.longer_side()))
        });
        Ok(Out {
            ratio: want.compute("ratio", || ratio),
            smooth,
        })
    }
}

/// Pixels a step of the fused loops: its samples stay in the innermost cache.
const STEP: usize = 512;

/// Luminance of encoded colour in linear light; samples that are no light (NaN, negative) count as 0.
pub fn luminance(image: &Rgb<Srgb>) -> Field {
    let (width, height) = image.size();
    let mut out = Field::filled(width, height, 0.0);
    out.data_mut()
        .par_chunks_mut(1 << 14)
        .zip(image.data().par_chunks(1 << 14))
        .for_each(|(out, rgb)| luminance_chunk(rgb, out));
    out
}

#[multiversion(targets = "simd")]
fn luminance_chunk(rgb: &[[f32; 3]], out: &mut [f32]) {
    let mut flat = [0.0f32; 3 * STEP];
    for (rgb, out) in rgb.chunks(STEP).zip(out.chunks_mut(STEP)) {
        let flat = &mut flat[..3 * rgb.len()];
        flat.copy_from_slice(rgb.as_flattened());
        for x in flat.iter_mut() {
            *x = colour::sanitise_sample(colour::to_linear(*x));
        }
        for (out, light) in out.iter_mut().zip(flat.as_chunks::<3>().0) {
            *out = colour::luminance(*light);
        }
    }
}

/// R from L, in place.
pub fn log_ratio(mut luminance: Field, epsilon: f32) -> Field {
    luminance
        .data_mut()
        .par_chunks_mut(1 << 14)
        .for_each(|chunk| log_chunk(chunk, epsilon));
    let mean = stats::mean(luminance.data()) as f32;
    luminance.data_mut().par_chunks_mut(1 << 14).for_each(|chunk| {
        for x in chunk {
            *x -= mean;
        }
    });
    luminance
}

#[multiversion(targets = "simd")]
fn log_chunk(xs: &mut [f32], epsilon: f32) {
    for x in xs {
        *x = math::ln(*x + epsilon);
    }
}

/// exp(mean log L) over L > 0; 1 when there is none.
fn geometric_mean_of_positive(luminance: &Field) -> f64 {
    let mut logs: Vec<f32> = luminance.data().iter().copied().filter(|&l| l > 0.0).collect();
    math::map_slice(&mut logs, math::ln_slice);
    libm::exp(stats::mean(&logs))
}

/// The window's radius in pixels.
fn radius_px(share: f64, longer_side: usize) -> usize {
    if share == 0.0 {
        0
    } else {
        (share * longer_side as f64).round().max(1.0) as usize
    }
}

/// Adds the node to a registry.
pub fn register(registry: &mut Registry) {
    registry.node::<LogRatio>();
}

#[cfg(test)]
mod tests;
