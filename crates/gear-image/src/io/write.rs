//! PNG files, under a temporary name first, so that no half-written file ever stands under a final one.

use std::io::Write;
use std::path::{Path, PathBuf};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use crate::{Image, Mask};

/// Why a file was not written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The file system refused; nothing is left under the final name.
    #[error("{}: cannot be written: {source}", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The picture cannot be a PNG.
    #[error("{}: cannot be a PNG file: {cause}", file.display())]
    Encode {
        /// The file.
        file: PathBuf,
        /// Why.
        cause: String,
    },
}

/// An 8-bit PNG of a picture: samples cut to [0, 1] and rounded (NaN is 0), alpha kept.
pub fn png_bytes(image: &Image) -> Result<Vec<u8>, String> {
    let code = |x: f32| (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    match &image.alpha {
        None => {
            let samples: Vec<u8> = image.rgb.data().as_flattened().iter().map(|&x| code(x)).collect();
            encode(image.size(), &samples, ExtendedColorType::Rgb8)
        }
        Some(alpha) => {
            let pixels = image.rgb.data().iter().zip(alpha.data());
            let samples: Vec<u8> = pixels
                .flat_map(|(p, &a)| [code(p[0]), code(p[1]), code(p[2]), code(a)])
                .collect();
            encode(image.size(), &samples, ExtendedColorType::Rgba8)
        }
    }
}

fn encode((width, height): (usize, usize), samples: &[u8], kind: ExtendedColorType) -> Result<Vec<u8>, String> {
    let side = |n: usize| u32::try_from(n).map_err(|_| format!("a side of {n} pixels is too long"));
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive)
        .write_image(samples, side(width)?, side(height)?, kind)
        .map_err(|e| e.to_string())?;
    Ok(bytes)
}

/// Writes bytes to a file: to a temporary name beside it, to disk, then renamed. On failure nothing is left.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    let io = |source| WriteError::Io {
        file: path.to_path_buf(),
        source,
    };
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(name);
    let written = std::fs::File::create(&part).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()
    });
    if let Err(error) = written.and_then(|()| std::fs::rename(&part, path)) {
        // The temporary file may not even exist; the first error is the one that counts.
        let _ = std::fs::remove_file(&part);
        return Err(io(error));
    }
    Ok(())
}

/// Writes a picture as an 8-bit PNG file, atomically.
pub fn write_png(path: &Path, image: &Image) -> Result<(), WriteError> {
    let bytes = png_bytes(image).map_err(|cause| WriteError::Encode {
        file: path.to_path_buf(),
        cause,
    })?;
    write_atomically(path, &bytes)
}

/// Writes a mask as a PNG file, white inside, atomically.
pub fn write_mask_png(path: &Path, mask: &Mask) -> Result<(), WriteError> {
    let samples: Vec<u8> = mask.data().iter().map(|&inside| if inside { 255 } else { 0 }).collect();
    let bytes = encode(mask.size(), &samples, ExtendedColorType::L8).map_err(|cause| WriteError::Encode {
        file: path.to_path_buf(),
        cause,
    })?;
    write_atomically(path, &bytes)
}
