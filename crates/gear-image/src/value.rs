//! How the rasters travel through a graph: digests, encodings, summaries, extreme cases.
//!
//! [`Image`] and [`Field`] are stored as uncompressed f32 OpenEXR, bit for bit, NaNs included; [`Mask`] as a
//! black and white PNG. An image's samples stay sRGB-encoded in its file (an attribute says so).

use std::io::Cursor;

use gear_graph::{AnyValue, Digest, Hasher, Numerics, Summary, Value, ValueError};
use image::{ExtendedColorType, ImageDecoder, ImageEncoder};
use serde_json::json;

use crate::{Field, Image, Mask, Rgb, exr_file, stats};

/// Raised whenever a filter, a colour function or an elementary function gives other bits.
pub(crate) const NUMERICS: Numerics = Numerics::new("gear-image", 1);

/// No stored raster is larger; a header that claims more is damaged.
const MOST_SAMPLES: usize = 1 << 31;

/// Six significant digits: what a person compares.
fn rounded(x: f64) -> serde_json::Value {
    if !x.is_finite() {
        return json!(x.to_string());
    }
    json!(format!("{x:.5e}").parse::<f64>().unwrap_or(x))
}

/// Range, mean and deviation of the finite samples, and how many are not finite.
fn describe(samples: &[f32]) -> serde_json::Value {
    let finite: Vec<f32>;
    let bad = samples.iter().filter(|x| !x.is_finite()).count();
    let kept = if bad == 0 {
        samples
    } else {
        finite = samples.iter().copied().filter(|x| x.is_finite()).collect();
        &finite
    };
    let (mean, deviation) = stats::mean_and_deviation(kept);
    let (low, high) = stats::range(kept).unwrap_or((0.0, 0.0));
    let mut out = json!({
        "min": rounded(low.into()), "max": rounded(high.into()),
        "mean": rounded(mean), "deviation": rounded(deviation),
    });
    if bad > 0 {
        out["not_finite"] = json!(bad);
    }
    out
}

/// The size of a raster of any of the three types.
fn size_of(value: &AnyValue) -> Option<(usize, usize)> {
    let image = value.get::<Image>().map(|image| image.size());
    let field = || value.get::<Field>().map(|field| field.size());
    let mask = || value.get::<Mask>().map(|mask| mask.size());
    image.or_else(field).or_else(mask)
}

/// Where the pixel `x` of a side of `to` pixels lies on a side of `from` pixels.
fn nearest(x: usize, to: usize, from: usize) -> usize {
    (x * from / to).min(from - 1)
}

fn channel<const C: usize>(pixels: &[[f32; 3]]) -> Vec<f32> {
    pixels.iter().map(|p| p[C]).collect()
}

impl Value for Field {
    const TYPE: &'static str = "Field";
    const DOC: &'static str = "One f32 a pixel. NaN is allowed, and means that there is nothing to say at the pixel (depth outside the figure).";
    const NUMERICS: Numerics = NUMERICS;
    const EXTENSION: &'static str = "exr";

    fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("Field");
        hasher
            .u64(self.width() as u64)
            .u64(self.height() as u64)
            .f32s(self.data());
        hasher.finish()
    }

    fn size_bytes(&self) -> usize {
        self.len() * 4
    }

    fn encode(&self) -> Result<Vec<u8>, ValueError> {
        exr_file::write(self.width(), self.height(), vec![("Y", self.data().to_vec())], "scalar")
            .map_err(|cause| ValueError::new("Field", cause))
    }

    fn decode(bytes: &[u8]) -> Result<Self, ValueError> {
        let error = |cause: String| ValueError::new("Field", cause);
        let mut file = exr_file::decode(bytes, MOST_SAMPLES).map_err(error)?;
        let data = file
            .take("Y")
            .ok_or_else(|| error("the EXR file has no channel Y".into()))?;
        Ok(Self::from_vec(file.width, file.height, data))
    }

    fn summary(&self) -> Summary {
        let mut out = Summary::new();
        out.insert("size".into(), json!([self.width(), self.height()]));
        out.insert("value".into(), describe(self.data()));
        out
    }

    fn flaw(&self) -> Option<String> {
        let infinite = self.data().iter().filter(|x| x.is_infinite()).count();
        (infinite > 0).then(|| format!("has {infinite} infinite samples of {}", self.len()))
    }

    fn extremes() -> Vec<(&'static str, Self)> {
        vec![
            ("one pixel", Self::filled(1, 1, 0.5)),
            ("one row", Self::from_fn(40, 1, |x, _| x as f32 / 39.0)),
            ("one column", Self::from_fn(1, 40, |_, y| y as f32 / 39.0)),
            ("zero", Self::filled(33, 20, 0.0)),
            ("step", Self::from_fn(48, 32, |x, _| if x < 20 { 0.0 } else { 1.0 })),
            ("checker", Self::from_fn(32, 32, |x, y| ((x + y) % 2) as f32)),
            (
                "one outlier",
                Self::from_fn(32, 24, |x, y| if (x, y) == (7, 9) { 1e30 } else { 0.1 }),
            ),
            (
                "tiny and huge",
                Self::from_fn(31, 17, |x, y| [1e-30, 1.0, 1e30][(x + y) % 3]),
            ),
            (
                "not finite",
                Self::from_fn(20, 20, |x, _| [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.5][x % 4]),
            ),
        ]
    }

    fn matched(&self, other: &AnyValue) -> Option<Self> {
        let (width, height) = size_of(other)?;
        let from = self.size();
        Some(Self::from_fn(width, height, |x, y| {
            self.at(nearest(x, width, from.0), nearest(y, height, from.1))
        }))
    }
}

