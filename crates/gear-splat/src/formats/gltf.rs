//! glTF 2.0, binary (`.glb`), with the extension `KHR_gaussian_splatting`. Write only.
//!
//! Follows the extension as Khronos ratified it in 2026 (KhronosGroup/glTF, `extensions/2.0/Khronos/KHR_gaussian_splatting`;
//! the release candidate of February 2026 has the same attributes, drafts before it stored scales as logarithms). One mesh
//! primitive of points with kernel `ellipse` and colour space `srgb_rec709_display`; every attribute is f32 in a buffer
//! view of its own:
//!
//! | attribute | |
//! |---|---|
//! | `POSITION` | centres |
//! | `KHR_gaussian_splatting:ROTATION` | unit quaternions x y z w |
//! | `KHR_gaussian_splatting:SCALE` | standard deviations, linear |
//! | `KHR_gaussian_splatting:OPACITY` | opacities in [0, 1], linear |
//! | `KHR_gaussian_splatting:SH_DEGREE_l_COEF_n` | SH, r g b, `l` up to the scene's degree, `n` from order −l |
//! | `COLOR_0` | for viewers that know points only: linear colour of SH degree 0, and opacity; 16 bits |
//!
//! Kept: centres and SH bit for bit, the rest to f32 (standard deviations and opacities to 1e-7 of their values, rotations
//! to 1e-7). Axes are glTF's: x right, y up, z towards the viewer. The canonical camera stands in the extras of the glTF
//! scene, as `gear.canonical_camera`. A scene without Gaussians cannot be written: glTF wants at least one point.

use glam::Vec3;
use serde_json::{Value, json};

use crate::{Scene, sh};

use super::loss::{Cut, finite};
use super::{Format, FormatError, Written};

const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const ARRAY_BUFFER: u32 = 34962;
const POINTS: u32 = 0;
const NAME: &str = "KHR_gaussian_splatting";

/// The binary part and what describes it.
#[derive(Default)]
struct Buffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    attributes: serde_json::Map<String, Value>,
}

impl Buffer {
    /// Adds an attribute whose values were appended to the bytes from `start` on.
    fn attribute(&mut self, name: &str, kind: &str, component: u32, count: usize, start: usize) {
        self.attributes.insert(name.into(), json!(self.accessors.len()));
        self.accessors.push(json!({
            "bufferView": self.views.len(), "componentType": component, "count": count, "type": kind,
            "normalized": component != FLOAT,
        }));
        self.views.push(json!({
            "buffer": 0, "byteOffset": start, "byteLength": self.bytes.len() - start, "target": ARRAY_BUFFER,
        }));
    }

    /// Adds an attribute of N floats a Gaussian.
    fn floats<const N: usize>(&mut self, name: &str, count: usize, value: impl FnMut(usize) -> [f32; N]) {
        let start = self.bytes.len();
        for x in (0..count).flat_map(value) {
            self.bytes.extend(x.to_le_bytes());
        }
        let kind = match N {
            1 => "SCALAR",
            3 => "VEC3",
            _ => "VEC4",
        };
        self.attribute(name, kind, FLOAT, count, start);
    }
}

