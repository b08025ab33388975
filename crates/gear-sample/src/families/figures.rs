//! Figures with drapery: standing, enthroned, dancing.
//!
//! As in [`crate::court_lady`], parts are tubes and ellipsoids from back to front; here knots, folds, cloth, poses and
//! hair are drawn. Silhouettes of bodies stand at height 0, fronts at about .1.

use std::f64::consts::TAU;

use crate::court_lady::{ball, face, hand, tube};
use crate::palette::{Palette, mix, scale};
use crate::random::smoothstep;
use crate::shape::{Ends, Knot, Local, knot};
use crate::stage::{Colour, Skin, Stage};
use crate::textile::{Pleats, blossom};

use super::cloth::Cloth;
use super::dice::Dice;

/// Width of a drawn fold line, world units.
const FOLD_LINE: f64 = 0.0016;

/// Builds figure `number`; `seed` lets the folds fall otherwise.
pub fn stage(number: u64, seed: u64) -> Stage {
    let dice = Dice::of("figure", number);
    let mut stage = Stage {
        aspect: 0.75,
        parts: Vec::new(),
        whole_canvas: false,
    };
    let wear = Wear::drawn(dice, seed);
    match number % 3 {
        1 => standing(&mut stage, dice, &wear),
        2 => enthroned(&mut stage, dice, &wear),
        _ => dancing(&mut stage, dice, &wear),
    }
    stage
}

/// What a figure wears.
struct Wear {
    robe: Cloth,
    skirt: Cloth,
    shawl: Cloth,
    hair: Hair,
    seed: u64,
}

#[derive(Clone, Copy)]
enum Hair {
    Bun,
    TwoBuns,
    Cap,
    Crown,
    Shaven,
}

impl Wear {
    fn drawn(dice: Dice, seed: u64) -> Self {
        Self {
            robe: Cloth::drawn(dice.each("cloth", 0)),
            skirt: Cloth::drawn(dice.each("cloth", 1)),
            shawl: Cloth::drawn(dice.each("cloth", 2)),
            hair: dice.pick(
                "hair",
                &[Hair::Bun, Hair::TwoBuns, Hair::Cap, Hair::Crown, Hair::Shaven],
            ),
            seed: dice.seed("folds").wrapping_add(seed),
        }
    }
}

/// Folds of a piece: how many, how deep, from where along it.
fn folds(dice: Dice, what: &str, wear: &Wear, count: [f64; 2], height: [f64; 2], from: [f64; 2]) -> Pleats {
    let dice = dice.each(what, 0);
    Pleats {
        count: dice.between("count", count[0], count[1]).round(),
        height: dice.between("height", height[0], height[1]),
        from,
        sweep: dice.between("sweep", -1.6, 1.6),
        seed: wear.seed.wrapping_add(dice.seed("pleats") & 0xffff),
    }
}

/// Cloth in folds, with an edge of its own colour at the far end.
fn draped(cloth: Cloth, pleats: Pleats, hem: f64) -> impl Fn(&Local) -> Skin + Send + Sync + 'static {
    move |l| {
        let (relief, ink) = pleats.at(l, FOLD_LINE);
        let rise = (1.0 - l.s) * l.length;
        let albedo = if rise < hem { cloth.edge } else { cloth.at(l) };
        Skin { albedo, relief, ink }
    }
}

fn skin(_: &Local) -> Skin {
    Skin::plain(Palette::court().skin)
}

