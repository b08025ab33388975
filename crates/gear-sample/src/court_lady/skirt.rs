//! Shoes, the long pleated skirt, and the high sash with its ribbons.

use crate::palette::Palette;
use crate::shape::{Ends, Knot, knot};
use crate::stage::{Skin, Stage};
use crate::textile::{Pleats, blossom, fret, roundels, unrolled};

use super::{FOLD_LINE, ball, tube};

pub fn shoes(stage: &mut Stage) {
    for side in [-1.0, 1.0] {
        let shoe = ball([side * 0.062, 0.435], [0.048, 0.024], side * 0.12, 0.05, 0.03);
        stage.add(shoe, 1.0, move |l| {
            let p = Palette::court();
            let sole = l.y > 0.45;
            let toe = blossom(l.x - 0.1 * side, l.y + 0.1, 0.36, 2.5, p.gold, p.white);
            Skin::plain(if sole { p.white } else { toe.unwrap_or(p.lac) })
        });
    }
}

pub fn skirt(stage: &mut Stage, seed: u64) {
    let knots = [
        knot(0.000, -0.150, 0.092, 0.062, 0.0),
        knot(0.004, -0.02, 0.104, 0.075, 0.0),
        knot(0.008, 0.14, 0.136, 0.092, 0.0),
        knot(0.002, 0.30, 0.168, 0.105, 0.0),
        knot(-0.006, 0.420, 0.196, 0.115, 0.0),
    ];
    let pleats = Pleats {
        count: 13.0,
        height: 0.085,
        from: [0.05, 0.55],
        sweep: 1.2,
        seed: seed + 101,
    };
    stage.add(tube(&knots, Ends::Cut(0.10)), 1.15, move |l| {
        let p = Palette::court();
        let (u, v) = unrolled(l);
        let (relief, ink) = pleats.at(l, FOLD_LINE);
        // hem: a gold rule, a blue band with blossoms, a gold fret
        // the hem hangs in an arc, and the bands follow it
        let rise = (1.0 - l.s) * l.length + 0.10 * l.width * (1.0 - l.e * l.e).max(0.0).sqrt();
        let albedo = if rise < 0.004 {
            p.gold
        } else if rise < 0.056 {
            let middle = rise - 0.030;
            let cell = 0.040;
            let x = (u / cell - (u / cell).floor() - 0.5) * cell;
            blossom(x, middle, 0.016, 2.5, p.white, p.cinnabar).unwrap_or(p.azurite)
        } else if rise < 0.060 {
            p.white
        } else if rise < 0.078 {
            if fret(u, (rise - 0.060) / 0.018, 0.022) {
                p.gold
            } else {
                p.lac
            }
        } else {
            roundels(u, v + 0.02, 0.074, [p.gold, p.lac, p.peony]).unwrap_or(p.cinnabar)
        };
        Skin { albedo, relief, ink }
    });
}

pub fn sash(stage: &mut Stage, seed: u64) {
    let band = [
        knot(-0.098, -0.124, 0.022, 0.006, 0.002),
        knot(0.0, -0.112, 0.025, 0.010, 0.003),
        knot(0.098, -0.124, 0.022, 0.006, 0.002),
    ];
    stage.lay(tube(&band, Ends::Cut(0.0)), 0.9, |l| {
        let p = Palette::court();
        let rim = l.e.abs();
        let u = l.s * l.length;
        let cell = 0.030;
        let x = (u / cell - (u / cell).floor() - 0.5) * cell;
        let flower = blossom(x, l.e * l.width, 0.013, 2.5, p.gold, p.cinnabar);
        Skin::plain(if rim > 0.78 {
            p.gold
        } else {
            flower.unwrap_or(p.azurite)
        })
    });
    let ribbons: [[(f64, f64); 5]; 2] = [
        [
            (-0.006, -0.10),
            (-0.016, 0.02),
            (-0.004, 0.12),
            (-0.024, 0.22),
            (-0.014, 0.315),
        ],
        [
            (0.012, -0.10),
            (0.022, 0.01),
            (0.016, 0.10),
            (0.034, 0.19),
            (0.024, 0.265),
        ],
    ];
    for (k, path) in ribbons.iter().enumerate() {
        let knots: Vec<Knot> = path.iter().map(|&(x, y)| knot(x, y, 0.0125, 0.006, 0.003)).collect();
        let pleats = Pleats {
            count: 2.0,
            height: 0.2,
            from: [-0.4, 0.1],
            sweep: 1.0,
            seed: seed + 131 + k as u64,
        };
        stage.lay(tube(&knots, Ends::Cut(0.5)), 0.9, move |l| {
            let p = Palette::court();
            let (relief, ink) = pleats.at(l, 0.7 * FOLD_LINE);
            let tip = l.s > 0.93;
            let base = if k == 0 { p.celadon } else { p.white };
            Skin {
                albedo: if tip || l.e.abs() > 0.8 { p.gold } else { base },
                relief,
                ink,
            }
        });
    }
}
