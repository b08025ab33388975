//! Prints what refinement costs at the default working size, and what more or fewer steps, views and pixels buy:
//!
//! * `cargo bench -p gear-splat --bench refine`: on a dome of surfels in a 768² picture, as `Reconstruct` makes it; the
//!   targets are seven views of it in other colours;
//! * `… --bench refine -- SCENE.ply TARGETS.exr`: on a scene and targets of your own, as the store keeps them;
//! * `… --bench refine -- SCENE.ply TARGETS.exr once [KEY=VALUE…]`: one run with the steps `color`, `all` and `final`, the
//!   `rate` of colours and so on, for comparing two programs by turns; other programs on the machine disturb
//!   processor seconds less than the clock.

use std::ops::ControlFlow;
use std::time::Instant;

use gear_graph::Value;
use gear_image::Field;
use gear_splat::refine::prox::{ProxAdam, metric_prox};
use gear_splat::refine::{ColorSolver, Densify, RefineOptions, Refined, refine};
use gear_splat::{Camera, Gaussian, RenderOptions, Scene, Views, orbit};
use glam::{Quat, Vec3};

const SIDE: u32 = 768;

/// A dome with one surfel every `step` pixels.
fn dome(step: usize) -> Scene {
    let mut scene = Scene {
        canonical_camera: Some(Camera::front(SIDE, SIDE)),
        ..Scene::default()
    };
    let n = SIDE as f32;
    for j in (0..SIDE).step_by(step) {
        for i in (0..SIDE).step_by(step) {
            let (x, y) = ((i as f32 - 383.5) / n, -(j as f32 - 383.5) / n);
            let rest = 0.16 - x * x - y * y;
            if rest > 0.0 {
                let normal = Vec3::new(x, y, rest.sqrt()) / 0.4;
                let scale = 0.6 * step as f32 / n;
                scene.push(Gaussian {
                    center: Vec3::new(x, y, rest.sqrt()),
                    scales: Vec3::new(scale / normal.z.max(0.15), scale, 0.15 / n),
                    rotation: Quat::from_rotation_arc(Vec3::Z, normal),
                    opacity: 0.99,
                    color: [0.5, 0.5, 0.5],
                });
            }
        }
    }
    scene
}

fn targets(scene: &Scene) -> Views {
    let mut painted = scene.clone();
    for (center, dc) in painted.centers.iter().zip(&mut painted.sh_dc) {
        let wave = libm::sin(f64::from(60.0 * center.x + 20.0 * center.y)) as f32;
        *dc = [wave, 0.5 - wave, center.y];
    }
    let yaws = [-90.0, -60.0, -30.0, 0.0, 30.0, 60.0, 90.0];
    let views = orbit::cameras(scene, &yaws, 0)
        .into_iter()
        .zip(yaws)
        .map(|(camera, yaw)| {
            let mut view = orbit::view(&painted, &camera, orbit::yaw_name(yaw), &RenderOptions::default(), true);
            view.weight = view.alpha.clone().map(|alpha| {
                let (width, height) = alpha.size();
                Field::from_vec(width, height, alpha.data().iter().map(|a| a.round()).collect())
            });
            view
        });
    Views { views: views.collect() }
}

fn seconds<T>(run: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let value = run();
    (start.elapsed().as_secs_f64(), value)
}

/// Processor seconds of this process so far, user and system; zero where Linux does not tell.
fn processor_seconds() -> [f64; 2] {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    // Ticks of a hundredth of a second.
    [11, 12].map(|k| {
        fields
            .get(k)
            .and_then(|t| t.parse().ok())
            .map_or(0.0, |t: f64| t / 100.0)
    })
}

/// One scene and its targets.
struct Problem {
    scene: Scene,
    views: Views,
}

/// What a run gave, and what it took.
struct Row {
    refined: Refined,
    wall: f64,
    user: f64,
    system: f64,
}

impl Row {
    fn loss(&self) -> f64 {
        let losses = self.refined.curve.iter().map(|p| p.loss);
        losses.fold(f64::INFINITY, f64::min)
    }

    fn print(&self, name: &str, reference: f64) {
        let fidelity = &self.refined.fidelity;
        let mean = fidelity.iter().map(|f| f.after).sum::<f64>() / fidelity.len().max(1) as f64;
        println!(
            "{name:<34} {:>6.2} s, {:>6.2} user, {:>5.2} system | loss {:.5} ({:+6.2} %) | {mean:.2} dB, {} Gaussians",
            self.wall,
            self.user,
            self.system,
            self.loss(),
            100.0 * (self.loss() / reference - 1.0),
            self.refined.scene.len(),
        );
    }
}

