//! PNG, row by row; an interlaced file is decoded whole.

use image::metadata::Orientation;
use png::{BitDepth, ColorType, Decoder, DecodingError, Transformations};

use super::profile::Profile;
use super::rows::{Layout, Rows, Samples, check_memory, check_size};
use super::{Options, Problem, Source};

fn error(e: DecodingError) -> Problem {
    match e {
        DecodingError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            Problem::Truncated { format: "PNG" }
        }
        e => Problem::decoder("PNG", e),
    }
}

/// Width and height as the header states them: a size of 0 must be told from damage.
fn stated_size(source: &mut dyn Source) -> Result<(usize, usize), Problem> {
    let mut head = [0u8; 24];
    source
        .read_exact(&mut head)
        .map_err(|_| Problem::Truncated { format: "PNG" })?;
    source.rewind()?;
    let side = |at: usize| u32::from_be_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]) as usize;
    Ok((side(16), side(20)))
}

pub(super) fn decode(source: &mut dyn Source, options: &Options) -> Result<(Rows, Orientation), Problem> {
    let (width, height) = stated_size(source)?;
    check_size(width, height, &options.limits)?;
    let mut decoder = Decoder::new_with_limits(
        source,
        png::Limits {
            bytes: options.limits.bytes,
        },
    );
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(error)?;
    let (colour, depth) = reader.output_color_type();
    let layout = match colour {
        ColorType::Grayscale => Layout {
            colour: false,
            alpha: false,
        },
        ColorType::GrayscaleAlpha => Layout {
            colour: false,
            alpha: true,
        },
        ColorType::Rgb | ColorType::Indexed => Layout {
            colour: true,
            alpha: false,
        },
        ColorType::Rgba => Layout {
            colour: true,
            alpha: true,
        },
    };
    let info = reader.info();
    // An sRGB chunk overrides a profile.
    let profile = match (&info.icc_profile, info.srgb) {
        (Some(icc), None) => Profile::parse(icc, !layout.colour)?,
        _ => None,
    };
    let orientation = info.exif_metadata.as_deref().and_then(Orientation::from_exif_chunk);
    let interlaced = info.interlaced;
    let mut rows = Rows::new((width, height), layout, profile, options)?;
    let mut push = |bytes: &[u8], wide: &mut Vec<u16>| {
        if depth == BitDepth::Sixteen {
            wide.clear();
            wide.extend(bytes.as_chunks::<2>().0.iter().map(|&b| u16::from_be_bytes(b)));
            rows.push(Samples::U16(wide));
        } else {
            rows.push(Samples::U8(bytes));
        }
    };
    let mut wide = Vec::new();
    if interlaced {
        let bytes = reader.output_buffer_size().unwrap_or(usize::MAX);
        check_memory(width, height, bytes as u64, &options.limits)?;
        let mut whole = vec![0; bytes];
        reader.next_frame(&mut whole).map_err(error)?;
        push(&whole, &mut wide);
    } else {
        while let Some(row) = reader.next_row().map_err(error)? {
            push(row.data(), &mut wide);
        }
    }
    Ok((rows, orientation.unwrap_or(Orientation::NoTransforms)))
}
