//! How far a reconstruction is from a surface that is known.
//!
//! | measure | says | range | where |
//! |---|---|---|---|
//! | depth | what the best fit `truth ≈ a·z + b`, a ≥ 0, leaves of the truth's deviation | 0 right … 1 no better than a plane | [`surface`] |
//! | normals | mean angle to the true normal, as they are, and after that fit | 0°… | [`surface`] |
//! | detail | correlation of the heights without what is larger than 4 % of the picture | −1 … 1 | [`surface`] |
//! | silhouette | intersection over union of the masks | 0 … 1 | [`surface`] |
//! | novel views | PSNR and SSIM beside renders of the true surface | dB; −1 … 1 | [`views`] |
//!
//! Depth is compared up to distance and scale, because neither is in a single painting. Normals know the scale: a body
//! that is half as deep has other normals. After the fit they tell shape alone, and both figures are given.
//!
//! Nothing here takes part in a reconstruction; [`crate::NUMERICS`] does not cover it.

pub mod surface;
pub mod views;

pub use surface::{SurfaceError, surface_error};
pub use views::{TrueViews, ViewError, novel_views};
