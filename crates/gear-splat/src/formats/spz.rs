//! SPZ: a gzip stream of quantised attributes, about a tenth of a PLY (github.com/nianticlabs/spz, README and
//! `load-spz.cc`). Versions 2 and 3 are read, 3 is written. The crate `spz` brings a command line and an asynchronous
//! runtime for what is two pages here.
//!
//! A header of 16 bytes (magic `NGSP`, version, number of Gaussians n, SH degree, fractional bits, flags, 0), then each
//! attribute for all Gaussians:
//!
//! | bytes | attribute | value | range | largest error |
//! |---|---|---|---|---|
//! | 9 n | centres | 24-bit fixed point with so many fractional bits | ±2²³⁻ᵇ | 2⁻ᵇ⁻¹ |
//! | n | opacities | `255 α` | [0, 1] | 0.002 |
//! | 3 n | `f_dc` | `255 (0.15 f_dc + 0.5)` | colours −0.44…1.44 | 0.0037 in colour |
//! | 3 n | log scales | `16 (s + 10)` | 4.5e-5…379 units | 1/32, 3.2 % |
//! | 4 n | rotations (3) | index of the largest component, the others in sign and 9 bits of √½ | | 0.3° |
//! | 3 n | rotations (2) | `127.5 (1 + q)` of x y z, where w ≥ 0 | | 3° away from half turns |
//! | | higher SH | `128 (1 + c)`, coefficient by coefficient, r g b each | [−1, 1) | 0.004 |
//!
//! Little endian. Written files have as many fractional bits b as their farthest centre allows, at most 24 (the reference
//! encoder always takes 12, which is a fifth of a pixel of a 768 px painting), and keep all 8 bits of SH. The canonical
//! camera is not kept. The format's axes are x right, y up, z towards the viewer, as ours are; nothing is turned. Opacities
//! 0 and 1 are read as logits of ∓16. Vendor extensions after the data are not read.

use std::io::{ErrorKind, Read, Write};

use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use glam::{DQuat, Quat, Vec3};

use crate::{Scene, logit, sh};

use super::loss::{Cut, finite};
use super::{Format, FormatError, Loss, Written, check_count};

const MAGIC: [u8; 4] = *b"NGSP";
const HEADER: usize = 16;
const GZIP: [u8; 2] = [0x1f, 0x8b];
/// Deflate cannot make more bytes out of one.
const MOST_EXPANSION: u64 = 1032;
const DC_SCALE: f64 = 0.15;
/// Largest coordinate in fixed point.
const FIXED_MAX: f64 = 8_388_607.0;
const BITS_MAX: i32 = 24;
const ANTIALIASED: u8 = 1;
const EXTENSIONS: u8 = 2;

/// Whether these bytes begin an SPZ file: a gzip stream, or a bare header as version 4 has.
pub(super) fn begins(bytes: &[u8]) -> bool {
    bytes.starts_with(&GZIP) || bytes.starts_with(&MAGIC)
}

/// What a header says.
struct Header {
    version: u32,
    count: u64,
    sh_degree: u8,
    fractional_bits: u8,
    flags: u8,
}

