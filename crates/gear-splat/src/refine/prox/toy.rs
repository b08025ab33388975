//! A problem like that of the refinement, small enough for its minimum to be known: for the tests, and for the program that
//! draws the schemes of the anchor.

use super::ProxAdam;

/// SplitMix64 and Box–Muller.
pub struct Random(pub u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (((z ^ (z >> 31)) >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    /// Of the normal distribution.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(self.uniform())).sqrt();
        radius * libm::cos(2.0 * std::f64::consts::PI * self.uniform())
    }
}

/// Coordinates of the toy.
const N: usize = 200;
/// η.
pub const RATE: f64 = 0.0125;

/// A splat-like toy: Σ c (√((x − t)² + 1e-4) − 1e-2) / n + λ Σ (x − x⁰)² / n, curvatures c over four decades, noisy
/// gradients.
struct Toy {
    start: Vec<f64>,
    target: Vec<f64>,
    curvature: Vec<f64>,
    noise: Random,
}

impl Toy {
    fn new() -> Self {
        let mut random = Random(0);
        let start: Vec<f64> = (0..N).map(|_| random.normal()).collect();
        let target = start.iter().map(|x| x + 0.5 * random.normal()).collect();
        let curvature = (0..N).map(|_| libm::pow(10.0, 4.0 * random.uniform() - 2.0)).collect();
        Self {
            start,
            target,
            curvature,
            noise: random,
        }
    }

    fn slope(&self, i: usize, x: f64) -> f64 {
        let d = x - self.target[i];
        self.curvature[i] * d / (d * d + 1e-4).sqrt() / N as f64
    }

    fn noisy_slope(&mut self, i: usize, x: f64) -> f64 {
        self.slope(i, x) + 0.05 * self.noise.normal() / N as f64 * self.curvature[i]
    }

    /// The minimiser, by bisection on the monotone derivative.
    fn minimiser(&self, lambda: f64) -> Vec<f64> {
        let at = |i: usize| {
            let (a, b) = (self.start[i], self.target[i]);
            let (mut low, mut high) = (a.min(b) - 1.0, a.max(b) + 1.0);
            for _ in 0..200 {
                let middle = 0.5 * (low + high);
                let slope = self.slope(i, middle) + 2.0 * lambda * (middle - a) / N as f64;
                if slope < 0.0 { low = middle } else { high = middle }
            }
            0.5 * (low + high)
        };
        (0..N).map(at).collect()
    }
}

/// How the anchor is taken.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Method {
    /// Its gradient in plain descent.
    ExplicitSgd,
    /// Its gradient within Adam.
    AdamWithAnchor,
    /// Its proximal step in the unit metric.
    UnitMetricProx,
    /// Its proximal step in Adam's own metric: what is shipped.
    MetricProx,
}

/// Root mean square distance to the minimiser after some steps; infinite when it diverged.
pub fn distance(lambda: f64, method: Method, steps: usize) -> f64 {
    let mut toy = Toy::new();
    let exact = toy.minimiser(lambda);
    let mut x = toy.start.clone();
    let (mut m, mut v) = (vec![0.0; N], vec![0.0; N]);
    let mu = 2.0 * lambda / N as f64;
    let epsilon = 1e-8 / N as f64;
    for t in 1..=steps {
        let adam = ProxAdam::new(t, RATE, 0.0, epsilon);
        let ours = ProxAdam::new(t, RATE, mu, epsilon);
        for i in 0..N {
            let data = toy.noisy_slope(i, x[i]);
            let anchor = toy.start[i];
            let pull = mu * (x[i] - anchor);
            x[i] = match method {
                Method::ExplicitSgd => x[i] - RATE * (data + pull),
                Method::AdamWithAnchor => adam.step(x[i], anchor, data + pull, &mut m[i], &mut v[i]),
                Method::UnitMetricProx => {
                    let y = adam.step(x[i], anchor, data, &mut m[i], &mut v[i]);
                    (y + RATE * mu * anchor) / (1.0 + RATE * mu)
                }
                Method::MetricProx => ours.step(x[i], anchor, data, &mut m[i], &mut v[i]),
            };
        }
    }
    let square: f64 = x.iter().zip(&exact).map(|(a, b)| (a - b) * (a - b)).sum();
    let rms = (square / N as f64).sqrt();
    if rms.is_finite() { rms } else { f64::INFINITY }
}
