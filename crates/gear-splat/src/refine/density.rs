//! More Gaussians where the loss asks for them (3DGS's adaptive density, made deterministic and free of scale).
//!
//! A Gaussian that the loss pulls about on the screen stands for more than it can show. So the length of the derivative by
//! its place on the screen is averaged over the steps that saw it, and every so often the share with the
//! longest means is densified: the small ones get a twin, the large ones are split along their longest axis. 3DGS takes
//! those above a threshold instead, which depends on picture size and loss, and draws the places of children at random.
//!
//! A twin starts at the same place, moved a little down the slope, and the opacity of both is such that together they cover
//! as before. Children and twins are a new generation: their anchor is where they were born, and it holds them less
//! firmly than the older ones ([`Generations`]), as in GaussianEditor.

use glam::Vec3;

use super::anchored::{Anchored, Group, growth_limit};
use crate::render::SceneGradients;
use crate::{Camera, Projection, logit};

/// When and how much to densify.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Densify {
    /// Steps in which everything moves between densifications.
    pub every: usize,
    /// Share of all steps after which there is none any more, so that what was born can settle.
    pub until: f64,
    /// Share of the Gaussians that is densified each time.
    pub share: f64,
    /// Largest number of Gaussians.
    pub most: usize,
}

impl Default for Densify {
    fn default() -> Self {
        Self {
            every: 50,
            until: 0.6,
            share: 0.01,
            most: 1_000_000,
        }
    }
}

/// How firmly the anchor holds the generations of Gaussians: factors of its weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Generations {
    /// The scene as it came.
    pub first: f64,
    /// Gaussians that a densification made.
    pub newborn: f64,
    /// By this much every Gaussian becomes firmer at each later densification.
    pub multiplier: f64,
    /// Where that ends.
    pub most: f64,
}

impl Default for Generations {
    fn default() -> Self {
        Self {
            first: 1.0,
            newborn: 0.1,
            multiplier: 1.3,
            most: 10.0,
        }
    }
}

/// Both parts of a split are by this much smaller (3DGS).
const SHRINK: f32 = 1.6;
/// How far the two parts of a split stand from where it was, in its longest standard deviation.
const APART: f32 = 0.7;
/// How far a twin is moved down the slope, in its smaller standard deviation within the surface.
const STEP_ASIDE: f32 = 0.3;

/// How much the loss pulls at each Gaussian on the screen.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Strain {
    /// Sum of the lengths of derivatives by the place on the screen.
    pub sums: Vec<f32>,
    /// Sum of the derivatives by the centres.
    pub slopes: Vec<Vec3>,
    /// Steps that saw it.
    pub seen: Vec<u32>,
}

impl Strain {
    pub fn gather(&mut self, gradients: &SceneGradients, centers: &[Vec3], camera: &Camera) {
        let n = gradients.centers.len();
        self.sums.resize(n, 0.0);
        self.slopes.resize(n, Vec3::ZERO);
        self.seen.resize(n, 0);
        for (i, &g) in gradients.centers.iter().enumerate() {
            if g == Vec3::ZERO || !g.is_finite() {
                continue;
            }
            let pixels_a_unit = match camera.projection {
                Projection::Orthographic { pixels_per_unit } => pixels_per_unit,
                Projection::Pinhole { focal_px } => focal_px / camera.to_camera(centers[i]).z.max(1e-6),
            };
            self.sums[i] += (camera.rotation * g).truncate().length() / pixels_a_unit;
            self.slopes[i] += g;
            self.seen[i] += 1;
        }
    }

    /// The `count` Gaussians with the longest means, in scene order.
    fn most_strained(&self, count: usize) -> Vec<usize> {
        let mean = |i: usize| self.sums[i] / self.seen[i].max(1) as f32;
        let mut order: Vec<usize> = (0..self.sums.len()).filter(|&i| self.sums[i] > 0.0).collect();
        order.sort_unstable_by(|&a, &b| mean(b).total_cmp(&mean(a)).then(a.cmp(&b)));
        order.truncate(count);
        order.sort_unstable();
        order
    }
}

