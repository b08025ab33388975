//! Grounding, LogRatio to Recompose, on a 2048² picture in memory: median of several runs, by stage.
//!
//!     cargo bench -p node-recompose --bench grounding [-- SIDE RUNS]

use std::hint::black_box;
use std::time::Instant;

use gear_image::{Field, SrgbImage, filter, stats};
use node_adaptive_gain::{Mode, blend};
use node_recompose::{Gamut, Recipe, grounded};

/// A picture with tones, stripes and grain.
fn picture(side: usize, seed: usize) -> SrgbImage {
    SrgbImage::from_fn(side, side, |x, y| {
        let grain = ((x * 7919 + y * 104_729 + x * y + seed * 31) % 61) as f32 / 61.0;
        let u = x as f32 / side as f32;
        let stripe = if (x / 57 + y / 91) % 3 == 0 { 0.7 } else { 0.3 };
        [
            0.1 + 0.7 * u * stripe + 0.1 * grain,
            0.6 * stripe + 0.1 * grain,
            0.8 - 0.6 * u + 0.1 * grain,
        ]
    })
}

fn main() {
    let numbers: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let side = numbers.first().copied().unwrap_or(2048);
    let runs = numbers.get(1).copied().unwrap_or(9).max(1);
    let (painting, translated) = (picture(side, 1), picture(side, 2));
    let edges = Field::from_fn(side, side, |x, y| if x % 97 < 3 || y % 113 < 3 { 1.0 } else { 0.05 });
    let names = [
        "luminance",
        "log ratio",
        "box mean",
        "pyramid",
        "alpha",
        "blend",
        "recompose",
        "all",
    ];
    let mut times = vec![Vec::new(); names.len()];
    let cpu = cpu_seconds();
    for _ in 0..runs {
        let begin = Instant::now();
        let mut last = begin;
        let mut stage = 0;
        let mut lap = || {
            let now = Instant::now();
            times[stage].push((now - last).as_secs_f64() * 1e3);
            stage += 1;
            last = now;
            if stage == 7 {
                times[7].push((now - begin).as_secs_f64() * 1e3);
            }
        };
        let luminance = node_log_ratio::luminance(&translated);
        lap();
        let ratio = node_log_ratio::log_ratio(luminance, 1e-3);
        lap();
        let smooth = filter::box_mean(&ratio, (0.03 * side as f64).round() as usize);
        lap();
        let multiscale = node_pyramid::multiscale(&ratio, &edges, 7, 20.0, 0.5);
        lap();
        let alpha = Mode::Adaptive {
            base: 0.8,
            target: 1.0,
            min: 0.4,
            max: 1.5,
        }
        .alpha(&multiscale);
        lap();
        let relight = blend(multiscale, &smooth, alpha as f32);
        lap();
        let recipe = Recipe {
            beta: 0.5,
            gamut: Gamut::Soft { knee: 0.8 },
            detail: 0.5,
            detail_radius: 0.004,
            epsilon: 1e-6,
        };
        black_box(grounded(&painting, Some(&relight), &recipe));
        lap();
    }
    let cpu = (cpu_seconds() - cpu) / runs as f64 * 1e3;
    println!(
        "grounding at {side}x{side}, {} threads, median of {runs} runs",
        rayon::current_num_threads()
    );
    for (name, times) in names.iter().zip(&times) {
        let ms: Vec<f32> = times.iter().map(|&t| t as f32).collect();
        let median = stats::median(&ms).unwrap_or(0.0);
        let least = stats::range(&ms).map_or(0.0, |(low, _)| low);
        println!("{name:>12} {median:8.1} ms   least {least:8.1} ms");
    }
    println!("{:>12} {cpu:8.1} ms a run, all threads together", "CPU");
}

/// Processor time of this process so far, from Linux' account of it (10 ms steps); 0 elsewhere. On a machine with other
/// work, it divided by the threads is nearer to the truth than the clock.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = stat
        .rsplit(')')
        .next()
        .unwrap_or_default()
        .split_whitespace()
        .skip(11)
        .take(2);
    fields.filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() / 100.0
}
