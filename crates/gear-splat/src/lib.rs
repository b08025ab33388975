//! 3D Gaussian scenes: cameras, differentiable rasteriser, optimiser, file formats.
//!
//! World: x right, y up, z towards the viewer of the canonical camera. A painting's longer side spans 1 world unit.
//! Camera space: x right, y down, z forward (depth grows away from the camera).

mod camera;
mod scene;
mod views;

pub use camera::{Camera, Projection};
pub use scene::Scene;
pub use views::{View, Views};
