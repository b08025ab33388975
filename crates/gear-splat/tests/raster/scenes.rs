//! Scenes and cameras for the tests.

use gear_splat::{Camera, Gaussian, Scene};
use glam::{Quat, Vec3};

/// Counter-based random numbers in [0, 1).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    }

    pub fn within(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.next()
    }

    pub fn vec3(&mut self, half: f32) -> Vec3 {
        Vec3::new(
            self.within(-half, half),
            self.within(-half, half),
            self.within(-half, half),
        )
    }

    pub fn rotation(&mut self) -> Quat {
        let q = Quat::from_xyzw(
            self.within(-1.0, 1.0),
            self.within(-1.0, 1.0),
            self.within(-1.0, 1.0),
            self.within(-1.0, 1.0),
        );
        if q.length_squared() > 1e-3 {
            q.normalize()
        } else {
            Quat::IDENTITY
        }
    }
}

/// Gaussians in a cube of side 0.8 with scales between `low` and `high`.
pub fn cloud(count: usize, seed: u64, low: f32, high: f32, sh_degree: u8) -> Scene {
    let mut random = Random(seed);
    let mut scene = Scene {
        sh_degree,
        ..Scene::default()
    };
    for _ in 0..count {
        // Skewed to the small end.
        let scale = |r: &mut Random| low + (high - low) * r.next() * r.next();
        let scales = Vec3::new(scale(&mut random), scale(&mut random), scale(&mut random));
        scene.push(Gaussian {
            center: random.vec3(0.4),
            scales,
            rotation: random.rotation(),
            opacity: random.within(0.05, 0.98),
            color: [random.next(), random.next(), random.next()],
        });
    }
    for x in &mut scene.sh_rest {
        *x = random.within(-0.2, 0.2);
    }
    scene
}

/// One camera of each kind, looking at the origin from the side.
pub fn cameras(width: u32, height: u32) -> [Camera; 2] {
    let parallel = Camera::front(width, height).orbit(Vec3::new(0.05, 0.0, 0.1), 33.0, 14.0);
    let focal = 1.1 * width.max(height) as f32;
    let eye = Vec3::new(0.7, 0.4, 1.1);
    [
        parallel,
        Camera::look_at(eye, Vec3::ZERO, Vec3::Y, width, height, focal),
    ]
}
