//! Resizing: area average along a side that shrinks, bilinear along one that grows.
//!
//! Both are separable tables of taps. Values are averaged as they are; [`resize_image`] averages colour in linear
//! light, weighted by alpha.

use std::borrow::Cow;

use rayon::prelude::*;

use crate::{Field, Image, LinearImage, Mask, Rgb, Space};

/// For each output sample: the first input sample and the weights from there on, which sum to 1.
pub(crate) struct Taps {
    pub first: Vec<usize>,
    pub weights: Vec<Vec<f32>>,
}

impl Taps {
    /// Taps from `from` to `to` samples, both at least 1.
    pub fn new(from: usize, to: usize) -> Self {
        let scale = from as f64 / to as f64;
        let (first, weights) = (0..to)
            .map(|o| {
                if to < from {
                    area(o, scale, from)
                } else {
                    linear(o, scale, from)
                }
            })
            .unzip();
        Self { first, weights }
    }
}

fn area(o: usize, scale: f64, n: usize) -> (usize, Vec<f32>) {
    let (a, b) = (o as f64 * scale, (o + 1) as f64 * scale);
    let first = (a.floor() as usize).min(n - 1);
    let last = ((b - 1e-9 * scale).ceil() as usize).clamp(first + 1, n);
    let cover = |i: usize| (b.min(i as f64 + 1.0) - a.max(i as f64)).max(0.0);
    let total: f64 = (first..last).map(cover).sum();
    (first, (first..last).map(|i| (cover(i) / total) as f32).collect())
}

fn linear(o: usize, scale: f64, n: usize) -> (usize, Vec<f32>) {
    let x = ((o as f64 + 0.5) * scale - 0.5).clamp(0.0, (n - 1) as f64);
    let first = (x.floor() as usize).min(n.saturating_sub(2));
    let t = (x - first as f64) as f32;
    if n == 1 {
        (0, vec![1.0])
    } else {
        (first, vec![1.0 - t, t])
    }
}

fn resample_row(row: &[f32], channels: usize, taps: &Taps, out: &mut [f32]) {
    for (o, out) in out.chunks_exact_mut(channels).enumerate() {
        out.fill(0.0);
        let pixels = row[taps.first[o] * channels..].chunks_exact(channels);
        for (pixel, &w) in pixels.zip(&taps.weights[o]) {
            for (out, &x) in out.iter_mut().zip(pixel) {
                *out += w * x;
            }
        }
    }
}

fn resample(data: &[f32], channels: usize, from: (usize, usize), to: (usize, usize)) -> Vec<f32> {
    if from == to {
        return data.to_vec();
    }
    let (across, down) = (Taps::new(from.0, to.0), Taps::new(from.1, to.1));
    let narrow: Cow<[f32]> = if from.0 == to.0 {
        Cow::Borrowed(data)
    } else {
        let mut narrow = vec![0.0; to.0 * from.1 * channels];
        narrow
            .par_chunks_mut(to.0 * channels)
            .zip(data.par_chunks(from.0 * channels))
            .for_each(|(out, row)| resample_row(row, channels, &across, out));
        Cow::Owned(narrow)
    };
    let stride = to.0 * channels;
    let mut out = vec![0.0; stride * to.1];
    out.par_chunks_mut(stride).enumerate().for_each(|(y, out)| {
        for (i, &w) in down.weights[y].iter().enumerate() {
            let row = &narrow[(down.first[y] + i) * stride..][..stride];
            for (out, &x) in out.iter_mut().zip(row) {
                *out += w * x;
            }
        }
    });
    out
}

/// The field at `width`×`height`.
pub fn resize(field: &Field, width: usize, height: usize) -> Field {
    assert!(!field.is_empty(), "an empty field has nothing to resize");
    Field::from_vec(width, height, resample(field.data(), 1, field.size(), (width, height)))
}

/// The raster at `width`×`height`, channels averaged as they are.
pub fn resize_rgb<S: Space>(image: &Rgb<S>, width: usize, height: usize) -> Rgb<S> {
    assert!(!image.is_empty(), "an empty image has nothing to resize");
    let flat = resample(image.data().as_flattened(), 3, image.size(), (width, height));
    Rgb::from_vec(
        width,
        height,
        flat.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect(),
    )
}

/// The mask at `width`×`height`: inside where at least half of the pixel's area is.
pub fn resize_mask(mask: &Mask, width: usize, height: usize) -> Mask {
    if mask.size() == (width, height) {
        return mask.clone();
    }
    let cover = resize(&mask.to_field(), width, height);
    Mask::from_vec(width, height, cover.data().iter().map(|&c| c >= 0.5).collect())
}

