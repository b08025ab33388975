use super::*;
use crate::formats::tests::{angle, random};

/// An SPZ file from its fields, by the format's README and no code of the writer.
fn by_hand(version: u32, count: u32, degree: u8, bits: u8, flags: u8, sections: &[&[u8]]) -> Vec<u8> {
    let mut raw = b"NGSP".to_vec();
    raw.extend(version.to_le_bytes());
    raw.extend(count.to_le_bytes());
    raw.extend([degree, bits, flags, 0]);
    raw.extend(sections.concat());
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(&raw).unwrap();
    encoder.finish().unwrap()
}

/// 1, −½ and 2¼ with 12 fractional bits: 4096, −2048 and 9216 in 24 bits.
const CENTER: &[u8] = &[0x00, 0x10, 0x00, 0x00, 0xf8, 0xff, 0x00, 0x24, 0x00];
/// Opacity 0.2.
const OPACITY: &[u8] = &[51];
const COLOR: &[u8] = &[255, 0, 128];
/// Log scales 0, −5, −10.
const SCALES: &[u8] = &[160, 80, 0];
/// A quarter turn about z. z = w = √½: z, the first of equals, is left out (2), w is 511 in the lowest bits.
const QUARTER_3: &[u8] = &[0xff, 0x01, 0x00, 0x80];
const QUARTER_2: &[u8] = &[128, 128, 218];
/// Three coefficients of r, g and b each.
const SH: &[u8] = &[192, 128, 64, 128, 128, 128, 0, 255, 128];

fn is_as_made(scene: &Scene) {
    assert_eq!(scene.centers, [Vec3::new(1.0, -0.5, 2.25)]);
    assert!((scene.opacity(0) - 0.2).abs() < 1e-6);
    let dc = [0.5 / 0.15, -0.5 / 0.15, (128.0 / 255.0 - 0.5) / 0.15];
    assert!(
        (0..3).all(|c| (scene.sh_dc[0][c] - dc[c] as f32).abs() < 1e-5),
        "{:?}",
        scene.sh_dc
    );
    assert_eq!(scene.log_scales, [Vec3::new(0.0, -5.0, -10.0)]);
    assert!(
        (scene.rotations[0] * Vec3::X - Vec3::Y).length() < 0.02,
        "{:?}",
        scene.rotations
    );
    assert_eq!(scene.sh_degree, 1);
    // Channel by channel here: r of all coefficients first.
    assert_eq!(scene.sh_rest, [0.5, 0.0, -1.0, 0.0, 0.0, 127.0 / 128.0, -0.5, 0.0, 0.0]);
    scene.validate().unwrap();
}

#[test]
fn both_versions_made_by_hand_are_read() {
    for (version, rotation) in [(2, QUARTER_2), (3, QUARTER_3)] {
        let bytes = by_hand(version, 1, 1, 12, 0, &[CENTER, OPACITY, COLOR, SCALES, rotation, SH]);
        let (scene, notes) = read(&bytes).unwrap();
        is_as_made(&scene);
        assert_eq!(notes, Vec::<String>::new());
    }
}

#[test]
fn what_is_not_taken_over_is_told() {
    let extension = [[2, 0, 0xbe, 0xad], [4, 0, 0, 0], [9; 4]].concat();
    let bytes = by_hand(
        3,
        1,
        1,
        12,
        3,
        &[CENTER, OPACITY, COLOR, SCALES, QUARTER_3, SH, &extension],
    );
    let (scene, notes) = read(&bytes).unwrap();
    is_as_made(&scene);
    assert!(
        notes[0].contains("anti-aliased") && notes[1].contains("extensions"),
        "{notes:?}"
    );

    let degree_4 = [SH, &[128; 63]].concat();
    let bytes = by_hand(3, 1, 4, 12, 0, &[CENTER, OPACITY, COLOR, SCALES, QUARTER_3, &degree_4]);
    let (scene, notes) = read(&bytes).unwrap();
    assert_eq!((scene.sh_degree, scene.sh_rest.len()), (3, 45));
    assert_eq!(scene.sh_rest[..3], [0.5, 0.0, -1.0]);
    assert!(notes[0].contains("cut to 3"), "{notes:?}");
}