impl Header {
    fn parse(bytes: &[u8; HEADER]) -> Result<Self, FormatError> {
        let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| bytes[at + i]));
        if !bytes.starts_with(&MAGIC) {
            return Err(FormatError::Header {
                format: Format::Spz,
                cause: "the gzip stream does not begin with `NGSP`; unpack it if it holds another format".into(),
            });
        }
        let header = Self {
            version: word(4),
            count: word(8).into(),
            sh_degree: bytes[12],
            fractional_bits: bytes[13],
            flags: bytes[14],
        };
        let unsupported = |found: String, help| {
            Err(FormatError::Unsupported {
                format: Format::Spz,
                found,
                help,
            })
        };
        if !matches!(header.version, 2 | 3) {
            return unsupported(
                format!("version {}", header.version),
                "versions 2 and 3 are; SplatTransform makes version 3 of a later one (`--spz-version 3`)",
            );
        }
        if header.sh_degree > 4 {
            return unsupported(format!("SH degree {}", header.sh_degree), "degrees 0 to 4 are read");
        }
        if header.fractional_bits > 30 {
            return unsupported(
                format!("a fixed point of {} fractional bits", header.fractional_bits),
                "at most 30 are read; the file is damaged",
            );
        }
        check_count(header.count, Format::Spz)?;
        Ok(header)
    }

    fn rotation_bytes(&self) -> usize {
        if self.version >= 3 { 4 } else { 3 }
    }

    /// Bytes of higher SH a Gaussian.
    fn sh_bytes(&self) -> usize {
        sh::rest_count(self.sh_degree)
    }

    fn gaussian_bytes(&self) -> usize {
        9 + 1 + 3 + 3 + self.rotation_bytes() + self.sh_bytes()
    }

    fn truncated(&self, held: u64) -> FormatError {
        FormatError::Truncated {
            format: Format::Spz,
            promised: self.count,
            unit: "Gaussians",
            room: held / self.gaussian_bytes() as u64,
        }
    }
}

/// Reads a scene, and what of the file is not in it.
pub fn read(bytes: &[u8]) -> Result<(Scene, Vec<String>), FormatError> {
    let mut stream: Box<dyn Read + '_> = if bytes.starts_with(&GZIP) {
        Box::new(GzDecoder::new(bytes))
    } else {
        Box::new(bytes)
    };
    let mut head = [0; HEADER];
    stream.read_exact(&mut head).map_err(|e| match e.kind() {
        ErrorKind::UnexpectedEof => data("it ends within the header; it is truncated, get it again".into()),
        _ => corrupt(&e),
    })?;
    let header = Header::parse(&head)?;

    let needed = header.count * header.gaussian_bytes() as u64;
    let possible = (bytes.len() as u64).saturating_mul(MOST_EXPANSION);
    if needed > possible {
        return Err(header.truncated(possible));
    }
    let mut packed = Vec::new();
    match stream.by_ref().take(needed).read_to_end(&mut packed) {
        Err(e) if e.kind() != ErrorKind::UnexpectedEof => return Err(corrupt(&e)),
        _ if (packed.len() as u64) < needed => return Err(header.truncated(packed.len() as u64)),
        _ => {}
    }
    // To the end, where gzip's checksum is compared; what stands here are extensions, and they are short.
    std::io::copy(&mut stream.take(1 << 20), &mut std::io::sink()).map_err(|e| corrupt(&e))?;
    Ok((unpack(&packed, &header), notes(&header)))
}

fn notes(header: &Header) -> Vec<String> {
    let mut notes = Vec::new();
    if header.flags & ANTIALIASED != 0 {
        notes.push("the SPZ file says that its scene was made for an anti-aliased renderer; that is not kept".into());
    }
    if header.flags & EXTENSIONS != 0 {
        let shifted = if header.sh_degree > 0 {
            "; if one of them quantises SH anew, colours are off"
        } else {
            ""
        };
        notes.push(format!("the vendor extensions of the SPZ file are not read{shifted}"));
    }
    if header.sh_degree > sh::MAX_DEGREE {
        notes.push(format!("SH degree {} is cut to {}", header.sh_degree, sh::MAX_DEGREE));
    }
    notes
}

