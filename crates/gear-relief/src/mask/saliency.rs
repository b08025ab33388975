//! A mask from what a network takes for figure.
//!
//! The network decides what is figure, the picture decides where it ends: the answer is thresholded at working size,
//! holes and crumbs go, and the boundary is cut anew at full size, as that of an automatic mask. Networks for saliency
//! fail without saying so: on dense murals they find a speck, on bordered pages everything, on patterns they
//! hesitate. So the answer is judged before it is used, by itself: how much of the canvas it takes, how decided it is,
//! and whether it is one body.

use gear_image::filter::{Connectivity, components, resize};
use gear_image::{Field, Mask, SrgbImage};

use super::frame::Window;
use super::judge::{self, Doubts};
use super::{Found, Mode, Settings, Small, relief, shape};

/// From here on a pixel is figure.
const FIGURE: f32 = 0.5;
/// Shares of the canvas outside of which an answer is no figure.
const LEAST_FILL: f64 = 0.03;
const MOST_FILL: f64 = 0.85;

/// The figure that `saliency` (0 to 1, the picture's size) shows; the whole canvas when the answer is degenerate.
pub fn from_saliency(image: &SrgbImage, saliency: &Field, settings: &Settings) -> Found {
    let (width, height) = image.size();
    if width.min(height) < 16 || saliency.is_empty() {
        return relief(width, height);
    }
    let small = Small::new(image, settings);
    let (w, h) = (small.features.width, small.features.height);
    let window = Window {
        x0: 0,
        y0: 0,
        x1: w,
        y1: h,
    };
    let saliency = resize(saliency, w, h);
    let mut mask = Mask::from_vec(w, h, saliency.data().iter().map(|&s| s >= FIGURE).collect());
    let taken = mask.count();
    let decided = decided(&saliency);
    let main = largest(&mask) as f64 / taken.max(1) as f64;
    shape::fill_holes(&mut mask, 0.002, |_| true);
    drop_small(&mut mask, 0.04);
    let measured = judge::measure(
        &mask,
        &small.features,
        &window,
        Doubts {
            told_apart: decided,
            ..Doubts::default()
        },
    );
    let doubts = Doubts { main, ..measured };
    let confidence = confidence(&doubts);
    tracing::debug!(confidence, ?doubts, "foreground of a network");
    let fine = if mask.count() > 0 {
        small.refine(image, &mask, settings)
    } else {
        Mask::filled(width, height, false)
    };
    if confidence <= settings.least_confidence || fine.count() == 0 {
        return Found {
            confidence: Some(confidence),
            doubts: Some(doubts),
            candidate: Some(fine),
            ..relief(width, height)
        };
    }
    Found {
        mask: fine,
        confidence: Some(confidence),
        mode: Mode::Figure,
        doubts: Some(doubts),
        candidate: None,
        frame: None,
    }
}

/// Of the pixels that could be figure (above a tenth) the share that surely are: near 1 for a figure with sharp sides, 0
/// for an answer that hesitates.
fn decided(saliency: &Field) -> f64 {
    let above = |least: f32| saliency.data().iter().filter(|s| **s > least).count();
    above(0.8) as f64 / above(0.1).max(1) as f64
}

fn largest(mask: &Mask) -> usize {
    components(mask, Connectivity::Eight)
        .sizes
        .iter()
        .max()
        .copied()
        .unwrap_or(0)
}

/// Drops parts below `share` of the largest.
fn drop_small(mask: &mut Mask, share: f64) {
    let parts = components(mask, Connectivity::Eight);
    let largest = parts.sizes.iter().max().copied().unwrap_or(0);
    let least = (share * largest as f64) as usize;
    for (inside, &label) in mask.data_mut().iter_mut().zip(&parts.labels) {
        *inside &= label > 0 && parts.sizes[label as usize - 1] >= least;
    }
}

fn confidence(doubts: &Doubts) -> f64 {
    let ramp = |from: f64, to: f64, x: f64| ((x - from) / (to - from)).clamp(0.0, 1.0);
    if !(LEAST_FILL..MOST_FILL).contains(&doubts.fill) {
        return 0.0;
    }
    ramp(0.25, 0.6, doubts.told_apart) * ramp(0.4, 0.7, doubts.main)
}
