//! What a rasteriser is asked for and what it answers, whichever device it runs on.

use gear_image::{Field, SrgbImage};
use glam::{Vec3, Vec4};

use crate::{Camera, Scene, cpu};

/// Smallest α that a Gaussian adds to a pixel: below, it is left out, as in 3DGS.
pub const ALPHA_MIN: f32 = 1.0 / 255.0;
/// log₂ of [`ALPHA_MIN`].
pub(crate) const ALPHA_MIN_LOG2: f32 = -7.994_353_4;
/// Largest α of one Gaussian at a pixel.
pub const ALPHA_MAX: f32 = 0.99;
/// A pixel whose transmittance is below this is finished.
pub const TRANSMITTANCE_MIN: f32 = 1e-4;
/// Standard deviations at which even an opaque Gaussian falls below [`ALPHA_MIN`]: √(2 ln 255).
pub const REACH_SIGMAS: f64 = 3.329_042_904_889_846;

/// A surfel's normal is turned round when it points away from the camera by more than this cosine. Seen edge-on it keeps
/// the side that it is stored with; else rounding would toss a coin, and walls along the line of sight would get noise.
pub(crate) const EDGE_ON: f64 = 1e-5;

/// What keeps Gaussians thinner than a pixel from falling between pixel centres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ScreenFilter {
    /// The variance is added to the projected covariance, px² (3DGS: 0.3). Thin Gaussians become too heavy.
    Dilate(f32),
    /// As [`ScreenFilter::Dilate`], and the opacity is scaled by √(det before / det after), so that a Gaussian keeps
    /// its weight at any distance (Mip-Splatting's 2D filter; TRELLIS uses 0.1).
    AntiAlias(f32),
}

impl ScreenFilter {
    pub(crate) fn variance(self) -> f64 {
        match self {
            Self::Dilate(v) | Self::AntiAlias(v) => f64::from(v).max(1e-6),
        }
    }
}

/// How to render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderOptions {
    /// sRGB-encoded ground that shows where the scene is transparent.
    pub background: [f32; 3],
    /// Treatment of Gaussians thinner than a pixel.
    pub filter: ScreenFilter,
    /// Pinhole cameras leave out Gaussians whose centre is nearer than this, world units. Orthographic cameras see
    /// along whole lines and leave out nothing.
    pub near: f32,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            background: [1.0; 3],
            filter: ScreenFilter::Dilate(0.3),
            near: 0.01,
        }
    }
}

/// Which pictures are wanted. What is not asked for is not computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Outputs {
    /// Colour over the background.
    pub rgb: bool,
    /// Coverage.
    pub alpha: bool,
    /// Expected depth.
    pub depth: bool,
    /// Median depth.
    pub median_depth: bool,
    /// World-space normals.
    pub normal: bool,
}

impl Outputs {
    /// Colour and coverage.
    pub const RGBA: Self = Self {
        rgb: true,
        alpha: true,
        depth: false,
        median_depth: false,
        normal: false,
    };
    /// Everything.
    pub const ALL: Self = Self {
        rgb: true,
        alpha: true,
        depth: true,
        median_depth: true,
        normal: true,
    };
}

/// The pictures of one rendering; those that were not wanted are absent.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendering {
    /// sRGB-encoded colour over the background, not clamped above 1.
    pub rgb: Option<SrgbImage>,
    /// Coverage in [0, 1]: 1 − the remaining transmittance.
    pub alpha: Option<Field>,
    /// Mean depth of what is seen along the camera's z axis, world units: Σ wᵢ zᵢ / Σ wᵢ, where zᵢ is the depth at
    /// which the pixel's ray meets the plane of surfel i. NaN where nothing is.
    pub depth: Option<Field>,
    /// Depth at which the transmittance falls to ½ or below. NaN where it does not.
    pub median_depth: Option<Field>,
    /// World-space unit normals of the surfels, turned to the camera, averaged with the weights of colour. Zero where
    /// nothing is.
    pub normal: Option<Vec<[f32; 3]>>,
}

