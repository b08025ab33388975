use gear_graph::{AnyValue, Value, testing};
use gear_image::filter::box_mean;
use gear_image::testing::{Oracle, SAMPLE_SIZE, sample_edges, sample_painting, sample_translation};
use gear_image::{Rgb, SrgbImage};
use node_adaptive_gain::Mode;

use super::*;

/// The chain from translated picture and edges to R_final, with default parameters.
fn chain(translated: &SrgbImage, edges: &Field) -> Field {
    let ratio = node_log_ratio::log_ratio(node_log_ratio::luminance(translated), 1e-3);
    let radius = (0.03 * ratio.longer_side() as f64).round().max(1.0) as usize;
    let smooth = box_mean(&ratio, radius);
    let side = ratio.width().min(ratio.height());
    let levels = if side < 8 {
        1
    } else {
        (1 + (side / 8).ilog2() as usize).min(7)
    };
    let multiscale = node_pyramid::multiscale(&ratio, edges, levels, 20.0, 0.5);
    let alpha = Mode::Adaptive {
        base: 0.8,
        target: 1.0,
        min: 0.4,
        max: 1.5,
    }
    .alpha(&multiscale);
    node_adaptive_gain::blend(multiscale, &smooth, alpha as f32)
}

/// β given, everything else as by default.
fn node(beta: f64) -> Recompose {
    Recompose {
        beta: OrAuto::Value(beta),
        ..Recompose::default()
    }
}

fn inputs(painting: Image, ratio: Field) -> In {
    let (w, h) = painting.size();
    In {
        painting: Arc::new(painting),
        mask: Lazy::given(Mask::filled(w, h, true)),
        ratio: Lazy::given(ratio),
    }
}

/// The whole of grounding: painting, translated picture, edges → grounded image.
fn ground(node: &Recompose, painting: &Image, translated: &Image, edges: &Field) -> SrgbImage {
    let ratio = chain(&translated.rgb, edges);
    testing::run(node, inputs(painting.clone(), ratio))
        .unwrap()
        .grounded
        .unwrap()
        .rgb
        .clone()
}

/// Grounding of a picture by itself, without edges.
fn ground_alone(node: &Recompose, painting: &Image) -> SrgbImage {
    let (w, h) = painting.size();
    ground(node, painting, painting, &Field::filled(w, h, 0.0))
}

fn flat(image: &SrgbImage) -> &[f32] {
    image.data().as_flattened()
}

fn constant(value: f32) -> Image {
    Image::opaque(Rgb::filled(60, 40, [value; 3]))
}

fn random(seed: usize) -> Image {
    let code = |x: usize, y: usize, c: usize| (x * 7919 + y * 104_729 + c * 631 + x * y * (seed + c + 1)) % 1009;
    Image::opaque(Rgb::from_fn(60, 40, |x, y| {
        [0, 1, 2].map(|c| code(x, y, c) as f32 / 1008.0)
    }))
}

#[test]
fn grounding_is_the_prototype_s_in_every_gamut() {
    let oracle = Oracle::parse(include_str!("../tests/oracle.json"));
    let ratio = chain(&sample_translation().rgb, &sample_edges());
    oracle.check("ratio_final", ratio.data());
    for (name, gamut) in [
        ("soft", Gamut::Soft { knee: 0.8 }),
        ("clip", Gamut::Clip),
        ("none", Gamut::None),
    ] {
        for beta in [0.5, -1.5] {
            let node = Recompose {
                gamut: gamut.clone(),
                ..node(beta)
            };
            let out = ground(&node, &sample_painting(), &sample_translation(), &sample_edges());
            oracle.check(&format!("{name}_{beta}"), flat(&out));
        }
    }
    let out = testing::run(&node(0.5), inputs(sample_painting(), ratio)).unwrap();
    oracle.check("luminance", out.luminance.unwrap().data());
    oracle.check("albedo", flat(&out.albedo.unwrap().rgb));
}

// The table of extreme cases (method notes, section A), row by row.

#[test]
fn all_black_stays_black() {
    assert!(
        flat(&ground_alone(&node(0.5), &constant(0.0)))
            .iter()
            .all(|&x| x == 0.0)
    );
}

