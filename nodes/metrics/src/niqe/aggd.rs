//! The asymmetric generalised Gaussian, fitted by moments, and the features of a block.
//!
//! With spreads σ_l, σ_r of the negative and positive samples, γ̂ = σ_l/σ_r and r̂ = (mean |x|)²/mean x², the shape
//! α solves r(α) = r̂ (γ̂³ + 1)(γ̂ + 1)/(γ̂² + 1)², where r(α) = Γ(2/α)²/(Γ(1/α) Γ(3/α)), to the nearest point of the
//! grid 0.2, 0.201 … 10. β = σ √(Γ(1/α)/Γ(3/α)); the mean of a product field is (β_r − β_l) Γ(2/α)/Γ(1/α).

use std::sync::OnceLock;

use libm::tgamma;

use super::luma::Plane;

/// Features of a block at one scale.
pub(super) const FEATURES: usize = 18;

/// The reference's four neighbours (rows, columns) that a coefficient is multiplied by, cyclic within the block.
const SHIFTS: [(isize, isize); 4] = [(0, 1), (1, 0), (1, 1), (1, -1)];

struct Fit {
    shape: f64,
    left: f64,
    right: f64,
    mean: f64,
}

/// Shapes from 0.2 to 10, and r on them, which grows with the shape.
pub(super) struct Grid {
    shapes: Vec<f64>,
    ratios: Vec<f64>,
}

/// The reference's step from one shape to the next.
pub(super) const STEP: f64 = 0.001;

impl Grid {
    /// A grid of a step of its own, above 0 and at most 9.8.
    pub fn of_step(step: f64) -> Self {
        let last = (9.8 / step).round() as usize;
        let shapes: Vec<f64> = (0..=last).map(|i| 0.2 + i as f64 * step).collect();
        let ratio = |&a: &f64| {
            let g = tgamma(2.0 / a);
            g * g / (tgamma(1.0 / a) * tgamma(3.0 / a))
        };
        let ratios = shapes.iter().map(ratio).collect();
        Self { shapes, ratios }
    }

    /// The grid of the reference.
    pub fn reference() -> &'static Self {
        static GRID: OnceLock<Grid> = OnceLock::new();
        GRID.get_or_init(|| Self::of_step(STEP))
    }

    /// How many shapes it has.
    pub fn len(&self) -> usize {
        self.shapes.len()
    }

    /// The shape whose r is nearest. NaN gives the first one, as `argmin` over NaNs does in the reference.
    fn nearest(&self, ratio: f64) -> f64 {
        let (shapes, ratios) = (&self.shapes, &self.ratios);
        if ratio.is_nan() {
            return shapes[0];
        }
        let above = ratios.partition_point(|&r| r < ratio);
        let at = match above {
            0 => 0,
            n if n == ratios.len() => n - 1,
            n if ratio - ratios[n - 1] <= ratios[n] - ratio => n - 1,
            n => n,
        };
        shapes[at]
    }
}

fn fit(samples: impl Iterator<Item = f64>, grid: &Grid) -> Fit {
    let (mut left, mut right, mut absolute) = (0.0, 0.0, 0.0);
    let (mut lefts, mut rights, mut count) = (0.0, 0.0, 0.0);
    for x in samples {
        if x < 0.0 {
            left += x * x;
            lefts += 1.0;
        } else if x > 0.0 {
            right += x * x;
            rights += 1.0;
        }
        absolute += x.abs();
        count += 1.0;
    }
    let square: f64 = (left + right) / count;
    let absolute = absolute / count;
    // 0/0 is NaN on purpose: a side without samples leaves the block undefined.
    let (left, right) = (f64::sqrt(left / lefts), f64::sqrt(right / rights));
    let skew = left / right;
    let (s2, s3) = (skew * skew, skew * skew * skew);
    let ratio = absolute * absolute / square * (s3 + 1.0) * (skew + 1.0) / ((s2 + 1.0) * (s2 + 1.0));
    let shape = grid.nearest(ratio);
    let width = (tgamma(1.0 / shape) / tgamma(3.0 / shape)).sqrt();
    let (left, right) = (left * width, right * width);
    Fit {
        shape,
        left,
        right,
        mean: (right - left) * (tgamma(2.0 / shape) / tgamma(1.0 / shape)),
    }
}

/// The 18 features of the square block at (x0, y0).
pub(super) fn features(plane: &Plane, (x0, y0): (usize, usize), side: usize, grid: &Grid) -> [f64; FEATURES] {
    let at = |x: usize, y: usize| plane.data[(y0 + y) * plane.width + x0 + x];
    let cells = || (0..side).flat_map(move |y| (0..side).map(move |x| (x, y)));
    let mut features = [0.0; FEATURES];
    let own = fit(cells().map(|(x, y)| at(x, y)), grid);
    features[0] = own.shape;
    features[1] = (own.left + own.right) / 2.0;
    for (features, (down, across)) in features[2..].chunks_exact_mut(4).zip(SHIFTS) {
        let wrapped = |i: usize, by: isize| (i as isize - by).rem_euclid(side as isize) as usize;
        let products = cells().map(|(x, y)| at(x, y) * at(wrapped(x, across), wrapped(y, down)));
        let pair = fit(products, grid);
        features.copy_from_slice(&[pair.shape, pair.mean, pair.left, pair.right]);
    }
    features
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ratio_grows_with_the_shape_so_bisection_finds_the_nearest() {
        let grid = Grid::reference();
        let (shapes, ratios) = (&grid.shapes, &grid.ratios);
        assert_eq!(shapes.len(), 9801);
        assert!(ratios.windows(2).all(|r| r[0] < r[1]));
        for probe in [0.0, 0.1, 0.3, 0.5, 0.636, 0.7, 0.75, 2.0] {
            let slow = (0..ratios.len())
                .min_by(|&i, &j| (ratios[i] - probe).abs().total_cmp(&(ratios[j] - probe).abs()))
                .unwrap();
            assert_eq!(grid.nearest(probe), shapes[slow]);
        }
    }

    #[test]
    fn a_laplacian_has_shape_one_and_a_uniform_a_large_one() {
        let quantiles = || (0..20_000).map(|i| (f64::from(i) + 0.5) / 20_000.0);
        let laplace = |u: f64| {
            if u < 0.5 {
                libm::log(2.0 * u)
            } else {
                -libm::log(2.0 - 2.0 * u)
            }
        };
        let grid = Grid::reference();
        assert!((fit(quantiles().map(laplace), grid).shape - 1.0).abs() < 0.01);
        assert!(fit(quantiles().map(|u| 2.0 * u - 1.0), grid).shape > 9.0);
    }

    #[test]
    fn a_block_with_one_sign_is_undefined() {
        let grid = Grid::reference();
        assert!(fit([1.0, 2.0, 3.0].into_iter(), grid).left.is_nan());
        assert!(fit([0.0; 4].into_iter(), grid).right.is_nan());
    }
}
