//! A scene under optimisation: its anchor, Adam's moments, the limits of its attributes.

use glam::{Quat, Vec3, Vec4};
use rayon::prelude::*;

use super::RefineOptions;
use super::prox::ProxAdam;
use crate::Scene;
use crate::render::{SceneGradients, Wanted};
use crate::sh::Y0;

/// Added to √v̂. The data gradient is a mean over pixels, about 1e-6; this stays far below.
const EPSILON: f64 = 1e-15;
/// Opacity logits are held within this.
const LOGIT_MAX: f32 = 9.0;
/// Largest ratio of a Gaussian's scales.
const NEEDLE_MAX: f32 = 200.0;
/// A standard deviation grows to at most so many times the largest one that the Gaussian began with, and by no more
/// than a typical surfel. At the rim of a picture nobody looks at what lies beyond, and without this limit small
/// Gaussians grow whiskers there, and the large ones of a plain back grow shadows around it.
const GROWTH_MAX: f64 = 2.0;
/// Gaussians handled by one task.
const CHUNK: usize = 4096;

/// One number for each attribute of a Gaussian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// Centres, in typical surfels.
    pub center: f64,
    /// Rotations.
    pub rotation: f64,
    /// Log scales.
    pub scale: f64,
    /// Opacity logits.
    pub opacity: f64,
    /// SH coefficients of degree 0; higher ones step at a twentieth.
    pub color: f64,
}

impl Rates {
    /// All times `factor`.
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            center: self.center * factor,
            rotation: self.rotation * factor,
            scale: self.scale * factor,
            opacity: self.opacity * factor,
            color: self.color * factor,
        }
    }
}

/// First and second moments of an attribute's coordinates.
#[derive(Default)]
struct Moments {
    first: Vec<f32>,
    second: Vec<f32>,
}

/// The attributes as flat coordinates, in this order: centre 3, log scale 3, rotation 4, opacity 1, colour 3, higher SH.
const GROUPS: usize = 6;

pub(super) struct Anchored {
    pub scene: Scene,
    anchor: Scene,
    rates: Rates,
    weights: Rates,
    lambda: f64,
    extent: f32,
    /// The typical surfel, world units.
    unit: f64,
    /// Largest log scale of each Gaussian.
    ceilings: Vec<f32>,
    moments: [Moments; GROUPS],
    gradients: [Vec<f32>; GROUPS],
    steps: [usize; GROUPS],
}

impl Anchored {
    pub fn new(scene: &Scene, options: &RefineOptions) -> Self {
        let extent = scene.bounds().map_or(1.0, |b| b.longest_side()).max(1e-6);
        let unit = typical_surfel(scene);
        Self {
            scene: scene.clone(),
            anchor: scene.clone(),
            rates: options.rates,
            weights: options.anchor_weights,
            lambda: options.anchor,
            extent,
            unit,
            ceilings: ceilings(scene, unit, extent),
            moments: Default::default(),
            gradients: Default::default(),
            steps: [0; GROUPS],
        }
    }

    /// Adds a gradient to what the next step will use.
    pub fn gather(&mut self, gradients: &SceneGradients) {
        let flat3 = |v: &[Vec3]| v.iter().flat_map(|v| v.to_array()).collect::<Vec<f32>>();
        let flat4 = |v: &[Vec4]| v.iter().flat_map(|v| v.to_array()).collect::<Vec<f32>>();
        let parts = [
            flat3(&gradients.centers),
            flat3(&gradients.log_scales),
            flat4(&gradients.rotations),
            gradients.opacity_logits.clone(),
            gradients.sh_dc.as_flattened().to_vec(),
            gradients.sh_rest.clone(),
        ];
        for (total, part) in self.gradients.iter_mut().zip(parts) {
            if total.is_empty() {
                *total = part;
            } else {
                total.iter_mut().zip(part).for_each(|(a, b)| *a += b);
            }
        }
    }

