//! What refinement promises, on small domes.

use gear_image::{Field, Rgb, Srgb};
use glam::{Quat, Vec3};

use super::*;
use crate::cpu::Frame;
use crate::{Camera, Gaussian, View, orbit};

/// A front half of a ball, one surfel a pixel of a `side`² picture, all grey.
fn dome(side: u32) -> Scene {
    let mut scene = Scene {
        canonical_camera: Some(Camera::front(side, side)),
        ..Scene::default()
    };
    let n = side as f32;
    for j in 0..side {
        for i in 0..side {
            let (x, y) = ((i as f32 - (n - 1.0) / 2.0) / n, -(j as f32 - (n - 1.0) / 2.0) / n);
            let rest = 0.16 - x * x - y * y;
            if rest > 0.0 {
                let z = rest.sqrt();
                let normal = Vec3::new(x, y, z) / 0.4;
                scene.push(Gaussian {
                    center: Vec3::new(x, y, z),
                    scales: Vec3::new(0.6 / normal.z.max(0.15), 0.6, 0.15) / n,
                    rotation: Quat::from_rotation_arc(Vec3::Z, normal),
                    opacity: 0.99,
                    color: [0.5, 0.45, 0.4],
                });
            }
        }
    }
    scene
}

/// Paint: flat areas with contours, a gradient and some grain; what a painting asks of a pixel.
fn paint(x: f32, y: f32, grain: f32) -> [f32; 3] {
    let stripe = if libm::sin(f64::from(24.0 * x + 9.0 * y)) > 0.3 {
        0.75
    } else {
        0.35
    };
    let outline = if (x * x + y * y).sqrt() % 0.13 < 0.008 {
        0.3
    } else {
        1.0
    };
    [
        stripe * outline + grain,
        (0.5 + 0.6 * y) * outline + grain,
        (0.6 - 0.5 * x) * outline + grain,
    ]
    .map(|c: f32| c.clamp(0.02, 0.98))
}

/// The painting: what the canonical camera is to see, with grain that no smooth blend of neighbours has.
fn painting(side: usize) -> Rgb<Srgb> {
    let n = side as f32;
    Rgb::from_fn(side, side, |i, j| {
        let grain = (((i * 7919 + j * 104_729) % 97) as f32 / 96.0 - 0.5) * 0.06;
        paint(
            (i as f32 - (n - 1.0) / 2.0) / n,
            -(j as f32 - (n - 1.0) / 2.0) / n,
            grain,
        )
    })
}

fn bilinear(image: &Rgb<Srgb>, u: f32, v: f32) -> [f32; 3] {
    let (x, y) = (u.floor(), v.floor());
    let (a, b) = (u - x, v - y);
    let at = |dx: isize, dy: isize| image.at_clamped(x as isize + dx, y as isize + dy);
    std::array::from_fn(|c| {
        let row = |dy| (1.0 - a) * at(0, dy)[c] + a * at(1, dy)[c];
        (1.0 - b) * row(0) + b * row(1)
    })
}

/// Targets as `Edit` makes them: the painting itself from the front, and from the sides what of it reaches there,
/// trusted where the surface faces the painting.
fn targets(scene: &Scene, yaws: &[f64]) -> Views {
    let front = scene.canonical_camera.unwrap();
    let painting = painting(front.width as usize);
    let cameras = orbit::cameras(scene, yaws, 0);
    let views = cameras.iter().zip(yaws).map(|(camera, &yaw)| {
        let options = RenderOptions::default();
        let mut view = orbit::view(scene, camera, orbit::yaw_name(yaw), &options, true);
        let (width, height) = view.rgb.size();
        let (alpha, depth) = (view.alpha.as_ref().unwrap(), view.depth.as_ref().unwrap());
        let normal = view.normal.as_ref().unwrap();
        let mut weight = Field::filled(width, height, 0.0);
        for v in 0..height {
            for u in 0..width {
                if alpha.at(u, v) <= 0.5 {
                    continue;
                }
                let point = camera.unproject(u as f32, v as f32, depth.at(u, v));
                let [x, y] = front.project(point).unwrap().pixel;
                let facing = ((normal[v * width + u][2] - 0.2) / 0.25).clamp(0.0, 1.0);
                let at_front = yaw == 0.0;
                weight.set(u, v, if at_front { 1.0 } else { facing });
                view.rgb.set(
                    u,
                    v,
                    if at_front {
                        painting.at(u, v)
                    } else {
                        bilinear(&painting, x, y)
                    },
                );
            }
        }
        view.weight = Some(weight);
        view
    });
    Views { views: views.collect() }
}

