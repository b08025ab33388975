use gear_graph::{Value, testing};
use gear_image::Rgb;
use gear_image::testing::{Oracle, sample_painting};

use super::*;

fn retinex_node() -> Enhance {
    Enhance {
        method: Method::Retinex {
            scales: vec![0.03, 0.12, 0.3],
        },
    }
}

fn run(node: &Enhance, image: Image) -> Arc<Image> {
    testing::run(node, In { image: Arc::new(image) }).unwrap().image
}

#[test]
fn both_methods_are_the_prototype_s() {
    let oracle = Oracle::parse(include_str!("../tests/oracle.json"));
    let check = |name, node: Enhance| oracle.check(name, run(&node, sample_painting()).rgb.data().as_flattened());
    check("histogram_equalization", Enhance::default());
    check("retinex", retinex_node());
}

#[test]
fn a_constant_picture_stays_as_it_is() {
    for node in [Enhance::default(), retinex_node()] {
        let out = run(&node, Image::opaque(Rgb::filled(30, 20, [0.3, 0.5, 0.2])));
        assert!(
            out.rgb
                .data()
                .iter()
                .all(|p| (p[0] - 0.3).abs() + (p[1] - 0.5).abs() + (p[2] - 0.2).abs() < 1e-5)
        );
    }
}

#[test]
fn every_extreme_picture_comes_out_in_range_with_its_alpha() {
    for node in [Enhance::default(), retinex_node()] {
        for (name, image) in Image::extremes() {
            let alpha = image.alpha.clone();
            let out = run(&node, image);
            assert!(
                out.rgb
                    .data()
                    .as_flattened()
                    .iter()
                    .all(|x| (0.0..=1.000_001).contains(x)),
                "{name}"
            );
            assert_eq!(out.alpha, alpha);
        }
    }
}

#[test]
fn retinex_needs_a_scale() {
    let none = Enhance {
        method: Method::Retinex { scales: vec![] },
    };
    assert!(testing::check(&none).unwrap_err().to_string().contains("scales"));
}

#[test]
fn an_answer_or_an_error_on_every_extreme_input() {
    testing::assert_extremes(&Enhance::default());
}

#[test]
fn outputs_are_pure() {
    for node in [Enhance::default(), retinex_node()] {
        testing::assert_pure(&node, || In {
            image: Arc::new(sample_painting()),
        });
    }
}

#[test]
fn summary_of_the_sample() {
    insta::assert_json_snapshot!(serde_json::json!({
        "histogram-equalization": run(&Enhance::default(), sample_painting()).summary(),
        "retinex": run(&retinex_node(), sample_painting()).summary(),
    }));
}
