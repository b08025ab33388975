#![doc = include_str!("../README.md")]

mod bounds;
mod camera;
pub mod cpu;
pub mod device;
pub mod formats;
#[cfg(feature = "gpu")]
pub mod gpu;
#[cfg(feature = "graph")]
mod loader;
pub mod orbit;
pub mod prune;
pub mod reference;
pub mod refine;
pub mod render;
mod scene;
pub mod sh;
#[cfg(feature = "graph")]
mod values;
mod views;

pub use bounds::Bounds;
pub use camera::{Camera, FRONT_DISTANCE, Projected, Projection, Ray};
pub use device::{Device, DeviceChoice, DeviceError, Fallback};
#[cfg(feature = "graph")]
pub use loader::{SceneFile, register};
pub use render::{Outputs, RenderOptions, Rendering, ScreenFilter, render};
pub use scene::{Gaussian, Scene, SceneError, logit, sigmoid};
pub use views::{View, Views};
