//! A scene under optimisation: its anchor, Adam's moments, the limits of its attributes.
//!
//! A step reads and writes every coordinate once, where it lies: the attributes of the scene, of its anchor and of
//! the gradient are looked at as flat coordinates, chunk by chunk on all threads. An attribute without a step size is
//! frozen: nothing is kept for it, and the rasteriser is not asked for its gradient.

use bytemuck::{cast_slice, cast_slice_mut};
use glam::Vec3;
use rayon::prelude::*;

use super::RefineOptions;
use super::density::Generations;
use super::prox::{ProxAdam, Steps};
use crate::Scene;
use crate::cpu::SimdLevel;
use crate::cpu::simd::simd_kernels;
use crate::render::{SceneGradients, Wanted};
use crate::sh::Y0;

/// Added to √v̂. The data gradient is a mean over pixels, about 1e-6; this stays far below.
const EPSILON: f64 = 1e-15;
/// Opacity logits are held within this.
const LOGIT_MAX: f32 = 9.0;
/// SH coefficients of degree 0 are held within this: black to white.
const DC_MAX: f32 = 0.5 / Y0;
/// Largest ratio of a Gaussian's scales.
const NEEDLE_MAX: f32 = 200.0;
/// A standard deviation grows to at most so many times the largest one that the Gaussian began with, and by no more
/// than a typical surfel. At the rim of a picture nobody looks at what lies beyond, and without this limit small
/// Gaussians grow whiskers there, and the large ones of a plain back grow shadows around it.
const GROWTH_MAX: f64 = 2.0;
/// Gaussians, or coordinates, handled by one task.
pub(super) const CHUNK: usize = 4096;

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

/// A group of attributes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Group {
    Centers,
    LogScales,
    Rotations,
    OpacityLogits,
    Colors,
    HigherColors,
}

impl Group {
    pub const ALL: [Self; 6] = [
        Self::Centers,
        Self::LogScales,
        Self::Rotations,
        Self::OpacityLogits,
        Self::Colors,
        Self::HigherColors,
    ];

    /// The group's coordinates.
    pub fn of(self, scene: &Scene) -> &[f32] {
        match self {
            Self::Centers => cast_slice(&scene.centers),
            Self::LogScales => cast_slice(&scene.log_scales),
            Self::Rotations => cast_slice(&scene.rotations),
            Self::OpacityLogits => &scene.opacity_logits,
            Self::Colors => scene.sh_dc.as_flattened(),
            Self::HigherColors => &scene.sh_rest,
        }
    }

    pub fn of_mut(self, scene: &mut Scene) -> &mut [f32] {
        match self {
            Self::Centers => cast_slice_mut(&mut scene.centers),
            Self::LogScales => cast_slice_mut(&mut scene.log_scales),
            Self::Rotations => cast_slice_mut(&mut scene.rotations),
            Self::OpacityLogits => &mut scene.opacity_logits,
            Self::Colors => scene.sh_dc.as_flattened_mut(),
            Self::HigherColors => &mut scene.sh_rest,
        }
    }

    /// The derivatives by the group's coordinates; empty if they were not wanted.
    fn of_gradient(self, gradients: &SceneGradients) -> &[f32] {
        match self {
            Self::Centers => cast_slice(&gradients.centers),
            Self::LogScales => cast_slice(&gradients.log_scales),
            Self::Rotations => cast_slice(&gradients.rotations),
            Self::OpacityLogits => &gradients.opacity_logits,
            Self::Colors => gradients.sh_dc.as_flattened(),
            Self::HigherColors => &gradients.sh_rest,
        }
    }

    fn of_gradient_mut(self, gradients: &mut SceneGradients) -> &mut [f32] {
        match self {
            Self::Centers => cast_slice_mut(&mut gradients.centers),
            Self::LogScales => cast_slice_mut(&mut gradients.log_scales),
            Self::Rotations => cast_slice_mut(&mut gradients.rotations),
            Self::OpacityLogits => &mut gradients.opacity_logits,
            Self::Colors => gradients.sh_dc.as_flattened_mut(),
            Self::HigherColors => &mut gradients.sh_rest,
        }
    }
}

