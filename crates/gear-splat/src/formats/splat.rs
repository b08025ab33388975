//! `.splat`: records of 32 bytes without a header, by antimatter15's viewer (`convert.py` of github.com/antimatter15/splat).
//!
//! | bytes | |
//! |---|---|
//! | 12 | centre, f32 × 3 |
//! | 12 | standard deviations, f32 × 3 |
//! | 4 | r g b of SH degree 0, and opacity, as shares of 255 |
//! | 4 | quaternion w x y z: `128 + 128 q`, at most 255 |
//!
//! Little endian. Kept: centres bit for bit, standard deviations to f32 (a log scale to 4e-6). Colours and opacities are
//! rounded to 1/255 of [0, 1] and cut to it; a rotation is off by at most 1.0° (half a step in each of four components, a
//! whole one at exactly 1). Higher SH and the canonical camera are not kept. Opacities 0 and 1 are read as logits of ∓16.
//!
//! Since there is no header, a file is taken for a `.splat` when its length fits and nearly all records could be
//! Gaussians: finite centres and scales, no negative scale, quaternions of length 1; and when it does not begin as text.

use glam::{Quat, Vec3};

use crate::{Scene, logit, sh};

use super::loss::{Cut, finite};
use super::{Format, FormatError, Loss, Written, check_count};

const RECORD: usize = 32;
/// Records that [`is_plausible`] looks at, spread over the file.
const LOOKS: usize = 1024;

/// Whether these bytes can be such records.
pub(super) fn is_plausible(bytes: &[u8]) -> bool {
    let count = bytes.len() / RECORD;
    let is_text = bytes.iter().take(LOOKS).all(u8::is_ascii);
    if count == 0 || !bytes.len().is_multiple_of(RECORD) || is_text {
        return false;
    }
    let looks = count.min(LOOKS);
    let good = (0..looks)
        .map(|i| Record::at(bytes, i * count / looks))
        .filter(Record::is_plausible)
        .count();
    // Some exporters leave a few Gaussians that are not finite.
    good * 10 >= looks * 9
}

struct Record {
    center: Vec3,
    scales: [f32; 3],
    rgba: [u8; 4],
    /// w x y z.
    rotation: [f32; 4],
}

impl Record {
    /// The `i`-th record of `bytes`, which holds it.
    fn at(bytes: &[u8], i: usize) -> Self {
        let record = &bytes[i * RECORD..(i + 1) * RECORD];
        let float = |at: usize| f32::from_le_bytes(std::array::from_fn(|b| record[4 * at + b]));
        Self {
            center: Vec3::new(float(0), float(1), float(2)),
            scales: [float(3), float(4), float(5)],
            rgba: std::array::from_fn(|b| record[24 + b]),
            rotation: std::array::from_fn(|b| (f32::from(record[28 + b]) - 128.0) / 128.0),
        }
    }

    fn is_plausible(&self) -> bool {
        let square = self.rotation.iter().fold(0.0, |sum, x| sum + x * x);
        let scales = self.scales.iter().all(|s| s.is_finite() && *s >= 0.0);
        self.center.is_finite() && scales && (0.9..1.1).contains(&square)
    }
}

/// Reads a scene.
pub fn read(bytes: &[u8]) -> Result<Scene, FormatError> {
    let (count, over) = (bytes.len() / RECORD, bytes.len() % RECORD);
    if count == 0 || over != 0 {
        return Err(FormatError::Data {
            format: Format::Splat,
            cause: format!(
                "{} bytes; expected records of {RECORD}; it may be truncated",
                bytes.len()
            ),
        });
    }
    check_count(count as u64, Format::Splat)?;
    let mut scene = Scene::default();
    for i in 0..count {
        let record = Record::at(bytes, i);
        let [w, x, y, z] = record.rotation;
        let [rgb @ .., opacity] = record.rgba.map(|byte| f32::from(byte) / 255.0);
        scene.centers.push(record.center);
        scene.log_scales.push(Vec3::from(record.scales.map(crate::scene::ln)));
        // Four zeros are no rotation; viewers take them for none.
        let q = Quat::from_xyzw(x, y, z, w);
        scene.rotations.push(if q.length_squared() > 1e-6 {
            q.normalize()
        } else {
            Quat::IDENTITY
        });
        scene.sh_dc.push(rgb.map(sh::dc_from_color));
        scene.opacity_logits.push(logit(opacity));
    }
    Ok(scene)
}

