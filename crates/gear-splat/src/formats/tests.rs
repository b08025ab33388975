//! What all formats promise.

use glam::{Quat, Vec3};
use proptest::prelude::*;

use super::*;
use crate::{Camera, Gaussian};

/// Gaussians of any kind within what a file is meant for: centres within ±½, scales of four decades, colours that leave
/// [0, 1] a little, higher SH within ±0.9.
pub(super) fn random(count: usize, sh_degree: u8) -> Scene {
    let mut state = 7u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    let mut scene = Scene {
        sh_degree,
        canonical_camera: Some(Camera::front(300, 77).orbit(Vec3::ONE, 12.3, 0.7)),
        ..Scene::default()
    };
    for _ in 0..count {
        let mut three = |low: f32, high: f32| [0; 3].map(|_| low + (high - low) * next());
        scene.push(Gaussian {
            center: three(-0.5, 0.5).into(),
            scales: Vec3::from(three(-9.0, 0.0).map(libm::expf)),
            rotation: Quat::IDENTITY,
            opacity: 0.5,
            color: three(-0.1, 1.1),
        });
    }
    for i in 0..count {
        let q = [0; 4].map(|_| 2.0 * next() - 1.0);
        scene.rotations[i] = Quat::from_array(q).normalize();
        scene.opacity_logits[i] = 12.0 * next() - 6.0;
    }
    scene.sh_rest.iter_mut().for_each(|x| *x = 1.8 * next() - 0.9);
    scene
}

/// The angle between two rotations, in degrees.
pub(super) fn angle(a: Quat, b: Quat) -> f64 {
    let dot = a.as_dquat().normalize().dot(b.as_dquat().normalize()).abs();
    (2.0 * libm::acos(dot.min(1.0))).to_degrees()
}

/// A file of each format that is read, compressed PLY excepted: nothing here writes it.
fn files() -> Vec<(Format, Vec<u8>)> {
    [Format::Ply, Format::Spz, Format::Splat]
        .map(|format| (format, write(&random(20, 2), format).unwrap().bytes))
        .into()
}

#[test]
fn a_file_is_what_its_bytes_are() {
    for (format, bytes) in files() {
        let loaded = read(&bytes).unwrap();
        assert_eq!(loaded.format, format);
        assert_eq!(loaded.scene.len(), 20);
    }
}

#[test]
fn a_name_says_what_is_written() {
    let of = |name: &str| Format::of_path(Path::new(name));
    assert_eq!(of("out/scene.PLY"), Some(Format::Ply));
    assert_eq!(of("scene.compressed.ply"), Some(Format::CompressedPly));
    assert_eq!(of("a.b.spz"), Some(Format::Spz));
    assert_eq!(of("scene.splat"), Some(Format::Splat));
    assert_eq!(of("scene.glb"), Some(Format::Glb));
    for name in ["scene", "scene.gltf", "ply", "scene.ply/", "scene.obj"] {
        assert_eq!(
            of(name),
            if name.ends_with('/') { Some(Format::Ply) } else { None },
            "{name}"
        );
    }
}

#[test]
fn files_of_other_kinds_are_named() {
    let cases: [(&[u8], &str); 7] = [
        (b"", "empty"),
        (b"glTF\x02\0\0\0", "written, not read"),
        (b"PK\x03\x04rest", "zip"),
        (b"\x89PNG\r\n", "PNG picture"),
        (b"solid cube", "`solid cube`"),
        (b"\x00\x01\x02", "00 01 02"),
        (b"NGSP\x04\0\0\0\0\0\0\0\0\0\0\0", "version 4"),
    ];
    for (bytes, part) in cases {
        let message = read(bytes).unwrap_err().to_string();
        assert!(message.contains(part), "{message} should mention {part}");
    }
    let message = write(&random(1, 0), Format::CompressedPly).unwrap_err().to_string();
    assert!(message.contains(".spz"), "{message}");
}

