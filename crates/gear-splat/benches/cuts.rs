//! What a rasteriser may leave out: cuts of Gaussians, the stop of opaque pixels, order, precision. Writes tables that
//! `gear curve` draws:
//!
//!     cargo bench -p gear-splat --bench cuts -- docs/src/curves
//!
//! * `raster-cuts.csv`: against the same order of centres without any cut, in f64. The cost is the number of exponentials and of the
//!   comparisons of sorting once.
//! * `raster-order.csv`: the order of centres against that of depths at each pixel. The cost is the same,
//!   with the comparisons of sorting at each pixel.
//!
//! The kernel is written out here, on a picture of random tilted discs, so that each choice can be turned; the rasterisers of
//! the crate have the shipped ones built in. Nothing is timed: the tables are the same on every machine.

#[path = "../../gear-image/benches/shared/table.rs"]
mod table;

use std::f64::consts::TAU;

use table::Table;

const SIDE: usize = 96;
const DISCS: usize = 3000;
const COUNTED: &str = "exponentials and comparisons";

/// A projected disc.
#[derive(Clone, Copy)]
struct Disc {
    mean: [f64; 2],
    /// The inverse covariance: xx, xy, yy.
    conic: [f64; 3],
    opacity: f64,
    grey: f64,
    depth: f64,
    /// Change of its depth by pixel.
    slope: [f64; 2],
}

/// Where a Gaussian ends.
#[derive(Clone, Copy, PartialEq)]
enum Cut {
    None,
    Sigmas(f64),
    /// Where its α falls below 1/255.
    Alpha,
}

#[derive(Clone, Copy)]
struct Choice {
    cut: Cut,
    /// Transmittance at which a pixel is finished; 0 is never.
    stop: f64,
    /// Depths are compared at each pixel, and not those of centres.
    by_pixel: bool,
    single: bool,
}

const SHIPPED: Choice = Choice {
    cut: Cut::Alpha,
    stop: 1e-4,
    by_pixel: false,
    single: true,
};

fn main() -> std::io::Result<()> {
    let discs: Vec<Disc> = (0..DISCS as u64).map(disc).collect();
    cuts(&discs).write("raster-cuts")?;
    orders(&discs).write("raster-order")
}

fn cuts(discs: &[Disc]) -> Table {
    let exact = Choice {
        cut: Cut::None,
        stop: 0.0,
        by_pixel: false,
        single: false,
    };
    let (truth, _) = render(discs, exact);
    let norm = "max abs of colour against no cut in f64";
    let mut table = Table::new("Rasteriser; cuts and stop", norm, "any").counting(COUNTED);
    let mut add = |label: &str, family: &str, choice: Choice, default: bool| {
        let (picture, count) = render(discs, choice);
        table.add(label, family, 0.0, Some(count), largest(&picture, &truth), default);
    };
    add("1/255; stop 1e-4; f32 (shipped)", "shipped", SHIPPED, true);
    add(
        "f64",
        "precision",
        Choice {
            single: false,
            ..SHIPPED
        },
        false,
    );
    for sigmas in [2.0, 2.5, 3.0, 3.33, 4.0, 5.0] {
        add(
            &format!("{sigmas} σ"),
            "cut at",
            Choice {
                cut: Cut::Sigmas(sigmas),
                ..SHIPPED
            },
            false,
        );
    }
    for stop in [1e-1, 1e-2, 1e-3, 0.0] {
        add(&format!("stop {stop}"), "stop at", Choice { stop, ..SHIPPED }, false);
    }
    add(
        "no cut",
        "no cut",
        Choice {
            cut: Cut::None,
            ..SHIPPED
        },
        false,
    );
    table
}