/// The scene in `packed`, which holds all that the header promises.
fn unpack(packed: &[u8], header: &Header) -> Scene {
    let count = packed.len() / header.gaussian_bytes();
    let mut rest = packed;
    let mut section = |bytes: usize| {
        let (mine, after) = rest.split_at(count * bytes);
        rest = after;
        mine
    };
    let (centers, opacities, colors, scales) = (section(9), section(1), section(3), section(3));
    let (rotations, higher) = (section(header.rotation_bytes()), section(header.sh_bytes()));

    let step = 1.0 / f64::from(1u32 << header.fractional_bits);
    let fixed = |b: &[u8]| f64::from(i32::from_le_bytes([0, b[0], b[1], b[2]]) >> 8) * step;
    let vectors = |bytes: &[u8], value: &dyn Fn(u8) -> f64| -> Vec<[f32; 3]> {
        let three = |b: &[u8]| [b[0], b[1], b[2]].map(|b| value(b) as f32);
        bytes.chunks_exact(3).map(three).collect()
    };
    let mut scene = Scene {
        centers: centers
            .chunks_exact(9)
            .map(|b| Vec3::from([&b[..3], &b[3..6], &b[6..]].map(|b| fixed(b) as f32)))
            .collect(),
        opacity_logits: opacities.iter().map(|&b| logit(f32::from(b) / 255.0)).collect(),
        sh_dc: vectors(colors, &|b| (f64::from(b) / 255.0 - 0.5) / DC_SCALE),
        log_scales: vectors(scales, &|b| f64::from(b) / 16.0 - 10.0)
            .into_iter()
            .map(Vec3::from)
            .collect(),
        sh_degree: header.sh_degree.min(sh::MAX_DEGREE),
        ..Scene::default()
    };
    scene.rotations = match header.version {
        2 => rotations.chunks_exact(3).map(first_three).collect(),
        _ => rotations
            .chunks_exact(4)
            .map(|b| smallest_three(u32::from_le_bytes([b[0], b[1], b[2], b[3]])))
            .collect(),
    };
    let bands = sh::bands(scene.sh_degree);
    for coefficients in higher.chunks_exact(header.sh_bytes().max(1)) {
        for channel in 0..3 {
            let value = |k: usize| (f32::from(coefficients[3 * k + channel]) - 128.0) / 128.0;
            scene.sh_rest.extend((0..bands).map(value));
        }
    }
    scene
}

/// Version 2: x, y and z; w is what is left, and not negative.
fn first_three(bytes: &[u8]) -> Quat {
    let [x, y, z] = [bytes[0], bytes[1], bytes[2]].map(|b| f64::from(b) / 127.5 - 1.0);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    DQuat::from_xyzw(x, y, z, w).normalize().as_quat()
}

/// Version 3: two bits say which of x y z w is left out, then ten bits for each other one, sign first.
fn smallest_three(word: u32) -> Quat {
    let largest = (word >> 30) as usize;
    let mut q = [0.0f64; 4];
    let mut square = 0.0;
    let mut shift = 30;
    for (i, component) in q.iter_mut().enumerate() {
        if i != largest {
            shift -= 10;
            let ten = word >> shift;
            let magnitude = f64::from(ten & 511) / 511.0 * std::f64::consts::FRAC_1_SQRT_2;
            *component = if ten & 512 == 0 { magnitude } else { -magnitude };
            square += magnitude * magnitude;
        }
    }
    q[largest] = (1.0 - square).max(0.0).sqrt();
    DQuat::from_array(q).normalize().as_quat()
}

fn pack_smallest_three(rotation: Quat) -> u32 {
    let q = rotation.as_dquat().normalize().to_array();
    let mut largest = 0;
    for i in 1..4 {
        if q[i].abs() > q[largest].abs() {
            largest = i;
        }
    }
    let mut word = largest as u32;
    for (i, component) in q.into_iter().enumerate() {
        if i != largest {
            let sign = u32::from((component < 0.0) != (q[largest] < 0.0));
            let magnitude = (511.0 * (component.abs() / std::f64::consts::FRAC_1_SQRT_2) + 0.5) as u32;
            word = word << 10 | sign << 9 | magnitude.min(511);
        }
    }
    word
}

