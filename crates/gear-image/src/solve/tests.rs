use super::*;
use proptest::prelude::*;

/// Slow and obvious: the dense matrix and Gaussian elimination with pivoting, f64.
mod oracle {
    use super::*;

    pub fn dense(mask: &Mask, c: &Coefficients) -> (Vec<usize>, Vec<Vec<f64>>) {
        let (w, h) = mask.size();
        let pixels: Vec<usize> = (0..w * h).filter(|&p| mask.data()[p]).collect();
        let index = |p: usize| pixels.binary_search(&p).ok();
        let n = pixels.len();
        let mut a = vec![vec![0.0; n]; n];
        for (i, &p) in pixels.iter().enumerate() {
            let (x, y) = (p % w, p / w);
            a[i][i] += f64::from(c.absorption.map_or(0.0, |f| f.at(x, y))) + f64::from(c.screening);
            let mut link = |q: usize, weight: f64| match index(q) {
                Some(j) => {
                    a[i][i] += weight;
                    a[i][j] -= weight;
                }
                None if c.outside == Outside::Zero => a[i][i] += weight,
                None => {}
            };
            let right = |x, y| f64::from(c.right.map_or(1.0, |f| f.at(x, y)));
            let down = |x, y| f64::from(c.down.map_or(1.0, |f| f.at(x, y)));
            if x + 1 < w {
                link(p + 1, right(x, y));
            }
            if x > 0 {
                link(p - 1, right(x - 1, y));
            }
            if y + 1 < h {
                link(p + w, down(x, y));
            }
            if y > 0 {
                link(p - w, down(x, y - 1));
            }
        }
        (pixels, a)
    }

    pub fn solve(mask: &Mask, c: &Coefficients, rhs: &[f64]) -> Vec<f64> {
        let (pixels, mut a) = dense(mask, c);
        let n = pixels.len();
        let mut b: Vec<f64> = pixels.iter().map(|&p| rhs[p]).collect();
        for i in 0..n {
            let pivot = (i..n).max_by(|&j, &k| a[j][i].abs().total_cmp(&a[k][i].abs())).unwrap();
            a.swap(i, pivot);
            b.swap(i, pivot);
            for j in i + 1..n {
                let f = a[j][i] / a[i][i];
                for k in i..n {
                    a[j][k] -= f * a[i][k];
                }
                b[j] -= f * b[i];
            }
        }
        for i in (0..n).rev() {
            for k in i + 1..n {
                b[i] -= a[i][k] * b[k];
            }
            b[i] /= a[i][i];
        }
        let mut out = vec![0.0; rhs.len()];
        for (&p, u) in pixels.iter().zip(b) {
            out[p] = u;
        }
        out
    }
}

fn relative(a: &[f64], b: &[f64]) -> f64 {
    let difference: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    let size: f64 = b.iter().map(|b| b * b).sum();
    (difference / size.max(1e-300)).sqrt()
}

fn disc(n: usize, radius: f64) -> Mask {
    let c = (n as f64 - 1.0) / 2.0;
    Mask::from_fn(n, n, |x, y| {
        (x as f64 - c) * (x as f64 - c) + (y as f64 - c) * (y as f64 - c) < radius * radius
    })
}

const FINE: SolveOptions = SolveOptions {
    tolerance: 1e-10,
    max_iterations: 200,
};

