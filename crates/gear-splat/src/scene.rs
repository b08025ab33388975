//! A scene: Gaussians as structure of arrays, and the camera under which it shows its painting.

use glam::{Quat, Vec3};

use crate::Camera;

/// 3D Gaussians in the parametrisation of 3DGS.
///
/// All vectors have the same length, one entry a Gaussian. World: x right, y up, z towards the viewer.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Centres, world units.
    pub centers: Vec<Vec3>,
    /// Natural logarithms of the three standard deviations, world units.
    pub log_scales: Vec<Vec3>,
    /// Unit quaternions that turn the Gaussian's own axes into the world's. For surfels the third own axis,
    /// the thinnest, is the outward normal.
    pub rotations: Vec<Quat>,
    /// Logits of the opacities.
    pub opacity_logits: Vec<f32>,
    /// SH coefficients of degree 0 (`f_dc`): sRGB-encoded colour is `0.5 + 0.28209479 · f_dc`.
    pub sh_dc: Vec<[f32; 3]>,
    /// Higher SH coefficients, channel-major as in 3DGS PLY (`f_rest`): `3 · ((degree + 1)² − 1)` a Gaussian, flat.
    pub sh_rest: Vec<f32>,
    /// SH degree of `sh_rest`, 0 to 3.
    pub sh_degree: u8,
    /// The camera under which the scene shows the painting.
    pub canonical_camera: Option<Camera>,
}
