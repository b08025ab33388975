use gear_graph::{Value, testing};
use gear_image::Rgb;
use gear_image::testing::sample_painting;

use super::*;

fn canny_node() -> EdgeDetect {
    EdgeDetect {
        method: Method::Canny {
            low: 0.1,
            high: 0.3,
            sigma: 1.4,
        },
    }
}

fn inputs(image: Image) -> In {
    In {
        image: Arc::new(image),
        model: None,
    }
}

fn run(node: &EdgeDetect, image: Image) -> Arc<Field> {
    testing::run(node, inputs(image)).unwrap().edges
}

fn disc() -> Image {
    Image::opaque(Rgb::from_fn(96, 80, |x, y| {
        let inside = x.abs_diff(48).pow(2) + y.abs_diff(40).pow(2) < 24 * 24;
        if inside { [0.8, 0.7, 0.6] } else { [0.3, 0.35, 0.4] }
    }))
}

#[test]
fn a_disc_is_outlined_once_three_pixels_wide_and_closed() {
    let edges = run(&canny_node(), disc());
    for y in 0..80usize {
        for x in 0..96usize {
            let distance = root(x.abs_diff(48).pow(2) + y.abs_diff(40).pow(2)) - 24.0;
            assert!(edges.at(x, y) == 0.0 || distance.abs() < 4.0, "({x}, {y})");
        }
    }
    // Every ray from the centre meets the outline, and the row through it meets it twice, about 3 px wide.
    let through = edges.row(40);
    let runs: Vec<usize> = through
        .split(|&e| e == 0.0)
        .map(<[f32]>::len)
        .filter(|&n| n > 0)
        .collect();
    assert_eq!(runs.len(), 2);
    assert!(runs.iter().all(|n| (3..=4).contains(n)), "{runs:?}");
    let outside = gear_image::Mask::from_fn(96, 80, |x, y| edges.at(x, y) == 0.0);
    let parts = gear_image::filter::components(&outside, gear_image::filter::Connectivity::Four);
    assert_eq!(parts.sizes.len(), 2, "inside and outside are apart");
}

fn root(squared: usize) -> f32 {
    (squared as f32).sqrt()
}

#[test]
fn a_weak_contour_is_kept_only_where_it_continues_a_strong_one() {
    // A step whose contrast fades from left to right, and a weak one apart from it.
    let picture = |apart: bool| {
        Image::opaque(Rgb::from_fn(120, 60, move |x, y| {
            let fading = 0.5 * (1.0 - x as f32 / 119.0).max(0.18);
            let value = if y < 20 { 0.3 } else { 0.3 + fading };
            [if apart && x > 70 && y > 40 && x + y > 118 {
                value + 0.045
            } else {
                value
            }; 3]
        }))
    };
    let edges = run(
        &EdgeDetect {
            method: Method::Canny {
                low: 0.1,
                high: 0.5,
                sigma: 1.0,
            },
        },
        picture(true),
    );
    assert!(edges.at(2, 20) == 1.0, "strong");
    assert!((100..118).all(|x| edges.at(x, 20) == 1.0), "weak, continued");
    assert!((45..58).all(|y| edges.at(118 - y, y) == 0.0), "weak, apart");
}

#[test]
fn soft_edges_lie_in_the_unit_range_and_peak_on_the_contour() {
    let edges = run(&EdgeDetect::default(), disc());
    assert!(edges.data().iter().all(|e| (0.0..=1.0).contains(e)));
    assert!(edges.at(24, 40) > 0.9 && edges.at(48, 40) < 0.01 && edges.at(4, 4) < 0.01);
}

#[test]
fn every_extreme_picture_has_edges_in_range() {
    for node in [EdgeDetect::default(), canny_node()] {
        for (name, image) in Image::extremes() {
            let size = image.size();
            let edges = run(&node, image);
            assert_eq!(edges.size(), size);
            assert!(edges.data().iter().all(|e| (0.0..=1.0).contains(e)), "{name}");
        }
    }
}