#[test]
fn all_white_is_uniform_at_the_end_of_the_shoulder_and_white_when_clipped() {
    let soft = ground_alone(&node(0.5), &constant(1.0));
    assert!(
        flat(&soft).iter().all(|x| (x - 0.966_93).abs() < 2e-5),
        "{}",
        flat(&soft)[0]
    );
    let clipped = ground_alone(
        &Recompose {
            gamut: Gamut::Clip,
            ..node(0.5)
        },
        &constant(1.0),
    );
    assert!(flat(&clipped).iter().all(|x| (x - 1.0).abs() < 2e-6));
}

#[test]
fn a_constant_is_only_compressed_by_the_shoulder() {
    for value in [0.05, 0.2, 0.7] {
        let out = ground_alone(&node(0.5), &constant(value));
        assert!(
            flat(&out).iter().all(|x| (x - value).abs() < 5e-5),
            "{} for {value}",
            flat(&out)[0]
        );
    }
}

#[test]
fn pictures_of_a_few_pixels_are_finite() {
    for (w, h) in [(1, 1), (7, 1), (1, 9), (2, 2), (5, 3)] {
        let image = Image::opaque(Rgb::from_fn(w, h, |x, y| [0.2 + 0.1 * x as f32, 0.1 * y as f32, 0.5]));
        let out = ground_alone(&node(0.5), &image);
        assert!(flat(&out).iter().all(|x| (0.0..=1.0).contains(x)), "{w}x{h}");
    }
    let pixel = Image::opaque(Rgb::filled(1, 1, [0.3, 0.5, 0.4]));
    let without = Recompose {
        detail: 0.0,
        ..node(0.5)
    };
    assert_eq!(
        ground_alone(&node(0.5), &pixel),
        ground_alone(&without, &pixel),
        "one pixel has no high frequencies"
    );
}

#[test]
fn any_finite_beta_stays_in_range() {
    for beta in [-1e6, -50.0, 50.0, 1e6, 1e300] {
        let out = ground(&node(beta), &random(1), &random(2), &Field::filled(60, 40, 0.0));
        assert!(flat(&out).iter().all(|x| (0.0..=1.0).contains(x)), "beta {beta}");
    }
}

#[test]
fn no_beta_no_detail_and_no_gamut_is_the_identity_within_a_hundredth_of_a_code() {
    let identity = Recompose {
        detail: 0.0,
        gamut: Gamut::None,
        ..node(0.0)
    };
    let painting = random(1);
    let out = ground(&identity, &painting, &random(2), &Field::filled(60, 40, 0.0));
    let worst = flat(&out)
        .iter()
        .zip(flat(&painting.rgb))
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f32::max);
    assert!(worst <= 4.2e-5, "{worst}");
}

#[test]
fn beta_zero_has_the_bits_of_a_zero_ratio() {
    let zero = Field::filled(SAMPLE_SIZE.0, SAMPLE_SIZE.1, 0.0);
    let with = testing::run(&node(0.5), inputs(sample_painting(), zero))
        .unwrap()
        .grounded
        .unwrap();
    let absent = In {
        painting: Arc::new(sample_painting()),
        mask: Lazy::absent(),
        ratio: Lazy::absent(),
    };
    let without = testing::run_wanting(&node(0.0), absent, &["grounded", "luminance", "albedo"]).unwrap();
    assert_eq!(with.digest(), without.grounded.unwrap().digest(), "exp(0) = 1");
}

#[test]
fn high_dynamic_range_is_finite_and_in_range_when_asked() {
    let power = |x: usize, y: usize, c: usize| ((x * 37 + y * 101 + c * 53) % 601) as f64 / 10.0 - 30.0;
    let light =
        Rgb::<gear_image::Linear>::from_fn(60, 40, |x, y| [0, 1, 2].map(|c| libm::pow(10.0, power(x, y, c)) as f32));
    let image = Image::opaque(light.to_srgb());
    let open = Recompose {
        gamut: Gamut::None,
        ..node(0.5)
    };
    assert!(flat(&ground_alone(&open, &image)).iter().all(|x| x.is_finite()));
    assert!(
        flat(&ground_alone(&node(0.5), &image))
            .iter()
            .all(|x| (0.0..=1.0).contains(x))
    );
}

#[test]
fn pixels_that_are_not_finite_give_finite_ones() {
    let mut painting = random(1);
    painting.rgb.set(4, 3, [f32::NAN; 3]);
    painting.rgb.set(6, 5, [f32::INFINITY; 3]);
    painting.rgb.set(8, 7, [f32::NEG_INFINITY; 3]);
    let out = ground_alone(&node(0.5), &painting);
    assert!(flat(&out).iter().all(|x| (0.0..=1.0).contains(x)));
    assert_eq!(out.at(4, 3), [0.0; 3]);
    assert_eq!(out.at(8, 7), [0.0; 3]);
}

