use std::sync::atomic::AtomicBool;
use std::time::Duration;

use gear_graph::{Value as _, testing};
use gear_image::Field;
use gear_splat::{Camera, Gaussian, RenderOptions, orbit};
use glam::{Quat, Vec3};

use super::*;

/// A tilted board of grey surfels and targets that are striped.
fn board() -> (Arc<Scene>, Arc<Views>) {
    let mut scene = Scene {
        canonical_camera: Some(Camera::front(32, 32)),
        ..Scene::default()
    };
    let tilt = Quat::from_rotation_arc(Vec3::Z, Vec3::new(0.3, 0.0, 1.0).normalize());
    for j in 3..29 {
        for i in 3..29 {
            let (x, y) = ((i as f32 - 15.5) / 32.0, -(j as f32 - 15.5) / 32.0);
            scene.push(Gaussian {
                center: Vec3::new(x, y, -0.3 * x),
                scales: Vec3::new(0.6, 0.6, 0.15) / 32.0,
                rotation: tilt,
                opacity: 0.99,
                color: [0.5, 0.5, 0.5],
            });
        }
    }
    let mut striped = scene.clone();
    for (center, dc) in striped.centers.iter().zip(&mut striped.sh_dc) {
        *dc = if (center.y * 32.0).rem_euclid(8.0) < 4.0 {
            [0.8, -0.4, -1.0]
        } else {
            [-0.9, 0.3, 0.9]
        };
    }
    let yaws = [-30.0, 0.0, 30.0];
    let views = orbit::cameras(&scene, &yaws, 0)
        .into_iter()
        .zip(yaws)
        .map(|(camera, yaw)| {
            let mut view = orbit::view(&striped, &camera, orbit::yaw_name(yaw), &RenderOptions::default(), true);
            let alpha = view.alpha.as_ref().unwrap();
            let inside = alpha.data().iter().map(|&a| f32::from(u8::from(a > 0.5))).collect();
            view.weight = Some(Field::from_vec(alpha.width(), alpha.height(), inside));
            view
        });
    (Arc::new(scene), Arc::new(Views { views: views.collect() }))
}

fn short() -> Refine {
    Refine {
        color_iterations: 30,
        iterations: 30,
        check_every: 10,
        ..Refine::default()
    }
}

#[test]
fn the_scene_takes_on_the_colours_of_the_targets() {
    let (scene, targets) = board();
    let out = testing::run(&short(), In { scene, targets }).unwrap();
    let report = out.curve.unwrap();
    let report = &report.0;
    for view in report["fidelity"].as_array().unwrap() {
        let [before, after] = ["psnr_before", "psnr_after"].map(|key| view[key].as_f64().unwrap());
        assert!(after > before + 10.0, "{view}");
    }
    let first = &report["curve"][0]["loss"];
    assert!(
        report["curve"]
            .as_array()
            .unwrap()
            .iter()
            .all(|p| p["loss"].as_f64() <= first.as_f64())
    );
}

#[test]
fn a_huge_anchor_returns_the_scene() {
    let (scene, targets) = board();
    let node = Refine {
        anchor: 1e30,
        ..short()
    };
    let out = testing::run(
        &node,
        In {
            scene: Arc::clone(&scene),
            targets,
        },
    )
    .unwrap();
    let refined = out.scene.unwrap();
    assert!(
        refined
            .centers
            .iter()
            .zip(&scene.centers)
            .all(|(a, b)| (*a - *b).length() < 1e-6)
    );
    assert!(
        refined
            .sh_dc
            .iter()
            .flatten()
            .zip(scene.sh_dc.iter().flatten())
            .all(|(a, b)| (a - b).abs() < 1e-5)
    );
}

#[test]
fn an_interrupted_run_is_cancelled() {
    let (scene, targets) = board();
    let ctx = Context::new(Arc::new(AtomicBool::new(true)), None, 0);
    let result = Refine::default().run(In { scene, targets }, &Want::all::<Out>(), &ctx);
    assert!(matches!(result, Err(NodeError::Cancelled)));
}

