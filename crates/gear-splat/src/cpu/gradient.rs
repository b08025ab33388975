//! Stage 5: from derivatives by pixels to derivatives by ellipses.
//!
//! At one pixel let C = Σ wᵢ cᵢ + T_end·b and A = Σ wᵢ = 1 − T_end, with wᵢ = αᵢ Tᵢ. A loss with derivatives g by C and
//! g_A by A sees Gaussian i through the scalar sᵢ = g·(cᵢ − b) + g_A, and
//!
//! ∂ℓ/∂αᵢ = Tᵢ sᵢ − Rᵢ / (1 − αᵢ),   Rᵢ = Σ_{j>i} wⱼ sⱼ = S − Σ_{j≤i} wⱼ sⱼ,   S = g·(C − b) + g_A·A.
//!
//! S is known from the pictures, so the second pass can walk front to back like the first, with the very same T, and
//! stop where the first stopped; walking backwards would have to divide T by 1 − α again and again.
//!
//! With h = α ∂ℓ/∂α (zero where α is held at 0.99, since it then depends on nothing), q = P_x e² + P_y d²,
//! e = x − m_x − k·d and d = y − m_y, every derivative of the ellipse is a moment of h:
//!
//! ∂ℓ/∂P_x = −½ Σ h e²,  ∂ℓ/∂k = P_x Σ h e d,  ∂ℓ/∂m_x = P_x Σ h e,  ∂ℓ/∂P_y = −½ Σ h d²,
//! ∂ℓ/∂m_y = P_y Σ h d − P_x k Σ h e,  ∂ℓ/∂(log opacity) = Σ h,  ∂ℓ/∂c = Σ w g.

use multiversion::multiversion;
use rayon::prelude::*;

use super::Frame;
use super::bin::{TILE_HEIGHT, TILE_WIDTH};
use super::blend::{CHECK_EVERY, clear_transmittance, is_finished};
use super::lanes::{self, LANE, LANES, PLANE_LEN, Plane, STRIDE, TileSplat};
use super::project::Splat;
use crate::render::{ALPHA_MAX, PixelGradients, Rendering, TRANSMITTANCE_MIN, Wanted};

/// Sums over the pixels of one Gaussian.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Sums {
    /// Σ w g.
    pub color: [f32; 3],
    /// Σ h, Σ h e, Σ h e², Σ h d, Σ h e d, Σ h d².
    pub moments: [f32; 6],
}

impl Sums {
    fn add(&mut self, other: &Self) {
        for (a, b) in self.color.iter_mut().zip(other.color) {
            *a += b;
        }
        for (a, b) in self.moments.iter_mut().zip(other.moments) {
            *a += b;
        }
    }
}

/// A tile's view of the loss.
struct TileLoss {
    transmittance: Plane,
    /// g.
    color: [Plane; 3],
    /// −g·b + g_A: what every Gaussian's sᵢ shares.
    offset: Plane,
    /// S, then Rᵢ.
    remaining: Plane,
}

#[derive(Clone, Copy)]
struct TileScene<'a> {
    splats: &'a [Splat],
    colors: &'a [[f32; 3]],
    list: &'a [u32],
    left: usize,
    top: usize,
    columns: usize,
    rows: usize,
}

/// The sums of every Gaussian, in scene order.
pub(crate) fn sum_tiles(frame: &Frame, rendering: &Rendering, pixels: &PixelGradients, wanted: Wanted) -> Vec<Sums> {
    let bins = &frame.bins;
    let grid = bins.grid;
    let rgb = rendering.rgb.as_ref().expect("colour was drawn").data();
    let alpha = rendering.alpha.as_ref().expect("coverage was drawn").data();
    assert_eq!(pixels.rgb.len(), rgb.len(), "one colour gradient a pixel");
    assert!(
        pixels.alpha.is_empty() || pixels.alpha.len() == rgb.len(),
        "one coverage gradient a pixel"
    );

    let mut by_entry = vec![Sums::default(); bins.entries.len()];
    split_by_rows(&mut by_entry, &bins.starts, grid.columns)
        .into_par_iter()
        .enumerate()
        .for_each(|(row, mut out)| {
            let mut loss = Box::new(TileLoss::new());
            for column in 0..grid.columns {
                let list = bins.tile(row * grid.columns + column);
                let (here, rest) = out.split_at_mut(list.len());
                out = rest;
                if list.is_empty() {
                    continue;
                }
                let scene = TileScene {
                    splats: &frame.splats,
                    colors: &frame.colors,
                    list,
                    left: column * TILE_WIDTH,
                    top: row * TILE_HEIGHT,
                    columns: TILE_WIDTH.min(grid.width - column * TILE_WIDTH),
                    rows: TILE_HEIGHT.min(grid.height - row * TILE_HEIGHT),
                };
                loss.load(&scene, grid.width, frame.background, rgb, alpha, pixels);
                match wanted {
                    Wanted::Color => sum_colors(scene, &mut loss, here),
                    Wanted::All => sum_everything(scene, &mut loss, here),
                }
            }
        });
    gather(&by_entry, &bins.entries, frame.splats.len())
}

/// The parts of `values` that belong to each row of tiles.
fn split_by_rows<'a, T>(mut values: &'a mut [T], starts: &[usize], columns: usize) -> Vec<&'a mut [T]> {
    let mut parts = Vec::new();
    for bounds in starts.windows(columns + 1).step_by(columns.max(1)) {
        let (here, rest) = values.split_at_mut(bounds[columns] - bounds[0]);
        parts.push(here);
        values = rest;
    }
    parts
}

