//! Error against run time of two kernels: the box mean and the inflation solver. Writes tables that `gear curve` draws:
//!
//!     cargo bench -p gear-image --bench curves -- docs/src/curves
//!
//! * `box-mean.csv`: values around 8 on 512² pixels, window of 31², against direct sums in f64.
//! * `box-mean-wide.csv`: the same with a window of 205².
//! * `box-mean-outlier.csv`: the first one with one pixel of 1e30; the error is taken where no window contains it.
//! * `inflation-solver.csv`: `−Δu = 4` on a disc of 192² pixels, relative L2 of u against a direct solution.

#[path = "shared/table.rs"]
mod table;

use gear_image::filter::box_mean;
use gear_image::solve::{Coefficients, GridSystem, Outside, SolveOptions};
use gear_image::{Field, Mask};
use table::{Table, machine, once, timed};

const SIDE: usize = 512;
/// The default, 0.03 of the side.
const RADIUS: usize = 15;
const WIDE: usize = 102;

fn main() -> std::io::Result<()> {
    box_means(RADIUS, None).write("box-mean")?;
    box_means(WIDE, None).write("box-mean-wide")?;
    box_means(RADIUS, Some(1e30)).write("box-mean-outlier")?;
    solvers().write("inflation-solver")
}

fn box_means(radius: usize, outlier: Option<f32>) -> Table {
    // A hash for noise, so that the picture is the same everywhere.
    let noise = |x: usize, y: usize| ((x * 7919 + y * 104_729 + x * y * 31) % 10_007) as f32 / 10_007.0 - 0.5;
    let mut field = Field::from_fn(SIDE, SIDE, |x, y| 8.0 + 3.4 * noise(x, y));
    if let Some(value) = outlier {
        field.set(40, 40, value);
    }
    let far = |i: usize| {
        let (x, y) = (i % SIDE, i / SIDE);
        outlier.is_none() || x.abs_diff(40) > radius || y.abs_diff(40) > radius
    };
    let exact = direct(&field, radius);
    let error = |values: &[f32]| {
        let pairs = values.iter().zip(&exact).enumerate().filter(|(i, _)| far(*i));
        pairs.map(|(_, (v, e))| (f64::from(*v) - e).abs()).fold(0.0, f64::max)
    };
    let what = match outlier {
        None => "Box mean",
        Some(_) => "Box mean beside an outlier of 1e30",
    };
    let title = format!("{what}; {SIDE}² pixels; radius {radius}");
    let mut table = Table::new(&title, "max abs against direct f64", &machine());
    if outlier.is_none() {
        // It says why the shipped one is off the front of ordinary pictures.
        table = table.decided("0007");
    }
    let mut measure = |label: &str, family: &str, default: bool, work: &dyn Fn() -> Vec<f32>| {
        let (seconds, values) = timed(40, work);
        table.add(label, family, seconds, None, error(&values), default);
    };
    measure("block sums f64 (shipped)", "block", true, &|| {
        box_mean(&field, radius).into_data()
    });
    measure("running f32", "running", false, &|| running::<f32>(&field, radius));
    measure("running f64", "running", false, &|| running::<f64>(&field, radius));
    measure("table f32", "table", false, &|| summed::<f32>(&field, radius));
    measure("table f64", "table", false, &|| summed::<f64>(&field, radius));
    measure("direct f64", "direct", false, &|| {
        direct(&field, radius).into_iter().map(|v| v as f32).collect()
    });
    table
}

trait Real: Copy + Default + std::ops::Add<Output = Self> + std::ops::Sub<Output = Self> {
    fn of(x: f32) -> Self;
    fn over(self, count: usize) -> f32;
}
impl Real for f32 {
    fn of(x: f32) -> Self {
        x
    }
    fn over(self, count: usize) -> f32 {
        self / count as f32
    }
}
impl Real for f64 {
    fn of(x: f32) -> Self {
        f64::from(x)
    }
    fn over(self, count: usize) -> f32 {
        (self / count as f64) as f32
    }
}

/// The window of `i` along a side of `n`.
fn window(i: usize, radius: usize, n: usize) -> (usize, usize) {
    (i.saturating_sub(radius), (i + radius).min(n - 1))
}

