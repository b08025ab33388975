use gear_image::{Field, Mask};

use super::*;
use crate::drawing::{Shape, Standing};
use crate::picture::Pixels;

fn picture(value: f32) -> Picture {
    Pixels::of_field(&Field::filled(4, 3, value)).png().unwrap()
}

/// A page with everything on it; texts carry characters that HTML treats specially.
fn full() -> Page {
    let shape = |id: &str, kind: &str, standing, note: &str| Shape {
        id: id.into(),
        kind: kind.into(),
        standing,
        note: note.into(),
    };
    Page {
        title: "A vessel <b>&</b> \"its\" scene".into(),
        subtitle: "gear.yaml".into(),
        facts: vec![("Gaussians".into(), "1,234".into())],
        problems: vec!["gain failed: 1 < 2".into()],
        graph: Drawing {
            shapes: vec![
                shape("painting", "input", Standing::End, ""),
                shape("gain", "AdaptiveGain", Standing::Ran, "0.1 s"),
                shape("translate", "Translate", Standing::LeftOut, "β is 0"),
            ],
            edges: vec![(0, 1), (0, 2), (2, 1)],
        },
        left_out: vec![Row {
            name: "translate".into(),
            text: "β is 0".into(),
        }],
        stages: vec![Figure {
            source: "foreground.mask".into(),
            caption: "What belongs to the figure.".into(),
            legend: Some(("−0.5".into(), "+0.5".into())),
            picture: Pixels::of_mask(&Mask::filled(2, 2, true)).png().unwrap(),
        }],
        mask: vec![Measure {
            name: "confidence".into(),
            value: "0.9".into(),
            meaning: "How far the mask can be trusted.".into(),
        }],
        comparisons: vec![Comparison {
            camera: "yaw +30°".into(),
            pictures: vec![("grounded".into(), picture(0.2)), ("restored".into(), picture(0.7))],
        }],
        orbit: vec![picture(0.1), picture(0.9)],
        curve: Curve {
            step: "iteration".into(),
            quantity: "loss".into(),
            points: vec![(0.0, 1.0), (1.0, 0.5)],
        },
        measures: vec![Measure {
            name: "VEND".into(),
            value: "64.3".into(),
            meaning: "How solid the scene is.".into(),
        }],
        costs: vec![Cost {
            node: "gain".into(),
            standing: Standing::Ran,
            seconds: Some(0.125),
            peak_bytes: Some(3 << 20),
            result_bytes: None,
        }],
        colophon: "gear 0.1.0".into(),
    }
}

/// The page without what changes freely: styles, script, pictures' bytes, the plot.
fn skeleton(html: &str) -> String {
    let mut kept = html.to_owned();
    for (open, close) in [("<style>", "</style>"), ("<script>", "</script>"), ("<svg ", "</svg>")] {
        while let Some(start) = kept.find(open) {
            let end = kept[start..].find(close).expect("every element is closed") + start + close.len();
            let name: String = open[1..].chars().take_while(char::is_ascii_alphabetic).collect();
            kept.replace_range(start..end, &format!("[{name}]"));
        }
    }
    while let Some(start) = kept.find(";base64,") {
        let end = kept[start..].find('"').expect("every attribute is closed") + start;
        kept.replace_range(start..end, ",…");
    }
    kept
}

#[test]
fn the_structure_of_a_full_page() {
    insta::assert_snapshot!(skeleton(&full().render().unwrap()));
}

#[test]
fn parts_without_content_are_left_out() {
    let html = Page {
        title: "Nothing".into(),
        ..Page::default()
    }
    .render()
    .unwrap();
    assert!(!html.contains("<section") && !html.contains("<script"), "{html}");
}

#[test]
fn a_page_refers_to_nothing_outside_itself() {
    let html = full().render().unwrap();
    for reference in ["src=\"http", "href=\"http", "url(", "@import", "fetch("] {
        assert!(!html.contains(reference), "{reference}");
    }
}

#[test]
fn every_picture_has_words() {
    let html = full().render().unwrap();
    let pictures = html.matches("<img").count();
    assert_eq!(pictures, 4);
    assert_eq!(html.matches(" alt=\"").count(), pictures);
    assert!(!html.contains("alt=\"\""));
}

#[test]
fn text_is_escaped() {
    let html = full().render().unwrap();
    assert!(!html.contains("<b>&</b>"));
    assert!(html.contains("gain failed: 1 &lt; 2"));
}

#[test]
fn the_same_page_has_the_same_bytes() {
    assert_eq!(full().render().unwrap(), full().render().unwrap());
}
