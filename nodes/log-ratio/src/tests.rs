use gear_graph::{Value, testing};
use gear_image::testing::{Oracle, sample_translation};

use super::*;

fn run(node: &LogRatio, image: Image) -> (Arc<Field>, Arc<Field>) {
    let out = testing::run(node, In { image: Arc::new(image) }).unwrap();
    (out.ratio.unwrap(), out.smooth.unwrap())
}

#[test]
fn ratio_and_smooth_are_the_prototype_s() {
    let oracle = Oracle::parse(include_str!("../tests/oracle.json"));
    let (ratio, smooth) = run(&LogRatio::default(), sample_translation());
    oracle.check("ratio", ratio.data());
    oracle.check("smooth", smooth.data());
}

#[test]
fn every_extreme_picture_has_a_finite_ratio_of_mean_zero() {
    for (name, image) in Image::extremes() {
        let node = LogRatio::default();
        let (ratio, smooth) = run(&node, image);
        assert!(
            ratio.data().iter().chain(smooth.data()).all(|x| x.is_finite()),
            "{name}"
        );
        assert!(stats::mean(ratio.data()).abs() < 1e-5, "{name}");
    }
}

#[test]
fn a_constant_picture_has_no_ratio() {
    let (ratio, smooth) = run(&LogRatio::default(), Image::opaque(Rgb::filled(40, 60, [0.2; 3])));
    assert!(ratio.data().iter().chain(smooth.data()).all(|x| x.abs() < 1e-6));
}

#[test]
fn a_window_fifty_times_the_image_gives_the_global_mean() {
    let node = LogRatio {
        radius: 50.0,
        ..LogRatio::default()
    };
    let (_, smooth) = run(&node, sample_translation());
    assert!(smooth.data().iter().all(|x| x.abs() < 1e-6));
    let (ratio, smooth) = run(&LogRatio { radius: 0.0, ..node }, sample_translation());
    assert_eq!(ratio, smooth, "no window, no smoothing");
}

#[test]
fn relative_scale_does_not_see_exposure() {
    let node = LogRatio {
        scale: Scale::Relative,
        ..LogRatio::default()
    };
    let exposed = |gain: f32| {
        let mut light = sample_translation().rgb.to_linear();
        light.data_mut().iter_mut().for_each(|p| *p = p.map(|c| c * gain));
        run(&node, Image::opaque(light.to_srgb())).0
    };
    let (dim, bright) = (exposed(0.01), exposed(100.0));
    assert!(dim.data().iter().zip(bright.data()).all(|(a, b)| (a - b).abs() < 1e-4));
}

#[test]
fn impossible_parameters_are_refused_by_name() {
    for (name, value) in [("radius", -1.0), ("radius", 51.0), ("epsilon", 0.0), ("epsilon", -1.0)] {
        let problems = testing::read::<LogRatio>(&serde_json::json!({ name: value })).unwrap_err();
        assert!(problems[0].message.contains(name), "{}", problems[0].message);
    }
    assert!(
        testing::check(&LogRatio {
            epsilon: f64::NAN,
            ..LogRatio::default()
        })
        .is_err()
    );
}

#[test]
fn an_answer_or_an_error_on_every_extreme_input() {
    testing::assert_extremes(&LogRatio::default());
    testing::assert_extremes(&LogRatio {
        scale: Scale::Relative,
        ..LogRatio::default()
    });
}

#[test]
fn outputs_are_pure() {
    testing::assert_pure(&LogRatio::default(), || In {
        image: Arc::new(sample_translation()),
    });
}

#[test]
fn summary_of_the_sample() {
    let (ratio, smooth) = run(&LogRatio::default(), sample_translation());
    insta::assert_json_snapshot!(serde_json::json!({"ratio": ratio.summary(), "smooth": smooth.summary()}));
}