/// Keeps the state of an action in memory.
#[derive(Default)]
struct InMemory(std::sync::Mutex<Option<Vec<u8>>>);

impl gear_graph::Unfinished for InMemory {
    fn last(&self) -> Option<Vec<u8>> {
        self.0.lock().unwrap().clone()
    }

    fn keep(&self, state: &[u8]) {
        *self.0.lock().unwrap() = Some(state.to_vec());
    }

    fn forget(&self) {
        *self.0.lock().unwrap() = None;
    }
}

#[test]
fn an_interrupted_refinement_goes_on_where_it_was() {
    let (scene, targets) = board();
    let inputs = || In {
        scene: Arc::clone(&scene),
        targets: Arc::clone(&targets),
    };
    let node = Refine {
        tolerance: 0.0,
        ..short()
    };
    let whole = testing::run(&node, inputs()).unwrap().scene.unwrap();
    let place = Arc::new(InMemory::default());
    // Interrupts itself after two thirds of the steps.
    let stop = Arc::new(AtomicBool::new(false));
    let steps = Arc::new(std::sync::atomic::AtomicUsize::new(0));
    let context = |limit: usize| {
        let (flag, steps) = (Arc::clone(&stop), Arc::clone(&steps));
        let listener = Arc::new(move |_: gear_graph::Progress| {
            let done = 1 + steps.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            flag.store(done >= limit, std::sync::atomic::Ordering::Relaxed);
        });
        Context::new(Arc::clone(&stop), Some(listener), 0).with_unfinished(Arc::clone(&place) as _, Duration::ZERO)
    };
    let first = node.run(inputs(), &Want::all::<Out>(), &context(45));
    assert!(matches!(first, Err(NodeError::Cancelled)));
    stop.store(false, std::sync::atomic::Ordering::Relaxed);
    let taken = steps.swap(0, std::sync::atomic::Ordering::Relaxed);
    let resumed = node.run(inputs(), &Want::all::<Out>(), &context(usize::MAX)).unwrap();
    let rest = steps.load(std::sync::atomic::Ordering::Relaxed);
    // No step is done twice.
    assert_eq!((taken, rest), (45, 15));
    assert_eq!(resumed.scene.unwrap(), whole);
}

#[test]
fn every_extreme_scene_and_target_gives_a_finite_scene_or_a_clear_error() {
    let (board_scene, board_targets) = board();
    let node = Refine {
        color_iterations: 3,
        iterations: 3,
        check_every: 2,
        ..Refine::default()
    };
    for (name, scene) in Scene::extremes() {
        let out = testing::run(
            &node,
            In {
                scene: Arc::new(scene),
                targets: Arc::clone(&board_targets),
            },
        );
        let refined = out.unwrap_or_else(|e| panic!("{name}: {e}")).scene.unwrap();
        assert_eq!(refined.count_invalid(), 0, "{name}");
    }
    for (name, targets) in Views::extremes() {
        let out = testing::run(
            &node,
            In {
                scene: Arc::clone(&board_scene),
                targets: Arc::new(targets),
            },
        );
        let refined = out.unwrap_or_else(|e| panic!("{name}: {e}")).scene.unwrap();
        assert_eq!(refined.count_invalid(), 0, "{name}");
    }
}

#[test]
fn an_answer_or_an_error_on_every_extreme_input() {
    testing::assert_extremes(&Refine {
        color_iterations: 4,
        iterations: 8,
        ..Refine::default()
    });
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let (scene, targets) = board();
    let node = Refine {
        color_iterations: 6,
        iterations: 6,
        check_every: 3,
        ..Refine::default()
    };
    testing::assert_pure(&node, || In {
        scene: Arc::clone(&scene),
        targets: Arc::clone(&targets),
    });
}

#[test]
fn the_numbers_of_a_board_stay_as_they_are() {
    let (scene, targets) = board();
    let out = testing::run(&short(), In { scene, targets }).unwrap();
    insta::assert_json_snapshot!(out.scene.unwrap().summary());
}
