//! Recomposition in f32 and f64, in gain form and as the paper writes it. Writes a table that `gear curve` draws:
//!
//!     cargo bench -p node-recompose --bench precision -- docs/src/curves
//!
//! `recompose.csv`: a sample of 512 pixels and its own log ratio with β = ½, against the gain form in f64. The literal form splits
//! the painting into albedo A = I/(L + ε) and luminance, takes log L_out = log L + βR, and multiplies A by exp(log L_out); black has
//! no luminance to take a logarithm of, and stays black.
//!
//! The forms but the shipped one are written out here, plainly: what they cost beside it is mostly that their loops are not
//! split into planes, and their logarithms and exponentials are `libm`'s.

#[path = "../../../crates/gear-image/benches/shared/table.rs"]
mod table;

use gear_image::{Field, SrgbImage};
use gear_sample::Options;
use node_recompose::{Gamut, Recipe, grounded};
use table::{Table, machine, timed};

const SIDE: usize = 512;
const BETA: f64 = 0.5;
const KNEE: f64 = 0.8;
const DETAIL: f64 = 0.5;
const RADIUS: f64 = 0.004;
const EPSILON: f64 = 1e-6;

/// A number of one precision: every operation is rounded to it.
trait Real:
    Copy
    + PartialOrd
    + std::ops::Add<Output = Self>
    + std::ops::Sub<Output = Self>
    + std::ops::Mul<Output = Self>
    + std::ops::Div<Output = Self>
{
    fn of(x: f64) -> Self;
    fn wide(self) -> f64;
    fn exp(self) -> Self;
    fn log(self) -> Self;
    fn pow(self, power: f64) -> Self;
}

impl Real for f32 {
    fn of(x: f64) -> Self {
        x as f32
    }
    fn wide(self) -> f64 {
        f64::from(self)
    }
    fn exp(self) -> Self {
        libm::expf(self)
    }
    fn log(self) -> Self {
        libm::logf(self)
    }
    fn pow(self, power: f64) -> Self {
        libm::powf(self, power as f32)
    }
}

impl Real for f64 {
    fn of(x: f64) -> Self {
        x
    }
    fn wide(self) -> f64 {
        self
    }
    fn exp(self) -> Self {
        libm::exp(self)
    }
    fn log(self) -> Self {
        libm::log(self)
    }
    fn pow(self, power: f64) -> Self {
        libm::pow(self, power)
    }
}

fn to_light<R: Real>(c: R) -> R {
    if c.wide() <= 0.04045 {
        c / R::of(12.92)
    } else {
        ((c + R::of(0.055)) / R::of(1.055)).pow(2.4)
    }
}

fn to_code<R: Real>(c: R) -> R {
    if c.wide() <= 0.003_130_8 {
        c * R::of(12.92)
    } else {
        R::of(1.055) * c.pow(1.0 / 2.4) - R::of(0.055)
    }
}

fn luminance<R: Real>(c: [R; 3]) -> R {
    R::of(0.2126) * c[0] + R::of(0.7152) * c[1] + R::of(0.0722) * c[2]
}

/// G · I, with G = L/(L + ε) · exp(βR).
fn gained<R: Real>(c: [R; 3], ratio: R) -> [R; 3] {
    let l = luminance(c);
    let gain = l / (l + R::of(EPSILON)) * (R::of(BETA) * ratio).exp();
    c.map(|c| gain * c)
}

/// A · L_out, with log L_out = log L + βR.
fn literal<R: Real>(c: [R; 3], ratio: R) -> [R; 3] {
    let l = luminance(c);
    if l.wide() <= 0.0 {
        return [R::of(0.0); 3];
    }
    let out = (l.log() + R::of(BETA) * ratio).exp();
    c.map(|c| c / (l + R::of(EPSILON)) * out)
}

/// The shoulder, and as much of the detail as stays in gamut.
fn brought_in<R: Real>(c: [R; 3], detail: [R; 3]) -> [R; 3] {
    let (knee, room) = (R::of(KNEE), R::of(1.0 - KNEE));
    let most = c.iter().fold(c[0], |m, c| if *c > m { *c } else { m });
    let base = if most > knee {
        let compressed = knee + room * (R::of(1.0) - ((knee - most) / room).exp());
        c.map(|c| c * (compressed / most))
    } else {
        c
    };
    let mut share = R::of(1.0);
    for (b, d) in base.iter().zip(&detail) {
        let space = if d.wide() > 0.0 { R::of(1.0) - *b } else { *b };
        let fits = space / R::of(d.wide().abs().max(1e-30));
        share = if fits < share { fits } else { share };
    }
    std::array::from_fn(|i| R::of((base[i] + share * detail[i]).wide().clamp(0.0, 1.0)))
}

