//! The outputs of a graph as files, by the type of their value:
//!
//! | type | files |
//! |---|---|
//! | Image | `NAME.png`, 8 bits |
//! | Mask | `NAME.png`, white inside |
//! | Field | `NAME.exr`, exact, and `NAME.png` to look at |
//! | Scene | `NAME.ply` |
//! | Views | `NAME/VIEW.png`, 8 bits |
//! | Report, Number | `NAME.json` |
//! | any other | `NAME` with the extension of its encoding |

use gear_graph::{AnyValue, ValueType};
use gear_image::{Field, Image, Mask};
use gear_report::picture::Pixels;
use gear_splat::Views;

use crate::bundle::File;

/// Raise when the same value gives other files.
const FILES_VERSION: u64 = 1;

/// Under which name the files of an output are kept in the store.
pub fn kind(name: &str) -> String {
    format!("files {FILES_VERSION} {name}")
}

/// The files that an output of this type will be, as far as its name tells; of views, it does not.
pub fn foreseen(name: &str, value_type: &ValueType) -> Vec<String> {
    let named = |extensions: &[&str]| extensions.iter().map(|end| format!("{name}.{end}")).collect();
    if value_type.is::<Image>() || value_type.is::<Mask>() {
        named(&["png"])
    } else if value_type.is::<Field>() {
        named(&["exr", "png"])
    } else if value_type.is::<Views>() {
        Vec::new()
    } else {
        named(&[value_type.extension])
    }
}

/// The files of one output. Equal values of an output of that name give equal bytes.
pub fn files(name: &str, value: &AnyValue) -> Result<Vec<File>, String> {
    let png = |pixels: Pixels| pixels.png().map(|picture| picture.bytes).map_err(|e| e.to_string());
    if let Some(image) = value.get::<Image>() {
        Ok(vec![File::new(
            format!("{name}.png"),
            gear_image::io::png_bytes(&image)?,
        )])
    } else if let Some(mask) = value.get::<Mask>() {
        let white = Field::from_vec(mask.width(), mask.height(), mask.to_field().into_data());
        Ok(vec![File::new(format!("{name}.png"), png(Pixels::of_share(&white))?)])
    } else if let Some(field) = value.get::<Field>() {
        let exact = File::new(format!("{name}.exr"), value.encode().map_err(|e| e.to_string())?);
        Ok(vec![
            exact,
            File::new(format!("{name}.png"), png(picture_of(name, &field))?),
        ])
    } else if let Some(views) = value.get::<Views>() {
        let files = views.views.iter();
        files
            .map(|view| {
                let bytes = png(Pixels::of_view(view))?;
                Ok(File::new(format!("{name}/{}.png", file_name(&view.name)), bytes))
            })
            .collect()
    } else {
        let bytes = value.encode().map_err(|e| e.to_string())?;
        Ok(vec![File::new(
            format!("{name}.{}", value.value_type().extension),
            bytes,
        )])
    }
}

/// A field as a picture: heights near-is-light, everything else by its range.
pub fn picture_of(name: &str, field: &Field) -> Pixels {
    if is_height(name) {
        Pixels::of_height(field)
    } else {
        Pixels::of_field(field)
    }
}

/// Whether an output of this name holds heights.
pub fn is_height(name: &str) -> bool {
    matches!(name, "depth" | "height")
}

/// A view's name as part of a file name on any system.
pub fn file_name(view: &str) -> String {
    view.chars()
        .map(|c| {
            if c.is_ascii_alphanumeric() || "+-_.".contains(c) {
                c
            } else {
                '_'
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use gear_graph::{Number, Report};
    use gear_image::SrgbImage;
    use gear_splat::{Camera, View};

    use super::*;

    fn names(name: &str, value: AnyValue) -> Vec<String> {
        let files = files(name, &value).unwrap();
        let names: Vec<_> = files.into_iter().map(|file| file.name).collect();
        if !value.value_type().is::<Views>() {
            assert_eq!(foreseen(name, &value.value_type()), names);
        }
        names
    }

    #[test]
    fn each_type_has_its_files() {
        let image = Image::opaque(SrgbImage::filled(3, 2, [0.5; 3]));
        assert_eq!(names("grounded", AnyValue::new(image)), ["grounded.png"]);
        assert_eq!(names("mask", AnyValue::new(Mask::filled(3, 2, true))), ["mask.png"]);
        assert_eq!(
            names("depth", AnyValue::new(Field::filled(3, 2, 0.1))),
            ["depth.exr", "depth.png"]
        );
        assert_eq!(
            names("metrics", AnyValue::new(Report(serde_json::json!({})))),
            ["metrics.json"]
        );
        assert_eq!(names("alpha", AnyValue::new(Number(1.0))), ["alpha.json"]);
        assert_eq!(
            names("scene", AnyValue::new(gear_splat::Scene::default())),
            ["scene.ply"]
        );
    }

    #[test]
    fn a_view_cannot_leave_the_folder() {
        let view = View {
            camera: Camera::front(2, 2),
            name: "../../etc/passwd".into(),
            rgb: SrgbImage::filled(2, 2, [1.0; 3]),
            alpha: None,
            depth: None,
            normal: None,
            weight: None,
        };
        let views = Views { views: vec![view] };
        assert_eq!(names("views", AnyValue::new(views)), ["views/.._.._etc_passwd.png"]);
    }
}
