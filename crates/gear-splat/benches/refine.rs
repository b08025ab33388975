//! Prints what refinement costs at the default working size, and what its views cost to store:
//! `cargo bench -p gear-splat --bench refine`.
//!
//! The scene is a dome of surfels in a 768² picture, as `Reconstruct` makes it; the targets are seven views of it in other
//! colours. Fewer steps than the default are timed, and the time of the default is computed from them.

use std::ops::ControlFlow;
use std::time::Instant;

use gear_graph::Value;
use gear_image::Field;
use gear_splat::refine::{RefineOptions, refine};
use gear_splat::{Camera, Gaussian, RenderOptions, Scene, Views, orbit};
use glam::{Quat, Vec3};

const SIDE: u32 = 768;

/// A dome with one surfel every `step` pixels.
fn dome(step: usize) -> Scene {
    let mut scene = Scene {
        canonical_camera: Some(Camera::front(SIDE, SIDE)),
        ..Scene::default()
    };
    let n = SIDE as f32;
    for j in (0..SIDE).step_by(step) {
        for i in (0..SIDE).step_by(step) {
            let (x, y) = ((i as f32 - 383.5) / n, -(j as f32 - 383.5) / n);
            let rest = 0.16 - x * x - y * y;
            if rest > 0.0 {
                let normal = Vec3::new(x, y, rest.sqrt()) / 0.4;
                let scale = 0.6 * step as f32 / n;
                scene.push(Gaussian {
                    center: Vec3::new(x, y, rest.sqrt()),
                    scales: Vec3::new(scale / normal.z.max(0.15), scale, 0.15 / n),
                    rotation: Quat::from_rotation_arc(Vec3::Z, normal),
                    opacity: 0.99,
                    color: [0.5, 0.5, 0.5],
                });
            }
        }
    }
    scene
}

fn targets(scene: &Scene) -> Views {
    let mut painted = scene.clone();
    for (center, dc) in painted.centers.iter().zip(&mut painted.sh_dc) {
        let wave = libm::sin(f64::from(60.0 * center.x + 20.0 * center.y)) as f32;
        *dc = [wave, 0.5 - wave, center.y];
    }
    let yaws = [-90.0, -60.0, -30.0, 0.0, 30.0, 60.0, 90.0];
    let views = orbit::cameras(scene, &yaws, 0)
        .into_iter()
        .zip(yaws)
        .map(|(camera, yaw)| {
            let mut view = orbit::view(&painted, &camera, orbit::yaw_name(yaw), &RenderOptions::default(), true);
            view.weight = view.alpha.clone().map(|alpha| {
                let (width, height) = alpha.size();
                Field::from_vec(width, height, alpha.data().iter().map(|a| a.round()).collect())
            });
            view
        });
    Views { views: views.collect() }
}

fn seconds<T>(run: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let value = run();
    (start.elapsed().as_secs_f64(), value)
}

fn main() {
    let whole = RefineOptions::default();
    for step in [2, 1] {
        let scene = dome(step);
        let (rendering, views) = seconds(|| targets(&scene));
        let short = |color_iterations: usize, iterations: usize| {
            let options = RefineOptions {
                color_iterations,
                iterations,
                check_every: usize::MAX,
                ..whole.clone()
            };
            seconds(|| refine(&scene, &views, &options, &mut |_| ControlFlow::Continue(()))).0
        };
        let (nothing, color, all) = (short(0, 0), short(14, 0), short(0, 14));
        // Without steps: the first look, the last, and setting up. With some: one look more.
        let look = nothing / 2.0;
        let (color, all) = ((color - nothing - look) / 14.0, (all - nothing - look) / 14.0);
        let looks = 2.0 + (whole.color_iterations + whole.iterations) as f64 / whole.check_every as f64;
        let total = color * whole.color_iterations as f64 + all * whole.iterations as f64 + looks * look;
        println!(
            "{:>7} gaussians, 7 views of {SIDE}²: colour step {:.0} ms, full step {:.0} ms, look {:.0} ms; default run {total:.0} s",
            scene.len(),
            color * 1e3,
            all * 1e3,
            look * 1e3
        );
        let (encoding, bytes) = seconds(|| views.encode().expect("views encode"));
        let (decoding, _) = seconds(|| Views::decode(&bytes).expect("views decode"));
        let (hashing, _) = seconds(|| views.digest());
        println!(
            "        views: render {rendering:.2} s, encode {encoding:.2} s ({} MB), decode {decoding:.2} s, digest {hashing:.2} s",
            bytes.len() / 1_000_000
        );
    }
}
