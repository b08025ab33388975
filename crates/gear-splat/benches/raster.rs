//! What the rasteriser costs: `cargo bench -p gear-splat --bench raster [-- --curve | --surfels | --gpu]`.
//!
//! The scene: centres in the unit ball, scales log-uniform 0.002–0.02, opacities 0.05–0.95, random rotations, SH degree
//! 0, seen at 512² from distance 2.5 under 40°. Times are minima over many runs, which is what a quiet machine would
//! show; on a busy one the counters of work (pairs, pixels, lanes) still compare. `--curve` goes from 10k to 3M
//! Gaussians, `--surfels` shows reliefs of 1–2 px discs at 768² as `Reconstruct` makes them. `--gpu` (with the feature
//! `gpu`) takes the most able GPU instead of the CPU, be it one that the CPU plays.

use std::time::{Duration, Instant};

use gear_splat::cpu::Frame;
use gear_splat::render::{PixelGradients, Wanted};
use gear_splat::{Camera, Gaussian, Outputs, RenderOptions, Scene};
use glam::{Quat, Vec3};

fn main() {
    let asked = |flag: &str| std::env::args().any(|argument| argument == flag);
    if asked("--surfels") {
        for count in [30_000, 100_000, 360_000] {
            report(&Bench::new(surfels(count, 768)));
        }
    } else if asked("--curve") {
        curve();
    } else if asked("--gpu") {
        gpu();
    } else {
        for count in [20_000, 100_000, 400_000] {
            reset_peak();
            report(&Bench::new(random_ball(count)));
        }
    }
}

/// Forward and backward time against the number of Gaussians, and what one of them costs.
fn curve() {
    println!("gaussians    forward ms    fwd+bwd ms    ns a gaussian");
    for count in [10_000, 30_000, 100_000, 300_000, 1_000_000, 3_000_000] {
        let bench = Bench::new(random_ball(count));
        let (forward, both) = bench.on_threads(2, || {
            (bench.forward(Outputs::RGBA), bench.forward_backward(Wanted::ALL))
        });
        println!(
            "{count:>9} {forward:>13.1} {both:>13.1} {:>16.0}",
            both * 1e6 / count as f64
        );
    }
}

#[cfg(feature = "gpu")]
fn gpu() {
    use gear_splat::gpu::{Frame, Gpu};
    let gpu = match Gpu::open(None) {
        Ok(gpu) => std::sync::Arc::new(gpu),
        Err(error) => return println!("{error}"),
    };
    println!("{}", gpu.name().realm());
    for count in [20_000, 100_000, 400_000] {
        let bench = Bench::new(random_ball(count));
        let frame = || {
            let options = RenderOptions::default();
            let frame = Frame::new(&gpu, &bench.scene, &bench.camera, &options, Outputs::RGBA);
            frame.expect("the scene fits into the GPU")
        };
        let draw = |frame: &Frame| frame.draw().expect("the GPU draws");
        let forward = minimum(|| drop(draw(&frame())));
        let both = minimum(|| {
            let frame = frame();
            drop(frame.backward(&bench.scene, &draw(&frame), &bench.loss, Wanted::ALL));
        });
        println!("{count:>7} Gaussians: forward {forward:.0} ms, forward + backward {both:.0} ms");
    }
}

#[cfg(not(feature = "gpu"))]
fn gpu() {
    println!("built without the feature `gpu`");
}

fn report(bench: &Bench) {
    let everything = |threads| {
        bench.on_threads(threads, || {
            [
                bench.forward(Outputs::RGBA),
                bench.forward_backward(Wanted::ALL),
                bench.forward_backward(Wanted::COLORS),
            ]
        })
    };
    let [forward, both, colors] = everything(2);
    let peak = peak_mb();
    // Turn and turn about, so that what goes on in the machine falls on both.
    let (two, one) = (0..3).fold(([forward, both, colors], [f64::INFINITY; 3]), |(two, one), _| {
        (least(two, everything(2)), least(one, everything(1)))
    });
    let ([forward, both, colors], [forward_1, both_1, _]) = (two, one);
    println!("{} Gaussians", bench.scene.len());
    println!("  ms on 2 threads: forward {forward:.1}, forward + backward {both:.1} (colours only {colors:.1})");
    println!(
        "  on 1 thread: {forward_1:.1} / {both_1:.1}, {:.2} / {:.2} times as long",
        forward_1 / forward,
        both_1 / both
    );
    let frozen = |wanted| bench.on_threads(2, || bench.forward_backward(wanted));
    let shapes = frozen(Wanted {
        colors: false,
        ..Wanted::ALL
    });
    let opacities = frozen(Wanted {
        opacity_logits: true,
        colors: false,
        ..Wanted::COLORS
    });
    println!("  forward + backward with colours frozen {shapes:.1}, of opacities alone {opacities:.1}");
    let rgb = Outputs {
        rgb: true,
        ..Outputs::default()
    };
    let surfaces = Outputs {
        alpha: true,
        depth: true,
        normal: true,
        ..rgb
    };
    let prepared = bench.on_threads(2, || minimum(|| drop(bench.frame(Outputs::RGBA))));
    println!("  of which projection, sorting and tiles {prepared:.1}");
    for threads in [2, 1] {
        let (rgb, surfaces) = bench.on_threads(threads, || in_turns(|| bench.once(rgb), || bench.once(surfaces)));
        println!(
            "  depth, normal and alpha, {threads} threads: {:.0} % on top of colour's {:.1} ms (medians: {:.0} %)",
            100.0 * (surfaces.0 / rgb.0 - 1.0),
            rgb.0,
            100.0 * (surfaces.1 / rgb.1 - 1.0)
        );
    }
    let work = bench.frame(Outputs::RGBA).work();
    let times = |count: u64| count as f64 / work.contributing as f64;
    println!(
        "  {:.2} M contributing pairs; pixels evaluated {:.2} times, SIMD lanes {:.2} times as many",
        work.contributing as f64 * 1e-6,
        times(work.evaluated),
        times(work.lanes)
    );
    if let Some(peak) = peak {
        println!("  peak memory {peak:.0} MB");
    }
}

