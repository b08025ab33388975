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
//! Expected depth D = Σ wᵢ zᵢ / W with W = Σ wᵢ, and the normal n = N/|N| with N = Σ wᵢ nᵢ, add g_D (zᵢ − D)/W and
//! (g_n − n (n·g_n))/|N| · nᵢ to sᵢ. Both terms sum to zero over the Gaussians of the pixel (D is the mean of the zᵢ, and
//! what g_n has across n is at right angles to N), so that S stays as it was. W and |N| are blended anew, in
//! the tile's buffers, only when such a gradient is given.
//!
//! With h = α ∂ℓ/∂α (zero where α is held at 0.99, since it then depends on nothing), q = P_x e² + P_y d²,
//! e = x − m_x − k·d and d = y − m_y, every derivative of the ellipse is a moment of h:
//!
//! ∂ℓ/∂P_x = −½ Σ h e²,  ∂ℓ/∂k = P_x Σ h e d,  ∂ℓ/∂m_x = P_x Σ h e,  ∂ℓ/∂P_y = −½ Σ h d²,
//! ∂ℓ/∂m_y = P_y Σ h d − P_x k Σ h e,  ∂ℓ/∂(log opacity) = Σ h,  ∂ℓ/∂c = Σ w g,
//!
//! and with u = w g_D / W, every derivative of the surfel's plane z = z₀ + clamp(k_x (x − m_x) + k_y d, ±reach) is a
//! moment of u. The sums of a Gaussian's tiles are added in the order of the tiles.

use rayon::prelude::*;

use super::Frame;
use super::blend::{self, CHECK_EVERY, TileBuffers, TileScene, is_finished};
use super::lanes::{self, HALF, LANE, LANES, Lanes, PLANE_LEN, Plane, STRIDE};
use super::project::Splat;
use super::simd::simd_kernels;
use super::spans::Span;
use super::surface::Surface;
use crate::render::{ALPHA_MAX, Outputs, PixelGradients, Rendering, TRANSMITTANCE_MIN, Wanted};

/// Sums over the pixels of one Gaussian.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Sums {
    /// Σ w g.
    pub color: [f32; 3],
    /// Σ h, Σ h e, Σ h e², Σ h d, Σ h e d, Σ h d².
    pub moments: [f32; 6],
}

/// Sums over the pixels of one Gaussian that depth and normals ask for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SurfaceSums {
    /// Σ u.
    pub depth: f32,
    /// Σ u over pixels where the plane is held at +reach, less those where it is held at −reach.
    pub reach: f32,
    /// Σ u, Σ u (x − m_x), Σ u (y − m_y) over the other pixels.
    pub plane: [f32; 3],
    /// Σ w ∂ℓ/∂N.
    pub normal: [f32; 3],
}

/// The sums of every seen Gaussian, front to back.
pub(crate) struct Gathered {
    pub sums: Vec<Sums>,
    /// Empty unless depth or normals have gradients.
    pub surfaces: Vec<SurfaceSums>,
}

/// A tile's view of the loss.
#[repr(align(64))]
struct TileLoss {
    transmittance: Plane,
    /// g.
    color: [Plane; 3],
    /// −g·b + g_A: what every Gaussian's sᵢ shares.
    offset: Plane,
    /// S, then Rᵢ.
    remaining: Plane,
    /// g_D / W, and D behind the tile's foremost Gaussian.
    depth: [Plane; 2],
    /// ∂ℓ/∂N.
    normal: [Plane; 3],
    forward: Box<TileBuffers>,
}

/// What a strip of a tile finds: the sums of the front of its list, as far as it was walked.
#[derive(Default)]
struct Strip {
    tile: usize,
    sums: Vec<Sums>,
    surfaces: Vec<SurfaceSums>,
}

/// The sums of all seen Gaussians.
pub(crate) fn sum_tiles(frame: &Frame, rendering: &Rendering, pixels: &PixelGradients, wanted: Wanted) -> Gathered {
    let bins = &frame.bins;
    let grid = bins.grid;
    pixels.check(grid.width * grid.height);
    let through_surface = !pixels.depth.is_empty() || !pixels.normal.is_empty();
    let colors = frame.needs_color_sums(wanted);
    if !colors && !wanted.moves_shapes() {
        return Gathered {
            sums: vec![Sums::default(); frame.splats.len()],
            surfaces: Vec::new(),
        };
    }
    let strips: Vec<(usize, (usize, usize))> = (0..grid.columns * grid.rows)
        .filter(|&tile| !bins.tile(tile).is_empty())
        .flat_map(|tile| bins.strips(tile).map(move |rows| (tile, rows)))
        .collect();
    let found: Vec<Strip> = strips
        .into_par_iter()
        .map_init(TileLoss::new, |loss, (tile, rows)| {
            let scene = TileScene::new(frame, tile, rows);
            loss.load(frame, &scene, rendering, pixels);
            let mut strip = Strip {
                tile,
                ..Strip::default()
            };
            let kernel = match (colors, wanted.moves_shapes(), through_surface) {
                (_, false, _) => sum_colors,
                (false, true, false) => sum_shapes,
                (true, true, false) => sum_everything,
                (false, true, true) => sum_surfaces,
                (true, true, true) => sum_with_surfaces,
            };
            kernel(frame.level, scene, loss, &mut strip);
            strip
        })
        .collect();
    Gathered {
        sums: gather(frame, &found, |strip| &strip.sums, Sums::add),
        surfaces: if through_surface && wanted.moves_shapes() {
            gather(frame, &found, |strip| &strip.surfaces, SurfaceSums::add)
        } else {
            Vec::new()
        },
    }
}