fn standing(stage: &mut Stage, dice: Dice, wear: &Wear) {
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

/// Shoulders, breast and crossed collars, the neck at (`at.0`, −.29 + `at.1`).
fn bust(stage: &mut Stage, dice: Dice, wear: &Wear, at: [f64; 2]) {
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

fn sash(stage: &mut Stage, dice: Dice, wear: &Wear, sway: f64) {
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
fn shawl(stage: &mut Stage, dice: Dice, wear: &Wear, sway: f64) {
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

/// Two sleeved arms: clasped before the body, one raised with something in its hand, or one on the hip.
fn arms(stage: &mut Stage, dice: Dice, wear: &Wear, at: [f64; 2]) {
    let [x, y] = at;
    let wide = dice.between("sleeves", 0.040, 0.066);
    let pose = dice.pick("arms", &["clasped", "raised", "raised", "open"]);
    let raised = dice.pick("raised side", &[-1.0, 1.0]);
    for side in [-1.0, 1.0] {
        let (elbow, wrist) = match pose {
            "raised" if side == raised => ([0.170, -0.085], [0.125, -0.190]),
            "open" => ([0.165, -0.070], [0.205, 0.020]),
            _ => ([0.148, -0.075], [0.048, -0.015]),
        };
        let place = |p: [f64; 2]| [x + side * p[0], y + p[1]];
        let (e, w) = (place(elbow), place(wrist));
        let mouth = [0.75 * w[0] + 0.25 * e[0], 0.75 * w[1] + 0.25 * e[1]];
        let drop = dice.between("mouth", 0.12, 0.20);
        let hanging = [
            knot(mouth[0], mouth[1] - 0.02, 0.75 * wide, 0.036, 0.056),
            knot(mouth[0] + side * 0.006, mouth[1] + 0.45 * drop, wide, 0.040, 0.066),
            knot(mouth[0] - side * 0.004, mouth[1] + drop, 1.15 * wide, 0.042, 0.072),
        ];
        let lower = folds(
            dice.each("mouth", usize::from(side > 0.0)),
            "mouth",
            wear,
            [4.0, 7.0],
            [0.12, 0.18],
            [0.0, 0.35],
        );
        stage.add(tube(&hanging, Ends::Cut(0.35)), 1.1, draped(wear.robe, lower, 0.026));
        let wrap = folds(
            dice.each("arm", usize::from(side > 0.0)),
            "arm",
            wear,
            [4.0, 6.0],
            [0.10, 0.16],
            [0.0, 0.5],
        );
        let shoulder = [x + side * 0.106, y - 0.178];
        let between = |a: [f64; 2], b: [f64; 2], t: f64| [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
        // Two tubes where the arm folds back: one that bends sharply has a spike at its elbow.
        if pose == "raised" && side == raised {
            let m = between(shoulder, e, 0.5);
            let upper = [
                knot(shoulder[0], shoulder[1], 0.040, 0.044, 0.020),
                knot(m[0], m[1], 0.044, 0.046, 0.030),
                knot(e[0], e[1], 0.044, 0.044, 0.040),
            ];
            stage.add(tube(&upper, Ends::Round), 1.05, draped(wear.robe, wrap, 0.0));
            let m = between(e, w, 0.5);
            let lower = [
                knot(e[0], e[1], 0.043, 0.042, 0.056),
                knot(m[0], m[1], 0.041, 0.042, 0.076),
                knot(w[0], w[1], 0.034, 0.036, 0.098),
            ];
            stage.add(tube(&lower, Ends::Round), 1.05, draped(wear.robe, wrap, 0.018));
        } else {
            let m = between(e, w, 0.5);
            let arm = [
                knot(shoulder[0], shoulder[1], 0.040, 0.044, 0.020),
                knot(e[0], e[1], 0.046, 0.046, 0.040),
                knot(m[0], m[1], 0.043, 0.043, 0.068),
                knot(w[0], w[1], 0.035, 0.036, 0.098),
            ];
            stage.add(tube(&arm, Ends::Cut(0.25)), 1.05, draped(wear.robe, wrap, 0.018));
        }
        if pose == "raised" && side == raised {
            held(stage, dice, [w[0] - side * 0.004, w[1] - 0.02]);
            hand(
                stage,
                [w[0] - side * 0.004, w[1] - 0.030],
                -TAU / 4.0 - side * 0.25,
                0.128,
            );
        } else {
            let turn = if side < 0.0 { 0.15 } else { TAU / 2.0 - 0.15 };
            let turn = if pose == "open" { TAU / 4.0 } else { turn };
            let reach = if pose == "open" {
                [0.0, 0.028]
            } else {
                [-side * 0.022, 0.0]
            };
            hand(stage, [w[0] + reach[0], w[1] + reach[1]], turn, 0.112 + 0.004 * side);
        }
    }
}

/// A lotus, a round fan or a scroll in the raised hand.
fn held(stage: &mut Stage, dice: Dice, at: [f64; 2]) {
    let p = Palette::court();
    let [x, y] = at;
    let stem = |stage: &mut Stage, top: f64, colour: Colour| {
        let knots = [
            knot(x, y + 0.03, 0.0042, 0.006, 0.118),
            knot(x + 0.006, top, 0.0042, 0.006, 0.118),
        ];
        stage.add(tube(&knots, Ends::Round), 0.5, move |_| Skin::plain(colour));
    };
    match dice.pick("held", &["lotus", "fan", "scroll"]) {
        "lotus" => {
            stem(stage, y - 0.10, p.malachite);
            for k in [-2i32, 2, -1, 1, 0] {
                let turn = -TAU / 4.0 + 0.42 * f64::from(k);
                let center = [x + 0.006 + 0.024 * libm::cos(turn), y - 0.10 + 0.030 * libm::sin(turn)];
                stage.add(
                    ball(center, [0.034, 0.013], turn, 0.014, 0.120 - 0.003 * f64::from(k.abs())),
                    0.6,
                    |l| {
                        let p = Palette::court();
                        Skin::plain(mix(p.white, p.cinnabar, smoothstep(-0.4, 1.0, l.x)))
                    },
                );
            }
        }
        "fan" => {
            stem(stage, y - 0.10, p.lac);
            let cloth = Cloth::drawn(dice.each("fan", 0));
            stage.add(
                ball([x + 0.01, y - 0.145], [0.062, 0.068], 0.2, 0.014, 0.116),
                0.9,
                move |l| {
                    let p = Palette::court();
                    let flower = blossom(l.x, l.y, 0.42, 2.5, cloth.ground, p.gold);
                    Skin {
                        albedo: if l.e > 0.92 { p.lac } else { flower.unwrap_or(p.white) },
                        relief: if l.e > 0.92 { 0.002 } else { 0.0 },
                        ink: 0.0,
                    }
                },
            );
        }
        _ => {
            let roll = [
                knot(x - 0.055, y - 0.012, 0.018, 0.018, 0.112),
                knot(x + 0.055, y - 0.040, 0.018, 0.018, 0.112),
            ];
            stage.add(tube(&roll, Ends::Cut(0.3)), 0.9, |l| {
                let p = Palette::court();
                Skin::plain(if !(0.06..0.94).contains(&l.s) { p.lac } else { p.white })
            });
        }
    }
}

fn hair_colour() -> Colour {
    scale(Palette::court().ink, 1.3)
}

fn back_hair(stage: &mut Stage, at: [f64; 2], hair: Hair) {
    if !matches!(hair, Hair::Shaven) {
        stage.add(ball(at, [0.062, 0.060], 0.0, 0.03, 0.0), 1.0, |_| {
            Skin::plain(hair_colour())
        });
    }
}

/// The head at `at`, with ears, hair or a hat.
fn head(stage: &mut Stage, at: [f64; 2], hair: Hair) {
    let [x, y] = at;
    for side in [-1.0, 1.0] {
        stage.add(
            ball([x + side * 0.052, y + 0.006], [0.009, 0.018], 0.0, 0.012, 0.040),
            0.5,
            skin,
        );
    }
    stage.add(ball(at, [0.052, 0.062], 0.0, 0.062, 0.046), 0.9, face);
    let strands = |l: &Local| {
        let p = Palette::court();
        let wave = libm::sin(16.0 * libm::atan2(l.y + 1.6, l.x) + 2.0 * l.e);
        Skin {
            albedo: mix(hair_colour(), scale(p.indigo, 2.2), 0.5 * smoothstep(0.55, 1.0, wave)),
            relief: 0.0012 * wave,
            ink: 0.0,
        }
    };
    let wings = |stage: &mut Stage| {
        for side in [-1.0, 1.0] {
            let wing = [
                knot(x + side * 0.004, y - 0.064, 0.016, 0.020, 0.085),
                knot(x + side * 0.034, y - 0.052, 0.019, 0.024, 0.075),
                knot(x + side * 0.054, y - 0.016, 0.016, 0.022, 0.056),
                knot(x + side * 0.057, y + 0.026, 0.010, 0.016, 0.046),
            ];
            stage.add(tube(&wing, Ends::Round), 0.5, |l| Skin {
                albedo: hair_colour(),
                relief: 0.001 * libm::sin(7.0 * l.e),
                ink: 0.0,
            });
        }
    };
    let gold = |_: &Local| Skin::plain(Palette::court().gold);
    match hair {
        Hair::Bun => {
            wings(stage);
            stage.add(
                ball([x + 0.008, y - 0.098], [0.042, 0.038], -0.25, 0.045, 0.048),
                0.5,
                strands,
            );
            stage.add(ball([x, y - 0.072], [0.030, 0.009], 0.0, 0.014, 0.092), 0.7, gold);
        }
        Hair::TwoBuns => {
            wings(stage);
            for side in [-1.0, 1.0] {
                stage.add(
                    ball([x + side * 0.044, y - 0.076], [0.030, 0.034], side * 0.4, 0.034, 0.050),
                    0.6,
                    strands,
                );
                stage.add(
                    ball([x + side * 0.036, y - 0.060], [0.012, 0.012], 0.0, 0.012, 0.088),
                    0.5,
                    |_| Skin::plain(Palette::court().cinnabar),
                );
            }
        }
        Hair::Cap => {
            wings(stage);
            let crown = [
                knot(x, y - 0.082, 0.050, 0.048, 0.056),
                knot(x, y - 0.128, 0.034, 0.038, 0.052),
            ];
            stage.add(tube(&crown, Ends::Round), 0.9, |l| {
                let p = Palette::court();
                Skin::plain(if l.s < 0.18 { p.gold } else { scale(p.indigo, 1.2) })
            });
        }
        Hair::Crown => {
            wings(stage);
            stage.add(ball([x, y - 0.088], [0.032, 0.034], 0.0, 0.040, 0.050), 0.5, strands);
            for k in -2i32..=2 {
                let t = f64::from(k);
                let center = [x + 0.021 * t, y - 0.072 + 0.0022 * t * t];
                stage.add(
                    ball(
                        center,
                        [0.010, 0.021 - 0.002 * t.abs()],
                        0.0,
                        0.010,
                        0.094 - 0.004 * t * t,
                    ),
                    0.6,
                    |l| {
                        let p = Palette::court();
                        Skin::plain(if l.e < 0.4 { p.cinnabar } else { p.gold })
                    },
                );
            }
        }
        Hair::Shaven => {
            // the dome of the skull, and the mark of wisdom
            stage.add(ball([x, y - 0.052], [0.030, 0.022], 0.0, 0.028, 0.070), 0.4, |_| {
                Skin::plain(mix(Palette::court().skin, Palette::court().indigo, 0.45))
            });
        }
    }
}

/// Cross-legged on a lotus throne, with a halo.
fn enthroned(stage: &mut Stage, dice: Dice, wear: &Wear) {
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

/// A lotus with two rows of petals.
fn throne(stage: &mut Stage, dice: Dice) {
    let p = Palette::court();
    let petal = dice.pick("petal", &[p.peony, p.cinnabar, p.celadon, p.azurite]);
    let count = dice.pick("petals", &[4i32, 5, 6]);
    let foot = [
        knot(-0.17, 0.435, 0.028, 0.08, 0.0),
        knot(0.0, 0.438, 0.030, 0.12, 0.0),
        knot(0.17, 0.435, 0.028, 0.08, 0.0),
    ];
    stage.add(tube(&foot, Ends::Round), 1.0, |l| {
        let p = Palette::court();
        Skin::plain(if l.e.abs() < 0.3 { p.gold } else { p.lac })
    });
    for (row, y) in [(0, 0.375), (1, 0.400)] {
        for k in -count..=count {
            let t = (f64::from(k) + 0.5 * f64::from(row)) / f64::from(count);
            if t.abs() > 1.0 {
                continue;
            }
            let x = 0.225 * libm::sin(1.35 * t) / libm::sin(1.35);
            let face = (1.0 - 0.8 * t * t).max(0.1);
            let center = [x, y - 0.014 * t * t];
            let radii = [0.036 * (0.45 + 0.55 * face), 0.044];
            stage.add(
                ball(
                    center,
                    radii,
                    0.25 * t,
                    0.032,
                    0.02 + 0.085 * face + 0.012 * f64::from(row),
                ),
                0.9,
                move |l| {
                    let p = Palette::court();
                    let vein = smoothstep(0.10, 0.03, l.x.abs());
                    Skin {
                        albedo: mix(mix(petal, p.white, smoothstep(0.9, -0.7, l.y)), p.lac, 0.4 * vein),
                        relief: 0.0,
                        ink: 0.0,
                    }
                },
            );
        }
    }
}

/// A dancer: a bent body, a flaring skirt, long sleeves that fly.
fn dancing(stage: &mut Stage, dice: Dice, wear: &Wear) {
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
