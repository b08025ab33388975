//! What is stiff, extreme or wrong, and what comes of it.

use super::*;
use crate::cpu::Frame;

#[test]
fn an_infinitely_strong_anchor_returns_the_scene() {
    let scene = dome(24);
    let views = targets(&scene, &[0.0]);
    for anchor in [1e12, 1e30] {
        let options = RefineOptions {
            anchor,
            iterations: 10,
            color_iterations: 10,
            ..RefineOptions::default()
        };
        let refined = run(&scene, &views, &options);
        let moved = |a: f32, b: f32| (a - b).abs();
        for i in 0..scene.len() {
            assert!((refined.scene.centers[i] - scene.centers[i]).length() < 1e-6);
            assert!((0..3).all(|c| moved(refined.scene.sh_dc[i][c], scene.sh_dc[i][c]) < 1e-5));
        }
    }
}

#[test]
fn any_anchor_weight_gives_a_finite_scene_that_is_no_worse() {
    let scene = dome(24);
    let views = targets(&scene, &[-30.0, 0.0]);
    for anchor in [0.0, 1e-2, 1.0, 50.0, 1e3, 1e6, 1e12] {
        let options = RefineOptions {
            anchor,
            iterations: 15,
            color_iterations: 15,
            check_every: 5,
            ..RefineOptions::default()
        };
        let refined = run(&scene, &views, &options);
        assert_eq!(refined.scene.count_invalid(), 0);
        let best = refined.curve.iter().map(|p| p.loss).fold(f64::INFINITY, f64::min);
        assert!(best <= refined.curve[0].loss, "{anchor}");
    }
}

#[test]
fn attributes_stay_within_their_limits() {
    let scene = dome(40);
    let mut options = RefineOptions {
        iterations: 30,
        color_iterations: 0,
        anchor: 0.0,
        ..RefineOptions::default()
    };
    options.rates = Rates {
        center: 1e-3,
        rotation: 0.5,
        scale: 2.0,
        opacity: 5.0,
        color: 0.1,
    };
    let mut anchored = Anchored::new(&scene, &options);
    let extent = scene.bounds().unwrap().longest_side();
    let target = &Target::all(&targets(&scene, &[0.0]), 0.2, None).unwrap()[0];
    let (mut scratch, mut pixels) = Default::default();
    for _ in 0..10 {
        let frame = Frame::new(&anchored.scene, &target.camera, &options.render, Outputs::RGBA);
        let picture = frame.draw();
        target.gradient(&picture, 1.0, &mut scratch, &mut pixels);
        let gradients = frame.backward(&anchored.scene, &picture, &pixels, Wanted::ALL);
        anchored.gather(gradients);
        anchored.step(Wanted::ALL, 1.0);
        for i in 0..scene.len() {
            let scales = anchored.scene.scales(i);
            assert!(
                scales.max_element() <= 0.2001 * extent && scales.min_element() >= 0.99e-4 * extent,
                "{scales}"
            );
            assert!(scales.max_element() / scales.min_element() <= 201.0);
            assert!((anchored.scene.rotations[i].length() - 1.0).abs() < 1e-5);
            assert!(anchored.scene.rotations[i].dot(scene.rotations[i]) >= 0.0);
            assert!(anchored.scene.opacity_logits[i].abs() <= 9.0);
        }
    }
}

#[test]
fn a_gaussian_whose_gradient_is_not_finite_is_left_out_and_counted() {
    let scene = dome(8);
    let mut anchored = Anchored::new(&scene, &RefineOptions::default());
    let n = scene.len();
    let mut gradients = crate::render::SceneGradients {
        centers: vec![Vec3::ONE * 1e-3; n],
        log_scales: vec![Vec3::ZERO; n],
        rotations: vec![glam::Vec4::ZERO; n],
        opacity_logits: vec![0.0; n],
        sh_dc: vec![[1e-3; 3]; n],
        sh_rest: Vec::new(),
    };
    gradients.opacity_logits[3] = f32::NAN;
    anchored.gather(gradients);
    assert_eq!(anchored.step(Wanted::ALL, 1.0), 1);
    assert_eq!(anchored.scene.centers[3], scene.centers[3]);
    assert_ne!(anchored.scene.centers[2], scene.centers[2]);
    assert_eq!(anchored.scene.count_invalid(), 0);
}