/// Adds up the entries of each Gaussian, in the order of strips. Each task owns a range of Gaussians; a list is
/// in order, so that its part is found by bisection.
fn gather<T: Copy + Default + Send + Sync>(
    frame: &Frame,
    found: &[Strip],
    part: impl Fn(&Strip) -> &[T] + Sync,
    add: impl Fn(&mut T, &T) + Sync,
) -> Vec<T> {
    let mut total = vec![T::default(); frame.splats.len()];
    let range = total.len().div_ceil(4 * rayon::current_num_threads()).max(1024);
    total.par_chunks_mut(range).enumerate().for_each(|(chunk, total)| {
        let first = (chunk * range) as u32;
        let end = first + total.len() as u32;
        for strip in found {
            let sums = part(strip);
            let list = &frame.bins.tile(strip.tile)[..sums.len()];
            let from = list.partition_point(|&i| i < first);
            let to = list.partition_point(|&i| i < end);
            for (&i, sum) in list[from..to].iter().zip(&sums[from..to]) {
                add(&mut total[(i - first) as usize], sum);
            }
        }
    });
    total
}

simd_kernels! {
    fn sum_colors(scene: TileScene, loss: &mut TileLoss, out: &mut Strip) {
        accumulate::<true, false, false>(scene, loss, out);
    }
    fn sum_shapes(scene: TileScene, loss: &mut TileLoss, out: &mut Strip) {
        accumulate::<false, true, false>(scene, loss, out);
    }
    fn sum_everything(scene: TileScene, loss: &mut TileLoss, out: &mut Strip) {
        accumulate::<true, true, false>(scene, loss, out);
    }
    fn sum_surfaces(scene: TileScene, loss: &mut TileLoss, out: &mut Strip) {
        accumulate::<false, true, true>(scene, loss, out);
    }
    fn sum_with_surfaces(scene: TileScene, loss: &mut TileLoss, out: &mut Strip) {
        accumulate::<true, true, true>(scene, loss, out);
    }
}

/// Walks the tile's list as `blend` does. `COLOR`: sums for colours; `SHAPE`: the moments; `SURFACE`: depth and normals have
/// gradients. What is frozen is not added up.
#[inline(always)]
fn accumulate<const COLOR: bool, const SHAPE: bool, const SURFACE: bool>(
    scene: TileScene,
    loss: &mut TileLoss,
    out: &mut Strip,
) {
    for (n, &i) in scene.list.iter().enumerate() {
        if n % CHECK_EVERY == CHECK_EVERY - 1 && is_finished(&loss.transmittance) {
            return;
        }
        let i = i as usize;
        let splat = scene.splats[i];
        let color = scene.colors.get(i).copied().unwrap_or_default();
        let surface = if SURFACE { scene.surfaces[i] } else { Surface::default() };
        let spans = scene.spans(&splat);
        let mut sums = LaneSums::default();
        for y in spans.rows.clone() {
            let span = spans.row(y);
            let from_center = span.middle - spans.mean[0];
            let stroke = Stroke {
                splat,
                span,
                color,
                surface,
                from_center,
                row_offset: surface.slope[1] * span.dy + surface.slope[0] * from_center,
                behind: surface.depth - scene.foremost,
            };
            let mut x = span.first;
            while x < span.end {
                let at = y * STRIDE + x;
                let start = x as f32 - span.middle;
                if span.end - x > HALF {
                    group::<LANES, COLOR, SHAPE, SURFACE>(&stroke, at, start, loss, &mut sums);
                    x += LANES;
                } else {
                    group::<HALF, COLOR, SHAPE, SURFACE>(&stroke, at, start, loss, &mut sums);
                    x += HALF;
                }
            }
        }
        out.sums.push(Sums {
            color: if COLOR { sums.color.map(lanes::sum) } else { [0.0; 3] },
            moments: if SHAPE { sums.moments.map(lanes::sum) } else { [0.0; 6] },
        });
        if SURFACE {
            let [depth, reach, plane @ ..] = sums.plane.map(lanes::sum);
            out.surfaces.push(SurfaceSums {
                depth,
                reach,
                plane,
                normal: sums.normal.map(lanes::sum),
            });
        }
    }
}