impl Anchored {
    /// Densifies; returns how many Gaussians were born.
    pub fn densify(&mut self, strain: &Strain, densify: &Densify) -> usize {
        let n = self.scene.len();
        let wanted = (densify.share.clamp(0.0, 1.0) * n as f64).ceil() as usize;
        let parents = strain.most_strained(wanted.min(densify.most.saturating_sub(n)));
        let Generations {
            first,
            newborn,
            multiplier,
            most,
        } = self.generations;
        self.firmness.resize(n, first as f32);
        for firmness in &mut self.firmness {
            *firmness = (*firmness * multiplier as f32).min((most as f32).max(*firmness));
        }
        for &parent in &parents {
            let size = self.scene.scales(parent).max_element();
            if f64::from(size) > self.unit {
                self.split(parent, size);
                self.firmness[parent] = newborn as f32;
            } else {
                self.twin(parent, strain.slopes[parent]);
            }
            self.firmness.push(newborn as f32);
        }
        parents.len()
    }

    /// A copy of Gaussian `i` at the end, and of all that is kept for it.
    fn copy(&mut self, i: usize) -> usize {
        for scene in [&mut self.scene, &mut self.anchor] {
            let rest = scene.sh_rest_of(i).to_vec();
            scene.centers.push(scene.centers[i]);
            scene.log_scales.push(scene.log_scales[i]);
            scene.rotations.push(scene.rotations[i]);
            scene.opacity_logits.push(scene.opacity_logits[i]);
            scene.sh_dc.push(scene.sh_dc[i]);
            scene.sh_rest.extend(rest);
        }
        let n = self.scene.len() - 1;
        for moments in &mut self.moments {
            for values in [&mut moments.first, &mut moments.second] {
                let width = values.len() / n;
                values.extend_from_within(i * width..(i + 1) * width);
            }
        }
        self.ceilings.push(self.ceilings[i]);
        n
    }

    /// Anchors Gaussian `i` where it is.
    fn anchor_here(&mut self, i: usize) {
        for group in Group::ALL {
            let width = group.of(&self.scene).len() / self.scene.len();
            let range = i * width..(i + 1) * width;
            let here = &group.of(&self.scene)[range.clone()];
            group.of_mut(&mut self.anchor)[range].copy_from_slice(here);
        }
        self.ceilings[i] = growth_limit(self.scene.log_scales[i], self.unit, self.extent);
    }

    /// Two parts along the longest axis in place of one.
    fn split(&mut self, i: usize, size: f32) {
        let scales = self.scene.log_scales[i];
        let longest = (0..3).fold(0, |a, k| if scales[k] > scales[a] { k } else { a });
        let axis = self.scene.rotations[i].normalize() * [Vec3::X, Vec3::Y, Vec3::Z][longest];
        self.scene.log_scales[i][longest] -= libm::logf(SHRINK);
        let other = self.copy(i);
        self.scene.centers[i] += axis * (APART * size);
        self.scene.centers[other] -= axis * (APART * size);
        self.anchor_here(i);
        self.anchor_here(other);
    }

    /// A second Gaussian beside one that stays.
    fn twin(&mut self, i: usize, slope: Vec3) {
        // 1 − (1 − o)² is the opacity that there was.
        let opacity = self.scene.opacity(i);
        self.scene.opacity_logits[i] = logit(1.0 - (1.0 - opacity).max(0.0).sqrt());
        let twin = self.copy(i);
        let scales = self.scene.scales(i);
        let smaller = scales.element_sum() - scales.max_element() - scales.min_element();
        self.scene.centers[twin] -= slope.normalize_or_zero() * (STEP_ASIDE * smaller);
        self.anchor_here(twin);
    }
}