impl Problem {
    fn run(&self, options: &RefineOptions) -> Row {
        let [user, system] = processor_seconds();
        let (wall, refined) = seconds(|| {
            refine(&self.scene, &self.views, options, &mut |_| ControlFlow::Continue(())).expect("it refines")
        });
        let after = processor_seconds();
        Row {
            refined,
            wall,
            user: after[0] - user,
            system: after[1] - system,
        }
    }

    /// One run, with the loss at every look.
    fn once(&self, changes: &[String]) {
        let mut options = RefineOptions::default();
        for change in changes {
            let (key, value) = change.split_once('=').expect("KEY=VALUE");
            let number: f64 = value.parse().expect("a number");
            match key {
                "color" => options.color_iterations = number as usize,
                "all" => options.iterations = number as usize,
                "final" => options.final_color_iterations = number as usize,
                "views" => options.views_per_step = number as usize,
                "check" => options.check_every = number as usize,
                "tolerance" => options.tolerance = number,
                "rate" => options.rates.color = number,
                "solver" => options.color_solver = ColorSolver::ConjugateGradients,
                _ => panic!("no option `{key}`"),
            }
        }
        let row = self.run(&options);
        for point in &row.refined.curve {
            println!(
                "{:>6} {:.6} {:.6} {:.6}",
                point.iteration, point.loss, point.data, point.anchor
            );
        }
        for view in &row.refined.fidelity {
            println!("view {}: {:.2} dB, then {:.2} dB", view.view, view.before, view.after);
        }
        row.print(&changes.join(" "), row.refined.curve[0].loss);
    }

    /// What a step of either kind and a look at all views cost.
    fn parts(&self) {
        let whole = RefineOptions::default();
        let short = |color_iterations: usize, iterations: usize| {
            self.run(&RefineOptions {
                color_iterations,
                iterations,
                check_every: usize::MAX,
                ..whole.clone()
            })
            .wall
        };
        let (nothing, color, all) = (short(0, 0), short(14, 0), short(0, 14));
        // Without steps: the first look, the last, and setting up. With some: one look more.
        let look = nothing / 2.0;
        let (color, all) = ((color - nothing - look) / 14.0, (all - nothing - look) / 14.0);
        println!(
            "{} Gaussians, {} views: colour step {:.0} ms, full step {:.0} ms, look {:.0} ms",
            self.scene.len(),
            self.views.views.len(),
            color * 1e3,
            all * 1e3,
            look * 1e3
        );
    }

    fn storage(&self) {
        let (encoding, bytes) = seconds(|| self.views.encode().expect("views encode"));
        let (decoding, _) = seconds(|| Views::decode(&bytes).expect("views decode"));
        let (hashing, _) = seconds(|| self.views.digest());
        println!(
            "views: encode {encoding:.2} s ({} MB), decode {decoding:.2} s, digest {hashing:.2} s",
            bytes.len() / 1_000_000
        );
    }

    /// Error against time. The reference takes ten times the default steps.
    fn work_precision(&self) {
        let whole = RefineOptions::default();
        let with = |change: &dyn Fn(&mut RefineOptions)| {
            let mut options = whole.clone();
            change(&mut options);
            self.run(&options)
        };
        let reference = with(&|o| {
            o.iterations *= 10;
            o.tolerance = 0.0;
        });
        let least = reference.loss();
        println!("--- steps");
        for share in [0.25, 0.5, 1.0, 2.0] {
            let row = with(&|o| {
                o.color_iterations = (share * o.color_iterations as f64) as usize;
                o.iterations = (share * o.iterations as f64) as usize;
            });
            row.print(&format!("{share} times the default steps"), least);
        }
        reference.print("10 times", least);
        println!("--- views a step, for the same number of views in all");
        for views in [1, 2, 4] {
            let row = with(&|o| {
                o.views_per_step = views;
                o.color_iterations /= views;
                o.iterations /= views;
            });
            row.print(&format!("{views} views a step"), least);
        }
        println!("--- what moves");
        with(&|o| (o.rates.center, o.rates.rotation) = (0.0, 0.0)).print("centres and rotations frozen", least);
        with(&|o| o.iterations = 0).print("colours only, 30 steps", least);
        with(&|o| o.densify = Some(Densify::default())).print("densified", least);
        with(&|o| o.prune.unseen = true).print("what is not seen left out", least);
    }

