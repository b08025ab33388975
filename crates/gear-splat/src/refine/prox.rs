//! One coordinate of Adam with an implicit anchor.
//!
//! Adam's moments (m, v) follow the gradient of the data term only. Its step divides by P = √v̂ + ε, that is, it
//! measures lengths in the metric D = P/η. The anchor ½μ(x − x⁰)² is added by its proximal step in that same metric,
//!
//! ```text
//! ŷ  = x − η m̂ / P
//! x⁺ = argmin ½D(x − ŷ)² + ½μ(x − x⁰)² = (P ŷ + ημ x⁰) / (P + ημ).
//! ```
//!
//! Fixed points satisfy g + μ(x − x⁰) = 0, the true stationarity. The factor P/(P + ημ) lies in (0, 1] for every μ ≥ 0:
//! the step is stable for any anchor, μ → ∞ gives x⁰ exactly and μ = 0 gives Adam. With another metric,
//! (ŷ + ημ x⁰)/(1 + ημ), the fixed point is g/P + μ(x − x⁰) = 0: a different problem.

/// Decay of the first moment.
pub const BETA1: f64 = 0.9;
/// Decay of the second moment.
pub const BETA2: f64 = 0.99;

/// What all coordinates of an attribute share in one step.
#[derive(Clone, Copy, Debug)]
pub struct ProxAdam {
    rate: f64,
    mu: f64,
    epsilon: f64,
    correction1: f64,
    correction2: f64,
}

impl ProxAdam {
    /// Step number `t` (from 1) with step size `rate` (η) and anchor curvature `mu` (μ). `epsilon` is added to √v̂.
    pub fn new(t: usize, rate: f64, mu: f64, epsilon: f64) -> Self {
        Self {
            rate,
            mu,
            epsilon,
            correction1: 1.0 - libm::pow(BETA1, t as f64),
            correction2: 1.0 - libm::pow(BETA2, t as f64),
        }
    }

    /// The same step in f32, for many coordinates at a time.
    pub fn steps(&self) -> Steps {
        Steps {
            rate: (self.rate / self.correction1) as f32,
            pull: (self.rate * self.mu) as f32,
            epsilon: self.epsilon as f32,
            correction: (1.0 / self.correction2) as f32,
        }
    }

    /// Where `x` goes, given the data gradient there; updates the moments.
    #[inline]
    pub fn step(&self, x: f64, anchor: f64, gradient: f64, m: &mut f64, v: &mut f64) -> f64 {
        *m = BETA1 * *m + (1.0 - BETA1) * gradient;
        *v = BETA2 * *v + (1.0 - BETA2) * gradient * gradient;
        let p = (*v / self.correction2).sqrt() + self.epsilon;
        let y = x - self.rate * (*m / self.correction1) / p;
        metric_prox(y, p, self.rate * self.mu, anchor)
    }
}

/// [`ProxAdam`] in f32. What is stored is f32 anyway; its rounding is far below a step's size.
#[derive(Clone, Copy, Debug)]
pub struct Steps {
    /// η over the correction of the first moment.
    rate: f32,
    /// ημ; infinite where f32 ends, which holds x at its anchor.
    pull: f32,
    epsilon: f32,
    /// 1 over the correction of the second moment.
    correction: f32,
}

impl Steps {
    /// The same step for a coordinate whose anchor weighs `factor` times as much.
    pub fn firmer(self, factor: f32) -> Self {
        Self {
            pull: self.pull * factor,
            ..self
        }
    }

    /// Where `x` goes, given the data gradient there; updates the moments.
    #[inline(always)]
    pub fn step(&self, x: f32, anchor: f32, gradient: f32, m: &mut f32, v: &mut f32) -> f32 {
        const B1: f32 = BETA1 as f32;
        const B2: f32 = BETA2 as f32;
        // Moments that fade away would end as subnormal numbers, which are slow and never reach zero.
        const FADED: f32 = 1e-36;
        // Its square is a number.
        const STEEPEST: f32 = 1e15;
        let gradient = if gradient < STEEPEST { gradient } else { STEEPEST };
        let gradient = if gradient > -STEEPEST { gradient } else { -STEEPEST };
        let first = B1 * *m + (1.0 - B1) * gradient;
        let second = B2 * *v + (1.0 - B2) * (gradient * gradient);
        let first = if first.abs() < FADED { 0.0 } else { first };
        let second = if second < FADED { 0.0 } else { second };
        (*m, *v) = (first, second);
        let p = (second * self.correction).sqrt() + self.epsilon;
        let y = x - self.rate * first / p;
        let held = anchor + (y - anchor) * (p / (p + self.pull));
        // Without an anchor the rounding of the way there and back is saved, too.
        if self.pull == 0.0 { y } else { held }
    }
}

/// (P ŷ + s x⁰) / (P + s), written so that s = 0 gives ŷ and s → ∞ gives x⁰, both exactly.
#[inline]
pub fn metric_prox(y: f64, p: f64, s: f64, anchor: f64) -> f64 {
    if s == 0.0 {
        return y;
    }
    if s == f64::INFINITY {
        return anchor;
    }
    anchor + (y - anchor) * (p / (p + s))
}

