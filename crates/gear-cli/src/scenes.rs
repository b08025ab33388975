//! Scenes and cameras that are given as files.

use std::collections::BTreeSet;
use std::path::Path;

use gear_splat::{Camera, Scene, formats};
use serde_json::Value;

use crate::console::Console;
use crate::error::CliError;

/// Longest side of a picture.
pub const MOST_SIDE: u32 = 16_384;
/// Most pixels of a picture.
const MOST_PIXELS: u64 = 1 << 27;

/// Reads a scene in any format, says what it is, and turns it over if y points down in it.
pub fn open(path: &Path, y_down: bool, console: &Console) -> Result<Scene, CliError> {
    let loaded = formats::open(path).map_err(|cause| CliError::SceneFile {
        file: path.to_path_buf(),
        cause,
    })?;
    let scene = &loaded.scene;
    let camera = if scene.canonical_camera.is_some() {
        ", with its canonical camera"
    } else {
        ""
    };
    console.remark(&format!(
        "{}: {}, {} Gaussians, SH degree {}{camera}",
        path.display(),
        loaded.format,
        scene.len(),
        scene.sh_degree
    ));
    loaded.notes.iter().for_each(|note| console.note(note));
    Ok(if y_down { scene.turned_over() } else { loaded.scene })
}

/// A camera with a name for its pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    /// Part of file names.
    pub name: String,
    /// The camera.
    pub camera: Camera,
}

/// Reads cameras: one as JSON, as scenes and views hold it, or a list of them; each may have a `name`.
pub fn cameras(path: &Path) -> Result<Vec<Named>, CliError> {
    let refuse = |cause: String| CliError::CameraFile {
        file: path.to_path_buf(),
        cause,
    };
    let bytes = std::fs::read(path).map_err(|e| refuse(format!("cannot be read: {e}")))?;
    parse(&bytes).map_err(refuse)
}

fn parse(bytes: &[u8]) -> Result<Vec<Named>, String> {
    let text: Value = serde_json::from_slice(bytes).map_err(|e| {
        format!("no JSON: {e}; expected a camera, or a list of them, such as cameras.json beside pictures")
    })?;
    let list = match text {
        Value::Array(list) if list.is_empty() => return Err("an empty list; expected at least one camera".into()),
        Value::Array(list) => list,
        one => vec![one],
    };
    let mut names = BTreeSet::new();
    let mut cameras = Vec::new();
    for (i, value) in list.into_iter().enumerate() {
        let named = one_camera(&value, i).map_err(|cause| format!("camera {}: {cause}", i + 1))?;
        if !names.insert(named.name.to_lowercase()) {
            return Err(format!(
                "two cameras are named `{}`; their pictures need two names",
                named.name
            ));
        }
        cameras.push(named);
    }
    Ok(cameras)
}

fn one_camera(value: &Value, index: usize) -> Result<Named, String> {
    if !value.is_object() {
        return Err(format!("found {value}; expected an object"));
    }
    let camera: Camera = serde_json::from_value(value.clone()).map_err(|e| {
        format!("{e}; expected rotation, translation, projection, principal, width and height, as in the comment of a PLY file")
    })?;
    if !camera.is_valid() {
        return Err("its numbers are not finite, or it has no pixels, or its projection does not magnify".into());
    }
    let rotation = camera.rotation;
    if !(rotation * rotation.transpose()).abs_diff_eq(glam::Mat3::IDENTITY, 1e-3) || rotation.determinant() < 0.0 {
        return Err("its `rotation` is no rotation; expected three orthogonal unit columns, column by column".into());
    }
    check_size(camera.width, camera.height)?;
    let name = match &value["name"] {
        Value::Null => format!("camera-{:02}", index + 1),
        Value::String(name) if !name.trim().is_empty() => name.clone(),
        other => return Err(format!("its `name` is {other}; expected text")),
    };
    Ok(Named {
        name: crate::outputs::file_name(&name),
        camera,
    })
}

