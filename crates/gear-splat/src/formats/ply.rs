//! 3DGS PLY: what the reference implementation writes and every splat viewer reads.
//!
//! Properties in standard order, all `float`: x y z nx ny nz f_dc_0…2 f_rest_0… opacity scale_0…2 rot_0…3.
//! Opacities are logits, scales natural logarithms, rotations (w, x, y, z); `f_rest` is channel-major with 0, 9, 24 or 45
//! entries; normals are written as zeros, as the reference implementation does. The canonical camera is a comment line,
//! `comment gear canonical_camera {json}`, which other readers skip. Reading finds properties by name, in any order and
//! of any scalar type, little endian or ASCII, with or without normals and `f_rest`; further properties and elements
//! after the vertices are ignored.

use glam::{Quat, Vec3};

use crate::{Camera, Scene, SceneError, sh};

/// Starts the comment line that holds the canonical camera.
const CAMERA: &str = "gear canonical_camera ";
/// A header longer than this is none.
const HEADER_MAX: usize = 1 << 20;

/// Why a PLY file could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum PlyError {
    /// The header is not one of a PLY file.
    #[error("not a PLY file: {0}")]
    Header(String),
    /// The header lacks a property of 3DGS.
    #[error("no property `{0}` in the vertices; this PLY file is not a Gaussian scene in the 3DGS layout")]
    MissingProperty(String),
    /// `f_rest` has a length that no SH degree has.
    #[error("found {0} f_rest properties; expected 0, 9, 24 or 45 (SH degree 0 to 3)")]
    RestCount(usize),
    /// The data end early, or ASCII numbers cannot be read.
    #[error("{0}")]
    Data(String),
    /// The scene cannot be written.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The canonical camera has no meaning.
    #[error("the canonical camera has numbers that are not finite, or no pixels")]
    Camera,
}

fn data(message: impl Into<String>) -> PlyError {
    PlyError::Data(message.into())
}

fn header(message: impl Into<String>) -> PlyError {
    PlyError::Header(message.into())
}

/// Property names in standard order.
fn property_names(sh_degree: u8) -> Vec<String> {
    let mut names: Vec<String> = ["x", "y", "z", "nx", "ny", "nz"].map(String::from).into();
    names.extend((0..3).map(|i| format!("f_dc_{i}")));
    names.extend((0..sh::rest_count(sh_degree)).map(|i| format!("f_rest_{i}")));
    names.push("opacity".into());
    names.extend((0..3).map(|i| format!("scale_{i}")));
    names.extend((0..4).map(|i| format!("rot_{i}")));
    names
}

/// Writes a scene.
pub fn write(scene: &Scene) -> Result<Vec<u8>, PlyError> {
    scene.validate()?;
    let names = property_names(scene.sh_degree);
    let mut head = String::from("ply\nformat binary_little_endian 1.0\n");
    if let Some(camera) = &scene.canonical_camera {
        if !camera.is_valid() {
            return Err(PlyError::Camera);
        }
        let json = serde_json::to_string(camera).map_err(|_| PlyError::Camera)?;
        head.push_str(&format!("comment {CAMERA}{json}\n"));
    }
    head.push_str(&format!("element vertex {}\n", scene.len()));
    for name in &names {
        head.push_str(&format!("property float {name}\n"));
    }
    head.push_str("end_header\n");

    let mut out = Vec::with_capacity(head.len() + scene.len() * names.len() * 4);
    out.extend_from_slice(head.as_bytes());
    for i in 0..scene.len() {
        let q = scene.rotations[i];
        let mut put = |values: &[f32]| values.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
        put(&scene.centers[i].to_array());
        put(&[0.0; 3]);
        put(&scene.sh_dc[i]);
        put(scene.sh_rest_of(i));
        put(&[scene.opacity_logits[i]]);
        put(&scene.log_scales[i].to_array());
        put(&[q.w, q.x, q.y, q.z]);
    }
    Ok(out)
}

