//! Stage 1: every Gaussian becomes an ellipse on the screen (EWA splatting; Zwicker 2001, Kerbl 2023).
//!
//! With camera-space axes m_k and standard deviations s_k, and the projection's Jacobian J, the screen covariance is
//! Σ = Σ_k s_k² t_k t_kᵀ + δ·1, where t_k = J m_k. It is computed in f64: a needle's determinant cancels far more
//! than f32 holds. The determinant before dilation is taken in product form (Cauchy–Binet),
//! det₀ = Σ_{k<l} s_k² s_l² (t_k × t_l)², so that det = det₀ + δ·tr + δ² never cancels.
//!
//! The ellipse is kept as (mean, shear, precision_x, precision_y, peak) with
//! log₂ α = peak − precision_x · (x − mx − shear·(y − my))² − precision_y · (y − my)²: along a row only the first
//! square changes, and it is exact in f32 even for diagonal needles, where A·dx² + 2B·dx·dy + C·dy² cancels. The
//! powers are of two because the hardware's are, and the opacity is one of them: a pixel costs no factor for it.
//!
//! Eight Gaussians are projected at a time. [`View::footprint`] has no branch, so that the loop over them is one loop over
//! vectors of f64; the backward pass calls the same function for one.

use glam::{DMat3, DQuat, DVec2, DVec3};
use rayon::prelude::*;

use super::math;
use super::simd::{SimdLevel, simd_kernels};
use super::sort::Key;
use super::surface::{self, Surface};
use crate::render::{ALPHA_MIN_LOG2, Counts, REACH_SIGMAS, ScreenFilter};
use crate::{Camera, Projection, RenderOptions, Scene};

/// Screen standard deviations are held below this, so that everything stays finite in f32.
pub(crate) const SIGMA_MAX: f64 = 1e30;
/// Logarithms of standard deviations are held within this: variances stay within 1e±60, and their products normal.
const LOG_SCALE_MAX: f64 = 69.0;
/// Logits are held within this before anything else: opacity 1 and 0 are then exact in f32, and nothing overflows.
pub(crate) const LOGIT_MAX: f64 = 80.0;
/// Gaussians of one task: few enough that two threads end at about the same time in a scene of twenty thousand.
const CHUNK: usize = 1024;
/// Gaussians projected together.
const BLOCK: usize = 8;
/// ½ log₂ e: from q to halvings of α.
const HALVINGS: f64 = 0.5 * std::f64::consts::LOG2_E;

/// A Gaussian on the screen, in pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Splat {
    /// Centre.
    pub mean: [f32; 2],
    /// Σxy / Σyy: how far the centre of a row moves with y.
    pub shear: f32,
    /// ½ log₂e / (Σxx − Σxy²/Σyy): the inverse variance along a row.
    pub precision_x: f32,
    /// ½ log₂e / Σyy.
    pub precision_y: f32,
    /// 1 / √precision_x.
    pub sigma_x: f32,
    /// log₂ of the opacity at the centre.
    pub peak: f32,
    /// Half the width and height of the ellipse α ≥ 1/255.
    pub half: [f32; 2],
}

impl Splat {
    #[cfg(test)]
    pub fn of(mean: [f32; 2], shear: f32, px: f32, py: f32, opacity: f32) -> Self {
        let (px, py) = (f64::from(px) * HALVINGS, f64::from(py) * HALVINGS);
        let peak = libm::log2(f64::from(opacity));
        let rest = peak - f64::from(ALPHA_MIN_LOG2);
        let half_y = (rest / py).sqrt();
        let half_x = (rest / px + (f64::from(shear) * half_y) * (f64::from(shear) * half_y)).sqrt();
        Self {
            mean,
            shear,
            precision_x: px as f32,
            precision_y: py as f32,
            sigma_x: (1.0 / px.sqrt()) as f32,
            peak: peak as f32,
            half: [half_x as f32, half_y as f32],
        }
    }
}

