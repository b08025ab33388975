//! A type of value: the colours of a picture.

use gear_graph::{Digest, Hasher, Summary, Value, ValueError};
use serde::{Deserialize, Serialize};
use serde_json::json;

/// One colour and how much of the picture has it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tone {
    /// sRGB-encoded, 0 to 1.
    pub colour: [f32; 3],
    /// Share of the picture, 0 to 1.
    pub share: f64,
}

/// The colours of a picture, the most frequent first.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Palette(pub Vec<Tone>);

impl Value for Palette {
    const TYPE: &'static str = "Palette";
    const DOC: &'static str = "The colours of a picture, the most frequent first, each with its share (0 to 1).";
    const EXTENSION: &'static str = "json";

    fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("Palette");
        for tone in &self.0 {
            hasher.f32s(&tone.colour).u64(tone.share.to_bits());
        }
        hasher.finish()
    }

    fn size_bytes(&self) -> usize {
        size_of_val(self.0.as_slice())
    }

    fn encode(&self) -> Result<Vec<u8>, ValueError> {
        serde_json::to_vec_pretty(self).map_err(|e| ValueError::new("Palette", e.to_string()))
    }

    fn decode(bytes: &[u8]) -> Result<Self, ValueError> {
        serde_json::from_slice(bytes).map_err(|e| ValueError::new("Palette", e.to_string()))
    }

    fn summary(&self) -> Summary {
        let mut summary = Summary::new();
        summary.insert("tones".into(), json!(self.0.len()));
        for (i, tone) in self.0.iter().enumerate() {
            let [r, g, b] = tone.colour.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8);
            let share = (tone.share * 1000.0).round() / 1000.0;
            summary.insert(format!("{i}"), json!([format!("#{r:02x}{g:02x}{b:02x}"), share]));
        }
        summary
    }

    fn flaw(&self) -> Option<String> {
        let unit = |x: f64| (0.0..=1.0).contains(&x);
        let sound = |tone: &Tone| unit(tone.share) && tone.colour.iter().all(|&c| unit(c.into()));
        let bad = self.0.iter().filter(|tone| !sound(tone)).count();
        (bad > 0).then(|| format!("has {bad} tones that are not between 0 and 1"))
    }

    fn extremes() -> Vec<(&'static str, Self)> {
        let tone = |colour, share| Tone { colour, share };
        vec![
            ("empty", Self::default()),
            ("one tone", Self(vec![tone([0.2, 0.5, 0.8], 1.0)])),
            ("no share", Self(vec![tone([1.0; 3], 0.0)])),
            ("many", Self(vec![tone([0.5; 3], 1e-3); 1000])),
            ("out of range", Self(vec![tone([-1.0, 1e30, 0.5], 7.0)])),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_palette_survives_its_encoding() {
        gear_graph::testing::assert_codec(Palette::extremes().into_iter().map(|(_, palette)| palette));
    }
}
