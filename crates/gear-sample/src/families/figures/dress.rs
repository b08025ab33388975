//! What lies on the body: collars, sash, ribbons, shawl.

use crate::court_lady::tube;
use crate::palette::Palette;
use crate::shape::{Ends, Knot, knot};
use crate::stage::{Skin, Stage};

use super::{Dice, Wear, draped, folds, skin};

/// Shoulders, breast and crossed collars, the neck at (`at.0`, −.29 + `at.1`).
pub(super) fn bust(stage: &mut Stage, dice: Dice, wear: &Wear, at: [f64; 2]) {
    let [x, y] = at;
    let wide = dice.between("shoulders", 0.100, 0.118);
    let shoulders = [
        knot(x - wide, -0.174 + y, 0.040, 0.046, 0.006),
        knot(x - 0.070, -0.212 + y, 0.044, 0.058, 0.010),
        knot(x, -0.215 + y, 0.058, 0.070, 0.012),
        knot(x + 0.070, -0.212 + y, 0.044, 0.058, 0.010),
        knot(x + wide, -0.174 + y, 0.040, 0.046, 0.006),
    ];
    let calm = folds(dice, "breast", wear, [3.0, 6.0], [0.05, 0.09], [0.0, 0.3]);
    stage.add(tube(&shoulders, Ends::Round), 1.0, draped(wear.robe, calm, 0.0));
    let torso = [
        knot(x, -0.225 + y, 0.080, 0.066, 0.012),
        knot(x, -0.125 + y, 0.094, 0.070, 0.012),
    ];
    stage.add(tube(&torso, Ends::Cut(0.0)), 0.0, draped(wear.robe, calm, 0.0));
    let chest = [
        knot(x, -0.29 + y, 0.026, 0.028, 0.040),
        knot(x, -0.235 + y, 0.028, 0.030, 0.055),
        knot(x, -0.165 + y, 0.046, 0.022, 0.070),
    ];
    stage.add(tube(&chest, Ends::Cut(0.1)), 0.8, skin);
    let edge = wear.robe.edge;
    for side in [1.0, -1.0] {
        let collar = [
            knot(x + side * 0.030, -0.258 + y, 0.013, 0.009, 0.003),
            knot(x + side * 0.048, -0.212 + y, 0.015, 0.010, 0.004),
            knot(x + side * 0.024, -0.150 + y, 0.016, 0.010, 0.004),
            knot(x - side * 0.006, -0.115 + y, 0.016, 0.009, 0.004),
        ];
        stage.lay(tube(&collar, Ends::Cut(0.0)), 0.9, move |l| {
            let p = Palette::court();
            Skin::plain(if side * l.e > 0.45 { p.gold } else { edge })
        });
    }
}

pub(super) fn sash(stage: &mut Stage, dice: Dice, wear: &Wear, sway: f64) {
    let x = 0.6 * sway;
    let band = [
        knot(x - 0.098, -0.124, 0.022, 0.008, 0.003),
        knot(x, -0.112, 0.025, 0.012, 0.004),
        knot(x + 0.098, -0.124, 0.022, 0.008, 0.003),
    ];
    let (ground, edge) = (wear.shawl.ground, wear.shawl.edge);
    stage.lay(tube(&band, Ends::Cut(0.0)), 0.9, move |l| {
        Skin::plain(if l.e.abs() > 0.76 { edge } else { ground })
    });
    for k in 0..dice.pick("ribbons", &[0usize, 1, 2]) {
        let dice = dice.each("ribbon", k);
        let mut knots: Vec<Knot> = Vec::new();
        let start = x + dice.between("start", -0.03, 0.03);
        let drop = dice.between("drop", 0.26, 0.40);
        for i in 0..5 {
            let t = f64::from(i) / 4.0;
            let bend = dice.each("bend", i as usize).between("x", -0.022, 0.022) * t;
            knots.push(knot(start + bend, -0.10 + t * drop, 0.0135, 0.007, 0.004));
        }
        let pleats = folds(dice, "ribbon", wear, [2.0, 2.0], [0.2, 0.3], [-0.4, 0.1]);
        stage.lay(tube(&knots, Ends::Cut(0.0)), 0.8, draped(wear.shawl, pleats, 0.012));
    }
}

/// The ends of a shawl that hang behind the figure.
pub(super) fn shawl(stage: &mut Stage, dice: Dice, wear: &Wear, sway: f64) {
    for side in [-1.0, 1.0] {
        let dice = dice.each("shawl end", usize::from(side > 0.0));
        let out = dice.between("out", 0.20, 0.27);
        let knots = [
            knot(side * 0.110 + sway, -0.185, 0.022, 0.012, 0.0),
            knot(side * out, -0.05 + dice.between("a", -0.03, 0.03), 0.026, 0.016, 0.0),
            knot(side * (out + 0.02), 0.11, 0.028, 0.016, 0.0),
            knot(side * (out - 0.03), 0.25, 0.029, 0.016, 0.0),
            knot(side * out, dice.between("low", 0.30, 0.40), 0.034, 0.016, 0.0),
        ];
        let pleats = folds(dice, "shawl", wear, [3.0, 5.0], [0.16, 0.24], [-0.4, 0.0]);
        stage.add(tube(&knots, Ends::Cut(0.3)), 1.0, draped(wear.shawl, pleats, 0.014));
    }
}
