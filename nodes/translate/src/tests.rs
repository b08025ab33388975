use super::*;
use gear_graph::{Value, testing};
use gear_image::{LinearImage, Rgb, colour};

/// A vase-like body, shaded from the upper left, on paper, with an outline.
fn painting(side: usize) -> (Image, Mask) {
    let c = side as f32 / 2.0;
    let inside = |x: usize, y: usize| {
        let (u, v) = (
            (x as f32 - c) / (0.33 * side as f32),
            (y as f32 - c) / (0.42 * side as f32),
        );
        u * u + v * v
    };
    let light: LinearImage = Rgb::from_fn(side, side, |x, y| {
        let r = inside(x, y);
        if r > 1.0 {
            [0.7, 0.65, 0.5]
        } else if r > 0.93 {
            [0.05; 3]
        } else {
            let shade = 0.55 - 0.25 * ((x as f32 - c) + (y as f32 - c)) / side as f32;
            [0.8 * shade, 0.5 * shade, 0.3 * shade]
        }
    });
    (
        Image::opaque(light.to_srgb()),
        Mask::from_fn(side, side, |x, y| inside(x, y) <= 1.0),
    )
}

fn inputs(image: &Image, mask: &Mask) -> In {
    let (width, height) = image.size();
    In {
        image: Arc::new(image.clone()),
        edges: Lazy::given(Field::from_fn(width, height, |x, _| f32::from(x == width / 2))),
        mask: Lazy::given(mask.clone()),
        model: None,
    }
}

fn node(style: Style) -> Translate {
    Translate {
        style,
        ..Translate::default()
    }
}

const DRAWN: [Style; 3] = [Style::Sculpture, Style::PencilSketch, Style::Woodcut];

#[test]
fn none_passes_the_painting_bit_by_bit() {
    let (image, mask) = painting(40);
    let out = testing::run(&node(Style::None), inputs(&image, &mask)).unwrap();
    assert_eq!(out.image.digest(), image.digest());
}

#[test]
fn an_answer_or_an_error_on_every_extreme_input() {
    for style in [Style::None, Style::Sculpture, Style::PencilSketch, Style::Woodcut] {
        testing::assert_extremes(&node(style));
    }
}

#[test]
fn results_do_not_depend_on_threads() {
    let (image, mask) = painting(48);
    for style in DRAWN {
        testing::assert_pure(&node(style), || inputs(&image, &mask));
    }
}

#[test]
fn extremes_stay_finite_and_in_range() {
    for (w, h) in [(1, 1), (1, 40), (40, 1), (2, 3), (17, 16)] {
        for value in [0.0, 0.5, 1.0, f32::NAN, f32::INFINITY] {
            for full in [false, true] {
                let image = Image::opaque(Rgb::filled(w, h, [value; 3]));
                let mask = Mask::filled(w, h, full);
                for style in DRAWN {
                    let out = testing::run(&node(style), inputs(&image, &mask)).unwrap();
                    assert_eq!(out.image.size(), (w, h));
                    let flat = out.image.rgb.data().as_flattened();
                    assert!(
                        flat.iter().all(|c| (0.0..=1.0).contains(c)),
                        "{style:?} of {value} at {w}x{h}"
                    );
                }
            }
        }
    }
}

#[test]
fn marble_is_brighter_on_the_side_the_painting_lights() {
    let (image, mask) = painting(96);
    let out = testing::run(&node(Style::Sculpture), inputs(&image, &mask)).unwrap();
    let at = |x: usize, y: usize| colour::luminance(out.image.rgb.at(x, y));
    assert!(at(32, 30) > at(64, 66) + 0.1, "{} {}", at(32, 30), at(64, 66));
}

#[test]
fn light_follows_a_sure_fit_and_else_comes_from_the_upper_left() {
    use gear_relief::light::LightFit;
    let fit = |r2| LightFit {
        direction: [0.8, 0.0, 0.6],
        ambient: 0.0,
        gain: 1.0,
        r2,
        trust: 1.0,
    };
    let sure = sculpture::key_light(Some(&fit(1.0)));
    assert!((sure[0] - 0.8).abs() < 1e-6 && sure[1].abs() < 1e-6 && (sure[2] - 0.6).abs() < 1e-6);
    let unsure = sculpture::key_light(Some(&fit(0.0)));
    assert!(unsure[0] < 0.0 && unsure[1] < 0.0);
    assert_eq!(unsure, sculpture::key_light(None));
}

#[test]
fn another_seed_is_another_grain_and_only_that() {
    let (image, mask) = painting(64);
    let run = |style, seed| {
        let node = Translate { seed, ..node(style) };
        testing::run(&node, inputs(&image, &mask)).unwrap().image.digest()
    };
    assert_ne!(run(Style::PencilSketch, 1), run(Style::PencilSketch, 2));
    assert_eq!(run(Style::PencilSketch, 1), run(Style::PencilSketch, 1));
    assert_eq!(run(Style::Woodcut, 1), run(Style::Woodcut, 2));
}

