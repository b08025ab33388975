//! How far apart two values are, in the norms of their type.
//!
//! | type | norms |
//! |---|---|
//! | Field, Image, Mask | `max`, `rms`, `mean` of the absolute difference, `rel-l2` = ‖a − b‖₂ / ‖b‖₂ |
//! | Views | the same over the colours of all views |
//! | Scene | the same over the centres, if there are as many Gaussians |
//! | Number, Report | `abs` of a number |
//!
//! Samples that are NaN in both ("nothing here") are left out; those that are NaN in one are left out and counted.
//! Sums run in f64 in the order of the samples.

use gear_graph::{AnyValue, Number, Report, Summary};
use gear_image::{Field, Image, Mask};
use gear_splat::{Scene, Views};

/// The difference of two sets of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distance {
    /// Largest absolute difference.
    pub max: f64,
    /// Root of the mean square difference.
    pub rms: f64,
    /// Mean absolute difference.
    pub mean: f64,
    /// Root of the sum of squares, relative to that of the second value; infinite where the second is 0 and the first
    /// is not.
    pub relative: f64,
    /// How many samples were compared.
    pub samples: usize,
    /// How many samples are a number in one value only.
    pub unmatched: usize,
}

/// A norm, by its name in files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Norm {
    /// Largest absolute difference.
    Max,
    /// Root mean square.
    Rms,
    /// Mean absolute difference.
    Mean,
    /// Relative root of squares.
    RelativeL2,
    /// Absolute difference of two numbers.
    Abs,
}

impl Norm {
    /// The names of all.
    pub const NAMES: [&'static str; 5] = ["max", "rms", "mean", "rel-l2", "abs"];

    /// The norm of that name.
    pub fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "max" => Self::Max,
            "rms" => Self::Rms,
            "mean" => Self::Mean,
            "rel-l2" => Self::RelativeL2,
            "abs" => Self::Abs,
            _ => return None,
        })
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Max => "max",
            Self::Rms => "rms",
            Self::Mean => "mean",
            Self::RelativeL2 => "rel-l2",
            Self::Abs => "abs",
        }
    }

    /// The difference in this norm.
    pub fn of(self, distance: &Distance) -> f64 {
        match self {
            Self::Max => distance.max,
            Self::Rms => distance.rms,
            Self::Mean | Self::Abs => distance.mean,
            Self::RelativeL2 => distance.relative,
        }
    }
}

/// The distance of two lists of samples of one length.
pub fn distance(pairs: impl Iterator<Item = (f64, f64)>) -> Distance {
    let mut found = Distance::default();
    let (mut squares, mut of_b, mut sum) = (0.0, 0.0, 0.0);
    for (a, b) in pairs {
        match (a.is_nan(), b.is_nan()) {
            (true, true) => continue,
            (false, false) => {}
            _ => {
                found.unmatched += 1;
                continue;
            }
        }
        // Equal infinities are equal.
        let difference = if a == b { 0.0 } else { (a - b).abs() };
        found.max = found.max.max(difference);
        sum += difference;
        squares += difference * difference;
        of_b += b * b;
        found.samples += 1;
    }
    let n = found.samples.max(1) as f64;
    (found.mean, found.rms) = (sum / n, (squares / n).sqrt());
    found.relative = match (squares == 0.0, of_b == 0.0) {
        (true, _) => 0.0,
        (false, true) => f64::INFINITY,
        (false, false) => (squares / of_b).sqrt(),
    };
    found
}

/// The distance of two values, or why there is none: other types, other sizes, or a type without norms.
pub fn between(a: &AnyValue, b: &AnyValue) -> Result<Distance, String> {
    let (type_a, type_b) = (a.value_type(), b.value_type());
    if type_a != type_b {
        return Err(format!("one is a {}, the other a {}", type_a.name, type_b.name));
    }
    if let (Some(a), Some(b)) = (a.get::<Field>(), b.get::<Field>()) {
        sizes(a.size(), b.size())?;
        return Ok(distance(floats(a.data(), b.data())));
    }
    if let (Some(a), Some(b)) = (a.get::<Image>(), b.get::<Image>()) {
        sizes(a.size(), b.size())?;
        return Ok(distance(triples(a.rgb.data(), b.rgb.data())));
    }
    if let (Some(a), Some(b)) = (a.get::<Mask>(), b.get::<Mask>()) {
        sizes(a.size(), b.size())?;
        let bits = a.data().iter().zip(b.data());
        return Ok(distance(
            bits.map(|(a, b)| (f64::from(u8::from(*a)), f64::from(u8::from(*b)))),
        ));
    }
    if let (Some(a), Some(b)) = (a.get::<Views>(), b.get::<Views>()) {
        let names = |views: &Views| views.views.iter().map(|view| view.name.clone()).collect::<Vec<_>>();
        if names(&a) != names(&b) {
            return Err(format!(
                "the views are {} and {}",
                names(&a).join(", "),
                names(&b).join(", ")
            ));
        }
        for (a, b) in a.views.iter().zip(&b.views) {
            sizes(a.rgb.size(), b.rgb.size()).map_err(|e| format!("{}: {e}", a.name))?;
        }
        let views = a.views.iter().zip(&b.views);
        return Ok(distance(views.flat_map(|(a, b)| triples(a.rgb.data(), b.rgb.data()))));
    }
    if let (Some(a), Some(b)) = (a.get::<Scene>(), b.get::<Scene>()) {
        if a.len() != b.len() {
            return Err(format!("{} Gaussians and {}", a.len(), b.len()));
        }
        let centers = a.centers.iter().zip(&b.centers);
        let parts = centers.flat_map(|(a, b)| a.to_array().into_iter().zip(b.to_array()));
        return Ok(distance(parts.map(|(a, b)| (f64::from(a), f64::from(b)))));
    }
    if let (Some(a), Some(b)) = (a.get::<Number>(), b.get::<Number>()) {
        return Ok(distance(std::iter::once((a.0, b.0))));
    }
    Err(format!("a {} has no norm", type_a.name))
}

