//! f32 rasters and fields: colour, filters, pyramids, sparse solvers, file formats.
//!
//! Rasters are row-major, y points down, pixel (0, 0) is the top left one. Colour spaces are types:
//! [`SrgbImage`] holds encoded values, [`LinearImage`] linear light.

mod raster;
pub mod solve;

pub use raster::{Field, Image, Linear, LinearImage, Mask, Rgb, Space, Srgb, SrgbImage};