#[test]
fn only_what_a_style_reads_is_demanded() {
    let unknown = || Known::of::<In>(vec![]);
    let need = |style| node(style).demand("image", &unknown()).unwrap();
    assert!(matches!(need(Style::None), Demand::Ready { .. }));
    assert!(matches!(need(Style::Sculpture), Demand::Need { ports, .. } if ports == ["mask"]));
    assert!(matches!(need(Style::Woodcut), Demand::Need { ports, .. } if ports == ["edges"]));
}

#[test]
fn summaries_on_a_small_painting_are_pinned() {
    let (image, mask) = painting(64);
    for style in DRAWN {
        let out = testing::run(&node(style), inputs(&image, &mask)).unwrap();
        insta::assert_json_snapshot!(format!("{style:?}"), out.image.summary());
    }
}

#[test]
fn what_a_style_does_not_look_at_is_said() {
    let mask = gear_graph::AnyValue::new(Mask::filled(2, 2, true));
    let node = Translate {
        style: Style::Sculpture,
        contours: 0.3,
        seed: 7,
    };
    let answer = node.demand("image", &Known::of::<In>(vec![("mask", mask)])).unwrap();
    assert_eq!(answer, Demand::ready_because("style sculpture does not look at edges"));
}

/// Lengths in pixels are those of a picture of 512 px, for which the prototype is written.
#[test]
fn drawn_styles_agree_with_the_prototype() {
    let oracle: serde_json::Value =
        serde_json::from_str(include_str!("../../../tests/oracles/drawn_styles.json")).unwrap();
    let light: LinearImage = Rgb::from_fn(512, 72, |x, y| {
        let (x, y) = (x as f64, y as f64);
        let tone = 0.45 + 0.33 * libm::sin(x / 23.0 + y / 31.0) * libm::cos(y / 17.0 - x / 61.0);
        let (u, v) = ((x - 256.0) / 90.0, (y - 36.0) / 28.0);
        let tone = if u * u + v * v < 1.0 { tone * 0.45 + 0.03 } else { tone };
        [0.8, 0.5, 0.3].map(|c: f64| (c * tone) as f32)
    });
    let picture = light.to_srgb();
    for (name, ours) in [
        ("pencil-sketch", pencil::sketch(&picture, 7)),
        ("woodcut", woodcut::cut(&picture)),
    ] {
        let expected: Vec<f32> = serde_json::from_value(oracle[name].clone()).unwrap();
        let mut errors: Vec<f32> = (0..)
            .step_by(331)
            .zip(&expected)
            .map(|(p, expected)| (ours.data()[p] - expected).abs())
            .collect();
        errors.sort_by(f32::total_cmp);
        let tolerance = |what: &str| oracle["tolerance"][what].as_f64().unwrap() as f32;
        let (most, worst) = (errors[errors.len() * 9 / 10], errors[errors.len() - 1]);
        assert!(
            most <= tolerance("nine_in_ten") && worst <= tolerance("worst"),
            "{name}: nine in ten within {most}, the worst {worst}"
        );
    }
}

mod network {
    use super::*;
    use gear_graph::AnyValue;
    use gear_onnx::testing::{Net, can_run, model, with};

    fn network() -> Translate {
        node(Style::Network {
            provider: Provider::Cpu,
        })
    }

    #[test]
    fn the_network_s_picture_comes_out_at_the_painting_s_size() {
        if !can_run() {
            return;
        }
        let (image, mask) = painting(40);
        let asked = || In {
            model: Some(Lazy::given(model(&Net::Negative))),
            ..inputs(&image, &mask)
        };
        let out = testing::run(&network(), asked()).unwrap();
        assert_eq!(out.image.size(), image.size());
        for (made, painted) in out.image.rgb.data().iter().zip(image.rgb.data()) {
            assert!((0..3).all(|c| (made[c] + painted[c] - 1.0).abs() < 1e-6));
        }
        testing::assert_pure(&network(), asked);
    }

    #[test]
    fn it_asks_for_the_planes_that_the_network_takes_and_no_others() {
        let ask = |declaration: &str, net: &Net| {
            let model = AnyValue::new(with(net, declaration));
            network()
                .demand("image", &Known::of::<In>(vec![("model", model)]))
                .unwrap()
        };
        let plain = ask("network: 1\nanswer: picture\n", &Net::Negative);
        assert!(matches!(plain, Demand::Ready { .. }), "{plain:?}");
        let masked = ask("network: 1\nchannels: [red, mask]\nanswer: picture\n", &Net::MeanOf(2));
        assert!(
            matches!(&masked, Demand::Need { ports, .. } if *ports == ["mask"]),
            "{masked:?}"
        );
        let first = network().demand("image", &Known::of::<In>(Vec::new())).unwrap();
        assert!(
            matches!(&first, Demand::Need { ports, .. } if *ports == ["model"]),
            "{first:?}"
        );
    }

    #[test]
    fn an_answer_or_an_error_on_every_extreme_input() {
        testing::assert_extremes(&network());
        let (image, mask) = painting(40);
        let error = testing::run(&network(), inputs(&image, &mask)).err().unwrap();
        assert!(error.to_string().contains("--input NAME=FILE"), "{error}");
    }
}
