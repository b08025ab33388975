//! The three poses, each from its parts.

use std::f64::consts::TAU;

use crate::court_lady::{ball, tube};
use crate::palette::{Palette, mix};
use crate::random::smoothstep;
use crate::shape::{Ends, knot};
use crate::stage::{Skin, Stage};

use super::arms::arms;
use super::dress::{bust, sash, shawl};
use super::head::{back_hair, head};
use super::throne::throne;
use super::{Dice, Wear, draped, folds};

pub(super) fn standing(stage: &mut Stage, dice: Dice, wear: &Wear) {
    let sway = dice.between("sway", -0.035, 0.035);
    let hem = dice.between("hem", 0.135, 0.205);
    let low = dice.between("low", 0.385, 0.425);
    if dice.chance("shawl", 0.5) {
        shawl(stage, dice, wear, sway);
    }
    for side in [-1.0, 1.0] {
        stage.add(
            ball(
                [side * 0.055 - 0.3 * sway, low + 0.022],
                [0.046, 0.023],
                side * 0.12,
                0.05,
                0.03,
            ),
            1.0,
            |_| Skin::plain(Palette::court().lac),
        );
    }
    back_hair(stage, [1.2 * sway, -0.32], wear.hair);
    let hips = dice.between("hips", 0.098, 0.125);
    let skirt = [
        knot(0.6 * sway, -0.155, 0.088, 0.062, 0.0),
        knot(-0.2 * sway, -0.02, hips, 0.078, 0.0),
        knot(-0.8 * sway, 0.14, 0.5 * (hips + hem), 0.092, 0.0),
        knot(-0.4 * sway, 0.29, 0.25 * hips + 0.75 * hem, 0.105, 0.0),
        knot(0.3 * sway, low, hem, 0.112, 0.0),
    ];
    let pleats = folds(dice, "skirt", wear, [7.0, 15.0], [0.07, 0.12], [0.05, 0.55]);
    stage.add(tube(&skirt, Ends::Cut(0.10)), 1.15, draped(wear.skirt, pleats, 0.030));
    if dice.chance("open robe", 0.65) {
        let flare = dice.between("flare", 0.12, 0.20);
        for side in [-1.0, 1.0] {
            let panel = [
                knot(side * 0.070 + 0.6 * sway, -0.205, 0.044, 0.040, 0.030),
                knot(side * (0.062 + 0.25 * flare) - 0.2 * sway, -0.05, 0.044, 0.036, 0.034),
                knot(side * (0.062 + 0.55 * flare) - 0.6 * sway, 0.12, 0.050, 0.038, 0.032),
                knot(side * (0.062 + 0.85 * flare) - 0.3 * sway, 0.27, 0.056, 0.042, 0.026),
                knot(side * (0.062 + flare), low - 0.04, 0.064, 0.044, 0.020),
            ];
            let pleats = folds(
                dice.each("panel", usize::from(side > 0.0)),
                "panel",
                wear,
                [3.0, 6.0],
                [0.12, 0.2],
                [0.1, 0.5],
            );
            stage.add(tube(&panel, Ends::Cut(0.25)), 1.1, draped(wear.robe, pleats, 0.026));
        }
    }
    bust(stage, dice, wear, [sway, 0.0]);
    head(stage, [1.2 * sway, -0.322], wear.hair);
    sash(stage, dice, wear, sway);
    arms(stage, dice, wear, [sway, 0.0]);
}

/// Cross-legged on a lotus throne, with a halo.
pub(super) fn enthroned(stage: &mut Stage, dice: Dice, wear: &Wear) {
    let p = Palette::court();
    let up = 0.085;
    if dice.chance("halo", 0.7) {
        let (rim, rays) = (
            dice.pick("halo rim", &[p.gold, p.malachite, p.azurite]),
            dice.between("rays", 14.0, 26.0).round(),
        );
        stage.add(
            ball([0.0, -0.322 + up], [0.135, 0.135], 0.0, 0.012, 0.0),
            1.0,
            move |l| {
                let p = Palette::court();
                let ray = libm::sin(rays * TAU * l.s) > 0.0;
                Skin::plain(if l.e > 0.9 {
                    rim
                } else if l.e > 0.8 {
                    p.cinnabar
                } else if ray {
                    p.celadon
                } else {
                    mix(p.celadon, p.white, 0.5)
                })
            },
        );
    }
    back_hair(stage, [0.0, -0.32 + up], wear.hair);
    throne(stage, dice);
    // the robe over the hips, then the crossed legs before it
    let trunk = [
        knot(0.0, -0.20 + up, 0.090, 0.070, 0.0),
        knot(0.0, -0.05 + up, 0.102, 0.082, 0.0),
        knot(0.0, 0.10 + up, 0.135, 0.095, 0.0),
        knot(0.0, 0.19 + up, 0.155, 0.095, 0.0),
    ];
    let calm = folds(dice, "trunk", wear, [5.0, 9.0], [0.06, 0.10], [0.0, 0.4]);
    stage.add(tube(&trunk, Ends::Cut(0.1)), 1.1, draped(wear.robe, calm, 0.0));
    let spread = dice.between("knees", 0.205, 0.250);
    let thick = dice.between("shins", 0.056, 0.072);
    for side in [-1.0, 1.0] {
        let leg = [
            knot(side * 0.060, 0.115 + up, 0.9 * thick, 0.060, 0.030),
            knot(side * 0.75 * spread, 0.140 + up, 1.1 * thick, 0.070, 0.040),
            knot(side * spread, 0.190 + up, thick, 0.065, 0.050),
            knot(side * 0.45 * spread, 0.225 + up, 0.95 * thick, 0.066, 0.072),
            knot(-side * 0.20 * spread, 0.228 + up, 0.80 * thick, 0.055, 0.080),
        ];
        let pleats = folds(
            dice.each("leg", usize::from(side > 0.0)),
            "leg",
            wear,
            [4.0, 7.0],
            [0.10, 0.16],
            [0.0, 0.3],
        );
        stage.add(tube(&leg, Ends::Round), 1.1, draped(wear.skirt, pleats, 0.0));
    }
    // cloth that falls over the edge of the seat
    let fall = [
        knot(-0.165, 0.262 + up, 0.030, 0.022, 0.105),
        knot(0.0, 0.278 + up, 0.044, 0.030, 0.118),
        knot(0.165, 0.262 + up, 0.030, 0.022, 0.105),
    ];
    let scallop = dice.between("scallop", 9.0, 15.0).round();
    let cloth = wear.skirt;
    stage.add(tube(&fall, Ends::Round), 1.0, move |l| {
        let t = scallop * l.s;
        let arch = libm::sin(std::f64::consts::PI * (t - t.floor()));
        Skin {
            albedo: if l.e > 0.55 { cloth.edge } else { cloth.at(l) },
            relief: 0.012 * arch,
            ink: 0.8 * smoothstep(0.30, 0.05, arch) * smoothstep(1.0, 0.7, l.e.abs()),
        }
    });
    bust(stage, dice, wear, [0.0, up]);
    head(stage, [0.0, -0.322 + up], wear.hair);
    arms(stage, dice, wear, [0.0, up + 0.02]);
}

