//! TIFF, a strip or a row of tiles at a time; planes stored apart are decoded whole.

use image::metadata::Orientation;
use tiff::decoder::{ChunkType, Decoder, DecodingResult};
use tiff::tags::Tag;
use tiff::{ColorType, TiffError};

use super::profile::Profile;
use super::rows::{Layout, Rows, Samples, check_memory, check_size};
use super::{Options, Problem, Source};

fn error(e: TiffError) -> Problem {
    match e {
        TiffError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => Problem::Truncated { format: "TIFF" },
        TiffError::UnsupportedError(e) => Problem::UnsupportedSamples {
            found: format!("this TIFF ({e})"),
        },
        e => Problem::decoder("TIFF", e),
    }
}

fn layout(colour: ColorType) -> Result<Layout, Problem> {
    Ok(match colour {
        ColorType::Gray(_) => Layout {
            colour: false,
            alpha: false,
        },
        ColorType::GrayA(_) => Layout {
            colour: false,
            alpha: true,
        },
        ColorType::RGB(_) => Layout {
            colour: true,
            alpha: false,
        },
        ColorType::RGBA(_) => Layout {
            colour: true,
            alpha: true,
        },
        ColorType::CMYK(_) | ColorType::CMYKA(_) => return Err(Problem::Cmyk),
        other => {
            return Err(Problem::UnsupportedSamples {
                found: format!("a TIFF of {other:?} samples"),
            });
        }
    })
}

pub(super) fn decode(source: &mut dyn Source, options: &Options) -> Result<(Rows, Orientation), Problem> {
    let mut limits = tiff::decoder::Limits::default();
    limits.decoding_buffer_size = options.limits.bytes;
    limits.intermediate_buffer_size = options.limits.bytes;
    let mut decoder = Decoder::new(source).map_err(error)?.with_limits(limits);
    let (width, height) = decoder.dimensions().map_err(error)?;
    let (width, height) = (width as usize, height as usize);
    check_size(width, height, &options.limits)?;
    let colour = decoder.colortype().map_err(error)?;
    let layout = layout(colour)?;
    if colour.bit_depth() < 8 {
        let found = format!("a TIFF of {} bits a sample", colour.bit_depth());
        return Err(Problem::UnsupportedSamples { found });
    }
    if decoder
        .find_tag_unsigned::<u16>(Tag::PlanarConfiguration)
        .map_err(error)?
        == Some(2)
        && layout.samples() > 1
    {
        return Err(Problem::UnsupportedSamples {
            found: "a TIFF with its colour planes stored apart".into(),
        });
    }
    let profile = match decoder.get_tag_u8_vec(Tag::IccProfile) {
        Ok(icc) => Profile::parse(&icc, !layout.colour)?,
        Err(_) => None,
    };
    let orientation = decoder
        .find_tag_unsigned::<u16>(Tag::Orientation)
        .map_err(error)?
        .and_then(|code| Orientation::from_exif(code as u8));
    let mut rows = Rows::new((width, height), layout, profile, options)?;
    let (chunk_width, chunk_height) = decoder.chunk_dimensions();
    let (chunk_width, chunk_height) = (chunk_width as usize, chunk_height as usize);
    if chunk_width == 0 || chunk_height == 0 {
        return Err(Problem::Damaged {
            format: "TIFF",
            cause: "its strips or tiles have no size".into(),
        });
    }
    let samples = layout.samples();
    let band = (width * chunk_height.min(height) * samples) as u64 * u64::from(colour.bit_depth() / 8);
    check_memory(width, height, 2 * band, &options.limits)?;
    let across = match decoder.get_chunk_type() {
        ChunkType::Strip => 1,
        ChunkType::Tile => width.div_ceil(chunk_width),
    };
    for first in 0..height.div_ceil(chunk_height) {
        if across == 1 {
            let chunk = decoder.read_chunk(first as u32).map_err(error)?;
            push(&mut rows, &chunk)?;
            continue;
        }
        let mut tiles = Vec::with_capacity(across);
        for tile in 0..across {
            let index = (first * across + tile) as u32;
            let (w, _) = decoder.chunk_data_dimensions(index);
            tiles.push((w as usize * samples, decoder.read_chunk(index).map_err(error)?));
        }
        let lines = chunk_height.min(height - first * chunk_height);
        push_tiles(&mut rows, &tiles, lines)?;
    }
    Ok((rows, orientation.unwrap_or(Orientation::NoTransforms)))
}

fn unsupported(chunk: &DecodingResult) -> Problem {
    let kind = match chunk {
        DecodingResult::I8(_) | DecodingResult::I16(_) | DecodingResult::I32(_) | DecodingResult::I64(_) => "signed",
        DecodingResult::F64(_) => "64-bit float",
        _ => "32-bit or 64-bit integer",
    };
    Problem::UnsupportedSamples {
        found: format!("a TIFF of {kind} samples"),
    }
}

fn push(rows: &mut Rows, chunk: &DecodingResult) -> Result<(), Problem> {
    match chunk {
        DecodingResult::U8(xs) => rows.push(Samples::U8(xs)),
        DecodingResult::U16(xs) => rows.push(Samples::U16(xs)),
        DecodingResult::F32(xs) => rows.push(Samples::F32(xs)),
        DecodingResult::F16(xs) => rows.push(Samples::F32(&xs.iter().map(|x| x.to_f32()).collect::<Vec<_>>())),
        other => return Err(unsupported(other)),
    }
    Ok(())
}

/// Puts the lines of a row of tiles together; each tile comes with the number of samples in its lines.
fn push_tiles(rows: &mut Rows, tiles: &[(usize, DecodingResult)], lines: usize) -> Result<(), Problem> {
    for line in 0..lines {
        macro_rules! joined {
            ($kind:ident, $samples:ident) => {{
                let mut row = Vec::new();
                for (stride, tile) in tiles {
                    let DecodingResult::$kind(xs) = tile else {
                        return Err(unsupported(tile));
                    };
                    row.extend_from_slice(&xs[(line * stride).min(xs.len())..((line + 1) * stride).min(xs.len())]);
                }
                rows.push(Samples::$samples(&row));
            }};
        }
        match &tiles[0].1 {
            DecodingResult::U8(_) => joined!(U8, U8),
            DecodingResult::U16(_) => joined!(U16, U16),
            DecodingResult::F32(_) => joined!(F32, F32),
            other => return Err(unsupported(other)),
        }
    }
    Ok(())
}