/// The camera in f64, once for all Gaussians.
#[derive(Clone, Copy)]
pub(crate) struct View {
    pub rotation: DMat3,
    translation: DVec3,
    principal: DVec2,
    pinhole: bool,
    /// Focal length, or pixels a world unit.
    scale: f64,
    limit: [f64; 2],
    near: f64,
    size: [f64; 2],
    pub filter: ScreenFilter,
}

/// One Gaussian seen by a [`View`], with what the chain rule needs again.
#[derive(Clone, Copy)]
pub(crate) struct Footprint {
    /// Centre in camera space.
    pub point: DVec3,
    /// Camera-space unit axes.
    pub axes: [DVec3; 3],
    /// Squared standard deviations.
    pub variances: [f64; 3],
    /// Projected axes t_k, pixels a world unit.
    pub spread: [DVec2; 3],
    /// Pixel coordinates of the centre.
    pub mean: DVec2,
    /// Σxx, Σxy, Σyy with the dilation.
    pub covariance: [f64; 3],
    /// det before the dilation, and after.
    pub determinants: [f64; 2],
}

impl View {
    pub fn new(camera: &Camera, options: &RenderOptions) -> Self {
        let (pinhole, scale) = match camera.projection {
            Projection::Orthographic { pixels_per_unit } => (false, pixels_per_unit),
            Projection::Pinhole { focal_px } => (true, focal_px),
        };
        Self {
            rotation: camera.rotation.as_dmat3(),
            translation: camera.translation.as_dvec3(),
            principal: DVec2::new(f64::from(camera.principal[0]), f64::from(camera.principal[1])),
            pinhole,
            scale: f64::from(scale),
            limit: camera.jacobian_limit().map(f64::from),
            near: f64::from(options.near).max(1e-12),
            size: [f64::from(camera.width), f64::from(camera.height)],
            filter: options.filter,
        }
    }

    pub fn is_pinhole(&self) -> bool {
        self.pinhole
    }

    /// Scale s and clamped slopes x/z, y/z of J = [s 0 −s·tx; 0 s −s·ty]. Orthographic: (s, 0, 0).
    #[inline(always)]
    pub fn linearised(&self, p: DVec3) -> (f64, [f64; 2]) {
        if self.pinhole {
            let hold = |x: f64, most: f64| {
                let x = if x < most { x } else { most };
                if x > -most { x } else { -most }
            };
            let inverse = 1.0 / p.z;
            let slopes = [hold(p.x * inverse, self.limit[0]), hold(p.y * inverse, self.limit[1])];
            (self.scale * inverse, slopes)
        } else {
            (self.scale, [0.0; 2])
        }
    }

    /// Whether the slopes of [`View::linearised`] are inside the clamp, so that they still change with the centre.
    pub fn inside_limit(&self, p: DVec3) -> [bool; 2] {
        [(p.x / p.z).abs() <= self.limit[0], (p.y / p.z).abs() <= self.limit[1]]
    }

    /// The ellipse of a Gaussian, whether or not it can be seen.
    #[inline(always)]
    pub fn footprint(&self, center: DVec3, log_scale: DVec3, q: DQuat) -> Footprint {
        let point = self.rotation * center + self.translation;
        let (s, slopes) = self.linearised(point);
        let mean = self.principal + DVec2::new(point.x * s, point.y * s);
        let [a, b, c] = rotation_columns(q);
        let axes = [self.rotation * a, self.rotation * b, self.rotation * c];
        let hold = |x: f64| {
            let x = if x < LOG_SCALE_MAX { x } else { LOG_SCALE_MAX };
            if x > -LOG_SCALE_MAX { x } else { -LOG_SCALE_MAX }
        };
        let variance = |log_scale: f64| math::exp(2.0 * hold(log_scale));
        let variances = [variance(log_scale.x), variance(log_scale.y), variance(log_scale.z)];
        let seen = |m: DVec3| DVec2::new(s * (m.x - slopes[0] * m.z), s * (m.y - slopes[1] * m.z));
        let spread = [seen(axes[0]), seen(axes[1]), seen(axes[2])];

        let [mut xx, mut xy, mut yy] = [0.0; 3];
        for k in 0..3 {
            xx += variances[k] * spread[k].x * spread[k].x;
            xy += variances[k] * spread[k].x * spread[k].y;
            yy += variances[k] * spread[k].y * spread[k].y;
        }
        let mut before = 0.0;
        for (k, l) in [(0, 1), (0, 2), (1, 2)] {
            let area = spread[k].perp_dot(spread[l]);
            before += variances[k] * variances[l] * area * area;
        }
        let delta = self.filter.variance();
        Footprint {
            point,
            axes,
            variances,
            spread,
            mean,
            covariance: [xx + delta, xy, yy + delta],
            determinants: [before, before + delta * (xx + yy) + delta * delta],
        }
    }

