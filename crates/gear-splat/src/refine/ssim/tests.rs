//! Structural similarity against its definition.

use super::*;

fn noise(seed: u32, len: usize) -> Vec<f32> {
    (0..len as u32)
        .map(|i| {
            let mut h = (i ^ seed.wrapping_mul(0x9E37_79B9)).wrapping_mul(0x85EB_CA6B);
            h = (h ^ (h >> 13)).wrapping_mul(0xC2B2_AE35);
            ((h ^ (h >> 16)) >> 8) as f32 / (1 << 24) as f32
        })
        .collect()
}

/// A picture, a target and weights.
struct Case {
    width: usize,
    rgb: Vec<[f32; 3]>,
    target: [Vec<f32>; 3],
    weights: Vec<f32>,
}

impl Case {
    fn noise(width: usize, height: usize) -> Self {
        let n = width * height;
        let [r, g, b] = [1, 2, 3].map(|seed| noise(seed, n));
        Self {
            width,
            rgb: (0..n).map(|i| [r[i], g[i], b[i]]).collect(),
            target: [4, 5, 6].map(|seed| noise(seed, n)),
            weights: noise(7, n),
        }
    }

    fn height(&self) -> usize {
        self.rgb.len() / self.width
    }

    fn window(&self) -> Window {
        Window::for_size(self.width, self.height())
    }

    /// Σ w (1 − S) and its gradient, of the whole picture.
    fn fast(&self) -> (f64, Vec<[f32; 3]>) {
        let window = self.window();
        let spread = |plane: &[f32]| {
            let mut out = vec![0.0; pitch(self.width) * self.height()];
            for (out, row) in out.chunks_mut(pitch(self.width)).zip(plane.chunks(self.width)) {
                out[..self.width].copy_from_slice(row);
            }
            out
        };
        let fixed = self
            .target
            .each_ref()
            .map(|y| Fixed::new(spread(y), self.width, &window));
        let compared = Compared {
            rgb: &self.rgb,
            columns: self.width,
            rect: [0, 0, self.width, self.height()],
            fixed: &fixed,
            weights: &spread(&self.weights),
            window,
        };
        let mut out = vec![[f32::NAN; 3]; self.rgb.len()];
        gradient(&compared, -1.0, &mut Scratch::default(), &mut out, |_, row| {
            row.fill([0.0; 3])
        });
        (dissimilarity(&compared), out)
    }

    /// Σ w (1 − S) of one channel by its definition, f64, one window at a time.
    fn oracle(&self, x: &[f64], channel: usize) -> f64 {
        let (width, height) = (self.width as isize, self.height() as isize);
        let Window { taps, radius } = self.window();
        let r = radius as isize;
        let mut total = 0.0;
        for cy in 0..height {
            for cx in 0..width {
                let mut sums = [0.0f64; 5];
                for dy in -r..=r {
                    for dx in -r..=r {
                        let (px, py) = (cx + dx, cy + dy);
                        if px < 0 || py < 0 || px >= width || py >= height {
                            continue;
                        }
                        let w = f64::from(taps[dx.unsigned_abs()]) * f64::from(taps[dy.unsigned_abs()]);
                        let at = (py * width + px) as usize;
                        let (a, b) = (x[at], f64::from(self.target[channel][at]));
                        for (sum, term) in sums.iter_mut().zip([a, b, a * a, b * b, a * b]) {
                            *sum += w * term;
                        }
                    }
                }
                let [mx, my, xx, yy, xy] = sums;
                let (c1, c2) = (f64::from(C1), f64::from(C2));
                let s = (2.0 * mx * my + c1) * (2.0 * (xy - mx * my) + c2)
                    / ((mx * mx + my * my + c1) * (xx - mx * mx + yy - my * my + c2));
                total += (1.0 - s) * f64::from(self.weights[(cy * width + cx) as usize]);
            }
        }
        total
    }

    fn channel(&self, c: usize) -> Vec<f64> {
        self.rgb.iter().map(|pixel| f64::from(pixel[c])).collect()
    }
}

#[test]
fn the_value_and_the_gradient_agree_with_the_definition() {
    for (width, height) in [(19, 14), (5, 9), (1, 1), (30, 2), (12, 70)] {
        let case = Case::noise(width, height);
        let n = width * height;
        let (found, gradient) = case.fast();
        let exact: f64 = (0..3).map(|c| case.oracle(&case.channel(c), c)).sum();
        assert!((found - exact).abs() < 2e-5 * n as f64, "{found} {exact}");
        for i in (0..n).step_by(n.div_ceil(12)) {
            for c in 0..3 {
                let at = |h: f64| {
                    let mut moved = case.channel(c);
                    moved[i] += h;
                    case.oracle(&moved, c)
                };
                let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
                let found = f64::from(gradient[i][c]);
                assert!(
                    (slope - found).abs() < 2e-3 * slope.abs().max(1.0),
                    "{i}: {slope} {found}"
                );
            }
        }
    }
}

#[test]
fn a_picture_is_wholly_similar_to_itself() {
    let mut case = Case::noise(20, 20);
    case.target = [0, 1, 2].map(|c| case.rgb.iter().map(|pixel| pixel[c]).collect());
    let (value, gradient) = case.fast();
    assert!(value.abs() < 1e-3, "{value}");
    assert!(gradient.as_flattened().iter().all(|g| g.abs() < 2e-3));
}

#[test]
fn rows_come_out_the_same_wherever_a_band_begins() {
    // The lower of two stacked copies, far enough from the seam, is the upper one; it lies otherwise in its bands.
    let one = Case::noise(24, 75);
    let twice = |v: &[f32]| [v, v].concat();
    let both = Case {
        width: 24,
        rgb: [one.rgb.clone(), one.rgb.clone()].concat(),
        target: one.target.each_ref().map(|y| twice(y)),
        weights: twice(&one.weights),
    };
    let gradient = both.fast().1;
    let (upper, lower) = gradient.split_at(24 * 75);
    let inner = 24 * 2 * RADIUS..24 * (75 - 2 * RADIUS);
    assert_eq!(upper[inner.clone()], lower[inner]);
}
