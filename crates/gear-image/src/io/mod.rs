//! Pictures and masks from files, and PNG files from pictures.
//!
//! PNG, JPEG, TIFF, WebP and OpenEXR, told apart by content, never by name; 8 and 16 bits and float. Rows flow from
//! the decoder through the ICC profile into linear light and are averaged down to the working size as they arrive, so
//! that a scan of 200 megapixels never exists as floats. PNG and striped or tiled TIFF stream row by row; JPEG,
//! WebP and EXR decoders give a whole picture, whose bytes are bounded by [`Limits`].
//!
//! Integer samples are sRGB-encoded unless an ICC profile says otherwise; float samples are linear light with sRGB
//! primaries.

mod decode;
mod error;
mod exr;
mod format;
mod jpeg;
#[cfg(feature = "graph")]
mod loader;
mod orient;
mod png;
mod profile;
mod rows;
mod tiff;
mod write;

use std::io::{BufRead, Seek};
use std::path::Path;

pub use decode::{decode_image, decode_mask};
pub use error::{Problem, ReadError};
#[cfg(feature = "graph")]
pub use loader::{ImageFile, MaskFile, register};
pub use write::{WriteError, png_bytes, write_atomically, write_mask_png, write_png};

use crate::{Image, Mask};

/// Longer side of the working picture unless told otherwise, in pixels.
pub const DEFAULT_SIZE: usize = 768;

/// What a file may ask for before it is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Longest side in pixels.
    pub side: usize,
    /// Most pixels in all.
    pub pixels: usize,
    /// Most bytes of decoded samples held at once.
    pub bytes: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            side: 100_000,
            pixels: 500_000_000,
            bytes: 1 << 30,
        }
    }
}

/// How a picture is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Longest side of the result; larger pictures are averaged down, smaller ones stay. At least 1.
    pub size: usize,
    /// What a file may ask for.
    pub limits: Limits,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            size: DEFAULT_SIZE,
            limits: Limits::default(),
        }
    }
}

/// A picture read, and what there is to say about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The picture, upright, at the working size.
    pub image: Image,
    /// (width, height) in the file, before its orientation was applied.
    pub original: (usize, usize),
    /// Remarks for the user: bad samples replaced, a name that misleads.
    pub notes: Vec<String>,
}

/// A reader that can seek: a file or bytes in memory.
pub trait Source: BufRead + Seek {}
impl<T: BufRead + Seek + ?Sized> Source for T {}

/// Reads a picture file.
pub fn read_image(path: &Path, options: &Options) -> Result<Loaded, ReadError> {
    opened(path)
        .and_then(|mut file| decode_image(&mut file, extension(path), options))
        .map_err(|problem| ReadError {
            file: path.display().to_string(),
            problem,
        })
}

/// Reads a mask file: inside is where alpha, if the file has any, or else luminance code, is at least one half.
pub fn read_mask(path: &Path, options: &Options) -> Result<(Mask, Vec<String>), ReadError> {
    opened(path)
        .and_then(|mut file| decode_mask(&mut file, extension(path), options))
        .map_err(|problem| ReadError {
            file: path.display().to_string(),
            problem,
        })
}

fn opened(path: &Path) -> Result<std::io::BufReader<std::fs::File>, Problem> {
    if path.is_dir() {
        return Err(Problem::Folder);
    }
    Ok(std::io::BufReader::with_capacity(1 << 16, std::fs::File::open(path)?))
}

/// The extension of a path, in lower case.
fn extension(path: &Path) -> Option<String> {
    Some(path.extension()?.to_str()?.to_ascii_lowercase())
}

#[cfg(test)]
mod tests;
