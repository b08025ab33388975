//! The cheapest boundary: figure and ground as a minimum cut (Boykov and Jolly 2001; Rother et al., GrabCut, 2004).
//!
//! ```text
//! E(mask) = Σ_p unary(p) + Σ_{neighbours p,q on different sides} γ exp(−|c_p − c_q|² / 2⟨|Δc|²⟩) / |p − q|
//! ```
//! over the eight neighbours; a boundary is cheap where colour changes and dear where it does not.

use super::features::{Features, squared_distance};
use super::maxflow::Network;
use gear_image::math;

/// What is known about a pixel beforehand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Prior {
    /// Certainly ground.
    Ground,
    /// Certainly figure.
    Figure,
    /// ln p(colour | figure) − ln p(colour | ground).
    Evidence(f32),
}

/// Steps of an integer capacity that make one nat.
const UNIT: f32 = 256.0;
/// A capacity that no boundary can buy off.
const HARD: i32 = 1 << 26;
/// Evidence beyond this many nats counts no more: one odd pixel must not outvote its surroundings.
const LIMIT: f32 = 6.0;

/// The neighbours that make each pair once.
const PAIRS: [(isize, isize, f32); 4] = [
    (1, 0, 1.0),
    (0, 1, 1.0),
    (1, 1, std::f32::consts::FRAC_1_SQRT_2),
    (-1, 1, std::f32::consts::FRAC_1_SQRT_2),
];

/// Mean squared difference of neighbours: what counts as an edge in this picture.
fn mean_contrast(features: &Features) -> f32 {
    let (w, h) = (features.width, features.height);
    let (mut sum, mut count) = (0.0f64, 0u64);
    for y in 0..h {
        for x in 0..w {
            let here = features.data[y * w + x];
            if x + 1 < w {
                sum += f64::from(squared_distance(here, features.data[y * w + x + 1]));
                count += 1;
            }
            if y + 1 < h {
                sum += f64::from(squared_distance(here, features.data[(y + 1) * w + x]));
                count += 1;
            }
        }
    }
    (sum / count.max(1) as f64) as f32
}

/// The minimum cut: true for figure. `smoothness` is γ in nats.
pub fn cut(features: &Features, priors: &[Prior], smoothness: f32) -> Vec<bool> {
    let (w, h) = (features.width, features.height);
    let beta = 0.5 / mean_contrast(features).max(1e-8);
    // only undecided pixels become nodes; links to decided ones go to the terminals
    let mut node = vec![u32::MAX; priors.len()];
    let mut open = Vec::new();
    for (p, prior) in priors.iter().enumerate() {
        if matches!(prior, Prior::Evidence(_)) {
            node[p] = open.len() as u32;
            open.push(p);
        }
    }
    let mut network = Network::new(open.len(), 4 * open.len());
    for (n, &p) in open.iter().enumerate() {
        if let Prior::Evidence(e) = priors[p] {
            let e = if e.is_finite() {
                (e.clamp(-LIMIT, LIMIT) * UNIT) as i32
            } else {
                0
            };
            network.link_terminals(n, e.max(0), (-e).max(0));
        }
    }
    for y in 0..h {
        for x in 0..w {
            let p = y * w + x;
            for (dx, dy, share) in PAIRS {
                let (i, j) = (x as isize + dx, y as isize + dy);
                if i < 0 || i >= w as isize || j >= h as isize {
                    continue;
                }
                let q = j as usize * w + i as usize;
                if node[p] == u32::MAX && node[q] == u32::MAX {
                    continue;
                }
                let apart = squared_distance(features.data[p], features.data[q]);
                let weight = (smoothness * share * math::exp(-beta * apart) * UNIT) as i32;
                match (node[p], node[q]) {
                    (u32::MAX, n) => tie(&mut network, n, priors[p], weight),
                    (n, u32::MAX) => tie(&mut network, n, priors[q], weight),
                    (a, b) => network.link(a as usize, b as usize, weight, weight),
                }
            }
        }
    }
    network.solve();
    (0..priors.len())
        .map(|p| match priors[p] {
            Prior::Ground => false,
            Prior::Figure => true,
            Prior::Evidence(_) => network.on_source_side(node[p] as usize),
        })
        .collect()
}

fn tie(network: &mut Network, node: u32, decided: Prior, weight: i32) {
    let weight = weight.min(HARD);
    match decided {
        Prior::Figure => network.link_terminals(node as usize, weight, 0),
        _ => network.link_terminals(node as usize, 0, weight),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_halves(noise: f32) -> Features {
        let data = (0..20 * 10)
            .map(|p| {
                let x = p % 20;
                let base = if x < 8 { 0.2 } else { 0.6 };
                [base + noise * ((p * 7919 % 13) as f32 / 13.0 - 0.5), 0.0, 0.0]
            })
            .collect();
        Features {
            width: 20,
            height: 10,
            data,
        }
    }

    #[test]
    fn the_boundary_snaps_to_the_edge_of_colour() {
        let features = two_halves(0.05);
        let priors: Vec<Prior> = (0..200)
            .map(|p| match p % 20 {
                0 => Prior::Ground,
                19 => Prior::Figure,
                _ => Prior::Evidence(0.0),
            })
            .collect();
        let mask = cut(&features, &priors, 5.0);
        for (p, inside) in mask.iter().enumerate() {
            assert_eq!(*inside, p % 20 >= 8, "pixel {p}");
        }
    }

    #[test]
    fn a_lonely_pixel_is_outvoted() {
        let features = Features {
            width: 9,
            height: 9,
            data: vec![[0.4, 0.0, 0.0]; 81],
        };
        let mut priors = vec![Prior::Evidence(-1.0); 81];
        priors[40] = Prior::Evidence(3.0);
        assert!(cut(&features, &priors, 4.0).iter().all(|inside| !inside));
    }
}