    pub fn footprint_of(&self, scene: &Scene, i: usize) -> Footprint {
        self.footprint(
            scene.centers[i].as_dvec3(),
            scene.log_scales[i].as_dvec3(),
            scene.rotations[i].as_dquat(),
        )
    }

    /// How much of the opacity the filter leaves.
    #[inline(always)]
    fn compensation(&self, footprint: &Footprint) -> f64 {
        match self.filter {
            ScreenFilter::Dilate(_) => 1.0,
            ScreenFilter::AntiAlias(_) => {
                let [before, after] = footprint.determinants;
                (before / after).sqrt()
            }
        }
    }

    /// Entry `l` of a block.
    #[inline(always)]
    fn project<const PLANE: bool>(&self, block: &Block, l: usize, out: &mut Projected) {
        let vector = |v: &[[f64; BLOCK]; 3]| DVec3::new(v[0][l], v[1][l], v[2][l]);
        let [x, y, z, w] = &block.rotation;
        let q = DQuat::from_xyzw(x[l], y[l], z[l], w[l]);
        let log_scale = vector(&block.log_scale);
        let footprint = self.footprint(vector(&block.center), log_scale, q);
        let opacity = 1.0 / (1.0 + math::exp(-block.logit[l])) * self.compensation(&footprint);
        // ln needs a normal number; what is that faint is left out anyway.
        let peak = math::ln(if opacity > 1e-30 { opacity } else { 1e-30 }) * std::f64::consts::LOG2_E;
        let rest = peak - f64::from(ALPHA_MIN_LOG2);
        let reach = (if rest > 0.0 { rest } else { 0.0 }) * (1.0 / HALVINGS);

        let [xx, xy, yy] = footprint.covariance;
        let determinant = footprint.determinants[1];
        let inverse = 1.0 / yy;
        let half = [(reach * xx).sqrt(), (reach * yy).sqrt()];
        let mut inside = true;
        for (axis, mean) in [(0, footprint.mean.x), (1, footprint.mean.y)] {
            inside &= (mean + half[axis] >= 0.0) & (mean - half[axis] <= self.size[axis] - 1.0);
        }
        let sigma = (determinant * inverse * (1.0 / HALVINGS)).sqrt();
        out.mean[0][l] = footprint.mean.x as f32;
        out.mean[1][l] = footprint.mean.y as f32;
        out.shear[l] = (xy * inverse) as f32;
        out.precision_x[l] = (HALVINGS * yy / determinant) as f32;
        out.precision_y[l] = (HALVINGS * inverse) as f32;
        out.sigma_x[l] = (if sigma < SIGMA_MAX { sigma } else { SIGMA_MAX }) as f32;
        out.peak[l] = peak as f32;
        out.half[0][l] = (if half[0] < SIGMA_MAX { half[0] } else { SIGMA_MAX }) as f32;
        out.half[1][l] = (if half[1] < SIGMA_MAX { half[1] } else { SIGMA_MAX }) as f32;
        out.depth[l] = footprint.point.z as f32;
        if PLANE {
            out.plane(l, self, &footprint, log_scale);
        }
        // What f32 cannot hold is as far outside as can be.
        let sizes = out.mean[0][l].abs() + out.mean[1][l].abs() + out.shear[l].abs() + out.precision_x[l];
        inside &= sizes + out.depth[l].abs() < f32::INFINITY;
        // The first cause that applies.
        let behind = self.pinhole & (footprint.point.z < self.near);
        let fate = if inside { SEEN } else { OUTSIDE };
        let fate = if rest >= 0.0 { fate } else { TRANSPARENT };
        out.fate[l] = if behind { BEHIND } else { fate };
    }
}

