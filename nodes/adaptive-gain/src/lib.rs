//! Adaptive illumination gain (paper, Eq. 8–9).
//!
//! ```text
//! σ_R     = population standard deviation of R_ms
//! α       = clip(α_base · α_target / (σ_R + ε),  α_min, α_max)
//! R_final = α R_ms + (1 − α) R_smooth
//! ```
//!
//! A wide spread of illumination gives a small α and more weight to the smooth ratio. (The paper's sentence says the
//! opposite of its equation; this is the equation.) α > 1 sharpens: |R_final| ≤ (2α_max − 1)·max|R|, which
//! is 2·max|R| at 1.5. A constant ratio has σ_R = 0, hence α = α_max, which is harmless: both ratios are 0.

use std::sync::Arc;

use gear_graph::{
    Choice, Context, Demand, Inputs, Known, Lazy, Node, NodeError, Number, Outputs, Params, Registry, Want, Wanted,
};
use gear_image::{Field, stats};
use multiversion::multiversion;
use rayon::prelude::*;

/// Blend of multi-scale and smooth illumination ratios, by how much the illumination varies.
#[derive(Clone, Debug, Params)]
pub struct AdaptiveGain {
    /// How α is found.
    #[param(default = Mode::Adaptive { base: 0.8, target: 1.0, min: 0.4, max: 1.5 })]
    pub mode: Mode,
}

/// How α is found. In YAML: `mode: adaptive`, `mode: {fixed: {alpha: 0.8}}`.
#[derive(Clone, Debug, PartialEq, Choice)]
pub enum Mode {
    /// From the spread of the multi-scale ratio.
    Adaptive {
        /// α_base of the paper.
        #[param(default = 0.8, range = 0.0..=100.0)]
        base: f64,
        /// α_target: the spread of the ratio at which α is α_base.
        #[param(default = 1.0, range = 0.0..=100.0)]
        target: f64,
        /// Least α.
        #[param(default = 0.4, range = 0.0..=10.0)]
        min: f64,
        /// Greatest α.
        #[param(default = 1.5, range = 0.0..=10.0)]
        max: f64,
    },
    /// Given.
    Fixed {
        /// α.
        #[param(default = 0.8, range = 0.0..=10.0)]
        alpha: f64,
    },
}

/// Input ports.
#[derive(Inputs)]
pub struct In {
    /// R_ms, the multi-scale ratio.
    pub multiscale: Arc<Field>,
    /// R_smooth, the local mean of the ratio; not needed when α is known to be 1.
    pub smooth: Lazy<Field>,
}

/// Output ports.
#[derive(Outputs)]
pub struct Out {
    /// R_final.
    pub ratio: Wanted<Field>,
    /// α.
    pub alpha: Wanted<Number>,
}

/// ε of the gain: keeps α finite when the ratio is constant.
const EPSILON: f64 = 1e-6;

impl Node for AdaptiveGain {
    const NAME: &str = "AdaptiveGain";
    const VERSION: u32 = 2;
    type Inputs = In;
    type Outputs = Out;

    fn check(&self) -> Result<(), NodeError> {
        match self.mode {
            Mode::Adaptive { min, max, .. } if min > max => Err(NodeError::param(
                "min",
                format!("must not exceed max, found min = {min} and max = {max}"),
            )),
            _ => Ok(()),
        }
    }

    fn demand(&self, output: &str, known: &Known<'_>) -> Result<Demand, NodeError> {
        Ok(match (output, self.mode.constant()) {
            ("alpha", _) => Demand::ready_because("alpha follows from the multi-scale ratio"),
            (_, Some(1.0)) => Demand::ready_because("alpha = 1 leaves no weight to it"),
            _ => known.need(&["smooth"], "weight 1 − alpha"),
        })
    }

    fn run(&self, inputs: In, want: &Want, _ctx: &Context) -> Result<Out, NodeError> {
        let alpha = self.mode.alpha(&inputs.multiscale);
        let ratio = want.try_compute("ratio", || {
            if self.mode.constant() == Some(1.0) {
                return Ok(all_finite(owned(inputs.multiscale)));
            }
            let smooth = inputs.smooth.demanded()?;
            if smooth.size() != inputs.multiscale.size() {
                let problem = format!(
                    "expected the size of `multiscale`, {:?}, found {:?}",
                    inputs.multiscale.size(),
                    smooth.size()
                );
                return Err(NodeError::input("smooth", problem));
            }
            Ok(blend(owned(inputs.multiscale), smooth, alpha as f32))
        })?;
        Ok(Out {
            ratio,
            alpha: want.compute("alpha", || Number(alpha)),
        })
    }
}

/// The field itself where nobody else reads it, else a copy.
fn owned(field: Arc<Field>) -> Field {
    Arc::try_unwrap(field).unwrap_or_else(|shared| (*shared).clone())
}

impl Mode {
    /// α when it does not depend on the ratio.
    fn constant(&self) -> Option<f64> {
        match *self {
            Self::Fixed { alpha } => Some(alpha),
            Self::Adaptive { min, max, .. } if min == max => Some(min),
            Self::Adaptive { .. } => None,
        }
    }

    /// α for a multi-scale ratio.
    pub fn alpha(&self, multiscale: &Field) -> f64 {
        match (self.constant(), self) {
            (Some(alpha), _) | (None, &Self::Fixed { alpha }) => alpha,
            (None, &Self::Adaptive { base, target, min, max }) => {
                let (_, deviation) = stats::mean_and_deviation(multiscale.data());
                let alpha = base * target / (deviation + EPSILON);
                if alpha.is_nan() { min } else { alpha.clamp(min, max) }
            }
        }
    }
}

/// No light is 10³⁰ times another; a ratio that is beyond comes from a damaged file.
const LARGEST: f32 = 1e30;

/// NaN as 0, which says nothing of the light, and the rest within ±[`LARGEST`]: as the pyramid takes its ratios.
#[inline(always)]
fn finite(ratio: f32) -> f32 {
    if ratio.is_nan() {
        0.0
    } else {
        ratio.clamp(-LARGEST, LARGEST)
    }
}

fn all_finite(mut ratio: Field) -> Field {
    ratio.data_mut().iter_mut().for_each(|x| *x = finite(*x));
    ratio
}

/// αR_ms + (1 − α)R_smooth, in the memory of R_ms.
pub fn blend(mut multiscale: Field, smooth: &Field, alpha: f32) -> Field {
    multiscale
        .data_mut()
        .par_chunks_mut(1 << 14)
        .zip(smooth.data().par_chunks(1 << 14))
        .for_each(|(multiscale, smooth)| blend_chunk(multiscale, smooth, alpha));
    multiscale
}

#[multiversion(targets = "simd")]
fn blend_chunk(multiscale: &mut [f32], smooth: &[f32], alpha: f32) {
    for (m, &s) in multiscale.iter_mut().zip(smooth) {
        *m = alpha * finite(*m) + (1.0 - alpha) * finite(s);
    }
}

/// Adds the node to a registry.
pub fn register(registry: &mut Registry) {
    registry.node::<AdaptiveGain>();
}

#[cfg(test)]
mod tests;