fn run(scene: &Scene, targets: &Views, options: &RefineOptions) -> Refined {
    refine(scene, targets, options, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// Mean distance of the front's depths from the ball's, pixels.
fn depth_error(scene: &Scene) -> f64 {
    let camera = scene.canonical_camera.unwrap();
    let view = orbit::view(scene, &camera, String::new(), &RenderOptions::default(), true);
    let depth = view.depth.unwrap();
    let (mut total, mut count) = (0.0, 0.0);
    for v in 0..camera.height {
        for u in 0..camera.width {
            let ray = camera.ray(u as f32, v as f32);
            let rest = 0.15 - ray.origin.x * ray.origin.x - ray.origin.y * ray.origin.y;
            if rest > 0.0 {
                let truth = crate::FRONT_DISTANCE - (rest + 0.01).sqrt();
                let off = depth.at(u as usize, v as usize) - truth;
                total += f64::from((off * camera.width as f32).abs());
                count += 1.0;
            }
        }
    }
    total / count
}

#[test]
fn the_front_reaches_thirty_decibels_and_the_geometry_stays() {
    let scene = dome(96);
    let yaws = [-90.0, -60.0, -30.0, 0.0, 30.0, 60.0, 90.0];
    let refined = run(&scene, &targets(&scene, &yaws), &RefineOptions::default());
    let front = refined.fidelity[3];
    assert!(front.before < 18.0, "{front:?}");
    assert!(front.after >= 30.0, "{:?}", refined.fidelity);
    for view in &refined.fidelity {
        assert!(view.after > view.before + 4.0, "{view:?}");
    }
    assert!(refined.curve.last().unwrap().loss < 0.3 * refined.curve[0].loss);
    let (before, after) = (depth_error(&scene), depth_error(&refined.scene));
    assert!(
        after < before + 0.3,
        "depth error, pixels: {before} before, {after} after"
    );
}

#[test]
fn the_best_scene_comes_back_and_its_loss_is_on_the_curve() {
    let scene = dome(32);
    let views = targets(&scene, &[-30.0, 0.0, 30.0]);
    // Steps far too large: the loss rises again.
    let mut options = RefineOptions {
        iterations: 60,
        color_iterations: 20,
        check_every: 5,
        ..RefineOptions::default()
    };
    options.rates.center = 8.0;
    options.anchor = 0.0;
    let refined = run(&scene, &views, &options);
    let least = refined.curve.iter().map(|p| p.loss).fold(f64::INFINITY, f64::min);
    let best = refined
        .curve
        .iter()
        .find(|p| p.iteration == refined.best_iteration)
        .unwrap();
    assert_eq!(best.loss, least);
    assert!(refined.curve.last().unwrap().loss > least);
}

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
fn colours_alone_leave_the_geometry_to_the_bit() {
    let scene = dome(24);
    let options = RefineOptions {
        iterations: 0,
        color_iterations: 20,
        ..RefineOptions::default()
    };
    let refined = run(&scene, &targets(&scene, &[0.0, 30.0]), &options);
    assert_eq!(refined.scene.centers, scene.centers);
    assert_eq!(refined.scene.log_scales, scene.log_scales);
    assert_eq!(refined.scene.rotations, scene.rotations);
    assert_ne!(refined.scene.sh_dc, scene.sh_dc);
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
fn an_observer_can_break_off() {
    let scene = dome(8);
    let views = targets(&scene, &[0.0]);
    let mut calls = 0;
    let stopped = refine(&scene, &views, &RefineOptions::default(), &mut |_| {
        calls += 1;
        if calls == 3 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    assert_eq!((stopped.unwrap_err(), calls), (RefineError::Interrupted, 3));
}

/// Few steps, everything moves.
fn short() -> RefineOptions {
    RefineOptions {
        color_iterations: 10,
        iterations: 20,
        check_every: 5,
        tolerance: 0.0,
        ..RefineOptions::default()
    }
}

#[test]
fn adam_comes_close_to_the_colours_that_conjugate_gradients_find() {
    let scene = dome(32);
    let views = targets(&scene, &[-40.0, 0.0, 40.0]);
    let least = |color_solver: ColorSolver, color_iterations: usize| {
        let options = RefineOptions {
            color_solver,
            color_iterations,
            iterations: 0,
            tolerance: 0.0,
            ..RefineOptions::default()
        };
        let refined = run(&scene, &views, &options);
        refined.curve.iter().map(|p| p.loss).fold(f64::INFINITY, f64::min)
    };
    let minimum = least(ColorSolver::ConjugateGradients, 150);
    // It is one: twice as many steps change nothing.
    let longer = least(ColorSolver::ConjugateGradients, 300);
    assert!(longer > 0.998 * minimum, "{longer} after {minimum}");
    // The default number of steps only prepares for those in which everything moves; from grey it ends a third above.
    for (steps, above) in [(30, 1.4), (300, 1.05)] {
        let adam = least(ColorSolver::Adam, steps);
        assert!(adam >= 0.999 * minimum, "{adam} is below the minimum {minimum}");
        assert!(
            adam < above * minimum,
            "Adam's {steps} steps: {adam}, minimum {minimum}"
        );
    }
}

#[test]
fn conjugate_gradients_leave_the_shapes_and_hold_colours_between_black_and_white() {
    let scene = dome(24);
    let options = RefineOptions {
        color_solver: ColorSolver::ConjugateGradients,
        color_iterations: 60,
        iterations: 0,
        ..RefineOptions::default()
    };
    let refined = run(&scene, &targets(&scene, &[0.0, 30.0]), &options);
    assert_eq!(refined.scene.centers, scene.centers);
    assert_eq!(refined.scene.log_scales, scene.log_scales);
    assert!(refined.curve.windows(2).all(|pair| pair[1].loss < pair[0].loss));
    for i in 0..scene.len() {
        assert!(refined.scene.color(i).iter().all(|c| (-1e-6..=1.0 + 1e-6).contains(c)));
    }
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

#[test]
fn one_view_is_enough() {
    let scene = dome(32);
    let refined = run(&scene, &targets(&scene, &[30.0]), &short());
    let [view] = refined.fidelity.as_slice() else {
        panic!("{:?}", refined.fidelity)
    };
    assert!(view.after > view.before + 3.0, "{view:?}");
}

/// A place for states that keeps them all.
#[derive(Default)]
struct Kept {
    last: Option<Vec<u8>>,
    states: Vec<Vec<u8>>,
}

impl Checkpoints for Kept {
    fn last(&mut self) -> Option<Vec<u8>> {
        self.last.clone()
    }

    fn keep(&mut self, state: &dyn Fn() -> Vec<u8>) {
        self.states.push(state());
    }
}

#[test]
fn a_run_that_goes_on_from_a_state_ends_with_the_same_bits() {
    let scene = dome(24);
    let views = targets(&scene, &[-30.0, 0.0, 30.0]);
    let dense = RefineOptions {
        densify: Some(Densify {
            every: 6,
            share: 0.05,
            ..Densify::default()
        }),
        ..short()
    };
    let solved = RefineOptions {
        color_solver: ColorSolver::ConjugateGradients,
        color_iterations: 20,
        ..short()
    };
    for options in [short(), dense, solved] {
        let run = |kept: &mut Kept, calls: &mut usize| {
            let device = Device::cpu();
            let mut count = |_| {
                *calls += 1;
                ControlFlow::Continue(())
            };
            refine_resuming(&device, &scene, &views, &options, kept, &mut count).unwrap()
        };
        let (mut kept, mut steps) = (Kept::default(), 0);
        let whole = run(&mut kept, &mut steps);
        assert!(kept.states.len() > 2);
        for state in kept.states {
            let mut from = Kept {
                last: Some(state),
                ..Kept::default()
            };
            let mut fewer = 0;
            let resumed = run(&mut from, &mut fewer);
            assert!(fewer < steps);
            assert_eq!(resumed.scene, whole.scene);
            assert_eq!(
                (resumed.curve, resumed.fidelity),
                (whole.curve.clone(), whole.fidelity.clone())
            );
            assert_eq!(
                (resumed.best_iteration, resumed.born),
                (whole.best_iteration, whole.born)
            );
        }
    }
}

#[test]
fn bytes_that_are_no_state_begin_anew() {
    let scene = dome(16);
    let views = targets(&scene, &[0.0]);
    let mut kept = Kept::default();
    let device = Device::cpu();
    let go = &mut |_| ControlFlow::Continue(());
    let whole = refine_resuming(&device, &scene, &views, &short(), &mut kept, go).unwrap();
    let state = kept.states.pop().unwrap();
    for cut in [0, 7, 100, state.len() / 2, state.len() - 1] {
        let mut from = Kept {
            last: Some(state[..cut].to_vec()),
            ..Kept::default()
        };
        let anew = refine_resuming(&device, &scene, &views, &short(), &mut from, go).unwrap();
        assert_eq!(anew.scene, whole.scene, "{cut}");
    }
}

#[test]
fn densification_adds_gaussians_where_detail_is_missing_and_lowers_the_loss() {
    // Surfels three times as large as pixels.
    let mut coarse = dome(16);
    coarse.canonical_camera = Some(Camera::front(48, 48));
    let views = targets(&coarse, &[-30.0, 0.0, 30.0]);
    let plain = RefineOptions {
        iterations: 60,
        ..short()
    };
    let dense = RefineOptions {
        densify: Some(Densify {
            every: 10,
            until: 0.7,
            share: 0.1,
            most: 250,
        }),
        ..plain.clone()
    };
    let (few, many) = (run(&coarse, &views, &plain), run(&coarse, &views, &dense));
    assert!(many.born > 20 && many.scene.len() <= 250, "{} more", many.born);
    assert_eq!(many.scene.len(), coarse.len() + many.born);
    assert_eq!(many.scene.count_invalid(), 0);
    let least = |refined: &Refined| refined.curve.iter().map(|p| p.loss).fold(f64::INFINITY, f64::min);
    assert!(least(&many) < least(&few), "{} {}", least(&many), least(&few));
}

#[test]
fn a_firmer_generation_moves_less() {
    let scene = dome(24);
    let views = targets(&scene, &[0.0]);
    let moved = |first: f64| {
        let mut options = short();
        options.generations.first = first;
        options.anchor = 1e4;
        let refined = run(&scene, &views, &options).scene;
        let pairs = refined.sh_dc.as_flattened().iter().zip(scene.sh_dc.as_flattened());
        pairs.map(|(a, b)| f64::from((a - b).abs())).sum::<f64>()
    };
    let (loose, firm) = (moved(0.1), moved(10.0));
    assert!(firm < 0.5 * loose, "{firm} {loose}");
}

#[test]
fn what_no_view_sees_is_left_out_and_no_pixel_notices() {
    let front = dome(32);
    let mut whole = front.clone();
    // A wall behind everything that a front view can see.
    for i in 0..front.len() {
        whole.push(Gaussian {
            center: front.centers[i] * Vec3::new(0.5, 0.5, 0.0) - Vec3::Z * 0.2,
            scales: Vec3::splat(0.01),
            rotation: Quat::IDENTITY,
            opacity: 0.9,
            color: [0.1, 0.9, 0.1],
        });
    }
    let views = targets(&whole, &[0.0]);
    let options = RefineOptions {
        iterations: 0,
        color_iterations: 0,
        prune: Prune {
            opacity: 0.0,
            unseen: true,
        },
        ..RefineOptions::default()
    };
    let refined = run(&whole, &views, &options);
    assert!(refined.pruned > front.len() / 2, "{}", refined.pruned);
    assert_eq!(refined.scene.len() + refined.pruned, whole.len());
    let camera = whole.canonical_camera.unwrap();
    let draw = |scene: &Scene| crate::render(scene, &camera, &options.render, DRAWN).rgb.unwrap();
    for (a, b) in draw(&whole).data().iter().zip(draw(&refined.scene).data()) {
        assert!(
            a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1.01 / 255.0),
            "{a:?} {b:?}"
        );
    }
    let faint = RefineOptions {
        prune: Prune {
            opacity: 0.95,
            unseen: false,
        },
        ..options
    };
    assert_eq!(run(&whole, &views, &faint).pruned, front.len());
}
