//! The catalogue of shapes with known character: height fields lifted to closed surfels, and degenerate clouds.

use gear_image::{Field, Mask, filter};
use gear_splat::{Camera, Gaussian, Scene};
use glam::{Quat, Vec3};

pub const SIDE: usize = 192;

/// A height in pixels over a mask.
#[derive(Clone)]
pub struct Relief {
    pub height: Vec<f64>,
    pub mask: Vec<bool>,
}

fn relief(f: impl Fn(f64, f64) -> Option<f64>) -> Relief {
    let samples: Vec<Option<f64>> = (0..SIDE * SIDE)
        .map(|i| f((i % SIDE) as f64, (i / SIDE) as f64))
        .collect();
    Relief {
        height: samples.iter().map(|h| h.unwrap_or(0.0)).collect(),
        mask: samples.iter().map(Option::is_some).collect(),
    }
}

/// Half an ellipsoid at (cx, cy) with half axes a, b and height d; `None` beside it.
fn dome(x: f64, y: f64, [cx, cy, a, b, d]: [f64; 5]) -> Option<f64> {
    let q = 1.0 - (x - cx) * (x - cx) / (a * a) - (y - cy) * (y - cy) / (b * b);
    (q > 0.0).then(|| d * q.sqrt())
}

impl Relief {
    pub fn map(mut self, f: impl Fn(f64, f64, f64) -> f64) -> Self {
        for (i, h) in self.height.iter_mut().enumerate() {
            *h = f(*h, (i % SIDE) as f64, (i / SIDE) as f64);
        }
        self
    }

    pub fn smoothed(mut self, sigma: f64) -> Self {
        let field = Field::from_vec(SIDE, SIDE, self.height.iter().map(|&h| h as f32).collect());
        let soft = filter::gaussian(&field, sigma);
        for ((h, s), m) in self.height.iter_mut().zip(soft.data()).zip(&self.mask) {
            *h = if *m { f64::from(*s) } else { 0.0 };
        }
        self
    }

    /// Double-sided surfels, one a pixel, with walls where the rim is high; `back` scales the mirrored side.
    pub fn scene(&self, back: f64) -> Scene {
        let px = 1.0 / SIDE as f64;
        let at = |x: isize, y: isize| self.height[y as usize * SIDE + x as usize];
        let inside = |x: isize, y: isize| {
            let n = SIDE as isize;
            x >= 0 && y >= 0 && x < n && y < n && self.mask[y as usize * SIDE + x as usize]
        };
        let mask = Mask::from_vec(SIDE, SIDE, self.mask.clone());
        let soft = filter::gaussian(&mask.to_field(), 1.5);
        let slope = |f: &dyn Fn(isize, isize) -> f64, x: isize, y: isize| {
            let along = |i: isize, g: &dyn Fn(isize) -> f64| {
                let (low, high) = ((i - 1).max(0), (i + 1).min(SIDE as isize - 1));
                (g(high) - g(low)) / (high - low) as f64
            };
            (along(x, &|i| f(i, y)), along(y, &|j| f(x, j)))
        };
        let (mut scene, mut lowest, mut highest) = (Scene::default(), f64::INFINITY, f64::NEG_INFINITY);
        let mut push = |p: [f64; 3], n: Vec3, stretch: f32| {
            lowest = lowest.min(p[2]);
            highest = highest.max(p[2]);
            let n = n.normalize();
            let downhill = Vec3::new(-n.x * n.z, -n.y * n.z, n.x * n.x + n.y * n.y).normalize_or(Vec3::X);
            let frame = glam::Mat3::from_cols(downhill, n.cross(downhill), n);
            scene.push(Gaussian {
                center: Vec3::new(p[0] as f32, p[1] as f32, p[2] as f32),
                scales: Vec3::new(0.6 * stretch, 0.6, 0.15) * px as f32,
                rotation: Quat::from_mat3(&frame),
                opacity: 0.99,
                color: [0.6; 3],
            });
        };
        for i in (0..SIDE * SIDE).filter(|&i| self.mask[i]) {
            let (x, y) = ((i % SIDE) as isize, (i / SIDE) as isize);
            let (gx, gy) = slope(&at, x, y);
            let n = Vec3::new(-gx as f32, gy as f32, 1.0).normalize();
            let stretch = 1.0 / n.z.max(0.15);
            let place = |z: f64| [(x as f64 - 95.5) * px, -(y as f64 - 95.5) * px, z];
            let (top, bottom) = (self.height[i] * px, -back * self.height[i] * px);
            push(place(top), n, stretch);
            push(
                place(bottom),
                Vec3::new(n.x, n.y, -n.z / (back.max(1e-3) as f32)),
                stretch,
            );
            let rim = [(1, 0), (-1, 0), (0, 1), (0, -1)]
                .iter()
                .any(|(dx, dy)| !inside(x + dx, y + dy));
            let steps = ((top - bottom) / px).ceil();
            if rim && steps >= 2.0 {
                let (ox, oy) = slope(&|x, y| f64::from(soft.at(x as usize, y as usize)), x, y);
                let out = Vec3::new(-ox as f32, oy as f32, 0.0).normalize_or(Vec3::X);
                for k in 1..steps as usize {
                    push(place(bottom + (top - bottom) * k as f64 / steps), out, 1.0);
                }
            }
        }
        let shift = (-0.5 * (lowest + highest)) as f32;
        for center in &mut scene.centers {
            center.z += shift;
        }
        scene.canonical_camera = Some(Camera::front(SIDE as u32, SIDE as u32));
        scene
    }
}