/// One Gaussian in one row.
#[derive(Clone, Copy)]
struct Stroke {
    splat: Splat,
    span: Span,
    color: [f32; 3],
    surface: Surface,
    /// Column of the middle of the span, from the centre's.
    from_center: f32,
    /// Offset of the surfel's plane there.
    row_offset: f32,
    /// Depth of its centre behind the tile's foremost.
    behind: f32,
}

/// [`Sums`] and [`SurfaceSums`] by lane.
#[derive(Default)]
struct LaneSums {
    color: [Lanes; 3],
    moments: [Lanes; 6],
    plane: [Lanes; 5],
    normal: [Lanes; 3],
}

/// `N` pixels from place `at` of the tile's planes on, which lies `start` from the middle of the span.
#[inline(always)]
fn group<const N: usize, const COLOR: bool, const SHAPE: bool, const SURFACE: bool>(
    stroke: &Stroke,
    at: usize,
    start: f32,
    loss: &mut TileLoss,
    sums: &mut LaneSums,
) {
    let mut t = lanes::load::<N>(&loss.transmittance, at);
    if lanes::all_below(&t, TRANSMITTANCE_MIN) {
        return;
    }
    let Stroke { color, surface, .. } = *stroke;
    let dy = stroke.span.dy;
    let [g_r, g_g, g_b] = [0, 1, 2].map(|c| lanes::load::<N>(&loss.color[c], at));
    let (shared, mut rest) = (
        lanes::load::<N>(&loss.offset, at),
        lanes::load::<N>(&loss.remaining, at),
    );
    let [g_z, z_mean] = [0, 1].map(|c| lanes::load::<N>(&loss.depth[c], at));
    let [g_nx, g_ny, g_nz] = [0, 1, 2].map(|c| lanes::load::<N>(&loss.normal[c], at));
    let [by_r, by_g, by_b] = &mut sums.color;
    let [m_0, m_e, m_ee, m_d, m_ed, m_dd] = &mut sums.moments;
    let [u_all, u_reach, u_0, u_x, u_y] = &mut sums.plane;
    let [s_nx, s_ny, s_nz] = &mut sums.normal;
    for l in 0..N {
        let e = start + LANE[l];
        let before = t[l];
        let alpha = lanes::alpha(&stroke.splat, &stroke.span, e, before);
        let weight = alpha * before;
        t[l] = before - weight;
        if COLOR {
            by_r[l] += weight * g_r[l];
            by_g[l] += weight * g_g[l];
            by_b[l] += weight * g_b[l];
        }
        if SHAPE {
            let mut s = g_r[l] * color[0] + g_g[l] * color[1] + g_b[l] * color[2] + shared[l];
            if SURFACE {
                let plane = stroke.row_offset + surface.slope[0] * e;
                let offset = surface.offset(plane);
                s += g_z[l] * (stroke.behind + offset - z_mean[l]);
                s += g_nx[l] * surface.normal[0] + g_ny[l] * surface.normal[1] + g_nz[l] * surface.normal[2];
                let u = weight * g_z[l];
                let held = plane != offset;
                let free = if held { 0.0 } else { u };
                let signed = if offset > 0.0 { u } else { -u };
                u_all[l] += u;
                u_reach[l] += if held { signed } else { 0.0 };
                u_0[l] += free;
                u_x[l] += free * (e + stroke.from_center);
                u_y[l] += free * dy;
                s_nx[l] += weight * g_nx[l];
                s_ny[l] += weight * g_ny[l];
                s_nz[l] += weight * g_nz[l];
            }
            let s = weight * s;
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
    lanes::store(&mut loss.transmittance, at, &t);
    if SHAPE {
        lanes::store(&mut loss.remaining, at, &rest);
    }
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

    /// True when the loss does not see the Gaussian.
    pub fn is_zero(&self) -> bool {
        *self == Self::default()
    }
}

impl SurfaceSums {
    fn add(&mut self, other: &Self) {
        self.depth += other.depth;
        self.reach += other.reach;
        for (a, b) in self.plane.iter_mut().zip(other.plane) {
            *a += b;
        }
        for (a, b) in self.normal.iter_mut().zip(other.normal) {
            *a += b;
        }
    }
}

impl TileLoss {
    fn new() -> Box<Self> {
        const ZERO: Plane = [0.0; PLANE_LEN];
        Box::new(Self {
            transmittance: ZERO,
            color: [ZERO; 3],
            offset: ZERO,
            remaining: ZERO,
            depth: [ZERO; 2],
            normal: [ZERO; 3],
            forward: TileBuffers::new(),
        })
    }

    /// Reads a tile. Padding keeps what it has: with T = 0 it is never looked at.
    fn load(&mut self, frame: &Frame, scene: &TileScene, rendering: &Rendering, pixels: &PixelGradients) {
        let width = frame.bins.grid.width;
        scene.clear_transmittance(&mut self.transmittance);
        let rgb = rendering.rgb.as_ref().map_or(&[][..], |p| p.data());
        let alpha = rendering.alpha.as_ref().map_or(&[][..], |p| p.data());
        for y in scene.rows.0..scene.rows.1 {
            let row = y * STRIDE;
            let from = (scene.top + y) * width + scene.left;
            for x in 0..scene.columns {
                let (at, from) = (row + x, from + x);
                let g = pixels.rgb.get(from).copied().unwrap_or_default();
                let by_alpha = pixels.alpha.get(from).copied().unwrap_or_default();
                let (mut ground, mut shown) = (0.0, 0.0);
                for c in 0..3 {
                    self.color[c][at] = g[c];
                    ground += g[c] * frame.background[c];
                    shown += g[c] * (rgb.get(from).map_or(0.0, |p| p[c]) - frame.background[c]);
                }
                self.offset[at] = by_alpha - ground;
                self.remaining[at] = shown + by_alpha * alpha.get(from).copied().unwrap_or_default();
            }
        }
        let (depth, normal) = (!pixels.depth.is_empty(), !pixels.normal.is_empty());
        if depth || normal {
            self.load_surfaces(frame, scene, pixels, depth, normal);
        }
    }

    /// Blends the tile's depth and normals again: their sums, not their means, are what derivatives need.
    fn load_surfaces(&mut self, frame: &Frame, scene: &TileScene, pixels: &PixelGradients, depth: bool, normal: bool) {
        let width = frame.bins.grid.width;
        let outputs = Outputs {
            depth,
            normal,
            ..Outputs::default()
        };
        self.forward.clear(outputs, scene);
        blend::kernel(outputs)(frame.level, *scene, &mut self.forward);
        for y in scene.rows.0..scene.rows.1 {
            for x in 0..scene.columns {
                let at = y * STRIDE + x;
                let from = (scene.top + y) * width + scene.left + x;
                // A pixel that nothing covers has neither depth nor normal, and no derivative.
                let weight = 1.0 - self.forward.transmittance[at];
                let seen = depth && weight > 0.0;
                self.depth[0][at] = if seen { pixels.depth[from] / weight } else { 0.0 };
                self.depth[1][at] = if seen { self.forward.depth[at] / weight } else { 0.0 };
                let sum: [f32; 3] = std::array::from_fn(|c| self.forward.normal[c][at]);
                let length = blend::length(sum);
                let seen = normal && length > 0.0;
                let g = if seen { pixels.normal[from] } else { [0.0; 3] };
                let unit = if seen { sum.map(|x| x / length) } else { [0.0; 3] };
                let along = g[0] * unit[0] + g[1] * unit[1] + g[2] * unit[2];
                for c in 0..3 {
                    self.normal[c][at] = if seen { (g[c] - along * unit[c]) / length } else { 0.0 };
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::tests::one;
    use crate::{Camera, RenderOptions, Scene};
    use glam::Vec3;

    #[test]
    fn what_is_frozen_is_not_added_up() {
        let mut scene = Scene::default();
        (0..20).for_each(|i| scene.push(one(Vec3::new(0.02 * i as f32, 0.1, 0.03 * i as f32))));
        let frame = Frame::new(&scene, &Camera::front(40, 40), &RenderOptions::default(), Outputs::ALL);
        let picture = frame.draw();
        let pixels = PixelGradients {
            rgb: vec![[1.0, -0.5, 0.25]; 1600],
            depth: vec![0.5; 1600],
            ..PixelGradients::default()
        };
        let sums = |wanted| sum_tiles(&frame, &picture, &pixels, wanted);
        let all = sums(Wanted::ALL);
        let shapes = sums(Wanted {
            colors: false,
            ..Wanted::ALL
        });
        let colors = sums(Wanted::COLORS);
        assert!(all.sums.iter().any(|s| s.color[0] != 0.0 && s.moments[3] != 0.0));
        for ((all, shapes), colors) in all.sums.iter().zip(&shapes.sums).zip(&colors.sums) {
            assert_eq!((shapes.color, shapes.moments), ([0.0; 3], all.moments));
            assert_eq!((colors.color, colors.moments), (all.color, [0.0; 6]));
        }
        assert!(all.surfaces == shapes.surfaces && colors.surfaces.is_empty());
        let nothing = Wanted {
            colors: false,
            ..Wanted::COLORS
        };
        assert!(sums(nothing).sums.iter().all(Sums::is_zero));
    }
}
