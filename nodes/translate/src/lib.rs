//! Translate: a version of the painting whose light shows geometry, with every contour in its place.
//!
//! Embedded styles stand for a text-guided translator: `sculpture` carves a relief from the painting (with the
//! calibration for paintings, which takes faint shading seriously) and lights it like marble; `pencil-sketch` and
//! `woodcut` draw its tone with line integrals along the contours. Lengths in pixels refer to a picture of
//! 512 px and grow with it. `network` asks an image-to-image network that the graph has as an input of type `Model`.

mod lines;
mod network;
mod pencil;
mod sculpture;
mod woodcut;

use std::sync::Arc;

use gear_graph::{
    Choice, Context, Demand, Inputs, Known, Lazy, Node, NodeError, Numerics, Outputs, Params, Registry, Resources, Want,
};
use gear_image::{Field, Image, Mask, SrgbImage, colour, filter};
use gear_onnx::{Model, Provider};

/// A geometry-friendly picture of the painting.
#[derive(Clone, Debug, Params)]
pub struct Translate {
    /// What the picture is made of.
    #[param(default = Style::Sculpture)]
    pub style: Style,
    /// How strongly the edge map is drawn into sketch and woodcut.
    #[param(default = 0.3, range = 0.0..=1.0)]
    pub contours: f64,
    /// Seed of the graphite's grain.
    #[param(default = 7, range = 0..=1_000_000_000)]
    pub seed: u64,
}

/// What the picture is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum Style {
    /// Marble relief, lit as the painting is.
    Sculpture,
    /// Graphite lines and hatching.
    PencilSketch,
    /// Black and white cuts that follow the form.
    Woodcut,
    /// The painting itself, untouched.
    None,
    /// What an image-to-image network makes of it; its declaration says `answer: picture`.
    Network {
        /// What computes it.
        #[param(default = Provider::Cpu)]
        provider: Provider,
    },
}

/// Input ports.
#[derive(Inputs)]
pub struct In {
    /// The painting.
    pub image: Arc<Image>,
    /// Contour strength in [0, 1]; for drawn styles only.
    pub edges: Lazy<Field>,
    /// What belongs to the object; for sculpture only. Full or empty means a relief of the whole canvas.
    pub mask: Lazy<Mask>,
    /// The network, for the style `network`.
    pub model: Option<Lazy<Model>>,
}

/// Output ports.
#[derive(Outputs)]
pub struct Out {
    /// The translated picture, the size of the painting.
    pub image: Arc<Image>,
}

impl Node for Translate {
    const NAME: &str = "Translate";
    const VERSION: u32 = 2;
    const USES: &'static [Numerics] = &[Numerics::new("gear-relief", gear_relief::NUMERICS)];
    type Inputs = In;
    type Outputs = Out;

    fn realm(&self, resources: &Resources) -> String {
        match self.style {
            Style::Network { provider } => gear_onnx::realm(resources, provider),
            _ => "cpu".to_owned(),
        }
    }

    fn demand(&self, _output: &str, known: &Known<'_>) -> Result<Demand, NodeError> {
        let answer = match self.style {
            Style::Network { .. } => return network::demand(known),
            Style::None => Demand::ready_because("style is none: the painting passes"),
            Style::Sculpture => known.need(&["mask"], "a sculpture is cut out by the mask"),
            Style::PencilSketch | Style::Woodcut if self.contours == 0.0 => {
                Demand::ready_because("contours = 0 and the whole canvas is drawn")
            }
            Style::PencilSketch | Style::Woodcut => known.need(&["edges"], "contours are drawn"),
        };
        Ok(match (answer, self.style) {
            (Demand::Ready { reason }, Style::Sculpture) if reason.is_empty() => {
                Demand::ready_because("style sculpture does not look at edges")
            }
            (Demand::Ready { reason }, _) if reason.is_empty() => {
                Demand::ready_because("drawn styles do not look at the mask")
            }
            (answer, _) => answer,
        })
    }

    fn run(&self, inputs: In, _want: &Want, ctx: &Context) -> Result<Out, NodeError> {
        let painting = inputs.image;
        let (width, height) = painting.size();
        if self.style == Style::None || width == 0 || height == 0 {
            return Ok(Out {
                image: all_finite(painting),
            });
        }
        let edges = match inputs.edges.get() {
            Some(edges) if edges.is_empty() => None,
            Some(edges) => Some(filter::resize(edges, width, height)),
            None => None,
        };
        let rgb = match self.style {
            Style::None => painting.rgb.clone(),
            Style::Network { provider } => {
                let model = gear_onnx::required(&inputs.model)?;
                network::translate(&painting, model, provider, edges.as_ref(), inputs.mask.get(), ctx)?
            }
            Style::Sculpture => {
                let mask = match inputs.mask.get() {
                    Some(mask) if !mask.is_empty() => filter::resize_mask(mask, width, height),
                    _ => Mask::filled(width, height, true),
                };
                sculpture::carve(&painting.rgb, &mask)
            }
            Style::PencilSketch => grey(&self.with_contours(pencil::sketch(&painting.rgb, self.seed), edges.as_ref())),
            Style::Woodcut => grey(&self.with_contours(woodcut::cut(&painting.rgb), edges.as_ref())),
        };
        ctx.checkpoint()?;
        Ok(Out {
            image: Arc::new(Image {
                rgb,
                alpha: painting.alpha.clone(),
            }),
        })
    }
}

impl Translate {
    /// Darkens by the edge map.
    fn with_contours(&self, mut drawing: Field, edges: Option<&Field>) -> Field {
        let strength = self.contours as f32;
        if let Some(edges) = edges {
            for (tone, edge) in drawing.data_mut().iter_mut().zip(edges.data()) {
                // An edge that is no number is none.
                let edge = if *edge > 0.0 { edge.min(1.0) } else { 0.0 };
                *tone *= 1.0 - strength * edge;
            }
        }
        drawing
    }
}

/// The painting itself, unless samples of it are not finite: these are made so.
fn all_finite(painting: Arc<Image>) -> Arc<Image> {
    if painting.rgb.data().as_flattened().iter().all(|x| x.is_finite()) {
        return painting;
    }
    let mut painted = (*painting).clone();
    for sample in painted.rgb.data_mut().as_flattened_mut() {
        if !sample.is_finite() {
            *sample = colour::sanitise_sample(*sample);
        }
    }
    Arc::new(painted)
}

fn grey(tones: &Field) -> SrgbImage {
    SrgbImage::from_vec(
        tones.width(),
        tones.height(),
        tones.data().iter().map(|&t| [t; 3]).collect(),
    )
}

/// A length that is `px` in a picture of 512 px, at least .6.
fn length(px: f64, side: usize) -> f64 {
    (px * side as f64 / 512.0).max(0.6)
}

/// Adds the node to a registry.
pub fn register(registry: &mut Registry) {
    registry.node::<Translate>();
}

#[cfg(test)]
mod tests;
