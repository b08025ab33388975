//! f32 rasters and fields: colour, filters, pyramids, sparse solvers, file formats.
//!
//! Rasters are row-major, y points down, pixel (0, 0) is the top left one. Colour spaces are types:
//! [`SrgbImage`] holds encoded values, [`LinearImage`] linear light.
//!
//! Everything here gives the same bits for any number of threads and on every SIMD level: work is split over
//! rows or fixed chunks, sums have a fixed shape ([`stats`]), and transcendental functions are our own ([`math`]).

pub mod colour;
pub mod edges;
#[cfg_attr(not(feature = "graph"), allow(dead_code))] // files are then only read
mod exr_file;
pub mod fidelity;
pub mod filter;
pub mod io;
pub mod math;
mod raster;
pub mod solve;
pub mod stats;
pub mod testing;
#[cfg(feature = "graph")]
mod value;

pub use raster::{Field, Image, Linear, LinearImage, Mask, Rgb, Space, Srgb, SrgbImage};

#[cfg(feature = "graph")]
pub use io::register;