/// A dancer: a bent body, a flaring skirt, long sleeves that fly.
pub(super) fn dancing(stage: &mut Stage, dice: Dice, wear: &Wear) {
    let lean = dice.pick("lean", &[-1.0, 1.0]) * dice.between("bend", 0.03, 0.055);
    // sleeves behind the body first
    let back = -lean.signum();
    let fly = |side: f64, lift: f64, z: f64| {
        [
            knot(side * 0.102 + 1.2 * lean, -0.180, 0.036, 0.040, 0.016 + z),
            knot(side * 0.195 + lean, -0.200 + 0.3 * lift, 0.036, 0.036, 0.020 + z),
            knot(side * 0.265 + lean, -0.245 + lift, 0.034, 0.030, 0.024 + z),
            knot(side * 0.300 + lean * 0.5, -0.180 + 1.3 * lift, 0.032, 0.024, 0.020 + z),
            knot(side * 0.272, -0.080 + 1.5 * lift, 0.036, 0.022, 0.014 + z),
            knot(side * 0.308, 0.020 + 1.6 * lift, 0.040, 0.022, 0.010 + z),
        ]
    };
    let lifts = [dice.between("lift a", -0.06, 0.02), dice.between("lift b", 0.10, 0.20)];
    let pleats = folds(dice, "fly", wear, [3.0, 6.0], [0.14, 0.22], [0.0, 0.4]);
    stage.add(
        tube(&fly(back, lifts[0], 0.0), Ends::Cut(0.4)),
        1.05,
        draped(wear.robe, pleats, 0.03),
    );
    back_hair(stage, [1.9 * lean, -0.316], wear.hair);
    let hem = dice.between("hem", 0.19, 0.25);
    let skirt = [
        knot(0.9 * lean, -0.155, 0.084, 0.062, 0.0),
        knot(-0.3 * lean, -0.02, 0.108, 0.080, 0.0),
        knot(-1.2 * lean, 0.13, 0.135, 0.094, 0.0),
        knot(-lean, 0.28, 0.45 * hem + 0.08, 0.108, 0.0),
        knot(-0.6 * lean, 0.375, hem, 0.118, 0.0),
    ];
    let pleats = folds(dice, "skirt", wear, [9.0, 15.0], [0.09, 0.14], [0.0, 0.45]);
    stage.add(tube(&skirt, Ends::Cut(0.14)), 1.15, draped(wear.skirt, pleats, 0.034));
    // an apron that swings the other way
    let apron = [
        knot(0.7 * lean, -0.115, 0.050, 0.020, 0.070),
        knot(-0.5 * lean, 0.03, 0.058, 0.022, 0.086),
        knot(-1.6 * lean, 0.17, 0.062, 0.024, 0.100),
        knot(-1.9 * lean, 0.27, 0.060, 0.022, 0.104),
    ];
    let swing = folds(dice, "apron", wear, [3.0, 5.0], [0.10, 0.16], [0.0, 0.4]);
    stage.add(tube(&apron, Ends::Cut(0.6)), 1.0, draped(wear.shawl, swing, 0.022));
    bust(stage, dice, wear, [1.1 * lean, 0.0]);
    head(stage, [1.9 * lean, -0.322], wear.hair);
    sash(stage, dice, wear, 1.3 * lean);
    let pleats = folds(dice.each("other", 0), "fly", wear, [3.0, 6.0], [0.14, 0.22], [0.0, 0.4]);
    stage.add(
        tube(&fly(-back, lifts[1], 0.030), Ends::Cut(0.4)),
        1.05,
        draped(wear.robe, pleats, 0.03),
    );
}
