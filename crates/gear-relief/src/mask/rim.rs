//! The ground's colours, from the rim of the picture (notes C1).
//!
//! A figure is rarely cut by two sides with the same colour, so rim colours that show on at least two sides are taken
//! for the ground's. k-means on the rim, clusters with more than 30 % of two sides kept; what lies nearer
//! than a threshold to one of them, and hangs together with the rim, is the first guess of the ground.

use gear_image::Mask;
use gear_image::filter::{Connectivity, components};

use super::features::{Feature, Features, squared_distance};
use super::frame::Window;

/// The first guess.
pub struct Rim {
    /// Ground: near to a ground colour and reached from the rim. Everything beyond the window is ground too.
    pub ground: Mask,
    /// Share of the rim's pixels that the ground's colours explain, 0 to 1.
    pub explained: f64,
    /// The same for the side that is third best explained: a figure may be cut by one side, not by two.
    pub sides: f64,
}

const CLUSTERS: usize = 4;
/// Share of a side that a ground colour holds, on two sides at least.
const SHARE: f64 = 0.25;

/// Finds the ground as seen from the rim of `window`; `None` when no colour holds two sides.
pub fn ground(features: &Features, window: &Window) -> Option<Rim> {
    let sides = window.rim_of(features.width, (window.width().min(window.height()) / 40).max(2));
    let rim: Vec<(usize, Feature)> = sides
        .iter()
        .enumerate()
        .flat_map(|(s, ps)| ps.iter().map(move |p| (s, *p)))
        .map(|(s, p)| (s, features.data[p]))
        .collect();
    if rim.is_empty() {
        return None;
    }
    let mut centers: Vec<Feature> = (0..CLUSTERS)
        .map(|k| rim[k * (rim.len() - 1) / (CLUSTERS - 1)].1)
        .collect();
    let mut nearest = vec![0usize; rim.len()];
    for _ in 0..12 {
        for (n, (_, c)) in nearest.iter_mut().zip(&rim) {
            *n = closest(&centers, *c).0;
        }
        for (k, center) in centers.iter_mut().enumerate() {
            let (mut sum, mut count) = ([0.0f64; 3], 0u32);
            for (_, (_, c)) in nearest.iter().zip(&rim).filter(|(n, _)| **n == k) {
                count += 1;
                for (s, v) in sum.iter_mut().zip(c) {
                    *s += f64::from(*v);
                }
            }
            if count > 0 {
                *center = sum.map(|s| (s / f64::from(count)) as f32);
            }
        }
    }
    let total: Vec<f64> = sides.iter().map(|s| s.len().max(1) as f64).collect();
    let kept: Vec<Feature> = (0..CLUSTERS)
        .filter(|&k| {
            let held = |side: usize| {
                nearest
                    .iter()
                    .zip(&rim)
                    .filter(|(n, (s, _))| **n == k && *s == side)
                    .count() as f64
            };
            (0..4).filter(|&side| held(side) > SHARE * total[side]).count() >= 2
        })
        .map(|k| centers[k])
        .collect();
    if kept.is_empty() {
        return None;
    }
    let mut spread: Vec<f32> = rim
        .iter()
        .zip(&nearest)
        .filter(|(_, n)| kept.contains(&centers[**n]))
        .map(|((_, c), _)| closest(&kept, *c).1.sqrt())
        .collect();
    let quantile = gear_image::stats::quantile_in_place(&mut spread, 0.95).unwrap_or(0.0);
    let threshold = (1.3 * quantile).clamp(0.025, 0.075);
    let near_ground = |c: &Feature| closest(&kept, *c).1.sqrt() <= threshold;
    let mut by_side = sides
        .each_ref()
        .map(|side| side.iter().filter(|p| near_ground(&features.data[**p])).count() as f64 / side.len().max(1) as f64);
    by_side.sort_by(f64::total_cmp);
    let explained = rim.iter().filter(|(_, c)| near_ground(c)).count() as f64 / rim.len() as f64;

    let near = Mask::from_fn(features.width, features.height, |x, y| {
        let p = y * features.width + x;
        window.contains(x, y) && closest(&kept, features.data[p]).1 <= threshold * threshold
    });
    let parts = components(&near, Connectivity::Four);
    let mut reached = vec![false; parts.sizes.len() + 1];
    for p in sides.iter().flatten() {
        reached[parts.labels[*p] as usize] = true;
    }
    reached[0] = false;
    let ground = Mask::from_fn(features.width, features.height, |x, y| {
        !window.contains(x, y) || reached[parts.labels[y * features.width + x] as usize]
    });
    Some(Rim {
        ground,
        explained,
        sides: by_side[1],
    })
}

fn closest(centers: &[Feature], c: Feature) -> (usize, f32) {
    let mut best = (0, f32::MAX);
    for (k, center) in centers.iter().enumerate() {
        let d = squared_distance(*center, c);
        if d < best.1 {
            best = (k, d);
        }
    }
    best
}