/// Writes a scene as version 3.
pub fn write(scene: &Scene) -> Result<Written, FormatError> {
    scene.validate()?;
    let (scene, mut losses) = finite(scene);
    check_count(scene.len() as u64, Format::Spz)?;
    let bits = fractional_bits(&scene);
    let step = 1.0 / f64::from(1u32 << bits);

    let mut packed = Vec::with_capacity(HEADER + scene.len() * (20 + scene.sh_rest_stride()));
    packed.extend(MAGIC);
    packed.extend(3u32.to_le_bytes());
    packed.extend((scene.len() as u32).to_le_bytes());
    packed.extend([scene.sh_degree, bits as u8, 0, 0]);

    let mut centers_cut = Cut::to(-FIXED_MAX, FIXED_MAX);
    for x in scene.centers.iter().flat_map(|c| c.to_array()) {
        let fixed = centers_cut.value(f64::from(x) / step, 1.0);
        packed.extend(&(libm::round(fixed) as i32).to_le_bytes()[..3]);
    }
    let byte = |x: f64| libm::round(x) as u8;
    packed.extend((0..scene.len()).map(|i| byte(255.0 * f64::from(scene.opacity(i)))));
    let mut colors_cut = Cut::to(0.0, 255.0);
    for &dc in scene.sh_dc.as_flattened() {
        packed.push(byte(colors_cut.value(255.0 * (DC_SCALE * f64::from(dc) + 0.5), 1.0)));
    }
    let mut scales_cut = Cut::to(0.0, 255.0);
    for log in scene.log_scales.iter().flat_map(|s| s.to_array()) {
        packed.push(byte(scales_cut.value(16.0 * (f64::from(log) + 10.0), 1.0)));
    }
    for &rotation in &scene.rotations {
        packed.extend(pack_smallest_three(rotation).to_le_bytes());
    }
    let mut sh_cut = Cut::to(0.0, 255.0);
    let bands = sh::bands(scene.sh_degree);
    for i in 0..scene.len() {
        let rest = scene.sh_rest_of(i);
        for k in 0..bands {
            for channel in 0..3 {
                let coefficient = f64::from(rest[channel * bands + k]);
                packed.push(byte(sh_cut.value(128.0 * (1.0 + coefficient), 2.0)));
            }
        }
    }

    losses.extend(scene.canonical_camera.map(|_| Loss::CanonicalCamera));
    losses.extend(centers_cut.loss("coordinates", "±8388607 units"));
    losses.extend(colors_cut.loss("colour components", "[-0.44, 1.44]"));
    losses.extend(scales_cut.loss("standard deviations", "[4.5e-5, 379]"));
    losses.extend(sh_cut.loss("SH coefficients", "[-1, 0.992]"));
    losses.push(Loss::Rounded(format!(
        "centres to {:.1e} units, standard deviations to 3 %, colours to 1/270, opacities to 1/510, rotations to 0.3°",
        0.5 * step
    )));
    Ok(Written {
        bytes: gzip(&packed)?,
        losses,
    })
}

/// As many as the farthest coordinate leaves.
fn fractional_bits(scene: &Scene) -> i32 {
    let farthest = scene
        .centers
        .iter()
        .fold(0.0f32, |most, c| most.max(c.abs().max_element()));
    let fits = |bits: &i32| f64::from(farthest) * f64::from(1u32 << *bits) <= FIXED_MAX;
    (0..=BITS_MAX).rev().find(fits).unwrap_or(0)
}

fn gzip(bytes: &[u8]) -> Result<Vec<u8>, FormatError> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder
        .write_all(bytes)
        .and_then(|()| encoder.finish())
        .map_err(|e| data(format!("it cannot be compressed: {e}")))
}

fn data(cause: String) -> FormatError {
    FormatError::Data {
        format: Format::Spz,
        cause,
    }
}

fn corrupt(error: &std::io::Error) -> FormatError {
    data(format!("the gzip stream is damaged ({error}); get the file again"))
}

#[cfg(test)]
mod tests;
