//! What is odd but can be worked with is worked with: exit 0, and a note says what was odd.

use gear_image::{Field, SrgbImage};
use gear_tests::{Desk, Done};

use crate::{MAIN, SMALL};

fn small(desk: &Desk, input: &str) -> Done {
    desk.file("graph.yaml", SMALL);
    let given = format!("painting={input}");
    desk.gear(&["run", "graph.yaml", "--input", &given, "--out", "out"])
}

fn encoded(picture: &image::RgbImage, format: image::ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

#[test]
fn a_jpeg_called_png_is_decoded_by_its_content() {
    let desk = Desk::new();
    let picture = image::RgbImage::from_pixel(40, 30, image::Rgb([90, 120, 30]));
    desk.file("picture.png", encoded(&picture, image::ImageFormat::Jpeg));
    small(&desk, "picture.png").exits(0).says("JPEG");
    assert!(desk.path("out/enhanced.png").exists());
}

#[test]
fn pixels_that_are_no_colours_are_mended_and_counted() {
    let desk = Desk::new();
    let mut picture = image::Rgb32FImage::from_pixel(32, 24, image::Rgb([0.4, 0.3, 0.2]));
    picture.put_pixel(3, 4, image::Rgb([f32::NAN, 0.1, 0.1]));
    picture.put_pixel(5, 4, image::Rgb([f32::INFINITY, 0.1, 0.1]));
    picture.put_pixel(7, 4, image::Rgb([-3.0, 0.1, 0.1]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageFormat::OpenExr).unwrap();
    desk.file("light.exr", bytes.into_inner());
    small(&desk, "light.exr")
        .exits(0)
        .says("1 pixel has NaN")
        .says("1 pixel has infinite")
        .says("1 pixel has negative");
    for name in ["out/ratio.exr", "out/edges.exr"] {
        let bytes = std::fs::read(desk.path(name)).unwrap();
        let field = <Field as gear_graph::Value>::decode(&bytes).unwrap();
        assert!(field.data().iter().all(|x| x.is_finite()), "{name}");
    }
}

/// The whole main job on a picture of one shape: whatever it gives, it is there and finite.
fn main_job_on(width: usize, height: usize, color: impl Fn(usize, usize) -> [f32; 3]) {
    let desk = Desk::new();
    let picture = gear_image::Image::opaque(SrgbImage::from_fn(width, height, color));
    desk.file("picture.png", gear_image::io::png_bytes(&picture).unwrap());
    let mut arguments = MAIN.to_vec();
    arguments[3] = "painting=picture.png";
    desk.gear(&arguments).exits(0);
    let scene = gear_splat::formats::ply::read(&std::fs::read(desk.path("out/scene.ply")).unwrap()).unwrap();
    assert!(scene.centers.iter().all(|center| center.is_finite()));
    assert!(desk.path("out/report.html").exists());
}

#[test]
fn one_pixel() {
    main_job_on(1, 1, |_, _| [0.5, 0.4, 0.3]);
}

#[test]
fn one_row_of_four_thousand() {
    main_job_on(4000, 1, |x, _| [x as f32 / 4000.0, 0.4, 0.3]);
}

#[test]
fn one_column_of_four_thousand() {
    main_job_on(1, 4000, |_, y| [0.2, y as f32 / 4000.0, 0.3]);
}

#[test]
fn one_colour() {
    main_job_on(48, 40, |_, _| [0.5, 0.5, 0.5]);
}

#[test]
fn a_mask_that_says_nothing_or_does_not_fit_is_told_of() {
    let desk = Desk::new();
    let mask = |width, height, value| {
        let picture = image::GrayImage::from_pixel(width, height, image::Luma([value]));
        let mut bytes = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        desk.file("mask.png", bytes.into_inner())
    };
    let run = || {
        let more = ["--input", "mask=mask.png", "--output", "foreground"];
        desk.gear(&[MAIN, &more].concat()).exits(0)
    };
    mask(50, 64, 0);
    run().says("note: foreground: the mask is empty");
    let record = desk.record("out").0;
    let nodes = record["nodes"].as_array().unwrap();
    let foreground = nodes.iter().find(|node| node["id"] == "foreground").unwrap();
    assert!(
        foreground["notes"][0]
            .as_str()
            .unwrap()
            .contains("the whole canvas is used")
    );
    mask(64, 20, 255);
    run().says("the mask's proportions (64x20) differ from the painting's");
}

#[test]
fn a_store_that_cannot_be_written_only_costs_the_store() {
    let desk = Desk::new();
    desk.file("graph.yaml", SMALL);
    desk.file("file", "");
    let arguments = [
        "run",
        "graph.yaml",
        "--input",
        "painting=sample:vessel",
        "--store",
        "file/store",
    ];
    desk.gear(&arguments).exits(0).says("warning").says("file/store");
    assert!(desk.path("out/enhanced.png").exists());
}

#[cfg(unix)]
#[test]
fn a_store_that_is_full_only_costs_the_store() {
    let desk = Desk::new();
    // Nothing above 40 KiB can be written: what is larger does not fit the store, the files of this run do.
    let graph = SMALL
        .replace("size: 64", "size: 256")
        .replace("  edges: edges.edges\n  ratio: pyramid.ratio\n", "");
    desk.file(
        "graph.yaml",
        graph.replace("enhanced: enhance.image", "ratio: gain.alpha").replace(
            "  enhance: {node: Enhance, in: {image: painting}}\n",
            "  gain: {node: AdaptiveGain, in: {multiscale: pyramid.ratio, smooth: ratio.smooth}}\n",
        ),
    );
    let arguments = ["run", "graph.yaml", "--input", "painting=sample:vessel"];
    crate::a_full_disk_leaves_no_half_file::limited(&desk, 120, &arguments)
        .exits(0)
        .says("warning");
    assert!(desk.path("out/ratio.json").exists());
}
