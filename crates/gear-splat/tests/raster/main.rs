//! The fast rasteriser against the f64 reference: pictures, gradients, adversarial scenes, determinism.

mod agreement;
mod determinism;
mod extremes;
mod gradients;
mod scenes;
