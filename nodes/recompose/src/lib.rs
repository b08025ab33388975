//! Recomposition of the grounded image (paper, Eq. 10–13), in gain form.
//!
//! The paper splits the painting into albedo A = I/(L + ε) and luminance L, lights it anew by
//! L_out = L·exp(β R), and adds back high frequencies HF. Multiplied out, which avoids logarithms of zero:
//!
//! ```text
//! G    = L/(L + ε) · exp(clamp(β R, −80, 80))           I_g = gamut(G·I) + s·HF
//! HF   = k (I − G_σ ∗ I)                                 0 ≤ s ≤ 1 the largest that stays in gamut
//! ```
//!
//! all in linear light. A and L_out themselves are outputs on demand. ε here is not that of the log ratio: at
//! β = 0 the image should be itself, and the largest encoded error is 4·10⁻⁵ for ε = 10⁻⁶ but 3·10⁻² for 10⁻³.
//!
//! # When the painting already has natural light
//!
//! Grounding repairs pictures whose shading says too little about shape. On pictures with true shading it does harm:
//! measured on rendered photographs, the normals' error rises from 13.5° to 14.4°. With `beta: auto` the node first
//! looks for natural light in painting and mask; the better one light explains the shading, the smaller is β, and where
//! it does so well, β is 0, exp(0) = 1, and the ratio, with the whole chain behind it, is never asked for.

mod evidence;
mod gamut;
mod steps;

use std::sync::Arc;

use gear_graph::{
    Context, Demand, Inputs, Known, Lazy, Node, NodeError, Numerics, OrAuto, Outputs, Params, Registry, Report, Want,
    Wanted,
};
use gear_image::{Field, Image, Mask, colour};

pub use gamut::Gamut;
pub use steps::{Recipe, albedo, grounded, luminance};

/// The painting in the light of a geometry-friendly version of itself.
///
/// Feed it the painting, its mask, and the illumination ratio of the translated picture.
#[derive(Clone, Debug, Params)]
pub struct Recompose {
    /// β, how much of the illumination ratio is applied. 0 leaves the painting's light; `auto` is 0.5 when the
    /// painting shows no light, less as its light is more natural, and 0 when it is. 1 over-darkens shadows.
    #[param(default = OrAuto::Auto)]
    pub beta: OrAuto<f64>,

    /// How colours are brought into [0, 1].
    #[param(default = Gamut::Soft { knee: 0.8 })]
    pub gamut: Gamut,

    /// k, share of the painting's high frequencies that is added; with `beta: auto` as much less as β is.
    #[param(default = 0.5, range = 0.0..=10.0)]
    pub detail: f64,

    /// σ of the high-pass filter; at least 0.6 pixels.
    #[param(default = 0.004, range = 0.0..=0.1, unit = "share of the longer side")]
    pub detail_radius: f64,

    /// ε, what is added to the luminance that albedo is divided by.
    #[param(default = 1e-6, above = 0.0, range = 0.0..=0.1)]
    pub epsilon: f64,
}

/// Input ports.
#[derive(Inputs)]
pub struct In {
    /// The painting.
    pub painting: Arc<Image>,
    /// Its foreground; looked at for evidence of natural light.
    pub mask: Lazy<Mask>,
    /// The illumination ratio R to apply; brought to the painting's size.
    pub ratio: Lazy<Field>,
}

/// Output ports.
#[derive(Outputs)]
pub struct Out {
    /// The grounded image.
    pub grounded: Wanted<Image>,
    /// The painting's colour without its luminance, I/(L + ε); sRGB-encoded, may exceed 1.
    pub albedo: Wanted<Image>,
    /// The luminance to which the albedo is lit, L·exp(βR), linear.
    pub luminance: Wanted<Field>,
    /// How natural the painting's light is, and the β that was used.
    pub evidence: Wanted<Report>,
}

