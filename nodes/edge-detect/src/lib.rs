//! Edge maps: where the translation keeps contours and where illumination must not leak across.
//!
//! `gradient` is the soft colour gradient of [`gear_image::edges`]; `canny` (Canny 1986) are binary contours of the
//! luminance: blur, gradient, the ridge of its magnitude, and hysteresis between two thresholds. Contours are then
//! widened by a pixel: as weights of the illumination pyramid, lines one pixel wide hardly stop leakage.

mod canny;

use std::sync::Arc;

use gear_graph::{Choice, Context, Inputs, Node, NodeError, Outputs, Params, Registry, Want};
use gear_image::edges::soft_edges;
use gear_image::{Field, Image, colour};

/// Contours of a picture.
#[derive(Clone, Debug, Params)]
pub struct EdgeDetect {
    /// How contours are found.
    #[param(default = Method::Gradient { sigma: 1.0, quantile: 0.98 })]
    pub method: Method,
}

/// How contours are found.
#[derive(Clone, Debug, PartialEq, Choice)]
pub enum Method {
    /// Soft: norm of the colour gradient of the cube-root image, scaled by a quantile of itself.
    Gradient {
        /// Blur before the gradient.
        #[param(default = 1.0, range = 0.0..=20.0, unit = "px")]
        sigma: f64,
        /// The quantile of the gradient that counts as 1.
        #[param(default = 0.98, range = 0.5..=1.0)]
        quantile: f64,
    },
    /// Binary lines, three pixels wide.
    Canny {
        /// Gradient from which on a contour is continued.
        #[param(default = 0.1, range = 0.0..=1.0, unit = "share of the gradient's 98 % quantile")]
        low: f64,
        /// Gradient from which on a contour begins.
        #[param(default = 0.3, range = 0.0..=1.0, unit = "share of the gradient's 98 % quantile")]
        high: f64,
        /// Blur before the gradient.
        #[param(default = 1.4, range = 0.0..=20.0, unit = "px")]
        sigma: f64,
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
    /// Contour strength in [0, 1], the size of the picture.
    pub edges: Arc<Field>,
}

impl Node for EdgeDetect {
    const NAME: &str = "EdgeDetect";
    const VERSION: u32 = 1;
    type Inputs = In;
    type Outputs = Out;

    fn check(&self) -> Result<(), NodeError> {
        match self.method {
            Method::Canny { low, high, .. } if low > high => Err(NodeError::param(
                "method.canny.low",
                format!("must not exceed high, found low = {low} and high = {high}"),
            )),
            _ => Ok(()),
        }
    }

    fn run(&self, inputs: In, _want: &Want, _ctx: &Context) -> Result<Out, NodeError> {
        let light = colour::light(&inputs.image.rgb);
        let edges = match self.method {
            Method::Gradient { sigma, quantile } => soft_edges(&light, sigma, quantile),
            Method::Canny { low, high, sigma } => canny::contours(&light, low as f32, high as f32, sigma),
        };
        Ok(Out { edges: Arc::new(edges) })
    }
}

/// Adds the node to a registry.
pub fn register(registry: &mut Registry) {
    registry.node::<EdgeDetect>();
}

#[cfg(test)]
mod tests;
