//! The generic enhancement baselines that the paper compares grounding with.
//!
//! Both find a new luminance q from the luminance L and scale the colour by it, in linear light:
//! I' = clip(I · q/L). Neither knows anything about shape, which is their point.
//!
//! *Histogram equalization*: q is the share of pixels that are darker, of the sRGB-encoded luminance (256 bins,
//! interpolated between bin centres).
//!
//! *Retinex* (multi-scale, Jobson et al. 1997): r = mean over s of log(L + ε) − log(G_s ∗ (L + ε)), stretched from
//! its 1 % to its 99 % quantile.

use std::sync::Arc;

use gear_graph::{Choice, Context, Inputs, Node, NodeError, Outputs, Params, Registry, Want};
use gear_image::filter::gaussian;
use gear_image::{Field, Image, LinearImage, SrgbImage, colour, math, stats};
use rayon::prelude::*;

/// Generic enhancement: histogram equalization or retinex.
#[derive(Clone, Debug, Params)]
pub struct Enhance {
    /// How the luminance is changed.
    #[param(default = Method::HistogramEqualization)]
    pub method: Method,
}

/// How the luminance is changed.
#[derive(Clone, Debug, PartialEq, Choice)]
pub enum Method {
    /// Every luminance becomes equally frequent.
    HistogramEqualization,
    /// Luminance against its surroundings, at several sizes.
    Retinex {
        /// Sizes of the surroundings: σ of the Gaussians.
        #[param(default = vec![0.03, 0.12, 0.3], range = 0.001..=1.0, unit = "share of the longer side")]
        scales: Vec<f64>,
    },
}

/// Input ports.
#[derive(Inputs)]
pub struct In {
    /// The picture.
    pub image: Arc<Image>,
}

/// Output ports.
#[derive(Outputs)]
pub struct Out {
    /// The enhanced picture.
    pub image: Arc<Image>,
}

impl Node for Enhance {
    const NAME: &str = "Enhance";
    const VERSION: u32 = 1;
    type Inputs = In;
    type Outputs = Out;

    fn check(&self) -> Result<(), NodeError> {
        match &self.method {
            Method::Retinex { scales } if scales.is_empty() => Err(NodeError::param(
                "method.retinex.scales",
                "expected at least one scale, found none",
            )),
            _ => Ok(()),
        }
    }

    fn run(&self, inputs: In, _want: &Want, _ctx: &Context) -> Result<Out, NodeError> {
        let light = colour::light(&inputs.image.rgb);
        let rgb = match &self.method {
            Method::HistogramEqualization => equalized(&light),
            Method::Retinex { scales } => retinex(&light, scales),
        };
        Ok(Out {
            image: Arc::new(Image {
                rgb,
                alpha: inputs.image.alpha.clone(),
            }),
        })
    }
}

const BINS: usize = 256;

/// Histogram equalization of the encoded luminance. A picture of one luminance stays as it is.
pub fn equalized(light: &LinearImage) -> SrgbImage {
    let mut encoded = light.luminance();
    encoded
        .data_mut()
        .par_chunks_mut(1 << 14)
        .for_each(colour::to_srgb_slice);
    let Some((low, high)) = stats::range(encoded.data()).filter(|(low, high)| low < high) else {
        return rescaled(light, |_, l| l);
    };
    let shares = cumulative_shares(encoded.data(), low, high);
    let scale = BINS as f32 / (high - low);
    rescaled(light, |i, _| {
        // Position between bin centres.
        let x = ((encoded.data()[i] - low) * scale - 0.5).clamp(0.0, (BINS - 1) as f32);
        let bin = (x as usize).min(BINS - 2);
        let t = x - bin as f32;
        colour::to_linear(shares[bin] + t * (shares[bin + 1] - shares[bin]))
    })
}

/// Share of the samples in each bin of [low, high] or a lower one.
fn cumulative_shares(samples: &[f32], low: f32, high: f32) -> Vec<f32> {
    let mut counts = [0u64; BINS];
    let scale = BINS as f32 / (high - low);
    for &x in samples {
        counts[(((x - low) * scale) as usize).min(BINS - 1)] += 1;
    }
    let total = samples.len() as f64;
    counts
        .iter()
        .scan(0u64, |sum, &count| {
            *sum += count;
            Some((*sum as f64 / total) as f32)
        })
        .collect()
}

/// Keeps the logarithms finite.
const RETINEX_EPSILON: f32 = 1e-3;

/// Multi-scale retinex of the luminance. A picture without any contrast stays as it is.
pub fn retinex(light: &LinearImage, scales: &[f64]) -> SrgbImage {
    let mut luminance = light.luminance();
    luminance.data_mut().iter_mut().for_each(|l| *l += RETINEX_EPSILON);
    let log = |mut field: Field| {
        math::map_slice(field.data_mut(), math::ln_slice);
        field
    };
    let own = log(luminance.clone());
    let mut contrast = Field::filled(light.width(), light.height(), 0.0);
    let weight = 1.0 / scales.len() as f32;
    for scale in scales {
        let around = log(gaussian(&luminance, scale * light.longer_side() as f64));
        for ((c, own), around) in contrast.data_mut().iter_mut().zip(own.data()).zip(around.data()) {
            *c += weight * (own - around);
        }
    }
    let low = stats::quantile(contrast.data(), 0.01).unwrap_or(0.0);
    let high = stats::quantile(contrast.data(), 0.99).unwrap_or(0.0);
    if high - low <= 1e-6 {
        return rescaled(light, |_, l| l);
    }
    rescaled(light, |i, l| {
        let stretched = colour::to_linear(((contrast.data()[i] - low) / (high - low)).clamp(0.0, 1.0));
        // `rescaled` divides by l, this method by l + ε.
        stretched * l / (l + RETINEX_EPSILON)
    })
}

/// Scales each colour from its luminance l to `target(index, l)`, clips to [0, 1] and encodes.
fn rescaled(light: &LinearImage, target: impl Fn(usize, f32) -> f32 + Sync) -> SrgbImage {
    const CHUNK: usize = 1 << 13;
    let mut out = light.clone();
    out.data_mut()
        .par_chunks_mut(CHUNK)
        .enumerate()
        .for_each(|(chunk, pixels)| {
            for (i, pixel) in pixels.iter_mut().enumerate() {
                let l = colour::luminance(*pixel);
                let factor = target(chunk * CHUNK + i, l) / l.max(1e-4);
                *pixel = pixel.map(|c| (c * factor).clamp(0.0, 1.0));
            }
        });
    out.to_srgb()
}

/// Adds the node to a registry.
pub fn register(registry: &mut Registry) {
    registry.node::<Enhance>();
}

#[cfg(test)]
mod tests;
