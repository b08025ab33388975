//! PlayCanvas compressed PLY: 16 bytes a Gaussian, as SuperSplat and SplatTransform write it. Read only.
//!
//! Source: PlayCanvas' user manual, "The compressed PLY format", and the reader of `@playcanvas/splat-transform`.
//! Gaussians come in chunks of 256. A row of the element `chunk` holds the range of each quantity in its chunk:
//! `min_x…max_z` of the centres, `min_scale_x…max_scale_z` of the log scales and, in files since 2024, `min_r…max_b` of the
//! colours. A row of `vertex` holds four words of 32 bits, first quantity in the highest bits:
//!
//! | word | bits | |
//! |---|---|---|
//! | `packed_position` | 11 10 11 | x y z, as shares of the chunk's range |
//! | `packed_rotation` | 2 10 10 10 | which of w x y z is largest and left out; the others, of [−√½, √½] |
//! | `packed_scale` | 11 10 11 | log scales, as shares of the chunk's range |
//! | `packed_color` | 8 8 8 8 | r g b, as shares of the chunk's range or of [0, 1]; opacity |
//!
//! The optional element `sh` holds 9, 24 or 45 bytes `f_rest_…` a Gaussian, over [−4, 4], channel-major.
//! Opacities 0 and 1 become logits of ∓16.

use glam::{Quat, Vec3};

use crate::{Scene, logit, sh};

use super::ply_header::{self, Body, Element, Header};
use super::{Format, FormatError, check_count};

const CHUNK: usize = 256;
const FORMAT: Format = Format::CompressedPly;
const RANGES: [&str; 12] = [
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "min_scale_x",
    "min_scale_y",
    "min_scale_z",
    "max_scale_x",
    "max_scale_y",
    "max_scale_z",
];
const COLOR_RANGES: [&str; 6] = ["min_r", "min_g", "min_b", "max_r", "max_g", "max_b"];
const WORDS: [&str; 4] = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];

/// Whether a PLY header is one of this format.
pub(super) fn is_one(header: &Header) -> bool {
    let packed = |e: &Element| e.find(WORDS[0]).is_some();
    header.element("chunk").is_some() && header.element("vertex").is_some_and(packed)
}

/// The ranges of one chunk.
#[derive(Clone, Copy)]
struct Ranges {
    center: [[f64; 3]; 2],
    scale: [[f64; 3]; 2],
    color: [[f64; 3]; 2],
}

/// Reads a scene.
pub fn read(bytes: &[u8]) -> Result<Scene, FormatError> {
    let header = ply_header::parse(bytes)?;
    let element = |name| {
        header
            .element(name)
            .ok_or_else(|| missing(format!("element {name}"), None))
    };
    let (chunks, vertices) = (element("chunk")?, element("vertex")?);
    let ranges_at = columns(chunks, RANGES)?;
    let colors_at = match chunks.find(COLOR_RANGES[0]) {
        Some(_) => Some(columns(chunks, COLOR_RANGES)?),
        None => None,
    };
    let words_at = columns(vertices, WORDS)?;
    check_count(vertices.count, FORMAT)?;
    if vertices.count.div_ceil(CHUNK as u64) != chunks.count {
        return Err(data(format!(
            "{} Gaussians and {} chunks; expected a chunk for every {CHUNK}",
            vertices.count, chunks.count
        )));
    }

    let mut scene = Scene {
        canonical_camera: header.camera,
        ..Scene::default()
    };
    let mut ranges = Vec::new();
    let mut words: Vec<[u32; 4]> = Vec::new();
    let mut body = Body::new(bytes, &header, FORMAT)?;
    for element in &header.elements {
        match element.name.as_str() {
            "chunk" => body.rows(element, "chunks", |row| {
                let three = |at: &[usize]| [row[at[0]], row[at[1]], row[at[2]]];
                let color = colors_at.map_or([[0.0; 3], [1.0; 3]], |at| [three(&at[..3]), three(&at[3..])]);
                ranges.push(Ranges {
                    center: [three(&ranges_at[..3]), three(&ranges_at[3..6])],
                    scale: [three(&ranges_at[6..9]), three(&ranges_at[9..])],
                    color,
                });
            })?,
            "vertex" => body.rows(element, "Gaussians", |row| {
                words.push(words_at.map(|at| row[at] as u32))
            })?,
            "sh" => {
                let at = sh_columns(element, vertices, &mut scene)?;
                let rest = &mut scene.sh_rest;
                body.rows(element, "rows of SH", |row| {
                    rest.extend(at.iter().map(|&at| sh_value(row[at])))
                })?;
            }
            _ => body.rows(element, "rows of another element", |_| {})?,
        }
    }
    for (i, words) in words.iter().enumerate() {
        push(*words, &ranges[i / CHUNK], &mut scene);
    }
    Ok(scene)
}

