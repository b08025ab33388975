//! What refinement promises, on small domes.

use gear_image::{Field, Rgb, Srgb};
use glam::{Quat, Vec3};

use super::*;
use crate::{Camera, Gaussian, View, orbit};

mod colors;
mod counts;
mod limits;
mod states;

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
fn one_view_is_enough() {
    let scene = dome(32);
    let refined = run(&scene, &targets(&scene, &[30.0]), &short());
    let [view] = refined.fidelity.as_slice() else {
        panic!("{:?}", refined.fidelity)
    };
    assert!(view.after > view.before + 3.0, "{view:?}");
}
