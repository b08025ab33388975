//! DDI, depth detail index: 100 H √A at a yaw, and its mean over yaws.
//!
//! The paper names the metric and its purpose but gives no formula; this definition is ours, and its numbers do
//! not compare with the paper's. It measures how much detail there is, not whether the detail is right: noise has
//! the most.
//!
//! * H = q/(q + 0.15) of the depth map seen at that yaw, q = mean over s ∈ {0.02, 0.03, 0.04} of
//!   mean |(I − G)² d| / (s · diameter), with σ = s · diameter and diameter = √(visible area). Applying I − G twice
//!   removes planes exactly and smooth curvature to fourth order. G is a Gaussian normalised inside the
//!   silhouette, the mean is taken 3σ away from it (a silhouette is no detail), and |·| is capped at
//!   5 · median + 10⁻³ · diameter, so that a jump in depth counts once, whatever its height.
//! * A = σ₃/σ₁ of the centres (see [`crate::vend`]): a flat board has no depth to be detailed.

use gear_image::Mask;
use gear_image::filter::{self, Beyond};

/// Smoothing scales, shares of the diameter.
const SCALES: [f64; 3] = [0.02, 0.03, 0.04];
/// Detail at which H is one half.
const HALF: f64 = 0.15;
/// Fewer visible pixels than this show no detail.
const MIN_PIXELS: usize = 64;
/// Fewer pixels than this inside the eroded silhouette are no sample.
const MIN_CORE: usize = 32;

/// A depth map in units of its pixels. Sign and offset do not matter.
#[derive(Clone, Debug)]
pub struct DepthMap {
    /// Where something is seen.
    pub visible: Mask,
    /// Depth in pixels, row-major; any value where nothing is seen.
    pub depth: Vec<f64>,
}

/// DDI at one yaw, in 0..=100, from the depth seen there and the scene's principal deviations, largest first.
pub fn ddi(map: &DepthMap, deviations: [f64; 3]) -> f64 {
    if deviations[0] <= 0.0 {
        return 0.0;
    }
    100.0 * detail(map) * (deviations[2] / deviations[0]).sqrt()
}

/// Detail H of a depth map, in 0..1; 0 where no scale leaves a core.
pub fn detail(map: &DepthMap) -> f64 {
    let visible = &map.visible;
    if visible.count() < MIN_PIXELS {
        return 0.0;
    }
    let closed = filter::close(visible, 1);
    let filled = Mask::from_fn(visible.width(), visible.height(), |x, y| {
        visible.at(x, y) || closed.at(x, y)
    });
    let depth = without_pinholes(map);
    let diameter = (filled.count() as f64).sqrt();
    let amounts: Vec<f64> = SCALES
        .iter()
        .filter_map(|s| Some(band(&depth, &filled, (s * diameter).max(0.7), diameter)? / (s * diameter)))
        .collect();
    if amounts.is_empty() {
        return 0.0;
    }
    let q = amounts.iter().fold(0.0, |sum, a| sum + a) / amounts.len() as f64;
    q / (q + HALF)
}

/// Depth less its median, unseen pixels filled from the nearest seen one.
fn without_pinholes(map: &DepthMap) -> Vec<f64> {
    let Some(nearest) = filter::nearest(&map.visible) else {
        return map.depth.clone();
    };
    let seen: Vec<f64> = map
        .depth
        .iter()
        .zip(map.visible.data())
        .filter_map(|(d, &seen)| seen.then_some(*d))
        .collect();
    let middle = median(seen);
    let width = map.visible.width();
    (0..map.depth.len())
        .map(|i| {
            let (x, y) = nearest.at(i % width, i / width);
            map.depth[y * width + x] - middle
        })
        .collect()
}

/// Mean of capped |(I − G)² d| over the core; `None` when the core is too small.
fn band(depth: &[f64], mask: &Mask, sigma: f64, diameter: f64) -> Option<f64> {
    let core = filter::erode(mask, (3.0 * sigma).ceil() as usize, Beyond::Outside);
    if core.count() < MIN_CORE {
        return None;
    }
    let inside: Vec<f64> = mask.data().iter().map(|&m| f64::from(u8::from(m))).collect();
    let weight = gaussian(&inside, mask.size(), sigma);
    let high = |d: &[f64]| -> Vec<f64> {
        let masked: Vec<f64> = d.iter().zip(&inside).map(|(d, m)| d * m).collect();
        let low = gaussian(&masked, mask.size(), sigma);
        let low = low.iter().zip(&weight).map(|(l, w)| l / w.max(1e-9));
        d.iter().zip(low).map(|(d, l)| d - l).collect()
    };
    let twice = high(&high(depth));
    let mut amounts: Vec<f64> = twice
        .iter()
        .zip(core.data())
        .filter_map(|(v, &m)| m.then_some(v.abs()))
        .collect();
    let cap = 5.0 * median(amounts.clone()) + 1e-3 * diameter;
    for amount in &mut amounts {
        *amount = amount.min(cap);
    }
    Some(amounts.iter().fold(0.0, |sum, a| sum + a) / amounts.len() as f64)
}