#[cfg(test)]
mod toy;

#[cfg(test)]
mod tests {
    use super::toy::{Method, RATE, Random};
    use super::*;

    fn distance(lambda: f64, method: Method) -> f64 {
        toy::distance(lambda, method, 400)
    }

    /// Errors of order of the prototype's: within a factor of four either way (other random numbers).
    fn is_about(found: f64, expected: f64) -> bool {
        found < 4.0 * expected && found > expected / 4.0
    }

    #[test]
    fn the_metric_prox_is_accurate_for_every_anchor_weight() {
        for (lambda, expected) in [
            (1.0, 9.8e-4),
            (50.0, 6.9e-4),
            (1e3, 1.2e-4),
            (1e6, 1.3e-7),
            (1e12, 1.3e-13),
        ] {
            let found = distance(lambda, Method::MetricProx);
            assert!(
                is_about(found, expected),
                "λ = {lambda:e}: {found:e}, expected about {expected:e}"
            );
        }
        for lambda in [0.0, 1e-2] {
            assert!(distance(lambda, Method::MetricProx) < 0.2, "λ = {lambda:e}");
        }
    }

    #[test]
    fn explicit_descent_diverges_with_a_stiff_anchor() {
        for lambda in [1e6, 1e12] {
            assert!(distance(lambda, Method::ExplicitSgd) > 1e6);
        }
        for (lambda, expected) in [(1.0, 2.6e-1), (50.0, 7.8e-3), (1e3, 1.4e-4)] {
            let found = distance(lambda, Method::ExplicitSgd);
            assert!(
                is_about(found, expected),
                "λ = {lambda:e}: {found:e}, expected about {expected:e}"
            );
        }
    }

    #[test]
    fn the_anchor_inside_adam_is_stable_and_less_accurate() {
        for (lambda, expected) in [
            (1.0, 3.3e-3),
            (50.0, 3.2e-3),
            (1e3, 9.2e-4),
            (1e6, 5.2e-6),
            (1e12, 6.6e-12),
        ] {
            let found = distance(lambda, Method::AdamWithAnchor);
            assert!(
                is_about(found, expected),
                "λ = {lambda:e}: {found:e}, expected about {expected:e}"
            );
            assert!(found > 2.0 * distance(lambda, Method::MetricProx));
        }
    }

    #[test]
    fn the_unit_metric_solves_another_problem() {
        for (lambda, expected) in [
            (1.0, 3.0e-1),
            (50.0, 4.7e-1),
            (1e3, 9.1e-2),
            (1e6, 9.6e-5),
            (1e12, 9.6e-11),
        ] {
            let found = distance(lambda, Method::UnitMetricProx);
            assert!(
                is_about(found, expected),
                "λ = {lambda:e}: {found:e}, expected about {expected:e}"
            );
            assert!(found > 50.0 * distance(lambda, Method::MetricProx));
        }
    }

    #[test]
    fn the_step_in_f32_is_that_in_f64() {
        let mut random = Random(9);
        for lambda in [0.0, 1e-3, 1.0, 1e6, 1e30] {
            let (mut m, mut v, mut m32, mut v32) = (0.0, 0.0, 0.0f32, 0.0f32);
            let anchor = random.normal();
            let mut x = anchor;
            let mut x32 = x as f32;
            for t in 1..=300 {
                let gradient = 1e-6 * random.normal() * libm::exp(2.0 * random.normal());
                let adam = ProxAdam::new(t, RATE, 2e-6 * lambda, 1e-15);
                x = adam.step(x, anchor, gradient, &mut m, &mut v);
                x32 = adam
                    .steps()
                    .step(x32, anchor as f32, gradient as f32, &mut m32, &mut v32);
                let off = (x - f64::from(x32)).abs();
                assert!(off < 1e-5 * x.abs().max(1.0), "λ = {lambda:e}, step {t}: {x} {x32}");
            }
        }
    }

    #[test]
    fn moments_that_fade_end_at_zero() {
        let steps = ProxAdam::new(1, RATE, 1.0, 1e-15).steps();
        let (mut m, mut v) = (1e-6, 1e-12);
        for _ in 0..20_000 {
            steps.step(0.0, 0.0, 0.0, &mut m, &mut v);
        }
        assert_eq!((m, v), (0.0, 0.0));
    }

    #[test]
    fn the_limits_are_exact() {
        let steps = |mu| ProxAdam::new(1, RATE, mu, 1e-15).steps();
        for anchor in [0.7f32, -123.0] {
            let held = steps(1e300).step(0.3, anchor, 1e-3, &mut 0.0, &mut 0.0);
            assert_eq!(held, anchor);
        }
        assert_eq!(metric_prox(0.3, 0.1, 0.0, 0.7), 0.3);
        assert_eq!(metric_prox(0.3, 0.1, f64::INFINITY, 0.7), 0.7);
        assert_eq!(metric_prox(0.3, 1e-3, 1e300, 0.7), 0.7);
    }
}
