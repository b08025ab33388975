//! Any value as named lists of numbers: what ranges, errors and norms are taken of.
//!
//! | type | planes |
//! |---|---|
//! | Image | `rgb`, `alpha` |
//! | Field | `value` |
//! | Mask | `inside`, 0 or 1 |
//! | Scene | `centers`, `log_scales`, `rotations`, `opacity_logits`, `sh_dc`, `sh_rest` |
//! | Views | `VIEW.rgb`, `VIEW.alpha`, `VIEW.depth`, `VIEW.normal`, `VIEW.weight` |
//! | Number | `value` |
//! | Report | each number in it, by its path: `niqe.grounded` |
//! | any other | each number of its summary, by its path |

use gear_graph::{AnyValue, Number, Report};
use gear_image::{Field, Image, Mask};
use gear_splat::{Scene, Views};
use serde_json::Value as Json;

/// Some numbers of a value that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// What they are.
    pub name: String,
    /// The numbers, in the order of the value.
    pub numbers: Vec<f64>,
}

impl Plane {
    fn new(name: impl Into<String>, numbers: impl IntoIterator<Item = f32>) -> Self {
        Self {
            name: name.into(),
            numbers: numbers.into_iter().map(f64::from).collect(),
        }
    }
}

/// All numbers of a value.
pub fn planes(value: &AnyValue) -> Vec<Plane> {
    if let Some(image) = value.get::<Image>() {
        let mut planes = vec![Plane::new("rgb", image.rgb.data().as_flattened().iter().copied())];
        planes.extend(
            image
                .alpha
                .iter()
                .map(|a| Plane::new("alpha", a.data().iter().copied())),
        );
        planes
    } else if let Some(field) = value.get::<Field>() {
        vec![Plane::new("value", field.data().iter().copied())]
    } else if let Some(mask) = value.get::<Mask>() {
        let inside = mask.data().iter().map(|&inside| f32::from(u8::from(inside)));
        vec![Plane::new("inside", inside)]
    } else if let Some(scene) = value.get::<Scene>() {
        of_scene(&scene)
    } else if let Some(views) = value.get::<Views>() {
        of_views(&views)
    } else if let Some(number) = value.get::<Number>() {
        vec![Plane {
            name: "value".to_owned(),
            numbers: vec![number.0],
        }]
    } else if let Some(report) = value.get::<Report>() {
        of_json(&report.0)
    } else {
        of_json(&Json::Object(value.summary()))
    }
}

fn of_scene(scene: &Scene) -> Vec<Plane> {
    let rotations = scene.rotations.iter().flat_map(|q| q.to_array());
    let mut planes = vec![
        Plane::new("centers", scene.centers.iter().flat_map(|v| v.to_array())),
        Plane::new("log_scales", scene.log_scales.iter().flat_map(|v| v.to_array())),
        Plane::new("rotations", rotations),
        Plane::new("opacity_logits", scene.opacity_logits.iter().copied()),
        Plane::new("sh_dc", scene.sh_dc.as_flattened().iter().copied()),
    ];
    if scene.sh_degree > 0 {
        planes.push(Plane::new("sh_rest", scene.sh_rest.iter().copied()));
    }
    planes
}

fn of_views(views: &Views) -> Vec<Plane> {
    let mut planes = Vec::new();
    for view in &views.views {
        let name = |plane: &str| format!("{}.{plane}", view.name);
        planes.push(Plane::new(name("rgb"), view.rgb.data().as_flattened().iter().copied()));
        for (plane, field) in [("alpha", &view.alpha), ("depth", &view.depth), ("weight", &view.weight)] {
            planes.extend(field.iter().map(|f| Plane::new(name(plane), f.data().iter().copied())));
        }
        let normal = view.normal.iter();
        planes.extend(normal.map(|n| Plane::new(name("normal"), n.as_flattened().iter().copied())));
    }
    planes
}

/// Each number of a JSON value, by its path.
pub fn of_json(json: &Json) -> Vec<Plane> {
    fn walk(path: &str, json: &Json, planes: &mut Vec<Plane>) {
        let below = |key: &str| match path {
            "" => key.to_owned(),
            _ => format!("{path}.{key}"),
        };
        match json {
            Json::Number(number) => planes.push(Plane {
                name: if path.is_empty() { "value" } else { path }.to_owned(),
                numbers: number.as_f64().into_iter().collect(),
            }),
            Json::Array(items) => {
                let items = items.iter().enumerate();
                items.for_each(|(i, item)| walk(&below(&i.to_string()), item, planes));
            }
            Json::Object(entries) => entries.iter().for_each(|(key, item)| walk(&below(key), item, planes)),
            Json::Null | Json::Bool(_) | Json::String(_) => {}
        }
    }
    let mut planes = Vec::new();
    walk("", json, &mut planes);
    planes
}

/// What can be said of numbers at a glance.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Extent {
    /// How many there are.
    pub count: usize,
    /// How many of them are not finite.
    pub not_finite: usize,
    /// The least finite one; 0 if there is none.
    pub low: f64,
    /// The greatest finite one; 0 if there is none.
    pub high: f64,
}

/// The extent of all planes together.
pub fn extent(planes: &[Plane]) -> Extent {
    let (mut count, mut not_finite, mut low, mut high) = (0, 0, f64::INFINITY, f64::NEG_INFINITY);
    for &x in planes.iter().flat_map(|plane| &plane.numbers) {
        count += 1;
        if x.is_finite() {
            (low, high) = (low.min(x), high.max(x));
        } else {
            not_finite += 1;
        }
    }
    let any = low <= high;
    Extent {
        count,
        not_finite,
        low: if any { low } else { 0.0 },
        high: if any { high } else { 0.0 },
    }
}

#[cfg(test)]
mod tests {
    use gear_graph::{Value, ValueType};

    use super::*;

    #[test]
    fn numbers_of_a_report_are_named_by_their_path() {
        let report = AnyValue::new(Report(
            serde_json::json!({"a": {"b": [1, null, 2.5]}, "c": "x", "d": true}),
        ));
        let names: Vec<_> = planes(&report).into_iter().map(|p| (p.name, p.numbers)).collect();
        assert_eq!(
            names,
            [("a.b.0".to_owned(), vec![1.0]), ("a.b.2".to_owned(), vec![2.5])]
        );
        assert_eq!(planes(&AnyValue::new(Report(serde_json::json!(3))))[0].name, "value");
    }

    #[test]
    fn every_number_of_an_extreme_value_is_counted() {
        let (_, field) = Field::extremes().pop().unwrap();
        let extent = extent(&planes(&AnyValue::new(field)));
        assert_eq!((extent.count, extent.not_finite), (400, 300));
        assert_eq!((extent.low, extent.high), (0.5, 0.5));
        for value_type in [
            ValueType::of::<Image>(),
            ValueType::of::<Scene>(),
            ValueType::of::<Views>(),
        ] {
            for (name, value) in value_type.extremes() {
                let planes = planes(&value);
                assert!(name == "none" || !planes.is_empty(), "{name}");
            }
        }
    }
}