/// What [`cameras`] reads.
pub fn cameras_json(cameras: &[Named]) -> Vec<u8> {
    let list: Vec<Value> = cameras
        .iter()
        .map(|named| {
            let mut value = serde_json::json!(named.camera);
            value["name"] = Value::String(named.name.clone());
            value
        })
        .collect();
    format!("{:#}\n", Value::Array(list)).into_bytes()
}

/// Refuses pictures of no or of too many pixels.
pub fn check_size(width: u32, height: u32) -> Result<(), String> {
    let sides = 1..=MOST_SIDE;
    if sides.contains(&width) && sides.contains(&height) && u64::from(width) * u64::from(height) <= MOST_PIXELS {
        Ok(())
    } else {
        Err(format!(
            "a picture of {width}x{height} pixels; expected sides from 1 to {MOST_SIDE} and at most {MOST_PIXELS} pixels"
        ))
    }
}

/// The size of pictures: `512` is the longer side, `640x480` width and height.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// The longer side; the other follows the camera.
    Longer(u32),
    /// Width and height; the camera's frame stands in the middle.
    Exact(u32, u32),
}

impl std::str::FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || format!("found `{text}`; expected WIDTHxHEIGHT or the longer side, such as 640x480 or 768");
        let side = |text: &str| text.parse::<u32>().map_err(|_| expected());
        match text.split_once('x') {
            None => {
                let longer = side(text)?;
                if longer == 0 || longer > MOST_SIDE {
                    return Err(format!(
                        "found `{text}`; expected a longer side from 1 to {MOST_SIDE} pixels"
                    ));
                }
                Ok(Self::Longer(longer))
            }
            Some((width, height)) => {
                let (width, height) = (side(width)?, side(height)?);
                check_size(width, height)?;
                Ok(Self::Exact(width, height))
            }
        }
    }
}

impl Size {
    /// The camera with a picture of this size.
    pub fn of(self, camera: &Camera) -> Camera {
        match self {
            Self::Longer(side) => camera.resized(side),
            Self::Exact(width, height) => camera.fitted(width, height),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_read_as_they_are_written() {
        let front = Camera::front(30, 20);
        let cameras = vec![
            Named {
                name: "front".into(),
                camera: front,
            },
            Named {
                name: "side".into(),
                camera: front.orbit(Default::default(), 90.0, 0.0),
            },
        ];
        assert_eq!(parse(&cameras_json(&cameras)).unwrap(), cameras);
        let one = parse(serde_json::json!(front).to_string().as_bytes()).unwrap();
        assert_eq!((one[0].name.as_str(), one[0].camera), ("camera-01", front));
    }

    #[test]
    fn what_is_wrong_with_a_camera_is_named() {
        let with = |change: fn(&mut Value)| {
            let mut value = serde_json::json!(Camera::front(30, 20));
            change(&mut value);
            value.to_string()
        };
        let cases = [
            ("{".to_owned(), "no JSON"),
            ("[]".to_owned(), "empty list"),
            ("[7]".to_owned(), "camera 1: found 7"),
            (with(|c| drop(c.as_object_mut().unwrap().remove("width"))), "width"),
            (with(|c| c["width"] = 0.into()), "no pixels"),
            (with(|c| c["width"] = 100_000.into()), "16384"),
            (with(|c| c["rotation"][0] = 2.into()), "no rotation"),
            (with(|c| c["name"] = 3.into()), "expected text"),
            (format!("[{0}, {0}]", with(|c| c["name"] = "A".into())), "two cameras"),
        ];
        for (text, part) in cases {
            let message = parse(text.as_bytes()).unwrap_err();
            assert!(message.contains(part), "{message} should mention {part}");
        }
    }

    #[test]
    fn sizes_are_read() {
        assert_eq!("640x480".parse(), Ok(Size::Exact(640, 480)));
        assert_eq!("768".parse(), Ok(Size::Longer(768)));
        for wrong in ["", "x", "0", "10x", "640X480", "-3", "20000", "16384x16384", "1x0"] {
            assert!(wrong.parse::<Size>().unwrap_err().contains("expected"), "{wrong}");
        }
    }
}
