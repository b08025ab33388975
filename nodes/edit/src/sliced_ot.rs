//! Sliced optimal transport of colours (Rabin, Pitié): matches one colour distribution to another.
//!
//! For each of a number of random rotations of colour space, the three marginals of the source are moved towards
//! those of the reference by matching 512 quantiles, a share of the way. What is learnt on a sample of pixels is a
//! chain of rotations and monotone piecewise-linear curves, which then maps any colour.

/// Quantiles that are matched.
const QUANTILES: usize = 512;
/// Share of the way that each rotation's matching goes.
const STEP: f64 = 0.7;

/// One rotation's three marginals: from where to where.
struct Slice {
    /// Rows are source channels, columns rotated ones.
    rotation: [[f64; 3]; 3],
    from: [Vec<f64>; 3],
    to: [Vec<f64>; 3],
}

/// A colour map that brings one distribution to another.
pub struct SlicedOt {
    slices: Vec<Slice>,
}

impl SlicedOt {
    /// Learns the map from samples. Without samples on either side it is the identity.
    pub fn fit(
        source: &[[f64; 3]],
        reference: &[[f64; 3]],
        rotations: impl IntoIterator<Item = [[f64; 3]; 3]>,
    ) -> Self {
        let mut slices = Vec::new();
        if source.is_empty() || reference.is_empty() {
            return Self { slices };
        }
        let mut moved = source.to_vec();
        for rotation in rotations {
            let curve =
                |colours: &[[f64; 3]], k: usize| quantiles(colours.iter().map(|c| rotated(&rotation, c)[k]).collect());
            let slice = Slice {
                rotation,
                from: std::array::from_fn(|k| curve(&moved, k)),
                to: std::array::from_fn(|k| curve(reference, k)),
            };
            for colour in &mut moved {
                *colour = slice.apply(*colour);
            }
            slices.push(slice);
        }
        Self { slices }
    }

    /// The colour that `colour` becomes. May leave [0, 1] slightly.
    pub fn apply(&self, colour: [f64; 3]) -> [f64; 3] {
        self.slices.iter().fold(colour, |colour, slice| slice.apply(colour))
    }
}

impl Slice {
    fn apply(&self, colour: [f64; 3]) -> [f64; 3] {
        let along = rotated(&self.rotation, &colour);
        let shift: [f64; 3] =
            std::array::from_fn(|k| STEP * (interpolate(along[k], &self.from[k], &self.to[k]) - along[k]));
        std::array::from_fn(|c| {
            let row = &self.rotation[c];
            colour[c] + row[0] * shift[0] + row[1] * shift[1] + row[2] * shift[2]
        })
    }
}

/// A colour times the rotation, as a row vector.
fn rotated(rotation: &[[f64; 3]; 3], c: &[f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| c[0] * rotation[0][k] + c[1] * rotation[1][k] + c[2] * rotation[2][k])
}

/// The quantiles at (i + ½)/512, linear between the samples.
fn quantiles(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    let last = (values.len() - 1) as f64;
    (0..QUANTILES)
        .map(|i| {
            let at = (i as f64 + 0.5) / QUANTILES as f64 * last;
            let low = at.floor();
            let (a, b) = (values[low as usize], values[(at.ceil()) as usize]);
            a + (at - low) * (b - a)
        })
        .collect()
}

/// Piecewise-linear interpolation, constant beyond the ends.
fn interpolate(x: f64, xs: &[f64], ys: &[f64]) -> f64 {
    match xs.partition_point(|&v| v <= x) {
        0 => ys[0],
        n if n == xs.len() => ys[n - 1],
        n => ys[n - 1] + (x - xs[n - 1]) / (xs[n] - xs[n - 1]) * (ys[n] - ys[n - 1]),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::random;

    const ORACLE: &str = include_str!("../../../tests/oracles/sliced_ot.json");

    fn samples(n: usize, a: usize, b: usize, c: usize) -> Vec<[f64; 3]> {
        let part = |i: usize, k: usize| (i * k % 101) as f64 / 100.0;
        (0..n)
            .map(|i| [part(i, a), 0.5 * part(i, b), part(i, c) * part(i, a)])
            .collect()
    }

    #[test]
    fn colours_move_as_in_the_prototype() {
        let oracle: serde_json::Value = serde_json::from_str(ORACLE).unwrap();
        let rotations: Vec<[[f64; 3]; 3]> = serde_json::from_value(oracle["rotations"].clone()).unwrap();
        let source = samples(700, 7, 13, 29);
        let reference: Vec<_> = samples(900, 11, 17, 5)
            .iter()
            .map(|c| [c[0] * c[0], 0.2 + c[1], 1.0 - c[2]])
            .collect();
        let map = SlicedOt::fit(&source, &reference, rotations);
        let expected: Vec<[f64; 3]> = serde_json::from_value(oracle["moved"].clone()).unwrap();
        let tolerance = oracle["tolerance"]["absolute"].as_f64().unwrap();
        for (i, want) in expected.iter().enumerate() {
            let got = map.apply(source[i * 37]);
            for c in 0..3 {
                assert!((got[c] - want[c]).abs() < tolerance, "{i}: {got:?}, expected {want:?}");
            }
        }
    }

    #[test]
    fn equal_distributions_stay() {
        let colours = samples(400, 7, 13, 29);
        let map = SlicedOt::fit(&colours, &colours, (0..20).map(|i| random::rotation(1, i)));
        for colour in &colours {
            let moved = map.apply(*colour);
            assert!(
                (0..3).all(|c| (moved[c] - colour[c]).abs() < 0.02),
                "{colour:?} → {moved:?}"
            );
        }
    }

    #[test]
    fn without_samples_it_is_the_identity() {
        let map = SlicedOt::fit(&[], &[[0.5; 3]], [random::rotation(0, 0)]);
        assert_eq!(map.apply([0.1, 0.2, 0.3]), [0.1, 0.2, 0.3]);
    }

    proptest! {
        #[test]
        fn interpolation_is_monotone(mut xs in prop::collection::vec(0.0..1.0f64, 2..30), a in 0.0..1.0f64, b in 0.0..1.0f64) {
            xs.sort_by(f64::total_cmp);
            let ys: Vec<f64> = xs.iter().map(|x| x * x).collect();
            prop_assert!(interpolate(a.min(b), &xs, &ys) <= interpolate(a.max(b), &xs, &ys) + 1e-15);
        }
    }
}