/// The columns of a quaternion's rotation matrix; the quaternion may have any length but zero.
#[inline(always)]
fn rotation_columns(q: DQuat) -> [DVec3; 3] {
    let s = 2.0 / (q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    let (xx, yy, zz) = (q.x * q.x * s, q.y * q.y * s, q.z * q.z * s);
    let (xy, xz, yz) = (q.x * q.y * s, q.x * q.z * s, q.y * q.z * s);
    let (wx, wy, wz) = (q.w * q.x * s, q.w * q.y * s, q.w * q.z * s);
    [
        DVec3::new(1.0 - (yy + zz), xy + wz, xz - wy),
        DVec3::new(xy - wz, 1.0 - (xx + zz), yz + wx),
        DVec3::new(xz + wy, yz - wx, 1.0 - (xx + yy)),
    ]
}

const SEEN: u32 = 0;
const OUTSIDE: u32 = 1;
const TRANSPARENT: u32 = 2;
const BEHIND: u32 = 3;
const INVALID: u32 = 4;

/// The attributes of a few Gaussians, one array a component.
#[derive(Default)]
struct Block {
    center: [[f64; BLOCK]; 3],
    log_scale: [[f64; BLOCK]; 3],
    rotation: [[f64; BLOCK]; 4],
    logit: [f64; BLOCK],
}

impl Block {
    fn set(&mut self, l: usize, scene: &Scene, i: usize) {
        for k in 0..3 {
            self.center[k][l] = f64::from(scene.centers[i][k]);
            self.log_scale[k][l] = f64::from(scene.log_scales[i][k]);
        }
        for (k, x) in scene.rotations[i].to_array().into_iter().enumerate() {
            self.rotation[k][l] = f64::from(x);
        }
        self.logit[l] = f64::from(scene.opacity_logits[i]).clamp(-LOGIT_MAX, LOGIT_MAX);
    }
}

/// What becomes of a [`Block`].
#[derive(Default)]
struct Projected {
    mean: [[f32; BLOCK]; 2],
    shear: [f32; BLOCK],
    precision_x: [f32; BLOCK],
    precision_y: [f32; BLOCK],
    sigma_x: [f32; BLOCK],
    peak: [f32; BLOCK],
    half: [[f32; BLOCK]; 2],
    depth: [f32; BLOCK],
    fate: [u32; BLOCK],
    slope: [[f32; BLOCK]; 2],
    reach: [f32; BLOCK],
    normal: [[f32; BLOCK]; 3],
}

impl Projected {
    fn splat(&self, l: usize) -> Splat {
        Splat {
            mean: self.mean.map(|m| m[l]),
            shear: self.shear[l],
            precision_x: self.precision_x[l],
            precision_y: self.precision_y[l],
            sigma_x: self.sigma_x[l],
            peak: self.peak[l],
            half: self.half.map(|h| h[l]),
        }
    }

    fn surface(&self, l: usize) -> Surface {
        Surface {
            depth: self.depth[l],
            slope: self.slope.map(|s| s[l]),
            reach: self.reach[l],
            normal: self.normal.map(|n| n[l]),
        }
    }

    #[inline(always)]
    fn plane(&mut self, l: usize, view: &View, footprint: &Footprint, log_scale: DVec3) {
        let plane = surface::plane(footprint);
        let normal = view.rotation.transpose() * surface::outward(view, footprint, log_scale).1;
        let reach = REACH_SIGMAS * plane.depth_variance.sqrt();
        self.slope[0][l] = plane.slope.x as f32;
        self.slope[1][l] = plane.slope.y as f32;
        self.reach[l] = (if reach < SIGMA_MAX { reach } else { SIGMA_MAX }) as f32;
        self.normal[0][l] = normal.x as f32;
        self.normal[1][l] = normal.y as f32;
        self.normal[2][l] = normal.z as f32;
    }
}

simd_kernels! {
    fn project_block(view: &View, block: &Block, out: &mut Projected) {
        for l in 0..BLOCK {
            view.project::<false>(block, l, out);
        }
    }
    fn project_block_and_planes(view: &View, block: &Block, out: &mut Projected) {
        for l in 0..BLOCK {
            view.project::<true>(block, l, out);
        }
    }
}

/// The scene on the screen, in chunks of [`CHUNK`] Gaussians in scene order.
///
/// Each task fills vectors of its own. One vector for all would be filled with zeros by one thread first, while the
/// others wait.
pub(crate) struct Seen {
    chunks: Vec<Chunk>,
    pub counts: Counts,
}

/// What one task projects.
pub(crate) struct Chunk {
    /// One for each Gaussian; those that are not seen are zero.
    splats: Vec<Splat>,
    /// Likewise; empty unless asked for.
    surfaces: Vec<Surface>,
    /// The Gaussians that touch the picture, in scene order.
    pub keys: Vec<Key>,
    counts: Counts,
}

impl Seen {
    pub fn chunks(&self) -> &[Chunk] {
        &self.chunks
    }

    /// The ellipses of the Gaussians `ids`, in their order.
    pub fn splats(&self, ids: &[u32]) -> Vec<Splat> {
        self.pick(ids, |chunk| &chunk.splats)
    }

    /// Their planes.
    pub fn surfaces(&self, ids: &[u32]) -> Vec<Surface> {
        self.pick(ids, |chunk| &chunk.surfaces)
    }

    fn pick<T: Copy + Send>(&self, ids: &[u32], of: impl Fn(&Chunk) -> &[T] + Sync) -> Vec<T> {
        ids.par_iter()
            .with_min_len(1024)
            .map(|&id| of(&self.chunks[id as usize / CHUNK])[id as usize % CHUNK])
            .collect()
    }
}

pub(crate) fn project(scene: &Scene, view: &View, surfaces: bool, level: SimdLevel) -> Seen {
    let chunks: Vec<Chunk> = (0..scene.len().div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| project_chunk(scene, view, level, chunk * CHUNK, surfaces))
        .collect();
    let mut counts = Counts::default();
    chunks.iter().for_each(|chunk| counts.add(&chunk.counts));
    Seen { chunks, counts }
}

/// Projects the Gaussians from `first` on.
fn project_chunk(scene: &Scene, view: &View, level: SimdLevel, first: usize, planes: bool) -> Chunk {
    let kernel = if planes {
        project_block_and_planes
    } else {
        project_block
    };
    let len = CHUNK.min(scene.len() - first);
    let mut chunk = Chunk {
        splats: Vec::with_capacity(len),
        surfaces: Vec::with_capacity(if planes { len } else { 0 }),
        keys: Vec::with_capacity(len),
        counts: Counts::default(),
    };
    let Chunk {
        splats,
        surfaces,
        keys,
        counts,
    } = &mut chunk;
    let mut block = Block::default();
    let mut out = Projected::default();
    for at in (0..len).step_by(BLOCK) {
        let count = BLOCK.min(len - at);
        for l in 0..count {
            block.set(l, scene, first + at + l);
        }
        kernel(level, view, &block, &mut out);
        for l in 0..count {
            let i = first + at + l;
            let fate = if scene.is_valid(i) { out.fate[l] } else { INVALID };
            let seen = fate == SEEN;
            splats.push(if seen { out.splat(l) } else { Splat::default() });
            if planes {
                surfaces.push(if seen { out.surface(l) } else { Surface::default() });
            }
            match fate {
                SEEN => {
                    counts.seen += 1;
                    keys.push(Key::new(out.depth[l], i as u32));
                }
                TRANSPARENT => counts.transparent += 1,
                BEHIND => counts.behind += 1,
                INVALID => counts.invalid += 1,
                _ => counts.outside += 1,
            }
        }
    }
    chunk
}
