//! Promises of the whole search; its parts are tested where they stand.

use super::*;
use gear_sample::{Background, Condition, Options, paint};

fn overlap(a: &Mask, b: &Mask) -> f64 {
    let pairs = || a.data().iter().zip(b.data());
    let both = pairs().filter(|(a, b)| **a && **b).count();
    let any = pairs().filter(|(a, b)| **a || **b).count();
    both as f64 / any.max(1) as f64
}

fn sample(name: &str, background: Background, seed: u64) -> gear_sample::Sample {
    paint(
        name,
        &Options {
            longer_side: 256,
            background,
            seed,
            condition: Condition::Paint,
            ..Options::default()
        },
    )
    .unwrap()
}

#[test]
fn figures_are_found_on_plain_textured_and_bordered_grounds() {
    for name in ["court-lady", "vessel"] {
        for (background, least) in [
            (Background::Plain, 0.95),
            (Background::Textured, 0.9),
            (Background::Bordered, 0.9),
        ] {
            let sample = sample(name, background, 1);
            let found = automatic(&sample.painting.rgb, &Settings::default());
            let iou = overlap(&found.mask, &sample.mask);
            assert!(
                found.mode == Mode::Figure && iou >= least,
                "{name} {background:?}: {:?} {iou:.3}",
                found.mode
            );
        }
    }
}

#[test]
fn a_frame_is_found_where_there_is_one_and_nowhere_else() {
    let framed = automatic(
        &sample("court-lady", Background::Bordered, 1).painting.rgb,
        &Settings::default(),
    );
    assert!(framed.frame.is_some());
    let bare = automatic(
        &sample("court-lady", Background::Plain, 1).painting.rgb,
        &Settings::default(),
    );
    assert!(bare.frame.is_none());
}

#[test]
fn a_landscape_is_a_whole_canvas_relief() {
    for seed in 1..4 {
        let found = automatic(
            &sample("landscape-relief", Background::Plain, seed).painting.rgb,
            &Settings::default(),
        );
        assert!(
            found.mode == Mode::Relief && found.mask.is_full(),
            "seed {seed}: {:?}",
            found.doubts
        );
    }
}

#[test]
fn a_rough_box_is_enough() {
    let sample = sample("vessel", Background::Textured, 1);
    let found = in_box(&sample.painting.rgb, [0.08, 0.1, 0.88, 0.97], &Settings::default());
    let iou = overlap(&found.mask, &sample.mask);
    assert!(found.mode == Mode::Box && iou > 0.9, "{iou:.3}");
    let (w, _) = sample.painting.size();
    assert!((0..w / 20).all(|x| !found.mask.at(x, 100)), "nothing outside the box");
}

#[test]
fn pictures_without_a_figure_are_the_whole_canvas() {
    for (w, h) in [
        (1, 1),
        (1, 50),
        (50, 1),
        (2, 2),
        (15, 400),
        (16, 16),
        (17, 33),
        (64, 48),
    ] {
        let grey = SrgbImage::filled(w, h, [0.5, 0.4, 0.3]);
        let found = automatic(&grey, &Settings::default());
        assert!(
            found.mask.is_full() && found.mask.size() == (w, h) && found.confidence == Some(0.0),
            "{w}x{h}"
        );
        let boxed = in_box(&grey, [0.4, 0.4, 0.6, 0.6], &Settings::default());
        assert!(boxed.mask.size() == (w, h) && boxed.mask.count() > 0);
    }
}

#[test]
fn broken_samples_do_no_harm() {
    let mut image = sample("vessel", Background::Plain, 1).painting.rgb;
    for (i, value) in [f32::NAN, f32::INFINITY, -1.0, 1e30, f32::NEG_INFINITY]
        .into_iter()
        .enumerate()
    {
        image.data_mut()[1000 + 700 * i] = [value; 3];
    }
    let found = automatic(&image, &Settings::default());
    assert_eq!(found.mask.size(), image.size());
    assert!(found.confidence.is_some_and(f64::is_finite));
}

#[test]
fn an_empty_mask_means_the_whole_canvas() {
    let found = given(&Mask::filled(4, 4, false), 20, 10);
    assert!(found.mode == Mode::Relief && found.mask.is_full() && found.mask.size() == (20, 10));
}

#[test]
fn the_same_mask_on_one_thread_and_on_many() {
    let image = sample("vessel", Background::Textured, 2).painting.rgb;
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap()
        .install(|| automatic(&image, &Settings::default()));
    let many = rayon::ThreadPoolBuilder::new()
        .num_threads(5)
        .build()
        .unwrap()
        .install(|| automatic(&image, &Settings::default()));
    assert_eq!(one, many);
}