impl Value for Image {
    const TYPE: &'static str = "Image";
    const DOC: &'static str = "A colour picture: sRGB-encoded f32 red, green and blue, nominally 0 to 1, and alpha if it had one. Every sample is finite.";
    const NUMERICS: Numerics = NUMERICS;
    const EXTENSION: &'static str = "exr";

    fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("Image");
        hasher.u64(self.rgb.width() as u64).u64(self.rgb.height() as u64);
        hasher.f32s(self.rgb.data().as_flattened());
        if let Some(alpha) = &self.alpha {
            hasher.f32s(alpha.data());
        }
        hasher.finish()
    }

    fn size_bytes(&self) -> usize {
        self.rgb.len() * 12 + self.alpha.as_ref().map_or(0, |a| a.len() * 4)
    }

    fn encode(&self) -> Result<Vec<u8>, ValueError> {
        let pixels = self.rgb.data();
        let mut planes = vec![
            ("R", channel::<0>(pixels)),
            ("G", channel::<1>(pixels)),
            ("B", channel::<2>(pixels)),
        ];
        if let Some(alpha) = &self.alpha {
            planes.push(("A", alpha.data().to_vec()));
        }
        exr_file::write(self.rgb.width(), self.rgb.height(), planes, "sRGB-encoded")
            .map_err(|cause| ValueError::new("Image", cause))
    }

    fn decode(bytes: &[u8]) -> Result<Self, ValueError> {
        let error = |cause: String| ValueError::new("Image", cause);
        let mut file = exr_file::decode(bytes, MOST_SAMPLES).map_err(error)?;
        let mut plane = |name: &str| {
            file.take(name)
                .ok_or_else(|| ValueError::new("Image", format!("the EXR file has no channel {name}")))
        };
        let (r, g, b) = (plane("R")?, plane("G")?, plane("B")?);
        let alpha = plane("A").ok().map(|a| Field::from_vec(file.width, file.height, a));
        let pixels = r.iter().zip(&g).zip(&b).map(|((&r, &g), &b)| [r, g, b]).collect();
        Ok(Self {
            rgb: Rgb::from_vec(file.width, file.height, pixels),
            alpha,
        })
    }

    fn summary(&self) -> Summary {
        let pixels = self.rgb.data();
        let mut out = Summary::new();
        out.insert("size".into(), json!([self.rgb.width(), self.rgb.height()]));
        out.insert("red".into(), describe(&channel::<0>(pixels)));
        out.insert("green".into(), describe(&channel::<1>(pixels)));
        out.insert("blue".into(), describe(&channel::<2>(pixels)));
        if let Some(alpha) = &self.alpha {
            out.insert("alpha".into(), describe(alpha.data()));
        }
        out
    }

    fn flaw(&self) -> Option<String> {
        let finite = |samples: &[f32]| samples.iter().filter(|x| !x.is_finite()).count();
        let bad = finite(self.rgb.data().as_flattened()) + self.alpha.as_ref().map_or(0, |a| finite(a.data()));
        (bad > 0).then(|| format!("has {bad} samples that are not finite"))
    }

    fn extremes() -> Vec<(&'static str, Self)> {
        let grey = |v: f32| Self::opaque(Rgb::filled(40, 60, [v; 3]));
        let picture = |x: usize, y: usize| {
            let f = |k: usize| ((x * 37 + y * 101 + k * 53 + x * y * k) % 255) as f32 / 254.0;
            [f(1), f(2), f(3)]
        };
        let of = |w, h| Self::opaque(Rgb::from_fn(w, h, picture));
        let mut bad = Rgb::from_fn(40, 30, picture);
        bad.set(4, 3, [f32::NAN; 3]);
        bad.set(6, 5, [f32::INFINITY, 0.2, 0.1]);
        bad.set(8, 7, [f32::NEG_INFINITY, -0.5, 0.1]);
        let hdr = Rgb::from_fn(40, 30, |x, y| {
            let power = (x * 7 + y * 13) % 26;
            [
                libm::exp10(power as f64 - 13.0) as f32,
                0.5,
                libm::exp10(12.0 - power as f64) as f32,
            ]
        });
        let clear = Field::from_fn(24, 24, |x, _| if x < 12 { 0.0 } else { 0.5 });
        vec![
            ("one pixel", of(1, 1)),
            ("two by two", of(2, 2)),
            ("three by five", of(5, 3)),
            ("noise", of(48, 36)),
            ("one row", of(400, 1)),
            ("one column", of(1, 400)),
            ("black", grey(0.0)),
            ("white", grey(1.0)),
            ("constant", grey(0.2)),
            (
                "black and white",
                Self::opaque(Rgb::from_fn(60, 40, |x, _| [if x < 30 { 0.0 } else { 1.0 }; 3])),
            ),
            ("not finite", Self::opaque(bad)),
            ("high dynamic range", Self::opaque(hdr)),
            (
                "half transparent",
                Self {
                    rgb: Rgb::from_fn(24, 24, picture),
                    alpha: Some(clear),
                },
            ),
        ]
    }

    fn matched(&self, other: &AnyValue) -> Option<Self> {
        let (width, height) = size_of(other)?;
        let from = self.size();
        Some(Self {
            rgb: Rgb::from_fn(width, height, |x, y| {
                self.rgb.at(nearest(x, width, from.0), nearest(y, height, from.1))
            }),
            alpha: self.alpha.as_ref().and_then(|alpha| alpha.matched(other)),
        })
    }
}

