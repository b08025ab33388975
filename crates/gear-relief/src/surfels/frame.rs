//! From picture coordinates and heights to world-space Gaussians, along the camera's rays.

use gear_image::Mask;
use gear_splat::Camera;
use glam::{Mat3, Quat, Vec3};

use super::SurfelSettings;
use super::blocks::Block;
use super::walls::{ALONG, Wall};

/// A Gaussian's place and shape; the third own axis is the outward normal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    pub center: Vec3,
    pub rotation: Quat,
    pub scales: Vec3,
}

/// Maps (u, v, height) to the world.
pub(super) struct Lift<'a> {
    camera: &'a Camera,
    /// World units of a pixel at z = 0.
    unit: f32,
    /// Height in pixels that goes to world z = 0.
    middle: f32,
    /// Camera depth of z = 0.
    ground: f32,
}

/// Cosine between surface and view below which a spot is stretched no further.
const GRAZING: f32 = 0.15;

impl<'a> Lift<'a> {
    pub fn new(camera: &'a Camera, mask: &Mask, middle: f32) -> Self {
        Self {
            camera,
            unit: 1.0 / mask.longer_side() as f32,
            middle,
            ground: camera.to_camera(Vec3::ZERO).z,
        }
    }

    /// The world point on the ray of pixel coordinates (u, v) at a height in pixels.
    pub fn point(&self, u: f32, v: f32, height: f32) -> Vec3 {
        let z = (height - self.middle) * self.unit;
        self.camera.unproject(u, v, self.ground - z)
    }

    /// The spot of a block on the plane `[height, slope right, slope down]`, facing the viewer (`side` = 1) or
    /// away from it (−1).
    pub fn block(&self, block: &Block, plane: [f32; 3], side: f32, settings: &SurfelSettings) -> Spot {
        let [u, v] = block.center;
        let [z, p, q] = plane;
        let center = self.point(u, v, z);
        let right = self.point(u + 0.5, v, z + 0.5 * p) - self.point(u - 0.5, v, z - 0.5 * p);
        let down = self.point(u, v + 0.5, z + 0.5 * q) - self.point(u, v - 0.5, z - 0.5 * q);
        // The ellipse { a·right + b·down : a² + b² = 1 }: its axes are those of MᵀM, M = [right down].
        let (a, b, c) = (right.dot(right), right.dot(down), down.dot(down));
        let root = ((a - c) * (a - c) + 4.0 * b * b).sqrt();
        let large = 0.5 * (a + c + root);
        let (s, t) = if a >= c { (large - c, b) } else { (b, large - a) };
        let direction = right * s + down * t;
        let axis = direction.normalize_or(right.normalize_or(Vec3::X));
        let normal = down.cross(right).normalize_or(Vec3::Z) * side;
        let long = large.sqrt();
        let short = (0.5 * (a + c - root)).max(0.0).sqrt().max(1e-3 * self.unit);
        let cover = if block.size == 1 {
            settings.cover_pixel
        } else {
            settings.cover
        };
        let size = cover * block.size as f32;
        Spot {
            center,
            rotation: rotation(axis, normal),
            scales: Vec3::new(
                size * long.min(short / GRAZING),
                size * short,
                settings.thin * self.unit,
            ),
        }
    }

    /// The spot of a piece of wall.
    pub fn wall(&self, wall: &Wall, settings: &SurfelSettings) -> Spot {
        let [u, v] = wall.pixel;
        let center = self.point(u, v, wall.height);
        let ray = (self.point(u, v, wall.height + 1.0) - center).normalize_or(Vec3::Z);
        let outward = self.point(u + wall.outward[0], v + wall.outward[1], wall.height) - center;
        let normal = (outward - ray * ray.dot(outward)).normalize_or(Vec3::X);
        Spot {
            center,
            rotation: rotation(ray, normal),
            scales: Vec3::new(
                ALONG * wall.extent * self.unit,
                settings.cover * self.unit,
                settings.thin * self.unit,
            ),
        }
    }
}

/// The rotation that takes x to `axis` and z to `normal` (orthonormal).
fn rotation(axis: Vec3, normal: Vec3) -> Quat {
    let axis = (axis - normal * normal.dot(axis)).normalize_or(normal.any_orthonormal_vector());
    Quat::from_mat3(&Mat3::from_cols(axis, normal.cross(axis), normal)).normalize()
}
