//! A number.

use crate::{Digest, Hasher, Summary, Value, ValueError};

/// One f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Number(pub f64);

impl Value for Number {
    const TYPE: &'static str = "Number";
    const DOC: &'static str = "One f64. A result may be infinite, never NaN: what is undefined is an error.";
    const EXTENSION: &'static str = "json";

    fn digest(&self) -> Digest {
        Hasher::new("Number").u64(self.0.to_bits()).finish()
    }

    fn size_bytes(&self) -> usize {
        8
    }

    fn encode(&self) -> Result<Vec<u8>, ValueError> {
        // JSON has no word for what is not finite; those travel as text.
        let text = if self.0.is_finite() {
            serde_json::Value::from(self.0).to_string()
        } else if self.0.is_nan() {
            format!("\"NaN:{:016x}\"", self.0.to_bits())
        } else {
            format!("\"{}\"", self.0)
        };
        Ok(text.into_bytes())
    }

    fn decode(bytes: &[u8]) -> Result<Self, ValueError> {
        let bad = |cause: &str| ValueError::new("Number", cause);
        match serde_json::from_slice(bytes).map_err(|e| bad(&e.to_string()))? {
            serde_json::Value::Number(n) => n.as_f64().map(Self).ok_or_else(|| bad("out of range")),
            serde_json::Value::String(text) => match text.as_str() {
                "inf" => Ok(Self(f64::INFINITY)),
                "-inf" => Ok(Self(f64::NEG_INFINITY)),
                other => other
                    .strip_prefix("NaN:")
                    .and_then(|bits| u64::from_str_radix(bits, 16).ok())
                    .map(|bits| Self(f64::from_bits(bits)))
                    .filter(|number| number.0.is_nan())
                    .ok_or_else(|| bad("expected a number")),
            },
            _ => Err(bad("expected a number")),
        }
    }

    fn summary(&self) -> Summary {
        let mut summary = Summary::new();
        summary.insert("value".into(), self.0.into());
        summary
    }

    fn flaw(&self) -> Option<String> {
        self.0.is_nan().then(|| "is not a number".to_owned())
    }

    fn extremes() -> Vec<(&'static str, Self)> {
        vec![
            ("zero", Self(0.0)),
            ("negative", Self(-1.0)),
            ("huge", Self(1e300)),
            ("tiny", Self(1e-300)),
            ("infinite", Self(f64::INFINITY)),
            ("minus infinite", Self(f64::NEG_INFINITY)),
            ("nan", Self(f64::NAN)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_extreme_survives_encoding() {
        for (name, number) in Number::extremes().into_iter().chain([("minus zero", Number(-0.0))]) {
            let back = Number::decode(&number.encode().unwrap()).unwrap();
            assert_eq!(back.digest(), number.digest(), "{name}");
        }
    }

    #[test]
    fn garbage_is_an_error() {
        for bytes in [&b""[..], b"{}", b"\"NaN:zz\"", b"\"NaN:0\"", b"\xff"] {
            assert!(Number::decode(bytes).is_err());
        }
    }
}
