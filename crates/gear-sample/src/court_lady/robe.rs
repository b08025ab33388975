//! The open robe: its panels, the bodice with collars and chest, the wide sleeves and the hand before them.

use crate::palette::Palette;
use crate::shape::{Ends, Local, knot};
use crate::stage::{Skin, Stage};
use crate::textile::{Pleats, blossom, fret, sprinkled, unrolled};

use super::fan::hand;
use super::{FOLD_LINE, tube};

fn robe_cloth(l: &Local, pleats: &Pleats) -> Skin {
    let p = Palette::court();
    let (u, v) = unrolled(l);
    let (relief, ink) = pleats.at(l, FOLD_LINE);
    let cloth = sprinkled(u, v, 0.030, 0.62, 81, [p.white, p.gold]).unwrap_or(p.malachite);
    Skin {
        albedo: cloth,
        relief,
        ink,
    }
}

pub fn panels(stage: &mut Stage, seed: u64) {
    for side in [-1.0, 1.0] {
        let knots = [
            knot(side * 0.072, -0.205, 0.046, 0.040, 0.030),
            knot(side * 0.098, -0.05, 0.044, 0.036, 0.034),
            knot(side * 0.138, 0.12, 0.050, 0.038, 0.032),
            knot(side * 0.176, 0.28, 0.058, 0.042, 0.026),
            knot(side * 0.190, 0.372, 0.066, 0.044, 0.020),
        ];
        let pleats = Pleats {
            count: 5.0,
            height: 0.16,
            from: [0.1, 0.5],
            sweep: side * 0.9,
            seed: seed + 111 + (side > 0.0) as u64,
        };
        stage.add(tube(&knots, Ends::Cut(0.25)), 1.1, move |l| {
            let p = Palette::court();
            let mut skin = robe_cloth(l, &pleats);
            let (u, _) = unrolled(l);
            let inner = side * l.e;
            let rise = (1.0 - l.s) * l.length;
            if inner < -0.72 || rise < 0.026 {
                let t = if inner < -0.72 {
                    (inner + 1.0) / 0.28
                } else {
                    rise / 0.026
                };
                let along = if inner < -0.72 { l.s * l.length } else { u };
                skin.albedo = if fret(along, t.clamp(0.0, 1.0), 0.024) {
                    p.gold
                } else {
                    p.indigo
                };
            }
            skin
        });
    }
}

pub fn bodice(stage: &mut Stage, seed: u64) {
    let shoulders = [
        knot(-0.112, -0.176, 0.040, 0.046, 0.006),
        knot(-0.070, -0.212, 0.044, 0.058, 0.010),
        knot(0.0, -0.215, 0.058, 0.070, 0.012),
        knot(0.070, -0.212, 0.044, 0.058, 0.010),
        knot(0.112, -0.176, 0.040, 0.046, 0.006),
    ];
    let calm = Pleats {
        count: 4.0,
        height: 0.05,
        from: [0.0, 0.3],
        sweep: 0.4,
        seed: seed + 121,
    };
    stage.add(tube(&shoulders, Ends::Round), 1.0, move |l| robe_cloth(l, &calm));
    let torso = [
        knot(0.0, -0.225, 0.080, 0.066, 0.012),
        knot(0.0, -0.135, 0.094, 0.068, 0.012),
    ];
    stage.add(tube(&torso, Ends::Cut(0.0)), 0.0, move |l| robe_cloth(l, &calm));
    // neck and the powdered chest between the collars
    let chest = [
        knot(0.0, -0.29, 0.026, 0.028, 0.040),
        knot(0.0, -0.235, 0.028, 0.030, 0.055),
        knot(0.0, -0.160, 0.050, 0.022, 0.070),
    ];
    stage.add(tube(&chest, Ends::Cut(0.1)), 0.8, |l| {
        let p = Palette::court();
        let necklace = (l.s - 0.55 - 0.07 * (1.0 - l.e * l.e)).abs() * l.length;
        let beads = necklace < 0.0035;
        Skin {
            albedo: if beads { p.gold } else { p.skin },
            relief: if beads { 0.002 } else { 0.0 },
            ink: 0.0,
        }
    });
    for side in [1.0, -1.0] {
        let collar = [
            knot(side * 0.030, -0.258, 0.013, 0.008, 0.002),
            knot(side * 0.048, -0.212, 0.015, 0.009, 0.003),
            knot(side * 0.024, -0.150, 0.016, 0.009, 0.003),
            knot(-side * 0.004, -0.118, 0.016, 0.008, 0.003),
        ];
        stage.lay(tube(&collar, Ends::Cut(0.0)), 0.9, move |l| {
            let p = Palette::court();
            let (u, _) = unrolled(l);
            let edge = side * l.e > 0.45;
            let cell = 0.018;
            let v = l.s * l.length;
            let dot = blossom(
                u,
                (v / cell - (v / cell).floor() - 0.5) * cell,
                0.0075,
                2.5,
                p.peony,
                p.cinnabar,
            );
            Skin::plain(if edge { p.gold } else { dot.unwrap_or(p.indigo) })
        });
    }
}

