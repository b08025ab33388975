//! Whether the painting is already lit like a solid thing.

use gear_graph::NodeError;
use gear_image::{Image, Mask, colour, filter};
use gear_relief::light::{self, Evidence};
use serde_json::json;

/// Trust in the shading (see [`gear_relief::light`]) up to which a picture is not lit at all, and from which on its light
/// is natural. On the benchmark of painted scenes, medians are .00 and .01 for flat and painted figures and .25 for
/// photographed ones, .04, .18 and .67 for vessels.
const TRUST: [f32; 2] = [0.1, 0.25];

/// β of a picture without light. 1 over-darkens shadows and lifts brush noise.
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
        self.0.trust >= TRUST[1]
    }

    /// What `beta: auto` is: less, the more natural the light.
    pub fn beta(&self) -> f64 {
        let lacking = f64::from((TRUST[1] - self.0.trust) / (TRUST[1] - TRUST[0])).clamp(0.0, 1.0);
        GROUNDING_BETA * lacking
    }

    /// How much of the grounding is due, in [0, 1].
    pub fn due(&self) -> f64 {
        self.beta() / GROUNDING_BETA
    }

    /// Why β is what it is, for people.
    pub fn sentence(&self, consequence: &str) -> String {
        let (verdict, sign) = if self.is_natural() {
            ("has natural light", "at least")
        } else {
            ("lacks natural light", "below")
        };
        format!(
            "the painting {verdict} (gain {:.2} and r2 {:.2}, trust {:.2}, {sign} {}): {consequence}",
            self.0.gain, self.0.r2, self.0.trust, TRUST[1]
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