/// Scalar types of PLY.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Reads from the start of `bytes`, which holds at least [`Scalar::size`].
    fn read(self, bytes: &[u8]) -> f32 {
        fn take<const N: usize>(bytes: &[u8]) -> [u8; N] {
            std::array::from_fn(|i| bytes[i])
        }
        match self {
            Self::I8 => f32::from(bytes[0] as i8),
            Self::U8 => f32::from(bytes[0]),
            Self::I16 => f32::from(i16::from_le_bytes(take(bytes))),
            Self::U16 => f32::from(u16::from_le_bytes(take(bytes))),
            Self::I32 => i32::from_le_bytes(take(bytes)) as f32,
            Self::U32 => u32::from_le_bytes(take(bytes)) as f32,
            Self::F32 => f32::from_le_bytes(take(bytes)),
            Self::F64 => f64::from_le_bytes(take(bytes)) as f32,
        }
    }
}

/// What a header says.
#[derive(Debug)]
struct Layout {
    ascii: bool,
    count: usize,
    properties: Vec<(String, Scalar)>,
    camera: Option<Camera>,
    /// Where the data start.
    body: usize,
}

/// Reads a scene.
pub fn read(bytes: &[u8]) -> Result<Scene, PlyError> {
    let layout = parse_header(bytes)?;
    let body = &bytes[layout.body..];
    let columns = Columns::find(&layout.properties)?;
    let mut scene = Scene {
        sh_degree: columns.sh_degree,
        canonical_camera: layout.camera,
        ..Scene::default()
    };
    // Each vertex takes at least this much, so a false count cannot reserve memory that the file does not back.
    let least = if layout.ascii {
        2 * layout.properties.len()
    } else {
        layout.properties.iter().map(|p| p.1.size()).sum()
    };
    // The last ASCII number needs no separator after it.
    let held = (body.len() + usize::from(layout.ascii)) / least.max(1);
    if layout.count > held {
        return Err(data(format!(
            "the header promises {} vertices, the file has room for {held}; it is truncated",
            layout.count
        )));
    }
    scene.centers.reserve_exact(layout.count);
    let mut row = vec![0.0f32; layout.properties.len()];
    if layout.ascii {
        let text = std::str::from_utf8(body).map_err(|_| data("the ASCII data are not text"))?;
        let mut numbers = text.split_ascii_whitespace();
        for vertex in 0..layout.count {
            for (value, (name, _)) in row.iter_mut().zip(&layout.properties) {
                let word = numbers
                    .next()
                    .ok_or_else(|| data(format!("the data end in vertex {vertex}, before {name}")))?;
                *value = word
                    .parse()
                    .map_err(|_| data(format!("vertex {vertex}: expected a number for {name}, found `{word}`")))?;
            }
            columns.push(&row, &mut scene);
        }
    } else {
        for vertex in body.chunks_exact(least.max(1)).take(layout.count) {
            let mut at = 0;
            for (value, (_, scalar)) in row.iter_mut().zip(&layout.properties) {
                *value = scalar.read(&vertex[at..]);
                at += scalar.size();
            }
            columns.push(&row, &mut scene);
        }
    }
    Ok(scene)
}