impl Node for Recompose {
    const NAME: &str = "Recompose";
    const VERSION: u32 = 3;
    const USES: &'static [Numerics] = &[Numerics::new("gear-relief", gear_relief::NUMERICS)];
    type Inputs = In;
    type Outputs = Out;

    fn demand(&self, output: &str, known: &Known<'_>) -> Result<Demand, NodeError> {
        Ok(match (output, self.beta) {
            ("albedo", _) => Demand::ready_because("albedo does not depend on illumination"),
            ("evidence", _) => known.need(&["mask"], "evidence is looked for inside it"),
            (_, OrAuto::Value(0.0)) => Demand::ready_because("beta = 0 leaves the painting's light: exp(0) = 1"),
            (_, OrAuto::Value(_)) => known.need(&["ratio"], "beta is not 0"),
            (_, OrAuto::Auto) if !known.has("mask") => known.need(&["mask"], "beta = auto looks for natural light"),
            (_, OrAuto::Auto) => {
                let found = evidence::look(&*known.get::<Image>("painting")?, &*known.get::<Mask>("mask")?)?;
                if found.is_natural() {
                    Demand::ready_because(found.sentence("beta = 0"))
                } else {
                    known.need(&["ratio"], found.sentence(&format!("beta = {:.2}", found.beta())))
                }
            }
        })
    }

    fn run(&self, inputs: In, want: &Want, ctx: &Context) -> Result<Out, NodeError> {
        let painting = &inputs.painting;
        let relit = want.has("grounded") || want.has("luminance");
        let found = if want.has("evidence") || (relit && self.beta == OrAuto::Auto) {
            Some(evidence::look(painting, inputs.mask.demanded()?)?)
        } else {
            None
        };
        let beta = match (self.beta, &found) {
            (OrAuto::Value(beta), _) => beta,
            (OrAuto::Auto, Some(found)) => found.beta(),
            (OrAuto::Auto, None) => 0.0, // only albedo is wanted
        };
        ctx.checkpoint()?;
        let ratio = match relit && beta != 0.0 {
            true => Some(steps::fitted(inputs.ratio.demanded()?, painting)?),
            false => None,
        };
        let mut recipe = self.recipe(beta);
        if let (OrAuto::Auto, Some(found)) = (self.beta, &found) {
            // Sharpening alone would cost a picture that is well lit detail of its surface (measured on figures: .03).
            recipe.detail *= found.due() as f32;
            if found.is_natural() {
                ctx.note(
                    found.sentence("beta = 0, the light stays as it is painted; beta=0.5 grounds it all the same"),
                );
            }
        }
        Ok(Out {
            grounded: want.compute("grounded", || Image {
                rgb: grounded(&painting.rgb, ratio.as_deref(), &recipe),
                alpha: painting.alpha.clone(),
            }),
            albedo: want.compute("albedo", || Image {
                rgb: albedo(&colour::light(&painting.rgb), recipe.epsilon),
                alpha: painting.alpha.clone(),
            }),
            luminance: want.compute("luminance", || {
                luminance(&colour::light(&painting.rgb), ratio.as_deref(), recipe.beta)
            }),
            evidence: want.try_compute("evidence", || match &found {
                Some(found) => Ok::<_, NodeError>(Report::new(found.report(beta))?),
                None => Err(NodeError::new("evidence is wanted but was not looked for")),
            })?,
        })
    }
}

impl Recompose {
    /// The parameters as the steps take them, once β is known.
    pub fn recipe(&self, beta: f64) -> Recipe {
        Recipe {
            beta: beta.clamp(-1e30, 1e30) as f32,
            gamut: self.gamut.clone(),
            detail: self.detail as f32,
            detail_radius: self.detail_radius,
            epsilon: self.epsilon as f32,
        }
    }
}

/// Adds the node to a registry.
pub fn register(registry: &mut Registry) {
    registry.node::<Recompose>();
}

#[cfg(test)]
mod tests;
