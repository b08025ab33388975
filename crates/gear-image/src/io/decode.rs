//! One picture from a reader.

use std::io::Read;

use image::metadata::Orientation;

use super::format::{Format, detect};
use super::{Loaded, Options, Problem, Source, exr, jpeg, orient, png, tiff};
use crate::{Image, Mask};

/// Decodes a picture. `extension` (lower case) is only used to note that it misleads.
pub fn decode_image(source: &mut dyn Source, extension: Option<String>, options: &Options) -> Result<Loaded, Problem> {
    let mut head = Vec::new();
    source.take(64).read_to_end(&mut head)?;
    source.rewind()?;
    let format = detect(&head)?;
    let (rows, orientation) = match format {
        Format::Png => png::decode(source, options)?,
        Format::Jpeg | Format::WebP => jpeg::decode(source, format, options)?,
        Format::Tiff => tiff::decode(source, options)?,
        Format::Exr => (exr::decode(source, options)?, Orientation::NoTransforms),
    };
    let original = rows.size();
    let (image, mut notes) = rows.finish(format.name())?;
    if let Some(extension) = extension.filter(|extension| !format.is_called(extension)) {
        notes.insert(
            0,
            format!(
                "the file is called .{extension} but holds a {} picture; read as such",
                format.name()
            ),
        );
    }
    Ok(Loaded {
        image: orient::upright(image, orientation),
        original,
        notes,
    })
}

/// Decodes a mask: inside is where alpha, if the file has any, or else the brightest encoded channel, is at least
/// one half.
pub fn decode_mask(
    source: &mut dyn Source,
    extension: Option<String>,
    options: &Options,
) -> Result<(Mask, Vec<String>), Problem> {
    let loaded = decode_image(source, extension, options)?;
    Ok((mask_of(&loaded.image), loaded.notes))
}

fn mask_of(image: &Image) -> Mask {
    let (width, height) = image.size();
    let inside = match &image.alpha {
        Some(alpha) => alpha.data().iter().map(|&a| a >= 0.5).collect(),
        None => image.rgb.data().iter().map(|p| p.iter().any(|&c| c >= 0.5)).collect(),
    };
    Mask::from_vec(width, height, inside)
}