/// Direct sums along rows, then along columns: exact up to f64.
fn direct(field: &Field, radius: usize) -> Vec<f64> {
    let (w, h) = field.size();
    let mut rows = vec![0.0f64; w * h];
    for y in 0..h {
        for x in 0..w {
            let (a, b) = window(x, radius, w);
            let sum: f64 = field.row(y)[a..=b].iter().map(|v| f64::from(*v)).sum();
            rows[y * w + x] = sum / (b - a + 1) as f64;
        }
    }
    let mut out = vec![0.0f64; w * h];
    for y in 0..h {
        let (a, b) = window(y, radius, h);
        for x in 0..w {
            let sum: f64 = (a..=b).map(|yy| rows[yy * w + x]).sum();
            out[y * w + x] = sum / (b - a + 1) as f64;
        }
    }
    out
}

/// Sums that gain a sample and lose one at each step, along rows, then along columns.
fn running<R: Real>(field: &Field, radius: usize) -> Vec<f32> {
    let (w, h) = field.size();
    let mut rows = vec![0.0f32; w * h];
    for y in 0..h {
        let row = field.row(y);
        let mut sum = R::default();
        for v in &row[..radius.min(w)] {
            sum = sum + R::of(*v);
        }
        for x in 0..w {
            let (a, b) = window(x, radius, w);
            if x + radius < w {
                sum = sum + R::of(row[x + radius]);
            }
            rows[y * w + x] = sum.over(b - a + 1);
            if x >= radius {
                sum = sum - R::of(row[x - radius]);
            }
        }
    }
    let mut out = vec![0.0f32; w * h];
    let mut sums = vec![R::default(); w];
    for y in 0..radius.min(h) {
        for (sum, v) in sums.iter_mut().zip(&rows[y * w..(y + 1) * w]) {
            *sum = *sum + R::of(*v);
        }
    }
    for y in 0..h {
        let (a, b) = window(y, radius, h);
        for x in 0..w {
            if y + radius < h {
                sums[x] = sums[x] + R::of(rows[(y + radius) * w + x]);
            }
            out[y * w + x] = sums[x].over(b - a + 1);
            if y >= radius {
                sums[x] = sums[x] - R::of(rows[(y - radius) * w + x]);
            }
        }
    }
    out
}

/// A summed-area table.
fn summed<R: Real>(field: &Field, radius: usize) -> Vec<f32> {
    let (w, h) = field.size();
    let stride = w + 1;
    let mut sums = vec![R::default(); stride * (h + 1)];
    for y in 0..h {
        let mut row = R::default();
        for x in 0..w {
            row = row + R::of(field.at(x, y));
            sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + row;
        }
    }
    let mut out = vec![0.0f32; w * h];
    for y in 0..h {
        let (t, b) = window(y, radius, h);
        for x in 0..w {
            let (l, r) = window(x, radius, w);
            let at = |y: usize, x: usize| sums[y * stride + x];
            let sum = (at(b + 1, r + 1) - at(t, r + 1)) - (at(b + 1, l) - at(t, l));
            out[y * w + x] = sum.over((b - t + 1) * (r - l + 1));
        }
    }
    out
}

const GRID: usize = 192;