#[test]
fn every_extreme_scene_is_written_or_refused_with_a_reason() {
    let base = random(2, 1);
    let with = |change: fn(&mut Scene)| {
        let mut scene = base.clone();
        change(&mut scene);
        scene
    };
    let scenes = [
        Scene::default(),
        with(|s| s.centers[0].x = f32::NAN),
        with(|s| s.centers[0].x = 1e30),
        with(|s| s.log_scales[1] = Vec3::new(-200.0, 200.0, 0.0)),
        with(|s| s.opacity_logits = vec![-1e30, 1e30]),
        with(|s| s.sh_dc[0] = [1e30, -1e30, 0.0]),
        with(|s| s.sh_rest[0] = 1e30),
        with(|s| s.rotations[0] = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0)),
        with(|s| s.rotations[0] = Quat::from_xyzw(1e-8, 0.0, 0.0, 1e-8)),
    ];
    for scene in scenes {
        for format in [Format::Ply, Format::Spz, Format::Splat, Format::Glb] {
            match write(&scene, format) {
                Ok(written) if format != Format::Glb => {
                    let back = read(&written.bytes).unwrap().scene;
                    let expected = if format == Format::Ply {
                        scene.len()
                    } else {
                        scene.without_invalid().0.len()
                    };
                    assert_eq!(back.len(), expected, "{format}");
                    assert!(format == Format::Ply || back.count_invalid() == 0, "{format}");
                }
                Ok(_) => {}
                Err(error) => assert!(scene.is_empty() && error.to_string().contains("Gaussian"), "{error}"),
            }
        }
    }
    let cut = write(&with(|s| s.centers[0].x = 1e30), Format::Spz).unwrap();
    assert!(
        cut.losses.iter().any(|l| l.to_string().contains("1 coordinates")),
        "{:?}",
        cut.losses
    );
}

proptest! {
    #[test]
    fn damaged_files_never_panic(which in 0usize..3, at in 0usize..1 << 20, bit in 0u8..8, cut in 0usize..1 << 20) {
        let (_, mut bytes) = files().swap_remove(which);
        let len = bytes.len();
        if let Ok(loaded) = read(&bytes[..cut % len]) {
            loaded.scene.validate().unwrap();
        }
        bytes[at % len] ^= 1 << bit;
        if let Ok(loaded) = read(&bytes) {
            loaded.scene.validate().unwrap();
        }
    }

    #[test]
    fn a_cut_file_is_an_error_except_where_records_end(cut in 0usize..1 << 20) {
        for (format, bytes) in files() {
            let cut = cut % bytes.len();
            let whole = format == Format::Splat && cut > 0 && cut.is_multiple_of(32);
            prop_assert_eq!(read(&bytes[..cut]).is_ok(), whole, "{} cut at {}", format, cut);
        }
    }
}

#[test]
fn higher_coefficients_that_are_all_zero_are_neither_written_nor_read() {
    let scene = random(20, 1);
    let padded = Scene {
        sh_degree: 3,
        sh_rest: scene
            .sh_rest
            .chunks_exact(3)
            .flat_map(|channel| channel.iter().copied().chain([0.0; 12]))
            .collect(),
        ..scene.clone()
    };
    assert_eq!(read(&ply::write(&padded).unwrap()).unwrap().scene, scene);
    for format in [Format::Ply, Format::Spz, Format::Glb] {
        assert_eq!(
            write(&padded, format).unwrap().bytes,
            write(&scene, format).unwrap().bytes,
            "{format}"
        );
    }
    // No loss is told of a degree that was not used.
    let plain = Scene {
        sh_rest: vec![0.0; 20 * 9],
        ..scene
    };
    let losses = write(&plain, Format::Splat).unwrap().losses;
    assert!(
        !losses.iter().any(|loss| matches!(loss, Loss::HigherSh { .. })),
        "{losses:?}"
    );
}
