//! What lies behind a figure: paper, old silk, or silk in a brocade mount.

use crate::Background;
use crate::palette::{Palette, mix, scale};
use crate::random::{fractal, noise, smoothstep, uniform};
use crate::stage::Colour;
use crate::textile::{fret, roundels};

/// Width of the brocade mount, world units.
pub const MOUNT: f64 = 0.055;

/// Linear colour of the ground at (x, y) in world units, y down; `half` is half the picture's size.
pub fn colour(background: Background, palette: &Palette, x: f64, y: f64, half: [f64; 2], seed: u64) -> Colour {
    let silk = |depth: f64| {
        let age = fractal(seed + 11, 3.0 * x, 3.0 * y, 5);
        let stain = smoothstep(0.25, 0.6, fractal(seed + 12, 2.2 * x + 9.0, 2.2 * y, 4));
        let rim = (half[0] - x.abs()).min(half[1] - y.abs());
        let handled = smoothstep(0.10, 0.0, rim + 0.03 * fractal(seed + 13, 9.0 * x, 9.0 * y, 3));
        let tone = 1.0 + depth * (0.16 * age - 0.16 * stain - 0.14 * handled);
        let tinted = mix(palette.silk, palette.ochre, depth * (0.22 * stain + 0.15 * handled));
        scale(tinted, tone)
    };
    match background {
        Background::Plain => scale(palette.silk, 1.0 + 0.02 * fractal(seed + 11, 3.0 * x, 3.0 * y, 4)),
        Background::Textured => marks(palette, silk(1.0), x, y, half, seed),
        Background::Bordered => {
            let rim = (half[0] - x.abs()).min(half[1] - y.abs());
            if rim > MOUNT {
                let inner = [half[0] - MOUNT, half[1] - MOUNT];
                return marks(palette, silk(0.8), x, y, inner, seed);
            }
            mount(palette, rim / MOUNT, x, y)
        }
    }
}

/// Brocade: gold rules and a fret on indigo, medallions between; `t` runs from the picture's rim inwards.
fn mount(palette: &Palette, t: f64, x: f64, y: f64) -> Colour {
    let along = if y.abs() > x.abs() { x } else { y };
    if t > 0.95 {
        return scale(palette.ink, 1.5);
    }
    if t > 0.86 {
        return palette.gold;
    }
    if t > 0.62 {
        let lit = fret(along, (t - 0.62) / 0.24, 0.026);
        return if lit { palette.gold } else { palette.lac };
    }
    if t > 0.58 {
        return palette.gold;
    }
    let ground = scale(palette.indigo, 1.6);
    roundels(
        x,
        y,
        0.034,
        [scale(palette.gold, 0.8), palette.azurite, palette.celadon],
    )
    .unwrap_or(ground)
}

/// A column of brush writing and a red seal, top left, as collectors leave them.
fn marks(palette: &Palette, under: Colour, x: f64, y: f64, half: [f64; 2], seed: u64) -> Colour {
    let left = -half[0] + 0.050;
    let top = -half[1] + 0.055;
    let cell = 0.032;
    let (u, v) = ((x - left) / cell, (y - top) / (1.12 * cell));
    let (row, count) = (v.floor(), 4.0);
    if (0.0..1.0).contains(&u) && (0.0..count).contains(&v) {
        let ink = glyph(seed + 31 + row as u64, u, v - row);
        return mix(under, palette.ink, 0.85 * ink);
    }
    let (su, sv) = (u, (y - top - count * 1.12 * cell - 0.012) / cell);
    if (0.0..1.0).contains(&su) && (0.0..1.0).contains(&sv) {
        let rim = su.min(1.0 - su).min(sv.min(1.0 - sv));
        let worn = 0.75 + 0.2 * noise(seed + 41, 14.0 * su, 14.0 * sv);
        let carved = glyph(seed + 42, su * 1.2 - 0.1, sv * 1.2 - 0.1);
        let cover = if rim < 0.08 { 1.0 } else { 1.0 - carved };
        return mix(under, palette.cinnabar, worn * cover);
    }
    under
}

/// A made-up character: a few bent strokes in the unit cell, ink in [0, 1].
fn glyph(seed: u64, u: f64, v: f64) -> f64 {
    let mut ink = 0.0f64;
    for stroke in 0..6i64 {
        let r = |k| uniform(seed, stroke, k);
        let flat = stroke % 2 == 0;
        let (cx, cy) = (0.25 + 0.5 * r(0), 0.14 + 0.72 * (stroke as f64 + r(1)) / 6.0);
        let reach = 0.16 + 0.2 * r(2);
        let (a, b) = if flat {
            (u - cx, v - cy)
        } else {
            (v - 0.2 - 0.5 * r(3), u - cx)
        };
        let bend = b + 0.12 * (r(4) - 0.5) + if flat { 0.12 * a } else { 0.5 * a * a };
        let along = (a / reach).abs();
        if along < 1.0 {
            let width = 0.050 * (1.0 - 0.45 * along * along);
            ink = ink.max(smoothstep(width, 0.5 * width, bend.abs()));
        }
    }
    ink
}
