//! 3D Gaussian scenes: cameras, differentiable rasteriser, optimiser, file formats.
//!
//! World: x right, y up, z towards the viewer of the canonical camera. A painting's longer side spans 1 world unit.
//! Camera space: x right, y down, z forward (depth grows away from the camera).

mod bounds;
mod camera;
pub mod cpu;
pub mod formats;
pub mod orbit;
pub mod reference;
pub mod refine;
pub mod render;
mod scene;
pub mod sh;
mod values;
mod views;

pub use bounds::Bounds;
pub use camera::{Camera, FRONT_DISTANCE, Projected, Projection, Ray};
pub use render::{Outputs, RenderOptions, Rendering, ScreenFilter, render};
pub use scene::{Gaussian, Scene, SceneError, logit, sigmoid};
pub use views::{View, Views};