    /// Uses up the gathered gradients. `decay` scales all rates. Returns how many Gaussians were left out because a
    /// derivative was not finite.
    pub fn step(&mut self, phase: Wanted, decay: f64) -> usize {
        let skipped = self.drop_not_finite();
        let n = self.scene.len().max(1) as f64;
        let mu = |weight: f64| 2.0 * self.lambda * weight / n;
        let (rates, weights) = (self.rates, self.weights);
        let plan = [
            (rates.center * self.unit, weights.center / (self.unit * self.unit)),
            (rates.scale, weights.scale),
            (rates.rotation, weights.rotation),
            (rates.opacity, weights.opacity),
            (rates.color, weights.color),
            (rates.color / 20.0, weights.color),
        ];
        for (group, (rate, weight)) in plan.into_iter().enumerate() {
            let gradient = std::mem::take(&mut self.gradients[group]);
            if gradient.is_empty() {
                continue;
            }
            self.steps[group] += 1;
            let prox = ProxAdam::new(self.steps[group], rate * decay, mu(weight), EPSILON);
            let mut x = coordinates(&self.scene, group);
            let anchor = coordinates(&self.anchor, group);
            let moments = &mut self.moments[group];
            moments.first.resize(x.len(), 0.0);
            moments.second.resize(x.len(), 0.0);
            update(&prox, &mut x, &anchor, &gradient, moments);
            set_coordinates(&mut self.scene, group, &x);
        }
        if self.scene.sh_degree == 0 {
            self.restrain_colors();
        }
        if phase == Wanted::ALL {
            self.restrain();
        }
        skipped
    }

    /// Zeroes the gradients of Gaussians with a derivative that is not finite; returns how many.
    fn drop_not_finite(&mut self) -> usize {
        let n = self.scene.len();
        let mut bad = vec![false; n];
        for gradient in &self.gradients {
            let width = gradient.len() / n.max(1);
            if width > 0 {
                for (bad, part) in bad.iter_mut().zip(gradient.chunks_exact(width)) {
                    *bad |= part.iter().any(|g| !g.is_finite());
                }
            }
        }
        let count = bad.iter().filter(|&&b| b).count();
        if count > 0 {
            for gradient in &mut self.gradients {
                let width = gradient.len() / n.max(1);
                if width > 0 {
                    for (bad, part) in bad.iter().zip(gradient.chunks_exact_mut(width)) {
                        if *bad {
                            part.fill(0.0);
                        }
                    }
                }
            }
        }
        count
    }

    /// Keeps colours between black and white. A view blends a few Gaussians a pixel, so one that is brighter than white
    /// can make up for its neighbours in the views that were looked at; from between them it is a glaring speck.
    fn restrain_colors(&mut self) {
        let most = 0.5 / Y0;
        for (color, start) in self.scene.sh_dc.iter_mut().zip(&self.anchor.sh_dc) {
            for (x, start) in color.iter_mut().zip(start) {
                *x = x.clamp((-most).min(*start), most.max(*start));
            }
        }
    }

    /// Keeps the attributes where they make sense: unit quaternions on the anchor's side, scales of 1e-4 to 0.2 extents,
    /// no needles and no whiskers, opacities that can still change.
    fn restrain(&mut self) {
        let ln = |x: f32| libm::log(f64::from(x)) as f32;
        let (least, ratio) = (ln(1e-4 * self.extent), ln(NEEDLE_MAX));
        let anchor = &self.anchor;
        let limits = anchor.log_scales.iter().zip(&self.ceilings);
        for (scales, (start, ceiling)) in self.scene.log_scales.iter_mut().zip(limits) {
            // What came outside the limits may stay there, but go no farther.
            let low = Vec3::splat(least).min(*start);
            let high = Vec3::splat(*ceiling).max(*start);
            let held = scales.clamp(low, high);
            let allowed = ratio.max(start.max_element() - start.min_element());
            *scales = held.max(Vec3::splat(held.max_element() - allowed));
        }
        for (q, start) in self.scene.rotations.iter_mut().zip(&anchor.rotations) {
            let aligned = if q.dot(*start) < 0.0 { -*q } else { *q };
            let length = aligned.length();
            *q = if length > 1e-12 {
                aligned * (start.length() / length)
            } else {
                *start
            };
        }
        for (logit, start) in self.scene.opacity_logits.iter_mut().zip(&anchor.opacity_logits) {
            let limit = LOGIT_MAX.max(start.abs());
            *logit = logit.clamp(-limit, limit);
        }
    }