/// Writes a scene, in its own order.
pub fn write(scene: &Scene) -> Result<Written, FormatError> {
    scene.validate()?;
    let (scene, mut losses) = finite(scene);
    if scene.is_empty() {
        return Err(FormatError::NoGaussians { format: Format::Splat });
    }
    let mut scales_cut = Cut::to(f64::from(f32::MIN_POSITIVE), f64::from(f32::MAX));
    let mut colors_cut = Cut::to(0.0, 1.0);
    let mut bytes = Vec::with_capacity(scene.len() * RECORD);
    for i in 0..scene.len() {
        let scales = scene.log_scales[i].to_array().map(|log| {
            let scale = libm::exp(f64::from(log));
            scales_cut.value(scale, 0.0) as f32
        });
        for value in scene.centers[i].to_array().into_iter().chain(scales) {
            bytes.extend(value.to_le_bytes());
        }
        let color = scene.color(i).map(|c| colors_cut.value(f64::from(c), 1.0 / 255.0));
        let opacity = f64::from(scene.opacity(i));
        bytes.extend([color[0], color[1], color[2], opacity].map(|x| libm::round(x * 255.0) as u8));
        let q = scene.rotations[i].as_dquat().normalize();
        bytes.extend([q.w, q.x, q.y, q.z].map(|x| libm::round(128.0 + 128.0 * x).clamp(0.0, 255.0) as u8));
    }
    if scene.sh_degree > 0 {
        losses.push(Loss::HigherSh {
            degree: scene.sh_degree,
        });
    }
    if scene.canonical_camera.is_some() {
        losses.push(Loss::CanonicalCamera);
    }
    losses.extend(scales_cut.loss("standard deviations", "what f32 holds"));
    losses.extend(colors_cut.loss("colour components", "[0, 1]"));
    losses.push(Loss::Rounded("colours and opacities to 1/255, rotations to 1°".into()));
    Ok(Written { bytes, losses })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::tests::{angle, random};

    /// A record as the format describes it.
    fn by_hand() -> Vec<u8> {
        let mut bytes = Vec::new();
        for x in [1.5f32, -2.0, 0.25, 1.0, 0.5, 0.125] {
            bytes.extend(x.to_le_bytes());
        }
        // Colour (1, 0, 128/255), opacity 0.2; a quarter turn about z: w = z = √½ ≈ 91/128.
        bytes.extend([255, 0, 128, 51, 219, 128, 128, 219]);
        bytes
    }

    #[test]
    fn a_record_made_by_hand_is_read_and_written() {
        let scene = read(&by_hand()).unwrap();
        assert_eq!(scene.centers[0], Vec3::new(1.5, -2.0, 0.25));
        assert!((scene.scales(0) - Vec3::new(1.0, 0.5, 0.125)).length() < 1e-6);
        assert!((scene.color(0)[2] - 128.0 / 255.0).abs() < 1e-6 && (scene.opacity(0) - 0.2).abs() < 1e-6);
        assert!((scene.rotations[0] * Vec3::X - Vec3::Y).length() < 1e-6);
        assert_eq!(write(&scene).unwrap().bytes, by_hand());
    }

    #[test]
    fn a_round_trip_is_as_exact_as_promised() {
        let scene = random(500, 3);
        let written = write(&scene).unwrap();
        let back = read(&written.bytes).unwrap();
        assert_eq!(back.centers, scene.centers);
        for i in 0..scene.len() {
            assert!((back.log_scales[i] - scene.log_scales[i]).abs().max_element() < 4e-6);
            assert!((back.opacity(i) - scene.opacity(i)).abs() <= 0.501 / 255.0);
            for (a, b) in back.color(i).into_iter().zip(scene.color(i)) {
                assert!((a - b.clamp(0.0, 1.0)).abs() <= 0.501 / 255.0, "{a} {b}");
            }
            assert!(angle(back.rotations[i], scene.rotations[i]) < 1.0, "{i}");
        }
        let told: Vec<String> = written.losses.iter().map(ToString::to_string).collect();
        assert!(told.iter().any(|l| l.contains("SH degree 3")), "{told:?}");
        assert!(
            told.iter().any(|l| l.contains("colour components are outside [0, 1]")),
            "{told:?}"
        );
    }

    #[test]
    fn other_files_are_not_taken_for_records() {
        assert!(is_plausible(&by_hand().repeat(40)));
        assert!(!is_plausible(&by_hand()[1..]));
        for filling in [0u8, b'A', b'a', 128, 255] {
            assert!(!is_plausible(&[filling; 64]), "{filling}");
        }
        let mut some_broken = by_hand().repeat(40);
        some_broken[..4].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(is_plausible(&some_broken));
    }
}
