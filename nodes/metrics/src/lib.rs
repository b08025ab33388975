//! Measures of a finished scene.

pub mod ddi;
pub mod fidelity;
pub mod niqe;
pub mod surfels;
pub mod vend;
