//! Milliseconds of the multigrid solver on a disc, by size: `cargo bench -p gear-image --bench solve`.

use std::time::Instant;

use gear_image::Mask;
use gear_image::solve::{Coefficients, GridSystem, Outside, SolveOptions};

fn main() {
    println!(
        "{:>6} {:>9} {:>11} {:>11} {:>11}",
        "side", "build ms", "1e-5 ms", "iterations", "1e-8 ms"
    );
    for n in [196usize, 388, 772, 1540] {
        let c = (n as f64 - 1.0) / 2.0;
        let mask = Mask::from_fn(n, n, |x, y| {
            let (dx, dy) = (x as f64 - c, y as f64 - c);
            dx * dx + dy * dy < 0.2 * (n * n) as f64
        });
        let start = Instant::now();
        let system = GridSystem::new(
            &mask,
            &Coefficients {
                outside: Outside::Zero,
                ..Default::default()
            },
        );
        let build = start.elapsed();
        let rhs = vec![4.0; n * n];
        let start = Instant::now();
        let solution = system.solve(&rhs, None, SolveOptions::default());
        let coarse = start.elapsed();
        let start = Instant::now();
        system.solve(
            &rhs,
            None,
            SolveOptions {
                tolerance: 1e-8,
                max_iterations: 100,
            },
        );
        println!(
            "{n:>6} {:>9.1} {:>11.1} {:>11} {:>11.1}",
            build.as_secs_f64() * 1e3,
            coarse.as_secs_f64() * 1e3,
            solution.iterations,
            start.elapsed().as_secs_f64() * 1e3
        );
    }
}