#[test]
fn thresholds_that_contradict_are_refused() {
    let node = EdgeDetect {
        method: Method::Canny {
            low: 0.5,
            high: 0.1,
            sigma: 1.0,
        },
    };
    assert!(testing::check(&node).unwrap_err().to_string().contains("low"));
    let read = testing::read::<EdgeDetect>(&serde_json::json!({"method": {"canny": {"low": 0.2}}})).unwrap();
    assert_eq!(
        read.method,
        Method::Canny {
            low: 0.2,
            high: 0.3,
            sigma: 1.4
        }
    );
}

#[test]
fn an_answer_or_an_error_on_every_extreme_input() {
    testing::assert_extremes(&EdgeDetect::default());
}

#[test]
fn outputs_are_pure() {
    for node in [EdgeDetect::default(), canny_node()] {
        testing::assert_pure(&node, || inputs(sample_painting()));
    }
}

#[test]
fn summary_of_the_sample() {
    insta::assert_json_snapshot!(serde_json::json!({
        "gradient": run(&EdgeDetect::default(), sample_painting()).summary(),
        "canny": run(&canny_node(), sample_painting()).summary(),
    }));
}

mod network {
    //! Networks that the tests make, and PiDiNet where its file is.

    use super::*;
    use gear_onnx::Familiar;
    use gear_onnx::testing::{Net, can_run, model, shared};

    fn node() -> EdgeDetect {
        EdgeDetect {
            method: Method::Network {
                provider: Provider::Cpu,
            },
        }
    }

    fn asked(model: Model, image: Image) -> Result<Arc<Field>, NodeError> {
        let inputs = In {
            model: Some(Lazy::given(model)),
            ..inputs(image)
        };
        testing::run(&node(), inputs).map(|out| out.edges)
    }

    #[test]
    fn the_network_s_contours_come_out() {
        if !can_run() {
            return;
        }
        let edges = asked(model(&Net::Edges), disc()).unwrap();
        assert_eq!(edges.size(), (96, 80));
        assert!(edges.at(24, 40) > 0.1 && edges.at(48, 40) < 1e-5 && edges.at(4, 4) < 1e-5);
        testing::assert_pure(&node(), || In {
            model: Some(Lazy::given(model(&Net::Edges))),
            ..inputs(sample_painting())
        });
        testing::assert_extremes(&node());
    }

    #[test]
    fn without_a_network_or_with_one_of_another_kind_it_says_so() {
        let error = testing::run(&node(), inputs(disc())).err().unwrap();
        assert!(error.to_string().contains("--input NAME=FILE"), "{error}");
        let error = asked(model(&Net::Mean), disc()).unwrap_err();
        assert!(error.to_string().contains("`answer: edges` is needed here"), "{error}");
    }

    #[test]
    fn embedded_methods_do_not_ask_for_it() {
        let known = Known::of::<In>(Vec::new());
        assert!(matches!(
            EdgeDetect::default().demand("edges", &known),
            Ok(Demand::Ready { .. })
        ));
        let asked = node().demand("edges", &known).unwrap();
        assert!(matches!(asked, Demand::Need { ports, .. } if ports == ["model"]));
        assert_eq!(EdgeDetect::default().realm(&Resources::default()), "cpu");
    }

    #[test]
    fn pidinet_outlines_a_disc() {
        for file in ["table5_pidinet.onnx", "table5_pidinet-tiny.onnx"] {
            let Some(pidinet) = shared(file, Familiar::Pidinet).filter(|_| can_run()) else {
                continue;
            };
            let edges = asked(pidinet, disc()).unwrap();
            let on = [(24, 40), (72, 40), (48, 16), (48, 64)].map(|(x, y)| edges.at(x, y));
            let off = [(48, 40), (6, 6), (90, 74)].map(|(x, y)| edges.at(x, y));
            let (on, off) = (on.into_iter().fold(1.0, f32::min), off.into_iter().fold(0.0, f32::max));
            assert!(on > 3.0 * off, "{file}: {on} on the outline, {off} off it");
        }
    }
}