pub fn sleeves(stage: &mut Stage, seed: u64) {
    // the hanging mouths of the wide sleeves, then the arms before them
    for side in [-1.0, 1.0] {
        let low = if side < 0.0 { 0.0 } else { -0.012 };
        let hanging = [
            knot(side * 0.118, -0.045 + low, 0.050, 0.038, 0.062),
            knot(side * 0.120, 0.055 + low, 0.062, 0.040, 0.074),
            knot(side * 0.108, 0.165 + low, 0.072, 0.042, 0.084),
        ];
        let drop = Pleats {
            count: 6.0,
            height: 0.13,
            from: [0.0, 0.35],
            sweep: -side * 1.3,
            seed: seed + 141 + (side > 0.0) as u64,
        };
        stage.add(tube(&hanging, Ends::Cut(0.35)), 1.1, move |l| {
            let p = Palette::court();
            let mut skin = robe_cloth(l, &drop);
            let rise = (1.05 - l.s) * l.length + 0.02 * (1.0 - l.e * l.e).max(0.0).sqrt();
            if rise < 0.044 {
                let (u, _) = unrolled(l);
                let cell = 0.030;
                let x = (u / cell - (u / cell).floor() - 0.5) * cell;
                skin.albedo = blossom(x, rise - 0.022, 0.012, 2.5, p.peony, p.gold).unwrap_or(p.indigo);
                if !(0.006..0.040).contains(&rise) {
                    skin.albedo = p.gold;
                }
            }
            skin
        });
        let arm = if side < 0.0 {
            vec![
                knot(-0.108, -0.178, 0.040, 0.044, 0.020),
                knot(-0.150, -0.085, 0.046, 0.046, 0.040),
                knot(-0.128, -0.010, 0.044, 0.044, 0.080),
                knot(-0.066, 0.004, 0.036, 0.036, 0.104),
            ]
        } else {
            vec![
                knot(0.108, -0.178, 0.040, 0.044, 0.020),
                knot(0.152, -0.090, 0.046, 0.046, 0.040),
                knot(0.136, -0.030, 0.044, 0.044, 0.080),
                knot(0.098, -0.062, 0.036, 0.034, 0.106),
            ]
        };
        let wrap = Pleats {
            count: 5.0,
            height: 0.12,
            from: [0.0, 0.5],
            sweep: side * 3.0,
            seed: seed + 151 + (side > 0.0) as u64,
        };
        stage.add(tube(&arm, Ends::Cut(0.25)), 1.05, move |l| {
            let p = Palette::court();
            let mut skin = robe_cloth(l, &wrap);
            if l.s > 0.90 {
                skin.albedo = if l.s > 0.97 || l.s < 0.915 { p.gold } else { p.indigo };
            }
            skin
        });
    }
    hand(stage, [-0.030, 0.002], 0.10, 0.118);
}