/// Minimum and median of two things that are timed turn and turn about.
fn in_turns(a: impl Fn() -> f64, b: impl Fn() -> f64) -> ((f64, f64), (f64, f64)) {
    let (mut of_a, mut of_b): (Vec<f64>, Vec<f64>) = (0..31).map(|_| (a(), b())).unzip();
    let summary = |times: &mut Vec<f64>| {
        times.sort_by(f64::total_cmp);
        (times[0], times[times.len() / 2])
    };
    (summary(&mut of_a), summary(&mut of_b))
}

fn least(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i].min(b[i]))
}

struct Bench {
    scene: Scene,
    camera: Camera,
    loss: PixelGradients,
}

impl Bench {
    fn new((scene, camera): (Scene, Camera)) -> Self {
        let pixels = (camera.width * camera.height) as usize;
        let rgb = (0..pixels).map(|i| [(i % 7) as f32 - 3.0, (i % 5) as f32 - 2.0, 0.5]);
        let loss = PixelGradients {
            rgb: rgb.collect(),
            ..PixelGradients::default()
        };
        Self { scene, camera, loss }
    }

    fn on_threads<T: Send>(&self, threads: usize, run: impl FnOnce() -> T + Send) -> T {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads can be started").install(run)
    }

    fn frame(&self, outputs: Outputs) -> Frame {
        Frame::new(&self.scene, &self.camera, &RenderOptions::default(), outputs)
    }

    /// Wall time of one picture, ms.
    fn once(&self, outputs: Outputs) -> f64 {
        let start = Instant::now();
        drop(self.frame(outputs).draw());
        start.elapsed().as_secs_f64() * 1e3
    }

    fn forward(&self, outputs: Outputs) -> f64 {
        minimum(|| drop(self.frame(outputs).draw()))
    }

    fn forward_backward(&self, wanted: Wanted) -> f64 {
        minimum(|| {
            let frame = self.frame(Outputs::RGBA);
            drop(frame.backward(&self.scene, &frame.draw(), &self.loss, wanted));
        })
    }
}

/// Smallest wall time of the runs that fit into a third of a second, and of at least five, ms.
fn minimum(mut run: impl FnMut()) -> f64 {
    let mut best = Duration::MAX;
    let begin = Instant::now();
    let mut runs = 0;
    while runs < 5 || begin.elapsed() < Duration::from_millis(300) {
        let start = Instant::now();
        run();
        best = best.min(start.elapsed());
        runs += 1;
    }
    best.as_secs_f64() * 1e3
}

/// Lets the next [`peak_mb`] count from here, where the system can (Linux).
fn reset_peak() {
    // Without it the peak of the whole run is shown, which is still an upper bound.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Largest resident memory of this process, scene included.
fn peak_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kb: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kb / 1024.0)
}

struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    }

    fn centred(&mut self) -> f32 {
        self.next() - 0.5
    }
}

fn random_ball(count: usize) -> (Scene, Camera) {
    let mut random = Random(2);
    let mut scene = Scene::default();
    while scene.len() < count {
        let center = Vec3::new(random.next(), random.next(), random.next()) * 2.0 - 1.0;
        if center.length() > 1.0 {
            continue;
        }
        let mut scale = || (0.002 * libm::pow(10.0, f64::from(random.next()))) as f32;
        let scales = Vec3::new(scale(), scale(), scale());
        let q = Quat::from_xyzw(random.centred(), random.centred(), random.centred(), random.centred());
        scene.push(Gaussian {
            center,
            scales,
            rotation: q.normalize(),
            opacity: 0.05 + 0.9 * random.next(),
            color: [random.next(), random.next(), random.next()],
        });
    }
    let focal = (256.0 / libm::tan(20f64.to_radians())) as f32;
    let camera = Camera::look_at(Vec3::Z * 2.5, Vec3::ZERO, Vec3::Y, 512, 512, focal);
    (scene, camera)
}

fn surfels(count: usize, side: u32) -> (Scene, Camera) {
    let wave = |x: f32| libm::sin(f64::from(x)) as f32;
    let mut random = Random(1);
    let mut scene = Scene::default();
    let columns = (count as f32).sqrt() as usize;
    let spacing = 0.9 / columns as f32;
    for j in 0..columns {
        for i in 0..columns {
            let (x, y) = (i as f32 * spacing - 0.45, j as f32 * spacing - 0.45);
            let normal = Vec3::new(0.4 * wave(9.0 * x), 0.4 * wave(7.0 * y), 1.0).normalize();
            scene.push(Gaussian {
                center: Vec3::new(x, y, 0.1 * wave(9.0 * x)),
                scales: Vec3::new(0.6, 0.6, 0.15) * spacing,
                rotation: Quat::from_rotation_arc(Vec3::Z, normal),
                opacity: 0.99,
                color: [random.next(), random.next(), random.next()],
            });
        }
    }
    (scene, Camera::front(side, side))
}
