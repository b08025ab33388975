//! Measures of a finished scene.

pub mod fidelity;
pub mod niqe;
pub mod surfels;
pub mod vend;
