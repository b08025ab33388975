//! Surfels: a height field becomes a closed, double-sided Gaussian scene.
//!
//! *Front.* A quad-tree of square blocks (`blocks`): a block is one surfel when a plane explains its height
//! within a tolerance and its colours hardly vary. A surfel is the Gaussian on the block's plane that the
//! canonical camera sees as an isotropic spot of σ = cover · block size, centred where the ray through the block's
//! centre meets the plane; so the front view is aligned with the painting to the pixel for an orthographic and
//! for a pinhole camera alike (`frame`). *Back.* A figure's mirrored and flattened height, coarser; a relief's flat
//! board. *Walls.* Where front and back do not meet at the rim (`walls`).
//!
//! Outlines and paper leak into the outermost pixels of a mask and would show on walls: every pixel
//! takes its colour from at least three pixels inside the rim.
//!
//! *What must stay true.* A Gaussian has tails. A block of size s keeps a distance of s to the outside of the mask, so
//! outside pixels see at most 4 % of it (13 % across a diagonal rim, distances being city-block ones); along the rim blocks are single pixels.

mod blocks;
mod frame;
mod walls;

use gear_image::filter::{gaussian, nearest};
use gear_image::{Field, Mask, SrgbImage};
use gear_splat::{Camera, Scene};
use glam::Vec3;

use crate::fields::{eroded, masked};
use crate::height::{Mode, Relief};
use blocks::{Block, Blocks, Tolerance};
use frame::Lift;

/// How surfels are laid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfelSettings {
    /// Depth of the back of a figure relative to its front.
    pub back: f32,
    /// Thickness of a relief's board below its lowest point, as a share of the longer side.
    pub board: f32,
    /// σ of a surfel in its plane, in block sizes; at .42 the grid of the blocks was seen through the surface.
    pub cover: f32,
    /// The same for blocks of a single pixel, which the rasteriser's screen filter widens: more only blurs.
    pub cover_pixel: f32,
    /// σ across the surface, in pixels.
    pub thin: f32,
    /// Opacity of every surfel.
    pub opacity: f32,
    /// Largest deviation of the height from a block's plane, in pixels.
    pub plane_tolerance: f32,
    /// Largest deviation (rms, encoded) of the colours from a block's mean.
    pub colour_tolerance: f32,
    /// Budget: above it both tolerances are loosened together, up to [`LOOSEST`] times.
    pub max_gaussians: usize,
}

/// How far the budget may loosen the tolerances.
///
/// Three times the default colour tolerance is .045, −27 dB in the worst block before refinement. A picture that needs
/// more Gaussians than the budget at that tolerance gets them.
pub const LOOSEST: f32 = 3.0;

impl Default for SurfelSettings {
    fn default() -> Self {
        Self {
            back: 0.6,
            board: 0.02,
            cover: 0.6,
            cover_pixel: 0.5,
            thin: 0.15,
            opacity: 0.99,
            plane_tolerance: 0.25,
            colour_tolerance: 0.015,
            max_gaussians: 120_000,
        }
    }
}

/// What was laid.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Counts {
    /// Surfels of the front.
    pub front: usize,
    /// Surfels of the back.
    pub back: usize,
    /// Surfels of the walls.
    pub walls: usize,
    /// Factor by which the budget loosened the tolerances, 1 when it did not.
    pub loosened: f32,
}

/// Back and board are seen from the front by nobody: their tolerances, relative to the front's.
const BACK_PLANE: f32 = 3.0;
const BACK_COLOUR: f32 = 6.0;
const BACK_SHADE: f32 = 0.85;

/// Lifts a relief along the rays of `camera` (which must have its size) to a scene centred on z = 0. `image` gives the
/// colours.
pub fn lift(relief: &Relief, image: &SrgbImage, camera: &Camera, settings: &SurfelSettings) -> (Scene, Counts) {
    let mask = &relief.mask;
    let mut scene = Scene {
        canonical_camera: Some(*camera),
        ..Scene::default()
    };
    if mask.is_empty() || mask.count() == 0 {
        return (scene, Counts::default());
    }
    let colours = colours_from_inside(image, mask);
    let blocks = Blocks::measure(&relief.height, &colours, mask);
    let (back, middle) = Back::of(relief, settings);
    let lift = Lift::new(camera, mask, middle);
    let walls = walls::pieces(&relief.height, mask, &softened(&colours, mask), back);

    let front_at = |loosened: f32| Tolerance {
        plane: settings.plane_tolerance * loosened,
        colour: settings.colour_tolerance * loosened,
        largest: 16,
    };
    let back_at = |loosened: f32| match back {
        Back::Mirrored(share) => Tolerance {
            plane: BACK_PLANE * settings.plane_tolerance * loosened / share.max(0.05),
            colour: BACK_COLOUR * settings.colour_tolerance * loosened,
            largest: 16,
        },
        Back::Board { .. } => Tolerance {
            plane: f32::INFINITY,
            colour: f32::INFINITY,
            largest: 16,
        },
    };
    let total = |loosened: f32| blocks.count(&front_at(loosened)) + blocks.count(&back_at(loosened)) + walls.len();
    let loosened = within_budget(settings.max_gaussians, total);

    let mut add = |spot: frame::Spot, colour: [f32; 3]| {
        scene.centers.push(spot.center);
        scene.rotations.push(spot.rotation);
        scene.log_scales.push(Vec3::from_array(
            spot.scales.to_array().map(|s| libm::log(f64::from(s)) as f32),
        ));
        scene.sh_dc.push(colour.map(|c| (c - 0.5) / 0.282_094_79));
    };
    let front = blocks.choose(&front_at(loosened));
    for block in &front {
        add(lift.block(block, block.plane, 1.0, settings), block.colour);
    }
    let behind = blocks.choose(&back_at(loosened));
    for block in &behind {
        let plane = back.plane(block);
        add(
            lift.block(block, plane, -1.0, settings),
            block.colour.map(|c| c * BACK_SHADE),
        );
    }
    for wall in &walls {
        add(lift.wall(wall, settings), wall.colour);
    }
    let opacity = settings.opacity.clamp(1e-4, 1.0 - 1e-4);
    let logit = libm::log(f64::from(opacity / (1.0 - opacity))) as f32;
    scene.opacity_logits = vec![logit; scene.centers.len()];
    let counts = Counts {
        front: front.len(),
        back: behind.len(),
        walls: walls.len(),
        loosened,
    };
    (scene, counts)
}