/// The middle value, or the mean of the middle two. Panics on none: callers have at least [`MIN_CORE`].
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    (values[(n - 1) / 2] + values[n / 2]) / 2.0
}

/// Separable Gaussian in f64, cut at 4σ, mirrored rim: second differences of depth need more than f32.
fn gaussian(field: &[f64], (width, height): (usize, usize), sigma: f64) -> Vec<f64> {
    let radius = (4.0 * sigma + 0.5) as isize;
    let kernel: Vec<f64> = (-radius..=radius)
        .map(|d| libm::exp(-0.5 * (d as f64 / sigma) * (d as f64 / sigma)))
        .collect();
    let sum = kernel.iter().fold(0.0, |s, k| s + k);
    let kernel: Vec<f64> = kernel.iter().map(|k| k / sum).collect();
    let mirrored = |i: isize, n: usize| {
        let period = 2 * n as isize;
        let i = i.rem_euclid(period);
        (if i >= n as isize { period - 1 - i } else { i }) as usize
    };
    let mut down = vec![0.0; field.len()];
    for (y, out) in down.chunks_exact_mut(width).enumerate() {
        for (k, w) in kernel.iter().enumerate() {
            let from = mirrored(y as isize + k as isize - radius, height);
            for (out, v) in out.iter_mut().zip(&field[from * width..(from + 1) * width]) {
                *out += w * v;
            }
        }
    }
    let mut across = vec![0.0; field.len()];
    let mut padded = vec![0.0; width + 2 * radius as usize];
    for (row, out) in down.chunks_exact(width).zip(across.chunks_exact_mut(width)) {
        for (i, p) in padded.iter_mut().enumerate() {
            *p = row[mirrored(i as isize - radius, width)];
        }
        for (k, w) in kernel.iter().enumerate() {
            for (out, v) in out.iter_mut().zip(&padded[k..]) {
                *out += w * v;
            }
        }
    }
    across
}

#[cfg(test)]
mod tests {
    use super::*;

    const ORACLE: &str = include_str!("../../../tests/oracles/ddi.json");

    /// The oracle's depth maps, 128 × 128.
    fn map(case: &str) -> DepthMap {
        let side = 128;
        let disc = |x: f64, y: f64| (x - 63.0) * (x - 63.0) + (y - 60.0) * (y - 60.0) < 52.0 * 52.0;
        let visible = Mask::from_fn(side, side, |i, j| {
            let (x, y) = (i as f64, j as f64);
            match case {
                "step" => true,
                "sliver" => (x - 60.0).abs() < 2.0,
                "ripples_with_pinholes" => disc(x, y) && !(i % 17 == 3 && j % 13 == 5),
                _ => disc(x, y),
            }
        });
        let depth = |i: usize| {
            let (x, y) = ((i % side) as f64, (i / side) as f64);
            match case {
                "plane" => 0.3 * x - 0.2 * y,
                "ball" => (56.0 * 56.0 - (x - 63.0) * (x - 63.0) - (y - 60.0) * (y - 60.0))
                    .max(0.0)
                    .sqrt(),
                "step" => 10.0 * f64::from(u8::from(x > 60.0)),
                "sliver" => 0.0,
                _ => libm::sin(x / 4.0) * 2.0 + libm::cos(y / 5.0) * 1.5,
            }
        };
        DepthMap {
            visible,
            depth: (0..side * side).map(depth).collect(),
        }
    }

    #[test]
    fn detail_is_the_prototypes() {
        let oracle: serde_json::Value = serde_json::from_str(ORACLE).unwrap();
        let tolerance = oracle["tolerance"]["absolute"].as_f64().unwrap();
        for case in oracle["cases"].as_array().unwrap() {
            let name = case["case"].as_str().unwrap();
            let (ours, theirs) = (detail(&map(name)), case["detail"].as_f64().unwrap());
            println!("{name}: {ours:.6}, prototype {theirs:.6}");
            assert!((ours - theirs).abs() <= tolerance, "{name}: {ours}, expected {theirs}");
        }
    }

    #[test]
    fn nothing_seen_is_no_detail() {
        let map = DepthMap {
            visible: Mask::filled(32, 32, false),
            depth: vec![f64::NAN; 1024],
        };
        assert_eq!(ddi(&map, [1.0; 3]), 0.0);
        assert_eq!(ddi(&self::map("ripples"), [0.0; 3]), 0.0);
    }
}