fn push([position, rotation, scale, color]: [u32; 4], ranges: &Ranges, scene: &mut Scene) {
    let within = |[low, high]: [[f64; 3]; 2], shares: [f64; 3]| -> [f32; 3] {
        std::array::from_fn(|i| (low[i] * (1.0 - shares[i]) + high[i] * shares[i]) as f32)
    };
    scene
        .centers
        .push(Vec3::from(within(ranges.center, eleven_ten_eleven(position))));
    scene
        .log_scales
        .push(Vec3::from(within(ranges.scale, eleven_ten_eleven(scale))));
    scene.rotations.push(quaternion(rotation));
    let [r, g, b, opacity] = [24, 16, 8, 0].map(|shift| share(color >> shift, 8));
    scene.sh_dc.push(within(ranges.color, [r, g, b]).map(sh::dc_from_color));
    scene.opacity_logits.push(logit(opacity as f32));
}

/// The lowest `bits` bits as a share of their range.
fn share(word: u32, bits: u32) -> f64 {
    let most = (1 << bits) - 1;
    f64::from(word & most) / f64::from(most)
}

fn eleven_ten_eleven(word: u32) -> [f64; 3] {
    [share(word >> 21, 11), share(word >> 11, 10), share(word, 11)]
}

fn quaternion(word: u32) -> Quat {
    let three = [20, 10, 0].map(|shift| (share(word >> shift, 10) - 0.5) * std::f64::consts::SQRT_2);
    let rest = 1.0 - three.iter().fold(0.0, |sum, x| sum + x * x);
    // w x y z: the largest is put in where it was left out.
    let mut wxyz = [three[0], three[1], three[2], 0.0];
    let largest = (word >> 30) as usize;
    wxyz.copy_within(largest..3, largest + 1);
    wxyz[largest] = rest.max(0.0).sqrt();
    let [w, x, y, z] = wxyz.map(|x| x as f32);
    Quat::from_xyzw(x, y, z, w)
}

/// The ends of the byte range are exact, everything between stands for the middle of its step.
fn sh_value(byte: f64) -> f32 {
    let share = match byte {
        0.0 => 0.0,
        255.0 => 1.0,
        _ => (byte + 0.5) / 256.0,
    };
    ((share - 0.5) * 8.0) as f32
}

/// Columns of `f_rest_…` in order; sets the scene's SH degree.
fn sh_columns(element: &Element, vertices: &Element, scene: &mut Scene) -> Result<Vec<usize>, FormatError> {
    let count = element.properties.len();
    scene.sh_degree = (1..=sh::MAX_DEGREE)
        .find(|&degree| sh::rest_count(degree) == count)
        .ok_or(FormatError::RestCount(count))?;
    if element.count != vertices.count {
        return Err(data(format!(
            "{} rows of SH; expected one for each of {} Gaussians",
            element.count, vertices.count
        )));
    }
    let find = |i| {
        let name = format!("f_rest_{i}");
        element.find(&name).ok_or_else(|| missing(name, Some(element)))
    };
    (0..count).map(find).collect()
}

fn columns<const N: usize>(element: &Element, names: [&str; N]) -> Result<[usize; N], FormatError> {
    let mut at = [0; N];
    for (at, name) in at.iter_mut().zip(names) {
        *at = element.find(name).ok_or_else(|| missing(name.into(), Some(element)))?;
    }
    Ok(at)
}

fn data(cause: String) -> FormatError {
    FormatError::Data { format: FORMAT, cause }
}