#[test]
fn a_written_file_has_the_layout_of_version_3() {
    let (scene, _) = read(&by_hand(
        3,
        1,
        1,
        12,
        0,
        &[CENTER, OPACITY, COLOR, SCALES, QUARTER_3, SH],
    ))
    .unwrap();
    let mut raw = Vec::new();
    GzDecoder::new(&write(&scene).unwrap().bytes[..])
        .read_to_end(&mut raw)
        .unwrap();
    // 2¼ in 23 bits leaves 21 fractional ones: 1 is 2²¹.
    assert_eq!(raw[..16], [b'N', b'G', b'S', b'P', 3, 0, 0, 0, 1, 0, 0, 0, 1, 21, 0, 0]);
    assert_eq!(raw[16..25], [0x00, 0x00, 0x20, 0x00, 0x00, 0xf0, 0x00, 0x00, 0x48]);
    assert_eq!(raw[25..], [OPACITY, COLOR, SCALES, QUARTER_3, SH].concat());
}

#[test]
fn a_round_trip_is_as_exact_as_promised() {
    for degree in 0..=3 {
        let scene = random(500, degree);
        let written = write(&scene).unwrap();
        let (back, _) = read(&written.bytes).unwrap();
        assert_eq!(back.sh_degree, degree);
        let mut worst = 0.0f64;
        for i in 0..scene.len() {
            assert!((back.centers[i] - scene.centers[i]).abs().max_element() <= 1.0 / f32::from(1u16 << 15) / 512.0);
            assert!((back.log_scales[i] - scene.log_scales[i]).abs().max_element() <= 1.001 / 32.0);
            assert!((back.opacity(i) - scene.opacity(i)).abs() <= 0.501 / 255.0);
            for (a, b) in back.color(i).into_iter().zip(scene.color(i)) {
                assert!((a - b).abs() <= 0.0037, "{a} {b}");
            }
            worst = worst.max(angle(back.rotations[i], scene.rotations[i]));
        }
        assert!(worst < 0.3, "{worst}");
        for (a, b) in back.sh_rest.iter().zip(&scene.sh_rest) {
            assert!((a - b).abs() <= 0.501 / 128.0, "{a} {b}");
        }
        let told: Vec<String> = written.losses.iter().map(ToString::to_string).collect();
        assert!(
            told[0].contains("camera") && told[1].contains("rounded") && told.len() == 2,
            "{told:?}"
        );
    }
}

#[test]
fn any_component_of_a_rotation_may_be_the_largest() {
    for i in 0..4 {
        for sign in [1.0, -1.0] {
            let mut q = [0.3, -0.2, 0.1, 0.25];
            q[i] = sign;
            let q = Quat::from_array(q).normalize();
            assert!(angle(smallest_three(pack_smallest_three(q)), q) < 0.3, "{q}");
        }
    }
}

#[test]
fn centres_far_away_get_fewer_fractional_bits() {
    let mut scene = random(3, 0);
    for (far, bits) in [(1e-9, 24), (0.5, 23), (1.0, 22), (1000.0, 13), (8e6, 0), (1e9, 0)] {
        scene.centers = vec![Vec3::ZERO, Vec3::X * far, Vec3::NEG_Y * far];
        assert_eq!(fractional_bits(&scene), bits, "{far}");
    }
}

#[test]
fn what_is_wrong_with_a_file_is_named() {
    let all: &[&[u8]] = &[CENTER, OPACITY, COLOR, SCALES, QUARTER_3, SH];
    let good = by_hand(3, 1, 1, 12, 0, all);
    let mut wrong_sum = good.clone();
    let sum_at = good.len() - 8;
    wrong_sum[sum_at] ^= 1;
    let mut other = GzEncoder::new(Vec::new(), Compression::fast());
    other.write_all(b"a tape archive, or some other thing").unwrap();
    let cases = [
        (by_hand(1, 1, 1, 12, 0, all), "version 1"),
        (by_hand(4, 1, 1, 12, 0, all), "--spz-version 3"),
        (by_hand(3, 1, 5, 12, 0, all), "SH degree 5"),
        (by_hand(3, 1, 1, 31, 0, all), "31 fractional bits"),
        (
            by_hand(3, 2, 1, 12, 0, all),
            "promises 2 Gaussians, the file has room for 1",
        ),
        (by_hand(3, 50_000_000, 3, 12, 0, all), "truncated"),
        (by_hand(3, u32::MAX, 0, 12, 0, all), "at most"),
        (other.finish().unwrap(), "does not begin with `NGSP`"),
        (wrong_sum, "damaged"),
        (good[..good.len() - 4].to_vec(), "damaged"),
        (good[..12].to_vec(), "truncated"),
        (b"NGSP\x03\0\0\0".to_vec(), "within the header"),
    ];
    for (bytes, part) in cases {
        let message = read(&bytes).unwrap_err().to_string();
        assert!(message.contains(part), "{message} should mention {part}");
    }
}
