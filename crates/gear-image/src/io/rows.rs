//! Where decoded rows go: through the profile into linear light, and into the average of the working picture.

use super::profile::Profile;
use super::{Limits, Options, Problem};
use crate::colour::{self, Sanitised};
use crate::filter::{AreaRows, fit_longer_side};
use crate::{Field, Image, Rgb};

/// What the samples of a pixel are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    /// Three colour samples, or one.
    pub colour: bool,
    /// Followed by alpha, not multiplied in.
    pub alpha: bool,
}

impl Layout {
    pub fn samples(self) -> usize {
        if self.colour {
            3 + usize::from(self.alpha)
        } else {
            1 + usize::from(self.alpha)
        }
    }
}

/// A row (or several) of interleaved samples as the decoder gives them.
#[derive(Clone, Copy)]
pub(super) enum Samples<'a> {
    /// Encoded, of 255.
    U8(&'a [u8]),
    /// Encoded, of 65535.
    U16(&'a [u16]),
    /// Linear light.
    F32(&'a [f32]),
}

/// Takes rows from top to bottom.
pub(super) struct Rows {
    layout: Layout,
    width: usize,
    height: usize,
    profile: Option<Profile>,
    seen: usize,
    bad: Sanitised,
    /// One row, of r g b samples: encoded, or linear.
    rgb: Vec<f32>,
    alpha: Vec<f32>,
    any_transparent: bool,
    target: Target,
}

enum Target {
    /// The picture is small enough: its encoded samples are kept as they are.
    Whole { rgb: Vec<[f32; 3]>, alpha: Vec<f32> },
    /// Linear light times alpha, and alpha, averaged.
    Average {
        size: (usize, usize),
        rows: AreaRows,
        mixed: Vec<f32>,
    },
}

impl Rows {
    /// Checks the size against the limits before any memory is taken.
    pub fn new(
        (width, height): (usize, usize),
        layout: Layout,
        profile: Option<Profile>,
        options: &Options,
    ) -> Result<Self, Problem> {
        check_size(width, height, &options.limits)?;
        let size = fit_longer_side(width, height, options.size.max(1));
        let target = if size == (width, height) {
            Target::Whole {
                rgb: Vec::with_capacity(width * height),
                alpha: Vec::new(),
            }
        } else {
            let rows = AreaRows::new((width, height), size, if layout.alpha { 4 } else { 3 });
            Target::Average {
                size,
                rows,
                mixed: Vec::new(),
            }
        };
        Ok(Self {
            layout,
            width,
            height,
            profile,
            seen: 0,
            bad: Sanitised::default(),
            rgb: vec![0.0; width * 3],
            alpha: vec![1.0; if layout.alpha { width } else { 0 }],
            any_transparent: false,
            target,
        })
    }

    /// (width, height) of the picture in the file.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Takes whole rows; those beyond the last are ignored.
    pub fn push(&mut self, samples: Samples<'_>) {
        let stride = self.width * self.layout.samples();
        match samples {
            Samples::U8(xs) => xs.chunks_exact(stride).for_each(|row| self.row(Samples::U8(row))),
            Samples::U16(xs) => xs.chunks_exact(stride).for_each(|row| self.row(Samples::U16(row))),
            Samples::F32(xs) => xs.chunks_exact(stride).for_each(|row| self.row(Samples::F32(row))),
        }
    }

    fn row(&mut self, samples: Samples<'_>) {
        if self.seen == self.height {
            return;
        }
        self.seen += 1;
        let linear = matches!(samples, Samples::F32(_));
        match samples {
            Samples::U8(row) => self.split(row, |x| f32::from(x) / 255.0),
            Samples::U16(row) => self.split(row, |x| f32::from(x) / 65535.0),
            Samples::F32(row) => self.split(row, |x| x),
        }
        if let Some(profile) = &mut self.profile {
            profile.apply(&mut self.rgb);
        }
        if linear {
            let (pixels, _) = self.rgb.as_chunks_mut::<3>();
            let bad = colour::sanitise(pixels);
            self.bad.nan += bad.nan;
            self.bad.infinite += bad.infinite;
            self.bad.negative += bad.negative;
        }
        for a in &mut self.alpha {
            *a = if a.is_nan() { 1.0 } else { a.clamp(0.0, 1.0) };
            self.any_transparent |= *a < 1.0;
        }
        match &mut self.target {
            Target::Whole { rgb, alpha } => {
                if linear {
                    colour::to_srgb_slice(&mut self.rgb);
                }
                rgb.extend_from_slice(self.rgb.as_chunks::<3>().0);
                alpha.extend_from_slice(&self.alpha);
            }
            Target::Average { rows, mixed, .. } => {
                if !linear {
                    colour::to_linear_slice(&mut self.rgb);
                }
                if self.layout.alpha {
                    mixed.clear();
                    for (rgb, &a) in self.rgb.as_chunks::<3>().0.iter().zip(&self.alpha) {
                        mixed.extend_from_slice(&[rgb[0] * a, rgb[1] * a, rgb[2] * a, a]);
                    }
                    rows.push(mixed);
                } else {
                    rows.push(&self.rgb);
                }
            }
        }
    }

    /// Splits a row into `rgb` and `alpha`.
    fn split<T: Copy>(&mut self, row: &[T], value: impl Fn(T) -> f32) {
        let pixels = row.chunks_exact(self.layout.samples());
        for (i, (pixel, rgb)) in pixels.zip(self.rgb.as_chunks_mut::<3>().0).enumerate() {
            *rgb = if self.layout.colour {
                [value(pixel[0]), value(pixel[1]), value(pixel[2])]
            } else {
                [value(pixel[0]); 3]
            };
            if self.layout.alpha {
                self.alpha[i] = value(pixel[self.layout.samples() - 1]);
            }
        }
    }

    /// The working picture, and notes on what was replaced. `format` names the file's format in errors.
    pub fn finish(self, format: &'static str) -> Result<(Image, Vec<String>), Problem> {
        if self.seen < self.height {
            return Err(Problem::Truncated { format });
        }
        let keep_alpha = self.layout.alpha && self.any_transparent;
        let image = match self.target {
            Target::Whole { rgb, alpha } => Image {
                rgb: Rgb::from_vec(self.width, self.height, rgb),
                alpha: keep_alpha.then(|| Field::from_vec(self.width, self.height, alpha)),
            },
            Target::Average { size, rows, .. } => averaged(size, &rows.finish(), self.layout.alpha, keep_alpha),
        };
        Ok((image, notes(&self.bad)))
    }
}

fn averaged((width, height): (usize, usize), samples: &[f32], four: bool, keep_alpha: bool) -> Image {
    if !four {
        let rgb = Rgb::<crate::Linear>::from_vec(width, height, samples.as_chunks::<3>().0.to_vec());
        return Image::opaque(rgb.to_srgb());
    }
    let (pixels, _) = samples.as_chunks::<4>();
    let over = |p: &[f32; 4]| {
        if p[3] > 0.0 {
            [p[0] / p[3], p[1] / p[3], p[2] / p[3]]
        } else {
            [0.0; 3]
        }
    };
    let rgb = Rgb::<crate::Linear>::from_vec(width, height, pixels.iter().map(over).collect());
    let alpha = pixels.iter().map(|p| p[3].clamp(0.0, 1.0)).collect();
    Image {
        rgb: rgb.to_srgb(),
        alpha: keep_alpha.then(|| Field::from_vec(width, height, alpha)),
    }
}

fn notes(bad: &Sanitised) -> Vec<String> {
    let mut notes = Vec::new();
    let mut say = |count: usize, what: &str, became: &str| {
        if count > 0 {
            let (noun, verb) = if count == 1 {
                ("pixel", "has")
            } else {
                ("pixels", "have")
            };
            notes.push(format!("{count} {noun} {verb} {what} samples, which became {became}"));
        }
    };
    say(bad.nan, "NaN", "0");
    say(bad.infinite, "infinite", "1e30 (or 0 if negative)");
    say(bad.negative, "negative", "0");
    notes
}

/// Refuses pictures without pixels and those beyond the limits.
pub(super) fn check_size(width: usize, height: usize, limits: &Limits) -> Result<(), Problem> {
    if width == 0 || height == 0 {
        return Err(Problem::ZeroSize { width, height });
    }
    if width.max(height) > limits.side || width.saturating_mul(height) > limits.pixels {
        return Err(Problem::TooLarge {
            width,
            height,
            side: limits.side,
            megapixels: limits.pixels / 1_000_000,
        });
    }
    Ok(())
}

/// Refuses to hold more decoded bytes at once than the limits allow.
pub(super) fn check_memory(width: usize, height: usize, bytes: u64, limits: &Limits) -> Result<(), Problem> {
    if bytes > limits.bytes as u64 {
        return Err(Problem::TooMuchMemory {
            width,
            height,
            needs_mib: (bytes >> 20) as usize,
            limit_mib: limits.bytes >> 20,
        });
    }
    Ok(())
}
