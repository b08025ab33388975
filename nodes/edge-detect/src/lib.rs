//! Edge maps: where the translation keeps contours and where illumination must not leak across.
//!
//! `gradient` is the soft colour gradient of [`gear_image::edges`]; `canny` (Canny 1986) are binary contours of the
//! luminance: blur, gradient, the ridge of its magnitude, and hysteresis between two thresholds. Contours are then
//! widened by a pixel: as weights of the illumination pyramid, lines one pixel wide hardly stop leakage. `network` asks
//! an edge network, such as PiDiNet, that the graph has as an input of type `Model`.

mod canny;

use std::sync::Arc;

use gear_graph::{
    Choice, Context, Demand, Inputs, Known, Lazy, Node, NodeError, Outputs, Params, Registry, Resources, Want,
};
use gear_image::edges::soft_edges;
use gear_image::{Field, Image, colour};
use gear_onnx::{Given, Model, Provider};

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
    /// What an edge network says; its declaration says `answer: edges`.
    Network {
        /// What computes it.
        #[param(default = Provider::Cpu)]
        provider: Provider,
    },
}

/// Input ports.
#[derive(Inputs)]
pub struct In {
    /// The picture.
    pub image: Arc<Image>,
    /// The network, for the method `network`.
    pub model: Option<Lazy<Model>>,
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

    fn realm(&self, resources: &Resources) -> String {
        match self.method {
            Method::Network { provider } => gear_onnx::realm(resources, provider),
            Method::Gradient { .. } | Method::Canny { .. } => "cpu".to_owned(),
        }
    }

    fn demand(&self, _output: &str, known: &Known<'_>) -> Result<Demand, NodeError> {
        match self.method {
            Method::Network { .. } => gear_onnx::demand(known),
            Method::Gradient { .. } | Method::Canny { .. } => Ok(Demand::ready_because("the method is no network")),
        }
    }

    fn run(&self, inputs: In, _want: &Want, ctx: &Context) -> Result<Out, NodeError> {
        let light = colour::light(&inputs.image.rgb);
        let edges = match self.method {
            Method::Gradient { sigma, quantile } => soft_edges(&light, sigma, quantile),
            Method::Canny { low, high, sigma } => canny::contours(&light, low as f32, high as f32, sigma),
            Method::Network { provider } => network(&inputs, provider, ctx)?,
        };
        Ok(Out { edges: Arc::new(edges) })
    }
}

/// The contours that the network sees.
fn network(inputs: &In, provider: Provider, ctx: &Context) -> Result<Field, NodeError> {
    let model = gear_onnx::required(&inputs.model)?;
    model.declaration().expect(&["edges"])?;
    let given = Given {
        rgb: &inputs.image.rgb,
        planes: &[],
    };
    let mut fields = gear_onnx::answer(model, provider, given, ctx)?;
    // An answer has as many fields as it declares: one.
    Ok(fields.swap_remove(0))
}

/// Adds the node to a registry.
pub fn register(registry: &mut Registry) {
    registry.node::<EdgeDetect>();
}

#[cfg(test)]
mod tests;
