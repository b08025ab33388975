//! How far a mask can be trusted.
//!
//! An honest whole-canvas relief is better than a bad mask, so every doubt multiplies the confidence down: the
//! figure must leave the rim free, be one body, be thick, fill a fair share of the canvas, not be a mere panel, have
//! a boundary that follows edges of the picture, and stand before a ground that the rim explains.

use gear_image::Mask;
use gear_image::filter::{Beyond, Connectivity, components, erode};

use super::features::{Features, squared_distance};
use super::frame::Window;

/// What was measured on a mask; all shares are in [0, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Doubts {
    /// Share of the window's rim that is not ground, before ledges were dropped.
    pub rim: f64,
    /// Share of the figure that its largest part holds.
    pub main: f64,
    /// Share of the figure that survives erosion.
    pub thick: f64,
    /// Share of the window that the figure fills.
    pub fill: f64,
    /// Share of its bounding box that the figure fills.
    pub boxy: f64,
    /// Share of the boundary that lies on an edge of the picture.
    pub edges: f64,
    /// Share of the rim that the ground's colours explain.
    pub explained: f64,
    /// The same for the third best side alone.
    pub sides: f64,
    /// Share of the ground that its colour model explains better than the figure's.
    pub told_apart: f64,
    /// Share of the ground that lies next to an edge: a ground is plainer than what stands before it.
    pub busy: f64,
    /// Share of the left and of the right rim that the figure covers, the smaller of the two.
    pub spanned: f64,
}

/// Share of the window's rim that `mask` covers.
pub fn rim_covered(mask: &Mask, window: &Window) -> f64 {
    let rim = window.rim_of(mask.width(), 1);
    let (mut hit, mut all) = (0usize, 0usize);
    for p in rim.iter().flatten() {
        all += 1;
        hit += usize::from(mask.data()[*p]);
    }
    hit as f64 / all.max(1) as f64
}

/// Smaller share of the left and right rims that `mask` covers: a band of landscape runs from side to side, a figure
/// does not.
fn spanned(mask: &Mask, window: &Window) -> f64 {
    let [_, _, left, right] = window.rim_of(mask.width(), 1);
    let covered = |side: &[usize]| side.iter().filter(|p| mask.data()[**p]).count() as f64 / side.len().max(1) as f64;
    covered(&left).min(covered(&right))
}

/// Measures a mask at working resolution; what only the search knows (`rim`, `explained`, `told_apart`) comes in
/// `known`.
pub fn measure(mask: &Mask, features: &Features, window: &Window, known: Doubts) -> Doubts {
    let area = mask.count();
    if area == 0 {
        return known;
    }
    let (w, h) = mask.size();
    let parts = components(mask, Connectivity::Eight);
    let largest = parts.sizes.iter().max().copied().unwrap_or(0);
    let steps = ((0.012 * w.max(h) as f64).round() as usize).max(1);
    let core = erode(mask, steps, Beyond::Inside).count();
    let mut bounds = (w, h, 0, 0);
    for y in 0..h {
        for x in (0..w).filter(|x| mask.at(*x, y)) {
            bounds = (
                bounds.0.min(x),
                bounds.1.min(y),
                bounds.2.max(x + 1),
                bounds.3.max(y + 1),
            );
        }
    }
    let boxed = (bounds.2 - bounds.0) * (bounds.3 - bounds.1);
    Doubts {
        main: largest as f64 / area as f64,
        thick: core as f64 / area as f64,
        fill: area as f64 / window.area().max(1) as f64,
        boxy: area as f64 / boxed.max(1) as f64,
        spanned: spanned(mask, window),
        busy: busy(mask, features, window),
        edges: boundary_on_edges(mask, features),
        ..known
    }
}

/// Least difference of colour that counts as an edge under the boundary.
const EDGE: f32 = 0.08;

/// Largest squared difference of colour across a pixel, two pixels apart or less.
fn across(features: &Features, p: usize) -> f32 {
    let w = features.width;
    [1, 2, w, 2 * w].iter().fold(0.0, |most: f32, d| {
        most.max(squared_distance(features.data[p - d], features.data[p + d]))
    })
}

/// Share of boundary pixels with an edge within two pixels.
fn boundary_on_edges(mask: &Mask, features: &Features) -> f64 {
    let (w, h) = mask.size();
    let (mut on, mut all) = (0usize, 0usize);
    for y in 2..h.saturating_sub(2) {
        for x in 2..w.saturating_sub(2) {
            let p = y * w + x;
            let inner = mask.data()[p - 1] && mask.data()[p + 1] && mask.data()[p - w] && mask.data()[p + w];
            if mask.data()[p] && !inner {
                all += 1;
                on += usize::from(across(features, p) > EDGE * EDGE);
            }
        }
    }
    on as f64 / all.max(1) as f64
}

/// Share of ground pixels next to an edge.
fn busy(mask: &Mask, features: &Features, window: &Window) -> f64 {
    let (w, h) = mask.size();
    let (mut on, mut all) = (0usize, 0usize);
    for y in window.y0.max(2)..window.y1.min(h.saturating_sub(2)) {
        for x in window.x0.max(2)..window.x1.min(w.saturating_sub(2)) {
            if !mask.at(x, y) {
                all += 1;
                on += usize::from(across(features, y * w + x) > EDGE * EDGE);
            }
        }
    }
    on as f64 / all.max(1) as f64
}

/// The confidence, 0 to 1.
pub fn confidence(d: &Doubts) -> f64 {
    let ramp = |from: f64, to: f64, x: f64| ((x - from) / (to - from)).clamp(0.0, 1.0);
    if !(0.03..0.65).contains(&d.fill) {
        return 0.0;
    }
    ramp(0.45, 0.15, d.rim)
        * ramp(0.5, 0.8, d.main)
        * ramp(0.4, 0.65, d.thick)
        * ramp(0.93, 0.85, d.boxy)
        * ramp(0.35, 0.65, d.edges)
        * ramp(0.35, 0.65, d.explained)
        * ramp(0.25, 0.5, d.sides)
        * ramp(0.6, 0.85, d.told_apart)
        * ramp(0.40, 0.20, d.busy)
        * ramp(0.012, 0.002, d.spanned)
}