/// First and second moments of a group's coordinates; empty until the group moves.
#[derive(Clone, Default)]
pub(super) struct Moments {
    pub first: Vec<f32>,
    pub second: Vec<f32>,
    /// Steps that went into them.
    pub steps: usize,
}

#[derive(Clone)]
pub(super) struct Anchored {
    pub scene: Scene,
    pub anchor: Scene,
    rates: Rates,
    weights: Rates,
    lambda: f64,
    pub generations: Generations,
    pub extent: f32,
    /// The typical surfel, world units.
    pub unit: f64,
    /// Largest log scale of each Gaussian.
    pub ceilings: Vec<f32>,
    /// Factor of the anchor's weight for each Gaussian; empty while all belong to the first generation.
    pub firmness: Vec<f32>,
    pub moments: [Moments; Group::ALL.len()],
    /// What the next step will use.
    gradients: Option<SceneGradients>,
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
            generations: options.generations,
            extent,
            unit,
            ceilings: scene
                .log_scales
                .iter()
                .map(|&start| growth_limit(start, unit, extent))
                .collect(),
            firmness: Vec::new(),
            moments: Default::default(),
            gradients: None,
        }
    }

    /// What of `phase` moves at all.
    pub fn wanted(&self, phase: Wanted) -> Wanted {
        Wanted {
            centers: phase.centers && self.rates.center > 0.0,
            log_scales: phase.log_scales && self.rates.scale > 0.0,
            rotations: phase.rotations && self.rates.rotation > 0.0,
            opacity_logits: phase.opacity_logits && self.rates.opacity > 0.0,
            colors: phase.colors && self.rates.color > 0.0,
        }
    }

    /// Adds a gradient to what the next step will use.
    pub fn gather(&mut self, gradients: SceneGradients) {
        let Some(total) = &mut self.gradients else {
            self.gradients = Some(gradients);
            return;
        };
        for group in Group::ALL {
            let parts = group.of_gradient(&gradients).par_chunks(CHUNK);
            let totals = group.of_gradient_mut(total).par_chunks_mut(CHUNK);
            totals
                .zip(parts)
                .for_each(|(total, part)| total.iter_mut().zip(part).for_each(|(a, b)| *a += b));
        }
    }

    /// A group's step size, and the anchor's weight per squared coordinate.
    fn plan(&self, group: Group) -> (f64, f64) {
        let (rates, weights) = (self.rates, self.weights);
        match group {
            Group::Centers => (rates.center * self.unit, weights.center / (self.unit * self.unit)),
            Group::LogScales => (rates.scale, weights.scale),
            Group::Rotations => (rates.rotation, weights.rotation),
            Group::OpacityLogits => (rates.opacity, weights.opacity),
            Group::Colors => (rates.color, weights.color),
            Group::HigherColors => (rates.color / 20.0, weights.color),
        }
    }

    /// Uses up the gathered gradients. `decay` scales all rates. Returns how many Gaussians were left out because a
    /// derivative was not finite.
    pub fn step(&mut self, phase: Wanted, decay: f64) -> usize {
        let mut gradients = self.gradients.take().unwrap_or_default();
        let skipped = drop_not_finite(&mut gradients, self.scene.len());
        for (k, group) in Group::ALL.into_iter().enumerate() {
            let (rate, weight) = self.plan(group);
            let gradient = group.of_gradient(&gradients);
            if gradient.is_empty() || rate == 0.0 {
                continue;
            }
            let moments = &mut self.moments[k];
            moments.steps += 1;
            moments.first.resize(gradient.len(), 0.0);
            moments.second.resize(gradient.len(), 0.0);
            let mu = curvature(self.lambda, weight, self.scene.len());
            let steps = ProxAdam::new(moments.steps, rate * decay, mu, EPSILON).steps();
            let x = group.of_mut(&mut self.scene);
            let anchor = group.of(&self.anchor);
            if self.firmness.is_empty() {
                let steps = steps.firmer(self.generations.first as f32);
                update(&steps, x, anchor, gradient, moments);
            } else {
                update_each(&steps, &self.firmness, x, anchor, gradient, moments);
            }
        }
        self.restrain_colors();
        if phase == Wanted::ALL {
            self.restrain();
        }
        skipped
    }

    /// Keeps colours between black and white. A view blends a few Gaussians a pixel, so one that is brighter than white
    /// can make up for its neighbours in the views that were looked at; from between them it is a glaring speck. Colours
    /// that change with the direction have no such limits.
    pub fn restrain_colors(&mut self) {
        if self.scene.sh_degree > 0 {
            return;
        }
        let starts = self.anchor.sh_dc.as_flattened().par_iter();
        let colors = self.scene.sh_dc.as_flattened_mut().par_iter_mut();
        colors
            .zip(starts)
            .with_min_len(CHUNK)
            .for_each(|(x, start)| *x = x.clamp((-DC_MAX).min(*start), DC_MAX.max(*start)));
    }

    /// μ of every coordinate of the colours of degree 0, and the gradient of the anchor by it.
    pub fn color_anchor(&self) -> (Vec<f32>, Vec<f32>) {
        let (_, weight) = self.plan(Group::Colors);
        let (mu, first) = (
            curvature(self.lambda, weight, self.scene.len()),
            self.generations.first as f32,
        );
        let firmness = |i: usize| self.firmness.get(i / 3).copied().unwrap_or(first);
        let x = Group::Colors.of(&self.scene);
        let mus: Vec<f32> = (0..x.len()).map(|i| (mu * f64::from(firmness(i))) as f32).collect();
        let pairs = x.iter().zip(Group::Colors.of(&self.anchor)).zip(&mus);
        let slopes = pairs.map(|((x, start), mu)| mu * (x - start)).collect();
        (mus, slopes)
    }

    /// Which colours are at a limit and cannot follow the loss down its `slope`.
    pub fn held_colors(&self, slope: &[f32]) -> Vec<bool> {
        let colors = Group::Colors.of(&self.scene).iter().zip(Group::Colors.of(&self.anchor));
        let limited = self.scene.sh_degree == 0;
        let held = |((x, start), slope): ((&f32, &f32), &f32)| {
            let (low, high) = ((-DC_MAX).min(*start), DC_MAX.max(*start));
            limited && ((*x <= low && *slope > 0.0) || (*x >= high && *slope < 0.0))
        };
        colors.zip(slope).map(held).collect()
    }

    /// Keeps the attributes where they make sense: unit quaternions on the anchor's side, scales of 1e-4 to 0.2 extents,
    /// no needles and no whiskers, opacities that can still change.
    fn restrain(&mut self) {
        let ln = |x: f32| libm::log(f64::from(x)) as f32;
        let (least, ratio) = (ln(1e-4 * self.extent), ln(NEEDLE_MAX));
        let anchor = &self.anchor;
        let limits = anchor.log_scales.par_iter().zip(&self.ceilings);
        let scales = self.scene.log_scales.par_iter_mut().zip(limits);
        scales.with_min_len(CHUNK).for_each(|(scales, (start, ceiling))| {
            // What came outside the limits may stay there, but go no farther.
            let low = Vec3::splat(least).min(*start);
            let high = Vec3::splat(*ceiling).max(*start);
            let held = scales.clamp(low, high);
            let allowed = ratio.max(start.max_element() - start.min_element());
            *scales = held.max(Vec3::splat(held.max_element() - allowed));
        });
        let rotations = self.scene.rotations.par_iter_mut().zip(&anchor.rotations);
        rotations.with_min_len(CHUNK).for_each(|(q, start)| {
            let aligned = if q.dot(*start) < 0.0 { -*q } else { *q };
            let length = aligned.length();
            *q = if length > 1e-12 {
                aligned * (start.length() / length)
            } else {
                *start
            };
        });
        let logits = self.scene.opacity_logits.par_iter_mut().zip(&anchor.opacity_logits);
        logits.with_min_len(CHUNK).for_each(|(logit, start)| {
            let limit = LOGIT_MAX.max(start.abs());
            *logit = logit.clamp(-limit, limit);
        });
    }

    /// λ Σ_a w_a mean_i f_i ‖x − x⁰‖², with the firmness f of each Gaussian.
    pub fn anchor_loss(&self) -> f64 {
        let mut total = 0.0;
        for group in Group::ALL {
            let (_, weight) = self.plan(group);
            let x = group.of(&self.scene);
            let width = (x.len() / self.scene.len().max(1)).max(1);
            let parts = x.par_chunks(CHUNK * width).enumerate();
            let squares: Vec<f64> = parts
                .zip(group.of(&self.anchor).par_chunks(CHUNK * width))
                .map(|((chunk, x), anchor)| {
                    let firmness = self.firmness.get(chunk * CHUNK..).unwrap_or_default();
                    squares(x, anchor, width, firmness)
                })
                .collect();
            let generations = if self.firmness.is_empty() {
                self.generations.first
            } else {
                1.0
            };
            total += weight * generations * squares.iter().sum::<f64>();
        }
        self.lambda * total / self.scene.len().max(1) as f64
    }
}

