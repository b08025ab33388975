//! From picture to surface: mask, ink, inflation, shading, light fit, detail from shading, creases, layers, surfels.
//!
//! Modules stand in the order in which data passes them:
//!
//! ```text
//! image, mask ─ ink ─ base ─ shading ─ light ─ detail ─ crease or layers ─ height ─ surfels ─ scene
//! ```
//!
//! [`height::estimate`] runs the chain up to the height field; [`surfels::lift`] makes the closed Gaussian
//! scene. [`guided::estimate`] takes the body from what a network says instead of the silhouette. [`light::evidence`] stops after the light fit: how far a picture's shading is already natural.
//!
//! Heights are in pixels, towards the viewer; images have y down, so normals in image space are
//! `(−∂h/∂x, −∂h/∂y, 1)` with y down. Lengths that are parameters are shares of the picture's longer side or of the
//! square root of the mask's area, so that a scan and its thumbnail give the same surface.

pub mod base;
pub mod crease;
pub mod detail;
pub mod fields;
pub mod guided;
pub mod height;
pub mod ink;
pub mod layers;
pub mod light;
pub mod mask;
pub mod shading;
pub mod surfels;
pub mod truth;

/// Version of the numerics: part of the behaviour of every node that uses this crate. Raise it when bits change.
pub const NUMERICS: u32 = 4;
