//! Whether the painting is already lit like a solid thing.

use gear_graph::NodeError;
use gear_image::{Image, Mask, colour, filter};
use gear_relief::light::{self, Evidence};
use serde_json::json;

/// Contrast of shading that one light explains, from which on light counts as natural: a Lambertian body lit from
/// one side has .5 to 1, painted shading .1 to .2.
const NATURAL_GAIN: f32 = 0.5;

/// Share of the shading's variance that the light must explain as well.
const NATURAL_R2: f32 = 0.5;

/// β where grounding is due. 1 over-darkens shadows and lifts brush noise.
const GROUNDING_BETA: f64 = 0.5;

pub(crate) struct Found(Evidence);

/// Looks for natural light in the painting, inside its mask.
pub(crate) fn look(painting: &Image, mask: &Mask) -> Result<Found, NodeError> {
    let (width, height) = painting.size();
    if mask.is_empty() || width == 0 || height == 0 {
        return Err(NodeError::input(
            "mask",
            "expected a painting and a mask with pixels, found none",
        ));
    }
    let mask = filter::resize_mask(mask, width, height);
    Ok(Found(light::evidence(&colour::light(&painting.rgb), &mask)))
}

impl Found {
    pub fn is_natural(&self) -> bool {
        self.0.gain >= NATURAL_GAIN && self.0.r2 >= NATURAL_R2
    }

    /// What `beta: auto` is.
    pub fn beta(&self) -> f64 {
        if self.is_natural() { 0.0 } else { GROUNDING_BETA }
    }

    /// Why β is what it is, for people.
    pub fn sentence(&self, consequence: &str) -> String {
        let (verdict, sign) = if self.is_natural() {
            ("has natural light", "at least")
        } else {
            ("lacks natural light", "not both at least")
        };
        format!(
            "the painting {verdict} (gain {:.2} and r2 {:.2}, {sign} {NATURAL_GAIN} and {NATURAL_R2}): {consequence}",
            self.0.gain, self.0.r2
        )
    }

    pub fn report(&self, beta: f64) -> serde_json::Value {
        json!({
            "gain": self.0.gain,
            "r2": self.0.r2,
            "noise": self.0.noise,
            "trust": self.0.trust,
            "light": self.0.direction,
            "natural": self.is_natural(),
            "beta": beta,
        })
    }
}