fn noise(i: usize, seed: u64) -> f64 {
    let mut z = (i as u64)
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .wrapping_add(seed.wrapping_mul(0xbf58_476d_1ce4_e5b9));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

#[test]
fn a_disc_inflates_to_the_hemisphere() {
    let (n, radius) = (192, 80.0);
    let mask = disc(n, radius);
    let system = GridSystem::new(
        &mask,
        &Coefficients {
            outside: Outside::Zero,
            ..Default::default()
        },
    );
    let solution = system.solve(&vec![4.0; n * n], None, SolveOptions::default());
    assert!(
        solution.converged && solution.iterations <= 16,
        "{:?}",
        solution.residuals
    );
    let c = (n as f64 - 1.0) / 2.0;
    for y in 0..n {
        for x in 0..n {
            let r2 = (x as f64 - c) * (x as f64 - c) + (y as f64 - c) * (y as f64 - c);
            if r2 < 70.0 * 70.0 {
                let height = solution.values[y * n + x].sqrt();
                let exact = (radius * radius - r2).sqrt();
                assert!(
                    (height - exact).abs() < 0.02 * radius,
                    "({x}, {y}): {height} for {exact}"
                );
            }
        }
    }
}

#[test]
fn iterations_do_not_grow_with_the_mesh() {
    for n in [64, 128, 256, 512] {
        let system = GridSystem::new(
            &disc(n, 0.45 * n as f64),
            &Coefficients {
                outside: Outside::Zero,
                ..Default::default()
            },
        );
        let solution = system.solve(
            &vec![4.0; n * n],
            None,
            SolveOptions {
                tolerance: 1e-8,
                max_iterations: 100,
            },
        );
        assert!(
            solution.converged && solution.iterations <= 24,
            "{n}: {} iterations",
            solution.iterations
        );
    }
}

#[test]
fn no_absorption_at_all_removes_the_mean() {
    let mask = Mask::filled(40, 30, true);
    let system = GridSystem::new(&mask, &Coefficients::default());
    let wanted: Vec<f64> = (0..1200)
        .map(|p| (p % 40) as f64 * 0.1 - (p / 40) as f64 * 0.3)
        .collect();
    let mean = wanted.iter().sum::<f64>() / 1200.0;
    let solution = system.solve(&system.apply(&wanted), None, FINE);
    let centred: Vec<f64> = wanted.iter().map(|u| u - mean).collect();
    assert!(solution.converged);
    assert!(relative(&solution.values, &centred) < 1e-8);
    // An incompatible right-hand side has no solution; its compatible part has.
    let solution = system.solve(&vec![1.0; 1200], None, FINE);
    assert!(solution.values.iter().all(|u| u.abs() < 1e-9));
}

#[test]
fn parts_that_do_not_touch_are_solved_each_alone() {
    // Two panels, one floating, one held; and a lone floating pixel.
    let mask = Mask::from_fn(20, 8, |x, y| {
        (x < 8 || (11..19).contains(&x)) && y < 6 || (x, y) == (19, 7)
    });
    let mut hold = Field::filled(20, 8, 0.0);
    hold.set(15, 3, 0.5);
    let system = GridSystem::new(
        &mask,
        &Coefficients {
            absorption: Some(&hold),
            ..Default::default()
        },
    );
    let rhs: Vec<f64> = (0..160).map(|p| noise(p, 3) - 0.5).collect();
    let solution = system.solve(&rhs, None, FINE);
    assert!(solution.converged);
    let left: f64 = (0..160).filter(|p| p % 20 < 8).map(|p| solution.values[p]).sum();
    assert!(left.abs() < 1e-9);
    assert_eq!(solution.values[7 * 20 + 19], 0.0);
    // Where it is held, the solution balances the source: Σ a u = Σ f.
    let source: f64 = (0..160)
        .filter(|p| (11..19).contains(&(p % 20)) && p / 20 < 6)
        .map(|p| rhs[p])
        .sum();
    assert!((0.5 * solution.values[3 * 20 + 15] - source).abs() < 1e-7);
}

#[test]
fn empty_thin_and_tiny_masks_are_fine() {
    for (w, h) in [(0, 0), (1, 1), (1, 9), (9, 1), (2, 2), (3, 5), (1, 4000)] {
        for inside in [false, true] {
            let mask = Mask::filled(w, h, inside);
            let c = Coefficients {
                screening: 0.01,
                ..Default::default()
            };
            let rhs: Vec<f64> = (0..w * h).map(|p| noise(p, 1)).collect();
            let solution = GridSystem::new(&mask, &c).solve(&rhs, None, FINE);
            assert!(solution.converged, "{w}x{h} {inside}: {:?}", solution.residuals.last());
            if inside && w * h < 100 {
                assert!(relative(&solution.values, &oracle::solve(&mask, &c, &rhs)) < 1e-8);
            }
        }
    }
}

#[test]
fn a_warm_start_at_the_solution_needs_no_iteration() {
    let mask = disc(48, 20.0);
    let system = GridSystem::new(
        &mask,
        &Coefficients {
            screening: 0.004,
            ..Default::default()
        },
    );
    let rhs: Vec<f64> = (0..48 * 48).map(|p| noise(p, 8)).collect();
    let cold = system.solve(&rhs, None, FINE);
    let warm = system.solve(
        &rhs,
        Some(&cold.values),
        SolveOptions {
            tolerance: 1e-8,
            ..FINE
        },
    );
    assert!(cold.iterations > 3);
    assert_eq!(warm.iterations, 0);
}

#[test]
fn a_nan_in_the_source_is_reported_not_spread() {
    let mask = disc(16, 6.0);
    let system = GridSystem::new(
        &mask,
        &Coefficients {
            outside: Outside::Zero,
            ..Default::default()
        },
    );
    let mut rhs = vec![1.0; 256];
    rhs[8 * 16 + 8] = f64::NAN;
    let solution = system.solve(&rhs, None, FINE);
    assert!(!solution.converged && solution.values.iter().all(|u| *u == 0.0));
}

#[test]
fn same_bits_on_any_thread_count() {
    let mask = disc(300, 140.0);
    let solve = || {
        let system = GridSystem::new(
            &mask,
            &Coefficients {
                outside: Outside::Zero,
                ..Default::default()
            },
        );
        system
            .solve(&vec![4.0; 300 * 300], None, SolveOptions::default())
            .values
    };
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let one = pool(1).install(solve);
    let three = pool(3).install(solve);
    assert!(one.iter().zip(&three).all(|(a, b)| a.to_bits() == b.to_bits()));
}

#[test]
fn the_gradient_of_a_height_integrates_to_it() {
    let mask = disc(64, 28.0);
    let height = Field::from_fn(64, 64, |x, y| 0.02 * (x as f32 - 30.0) * (y as f32 - 20.0));
    let right = Field::from_fn(64, 64, |x, y| height.at((x + 1).min(63), y) - height.at(x, y));
    let down = Field::from_fn(64, 64, |x, y| height.at(x, (y + 1).min(63)) - height.at(x, y));
    let system = GridSystem::new(&mask, &Coefficients::default());
    let solution = system.solve(&system.divergence_of_links(&right, &down), None, FINE);
    let inside: Vec<usize> = (0..64 * 64).filter(|&p| mask.data()[p]).collect();
    let mean = inside.iter().map(|&p| f64::from(height.data()[p])).sum::<f64>() / inside.len() as f64;
    for &p in &inside {
        assert!((solution.values[p] - (f64::from(height.data()[p]) - mean)).abs() < 1e-4);
    }
}

fn small_system() -> impl Strategy<Value = (Mask, Field, Field, Field, Vec<f64>)> {
    (1usize..12, 1usize..12, any::<u64>(), 0.3f64..1.0).prop_map(|(w, h, seed, fill)| {
        let random = move |salt: u64| move |x: usize, y: usize| noise(y * 64 + x, seed ^ salt);
        let inside = random(1);
        let mask = Mask::from_fn(w, h, |x, y| inside(x, y) < fill);
        // Absorption from 1e-4 to 1e12, many zeros: ink of any strength.
        let ink = random(2);
        let absorption = Field::from_fn(w, h, |x, y| {
            let t = ink(x, y);
            if t < 0.5 {
                0.0
            } else {
                libm::pow(10.0, (t - 0.5) * 32.0 - 4.0) as f32
            }
        });
        let (rw, dw, src) = (random(3), random(4), random(5));
        let right = Field::from_fn(w, h, |x, y| 0.01 + rw(x, y) as f32);
        let down = Field::from_fn(w, h, |x, y| 0.01 + dw(x, y) as f32);
        let rhs = (0..w * h).map(|p| src(p % w, p / w)).collect();
        (mask, absorption, right, down, rhs)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn agrees_with_elimination_on_any_small_mask((mask, absorption, right, down, rhs) in small_system()) {
        for outside in [Outside::Zero, Outside::Free] {
            let c = Coefficients {
                absorption: Some(&absorption),
                screening: 1e-3,
                right: Some(&right),
                down: Some(&down),
                outside,
            };
            let solution = GridSystem::new(&mask, &c).solve(&rhs, None, FINE);
            prop_assert!(solution.converged, "{:?}", solution.residuals);
            let exact = oracle::solve(&mask, &c, &rhs);
            prop_assert!(relative(&solution.values, &exact) < 1e-4);
        }
    }

    #[test]
    fn absorption_only_lowers_and_never_below_zero((mask, absorption, _r, _d, rhs) in small_system()) {
        let c = Coefficients { screening: 1e-3, outside: Outside::Zero, ..Default::default() };
        let free = GridSystem::new(&mask, &c).solve(&rhs, None, FINE).values;
        let inked = Coefficients { absorption: Some(&absorption), ..c };
        let inked = GridSystem::new(&mask, &inked).solve(&rhs, None, FINE).values;
        for (a, b) in inked.iter().zip(&free) {
            prop_assert!(*a >= -1e-6 * b.abs().max(1.0) && *a <= b + 1e-6 * b.abs().max(1.0));
        }
    }
}
