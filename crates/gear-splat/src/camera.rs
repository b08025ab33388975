//! Orthographic and pinhole cameras.

use glam::{Mat3, Vec3};
use serde::{Deserialize, Serialize};

/// How camera space is brought to pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Projection {
    /// Parallel rays: `u = cx + x · pixels_per_unit`, `v = cy + y · pixels_per_unit`.
    Orthographic {
        /// Pixels a world unit spans.
        pixels_per_unit: f32,
    },
    /// Rays through the camera centre: `u = cx + focal_px · x / z`, `v = cy + focal_px · y / z`.
    Pinhole {
        /// Focal length in pixels.
        focal_px: f32,
    },
}

/// A camera: a rigid world-to-camera motion (`p_cam = rotation · p_world + translation`) and a projection.
///
/// Camera space has x right, y down, z forward. Pixel centres have integer coordinates: pixel (0, 0) covers
/// [−½, ½)², so a picture W wide that is centred has `cx = (W − 1) / 2`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// World to camera.
    pub rotation: Mat3,
    /// World to camera, world units.
    pub translation: Vec3,
    /// Projection to pixels.
    pub projection: Projection,
    /// Principal point (cx, cy) in pixels.
    pub principal: [f32; 2],
    /// Picture width in pixels.
    pub width: u32,
    /// Picture height in pixels.
    pub height: u32,
}
