//! Rasters as pictures: 8-bit, no larger than a page needs, compressed.
//!
//! Quantities without a natural colour are given one that can be read without a legend: a field of one sign
//! is grey from its 1 % to its 99 % quantile, a field of both signs is blue below zero, white at it, red above, with the
//! same scale on both sides; height is light where near; NaN, which means "nothing here", is the page's ground.

use std::io::Cursor;

use gear_image::{Field, Image, Mask, SrgbImage};
use gear_splat::View;
use image::ImageEncoder;
use image::codecs::{jpeg::JpegEncoder, png};

/// A compressed picture, ready to be embedded or written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// How the bytes are compressed.
    pub format: Format,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The file's bytes.
    pub bytes: Vec<u8>,
}

/// The compression of a [`Picture`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Lossy, small: what a page embeds.
    Jpeg,
    /// Lossless: masks and line drawings in a page, and the files of a run.
    Png,
}

/// A picture could not be compressed.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The raster has no pixel.
    #[error("a {width}x{height} raster has no pixel to show")]
    Empty {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// The encoder refused.
    #[error("the picture cannot be compressed: {0}")]
    Encode(#[from] image::ImageError),
}

impl Format {
    /// The MIME type.
    pub fn mime(self) -> &'static str {
        match self {
            Self::Jpeg => "image/jpeg",
            Self::Png => "image/png",
        }
    }
}

impl Picture {
    /// Packs the picture into bytes that [`Picture::unpack`] reads: format, width, height, file.
    pub fn pack(&self) -> Vec<u8> {
        let mut packed = Vec::with_capacity(9 + self.bytes.len());
        packed.push(match self.format {
            Format::Jpeg => 0,
            Format::Png => 1,
        });
        packed.extend(self.width.to_le_bytes());
        packed.extend(self.height.to_le_bytes());
        packed.extend(&self.bytes);
        packed
    }

    /// Reads what [`Picture::pack`] wrote; `None` for anything else.
    pub fn unpack(packed: &[u8]) -> Option<Self> {
        let (&format, rest) = packed.split_first()?;
        let (width, rest) = rest.split_first_chunk()?;
        let (height, bytes) = rest.split_first_chunk()?;
        Some(Self {
            format: match format {
                0 => Format::Jpeg,
                1 => Format::Png,
                _ => return None,
            },
            width: u32::from_le_bytes(*width),
            height: u32::from_le_bytes(*height),
            bytes: bytes.to_vec(),
        })
    }
}

/// An 8-bit RGB raster on its way to a [`Picture`].
#[derive(Clone, Debug)]
pub struct Pixels {
    width: usize,
    height: usize,
    data: Vec<u8>,
}

/// The page's ground, shown where there is nothing: `--paper` of the style sheet.
pub(crate) const PAPER: [u8; 3] = [250, 248, 243];

