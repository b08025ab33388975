//! Sleeved arms, hands, and what they hold.

use std::f64::consts::TAU;

use crate::court_lady::{ball, hand, tube};
use crate::palette::{Palette, mix};
use crate::random::smoothstep;
use crate::shape::{Ends, knot};
use crate::stage::{Colour, Skin, Stage};
use crate::textile::blossom;

use super::{Cloth, Dice, Wear, draped, folds};

/// Two sleeved arms: clasped before the body, one raised with something in its hand, or one on the hip.
pub(super) fn arms(stage: &mut Stage, dice: Dice, wear: &Wear, at: [f64; 2]) {
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