fn parse_header(bytes: &[u8]) -> Result<Layout, PlyError> {
    let mut at = 0;
    let mut line = || -> Result<(&str, usize), PlyError> {
        let rest = &bytes[at..bytes.len().min(at.max(HEADER_MAX))];
        let end = rest
            .iter()
            .position(|&b| b == b'\n')
            .ok_or_else(|| header("the header has no `end_header` line"))?;
        at += end + 1;
        let text = std::str::from_utf8(&rest[..end]).map_err(|_| header("the header is not text"))?;
        Ok((text.trim_end_matches('\r'), at))
    };
    if !bytes.starts_with(b"ply\n") && !bytes.starts_with(b"ply\r\n") {
        return Err(header("it does not start with the line `ply`"));
    }
    line()?;
    let mut ascii = None;
    let mut count = None;
    let mut inside_vertex = false;
    let mut properties: Vec<(String, Scalar)> = Vec::new();
    let mut camera = None;
    loop {
        let (text, body) = line()?;
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        match words.as_slice() {
            ["end_header"] => {
                return Ok(Layout {
                    ascii: ascii.ok_or_else(|| header("no `format` line"))?,
                    count: count.ok_or_else(|| header("no `element vertex`"))?,
                    properties,
                    camera,
                    body,
                });
            }
            ["format", "binary_little_endian", _] => ascii = Some(false),
            ["format", "ascii", _] => ascii = Some(true),
            ["format", other, ..] => {
                return Err(header(format!(
                    "format `{other}`; expected `binary_little_endian` or `ascii`"
                )));
            }
            ["comment", ..] => {
                let comment = text
                    .trim_start()
                    .strip_prefix("comment")
                    .unwrap_or_default()
                    .trim_start();
                if let Some(json) = comment.strip_prefix(CAMERA) {
                    let read: Camera = serde_json::from_str(json)
                        .map_err(|e| header(format!("the comment with the canonical camera: {e}")))?;
                    if !read.is_valid() {
                        return Err(PlyError::Camera);
                    }
                    camera = Some(read);
                }
            }
            ["element", "vertex", n] => {
                let n = n.parse().map_err(|_| header(format!("vertex count `{n}`")))?;
                if count.replace(n).is_some() {
                    return Err(header("two `element vertex` lines"));
                }
                inside_vertex = true;
            }
            ["element", name, n] => {
                if count.is_none() && *n != "0" {
                    return Err(header(format!("element `{name}` before the vertices is not supported")));
                }
                inside_vertex = false;
            }
            ["property", kind, name] if inside_vertex => {
                let scalar = Scalar::named(kind).ok_or_else(|| header(format!("property type `{kind}`")))?;
                if properties.iter().any(|p| p.0 == *name) {
                    return Err(header(format!("property `{name}` twice")));
                }
                properties.push(((*name).into(), scalar));
            }
            ["property", "list", ..] if inside_vertex => {
                return Err(header("a list property in the vertices; a Gaussian scene has none"));
            }
            ["property", ..] if !inside_vertex => {}
            ["obj_info", ..] | [] => {}
            _ => return Err(header(format!("header line `{text}`"))),
        }
    }
}

/// Where each attribute stands in a row.
struct Columns {
    center: [usize; 3],
    dc: [usize; 3],
    rest: Vec<usize>,
    opacity: usize,
    scale: [usize; 3],
    rotation: [usize; 4],
    sh_degree: u8,
}

impl Columns {
    fn find(properties: &[(String, Scalar)]) -> Result<Self, PlyError> {
        let find = |name: String| {
            let at = properties.iter().position(|p| p.0 == name);
            at.ok_or(PlyError::MissingProperty(name))
        };
        fn all<const N: usize>(
            names: [String; N],
            find: impl Fn(String) -> Result<usize, PlyError>,
        ) -> Result<[usize; N], PlyError> {
            let mut columns = [0; N];
            for (column, name) in columns.iter_mut().zip(names) {
                *column = find(name)?;
            }
            Ok(columns)
        }
        let numbered = |name: &str, i: usize| format!("{name}_{i}");
        let count = properties.iter().filter(|p| p.0.starts_with("f_rest_")).count();
        let sh_degree = (0..=sh::MAX_DEGREE)
            .find(|&degree| sh::rest_count(degree) == count)
            .ok_or(PlyError::RestCount(count))?;
        Ok(Self {
            center: all(["x", "y", "z"].map(String::from), find)?,
            dc: all([0, 1, 2].map(|i| numbered("f_dc", i)), find)?,
            rest: (0..count)
                .map(|i| find(numbered("f_rest", i)))
                .collect::<Result<_, _>>()?,
            opacity: find("opacity".into())?,
            scale: all([0, 1, 2].map(|i| numbered("scale", i)), find)?,
            rotation: all([0, 1, 2, 3].map(|i| numbered("rot", i)), find)?,
            sh_degree,
        })
    }