/// One sRGB-encoded value in [0, 1] as a byte; NaN is 0.
fn byte(x: f32) -> u8 {
    (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

impl Pixels {
    fn map<T: Copy>(width: usize, height: usize, samples: &[T], f: impl Fn(T) -> [u8; 3]) -> Self {
        Self {
            width,
            height,
            data: samples.iter().flat_map(|&sample| f(sample)).collect(),
        }
    }

    /// A raster of one colour.
    pub(crate) fn filled(width: usize, height: usize, colour: [u8; 3]) -> Self {
        Self {
            width,
            height,
            data: colour.repeat(width * height),
        }
    }

    /// Width and height in pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Lays another raster over this one; all of it must be inside.
    pub(crate) fn paste(&mut self, other: &Self, left: usize, top: usize) {
        for (y, row) in other.data.chunks_exact(other.width * 3).enumerate() {
            let start = ((top + y) * self.width + left) * 3;
            self.data[start..start + row.len()].copy_from_slice(row);
        }
    }

    /// A colour raster, its values clamped to [0, 1].
    pub fn of_rgb(rgb: &SrgbImage) -> Self {
        Self::map(rgb.width(), rgb.height(), rgb.data(), |c| c.map(byte))
    }

    /// An image over the page's ground.
    pub fn of_image(image: &Image) -> Self {
        let mut pixels = Self::of_rgb(&image.rgb);
        if let Some(alpha) = &image.alpha {
            for (pixel, &a) in pixels.data.chunks_exact_mut(3).zip(alpha.data()) {
                for (channel, paper) in pixel.iter_mut().zip(PAPER) {
                    *channel = byte(f32::from(*channel) / 255.0 * a + f32::from(paper) / 255.0 * (1.0 - a));
                }
            }
        }
        pixels
    }

    /// A mask: white inside, black outside, as mask files are.
    pub fn of_mask(mask: &Mask) -> Self {
        Self::map(mask.width(), mask.height(), mask.data(), |inside| {
            if inside { [255; 3] } else { [0; 3] }
        })
    }

    /// A field of any range (see the module's first lines).
    pub fn of_field(field: &Field) -> Self {
        let show: Box<dyn Fn(f32) -> [u8; 3]> = if let Some(scale) = scale(field) {
            Box::new(move |x| diverging(x / scale))
        } else {
            let (low, high) = quantiles(field.data());
            let span = (high - low).max(f32::MIN_POSITIVE);
            Box::new(move |x| [byte((x - low) / span); 3])
        };
        Self::map(field.width(), field.height(), field.data(), |x| {
            if x.is_nan() { PAPER } else { show(x) }
        })
    }

    /// Height towards the viewer: near is light, far is dark, nothing (NaN) is paper.
    pub fn of_height(height: &Field) -> Self {
        let (far, near) = quantiles(height.data());
        let span = (near - far).max(f32::MIN_POSITIVE);
        Self::map(height.width(), height.height(), height.data(), |z| {
            if z.is_nan() {
                PAPER
            } else {
                [byte(0.12 + 0.84 * (z - far) / span); 3]
            }
        })
    }

    /// A field of shares: 0 is black, 1 is white.
    pub fn of_share(field: &Field) -> Self {
        Self::map(field.width(), field.height(), field.data(), |x| [byte(x); 3])
    }

    /// Unit normals in the usual colours, 0.5 + 0.5 n; the zero vector is paper.
    pub fn of_normals(width: usize, height: usize, normals: &[[f32; 3]]) -> Self {
        Self::map(width, height, normals, |n| {
            if n == [0.0; 3] {
                PAPER
            } else {
                n.map(|c| byte(0.5 + 0.5 * c))
            }
        })
    }

    /// The colour of a view.
    pub fn of_view(view: &View) -> Self {
        Self::of_rgb(&view.rgb)
    }

    /// Area-averaged down until the longer side is at most `side` pixels; smaller rasters stay as they are.
    pub fn at_most(self, side: usize) -> Self {
        let longer = self.width.max(self.height);
        if longer <= side || longer == 0 {
            return self;
        }
        let scaled = |n: usize| ((n * side + longer / 2) / longer).max(1);
        let (width, height) = (scaled(self.width), scaled(self.height));
        let (columns, rows) = (spans(self.width, width), spans(self.height, height));
        let mut data = Vec::with_capacity(width * height * 3);
        // One row of sums at a time: rows are added first, then columns.
        let mut sums = vec![0.0f32; self.width * 3];
        for row in &rows {
            sums.fill(0.0);
            for (y, share) in row {
                let samples = &self.data[y * self.width * 3..(y + 1) * self.width * 3];
                for (sum, &sample) in sums.iter_mut().zip(samples) {
                    *sum += f32::from(sample) * share;
                }
            }
            for column in &columns {
                for channel in 0..3 {
                    let mean: f32 = column.iter().map(|(x, share)| sums[x * 3 + channel] * share).sum();
                    data.push((mean + 0.5) as u8);
                }
            }
        }
        Self { width, height, data }
    }

    /// Compressed for a page.
    pub fn jpeg(&self) -> Result<Picture, PictureError> {
        self.compress(Format::Jpeg, |bytes, pixels| {
            JpegEncoder::new_with_quality(bytes, 84).write_image(
                &pixels.data,
                pixels.width as u32,
                pixels.height as u32,
                image::ExtendedColorType::Rgb8,
            )
        })
    }

    /// Compressed without loss.
    pub fn png(&self) -> Result<Picture, PictureError> {
        self.compress(Format::Png, |bytes, pixels| {
            png::PngEncoder::new_with_quality(bytes, png::CompressionType::Fast, png::FilterType::Adaptive).write_image(
                &pixels.data,
                pixels.width as u32,
                pixels.height as u32,
                image::ExtendedColorType::Rgb8,
            )
        })
    }

    fn compress(
        &self,
        format: Format,
        encode: impl Fn(&mut Cursor<Vec<u8>>, &Self) -> image::ImageResult<()>,
    ) -> Result<Picture, PictureError> {
        if self.data.is_empty() {
            return Err(PictureError::Empty {
                width: self.width,
                height: self.height,
            });
        }
        let mut bytes = Cursor::new(Vec::new());
        encode(&mut bytes, self)?;
        Ok(Picture {
            format,
            width: self.width as u32,
            height: self.height as u32,
            bytes: bytes.into_inner(),
        })
    }
}

/// For each of `to` cells, the samples of `from` that it covers and their shares of it, which add up to 1.
fn spans(from: usize, to: usize) -> Vec<Vec<(usize, f32)>> {
    let scale = from as f32 / to as f32;
    (0..to)
        .map(|cell| {
            let (start, end) = (cell as f32 * scale, (cell + 1) as f32 * scale);
            (start as usize..from.min(end.ceil() as usize))
                .map(|i| (i, (end.min(i as f32 + 1.0) - start.max(i as f32)).max(0.0) / scale))
                .collect()
        })
        .collect()
}

/// The 1 % and 99 % quantiles of the finite samples; (0, 1) when there is none.
fn quantiles(samples: &[f32]) -> (f32, f32) {
    let mut finite: Vec<f32> = samples.iter().copied().filter(|x| x.is_finite()).collect();
    let Some(last) = finite.len().checked_sub(1) else {
        return (0.0, 1.0);
    };
    let mut at = |share: usize| *finite.select_nth_unstable_by(last * share / 100, f32::total_cmp).1;
    (at(1), at(99))
}

/// The value that is fully red, and whose negative is fully blue, in the picture of a field of both signs; `None` for a
/// field of one sign, which is grey.
pub fn scale(field: &Field) -> Option<f32> {
    let (low, high) = quantiles(field.data());
    (low < 0.0 && high > 0.0).then(|| high.max(-low))
}

/// Blue at −1, white at 0, red at +1.
fn diverging(x: f32) -> [u8; 3] {
    const WHITE: [f32; 3] = [0.97, 0.97, 0.96];
    const RED: [f32; 3] = [0.70, 0.16, 0.14];
    const BLUE: [f32; 3] = [0.12, 0.33, 0.58];
    let end = if x < 0.0 { BLUE } else { RED };
    let t = x.abs().min(1.0);
    std::array::from_fn(|i| byte(WHITE[i] + (end[i] - WHITE[i]) * t))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packed_picture_unpacks_to_itself() {
        let picture = Pixels::of_mask(&Mask::filled(5, 3, true)).png().unwrap();
        assert_eq!(Picture::unpack(&picture.pack()), Some(picture));
        for foreign in [&b""[..], b"\x07123456789", b"\x00123"] {
            assert_eq!(Picture::unpack(foreign), None);
        }
    }

    #[test]
    fn png_keeps_every_byte() {
        let rgb = SrgbImage::from_fn(9, 4, |x, y| [x as f32 / 8.0, y as f32 / 3.0, 0.5]);
        let pixels = Pixels::of_rgb(&rgb);
        let back = image::load_from_memory(&pixels.png().unwrap().bytes).unwrap().to_rgb8();
        assert_eq!(back.dimensions(), (9, 4));
        assert_eq!(back.into_raw(), pixels.data);
    }

    #[test]
    fn shrinking_keeps_the_aspect_ratio_and_never_loses_a_side() {
        let pixels = Pixels::of_field(&Field::filled(4000, 1, 0.5)).at_most(200);
        assert_eq!((pixels.width, pixels.height), (200, 1));
        let small = Pixels::of_field(&Field::filled(3, 2, 0.5)).at_most(200);
        assert_eq!((small.width, small.height), (3, 2));
    }

    #[test]
    fn shrinking_keeps_a_constant_and_the_mean() {
        let flat = Pixels::of_field(&Field::filled(101, 67, 0.5)).at_most(40);
        assert_eq!((flat.width, flat.height), (40, 27));
        assert!(flat.data.windows(2).all(|pair| pair[0] == pair[1]));
        let stripes = Pixels::of_mask(&Mask::from_fn(100, 2, |x, _| x % 2 == 0)).at_most(50);
        assert!(
            stripes.data.chunks(3).all(|c| c[0].abs_diff(128) <= 1),
            "{:?}",
            stripes.data
        );
    }

    #[test]
    fn zero_is_white_in_a_field_of_both_signs() {
        let field = Field::from_fn(101, 1, |x, _| x as f32 - 50.0);
        let pixels = Pixels::of_field(&field);
        assert!(pixels.data[150..153].iter().all(|&c| c > 240));
        assert!(scale(&field).is_some_and(|scale| scale > 48.0));
        assert_eq!(scale(&Field::filled(4, 1, 2.0)), None);
        assert!(pixels.data[0] < pixels.data[2], "negative is blue");
        assert!(pixels.data[300] > pixels.data[302], "positive is red");
    }

    #[test]
    fn nothing_is_paper() {
        assert_eq!(Pixels::of_height(&Field::filled(1, 1, f32::NAN)).data, PAPER);
        assert_eq!(Pixels::of_normals(1, 1, &[[0.0; 3]]).data, PAPER);
    }

    #[test]
    fn a_raster_without_pixels_is_an_error() {
        assert!(Pixels::of_field(&Field::filled(0, 4, 0.0)).jpeg().is_err());
    }
}