impl Value for Mask {
    const TYPE: &'static str = "Mask";
    const DOC: &'static str = "Inside or outside, a bit a pixel.";
    const NUMERICS: Numerics = NUMERICS;
    const EXTENSION: &'static str = "png";

    fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("Mask");
        let bytes: Vec<u8> = self.data().iter().map(|&inside| u8::from(inside)).collect();
        hasher.u64(self.width() as u64).u64(self.height() as u64).bytes(&bytes);
        hasher.finish()
    }

    fn size_bytes(&self) -> usize {
        self.len()
    }

    fn encode(&self) -> Result<Vec<u8>, ValueError> {
        let error = |cause: String| ValueError::new("Mask", cause);
        let bytes: Vec<u8> = self.data().iter().map(|&inside| if inside { 255 } else { 0 }).collect();
        let side = |n: usize| u32::try_from(n).map_err(|_| error(format!("a side of {n} pixels is too long")));
        let mut out = Vec::new();
        image::codecs::png::PngEncoder::new(&mut out)
            .write_image(&bytes, side(self.width())?, side(self.height())?, ExtendedColorType::L8)
            .map_err(|e| error(e.to_string()))?;
        Ok(out)
    }

    fn decode(bytes: &[u8]) -> Result<Self, ValueError> {
        let error = |cause: String| ValueError::new("Mask", cause);
        let decoder = image::codecs::png::PngDecoder::new(Cursor::new(bytes)).map_err(|e| error(e.to_string()))?;
        let (width, height) = decoder.dimensions();
        let samples = u64::from(width) * u64::from(height);
        if decoder.color_type() != image::ColorType::L8 || samples > MOST_SAMPLES as u64 {
            return Err(error(format!(
                "expected an 8-bit grey PNG, found {width}x{height} {:?}",
                decoder.color_type()
            )));
        }
        let mut grey = vec![0; samples as usize];
        decoder.read_image(&mut grey).map_err(|e| error(e.to_string()))?;
        Ok(Self::from_vec(
            width as usize,
            height as usize,
            grey.iter().map(|&v| v >= 128).collect(),
        ))
    }

    fn summary(&self) -> Summary {
        let mut out = Summary::new();
        out.insert("size".into(), json!([self.width(), self.height()]));
        out.insert("inside".into(), json!(self.count()));
        out.insert("share".into(), rounded(self.count() as f64 / self.len().max(1) as f64));
        out
    }

    fn extremes() -> Vec<(&'static str, Self)> {
        vec![
            ("one pixel", Self::filled(1, 1, true)),
            ("empty", Self::filled(40, 60, false)),
            ("full", Self::filled(40, 60, true)),
            ("one inside", Self::from_fn(40, 60, |x, y| (x, y) == (11, 13))),
            ("thin line", Self::from_fn(40, 60, |x, _| x == 20)),
            ("checker", Self::from_fn(40, 60, |x, y| (x + y) % 2 == 0)),
            (
                "ring",
                Self::from_fn(64, 64, |x, y| {
                    (200..600).contains(&(x.abs_diff(32).pow(2) + y.abs_diff(32).pow(2)))
                }),
            ),
        ]
    }

    fn matched(&self, other: &AnyValue) -> Option<Self> {
        let (width, height) = size_of(other)?;
        let from = self.size();
        Some(Self::from_fn(width, height, |x, y| {
            self.at(nearest(x, width, from.0), nearest(y, height, from.1))
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn survives<V: Value>() {
        for (name, value) in V::extremes() {
            let bytes = value.encode().unwrap();
            let back = V::decode(&bytes).unwrap();
            assert_eq!(back.digest(), value.digest(), "{} {name}", V::TYPE);
            assert!(!value.summary().is_empty() && value.size_bytes() > 0);
        }
    }

    #[test]
    fn every_extreme_survives_storing_bit_for_bit() {
        survives::<Field>();
        survives::<Image>();
        survives::<Mask>();
    }

    #[test]
    fn an_extreme_is_matched_to_another_raster_by_its_size() {
        let image = AnyValue::new(Image::opaque(Rgb::filled(5, 7, [0.0; 3])));
        for (name, mask) in Mask::extremes() {
            let matched = mask.matched(&image).unwrap();
            assert_eq!(matched.size(), (5, 7), "{name}");
            assert_eq!(
                matched.matched(&AnyValue::new(mask.clone())).unwrap().size(),
                mask.size()
            );
        }
        let ramp = Field::from_fn(10, 1, |x, _| x as f32);
        assert_eq!(ramp.matched(&image).unwrap().row(3), [0.0, 2.0, 4.0, 6.0, 8.0]);
        assert!(ramp.matched(&AnyValue::new(gear_graph::Number(1.0))).is_none());
    }

    #[test]
    fn what_is_not_finite_is_a_flaw_except_nothing_in_a_field() {
        assert!(Field::filled(2, 2, f32::NAN).flaw().is_none());
        assert!(Field::filled(2, 2, f32::INFINITY).flaw().is_some());
        assert!(Image::opaque(Rgb::filled(2, 2, [1e30; 3])).flaw().is_none());
        assert!(Image::opaque(Rgb::filled(2, 2, [f32::NAN; 3])).flaw().is_some());
    }

    #[test]
    fn digests_tell_shape_alpha_and_samples_apart() {
        let field = |w, h| Field::filled(w, h, 0.5).digest();
        assert_ne!(field(2, 3), field(3, 2));
        let rgb = Rgb::filled(2, 2, [0.5; 3]);
        let solid = Image {
            rgb: rgb.clone(),
            alpha: Some(Field::filled(2, 2, 1.0)),
        };
        assert_ne!(Image::opaque(rgb).digest(), solid.digest());
        assert_ne!(Mask::filled(2, 2, true).digest(), Mask::filled(2, 2, false).digest());
    }

    proptest! {
        #[test]
        fn damaged_bytes_are_an_error_or_a_value_but_never_a_panic(at in 0usize..2000, to in any::<u8>(), cut in 0usize..4000) {
            let mut bytes = Image::opaque(Rgb::filled(7, 5, [0.25; 3])).encode().unwrap();
            let n = bytes.len();
            bytes[at % n] = to;
            let _ = Image::decode(&bytes);
            let _ = Field::decode(&bytes[..cut.min(n)]);
            let mut bytes = Mask::filled(9, 9, true).encode().unwrap();
            let n = bytes.len();
            bytes[at % n] = to;
            let _ = Mask::decode(&bytes);
            let _ = Mask::decode(&bytes[..cut.min(n)]);
        }
    }
}