/// The smallest factor in [1, LOOSEST] (to 1 %) at which `total` fits the budget; LOOSEST when none does.
fn within_budget(budget: usize, total: impl Fn(f32) -> usize) -> f32 {
    if total(1.0) <= budget {
        return 1.0;
    }
    let (mut low, mut high) = (1.0f32, LOOSEST);
    for _ in 0..10 {
        let middle = 0.5 * (low + high);
        if total(middle) <= budget {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

/// The far side of the surface.
#[derive(Clone, Copy, Debug)]
enum Back {
    /// The front's height, mirrored and scaled.
    Mirrored(f32),
    /// A flat board, parallel to the relief's ground: height at the top of the picture, and its tilt.
    Board { level: f32, tilt: f32 },
}

impl Back {
    /// The back of a relief, and the height that is half way between the extremes of front and back.
    fn of(relief: &Relief, settings: &SurfelSettings) -> (Self, f32) {
        let back = match relief.mode {
            Mode::Figure => Self::Mirrored(settings.back),
            Mode::Relief => Self::Board {
                level: -settings.board * relief.mask.longer_side() as f32,
                tilt: relief.tilt,
            },
        };
        let (mut low, mut high) = (f32::MAX, f32::MIN);
        for y in 0..relief.height.height() {
            for (&h, &inside) in relief.height.row(y).iter().zip(relief.mask.row(y)) {
                if inside {
                    let behind = back.height(h, y as f32);
                    (low, high) = (low.min(h).min(behind), high.max(h).max(behind));
                }
            }
        }
        (back, if low <= high { 0.5 * (low + high) } else { 0.0 })
    }

    /// Height of the back in row `y` where the front has the height `front`.
    fn height(self, front: f32, y: f32) -> f32 {
        match self {
            Self::Mirrored(share) => -share * front,
            Self::Board { level, tilt } => level + tilt * y,
        }
    }

    /// Height and slopes of the back under a block.
    fn plane(self, block: &Block) -> [f32; 3] {
        match self {
            Self::Mirrored(share) => block.plane.map(|v| -share * v),
            Self::Board { level, tilt } => [level + tilt * block.center[1], 0.0, tilt],
        }
    }
}

/// Every inside pixel with the colour of the nearest one at least three pixels from the rim; NaN is black.
fn colours_from_inside(image: &SrgbImage, mask: &Mask) -> SrgbImage {
    let core = eroded(mask, 3);
    let source = nearest(&core);
    SrgbImage::from_fn(image.width(), image.height(), |x, y| {
        let (x, y) = source.as_ref().map_or((x, y), |source| source.at(x, y));
        image.at(x, y).map(|c| if c.is_nan() { 0.0 } else { c.clamp(0.0, 1e3) })
    })
}

/// Colours averaged over a small neighbourhood inside the mask: walls stretch one rim pixel over a whole side, and a
/// stripe of the picture would become a band.
fn softened(colours: &SrgbImage, mask: &Mask) -> SrgbImage {
    let (width, height) = mask.size();
    let sigma = 0.006 * mask.longer_side() as f64;
    let planes: [Field; 3] = std::array::from_fn(|channel| {
        let plane = Field::from_vec(width, height, colours.data().iter().map(|c| c[channel]).collect());
        gaussian(&masked(&plane, mask), sigma)
    });
    let weight = gaussian(&mask.to_field(), sigma);
    SrgbImage::from_fn(width, height, |x, y| {
        let w = weight.at(x, y).max(1e-6);
        std::array::from_fn(|channel| planes[channel].at(x, y) / w)
    })
}

/// The lifted position of every pixel's centre, for tests and overlays: world z of the front.
pub fn front_depth(relief: &Relief, settings: &SurfelSettings) -> Field {
    let side = relief.mask.longer_side() as f32;
    let (_, middle) = Back::of(relief, settings);
    Field::from_vec(
        relief.height.width(),
        relief.height.height(),
        relief
            .height
            .data()
            .iter()
            .zip(relief.mask.data())
            .map(|(&h, &m)| if m { (h - middle) / side } else { f32::NAN })
            .collect(),
    )
}
