//! What tests of image nodes share: small procedural rasters, and oracles made outside of this program.
//!
//! The rasters are made from integers only, so that another language makes exactly the same ones; the oracle files
//! say by what they were made.

use serde_json::Value as Json;

use crate::{Field, Image, Rgb};

/// Width and height of the sample rasters.
pub const SAMPLE_SIZE: (usize, usize) = (61, 43);

fn in_disc(x: usize, y: usize) -> usize {
    usize::from(x.abs_diff(30).pow(2) + y.abs_diff(21).pow(2) < 200)
}

fn encoded(code: usize) -> f32 {
    code.min(255) as f32 / 255.0
}

/// A painting-like picture: coloured ramps, a brighter disc, grain.
pub fn sample_painting() -> Image {
    Image::opaque(Rgb::from_fn(SAMPLE_SIZE.0, SAMPLE_SIZE.1, |x, y| {
        let grain = |c: usize| (x * 7919 + y * 104_729 + c * 31) % 23;
        [0, 1, 2].map(|c| encoded((x * 3 + y * 2 + 40 * c) % 160 + 60 * in_disc(x, y) + grain(c)))
    }))
}

/// Its stand-in for a translated picture: grey ramps and the disc.
pub fn sample_translation() -> Image {
    Image::opaque(Rgb::from_fn(SAMPLE_SIZE.0, SAMPLE_SIZE.1, |x, y| {
        [encoded((x * 2 + y * 4) % 200 + 40 * in_disc(x, y)); 3]
    }))
}

/// A rough field in [−2, 2].
pub fn sample_field() -> Field {
    Field::from_fn(SAMPLE_SIZE.0, SAMPLE_SIZE.1, |x, y| {
        ((x * 31 + y * 57 + x * y) % 101) as f32 / 25.0 - 2.0
    })
}

/// One upright contour, three pixels wide on either side.
pub fn sample_edges() -> Field {
    Field::from_fn(SAMPLE_SIZE.0, SAMPLE_SIZE.1, |x, _| {
        (1.0 - x.abs_diff(30) as f32 / 3.0).max(0.0)
    })
}

/// Results made outside of this program: a JSON object whose entries hold `values` (every `step`-th), their `mean`
/// before thinning, and the `tolerance` on each value.
pub struct Oracle(Json);

impl Oracle {
    /// Parses the file.
    ///
    /// # Panics
    /// If it is not JSON.
    pub fn parse(text: &str) -> Self {
        Self(serde_json::from_str(text).expect("an oracle file is JSON"))
    }

    /// A single number.
    ///
    /// # Panics
    /// If the file has no such number.
    pub fn number(&self, name: &str) -> f64 {
        self.0[name].as_f64().expect("the oracle has this number")
    }

    /// Compares samples with the entry `name`.
    ///
    /// # Panics
    /// If there is no such entry, or a sample is off by more than its tolerance.
    pub fn check(&self, name: &str, samples: &[f32]) {
        let number = |json: &Json| json.as_f64().expect("a number in an oracle");
        let entry = &self.0[name];
        let step = number(&self.0["step"]) as usize;
        let tolerance = number(&entry["tolerance"]);
        let values = entry["values"]
            .as_array()
            .unwrap_or_else(|| panic!("the oracle has no `{name}`"));
        assert_eq!(values.len(), samples.len().div_ceil(step), "{name}: number of samples");
        for (i, (expected, found)) in values.iter().map(number).zip(samples.iter().step_by(step)).enumerate() {
            let error = (f64::from(*found) - expected).abs();
            assert!(
                error <= tolerance,
                "{name}[{}] is {found}, expected {expected} ± {tolerance}",
                i * step
            );
        }
        let mean = crate::stats::mean(samples);
        assert!(
            (mean - number(&entry["mean"])).abs() <= tolerance,
            "the mean of {name} is {mean}"
        );
    }
}