/// Gaussian blur, mirrored at the rim, cut at 4σ.
fn blurred<R: Real>(light: &[[R; 3]], (width, height): (usize, usize), sigma: f64) -> Vec<[R; 3]> {
    let radius = (4.0 * sigma + 0.5) as isize;
    let weight = |i: isize| libm::exp(-0.5 * (i as f64 / sigma) * (i as f64 / sigma));
    let total: f64 = (-radius..=radius).map(weight).sum();
    let weights: Vec<R> = (-radius..=radius).map(|k| R::of(weight(k) / total)).collect();
    let mirrored = |i: isize, n: usize| {
        let n = n as isize;
        let i = if i < 0 { -1 - i } else { i };
        (if i >= n { 2 * n - 1 - i } else { i }) as usize
    };
    let along = |from: &[[R; 3]], x_step: isize, y_step: isize| -> Vec<[R; 3]> {
        let at = |i: usize| {
            let (x, y) = ((i % width) as isize, (i / width) as isize);
            let mut sum = [R::of(0.0); 3];
            for (k, w) in (-radius..=radius).zip(&weights) {
                let (sx, sy) = (mirrored(x + k * x_step, width), mirrored(y + k * y_step, height));
                for (sum, c) in sum.iter_mut().zip(from[sy * width + sx]) {
                    *sum = *sum + *w * c;
                }
            }
            sum
        };
        (0..from.len()).map(at).collect()
    };
    along(&along(light, 1, 0), 0, 1)
}

fn recomposed<R: Real>(painting: &SrgbImage, ratio: &Field, lit: fn([R; 3], R) -> [R; 3]) -> Vec<[f64; 3]> {
    let light = painting.data().iter().map(|c| c.map(|c| to_light(R::of(f64::from(c)))));
    let light: Vec<[R; 3]> = light.collect();
    let sigma = (RADIUS * painting.longer_side() as f64).max(0.6);
    let low = blurred(&light, painting.size(), sigma);
    let pixels = light.iter().zip(&low).zip(ratio.data());
    let pixel = |((c, low), ratio): ((&[R; 3], &[R; 3]), &f32)| {
        let detail = std::array::from_fn(|i| R::of(DETAIL) * (c[i] - low[i]));
        brought_in(lit(*c, R::of(f64::from(*ratio))), detail).map(|c| to_code(c).wide())
    };
    pixels.map(pixel).collect()
}

fn main() -> std::io::Result<()> {
    let options = Options {
        longer_side: SIDE,
        ..Options::default()
    };
    let sample = gear_sample::paint("court-lady", &options).expect("a motif");
    let painting = sample.painting.rgb;
    let ratio = node_log_ratio::log_ratio(node_log_ratio::luminance(&painting), 1e-3);
    let exact = recomposed::<f64>(&painting, &ratio, gained);
    let error = |found: &[[f64; 3]]| {
        let pairs = found.as_flattened().iter().zip(exact.as_flattened());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let recipe = Recipe {
        beta: BETA as f32,
        gamut: Gamut::Soft { knee: KNEE },
        detail: DETAIL as f32,
        detail_radius: RADIUS,
        epsilon: EPSILON as f32,
    };
    let title = format!("Recompose; precision and form; {SIDE} pixels");
    let norm = "max abs of code values against the gain form in f64";
    let mut table = Table::new(&title, norm, &machine());
    let (seconds, shipped) = timed(10, || grounded(&painting, Some(&ratio), &recipe));
    let shipped: Vec<[f64; 3]> = shipped.data().iter().map(|c| c.map(f64::from)).collect();
    table.add("gain f32 (shipped)", "gain", seconds, None, error(&shipped), true);
    let mut measure = |label: &str, family: &str, work: &dyn Fn() -> Vec<[f64; 3]>| {
        let (seconds, found) = timed(2, work);
        table.add(label, family, seconds, None, error(&found), false);
    };
    measure("gain f32; plain", "gain", &|| {
        recomposed::<f32>(&painting, &ratio, gained)
    });
    measure("gain f64; plain", "gain", &|| {
        recomposed::<f64>(&painting, &ratio, gained)
    });
    measure("literal f32; plain", "literal", &|| {
        recomposed::<f32>(&painting, &ratio, literal)
    });
    measure("literal f64; plain", "literal", &|| {
        recomposed::<f64>(&painting, &ratio, literal)
    });
    table.write("recompose")
}
