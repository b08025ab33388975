//! The lotus throne.

use crate::court_lady::{ball, tube};
use crate::palette::{Palette, mix};
use crate::random::smoothstep;
use crate::shape::{Ends, knot};
use crate::stage::{Skin, Stage};

use super::Dice;

/// A lotus with two rows of petals.
pub(super) fn throne(stage: &mut Stage, dice: Dice) {
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