/// μ of a group in a scene of `n` Gaussians.
fn curvature(lambda: f64, weight: f64, n: usize) -> f64 {
    2.0 * lambda * weight / n.max(1) as f64
}

/// Σ f_i ‖x_i − x⁰_i‖² over Gaussians of `width` coordinates; without `firmness`, f is 1.
fn squares(x: &[f32], anchor: &[f32], width: usize, firmness: &[f32]) -> f64 {
    let square = |(a, b): (&f32, &f32)| f64::from(a - b) * f64::from(a - b);
    if firmness.is_empty() {
        return x.iter().zip(anchor).map(square).sum();
    }
    let each = x.chunks_exact(width).zip(anchor.chunks_exact(width)).zip(firmness);
    each.map(|((x, anchor), firmness)| f64::from(*firmness) * x.iter().zip(anchor).map(square).sum::<f64>())
        .sum()
}

/// Zeroes the gradients of Gaussians with a derivative that is not finite; returns how many.
fn drop_not_finite(gradients: &mut SceneGradients, n: usize) -> usize {
    let level = SimdLevel::current();
    let finite = |group: Group| {
        let parts = group.of_gradient(gradients).par_chunks(CHUNK);
        parts.all(|part| {
            let mut found = 0;
            find_not_finite(level, part, &mut found);
            found == 0
        })
    };
    if n == 0 || Group::ALL.into_iter().all(finite) {
        return 0;
    }
    let mut bad = vec![false; n];
    for group in Group::ALL {
        let gradient = group.of_gradient(gradients);
        for (bad, part) in bad.iter_mut().zip(gradient.chunks_exact((gradient.len() / n).max(1))) {
            *bad |= part.iter().any(|g| !g.is_finite());
        }
    }
    for group in Group::ALL {
        let gradient = group.of_gradient_mut(gradients);
        let width = (gradient.len() / n).max(1);
        let parts = bad.iter().zip(gradient.chunks_exact_mut(width));
        parts.filter(|(bad, _)| **bad).for_each(|(_, part)| part.fill(0.0));
    }
    bad.into_iter().filter(|&b| b).count()
}