    /// λ Σ_a w_a mean_i ‖x − x⁰‖².
    pub fn anchor_loss(&self) -> f64 {
        let weights = self.weights;
        let weights = [
            weights.center / (self.unit * self.unit),
            weights.scale,
            weights.rotation,
            weights.opacity,
            weights.color,
            weights.color,
        ];
        let mut total = 0.0;
        for (group, weight) in weights.into_iter().enumerate() {
            let (x, anchor) = (coordinates(&self.scene, group), coordinates(&self.anchor, group));
            let square: f64 = x
                .iter()
                .zip(&anchor)
                .map(|(a, b)| f64::from(a - b) * f64::from(a - b))
                .sum();
            total += weight * square;
        }
        self.lambda * total / self.scene.len().max(1) as f64
    }
}

/// What each Gaussian's log scales may grow to.
fn ceilings(scene: &Scene, unit: f64, extent: f32) -> Vec<f32> {
    let most = libm::log(0.2 * f64::from(extent));
    scene
        .log_scales
        .iter()
        .map(|start| {
            let start = f64::from(start.max_element());
            let growth = (unit / libm::exp(start)).min(GROWTH_MAX - 1.0);
            most.min(start + libm::log(1.0 + growth)) as f32
        })
        .collect()
}

/// Median of the geometric means of the two larger standard deviations.
fn typical_surfel(scene: &Scene) -> f64 {
    let mut areas: Vec<f32> = (0..scene.len())
        .filter(|&i| scene.is_valid(i))
        .map(|i| scene.log_scales[i].element_sum() - scene.log_scales[i].min_element())
        .collect();
    if areas.is_empty() {
        return 1.0;
    }
    let middle = areas.len() / 2;
    let (_, &mut area, _) = areas.select_nth_unstable_by(middle, f32::total_cmp);
    libm::exp(0.5 * f64::from(area)).clamp(1e-12, 1e12)
}

fn update(prox: &ProxAdam, x: &mut [f32], anchor: &[f32], gradient: &[f32], moments: &mut Moments) {
    x.par_chunks_mut(CHUNK)
        .zip(anchor.par_chunks(CHUNK).zip(gradient.par_chunks(CHUNK)))
        .zip(
            moments
                .first
                .par_chunks_mut(CHUNK)
                .zip(moments.second.par_chunks_mut(CHUNK)),
        )
        .for_each(|((x, (anchor, gradient)), (first, second))| {
            for i in 0..x.len() {
                let (mut m, mut v) = (f64::from(first[i]), f64::from(second[i]));
                let to = prox.step(x[i].into(), anchor[i].into(), gradient[i].into(), &mut m, &mut v);
                (x[i], first[i], second[i]) = (to as f32, m as f32, v as f32);
            }
        });
}

/// A group's coordinates, flat.
fn coordinates(scene: &Scene, group: usize) -> Vec<f32> {
    let flat = |v: &[Vec3]| v.iter().flat_map(|v| v.to_array()).collect();
    match group {
        0 => flat(&scene.centers),
        1 => flat(&scene.log_scales),
        2 => scene.rotations.iter().flat_map(|q| q.to_array()).collect(),
        3 => scene.opacity_logits.clone(),
        4 => scene.sh_dc.as_flattened().to_vec(),
        _ => scene.sh_rest.clone(),
    }
}

fn set_coordinates(scene: &mut Scene, group: usize, x: &[f32]) {
    let vectors = || x.chunks_exact(3).map(Vec3::from_slice).collect();
    match group {
        0 => scene.centers = vectors(),
        1 => scene.log_scales = vectors(),
        2 => scene.rotations = x.chunks_exact(4).map(Quat::from_slice).collect(),
        3 => scene.opacity_logits = x.to_vec(),
        4 => scene.sh_dc = x.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
        _ => scene.sh_rest = x.to_vec(),
    }
}
