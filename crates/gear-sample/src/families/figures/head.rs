//! Heads: face, ears, and what is worn on them.

use crate::court_lady::{ball, face, tube};
use crate::palette::{Palette, mix, scale};
use crate::random::smoothstep;
use crate::shape::{Ends, Local, knot};
use crate::stage::{Colour, Skin, Stage};

use super::skin;

#[derive(Clone, Copy)]
pub(super) enum Hair {
    Bun,
    TwoBuns,
    Cap,
    Crown,
    Shaven,
}

fn hair_colour() -> Colour {
    scale(Palette::court().ink, 1.3)
}

pub(super) fn back_hair(stage: &mut Stage, at: [f64; 2], hair: Hair) {
    if !matches!(hair, Hair::Shaven) {
        stage.add(ball(at, [0.062, 0.060], 0.0, 0.03, 0.0), 1.0, |_| {
            Skin::plain(hair_colour())
        });
    }
}

/// The head at `at`, with ears, hair or a hat.
pub(super) fn head(stage: &mut Stage, at: [f64; 2], hair: Hair) {
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