#[test]
fn black_beside_white_with_a_lot_of_detail_stays_in_range() {
    let halves = Image::opaque(Rgb::from_fn(60, 40, |x, _| [if x < 30 { 0.0 } else { 1.0 }; 3]));
    let out = ground_alone(
        &Recompose {
            detail: 5.0,
            ..node(0.5)
        },
        &halves,
    );
    assert!(flat(&out).iter().all(|x| (0.0..=1.0).contains(x)));
}

#[test]
fn an_unlit_translation_makes_beta_irrelevant() {
    let grey = constant(0.4);
    let painting = random(1);
    let edges = Field::filled(60, 40, 0.0);
    let at = |beta| ground(&node(beta), &painting, &grey, &edges);
    let (a, b) = (at(0.0), at(3.0));
    let worst = flat(&a)
        .iter()
        .zip(flat(&b))
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f32::max);
    assert!(worst <= 1e-6, "{worst}");
}

#[test]
fn impossible_parameters_are_refused_by_name() {
    for (name, value) in [
        ("epsilon", 0.0),
        ("epsilon", -1e-6),
        ("detail", -0.1),
        ("detail_radius", 0.5),
    ] {
        let problems = testing::read::<Recompose>(&serde_json::json!({ name: value })).unwrap_err();
        assert!(problems[0].message.contains(name), "{}", problems[0].message);
    }
    assert!(testing::check(&node(f64::NAN)).is_err());
    assert!(
        testing::check(&Recompose {
            gamut: Gamut::Soft { knee: f64::NAN },
            ..node(0.5)
        })
        .is_err()
    );
}

// What is asked for, and when.

#[test]
fn hue_is_kept_by_the_shoulder_and_the_limiter_never_leaves_the_cube() {
    for i in 0..2000u32 {
        let unit = |k: u32| ((i * 7919 + k * 104_729) % 997) as f32 / 996.0;
        let rgb = [unit(1) * 4.0, unit(2), unit(3) * 2.0];
        let m = rgb[0].max(rgb[1]).max(rgb[2]);
        let out = gamut::shoulder(rgb, 0.8);
        assert!(out.iter().all(|&c| c <= 1.0));
        if m > 0.0 {
            let factor = out[0].max(out[1]).max(out[2]) / m;
            assert!(rgb.iter().zip(out).all(|(&a, b)| (a * factor - b).abs() < 1e-5));
        }
        let base = [unit(4), unit(5), unit(6)];
        let detail = [unit(7) - 0.5, unit(8) - 0.5, unit(9) - 0.5];
        let s = gamut::limiter(base, detail);
        assert!((0.0..=1.0).contains(&s));
        for c in 0..3 {
            assert!((-1e-6..=1.0 + 1e-6).contains(&(base[c] + s * detail[c])));
        }
    }
}

/// A sphere under one light: as natural as light gets.
fn lit_sphere() -> (Image, Mask) {
    let (n, radius) = (128usize, 48.0f32);
    let at = |x: usize, y: usize| ((x as f32 - 63.5) / radius, (y as f32 - 63.5) / radius);
    let light = Rgb::<gear_image::Linear>::from_fn(n, n, |x, y| {
        let (u, v) = at(x, y);
        let depth = 1.0 - u * u - v * v;
        if depth <= 0.0 {
            return [0.8; 3];
        }
        let shade = (-0.5 * u - 0.6 * v + 0.62 * depth.sqrt()).max(0.0);
        [0.05 + 0.6 * shade; 3]
    });
    let mask = Mask::from_fn(n, n, |x, y| {
        let (u, v) = at(x, y);
        u * u + v * v < 1.0
    });
    (Image::opaque(light.to_srgb()), mask)
}

/// The same silhouette, painted flat.
fn flat_disc() -> (Image, Mask) {
    let (_, mask) = lit_sphere();
    let rgb = Rgb::from_fn(128, 128, |x, y| match (mask.at(x, y), y / 32 % 2) {
        (false, _) => [0.9; 3],
        (true, 0) => [0.6, 0.3, 0.2],
        (true, _) => [0.3, 0.4, 0.6],
    });
    (Image::opaque(rgb), mask)
}

fn demand_with((painting, mask): (Image, Mask)) -> Demand {
    let values = vec![("painting", AnyValue::new(painting)), ("mask", AnyValue::new(mask))];
    Recompose::default()
        .demand("grounded", &Known::of::<In>(values))
        .unwrap()
}