    fn push(&self, row: &[f32], scene: &mut Scene) {
        scene.centers.push(Vec3::from(self.center.map(|at| row[at])));
        scene.log_scales.push(Vec3::from(self.scale.map(|at| row[at])));
        let [w, x, y, z] = self.rotation.map(|at| row[at]);
        scene.rotations.push(Quat::from_xyzw(x, y, z, w));
        scene.opacity_logits.push(row[self.opacity]);
        scene.sh_dc.push(self.dc.map(|at| row[at]));
        scene.sh_rest.extend(self.rest.iter().map(|&at| row[at]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::tests::one;
    use proptest::prelude::*;

    fn scene(degree: u8) -> Scene {
        let mut scene = Scene {
            sh_degree: degree,
            ..Scene::default()
        };
        for i in 0..5 {
            scene.push(one(Vec3::new(i as f32, -0.1, 1e-30)));
        }
        for (i, x) in scene.sh_rest.iter_mut().enumerate() {
            *x = i as f32 * 0.01;
        }
        scene.canonical_camera = Some(Camera::front(300, 77).orbit(Vec3::ONE, 12.3, 0.7));
        scene
    }

    #[test]
    fn what_is_written_is_read_for_every_degree() {
        for degree in 0..=3 {
            let scene = scene(degree);
            assert_eq!(read(&write(&scene).unwrap()).unwrap(), scene);
        }
        assert_eq!(read(&write(&Scene::default()).unwrap()).unwrap(), Scene::default());
    }

    #[test]
    fn the_header_is_the_reference_implementations() {
        let bytes = write(&Scene {
            canonical_camera: None,
            ..scene(1)
        })
        .unwrap();
        let text = String::from_utf8_lossy(&bytes);
        let head: Vec<&str> = text.lines().take_while(|l| *l != "end_header").collect();
        assert_eq!(
            head[..5],
            [
                "ply",
                "format binary_little_endian 1.0",
                "element vertex 5",
                "property float x",
                "property float y"
            ]
        );
        assert_eq!(head[9], "property float f_dc_0");
        assert_eq!(head[12], "property float f_rest_0");
        assert_eq!(head[21], "property float opacity");
        assert_eq!(head[25], "property float rot_0");
    }

    #[test]
    fn ascii_with_other_types_order_and_elements_is_read() {
        let names = "rot_0 rot_1 rot_2 rot_3 scale_0 scale_1 scale_2 opacity f_dc_2 f_dc_1 f_dc_0 extra z y x";
        let mut text = String::from("ply\r\nformat ascii 1.0\r\ncomment made by hand\r\nelement vertex 2\r\n");
        for name in names.split(' ') {
            text.push_str(&format!("property double {name}\r\n"));
        }
        text.push_str("element face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n");
        text.push_str("1 0 0 0 -1 -2 -3 0.5 .3 .2 .1 9 3 2 1\n1 0 0 0 -1 -2 -3 0.5 .3 .2 .1 9 3 2 nan\n3 0 1 1");
        let scene = read(text.as_bytes()).unwrap();
        assert_eq!(scene.centers[0], Vec3::new(1.0, 2.0, 3.0));
        assert_eq!(scene.sh_dc[1], [0.1, 0.2, 0.3]);
        assert_eq!(scene.count_invalid(), 1);
    }

    #[test]
    fn wrong_headers_are_named() {
        let good = write(&scene(0)).unwrap();
        let text = |s: &str| s.as_bytes().to_vec();
        let replaced = |from: &str, to: &str| {
            let at = good.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
            [&good[..at], to.as_bytes(), &good[at + from.len()..]].concat()
        };
        let cases = [
            (Vec::new(), "does not start"),
            (text("ply\nformat ascii 1.0\n"), "no `end_header`"),
            (text("ply\nend_header\n"), "no `format`"),
            (text("ply\nformat ascii 1.0\nend_header\n"), "no `element vertex`"),
            (text("ply\nformat binary_big_endian 1.0\n"), "binary_big_endian"),
            (replaced("element vertex 5", "element vertex 6"), "truncated"),
            (
                replaced("element vertex 5", "element vertex 99999999999999"),
                "truncated",
            ),
            (replaced("element vertex 5", "element vertex -5"), "vertex count"),
            (
                replaced("property float opacity", "property float opacitee"),
                "`opacity`",
            ),
            (replaced("property float opacity", "property float f_rest_7"), "f_rest"),
            (replaced("property float opacity", "property float x"), "twice"),
            (
                replaced("property float opacity", "property list uchar int opacity"),
                "list",
            ),
            (replaced("property float opacity", "property quad opacity"), "quad"),
            (replaced("\"width\":300", "\"width\":0"), "canonical camera"),
            (replaced("\"width\":300", "\"width\":x"), "canonical camera"),
        ];
        for (bytes, part) in cases {
            let message = read(&bytes).unwrap_err().to_string();
            assert!(message.contains(part), "{message} should mention {part}");
        }
    }

    proptest! {
        #[test]
        fn damaged_files_never_panic(at in 0usize..2000, byte: u8, cut in 0usize..2000) {
            let mut bytes = write(&scene(1)).unwrap();
            let len = bytes.len();
            bytes[at % len] = byte;
            let _ = read(&bytes);
            let _ = read(&bytes[..cut % len]);
        }
    }
}