    /// How far above the minimum Adam's colours end.
    fn colors(&self) {
        println!("--- colours of fixed shapes; the minimum by conjugate gradients");
        let with = |color_solver: ColorSolver, color_iterations: usize| {
            self.run(&RefineOptions {
                color_solver,
                color_iterations,
                iterations: 0,
                ..RefineOptions::default()
            })
        };
        let reference = with(ColorSolver::ConjugateGradients, 300);
        for steps in [10, 20, 40] {
            with(ColorSolver::ConjugateGradients, steps)
                .print(&format!("conjugate gradients, {steps} steps"), reference.loss());
        }
        reference.print("conjugate gradients, 300 steps", reference.loss());
        for steps in [30, 150, 300] {
            with(ColorSolver::Adam, steps).print(&format!("Adam, {steps} steps"), reference.loss());
        }
    }
}

/// Root mean square distance to the minimiser of Σ c |x − t| + ½μ Σ (x − x⁰)² after 400 noisy steps, curvatures c over
/// four decades: explicit steps, Adam with the anchor in its gradient, and the metric prox.
fn anchors() {
    println!("--- anchors (a toy with a known minimiser): explicit, inside Adam, metric prox");
    const N: usize = 200;
    const RATE: f64 = 0.0125;
    let noise = |k: usize| libm::sin(12.9898 * k as f64 + 0.5) * 43_758.545_3 % 1.0;
    for lambda in [1.0, 50.0, 1e3, 1e6, 1e12] {
        let mu = 2.0 * lambda / N as f64;
        let mut off = [0.0f64; 3];
        for i in 0..N {
            let start = noise(3 * i);
            let target = start + noise(3 * i + 1);
            let curvature = libm::pow(10.0, 2.0 * noise(3 * i + 2)) / N as f64;
            let slope = |x: f64| curvature * (x - target) / ((x - target) * (x - target) + 1e-4).sqrt();
            let (mut low, mut high) = (start.min(target), start.max(target));
            for _ in 0..200 {
                let middle = 0.5 * (low + high);
                let rises = slope(middle) + mu * (middle - start) > 0.0;
                (low, high) = if rises { (low, middle) } else { (middle, high) };
            }
            let mut x = [start; 3];
            let (mut m, mut v) = ([0.0; 2], [0.0; 2]);
            for t in 1..=400 {
                let adam = ProxAdam::new(t, RATE, 0.0, 1e-8 / N as f64);
                let prox = ProxAdam::new(t, RATE, mu, 1e-8 / N as f64);
                let disturbance = 0.05 * curvature * noise(1000 * i + t);
                let g = x.map(|x| slope(x) + disturbance);
                x[0] -= RATE * (g[0] + mu * (x[0] - start));
                x[1] = adam.step(x[1], start, g[1] + mu * (x[1] - start), &mut m[0], &mut v[0]);
                x[2] = prox.step(x[2], start, g[2], &mut m[1], &mut v[1]);
            }
            for (off, x) in off.iter_mut().zip(x) {
                *off += (x - low) * (x - low) / N as f64;
            }
        }
        let [explicit, inside, prox] = off.map(f64::sqrt);
        println!("λ = {lambda:>6.0e}: {explicit:9.1e} {inside:9.1e} {prox:9.1e}");
    }
    // The limits of the prox are exact.
    assert_eq!(
        (
            metric_prox(0.3, 0.1, 0.0, 0.7),
            metric_prox(0.3, 0.1, f64::INFINITY, 0.7)
        ),
        (0.3, 0.7)
    );
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    if let [scene, targets, rest @ ..] = arguments.as_slice() {
        let read = |path: &String| std::fs::read(path).unwrap_or_else(|error| panic!("{path}: {error}"));
        let problem = Problem {
            scene: Scene::decode(&read(scene)).expect("a scene"),
            views: Views::decode(&read(targets)).expect("views"),
        };
        if let [once, changes @ ..] = rest
            && once == "once"
        {
            problem.once(changes);
            return;
        }
        problem.parts();
        problem.work_precision();
        problem.colors();
        return;
    }
    for step in [2, 1] {
        let scene = dome(step);
        let (rendering, views) = seconds(|| targets(&scene));
        let problem = Problem { scene, views };
        problem.parts();
        println!("views: render {rendering:.2} s");
        problem.storage();
        if step == 2 {
            problem.work_precision();
            problem.colors();
        }
    }
    anchors();
}