/// What the log scales of a Gaussian that began with `start` may grow to.
pub(super) fn growth_limit(start: Vec3, unit: f64, extent: f32) -> f32 {
    let most = libm::log(0.2 * f64::from(extent));
    let start = f64::from(start.max_element());
    let growth = (unit / libm::exp(start)).min(GROWTH_MAX - 1.0);
    most.min(start + libm::log(1.0 + growth)) as f32
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

/// One step of all coordinates of a group.
fn update(steps: &Steps, x: &mut [f32], anchor: &[f32], gradient: &[f32], moments: &mut Moments) {
    let level = SimdLevel::current();
    let first = moments.first.par_chunks_mut(CHUNK);
    let second = moments.second.par_chunks_mut(CHUNK);
    x.par_chunks_mut(CHUNK)
        .zip(anchor.par_chunks(CHUNK).zip(gradient.par_chunks(CHUNK)))
        .zip(first.zip(second))
        .for_each(|((x, (anchor, gradient)), (first, second))| {
            update_chunk(level, steps, x, anchor, gradient, first, second);
        });
}

/// [`update`], with an anchor of its own weight for each Gaussian.
fn update_each(
    steps: &Steps,
    firmness: &[f32],
    x: &mut [f32],
    anchor: &[f32],
    gradient: &[f32],
    moments: &mut Moments,
) {
    let width = (x.len() / firmness.len().max(1)).max(1);
    let first = moments.first.par_chunks_exact_mut(width);
    let second = moments.second.par_chunks_exact_mut(width);
    x.par_chunks_exact_mut(width)
        .zip(anchor.par_chunks_exact(width).zip(gradient.par_chunks_exact(width)))
        .zip(first.zip(second))
        .zip(firmness)
        .with_min_len(CHUNK)
        .for_each(|(((x, (anchor, gradient)), (first, second)), firmness)| {
            let steps = steps.firmer(*firmness);
            for i in 0..width {
                x[i] = steps.step(x[i], anchor[i], gradient[i], &mut first[i], &mut second[i]);
            }
        });
}

simd_kernels! {
    fn update_chunk(
        steps: &Steps,
        x: &mut [f32],
        anchor: &[f32],
        gradient: &[f32],
        first: &mut [f32],
        second: &mut [f32],
    ) {
        let len = x.len();
        let (anchor, gradient) = (&anchor[..len], &gradient[..len]);
        let (first, second) = (&mut first[..len], &mut second[..len]);
        for i in 0..len {
            x[i] = steps.step(x[i], anchor[i], gradient[i], &mut first[i], &mut second[i]);
        }
    }

    /// Sets a bit of `found` if a number is NaN or infinite.
    fn find_not_finite(values: &[f32], found: &mut u32) {
        let mut any = 0;
        for x in values {
            any |= u32::from(x.abs() >= f32::INFINITY) | u32::from(x.is_nan());
        }
        *found = any;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Gaussian;
    use glam::Quat;

    /// Conjugate gradients solve with μ and the slopes of [`Anchored::color_anchor`], and stop by [`Anchored::anchor_loss`]:
    /// the one must be the derivative of the other, Gaussian by Gaussian.
    #[test]
    fn the_anchor_of_colours_is_the_slope_of_its_loss_for_every_firmness() {
        let mut scene = Scene::default();
        for i in 0..4 {
            scene.push(Gaussian {
                center: Vec3::X * 0.1 * i as f32,
                scales: Vec3::splat(0.05),
                rotation: Quat::IDENTITY,
                opacity: 0.9,
                color: [0.5; 3],
            });
        }
        let options = RefineOptions {
            anchor: 3.0,
            ..RefineOptions::default()
        };
        for firmness in [vec![], vec![1.0, 0.25, 8.0, 0.0]] {
            let mut anchored = Anchored::new(&scene, &options);
            anchored.firmness = firmness.clone();
            for (i, x) in anchored.scene.sh_dc.as_flattened_mut().iter_mut().enumerate() {
                *x += 0.1 * (i as f32 - 5.0);
            }
            let (mus, slopes) = anchored.color_anchor();
            let step = 1e-2f32;
            for i in 0..slopes.len() {
                let at = |by: f32| {
                    let mut moved = anchored.clone();
                    moved.scene.sh_dc.as_flattened_mut()[i] += by;
                    moved.anchor_loss()
                };
                let slope = (at(step) - at(-step)) / f64::from(2.0 * step);
                assert!(
                    (slope - f64::from(slopes[i])).abs() < 1e-5 + 1e-4 * slope.abs(),
                    "{firmness:?}, {i}: {slope}"
                );
                let bend = (at(step) - 2.0 * at(0.0) + at(-step)) / f64::from(step * step);
                assert!(
                    (bend - f64::from(mus[i])).abs() < 1e-3 + 1e-2 * bend,
                    "{firmness:?}, {i}: {bend} {}",
                    mus[i]
                );
            }
        }
    }
}
