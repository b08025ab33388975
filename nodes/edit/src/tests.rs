//! The node as a whole, on a painted sample with its true surface.

use gear_graph::{Value, testing};
use gear_image::{Rgb, SrgbImage};
use gear_sample::{Options, Sample, paint};
use gear_splat::{Projection, orbit};
use proptest::prelude::*;

use super::*;

fn sample(side: usize) -> Sample {
    let options = Options {
        longer_side: side,
        ..Options::default()
    };
    paint("court-lady", &options).unwrap()
}

/// The scene of a sample in colours that are not the painting's: darker and flatter, as after grounding.
fn grounded(sample: &Sample) -> Scene {
    let mut scene = sample.scene(1);
    for dc in &mut scene.sh_dc {
        *dc = dc.map(|c| 0.5 * c - 0.6);
    }
    scene
}

fn inputs(sample: &Sample, scene: Scene, yaws: &[f64]) -> In {
    let cameras = orbit::cameras(&scene, yaws, 0);
    let view = |(camera, yaw): (&Camera, &f64)| {
        orbit::view(&scene, camera, orbit::yaw_name(*yaw), &RenderOptions::default(), true)
    };
    In {
        views: Arc::new(Views {
            views: cameras.iter().zip(yaws).map(view).collect(),
        }),
        scene: Arc::new(scene),
        painting: Arc::new(sample.painting.clone()),
        mask: Arc::new(sample.mask.clone()),
    }
}

fn targets(inputs: In) -> Vec<View> {
    let out = testing::run(&Edit::default(), inputs).unwrap();
    out.targets.views.clone()
}

