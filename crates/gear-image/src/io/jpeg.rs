//! JPEG and WebP, decoded whole to 8-bit samples.

use image::metadata::Orientation;
use image::{ColorType, ImageDecoder};

use super::format::Format;
use super::profile::Profile;
use super::rows::{Layout, Rows, Samples, check_memory, check_size};
use super::{Options, Problem, Source};

pub(super) fn decode(
    source: &mut dyn Source,
    format: Format,
    options: &Options,
) -> Result<(Rows, Orientation), Problem> {
    let failed = |e: image::ImageError| Problem::decoder(format.name(), e);
    if format == Format::Jpeg {
        let end = source.seek(std::io::SeekFrom::End(0))?;
        source.rewind()?;
        check_memory(0, 0, end, &options.limits)?;
        let mut bytes = Vec::new();
        source.read_to_end(&mut bytes)?;
        look_through(&bytes, options)?;
        let decoder = image::codecs::jpeg::JpegDecoder::new(std::io::Cursor::new(bytes)).map_err(failed)?;
        whole(decoder, format, options)
    } else {
        whole(
            image::codecs::webp::WebPDecoder::new(source).map_err(failed)?,
            format,
            options,
        )
    }
}

/// What the decoder would not tell: CMYK (it converts without a profile) and a cut-off file (it greys the rest).
fn look_through(bytes: &[u8], options: &Options) -> Result<(), Problem> {
    let mut at = 2;
    while let Some(&[0xff, marker, high, low]) = bytes.get(at..at + 4) {
        if marker == 0xff {
            at += 1;
            continue;
        }
        let length = usize::from(u16::from_be_bytes([high, low]));
        let is_frame = (0xc0..=0xcf).contains(&marker) && ![0xc4, 0xc8, 0xcc].contains(&marker);
        if let (true, Some(frame)) = (is_frame, bytes.get(at + 4..at + 10)) {
            let side = |i: usize| usize::from(u16::from_be_bytes([frame[i], frame[i + 1]]));
            check_size(side(3), side(1), &options.limits)?;
            if frame[5] == 4 {
                return Err(Problem::Cmyk);
            }
        }
        if marker == 0xda {
            // Within entropy-coded data a 0xff is followed by 0: an end marker is an end marker.
            let ended = bytes[at..].windows(2).any(|pair| pair == [0xff, 0xd9]);
            return if ended {
                Ok(())
            } else {
                Err(Problem::Truncated { format: "JPEG" })
            };
        }
        at += 2 + length.max(2);
    }
    Err(Problem::Truncated { format: "JPEG" })
}

fn whole(mut decoder: impl ImageDecoder, format: Format, options: &Options) -> Result<(Rows, Orientation), Problem> {
    let failed = |e: image::ImageError| Problem::decoder(format.name(), e);
    let (width, height) = decoder.dimensions();
    let (width, height) = (width as usize, height as usize);
    check_size(width, height, &options.limits)?;
    check_memory(width, height, decoder.total_bytes(), &options.limits)?;
    let layout = match decoder.color_type() {
        ColorType::L8 => Layout {
            colour: false,
            alpha: false,
        },
        ColorType::La8 => Layout {
            colour: false,
            alpha: true,
        },
        ColorType::Rgb8 => Layout {
            colour: true,
            alpha: false,
        },
        ColorType::Rgba8 => Layout {
            colour: true,
            alpha: true,
        },
        other => {
            let found = format!("a {} picture of {other:?} samples", format.name());
            return Err(Problem::UnsupportedSamples { found });
        }
    };
    let profile = match decoder.icc_profile().map_err(failed)? {
        Some(icc) => Profile::parse(&icc, !layout.colour)?,
        None => None,
    };
    // Damaged metadata are no reason to refuse a picture.
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let mut samples = vec![0; decoder.total_bytes() as usize];
    decoder.read_image(&mut samples).map_err(failed)?;
    let mut rows = Rows::new((width, height), layout, profile, options)?;
    rows.push(Samples::U8(&samples));
    Ok((rows, orientation))
}
