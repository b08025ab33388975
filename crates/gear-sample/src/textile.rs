//! Painted cloth: patterns and folds in the coordinates of the shape that wears them.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::palette::mix;
use crate::random::{smoothstep, uniform};
use crate::shape::Local;
use crate::stage::Colour;

/// Coordinates on cloth that is wrapped round a tube: (round it, along it), world units.
pub fn unrolled(local: &Local) -> (f64, f64) {
    (
        libm::asin(local.e.clamp(-1.0, 1.0)) * local.width,
        local.s * local.length,
    )
}

/// A blossom with `petals` petals and an eye of another colour around (0, 0); `None` outside.
pub fn blossom(x: f64, y: f64, radius: f64, petals: f64, petal: Colour, eye: Colour) -> Option<Colour> {
    let r = (x * x + y * y).sqrt() / radius;
    if r > 1.0 {
        return None;
    }
    let angle = libm::atan2(y, x);
    let rim = 0.72 + 0.28 * libm::cos(petals * angle).abs();
    if r > rim {
        return None;
    }
    Some(if r < 0.26 {
        eye
    } else {
        mix(petal, eye, 0.35 * smoothstep(0.75, 0.3, r))
    })
}

/// Blossoms scattered on a shifted grid; `None` between them.
pub fn sprinkled(u: f64, v: f64, pitch: f64, share: f64, seed: u64, colours: [Colour; 2]) -> Option<Colour> {
    let row = (v / pitch).floor();
    let shifted = u / pitch + 0.5 * (row as i64).rem_euclid(2) as f64;
    let column = shifted.floor();
    let turn = TAU * uniform(seed, column as i64, row as i64);
    let (x, y) = ((shifted - column - 0.5) * pitch, (v / pitch - row - 0.5) * pitch);
    let (sin, cos) = (libm::sin(turn), libm::cos(turn));
    blossom(
        cos * x + sin * y,
        cos * y - sin * x,
        0.5 * share * pitch,
        2.5,
        colours[0],
        colours[1],
    )
}

/// Round medallions with a ring and a blossom inside, as on Tang silks.
pub fn roundels(u: f64, v: f64, pitch: f64, colours: [Colour; 3]) -> Option<Colour> {
    let row = (v / pitch).floor();
    let shifted = u / pitch + 0.5 * (row as i64).rem_euclid(2) as f64;
    let (x, y) = (
        (shifted - shifted.floor() - 0.5) * pitch,
        (v / pitch - row - 0.5) * pitch,
    );
    let r = (x * x + y * y).sqrt() / pitch;
    if (0.30..0.36).contains(&r) {
        let beads = libm::cos(20.0 * libm::atan2(y, x));
        return Some(if beads > -0.2 { colours[0] } else { colours[1] });
    }
    if r < 0.22 {
        return blossom(x, y, 0.22 * pitch, 3.0, colours[2], colours[0]);
    }
    // a small cross of four dots where four medallions meet
    let (cx, cy) = (x.abs() / pitch - 0.5, y.abs() / pitch - 0.5);
    let c = (cx * cx + cy * cy).sqrt();
    (c < 0.07).then_some(colours[1])
}

/// A running key fret or wave in a band; `t` runs over the band from 0 to 1, `u` along it.
pub fn fret(u: f64, t: f64, pitch: f64) -> bool {
    let x = (u / pitch).rem_euclid(1.0);
    let bar = |a: f64, b: f64| (a..b).contains(&x);
    let level = |a: f64, b: f64| (a..b).contains(&t);
    level(0.12, 0.24)
        || (bar(0.0, 0.14) && level(0.12, 0.88))
        || (level(0.76, 0.88) && bar(0.0, 0.7))
        || (bar(0.56, 0.7) && level(0.44, 0.88))
        || (level(0.44, 0.56) && bar(0.3, 0.7))
}

/// Overlapping scallops ("sea waves"), the share of the way from a scallop's rim to its centre.
pub fn scallops(u: f64, v: f64, pitch: f64) -> f64 {
    let mut best = 0.0;
    let row = (2.0 * v / pitch).floor() as i64;
    for r in [row + 1, row] {
        let shift = 0.5 * r.rem_euclid(2) as f64;
        let x = ((u / pitch + shift).rem_euclid(1.0) - 0.5) * 2.0;
        let y = v / pitch * 2.0 - r as f64;
        let d = (x * x + y * y).sqrt();
        if d < 1.0 {
            best = d;
        }
    }
    best
}

/// Pleats that run along a tube.
#[derive(Clone, Copy, Debug)]
pub struct Pleats {
    /// Number of pleats over the half turn that is seen.
    pub count: f64,
    /// Their height, a share of the tube's half width.
    pub height: f64,
    /// Where along the tube the first begin and all have begun.
    pub from: [f64; 2],
    /// Sideways sweep of the pleats along the tube, in pleats.
    pub sweep: f64,
    /// Seed of their unevenness.
    pub seed: u64,
}

impl Pleats {
    /// (height in world units, ink of the valley line) at a point.
    ///
    /// A pleat is an arch |sin| between two valleys; both neighbours are zero in a valley, so each may begin
    /// at a place of its own and the surface stays continuous.
    pub fn at(&self, local: &Local, line: f64) -> (f64, f64) {
        let round = libm::asin(local.e.clamp(-1.0, 1.0)) / FRAC_PI_2;
        let wander = 0.35 * libm::sin(TAU * (0.9 * local.s + uniform(self.seed, 0, 1)))
            + 0.25 * libm::sin(3.0 * round + 4.0 * local.s + TAU * uniform(self.seed, 1, 1));
        let t = 0.5 * self.count * round + self.sweep * (local.s - 0.5) + wander * (0.4 + local.s);
        let pleat = t.floor();
        let begin = self.from[0] + (self.from[1] - self.from[0]) * uniform(self.seed, pleat as i64, 7);
        let grown = smoothstep(begin - 0.1, begin + 0.3, local.s);
        let uneven = 0.55 + 0.45 * uniform(self.seed, pleat as i64, 3);
        let facing = (1.0 - local.e * local.e).max(0.0).sqrt();
        let height = self.height * local.width * grown * uneven * libm::sin(PI * (t - pleat)) * facing;
        // the painted line: in the valley, tapering where the pleat begins
        let valley = t.round();
        let line_begin = self.from[0] + (self.from[1] - self.from[0]) * uniform(self.seed, valley as i64, 11);
        let strength = smoothstep(line_begin, line_begin + 0.18, local.s) * smoothstep(0.0, 0.35, facing);
        let apart = (t - valley).abs() * 2.0 / self.count * FRAC_PI_2 * facing * local.width;
        (
            height,
            strength * smoothstep(line * (0.4 + 0.6 * strength), 0.35 * line, apart),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pleats_are_continuous_across_their_valleys() {
        let pleats = Pleats {
            count: 9.0,
            height: 0.2,
            from: [0.1, 0.6],
            sweep: 1.0,
            seed: 4,
        };
        let at = |e: f64| {
            let local = Local {
                x: e,
                y: 0.0,
                s: 0.8,
                e,
                width: 1.0,
                length: 1.0,
                rise: 0.0,
                base: 0.0,
            };
            pleats.at(&local, 0.01).0
        };
        for i in -900..900 {
            let e = f64::from(i) * 1e-3;
            assert!((at(e + 1e-6) - at(e)).abs() < 1e-4, "jump at {e}");
        }
    }
}
