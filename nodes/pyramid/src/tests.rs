use gear_graph::{Value, testing};
use gear_image::testing::{Oracle, sample_edges, sample_field};

use super::*;

fn run(node: &Pyramid, ratio: Field, edges: Field) -> Arc<Field> {
    let inputs = In {
        ratio: Arc::new(ratio),
        edges: Lazy::given(edges),
    };
    testing::run(node, inputs).unwrap().ratio
}

/// R_ms with κ and τ on the sample ratio.
fn on_sample(kappa: f64, tau: f64, levels: OrAuto<u32>) -> Arc<Field> {
    run(&Pyramid { levels, kappa, tau }, sample_field(), sample_edges())
}

fn worst(a: &Field, b: impl Fn(usize, usize) -> f32) -> f32 {
    let mut worst = 0.0f32;
    for y in 0..a.height() {
        for x in 0..a.width() {
            worst = worst.max((a.at(x, y) - b(x, y)).abs());
        }
    }
    worst
}

#[test]
fn levels_and_weights_are_the_prototype_s() {
    let oracle = Oracle::parse(include_str!("../tests/oracle.json"));
    oracle.check("default", on_sample(20.0, 0.5, OrAuto::Auto).data());
    oracle.check("seven_levels", on_sample(20.0, 0.5, OrAuto::Value(7)).data());
    oracle.check("kappa_1000_tau_0.2", on_sample(1000.0, 0.2, OrAuto::Auto).data());
    assert_eq!(levels::automatic(61, 43) as f64, oracle.number("auto_levels"));
}

#[test]
fn automatic_levels_stop_where_the_shorter_side_is_eight() {
    let found: Vec<usize> = [1, 7, 8, 15, 16, 192, 512, 5000]
        .map(|n| levels::automatic(n, 9999))
        .to_vec();
    assert_eq!(found, [1, 1, 1, 1, 2, 5, 7, 7]);
}

#[test]
fn the_result_stays_within_the_range_of_the_ratio() {
    let r = sample_field();
    let (low, high) = gear_image::stats::range(r.data()).unwrap();
    for kappa in [0.0, 20.0, 1e12] {
        for tau in [0.0, 0.3, 0.9] {
            let m = on_sample(kappa, tau, OrAuto::Value(7));
            assert!(m.data().iter().all(|&x| (low..=high).contains(&x)));
        }
    }
}

#[test]
fn a_constant_ratio_stays_that_constant() {
    let m = run(&Pyramid::default(), Field::filled(50, 33, 3.7), sample_50());
    assert!(worst(&m, |_, _| 3.7) <= 1e-6);
}

fn sample_50() -> Field {
    Field::from_fn(50, 33, |x, y| ((x * 13 + y * 29) % 17) as f32 / 16.0)
}

#[test]
fn one_level_or_tau_one_or_contours_everywhere_is_the_identity() {
    let r = sample_field();
    assert_eq!(*on_sample(20.0, 0.5, OrAuto::Value(1)), r);
    assert_eq!(*on_sample(20.0, 1.0, OrAuto::Auto), r);
    let everywhere = Field::filled(r.width(), r.height(), 1.0);
    let m = run(
        &Pyramid {
            kappa: 1e12,
            ..Pyramid::default()
        },
        r.clone(),
        everywhere,
    );
    assert!(worst(&m, |x, y| r.at(x, y)) <= 1e-6);
}

#[test]
fn a_shift_of_the_ratio_shifts_the_result_and_a_factor_scales_it() {
    let r = sample_field();
    let base = on_sample(20.0, 0.5, OrAuto::Auto);
    let change = |f: fn(f32) -> f32| {
        let data = r.data().iter().map(|&x| f(x)).collect();
        run(
            &Pyramid::default(),
            Field::from_vec(r.width(), r.height(), data),
            sample_edges(),
        )
    };
    assert!(worst(&change(|x| x + 5.0), |x, y| base.at(x, y) + 5.0) <= 4e-6);
    assert!(worst(&change(|x| 2.0 * x), |x, y| 2.0 * base.at(x, y)) == 0.0);
}

#[test]
fn light_leaks_across_a_wide_contour_five_times_less_than_without_one() {
    let n = 256;
    let step = Field::from_fn(n, n, |x, _| if x < 131 { 0.0 } else { 2.0 });
    let leakage = |kappa: f64, width: usize| {
        let contour = Field::from_fn(n, n, |x, _| {
            if (131 - width..131 + width).contains(&x) {
                1.0
            } else {
                0.0
            }
        });
        let m = run(
            &Pyramid {
                kappa,
                ..Pyramid::default()
            },
            step.clone(),
            contour,
        );
        (133..163).map(|x| (m.at(x, 100) - step.at(x, 100)).abs()).sum::<f32>() / 30.0
    };
    // The figures measured with the prototype.
    for (kappa, width, expected) in [
        (0.0, 3, 0.0232),
        (20.0, 1, 0.0192),
        (20.0, 3, 0.0039),
        (1000.0, 3, 0.0029),
    ] {
        assert!(
            (leakage(kappa, width) - expected).abs() < 6e-5,
            "{kappa} {width}: {}",
            leakage(kappa, width)
        );
    }
}

#[test]
fn every_extreme_field_gives_a_finite_result_of_its_size() {
    for (name, ratio) in Field::extremes() {
        for (edge_name, edges) in Field::extremes() {
            let size = ratio.size();
            let m = run(&Pyramid::default(), ratio.clone(), edges);
            assert_eq!(m.size(), size);
            assert!(m.data().iter().all(|x| x.is_finite()), "{name} with edges {edge_name}");
        }
    }
}

#[test]
fn identities_do_not_ask_for_edges() {
    let known = Known::of::<In>(vec![]);
    let demand = |levels, tau| {
        Pyramid {
            levels,
            tau,
            ..Pyramid::default()
        }
        .demand("ratio", &known)
        .unwrap()
    };
    assert!(matches!(demand(OrAuto::Value(1), 0.5), Demand::Ready { .. }));
    assert!(matches!(demand(OrAuto::Auto, 1.0), Demand::Ready { .. }));
    assert!(matches!(demand(OrAuto::Auto, 0.5), Demand::Need { .. }));
}

#[test]
fn impossible_parameters_are_refused_by_name() {
    for (name, value) in [("kappa", -1.0), ("tau", 1.5), ("tau", -0.1), ("levels", 0.0)] {
        let problems = testing::read::<Pyramid>(&serde_json::json!({ name: value })).unwrap_err();
        assert!(problems[0].message.contains(name), "{}", problems[0].message);
    }
    assert!(
        testing::check(&Pyramid {
            tau: f64::NAN,
            ..Pyramid::default()
        })
        .is_err()
    );
}

#[test]
fn an_answer_or_an_error_on_every_extreme_input() {
    testing::assert_extremes(&Pyramid::default());
}

#[test]
fn outputs_are_pure() {
    testing::assert_pure(&Pyramid::default(), || In {
        ratio: Arc::new(sample_field()),
        edges: Lazy::given(sample_edges()),
    });
}

#[test]
fn summary_of_the_sample() {
    insta::assert_json_snapshot!(on_sample(20.0, 0.5, OrAuto::Auto).summary());
}