#[test]
fn pixels_without_weight_have_no_say() {
    let scene = dome(24);
    let honest = targets(&scene, &[0.0]);
    let mut spoiled = honest.clone();
    let View { rgb, weight, .. } = &mut spoiled.views[0];
    for (pixel, weight) in rgb.data_mut().iter_mut().zip(weight.as_ref().unwrap().data()) {
        if *weight == 0.0 {
            *pixel = [f32::NAN, 7.0, -3.0];
        }
    }
    let options = RefineOptions {
        iterations: 5,
        color_iterations: 5,
        ssim: 0.0,
        ..RefineOptions::default()
    };
    assert_eq!(
        run(&scene, &honest, &options).scene,
        run(&scene, &spoiled, &options).scene
    );
}

#[test]
fn nothing_to_fit_returns_the_scene_with_that_status() {
    let scene = dome(8);
    let mut blind = targets(&scene, &[0.0]);
    blind.views[0].weight = Some(Field::filled(8, 8, 0.0));
    for views in [blind, Views::default()] {
        let refined = run(&scene, &views, &RefineOptions::default());
        assert_eq!((refined.status, &refined.scene), (Status::NothingToFit, &scene));
    }
    let empty = run(&Scene::default(), &targets(&scene, &[0.0]), &RefineOptions::default());
    assert_eq!(empty.status, Status::NothingToFit);
}

#[test]
fn a_target_that_does_not_fit_its_camera_is_named() {
    let scene = dome(8);
    let mut views = targets(&scene, &[0.0]);
    views.views[0].rgb = Rgb::filled(3, 3, [0.0; 3]);
    let error = refine(&scene, &views, &RefineOptions::default(), &mut |_| {
        ControlFlow::Continue(())
    })
    .unwrap_err();
    assert!(error.to_string().contains("yaw+0"), "{error}");
}

#[test]
fn an_attribute_without_a_step_is_frozen_to_the_bit() {
    let scene = dome(24);
    let views = targets(&scene, &[-30.0, 0.0]);
    let mut options = short();
    options.rates.rotation = 0.0;
    options.rates.opacity = 0.0;
    let refined = run(&scene, &views, &options);
    assert_eq!(refined.scene.rotations, scene.rotations);
    assert_eq!(refined.scene.opacity_logits, scene.opacity_logits);
    assert_ne!(refined.scene.centers, scene.centers);
    let nothing = RefineOptions {
        rates: options.rates.scaled(0.0),
        ..short()
    };
    let untouched = run(&scene, &views, &nothing);
    assert_eq!((untouched.scene, untouched.curve.len()), (scene, 1));
}

#[test]
fn targets_that_contradict_each_other_end_in_a_compromise() {
    let scene = dome(32);
    let mut views = targets(&scene, &[0.0]);
    let mut black = views.views[0].clone();
    black.rgb.data_mut().fill([0.0; 3]);
    black.name = "black".into();
    let white = View {
        rgb: Rgb::filled(32, 32, [1.0; 3]),
        name: "white".into(),
        ..black.clone()
    };
    views.views = vec![black, white];
    for color_solver in [ColorSolver::Adam, ColorSolver::ConjugateGradients] {
        let options = RefineOptions {
            color_solver,
            ..short()
        };
        let refined = run(&scene, &views, &options);
        assert_eq!(refined.scene.count_invalid(), 0);
        let least = refined.curve.iter().map(|p| p.loss).fold(f64::INFINITY, f64::min);
        assert!(least <= refined.curve[0].loss && least.is_finite(), "{color_solver:?}");
    }
}
