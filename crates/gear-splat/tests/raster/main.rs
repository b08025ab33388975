//! The fast rasteriser against the f64 reference: pictures, gradients, adversarial scenes, determinism.

#![allow(clippy::unwrap_used, reason = "helpers of tests, outside `#[test]` functions")]

mod agreement;
mod determinism;
mod extreme_gradients;
mod extremes;
#[cfg(feature = "gpu")]
mod gpu;
mod gradients;
mod scenes;