fn sizes(a: (usize, usize), b: (usize, usize)) -> Result<(), String> {
    if a == b {
        return Ok(());
    }
    Err(format!("{}×{} pixels and {}×{}", a.0, a.1, b.0, b.1))
}

fn floats<'a>(a: &'a [f32], b: &'a [f32]) -> impl Iterator<Item = (f64, f64)> + 'a {
    a.iter().zip(b).map(|(a, b)| (f64::from(*a), f64::from(*b)))
}

fn triples<'a>(a: &'a [[f32; 3]], b: &'a [[f32; 3]]) -> impl Iterator<Item = (f64, f64)> + 'a {
    floats(a.as_flattened(), b.as_flattened())
}

/// The numbers of a report (or of the summary of any other value), each with its place: `ddi.yaws.15`.
pub fn numbers(value: &AnyValue) -> Vec<(String, f64)> {
    let mut found = Vec::new();
    match value.get::<Report>() {
        Some(report) => gather(String::new(), &report.0, &mut found),
        None => of_summary(&value.summary(), &mut found),
    }
    found
}

fn of_summary(summary: &Summary, found: &mut Vec<(String, f64)>) {
    for (name, value) in summary {
        gather(name.clone(), value, found);
    }
}

fn gather(at: String, value: &serde_json::Value, found: &mut Vec<(String, f64)>) {
    let below = |name: &str| {
        if at.is_empty() {
            name.to_owned()
        } else {
            format!("{at}.{name}")
        }
    };
    match value {
        serde_json::Value::Number(number) => found.extend(number.as_f64().map(|number| (at, number))),
        serde_json::Value::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                gather(below(&i.to_string()), item, found);
            }
        }
        serde_json::Value::Object(fields) => {
            for (name, item) in fields {
                gather(below(name), item, found);
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use gear_image::SrgbImage;

    use super::*;

    #[test]
    fn the_norms_of_fields_leave_out_what_is_nothing_in_both() {
        let a = Field::from_vec(4, 1, vec![1.0, 2.0, f32::NAN, 4.0]);
        let b = Field::from_vec(4, 1, vec![1.0, 0.0, f32::NAN, f32::NAN]);
        let found = between(&AnyValue::new(a), &AnyValue::new(b)).unwrap();
        assert_eq!((found.samples, found.unmatched), (2, 1));
        assert_eq!((found.max, found.mean), (2.0, 1.0));
        assert!((found.rms - 2.0f64.sqrt()).abs() < 1e-12);
        assert_eq!(found.relative, 2.0);
        for name in Norm::NAMES {
            assert_eq!(Norm::parse(name).unwrap().name(), name);
        }
    }

    #[test]
    fn what_cannot_be_compared_says_why() {
        let field = |w| AnyValue::new(Field::filled(w, 1, 0.0));
        assert!(
            between(&field(2), &field(3))
                .unwrap_err()
                .contains("2×1 pixels and 3×1")
        );
        let image = AnyValue::new(Image::opaque(SrgbImage::filled(2, 1, [0.0; 3])));
        assert!(between(&field(2), &image).unwrap_err().contains("Field"));
        let report = || AnyValue::new(Report(serde_json::json!({"a": {"b": [1, 2.5]}, "word": "x"})));
        assert!(between(&report(), &report()).unwrap_err().contains("no norm"));
        assert_eq!(
            numbers(&report()),
            [("a.b.0".to_owned(), 1.0), ("a.b.1".to_owned(), 2.5)]
        );
    }

    #[test]
    fn equal_values_have_no_distance() {
        let value = AnyValue::new(Field::from_vec(2, 1, vec![f32::INFINITY, 3.0]));
        let found = between(&value, &value).unwrap();
        assert_eq!((found.max, found.rms, found.relative), (0.0, 0.0, 0.0));
    }
}
