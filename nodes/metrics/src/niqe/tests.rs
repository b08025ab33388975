//! Against the reference's figures: procedural pictures always, scans where a folder is given.

use std::path::PathBuf;

use serde_json::Value;

use super::*;

const ORACLE: &str = include_str!("../../../../tests/oracles/niqe.json");

/// Integer value noise, the same bits in any language: (cell, weight) octaves that sum to 8 eighths.
fn octave(x: u32, y: u32, channel: u32, seed: u32, cell: u32) -> u32 {
    let hash = |x: u32, y: u32| {
        let mut n = x
            .wrapping_mul(374_761_393)
            .wrapping_add(y.wrapping_mul(668_265_263))
            .wrapping_add(channel.wrapping_mul(2_246_822_519))
            .wrapping_add(seed.wrapping_mul(3_266_489_917));
        n ^= n >> 13;
        n = n.wrapping_mul(1_274_126_177);
        (n ^ (n >> 16)) >> 24
    };
    let (cx, cy, fx, fy) = (x / cell, y / cell, x % cell, y % cell);
    let top = hash(cx, cy) * (cell - fx) + hash(cx + 1, cy) * fx;
    let bottom = hash(cx, cy + 1) * (cell - fx) + hash(cx + 1, cy + 1) * fx;
    (top * (cell - fy) + bottom * fy) / (cell * cell)
}

fn code(kind: &str, (w, h): (u32, u32), x: u32, y: u32, channel: u32) -> u32 {
    let octaves: &[(u32, u32)] = match kind {
        "rough" => &[(64, 2), (16, 2), (4, 2), (1, 2)],
        "blurred" => &[(64, 5), (16, 3)],
        _ => &[(64, 4), (16, 2), (4, 1), (1, 1)],
    };
    let noise: u32 = octaves
        .iter()
        .map(|&(cell, k)| k * octave(x, y, channel, 7 + cell, cell))
        .sum();
    let noise = noise / 8;
    match kind {
        "flat" => 128,
        "posterised" => noise / 32 * 32 + 16,
        "figure_on_white" => {
            let square = |a: u32, of: u32| (2 * i64::from(a) - i64::from(of)).pow(2);
            let (w2, h2) = (i64::from(w * w), i64::from(h * h));
            let inside = square(x, w) * h2 + square(y, h) * w2 * 2 < w2 * h2 * 6 / 10;
            if inside { noise } else { 255 }
        }
        _ => noise,
    }
}

fn picture(kind: &str, width: usize, height: usize) -> (SrgbImage, u64) {
    let mut sum = 0;
    let picture = SrgbImage::from_fn(width, height, |x, y| {
        std::array::from_fn(|c| {
            let code = code(kind, (width as u32, height as u32), x as u32, y as u32, c as u32);
            sum += u64::from(code);
            code as f32 / 255.0
        })
    });
    (picture, sum)
}

#[test]
fn procedural_pictures_score_as_in_the_reference() {
    let oracle: Value = serde_json::from_str(ORACLE).unwrap();
    let tolerance = oracle["tolerance"]["relative"].as_f64().unwrap();
    for case in oracle["pictures"].as_array().unwrap() {
        let kind = case["picture"].as_str().unwrap();
        let side = |key: &str| case[key].as_u64().unwrap() as usize;
        let (picture, sum) = picture(kind, side("width"), side("height"));
        assert_eq!(sum, case["sum"].as_u64().unwrap(), "{kind}: not the oracle's picture");
        match (niqe(&picture), case["niqe"].as_f64()) {
            (None, None) => {}
            (Some(ours), Some(theirs)) => {
                println!("{kind}: {ours:.5}, reference {theirs:.5}");
                assert!(
                    (ours - theirs).abs() <= tolerance * theirs,
                    "{kind}: {ours}, expected {theirs}"
                );
            }
            (ours, theirs) => panic!("{kind}: {ours:?}, expected {theirs:?}"),
        }
    }
}

/// Three pictures and what BasicSR's `calculate_niqe` says of them. They may not be shipped: the folder is named
/// by `GEAR_NIQE_PICTURES`, or lies beside that of `GEAR_PAINTINGS` as `niqe`.
#[test]
fn scans_score_as_in_the_reference() {
    let folder = std::env::var_os("GEAR_NIQE_PICTURES")
        .map(PathBuf::from)
        .or_else(|| Some(PathBuf::from(std::env::var_os("GEAR_PAINTINGS")?).join("../niqe")));
    let Some(folder) = folder.filter(|folder| folder.is_dir()) else {
        println!("skipped: set GEAR_NIQE_PICTURES to the folder of the three reference pictures");
        return;
    };
    for (name, theirs) in [
        ("a_rrv_expectation.png", 8.673_881),
        ("b_great_wave.png", 3.225_734),
        ("e_rrv_blur2.png", 8.799_456),
    ] {
        let picture = image::open(folder.join(name)).expect("a reference picture").to_rgb8();
        let pixels = picture.pixels().map(|p| p.0.map(|c| f32::from(c) / 255.0)).collect();
        let picture = SrgbImage::from_vec(picture.width() as usize, picture.height() as usize, pixels);
        let ours = niqe(&picture).expect("a score");
        println!("{name}: {ours:.5}, reference {theirs:.5}");
        assert!((ours - theirs).abs() < 1e-3, "{name}: {ours}, expected {theirs}");
    }
}

#[test]
fn too_small_and_constant_pictures_are_undefined_not_zero() {
    assert_eq!(niqe(&SrgbImage::filled(1, 1, [0.5; 3])), None);
    assert_eq!(niqe(&SrgbImage::filled(95, 4000, [0.5; 3])), None);
    assert_eq!(niqe(&SrgbImage::filled(400, 400, [0.5; 3])), None);
    assert_eq!(niqe(&SrgbImage::filled(400, 400, [f32::NAN; 3])), None);
}

#[test]
fn any_thread_count_gives_the_same_bits() {
    let (picture, _) = picture("cloth", 200, 300);
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let many = rayon::ThreadPoolBuilder::new().num_threads(5).build().unwrap();
    let one = alone.install(|| niqe(&picture)).unwrap();
    let five = many.install(|| niqe(&picture)).unwrap();
    assert_eq!(one.to_bits(), five.to_bits());
}

#[test]
fn another_grid_of_shapes_changes_little_and_the_reference_s_nothing() {
    let (picture, _) = picture("noise", 256, 224);
    let reference = niqe(&picture).unwrap();
    assert_eq!(niqe_with_step(&picture, SHAPE_STEP), (Some(reference), 9801));
    let (finer, shapes) = niqe_with_step(&picture, 1e-4);
    let off = (finer.unwrap() - reference).abs();
    assert!(off > 0.0 && off < 0.01 && shapes == 98_001, "{off}, {shapes}");
}
