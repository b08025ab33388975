//! Prints medians of forward and forward + backward times: `cargo bench -p gear-splat`.
//!
//! `surfels`: a relief of 1–2 px discs at 768² as `Reconstruct` makes it. `random`: centres in the unit ball, scales
//! log-uniform 0.002–0.02, opacities 0.05–0.95, seen from distance 2.5 with a field of view of 40° at 512².

use std::time::Instant;

use gear_splat::cpu::Frame;
use gear_splat::render::{PixelGradients, Wanted};
use gear_splat::{Camera, Gaussian, Outputs, RenderOptions, Scene};
use glam::{Quat, Vec3};

struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    }
}

fn surfels(count: usize, side: u32) -> (Scene, Camera) {
    let mut random = Random(1);
    let mut scene = Scene::default();
    let columns = (count as f32).sqrt() as usize;
    let spacing = 0.9 / columns as f32;
    for j in 0..columns {
        for i in 0..columns {
            let (x, y) = (i as f32 * spacing - 0.45, j as f32 * spacing - 0.45);
            let normal = Vec3::new(0.4 * (9.0 * x).sin_like(), 0.4 * (7.0 * y).sin_like(), 1.0).normalize();
            scene.push(Gaussian {
                center: Vec3::new(x, y, 0.1 * (9.0 * x).sin_like()),
                scales: Vec3::new(0.6, 0.6, 0.15) * spacing,
                rotation: Quat::from_rotation_arc(Vec3::Z, normal),
                opacity: 0.99,
                color: [random.next(), random.next(), random.next()],
            });
        }
    }
    (scene, Camera::front(side, side))
}

/// A smooth wave without the platform's sine.
trait Wave {
    fn sin_like(self) -> f32;
}

impl Wave for f32 {
    fn sin_like(self) -> f32 {
        libm::sin(f64::from(self)) as f32
    }
}

fn random_ball(count: usize) -> (Scene, Camera) {
    let mut random = Random(2);
    let mut scene = Scene::default();
    while scene.len() < count {
        let center = Vec3::new(random.next(), random.next(), random.next()) * 2.0 - 1.0;
        if center.length() > 1.0 {
            continue;
        }
        let mut scale = || (0.002 * libm::pow(10.0, f64::from(random.next()))) as f32;
        let scales = Vec3::new(scale(), scale(), scale());
        let q = Quat::from_xyzw(
            random.next() - 0.5,
            random.next() - 0.5,
            random.next() - 0.5,
            random.next() - 0.5,
        );
        scene.push(Gaussian {
            center,
            scales,
            rotation: q.normalize(),
            opacity: 0.05 + 0.9 * random.next(),
            color: [random.next(), random.next(), random.next()],
        });
    }
    let focal = (256.0 / libm::tan(20f64.to_radians())) as f32;
    (
        scene,
        Camera::look_at(Vec3::Z * 2.5, Vec3::ZERO, Vec3::Y, 512, 512, focal),
    )
}

/// Median wall time of a few runs, ms.
fn median(mut run: impl FnMut()) -> f64 {
    run();
    let mut times: Vec<f64> = (0..9)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn report(name: &str, scene: &Scene, camera: &Camera) {
    let options = RenderOptions::default();
    let pixels = (camera.width * camera.height) as usize;
    let loss = PixelGradients {
        rgb: (0..pixels)
            .map(|i| [(i % 7) as f32 - 3.0, (i % 5) as f32 - 2.0, 0.5])
            .collect(),
        alpha: Vec::new(),
    };
    let rgba = || Frame::new(scene, camera, &options, Outputs::RGBA);
    let frame = rgba();
    let picture = frame.draw();
    let stages = [
        ("prepare", median(|| drop(rgba()))),
        ("draw", median(|| drop(frame.draw()))),
        ("forward", median(|| drop(rgba().draw()))),
        (
            "forward+backward",
            median(|| {
                let frame = rgba();
                drop(frame.backward(scene, &frame.draw(), &loss, Wanted::All));
            }),
        ),
        (
            "colours: draw+backward",
            median(|| drop(frame.backward(scene, &frame.draw(), &loss, Wanted::Color))),
        ),
        (
            "backward",
            median(|| drop(frame.backward(scene, &picture, &loss, Wanted::All))),
        ),
        (
            "everything",
            median(|| drop(Frame::new(scene, camera, &options, Outputs::ALL).draw())),
        ),
    ];
    print!("{name:<14} {:>7} gaussians {:>8} pairs", scene.len(), frame.pairs());
    for (stage, ms) in stages {
        print!("  {stage} {ms:.1}");
    }
    println!("  (ms)");
}

fn main() {
    for count in [30_000, 100_000, 360_000] {
        let (scene, camera) = surfels(count, 768);
        report("surfels 768", &scene, &camera);
    }
    for count in [20_000, 100_000, 400_000] {
        let (scene, camera) = random_ball(count);
        report("random 512", &scene, &camera);
    }
}
