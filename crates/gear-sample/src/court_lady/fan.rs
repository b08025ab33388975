//! The round fan and the hands.

use crate::palette::{Palette, mix};
use crate::random::smoothstep;
use crate::shape::{Ends, Local, knot};
use crate::stage::{Skin, Stage};
use crate::textile::blossom;

use super::{ball, stroke, tube};

/// A hand: a palm and four fingers that point along `turn`.
pub fn hand(stage: &mut Stage, at: [f64; 2], turn: f64, z: f64) {
    let (sin, cos) = (libm::sin(turn), libm::cos(turn));
    let skin = |_: &Local| Skin::plain(Palette::court().skin);
    stage.add(ball(at, [0.024, 0.0155], turn, 0.016, z), 0.6, skin);
    for k in 0..4 {
        let off = 0.0072 * (f64::from(k) - 1.5);
        let along = 0.024 - 0.0022 * (f64::from(k) - 1.2) * (f64::from(k) - 1.2);
        let center = [at[0] + cos * along - sin * off, at[1] + sin * along + cos * off];
        stage.add(
            ball(
                center,
                [0.017, 0.0046],
                turn + 0.10 * (f64::from(k) - 1.5),
                0.006,
                z + 0.006,
            ),
            0.45,
            skin,
        );
    }
}

pub fn fan(stage: &mut Stage) {
    let handle = [
        knot(0.062, -0.020, 0.0038, 0.005, 0.128),
        knot(0.108, -0.200, 0.0038, 0.005, 0.128),
    ];
    stage.add(tube(&handle, Ends::Round), 0.5, |_| Skin::plain(Palette::court().lac));
    stage.add(ball([0.130, -0.268], [0.072, 0.078], 0.2, 0.012, 0.126), 0.9, |l| {
        let p = Palette::court();
        let r = l.e;
        if r > 0.93 {
            return Skin {
                albedo: p.lac,
                relief: 0.002,
                ink: 0.0,
            };
        }
        // a branch of plum blossom on white silk
        let (x, y) = (l.x, l.y);
        let branch = stroke(x + 0.05, y - 0.25 + 0.55 * x, 0.80, -0.22, 0.050);
        let twig = stroke(y + 0.12, x - 0.18 - 0.3 * y, 0.38, 0.10, 0.030);
        let mut albedo = mix(p.white, p.silk, 0.25 * smoothstep(0.2, 1.0, r));
        for (fx, fy, size) in [
            (-0.45, 0.42, 0.17),
            (-0.12, 0.20, 0.20),
            (0.22, -0.34, 0.18),
            (0.36, 0.02, 0.21),
            (0.05, -0.10, 0.15),
            (0.52, -0.32, 0.13),
        ] {
            if let Some(c) = blossom(x - fx, y - fy, size, 2.5, p.cinnabar, p.gold) {
                albedo = c;
                return Skin::plain(mix(albedo, p.peony, 0.35));
            }
        }
        Skin {
            albedo,
            relief: 0.0,
            ink: 0.85 * branch.max(twig),
        }
    });
    hand(stage, [0.078, -0.075], -1.15, 0.132);
}