impl Rendering {
    /// Median depth where at least half is covered, expected depth elsewhere, NaN where nothing is: a depth
    /// without mixtures at silhouettes that still reaches them. Both depths must have been wanted.
    pub fn surface_depth(&self) -> Option<Field> {
        let (median, mean) = (self.median_depth.as_ref()?, self.depth.as_ref()?);
        let pairs = median.data().iter().zip(mean.data());
        let data = pairs.map(|(&m, &e)| if m.is_nan() { e } else { m }).collect();
        Some(Field::from_vec(median.width(), median.height(), data))
    }
}

/// Derivatives of a loss by the pictures of a [`Rendering`], row-major. A picture that the loss does not look at has an
/// empty list. There is none by the median depth, which jumps from surfel to surfel. Where nothing is, depth and normal are
/// not defined, and their entries are not looked at.
#[derive(Clone, Debug, Default)]
pub struct PixelGradients {
    /// By `rgb`.
    pub rgb: Vec<[f32; 3]>,
    /// By `alpha`.
    pub alpha: Vec<f32>,
    /// By `depth`.
    pub depth: Vec<f32>,
    /// By `normal`, as it is: a unit vector.
    pub normal: Vec<[f32; 3]>,
}

impl PixelGradients {
    /// # Panics
    /// When a list is neither empty nor as long as the picture: a caller's bug.
    pub(crate) fn check(&self, pixels: usize) {
        let lengths = [self.rgb.len(), self.alpha.len(), self.depth.len(), self.normal.len()];
        for (name, length) in ["rgb", "alpha", "depth", "normal"].into_iter().zip(lengths) {
            assert!(
                length == 0 || length == pixels,
                "{length} gradients by `{name}` for {pixels} pixels"
            );
        }
    }
}

/// Derivatives of a loss by the attributes of a scene, one entry a Gaussian. Groups that were not wanted are empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneGradients {
    /// By the centres.
    pub centers: Vec<Vec3>,
    /// By the logarithms of the scales.
    pub log_scales: Vec<Vec3>,
    /// By the quaternion components x, y, z, w as stored, not normalised.
    pub rotations: Vec<Vec4>,
    /// By the opacity logits.
    pub opacity_logits: Vec<f32>,
    /// By the SH coefficients of degree 0.
    pub sh_dc: Vec<[f32; 3]>,
    /// By the higher SH coefficients, laid out as in [`Scene`].
    pub sh_rest: Vec<f32>,
}

/// Which groups of attributes a gradient is wanted for. Frozen groups cost nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// Centres.
    pub centers: bool,
    /// Logarithms of the scales.
    pub log_scales: bool,
    /// Quaternions.
    pub rotations: bool,
    /// Opacity logits.
    pub opacity_logits: bool,
    /// SH coefficients of all degrees.
    pub colors: bool,
}

impl Wanted {
    /// SH coefficients only.
    pub const COLORS: Self = Self {
        centers: false,
        log_scales: false,
        rotations: false,
        opacity_logits: false,
        colors: true,
    };
    /// Everything.
    pub const ALL: Self = Self {
        centers: true,
        log_scales: true,
        rotations: true,
        opacity_logits: true,
        colors: true,
    };

    /// Whether anything is wanted that decides where a Gaussian's α falls.
    pub(crate) fn moves_shapes(self) -> bool {
        self.centers || self.log_scales || self.rotations || self.opacity_logits
    }
}

/// What became of a scene's Gaussians before anything was drawn. Each is counted once, by the first cause in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Dropped because a number is NaN or infinite, or the quaternion is zero.
    pub invalid: usize,
    /// Left out because the centre is behind the near plane of a pinhole camera.
    pub behind: usize,
    /// Left out because the opacity is below 1/255.
    pub transparent: usize,
    /// Left out because no pixel lies in the box around the ellipse α ≥ 1/255.
    pub outside: usize,
    /// Drawn.
    pub seen: usize,
}

impl Counts {
    pub(crate) fn add(&mut self, other: &Self) {
        self.invalid += other.invalid;
        self.behind += other.behind;
        self.transparent += other.transparent;
        self.outside += other.outside;
        self.seen += other.seen;
    }
}

/// Renders a scene on the CPU. Invalid Gaussians are left out; see [`Scene::count_invalid`].
///
/// # Panics
/// When the scene is ragged ([`Scene::validate`]): a caller's bug.
pub fn render(scene: &Scene, camera: &Camera, options: &RenderOptions, outputs: Outputs) -> Rendering {
    cpu::Frame::new(scene, camera, options, outputs).draw()
}