#[test]
fn natural_light_leaves_the_ratio_unasked() {
    match demand_with(lit_sphere()) {
        Demand::Ready { reason } => assert!(reason.contains("has natural light"), "{reason}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_more_natural_the_light_the_less_is_grounded() {
    let (sphere, mask) = lit_sphere();
    let flat = 0.4f32;
    let betas: Vec<f64> = [0.0, 0.1, 0.15, 0.2, 0.3, 0.6, 1.0]
        .iter()
        .map(|&contrast| {
            let light = colour::light(&sphere.rgb);
            let faint = Rgb::from_fn(128, 128, |x, y| {
                light.data()[y * 128 + x].map(|c| flat + contrast * (c - flat))
            });
            let faint = Image::opaque(faint.to_srgb());
            evidence::look(&faint, &mask).unwrap().beta()
        })
        .collect();
    assert!(betas.windows(2).all(|b| b[1] <= b[0]), "{betas:?}");
    assert!(betas[0] == 0.5 && betas[6] == 0.0, "{betas:?}");
    assert!(betas.iter().any(|&b| b > 0.0 && b < 0.5), "{betas:?}");
}

#[test]
fn natural_light_leaves_the_picture_as_it_is_but_for_the_shoulder() {
    let (sphere, mask) = lit_sphere();
    let ratio = Field::filled(128, 128, 1.0);
    let run = |node: &Recompose| {
        let inputs = In {
            painting: Arc::new(sphere.clone()),
            mask: Lazy::given(Arc::new(mask.clone())),
            ratio: Lazy::given(Arc::new(ratio.clone())),
        };
        testing::run(node, inputs).unwrap().grounded.unwrap().rgb.clone()
    };
    let auto = run(&Recompose::default());
    let plain = run(&Recompose {
        detail: 0.0,
        ..node(0.0)
    });
    assert_eq!(auto, plain);
    assert_ne!(run(&node(0.0)), plain, "β = 0 that was asked for still sharpens");
}

#[test]
fn flat_paint_asks_for_the_ratio() {
    match demand_with(flat_disc()) {
        Demand::Need { ports, reason } => {
            assert_eq!(ports, ["ratio"]);
            assert!(reason.contains("lacks natural light"), "{reason}");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn each_output_asks_only_for_what_it_reads() {
    let known = Known::of::<In>(vec![("painting", AnyValue::new(sample_painting()))]);
    let ports = |node: &Recompose, output| match node.demand(output, &known).unwrap() {
        Demand::Need { ports, .. } => ports,
        Demand::Ready { .. } => vec![],
    };
    assert_eq!(ports(&Recompose::default(), "grounded"), ["mask"]);
    assert_eq!(ports(&Recompose::default(), "albedo"), [""; 0]);
    assert_eq!(ports(&node(0.5), "grounded"), ["ratio"]);
    assert_eq!(ports(&node(0.0), "luminance"), [""; 0]);
    assert_eq!(ports(&node(0.0), "evidence"), ["mask"]);
}

#[test]
fn alpha_passes_through_and_another_size_of_ratio_is_fitted() {
    let alpha = Field::from_fn(SAMPLE_SIZE.0, SAMPLE_SIZE.1, |x, _| x as f32 / 60.0);
    let painting = Image {
        alpha: Some(alpha.clone()),
        ..sample_painting()
    };
    let out = testing::run(&node(0.5), inputs(painting, Field::filled(200, 17, 0.1))).unwrap();
    assert_eq!(out.grounded.unwrap().alpha, Some(alpha));
}

#[test]
fn an_answer_or_an_error_on_every_extreme_input() {
    testing::assert_extremes(&Recompose::default());
}

#[test]
fn outputs_are_pure() {
    for node in [node(0.5), node(0.0), Recompose::default()] {
        testing::assert_pure(&node, || {
            inputs(sample_painting(), chain(&sample_translation().rgb, &sample_edges()))
        });
    }
}

#[test]
fn summary_of_the_sample() {
    let ratio = chain(&sample_translation().rgb, &sample_edges());
    let out = testing::run(&node(0.5), inputs(sample_painting(), ratio)).unwrap();
    insta::assert_json_snapshot!(serde_json::json!({
        "grounded": out.grounded.unwrap().summary(),
        "albedo": out.albedo.unwrap().summary(),
        "luminance": out.luminance.unwrap().summary(),
    }));
}