/// Adds up the entries of each Gaussian, in tile order. Each task owns a range of Gaussians and reads all entries:
/// reading a list of numbers is cheap beside a second index.
fn gather(by_entry: &[Sums], entries: &[u32], count: usize) -> Vec<Sums> {
    let mut total = vec![Sums::default(); count];
    let range = count.div_ceil(rayon::current_num_threads().min(8)).max(4096);
    total.par_chunks_mut(range).enumerate().for_each(|(part, total)| {
        let first = part * range;
        for (&i, sums) in entries.iter().zip(by_entry) {
            if let Some(total) = (i as usize).checked_sub(first).and_then(|at| total.get_mut(at)) {
                total.add(sums);
            }
        }
    });
    total
}

#[multiversion(targets = "simd")]
fn sum_colors(scene: TileScene, loss: &mut TileLoss, out: &mut [Sums]) {
    accumulate::<false>(scene, loss, out);
}

#[multiversion(targets = "simd")]
fn sum_everything(scene: TileScene, loss: &mut TileLoss, out: &mut [Sums]) {
    accumulate::<true>(scene, loss, out);
}

/// Walks the tile's list as `blend` does. `SHAPE`: the moments too.
#[inline(always)]
fn accumulate<const SHAPE: bool>(scene: TileScene, loss: &mut TileLoss, out: &mut [Sums]) {
    let TileLoss {
        transmittance,
        color: [red, green, blue],
        offset,
        remaining,
    } = loss;
    for (n, (&i, out)) in scene.list.iter().zip(out).enumerate() {
        if n % CHECK_EVERY == CHECK_EVERY - 1 && is_finished(transmittance) {
            return;
        }
        let i = i as usize;
        let splat = scene.splats[i];
        let color = scene.colors[i];
        let seen = TileSplat::new(&splat, scene.left, scene.top, scene.rows);
        let mut by_color = [[0.0; LANES]; 3];
        let mut moments = [[0.0; LANES]; 6];
        let [by_r, by_g, by_b] = &mut by_color;
        let [m_0, m_e, m_ee, m_d, m_ed, m_dd] = &mut moments;
        for y in seen.rows() {
            let Some(span) = seen.row(y, scene.columns) else {
                continue;
            };
            let dy = span.dy;
            let mut x = span.first;
            while x <= span.last {
                let at = y * STRIDE + x;
                let start = x as f32 - span.middle;
                x += LANES;
                let t = lanes::at(transmittance, at);
                if lanes::all_below(t, TRANSMITTANCE_MIN) {
                    continue;
                }
                let (g_r, g_g, g_b) = (lanes::at(red, at), lanes::at(green, at), lanes::at(blue, at));
                let (shared, rest) = (lanes::at(offset, at), lanes::at(remaining, at));
                for l in 0..LANES {
                    let e = start + LANE[l];
                    let before = t[l];
                    let alpha = lanes::alpha(&splat, &span, e, before);
                    let weight = alpha * before;
                    t[l] = before * (1.0 - alpha);
                    let (g_r, g_g, g_b) = (g_r[l], g_g[l], g_b[l]);
                    by_r[l] += weight * g_r;
                    by_g[l] += weight * g_g;
                    by_b[l] += weight * g_b;
                    if SHAPE {
                        let s = weight * (g_r * color[0] + g_g * color[1] + g_b * color[2] + shared[l]);
                        let after = rest[l] - s;
                        rest[l] = after;
                        let slope = s - after * (alpha / (1.0 - alpha));
                        let h = if alpha < ALPHA_MAX { slope } else { 0.0 };
                        let (h_e, h_d) = (h * e, h * dy);
                        m_0[l] += h;
                        m_e[l] += h_e;
                        m_ee[l] += h_e * e;
                        m_d[l] += h_d;
                        m_ed[l] += h_e * dy;
                        m_dd[l] += h_d * dy;
                    }
                }
            }
        }
        out.color = by_color.map(lanes::sum);
        if SHAPE {
            out.moments = moments.map(lanes::sum);
        }
    }
}

impl TileLoss {
    fn new() -> Self {
        const ZERO: Plane = [0.0; PLANE_LEN];
        Self {
            transmittance: ZERO,
            color: [ZERO; 3],
            offset: ZERO,
            remaining: ZERO,
        }
    }

    /// Reads a tile. Padding keeps zeros: with T = 0 it is never looked at.
    fn load(
        &mut self,
        scene: &TileScene,
        width: usize,
        background: [f32; 3],
        rgb: &[[f32; 3]],
        alpha: &[f32],
        pixels: &PixelGradients,
    ) {
        clear_transmittance(&mut self.transmittance, scene.columns, scene.rows);
        for y in 0..scene.rows {
            for x in 0..scene.columns {
                let at = y * STRIDE + x;
                let from = (scene.top + y) * width + scene.left + x;
                let g = pixels.rgb[from];
                let by_alpha = pixels.alpha.get(from).copied().unwrap_or(0.0);
                let (mut ground, mut shown) = (0.0, 0.0);
                for c in 0..3 {
                    self.color[c][at] = g[c];
                    ground += g[c] * background[c];
                    shown += g[c] * (rgb[from][c] - background[c]);
                }
                self.offset[at] = by_alpha - ground;
                self.remaining[at] = shown + by_alpha * alpha[from];
            }
        }
    }
}