fn solvers() -> Table {
    let c = (GRID as f64 - 1.0) / 2.0;
    let mask = Mask::from_fn(GRID, GRID, |x, y| {
        let (dx, dy) = (x as f64 - c, y as f64 - c);
        dx * dx + dy * dy < 0.2 * (GRID * GRID) as f64
    });
    let coefficients = Coefficients {
        outside: Outside::Zero,
        ..Coefficients::default()
    };
    let inside: Vec<usize> = (0..GRID * GRID).filter(|i| mask.data()[*i]).collect();
    let (direct_seconds, exact) = once(|| cholesky(&inside));
    let error = |u: &[f64]| {
        let (mut off, mut all) = (0.0, 0.0);
        for (i, e) in inside.iter().zip(&exact) {
            off += (u[*i] - e) * (u[*i] - e);
            all += e * e;
        }
        f64::sqrt(off / all)
    };
    let rhs = vec![4.0; GRID * GRID];
    let title = format!("Inflation; {GRID}² pixels; {} unknowns", inside.len());
    let mut table = Table::new(&title, "relative L2 of u against banded Cholesky", &machine());
    for power in 1..=8 {
        let options = SolveOptions {
            tolerance: [1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8][power],
            max_iterations: 100,
        };
        // The hierarchy is built for each solution, as inflation does.
        let (seconds, solution) = timed(10, || GridSystem::new(&mask, &coefficients).solve(&rhs, None, options));
        let label = format!("1e-{power} ({} its)", solution.iterations);
        let shipped = options == SolveOptions::default();
        table.add(&label, "multigrid PCG", seconds, None, error(&solution.values), shipped);
    }
    let system = GridSystem::new(&mask, &coefficients);
    for iterations in [40, 80, 160, 320] {
        let (seconds, u) = timed(1, || plain_cg(&system, &mask, iterations));
        table.add(
            &format!("{iterations} its"),
            "plain CG",
            seconds,
            None,
            error(&u),
            false,
        );
    }
    table.add("Cholesky", "direct", direct_seconds, None, 0.0, false);
    table
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Conjugate gradients without a preconditioner, for f = 4.
fn plain_cg(system: &GridSystem, mask: &Mask, iterations: usize) -> Vec<f64> {
    let mut u = vec![0.0; GRID * GRID];
    let mut r: Vec<f64> = mask
        .data()
        .iter()
        .map(|inside| if *inside { 4.0 } else { 0.0 })
        .collect();
    let mut p = r.clone();
    let mut rr = dot(&r, &r);
    for _ in 0..iterations {
        let ap = system.apply(&p);
        let step = rr / dot(&p, &ap);
        for i in 0..u.len() {
            u[i] += step * p[i];
            r[i] -= step * ap[i];
        }
        let next = dot(&r, &r);
        let share = next / rr;
        rr = next;
        for i in 0..p.len() {
            p[i] = r[i] + share * p[i];
        }
    }
    u
}

/// The solution of −Δu = 4 with zeros outside, by Cholesky's factors of the banded matrix, row by row.
fn cholesky(inside: &[usize]) -> Vec<f64> {
    let n = inside.len();
    let mut number = vec![usize::MAX; GRID * GRID];
    for (k, i) in inside.iter().enumerate() {
        number[*i] = k;
    }
    // The disc keeps clear of the frame, so every pixel has four neighbours.
    let band = inside
        .iter()
        .enumerate()
        .map(|(k, i)| k - number[*i - GRID].min(k))
        .max()
        .unwrap_or(1);
    let width = band + 1;
    // Row k holds columns k − band ..= k.
    let mut l = vec![0.0f64; n * width];
    for (k, i) in inside.iter().enumerate() {
        l[k * width + band] = 4.0;
        for neighbour in [i - 1, i - GRID] {
            let j = number[neighbour];
            if j != usize::MAX {
                l[k * width + j + band - k] = -1.0;
            }
        }
    }
    for k in 0..n {
        let first = k.saturating_sub(band);
        for j in first..=k {
            let from = j.saturating_sub(band).max(first);
            let (row_k, row_j) = (&l[k * width..(k + 1) * width], &l[j * width..(j + 1) * width]);
            let a = &row_k[from + band - k..j + band - k];
            let b = &row_j[from + band - j..band];
            let rest = l[k * width + j + band - k] - dot(a, b);
            l[k * width + j + band - k] = if j == k {
                rest.sqrt()
            } else {
                rest / l[j * width + band]
            };
        }
    }
    let mut u = vec![4.0f64; n];
    for k in 0..n {
        let first = k.saturating_sub(band);
        let known = dot(&l[k * width + first + band - k..k * width + band], &u[first..k]);
        u[k] = (u[k] - known) / l[k * width + band];
    }
    for k in (0..n).rev() {
        u[k] /= l[k * width + band];
        let first = k.saturating_sub(band);
        for j in first..k {
            u[j] -= l[k * width + j + band - k] * u[k];
        }
    }
    u
}
