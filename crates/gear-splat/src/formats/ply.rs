//! 3DGS PLY: what the reference implementation writes and every splat viewer reads.
//!
//! Written properties are in standard order, all `float`: x y z nx ny nz f_dc_0…2 f_rest_0… opacity scale_0…2 rot_0…3.
//! Opacities are logits, scales natural logarithms, rotations (w, x, y, z); `f_rest` is channel-major with 0, 9, 24 or 45
//! entries; normals are written as zeros, as the reference implementation does. The canonical camera is a comment line,
//! `comment gear canonical_camera {json}`, which other readers skip. Nothing is lost: what is written is read back bit for
//! bit.
//!
//! Reading finds properties by name, in any order and of any scalar type, ASCII or binary of either byte order, with or
//! without normals and `f_rest` (TRELLIS writes normals and no `f_rest`, LGM neither); further properties and elements are
//! ignored. A property of type `double` is rounded to f32.

use glam::{Quat, Vec3};

use crate::{Scene, sh};

use super::ply_header::{self, Body, CAMERA, Element};
use super::{Format, FormatError, check_count};

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
pub fn write(scene: &Scene) -> Result<Vec<u8>, FormatError> {
    scene.validate()?;
    let names = property_names(scene.sh_degree);
    let mut head = String::from("ply\nformat binary_little_endian 1.0\n");
    if let Some(camera) = &scene.canonical_camera {
        if !camera.is_valid() {
            return Err(FormatError::Camera);
        }
        let json = serde_json::to_string(camera).map_err(|_| FormatError::Camera)?;
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

/// Reads a scene.
pub fn read(bytes: &[u8]) -> Result<Scene, FormatError> {
    let header = ply_header::parse(bytes)?;
    let vertices = header
        .element("vertex")
        .ok_or_else(|| ply_header::error("no `element vertex`"))?;
    if vertices.lists {
        return Err(ply_header::list_in("vertex"));
    }
    let columns = Columns::find(vertices)?;
    let mut scene = Scene {
        sh_degree: columns.sh_degree,
        canonical_camera: header.camera,
        ..Scene::default()
    };
    let mut body = Body::new(bytes, &header, Format::Ply)?;
    for element in &header.elements {
        if element.name == "vertex" {
            let count = body.count(element, "vertices")?;
            check_count(count as u64, Format::Ply)?;
            scene.centers.reserve_exact(count);
            body.rows(element, "vertices", |row| columns.push(row, &mut scene))?;
            break;
        }
        body.rows(element, "rows of another element", |_| {})?;
    }
    Ok(scene)
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
    fn find(vertices: &Element) -> Result<Self, FormatError> {
        let find = |name: String| {
            vertices.find(&name).ok_or_else(|| FormatError::MissingProperty {
                missing: name,
                found: vertices.listed(),
            })
        };
        fn all<const N: usize>(
            names: [String; N],
            find: impl Fn(String) -> Result<usize, FormatError>,
        ) -> Result<[usize; N], FormatError> {
            let mut columns = [0; N];
            for (column, name) in columns.iter_mut().zip(names) {
                *column = find(name)?;
            }
            Ok(columns)
        }
        let numbered = |name: &str, i: usize| format!("{name}_{i}");
        let count = vertices
            .properties
            .iter()
            .filter(|p| p.0.starts_with("f_rest_"))
            .count();
        let sh_degree = (0..=sh::MAX_DEGREE)
            .find(|&degree| sh::rest_count(degree) == count)
            .ok_or(FormatError::RestCount(count))?;
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

    fn push(&self, row: &[f64], scene: &mut Scene) {
        let at = |column: usize| row[column] as f32;
        scene.centers.push(Vec3::from(self.center.map(at)));
        scene.log_scales.push(Vec3::from(self.scale.map(at)));
        let [w, x, y, z] = self.rotation.map(at);
        scene.rotations.push(Quat::from_xyzw(x, y, z, w));
        scene.opacity_logits.push(at(self.opacity));
        scene.sh_dc.push(self.dc.map(at));
        scene.sh_rest.extend(self.rest.iter().map(|&column| at(column)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Camera;
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

    /// The layout of a PLY file as a generator writes it, all `float`, in the byte order asked for.
    fn by_hand(names: &str, rows: &[&[f32]], big: bool) -> Vec<u8> {
        let order = if big { "big" } else { "little" };
        let mut bytes = format!("ply\nformat binary_{order}_endian 1.0\nelement vertex {}\n", rows.len()).into_bytes();
        for name in names.split(' ') {
            bytes.extend(format!("property float {name}\n").bytes());
        }
        bytes.extend(b"end_header\n");
        for value in rows.concat() {
            bytes.extend(if big { value.to_be_bytes() } else { value.to_le_bytes() });
        }
        bytes
    }

    #[test]
    fn the_layouts_of_trellis_and_lgm_are_read() {
        // TRELLIS: trellis/representations/gaussian/gaussian_model.py, construct_list_of_attributes, without f_rest.
        let trellis = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
        let row = [
            1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3, 4.0, -1.0, -2.0, -3.0, 0.5, 0.5, -0.5, 0.5,
        ];
        // LGM: core/gs.py, save_ply: no normals either.
        let lgm = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
        let short = [&row[..3], &row[6..]].concat();
        let expected = Scene {
            centers: vec![Vec3::new(1.0, 2.0, 3.0)],
            log_scales: vec![Vec3::new(-1.0, -2.0, -3.0)],
            rotations: vec![Quat::from_xyzw(0.5, -0.5, 0.5, 0.5)],
            opacity_logits: vec![4.0],
            sh_dc: vec![[0.1, 0.2, 0.3]],
            ..Scene::default()
        };
        for big in [false, true] {
            assert_eq!(read(&by_hand(trellis, &[&row], big)).unwrap(), expected);
            assert_eq!(read(&by_hand(lgm, &[&short], big)).unwrap(), expected);
        }
    }

    #[test]
    fn elements_before_the_vertices_are_skipped() {
        let plain = write(&scene(1)).unwrap();
        let at = plain.windows(14).position(|w| w == b"element vertex").unwrap();
        let end = plain.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        let other = b"element camera 2\nproperty uchar id\nproperty double fov\n".as_slice();
        let bytes = [&plain[..at], other, &plain[at..end], &[7; 18], &plain[end..]].concat();
        assert_eq!(read(&bytes).unwrap(), scene(1));
    }

    #[test]
    fn a_mesh_is_told_by_its_properties() {
        let mesh = by_hand("x y z red", &[&[0.0; 4]], false);
        let message = read(&mesh).unwrap_err().to_string();
        assert!(
            message.contains("`f_dc_0`") && message.contains("x y z red"),
            "{message}"
        );
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
            (text("ply\nformat middle_endian 1.0\n"), "middle_endian"),
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