/// The picture at `width`×`height`: light is averaged, weighted by alpha.
pub fn resize_image(image: &Image, width: usize, height: usize) -> Image {
    if image.size() == (width, height) {
        return image.clone();
    }
    let mut linear = image.rgb.to_linear();
    let Some(alpha) = &image.alpha else {
        return Image::opaque(resize_rgb(&linear, width, height).to_srgb());
    };
    for (pixel, &a) in linear.data_mut().iter_mut().zip(alpha.data()) {
        *pixel = pixel.map(|c| c * a);
    }
    let alpha = resize(alpha, width, height);
    let mut small: LinearImage = resize_rgb(&linear, width, height);
    for (pixel, &a) in small.data_mut().iter_mut().zip(alpha.data()) {
        *pixel = if a > 0.0 { pixel.map(|c| c / a) } else { [0.0; 3] };
    }
    Image {
        rgb: small.to_srgb(),
        alpha: Some(alpha),
    }
}

/// (width, height) scaled so that the longer side is at most `longest`, never enlarged, at least 1 each.
pub fn fit_longer_side(width: usize, height: usize, longest: usize) -> (usize, usize) {
    let side = width.max(height);
    if side <= longest {
        return (width, height);
    }
    let scale = |n: usize| ((n as f64 * longest as f64 / side as f64).round() as usize).max(1);
    (scale(width), scale(height))
}

/// Averages a picture down while its rows arrive, from top to bottom, holding one output picture and one row.
pub(crate) struct AreaRows {
    across: Taps,
    down: Taps,
    channels: usize,
    stride: usize,
    next: usize,
    /// First output row that input row `next` may still contribute to.
    open: usize,
    narrow: Vec<f32>,
    out: Vec<f32>,
}

impl AreaRows {
    /// For a `from` picture of `channels` samples a pixel, brought to `to`, no larger in either side.
    pub fn new(from: (usize, usize), to: (usize, usize), channels: usize) -> Self {
        Self {
            across: Taps::new(from.0, to.0),
            down: Taps::new(from.1, to.1),
            channels,
            stride: to.0 * channels,
            next: 0,
            open: 0,
            narrow: vec![0.0; to.0 * channels],
            out: vec![0.0; to.0 * to.1 * channels],
        }
    }

    /// Takes the next input row.
    pub fn push(&mut self, row: &[f32]) {
        resample_row(row, self.channels, &self.across, &mut self.narrow);
        while self.open < self.down.first.len()
            && self.down.first[self.open] + self.down.weights[self.open].len() <= self.next
        {
            self.open += 1;
        }
        for y in self.open..self.down.first.len() {
            if self.down.first[y] > self.next {
                break;
            }
            let weight = self.down.weights[y][self.next - self.down.first[y]];
            for (out, &x) in self.out[y * self.stride..][..self.stride].iter_mut().zip(&self.narrow) {
                *out += weight * x;
            }
        }
        self.next += 1;
    }

    /// The averaged picture; rows that never came count as 0.
    pub fn finish(self) -> Vec<f32> {
        self.out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn noise(width: usize, height: usize) -> Field {
        Field::from_fn(width, height, |x, y| {
            ((x * 7919 + y * 104_729 + x * y) % 997) as f32 / 997.0
        })
    }

    proptest! {
        #[test]
        fn a_constant_stays_constant(w in 1usize..60, h in 1usize..60, tw in 1usize..90, th in 1usize..90) {
            let out = resize(&Field::filled(w, h, 0.7), tw, th);
            prop_assert!(out.data().iter().all(|x| (x - 0.7).abs() < 1e-6));
        }

        #[test]
        fn rows_that_stream_in_give_the_same_average(w in 1usize..60, h in 1usize..60, longest in 1usize..60) {
            let f = noise(w, h);
            let (tw, th) = fit_longer_side(w, h, longest);
            let mut rows = AreaRows::new((w, h), (tw, th), 1);
            for y in 0..h {
                rows.push(f.row(y));
            }
            let whole = resize(&f, tw, th);
            prop_assert_eq!(rows.finish(), whole.data());
        }
    }

    #[test]
    fn shrinking_keeps_the_mean() {
        let f = noise(91, 47);
        let small = resize(&f, 13, 5);
        assert!((crate::stats::mean(f.data()) - crate::stats::mean(small.data())).abs() < 1e-6);
    }

    #[test]
    fn growing_interpolates_between_cell_centres() {
        let f = Field::from_vec(2, 1, vec![0.0, 1.0]);
        assert_eq!(resize(&f, 4, 1).data(), [0.0, 0.25, 0.75, 1.0]);
    }

    #[test]
    fn light_is_averaged_not_its_encoding() {
        let checker = Image::opaque(Rgb::from_fn(8, 8, |x, y| [((x + y) % 2) as f32; 3]));
        let grey = resize_image(&checker, 2, 2).rgb.at(0, 0)[0];
        assert!((grey - 0.735_36).abs() < 1e-4, "{grey}");
    }

    #[test]
    fn transparent_pixels_lend_no_colour() {
        let rgb = Rgb::from_fn(2, 1, |x, _| if x == 0 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] });
        let image = Image {
            rgb,
            alpha: Some(Field::from_vec(2, 1, vec![1.0, 0.0])),
        };
        let one = resize_image(&image, 1, 1);
        assert!((one.rgb.at(0, 0)[0] - 1.0).abs() < 1e-6 && one.rgb.at(0, 0)[1] == 0.0);
        assert_eq!(one.alpha.map(|a| a.at(0, 0)), Some(0.5));
    }
}