fn orders(discs: &[Disc]) -> Table {
    let exact = Choice {
        cut: Cut::None,
        stop: 0.0,
        by_pixel: true,
        single: false,
    };
    let (truth, _) = render(discs, exact);
    let norm = "rms of colour against depths at each pixel";
    let mut table = Table::new("Rasteriser; order", norm, "any").counting(COUNTED);
    for (label, choice, default) in [
        ("order of centres (shipped)", SHIPPED, true),
        (
            "order at each pixel",
            Choice {
                by_pixel: true,
                ..SHIPPED
            },
            false,
        ),
        (
            "order at each pixel; no cut",
            Choice {
                by_pixel: true,
                cut: Cut::None,
                ..SHIPPED
            },
            false,
        ),
    ] {
        let (picture, count) = render(discs, choice);
        let squares: f64 = picture.iter().zip(&truth).map(|(a, b)| (a - b) * (a - b)).sum();
        let rms = (squares / picture.len() as f64).sqrt();
        table.add(label, "", 0.0, Some(count), rms, default);
    }
    table
}

fn largest(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// A number in 0..1 of a disc, by SplitMix64.
fn share(disc: u64, which: u64) -> f64 {
    let mut z = disc
        .wrapping_mul(16)
        .wrapping_add(which + 1)
        .wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

fn disc(i: u64) -> Disc {
    let (a, b) = (1.0 + 2.5 * share(i, 2), 0.6 + 1.4 * share(i, 3));
    let (sin, cos) = (libm::sin(TAU * share(i, 4)), libm::cos(TAU * share(i, 4)));
    let (ia, ib) = (1.0 / (a * a + 0.3), 1.0 / (b * b + 0.3));
    Disc {
        mean: [share(i, 0) * SIDE as f64, share(i, 1) * SIDE as f64],
        conic: [
            cos * cos * ia + sin * sin * ib,
            sin * cos * (ia - ib),
            sin * sin * ia + cos * cos * ib,
        ],
        opacity: 0.05 + 0.94 * share(i, 5),
        grey: share(i, 6),
        depth: share(i, 7),
        slope: [0.02 * (share(i, 8) - 0.5), 0.02 * (share(i, 9) - 0.5)],
    }
}

/// The picture, and how many operations it took.
fn render(discs: &[Disc], choice: Choice) -> (Vec<f64>, u64) {
    let mut count = 0u64;
    let mut sorted = discs.to_vec();
    sorted.sort_by(|a, b| {
        count += 1;
        a.depth.total_cmp(&b.depth)
    });
    let mut picture = Vec::with_capacity(SIDE * SIDE);
    for y in 0..SIDE {
        for x in 0..SIDE {
            let at = [x as f64, y as f64];
            let mut seen: Vec<(f64, f64, &Disc)> =
                sorted.iter().filter_map(|disc| reach(disc, at, choice.cut)).collect();
            if choice.by_pixel {
                seen.sort_by(|a, b| {
                    count += 1;
                    a.0.total_cmp(&b.0)
                });
            }
            picture.push(blend(&seen, choice, &mut count));
        }
    }
    (picture, count)
}

/// The depth of a disc at a pixel and its exponent there, if it reaches it.
fn reach(disc: &Disc, at: [f64; 2], cut: Cut) -> Option<(f64, f64, &Disc)> {
    let d = [at[0] - disc.mean[0], at[1] - disc.mean[1]];
    let q = disc.conic[0] * d[0] * d[0] + 2.0 * disc.conic[1] * d[0] * d[1] + disc.conic[2] * d[1] * d[1];
    let inside = match cut {
        Cut::None => true,
        Cut::Sigmas(sigmas) => q <= sigmas * sigmas,
        Cut::Alpha => q <= 2.0 * libm::log(255.0 * disc.opacity),
    };
    inside.then(|| (disc.depth + disc.slope[0] * d[0] + disc.slope[1] * d[1], q, disc))
}

fn blend(seen: &[(f64, f64, &Disc)], choice: Choice, count: &mut u64) -> f64 {
    let round = |x: f64| if choice.single { f64::from(x as f32) } else { x };
    let (mut grey, mut transmittance) = (0.0, 1.0);
    for (_, q, disc) in seen {
        if transmittance < choice.stop {
            break;
        }
        *count += 1;
        let exponential = match choice.single {
            true => f64::from(libm::expf(-0.5 * *q as f32)),
            false => libm::exp(-0.5 * q),
        };
        let alpha = round(disc.opacity * exponential).min(0.99);
        grey = round(grey + round(alpha * transmittance * disc.grey));
        transmittance = round(transmittance * (1.0 - alpha));
    }
    grey + transmittance
}