/// Mean absolute difference on the pixels where `keep` holds.
fn difference(a: &SrgbImage, b: &SrgbImage, keep: impl Fn(usize) -> bool) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for i in (0..a.len()).filter(|&i| keep(i)) {
        for c in 0..3 {
            sum += f64::from((a.data()[i][c] - b.data()[i][c]).abs());
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}

#[test]
fn at_the_canonical_camera_the_target_is_the_painting_bit_for_bit() {
    let sample = sample(96);
    let front = &targets(inputs(&sample, grounded(&sample), &[0.0]))[0];
    let (weight, alpha) = (front.weight.as_ref().unwrap(), front.alpha.as_ref().unwrap());
    for i in 0..sample.mask.len() {
        if sample.mask.data()[i] {
            assert_eq!(front.rgb.data()[i], sample.painting.rgb.data()[i]);
            assert_eq!(weight.data()[i], 1.0);
        } else if alpha.data()[i] == 0.0 {
            assert_eq!((front.rgb.data()[i], weight.data()[i]), ([1.0; 3], 1.0));
        }
    }
}

#[test]
fn beside_the_mask_the_rim_is_not_asked_to_be_white() {
    let sample = sample(96);
    let front = &targets(inputs(&sample, grounded(&sample), &[0.0]))[0];
    let (weight, alpha) = (front.weight.as_ref().unwrap(), front.alpha.as_ref().unwrap());
    let fringe: Vec<usize> = (0..sample.mask.len())
        .filter(|&i| !sample.mask.data()[i] && alpha.data()[i] > 0.2)
        .collect();
    assert!(fringe.len() > 20, "{}", fringe.len());
    for i in fringe {
        assert!(front.rgb.data()[i].iter().sum::<f32>() < 3.0 && weight.data()[i] < 1.0);
    }
}

#[test]
fn a_view_that_the_painting_tells_entirely_needs_no_filling() {
    let sample = sample(64);
    let scene = grounded(&sample);
    let inputs = inputs(&sample, scene, &[0.0]);
    let camera = canonical(&inputs.scene, sample.painting.size()).unwrap();
    let front = gear_splat::render(
        &inputs.scene,
        &camera,
        &RenderOptions::default(),
        gear_splat::Outputs::ALL,
    );
    let source = Source {
        painting: &sample.painting.rgb,
        mask: &sample.mask,
        camera,
        depth: front.surface_depth().unwrap(),
        tolerance_px: 2.0,
        feather_px: 1.0,
    };
    let view = &inputs.views.views[0];
    let told = Told::of(&source, view, &buffers(view).unwrap());
    assert!(told.is_complete());
    let recipe = Recipe {
        sigma: 1.0,
        rotations: 20,
        patch: 7,
        rounds: 4,
        seed: 0,
    };
    let filler = Filler::new(&view.rgb, &sample.painting.rgb, &sample.mask, recipe);
    let trust = Trust { back: 0.5, fill: 0.3 };
    let alpha = view.alpha.as_ref().unwrap();
    let with = target::target(told, view, alpha, &trust, Some(&filler));
    let told = Told::of(&source, view, &buffers(view).unwrap());
    let without = target::target(told, view, alpha, &trust, None);
    // Depths hold NaN, which is not equal to itself; digests go by bits.
    let digest = |view: View| Views { views: vec![view] }.digest();
    assert!(digest(with) == digest(without));
}

/// The truth: the true surface in its true colours, rendered. Ink and grain are the painting's own, so the front's own
/// distance to the painting is the measure.
#[test]
fn turned_views_come_closer_to_the_true_colours_than_the_grounded_ones() {
    let sample = sample(128);
    let yaws = [-60.0, -20.0, 20.0, 60.0];
    let truth = inputs(&sample, sample.scene(1), &yaws);
    let edited = inputs(&sample, grounded(&sample), &yaws);
    let before = edited.views.views.clone();
    for ((target, before), truth) in targets(edited).iter().zip(&before).zip(&truth.views.views) {
        let solid = |i: usize| before.alpha.as_ref().unwrap().data()[i] > 0.9;
        let (was, is) = (
            difference(&before.rgb, &truth.rgb, solid),
            difference(&target.rgb, &truth.rgb, solid),
        );
        println!("{}: {was:.4} → {is:.4}", target.name);
        assert!(is < 0.7 * was, "{}: {was} → {is}", target.name);
    }
}

#[test]
fn beyond_the_silhouette_is_white_and_trusted() {
    let sample = sample(96);
    for target in targets(inputs(&sample, grounded(&sample), &[-90.0, 45.0, 180.0])) {
        let alpha = target.alpha.as_ref().unwrap();
        let weight = target.weight.as_ref().unwrap();
        for i in 0..alpha.len() {
            assert!((0.0..=1.0).contains(&weight.data()[i]));
            if alpha.data()[i] == 0.0 {
                assert_eq!((target.rgb.data()[i], weight.data()[i]), ([1.0; 3], 1.0));
            }
            assert!(target.rgb.data()[i].iter().all(|c| (0.0..=1.0).contains(c)));
        }
    }
}

#[test]
fn a_pinhole_camera_is_edited_as_well() {
    let sample = sample(96);
    let mut scene = grounded(&sample);
    let (width, height) = sample.painting.size();
    scene.canonical_camera = Some(Camera::front_pinhole(width as u32, height as u32, 0.3));
    let inputs = inputs(&sample, scene, &[0.0, 30.0]);
    assert!(matches!(
        inputs.views.views[1].camera.projection,
        Projection::Pinhole { .. }
    ));
    let targets = targets(inputs);
    let painted = |i: usize| sample.mask.data()[i];
    assert_eq!(difference(&targets[0].rgb, &sample.painting.rgb, painted), 0.0);
    let (weight, alpha) = (targets[1].weight.as_ref().unwrap(), targets[1].alpha.as_ref().unwrap());
    let solid = (0..alpha.len()).filter(|&i| alpha.data()[i] > 0.9);
    let told = solid.clone().filter(|&i| weight.data()[i] > 0.9).count();
    assert!(
        2 * told > solid.count(),
        "half of a view at 30 degrees is what the painter saw"
    );
}

#[test]
fn what_cannot_be_used_is_refused_by_port() {
    let sample = sample(32);
    let fails = |change: fn(&mut In), words: &[&str]| {
        let mut inputs = inputs(&sample, grounded(&sample), &[30.0]);
        change(&mut inputs);
        let error = testing::run(&Edit::default(), inputs).err().unwrap().to_string();
        assert!(words.iter().all(|w| error.contains(w)), "{error}");
    };
    fails(|i| i.mask = Arc::new(Mask::filled(3, 4, true)), &["mask", "3×4"]);
    fails(
        |i| Arc::make_mut(&mut i.scene).canonical_camera = None,
        &["scene", "canonical camera"],
    );
    fails(
        |i| Arc::make_mut(&mut i.views).views[0].depth = None,
        &["views", "yaw+30", "depth"],
    );
    fails(
        |i| Arc::make_mut(&mut i.painting).rgb = Rgb::filled(9, 9, [0.5; 3]),
        &["mask"],
    );
}

#[test]
fn empty_scenes_and_masks_do_no_harm() {
    let sample = sample(32);
    let mut scene = grounded(&sample).filtered(|_| false);
    scene.canonical_camera = Some(sample.camera());
    let target = &targets(inputs(&sample, scene, &[30.0]))[0];
    assert!(target.rgb.data().iter().all(|c| *c == [1.0; 3]));
    let mut inputs = inputs(&sample, grounded(&sample), &[0.0, 30.0]);
    let (width, height) = sample.painting.size();
    inputs.mask = Arc::new(Mask::filled(width, height, false));
    for target in targets(inputs) {
        assert!(target.rgb.data().iter().flatten().all(|c| c.is_finite()));
    }
}

#[test]
fn an_answer_or_an_error_on_every_extreme_input() {
    testing::assert_extremes(&Edit::default());
}

#[test]
fn same_bits_on_any_thread_count() {
    let sample = sample(64);
    let scene = grounded(&sample);
    testing::assert_pure(&Edit::default(), || inputs(&sample, scene.clone(), &[0.0, 40.0, 150.0]));
}

#[test]
fn the_targets_of_a_sample_are_pinned() {
    let sample = sample(96);
    let out = testing::run(
        &Edit::default(),
        inputs(&sample, grounded(&sample), &[-60.0, 0.0, 60.0]),
    )
    .unwrap();
    insta::assert_json_snapshot!(out.targets.summary());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]
    #[test]
    fn targets_stay_in_range_for_any_yaw(yaw in -180.0..180.0f64, patch in 3usize..12) {
        let sample = sample(32);
        let edit = Edit { patch, ..Edit::default() };
        let out = testing::run(&edit, inputs(&sample, grounded(&sample), &[yaw])).unwrap();
        let target = &out.targets.views[0];
        prop_assert!(target.rgb.data().iter().flatten().all(|c| (0.0..=1.0).contains(c)));
        prop_assert!(target.weight.as_ref().unwrap().data().iter().all(|w| (0.0..=1.0).contains(w)));
    }
}
