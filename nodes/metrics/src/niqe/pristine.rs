//! The pristine model and the distance to it: √((μ₁ − μ₂)ᵀ ((Σ₁ + Σ₂)/2)⁺ (μ₁ − μ₂)).
//!
//! The reference takes a pseudo-inverse. The pristine covariance is positive definite (smallest eigenvalue
//! 7·10⁻⁶, checked by a test) and the picture's is positive semi-definite, so their mean is positive definite and
//! the pseudo-inverse is the inverse: a Cholesky factor answers the same, deterministically.

use std::sync::OnceLock;

use super::FEATURES;

type Matrix = Vec<[f64; FEATURES]>;

struct Model {
    mean: [f64; FEATURES],
    covariance: Matrix,
}

/// The figures of `data/niqe_pristine.txt`, whose head names their source and licence.
fn model() -> &'static Model {
    static MODEL: OnceLock<Model> = OnceLock::new();
    MODEL.get_or_init(|| {
        let text = include_str!("../../data/niqe_pristine.txt");
        let mut figures = text
            .lines()
            .filter(|line| !line.starts_with('#'))
            .flat_map(str::split_ascii_whitespace)
            .map(|word| word.parse::<f64>().expect("the embedded file holds numbers only"));
        let mut next = || figures.next().expect("the embedded file holds 36 + 666 numbers");
        let mean = std::array::from_fn(|_| next());
        let mut covariance = vec![[0.0; FEATURES]; FEATURES];
        for i in 0..FEATURES {
            for j in i..FEATURES {
                covariance[i][j] = next();
                covariance[j][i] = covariance[i][j];
            }
        }
        Model { mean, covariance }
    })
}

/// Distance of a picture's block statistics to the pristine ones; `None` when they are not finite.
pub(super) fn distance(mean: &[f64; FEATURES], covariance: &Matrix) -> Option<f64> {
    let model = model();
    let mut pooled = model.covariance.clone();
    for (row, other) in pooled.iter_mut().zip(covariance) {
        for (a, b) in row.iter_mut().zip(other) {
            *a = (*a + b) / 2.0;
        }
    }
    let factor = cholesky(pooled)?;
    // Forward substitution: |L⁻¹ δ|² = δᵀ (L Lᵀ)⁻¹ δ.
    let mut solved = [0.0; FEATURES];
    let mut square = 0.0;
    for i in 0..FEATURES {
        let mut rest = model.mean[i] - mean[i];
        for j in 0..i {
            rest -= factor[i][j] * solved[j];
        }
        solved[i] = rest / factor[i][i];
        square += solved[i] * solved[i];
    }
    square.is_finite().then(|| square.sqrt())
}

/// The lower factor of a symmetric positive definite matrix; `None` when a pivot is not positive.
fn cholesky(mut a: Matrix) -> Option<Matrix> {
    for i in 0..FEATURES {
        for j in 0..=i {
            let mut sum = a[i][j];
            for k in 0..j {
                sum -= a[i][k] * a[j][k];
            }
            if i == j {
                if sum <= 0.0 || !sum.is_finite() {
                    return None;
                }
                a[i][i] = sum.sqrt();
            } else {
                a[i][j] = sum / a[j][j];
            }
        }
    }
    Some(a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pristine_covariance_is_positive_definite() {
        let factor = cholesky(model().covariance.clone()).expect("positive definite");
        assert!((0..FEATURES).all(|i| factor[i][i] > 1e-3));
    }

    #[test]
    fn the_pristine_mean_is_at_distance_zero() {
        let model = model();
        assert_eq!(distance(&model.mean, &model.covariance), Some(0.0));
    }

    #[test]
    fn one_standard_deviation_along_a_feature_is_at_least_distance_one() {
        let model = model();
        let mut mean = model.mean;
        mean[0] += model.covariance[0][0].sqrt();
        assert!(distance(&mean, &model.covariance).unwrap() >= 1.0);
    }
}