/// Writes a scene.
pub fn write(scene: &Scene) -> Result<Written, FormatError> {
    scene.validate()?;
    let (scene, mut losses) = finite(scene);
    let format = Format::Glb;
    let count = scene.len();
    if count == 0 {
        return Err(FormatError::NoGaussians { format });
    }
    // Lengths in a GLB file have 32 bits; what is no attribute takes less than the margin.
    let gaussian_bytes = 4 * (3 + 4 + 3 + 1 + 3 + scene.sh_rest_stride()) + 8;
    let most = (u64::from(u32::MAX) - (1 << 20)) / gaussian_bytes as u64;
    if count as u64 > most {
        return Err(FormatError::TooMany {
            format,
            found: count as u64,
            most,
        });
    }

    let mut scales_cut = Cut::to(0.0, f64::from(f32::MAX));
    let mut buffer = Buffer::default();
    buffer.bytes.reserve_exact(count * gaussian_bytes);
    buffer.floats("POSITION", count, |i| scene.centers[i].to_array());
    let (low, high) = corners(&scene.centers);
    buffer.accessors[0]["min"] = json!(low.to_array());
    buffer.accessors[0]["max"] = json!(high.to_array());
    buffer.floats(&named("ROTATION"), count, |i| {
        scene.rotations[i].as_dquat().normalize().as_quat().to_array()
    });
    buffer.floats(&named("SCALE"), count, |i| {
        let linear = |log: f32| scales_cut.value(libm::exp(f64::from(log)), 0.0) as f32;
        scene.log_scales[i].to_array().map(linear)
    });
    buffer.floats(&named("OPACITY"), count, |i| [scene.opacity(i)]);
    buffer.floats(&named("SH_DEGREE_0_COEF_0"), count, |i| scene.sh_dc[i]);
    let bands = sh::bands(scene.sh_degree);
    for degree in 1..=scene.sh_degree {
        let before = sh::bands(degree - 1);
        for n in 0..=2 * usize::from(degree) {
            buffer.floats(&named(&format!("SH_DEGREE_{degree}_COEF_{n}")), count, |i| {
                [0, 1, 2].map(|channel| scene.sh_rest_of(i)[channel * bands + before + n])
            });
        }
    }
    let start = buffer.bytes.len();
    for i in 0..count {
        let [r, g, b] = scene.color(i).map(|c| gear_image::colour::to_linear(c.clamp(0.0, 1.0)));
        for share in [r, g, b, scene.opacity(i)] {
            buffer.bytes.extend(((share * 65535.0 + 0.5) as u16).to_le_bytes());
        }
    }
    buffer.attribute("COLOR_0", "VEC4", UNSIGNED_SHORT, count, start);

    losses.extend(scales_cut.loss("standard deviations", "what f32 holds"));
    Ok(Written {
        bytes: glb(&document(&scene, &buffer)?, &buffer.bytes),
        losses,
    })
}

fn named(attribute: &str) -> String {
    format!("{NAME}:{attribute}")
}

fn corners(centers: &[Vec3]) -> (Vec3, Vec3) {
    let first = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    centers.iter().fold(first, |(low, high), c| (low.min(*c), high.max(*c)))
}

fn document(scene: &Scene, buffer: &Buffer) -> Result<Value, FormatError> {
    let mut stage = json!({ "nodes": [0] });
    if let Some(camera) = &scene.canonical_camera {
        if !camera.is_valid() {
            return Err(FormatError::Camera);
        }
        stage["extras"] = json!({ "gear": { "canonical_camera": camera } });
    }
    Ok(json!({
        "asset": { "version": "2.0", "generator": concat!("gear ", env!("CARGO_PKG_VERSION")) },
        "extensionsUsed": [NAME],
        "scene": 0,
        "scenes": [stage],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{
            "attributes": buffer.attributes,
            "mode": POINTS,
            "extensions": { NAME: { "kernel": "ellipse", "colorSpace": "srgb_rec709_display" } },
        }] }],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{ "byteLength": buffer.bytes.len() }],
    }))
}

/// The container: a header of 12 bytes and two chunks, each padded to 4 bytes.
fn glb(document: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let padded = binary.len().next_multiple_of(4);
    let total = 12 + 8 + text.len() + 8 + padded;
    let mut out = Vec::with_capacity(total);
    let word = |out: &mut Vec<u8>, n: usize| out.extend((n as u32).to_le_bytes());
    out.extend(b"glTF");
    word(&mut out, 2);
    word(&mut out, total);
    word(&mut out, text.len());
    out.extend(b"JSON");
    out.extend(text);
    word(&mut out, padded);
    out.extend(b"BIN\0");
    out.extend(binary);
    out.resize(total, 0);
    out
}

#[cfg(test)]
mod tests;
