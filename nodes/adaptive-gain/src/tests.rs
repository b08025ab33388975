use gear_graph::{Value, testing};
use gear_image::testing::{Oracle, sample_field};

use super::*;

fn adaptive(min: f64, max: f64) -> AdaptiveGain {
    AdaptiveGain {
        mode: Mode::Adaptive {
            base: 0.8,
            target: 1.0,
            min,
            max,
        },
    }
}

fn flipped() -> Field {
    let f = sample_field();
    Field::from_fn(f.width(), f.height(), |x, y| 0.3 * f.at(f.width() - 1 - x, y))
}

fn run(node: &AdaptiveGain) -> Out {
    testing::run(
        node,
        In {
            multiscale: Arc::new(sample_field()),
            smooth: Lazy::given(flipped()),
        },
    )
    .unwrap()
}

#[test]
fn alpha_falls_as_the_ratio_spreads_and_is_clipped() {
    let alpha = |scale: f32| {
        let data = sample_field().data().iter().map(|x| x * scale).collect();
        AdaptiveGain::default().mode.alpha(&Field::from_vec(61, 43, data))
    };
    let (_, deviation) = stats::mean_and_deviation(sample_field().data());
    assert!((alpha(1.0) - 0.8 / (deviation + 1e-6)).abs() < 1e-9);
    assert_eq!(alpha(0.0), 1.5, "a constant ratio takes the greatest");
    assert_eq!(alpha(100.0), 0.4);
}

#[test]
fn alpha_of_the_prototype_s_spread_is_the_prototype_s() {
    let oracle = Oracle::parse(include_str!("../tests/oracle.json"));
    // Two values ±σ have the population deviation σ.
    let sigma = oracle.number("sigma") as f32;
    let alpha = AdaptiveGain::default()
        .mode
        .alpha(&Field::from_vec(2, 1, vec![sigma, -sigma]));
    assert!((alpha - oracle.number("alpha")).abs() < 1e-6);
}

#[test]
fn the_result_is_bounded_by_the_weights() {
    for alpha in [0.0, 0.8, 1.0, 1.5] {
        let out = run(&AdaptiveGain {
            mode: Mode::Fixed { alpha },
        });
        let bound = 2.0f32 * if alpha > 1.0 { (2.0 * alpha - 1.0) as f32 } else { 1.0 };
        assert!(out.ratio.unwrap().data().iter().all(|x| x.abs() <= bound));
        assert_eq!(out.alpha.unwrap().0, alpha);
    }
}

#[test]
fn alpha_one_leaves_the_smooth_ratio_unasked_and_changes_no_bit() {
    let known = Known::of::<In>(vec![]);
    for node in [
        AdaptiveGain {
            mode: Mode::Fixed { alpha: 1.0 },
        },
        adaptive(1.0, 1.0),
    ] {
        assert!(matches!(node.demand("ratio", &known).unwrap(), Demand::Ready { .. }));
        let inputs = In {
            multiscale: Arc::new(sample_field()),
            smooth: Lazy::absent(),
        };
        assert_eq!(*testing::run(&node, inputs).unwrap().ratio.unwrap(), sample_field());
    }
    let full = blend(sample_field(), &flipped(), 1.0);
    assert!(
        full.data().iter().zip(sample_field().data()).all(|(a, b)| a == b),
        "weight 1 − 1 = 0"
    );
    assert!(matches!(
        AdaptiveGain::default().demand("ratio", &known).unwrap(),
        Demand::Need { .. }
    ));
    assert!(matches!(
        AdaptiveGain::default().demand("alpha", &known).unwrap(),
        Demand::Ready { .. }
    ));
}

#[test]
fn contradictory_limits_and_sizes_are_refused_by_name() {
    let error = testing::check(&adaptive(1.2, 0.4)).unwrap_err().to_string();
    assert!(error.contains("min"), "{error}");
    let inputs = In {
        multiscale: Arc::new(sample_field()),
        smooth: Lazy::given(Field::filled(3, 3, 0.0)),
    };
    let error = testing::run(&AdaptiveGain::default(), inputs)
        .err()
        .unwrap()
        .to_string();
    assert!(error.contains("`smooth`") && error.contains("(61, 43)"), "{error}");
}

#[test]
fn an_answer_or_an_error_on_every_extreme_input() {
    testing::assert_extremes(&AdaptiveGain::default());
    testing::assert_extremes(&AdaptiveGain {
        mode: Mode::Fixed { alpha: 1.0 },
    });
}

#[test]
fn outputs_are_pure() {
    testing::assert_pure(&AdaptiveGain::default(), || In {
        multiscale: Arc::new(sample_field()),
        smooth: Lazy::given(flipped()),
    });
}

#[test]
fn summary_of_the_sample() {
    let out = run(&AdaptiveGain::default());
    insta::assert_json_snapshot!(serde_json::json!({
        "ratio": out.ratio.unwrap().summary(), "alpha": out.alpha.unwrap().summary(),
    }));
}