pub fn sphere() -> Relief {
    relief(|x, y| dome(x, y, [96.0, 96.0, 70.0, 70.0, 70.0]))
}

pub fn torus() -> Relief {
    relief(|x, y| {
        let r = ((x - 96.0) * (x - 96.0) + (y - 96.0) * (y - 96.0)).sqrt() - 50.0;
        let q = 28.0 * 28.0 - r * r;
        (q > 0.0).then(|| q.sqrt())
    })
}

/// Head with bun, nose and eyes on neck and shoulders.
pub fn bust() -> Relief {
    let parts = [
        [96.0, 70.0, 34.0, 42.0, 36.0],
        [96.0, 30.0, 20.0, 16.0, 18.0],
        [96.0, 120.0, 16.0, 30.0, 20.0],
        [96.0, 178.0, 74.0, 52.0, 40.0],
    ];
    relief(|x, y| {
        let body = parts.iter().filter_map(|&p| dome(x, y, p)).reduce(f64::max)?;
        let part = |p| dome(x, y, p).unwrap_or(0.0);
        let nose = part([96.0, 76.0, 7.0, 15.0, 12.0]);
        let eyes = part([82.0, 62.0, 7.0, 5.0, 5.0]) + part([110.0, 62.0, 7.0, 5.0, 5.0]);
        Some((body + nose - eyes).max(0.0))
    })
    .smoothed(1.0)
}

/// A body in pleated cloth.
pub fn folds() -> Relief {
    relief(|x, y| {
        let body = dome(x, y, [96.0, 96.0, 76.0, 84.0, 45.0])?;
        let pleats = 6.0 * libm::sin((x + 12.0 * libm::sin(y / 30.0)) / 5.5);
        Some(body + pleats * (body / 30.0).clamp(0.0, 1.0))
    })
}

/// A panel with three shallow bosses.
pub fn panel() -> Relief {
    let bosses = [
        [70.0, 80.0, 34.0, 34.0, 14.0],
        [124.0, 70.0, 22.0, 36.0, 12.0],
        [100.0, 134.0, 46.0, 22.0, 14.0],
    ];
    relief(|x, y| {
        let inside = (x - 96.0).abs() < 80.0 && (y - 96.0).abs() < 80.0;
        inside.then(|| {
            bosses
                .iter()
                .filter_map(|&b| dome(x, y, b))
                .fold(5.0, |h: f64, d| h.max(5.0 + d))
        })
    })
    .smoothed(0.8)
}

pub fn slab() -> Relief {
    relief(|_, _| Some(1.0))
}

/// One sheet of surfels that look at the painter.
pub fn plane() -> Scene {
    let mut scene = Scene::default();
    for i in 0..SIDE * SIDE {
        let (x, y) = ((i % SIDE) as f32, (i / SIDE) as f32);
        scene.push(surfel(Vec3::new(x - 96.0, 96.0 - y, 0.0) / SIDE as f32, Vec3::Z));
    }
    scene
}

/// Centres all over a ball's worth of a normal distribution, normals everywhere, nearly isotropic.
pub fn noise() -> Scene {
    let mut state = 12345u64;
    let mut uniform = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1u64 << 24) as f32
    };
    let mut normal = || Vec3::from_array(std::array::from_fn(|_| (0..12).map(|_| uniform()).sum::<f32>() - 6.0));
    let mut scene = Scene::default();
    for _ in 0..20_000 {
        let mut gaussian = surfel(normal() * 0.2, normal().normalize_or(Vec3::Z));
        gaussian.scales = Vec3::splat(0.004);
        scene.push(gaussian);
    }
    scene
}

fn surfel(center: Vec3, normal: Vec3) -> Gaussian {
    Gaussian {
        center,
        scales: Vec3::new(0.6, 0.6, 0.06) / SIDE as f32,
        rotation: Quat::from_rotation_arc(Vec3::Z, normal),
        opacity: 0.99,
        color: [0.5; 3],
    }
}