fn missing(what: String, element: Option<&Element>) -> FormatError {
    let among = element.map_or(String::new(), |e| {
        format!(" in the element `{}`; found {}", e.name, e.listed())
    });
    FormatError::Header {
        format: FORMAT,
        cause: format!("no `{what}`{among}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bytes of a compressed PLY with one chunk, made from the table above and no code of the reader.
    fn by_hand(color_ranges: bool, sh: usize, words: &[[u32; 4]]) -> Vec<u8> {
        let mut head = String::from("ply\nformat binary_little_endian 1.0\ncomment made by hand\nelement chunk 1\n");
        let (first, colors) = (RANGES.len(), if color_ranges { COLOR_RANGES.len() } else { 0 });
        for name in RANGES.iter().chain(&COLOR_RANGES[..colors]) {
            head.push_str(&format!("property float {name}\n"));
        }
        head.push_str(&format!("element vertex {}\n", words.len()));
        for name in WORDS {
            head.push_str(&format!("property uint {name}\n"));
        }
        if sh > 0 {
            head.push_str(&format!("element sh {}\n", words.len()));
            (0..sh).for_each(|i| head.push_str(&format!("property uchar f_rest_{i}\n")));
        }
        let mut bytes = (head + "end_header\n").into_bytes();
        let ranges: [f32; 18] = [
            -1.0, 0.0, 2.0, 1.0, 10.0, 6.0, -8.0, -7.0, -6.0, 0.0, -5.0, -2.0, -0.5, 0.0, 0.0, 1.5, 1.0, 2.0,
        ];
        for value in &ranges[..first + colors] {
            bytes.extend(value.to_le_bytes());
        }
        for word in words.concat() {
            bytes.extend(word.to_le_bytes());
        }
        for i in 0..words.len() * sh {
            bytes.push([0, 255, 127, 128][i % 4]);
        }
        bytes
    }

    /// x at the end of its range, y in the middle (512/1023), z at the start; opacity 51/255.
    const WORD: [u32; 4] = [
        (2047 << 21) | (512 << 11),
        (2 << 30) | (1023 << 20) | (512 << 10),
        (1 << 11) | 2047,
        0xff_00_80_33,
    ];

    #[test]
    fn a_file_made_by_hand_is_read() {
        let scene = read(&by_hand(true, 9, &[WORD])).unwrap();
        let close = |a: Vec3, b: Vec3| assert!((a - b).length() < 1e-5, "{a} {b}");
        close(scene.centers[0], Vec3::new(1.0, 10.0 * 512.0 / 1023.0, 2.0));
        close(scene.log_scales[0], Vec3::new(-8.0, -7.0 + 2.0 / 1023.0, -2.0));
        let color = scene.color(0);
        close(color.into(), Vec3::new(1.5, 0.0, 2.0 * 128.0 / 255.0));
        assert!((scene.opacity(0) - 0.2).abs() < 1e-6);
        // The third of w x y z is left out: w = √½, x = 1/1023·√½, z = −√½, so y is nearly nothing.
        let (q, half) = (scene.rotations[0], 0.5f32.sqrt());
        assert!((q.w - half).abs() < 1e-6 && (q.x - half / 1023.0).abs() < 1e-6 && (q.z + half).abs() < 1e-6);
        assert!(q.y.abs() < 1e-3);
        assert_eq!(scene.sh_degree, 1);
        assert_eq!(scene.sh_rest[..4], [-4.0, 4.0, -0.015625, 0.015625]);
        scene.validate().unwrap();
    }

    #[test]
    fn every_place_of_the_largest_component_is_read() {
        for which in 0..4u32 {
            let zero_point = (512 << 20) | (512 << 10) | 512;
            let q = quaternion((which << 30) | zero_point);
            let wxyz = [q.w, q.x, q.y, q.z];
            assert!(wxyz[which as usize] > 0.99, "{which}: {wxyz:?}");
            assert!((q.length() - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn without_colour_ranges_colours_span_zero_to_one() {
        let scene = read(&by_hand(false, 0, &[WORD, WORD])).unwrap();
        assert_eq!((scene.len(), scene.sh_degree), (2, 0));
        assert!((scene.color(1)[0] - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_does_not_fit_together_is_named() {
        let good = by_hand(true, 9, &[WORD; 3]);
        let replaced = |from: &str, to: &str| {
            let at = good.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
            [&good[..at], to.as_bytes(), &good[at + from.len()..]].concat()
        };
        let cases = [
            (replaced("element chunk 1", "element chunk 2"), "2 chunks"),
            (replaced("element vertex 3", "element vertex 4000000000"), "at most"),
            (replaced("element sh 3", "element sh 2"), "2 rows of SH"),
            (
                replaced("property float min_scale_y", "property float min_scale"),
                "min_scale_y",
            ),
            (
                replaced("property uint packed_scale", "property uint packed"),
                "packed_scale",
            ),
            (replaced("property uchar f_rest_8\n", ""), "8 f_rest"),
            (good[..good.len() - 1].to_vec(), "truncated"),
        ];
        for (bytes, part) in cases {
            let message = read(&bytes).unwrap_err().to_string();
            assert!(message.contains(part), "{message} should mention {part}");
        }
    }
}
