use gear_graph::testing;
use gear_image::{Rgb, SrgbImage};
use gear_sample::{Options, Sample, paint};

use super::*;

fn sample() -> Sample {
    let options = Options {
        longer_side: 48,
        ..Options::default()
    };
    paint("vessel", &options).unwrap()
}

/// World z of a sample's front, so much of the true depth.
fn depth(sample: &Sample, share: f32) -> Field {
    let inside = sample.height.data().iter().zip(sample.mask.data());
    let data = inside
        .map(|(&z, &inside)| if inside { share * z } else { f32::NAN })
        .collect();
    Field::from_vec(sample.height.width(), sample.height.height(), data)
}

fn normals(sample: &Sample) -> Image {
    let (width, height) = sample.height.size();
    let colours = sample.normals.iter().map(|n| n.map(|c| 0.5 + 0.5 * c)).collect();
    Image::opaque(SrgbImage::from_vec(width, height, colours))
}

fn shallower() -> In {
    let sample = sample();
    let mut scene = sample.scene(1);
    for center in &mut scene.centers {
        center.z *= 0.6;
    }
    In {
        depth: Arc::new(depth(&sample, 0.6)),
        true_depth: Arc::new(depth(&sample, 1.0)),
        normals: Some(Arc::new(normals(&sample))),
        true_normals: Some(Arc::new(normals(&sample))),
        scene: Some(Arc::new(scene)),
        true_scene: Some(Arc::new(sample.scene(1))),
    }
}

/// Few and small views: what is promised does not depend on their number.
fn quick() -> CompareTruth {
    CompareTruth {
        yaws: vec![30.0],
        size: 24,
    }
}

fn number(report: &Report, key: &str) -> f64 {
    report
        .0
        .pointer(key)
        .and_then(Value::as_f64)
        .unwrap_or_else(|| panic!("{key} in {}", report.0))
}

#[test]
fn the_truth_is_right_and_what_is_shallower_is_off_by_its_scale_only() {
    let mut inputs = shallower();
    let report = testing::run(&CompareTruth::default(), shallower()).unwrap().report;
    assert!(number(&report, "/depth") < 1e-3 && (number(&report, "/scale") - 1.0 / 0.6).abs() < 1e-3);
    assert!(number(&report, "/normals_degrees") < 0.1, "those that are given count");
    assert!(number(&report, "/fitted_normals_degrees") < 0.1 && number(&report, "/silhouette") == 1.0);
    (inputs.normals, inputs.true_normals) = (None, None);
    (inputs.scene, inputs.true_scene) = (inputs.true_scene.clone(), inputs.true_scene);
    let exact = testing::run(&CompareTruth::default(), inputs).unwrap().report;
    assert!(
        number(&exact, "/normals_degrees") > 3.0,
        "left out, they are those of the depths"
    );
    assert!(number(&exact, "/views/psnr_db") > number(&report, "/views/psnr_db") + 10.0);
}

#[test]
fn half_a_pair_and_another_size_are_refused_by_name() {
    let mut inputs = shallower();
    inputs.true_normals = None;
    let message = testing::run(&CompareTruth::default(), inputs)
        .map(|_| ())
        .unwrap_err()
        .to_string();
    assert!(message.contains("true_normals"), "{message}");
    let mut inputs = shallower();
    inputs.true_depth = Arc::new(Field::filled(7, 5, 0.0));
    let message = testing::run(&CompareTruth::default(), inputs)
        .map(|_| ())
        .unwrap_err()
        .to_string();
    assert!(message.contains("true_depth") && message.contains("7×5"), "{message}");
}

#[test]
fn nothing_to_compare_is_null() {
    let nothing = Arc::new(Field::filled(20, 10, f32::NAN));
    let grey = Arc::new(Image::opaque(Rgb::filled(20, 10, [0.5; 3])));
    let report = testing::run(
        &CompareTruth::default(),
        In {
            depth: nothing.clone(),
            true_depth: nothing,
            normals: Some(grey.clone()),
            true_normals: Some(grey),
            scene: None,
            true_scene: None,
        },
    )
    .unwrap()
    .report;
    for key in ["depth", "scale", "normals_degrees", "detail", "silhouette"] {
        assert!(report.0[key].is_null(), "{key}: {}", report.0);
    }
    assert!(report.0.get("views").is_none());
}

#[test]
fn same_bits_twice_on_any_threads_and_whatever_is_wanted() {
    testing::assert_pure(&quick(), shallower);
}

#[test]
fn an_answer_or_an_error_on_every_extreme_input() {
    testing::assert_extremes_around(&quick(), shallower());
}
