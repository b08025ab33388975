//! The steps, each a pure function on plain data.
//!
//! [`grounded`] is one pass after the horizontal half of its blur: each row is blurred vertically, then gain,
//! shoulder, limiter and encoding run over it in blocks of 256 pixels, split into planes so that the loops vectorise
//! while everything is in the innermost cache. The painting is read twice and the result written once.

use std::borrow::Cow;
use std::sync::Arc;

use gear_graph::NodeError;
use gear_image::filter::{self, blurred_light_rows};
use gear_image::{Field, Image, LinearImage, Rgb, SrgbImage, colour, math};
use multiversion::multiversion;
use rayon::prelude::*;

use crate::Gamut;
use crate::gamut::{limiter, shoulder, unit};

/// What [`grounded`] is made with; see the node's parameters.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// β.
    pub beta: f32,
    /// How colours are brought into [0, 1].
    pub gamut: Gamut,
    /// k.
    pub detail: f32,
    /// σ as a share of the longer side.
    pub detail_radius: f64,
    /// ε.
    pub epsilon: f32,
}

/// The ratio at the painting's size.
pub(crate) fn fitted<'a>(ratio: &'a Arc<Field>, painting: &Image) -> Result<Cow<'a, Field>, NodeError> {
    let (width, height) = painting.size();
    if ratio.size() == (width, height) {
        return Ok(Cow::Borrowed(ratio));
    }
    if ratio.is_empty() || width == 0 || height == 0 {
        return Err(NodeError::input(
            "ratio",
            "expected a painting and a ratio with pixels, found none",
        ));
    }
    Ok(Cow::Owned(filter::resize(ratio, width, height)))
}

/// The grounded image, sRGB-encoded. No ratio means β = 0.
pub fn grounded(painting: &SrgbImage, ratio: Option<&Field>, recipe: &Recipe) -> SrgbImage {
    let (width, height) = painting.size();
    let mut out = SrgbImage::filled(width, height, [0.0; 3]);
    let no_ratio = vec![0.0f32; width];
    let lit = |y: usize, light: &[[f32; 3]], blurred: &[f32], out: &mut [[f32; 3]]| {
        let ratio = ratio.map_or(&no_ratio[..], |ratio| ratio.row(y));
        light_row(light, blurred, ratio, recipe, out);
    };
    if recipe.detail > 0.0 {
        let sigma = (recipe.detail_radius * painting.longer_side() as f64).max(0.6);
        blurred_light_rows(painting, sigma, out.data_mut(), lit);
    } else {
        let light = colour::light(painting);
        out.data_mut()
            .par_chunks_mut(width.max(1))
            .enumerate()
            .for_each(|(y, out)| lit(y, light.row(y), light.row(y).as_flattened(), out));
    }
    out
}

/// exp(clamp(βR, −80, 80)); a ratio that is NaN counts as 0.
#[inline(always)]
fn relight(beta: f32, ratio: f32) -> f32 {
    let x = beta * ratio;
    let x = if x > -80.0 { x } else { -80.0 };
    let x = if x < 80.0 { x } else { 80.0 };
    math::exp(if ratio.is_nan() { 0.0 } else { x })
}

/// Pixels a block of [`light_row`].
const BLOCK: usize = 256;

#[multiversion(targets = "simd")]
fn light_row(light: &[[f32; 3]], blurred: &[f32], ratio: &[f32], recipe: &Recipe, out: &mut [[f32; 3]]) {
    let (blurred, _) = blurred.as_chunks::<3>();
    let mut planes = [[0.0f32; BLOCK]; 3];
    let mut details = [[0.0f32; BLOCK]; 3];
    let (beta, k, epsilon) = (recipe.beta, recipe.detail, recipe.epsilon);
    for start in (0..light.len()).step_by(BLOCK) {
        let n = BLOCK.min(light.len() - start);
        let (light, blurred, ratio) = (&light[start..][..n], &blurred[start..][..n], &ratio[start..][..n]);
        // Slices of one known length: bounds are checked once, and the loops vectorise.
        let [r, g, b] = &mut planes;
        let (r, g, b) = (&mut r[..n], &mut g[..n], &mut b[..n]);
        let [dr, dg, db] = &mut details;
        let (dr, dg, db) = (&mut dr[..n], &mut dg[..n], &mut db[..n]);
        for i in 0..n {
            let (l, s) = (light[i], blurred[i]);
            (r[i], g[i], b[i]) = (l[0], l[1], l[2]);
            (dr[i], dg[i], db[i]) = (k * (l[0] - s[0]), k * (l[1] - s[1]), k * (l[2] - s[2]));
        }
        for i in 0..n {
            let luminance = colour::luminance([r[i], g[i], b[i]]);
            let gain = luminance / (luminance + epsilon) * relight(beta, ratio[i]);
            // The largest light times the largest gain would be infinite.
            let cut = |x: f32| if x < colour::BRIGHTEST { x } else { colour::BRIGHTEST };
            (r[i], g[i], b[i]) = (cut(gain * r[i]), cut(gain * g[i]), cut(gain * b[i]));
        }
        match recipe.gamut {
            Gamut::Soft { knee } => {
                for i in 0..n {
                    let base = shoulder([r[i], g[i], b[i]], knee as f32);
                    [r[i], g[i], b[i]] = add_within(base, [dr[i], dg[i], db[i]]);
                }
            }
            Gamut::Clip => {
                for i in 0..n {
                    let base = [unit(r[i]), unit(g[i]), unit(b[i])];
                    [r[i], g[i], b[i]] = add_within(base, [dr[i], dg[i], db[i]]);
                }
            }
            Gamut::None => {
                for i in 0..n {
                    (r[i], g[i], b[i]) = (r[i] + dr[i], g[i] + dg[i], b[i] + db[i]);
                }
            }
        }
        for plane in &mut planes {
            for x in &mut plane[..n] {
                *x = colour::to_srgb(*x);
            }
        }
        let [r, g, b] = &planes;
        let pixels = r.iter().zip(g).zip(b);
        for (out, ((&r, &g), &b)) in out[start..][..n].iter_mut().zip(pixels) {
            *out = [r, g, b];
        }
    }
}

#[inline(always)]
fn add_within(base: [f32; 3], detail: [f32; 3]) -> [f32; 3] {
    let s = limiter(base, detail);
    let add = |b: f32, d: f32| unit(b + s * d); // leaves [0, 1] by rounding only
    [
        add(base[0], detail[0]),
        add(base[1], detail[1]),
        add(base[2], detail[2]),
    ]
}

/// A = I/(L + ε), sRGB-encoded; 0 where the painting is black.
pub fn albedo(light: &LinearImage, epsilon: f32) -> SrgbImage {
    let mut out: LinearImage = light.clone();
    out.data_mut().par_chunks_mut(1 << 13).for_each(|chunk| {
        for pixel in chunk {
            let divisor = colour::luminance(*pixel) + epsilon;
            *pixel = pixel.map(|c| c / divisor);
        }
    });
    Rgb::to_srgb(&out)
}

/// L_out = L·exp(βR); 0 where the painting is black. No ratio means β = 0.
pub fn luminance(light: &LinearImage, ratio: Option<&Field>, beta: f32) -> Field {
    let mut out = light.luminance();
    if let Some(ratio) = ratio {
        out.data_mut()
            .par_chunks_mut(1 << 13)
            .zip(ratio.data().par_chunks(1 << 13))
            .for_each(|(out, ratio)| {
                for (l, &r) in out.iter_mut().zip(ratio) {
                    *l = (*l * relight(beta, r)).min(colour::BRIGHTEST);
                }
            });
    }
    out
}
