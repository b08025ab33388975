//! Cloth and glaze: a ground colour and a pattern, drawn.

use crate::palette::{Palette, mix, scale};
use crate::shape::Local;
use crate::stage::Colour;
use crate::textile::{roundels, scallops, sprinkled, unrolled};

use super::dice::Dice;

/// Pattern and colours of one piece.
#[derive(Clone, Copy, Debug)]
pub struct Cloth {
    pattern: Pattern,
    /// The colour between the pattern.
    pub ground: Colour,
    /// Hems and rims.
    pub edge: Colour,
    motif: Colour,
    accent: Colour,
    pitch: f64,
    seed: u64,
}

#[derive(Clone, Copy, Debug)]
enum Pattern {
    Plain,
    Blossoms,
    Roundels,
    Stripes,
    Scales,
}

impl Cloth {
    /// Draws a piece.
    pub fn drawn(dice: Dice) -> Self {
        let p = Palette::court();
        let deep = [
            p.cinnabar,
            p.lac,
            p.malachite,
            p.azurite,
            scale(p.indigo, 1.5),
            scale(p.ochre, 0.8),
            mix(p.lac, p.azurite, 0.5),
            mix(p.malachite, p.ochre, 0.5),
        ];
        let pale = [p.white, p.celadon, p.peony, p.gold, mix(p.white, p.azurite, 0.25)];
        let is_deep = dice.chance("deep ground", 0.62);
        let (grounds, motifs): (&[Colour], &[Colour]) = if is_deep { (&deep, &pale) } else { (&pale, &deep) };
        Self {
            pattern: dice.pick(
                "pattern",
                &[
                    Pattern::Plain,
                    Pattern::Plain,
                    Pattern::Blossoms,
                    Pattern::Roundels,
                    Pattern::Stripes,
                    Pattern::Scales,
                ],
            ),
            ground: dice.pick("ground", grounds),
            edge: dice.pick("edge", &[p.gold, p.indigo, p.white, p.lac]),
            motif: dice.pick("motif", motifs),
            accent: dice.pick("accent", &[p.gold, p.cinnabar, p.white]),
            pitch: dice.between("pitch", 0.030, 0.062),
            seed: dice.seed("cloth"),
        }
    }

    /// The colour at a point of the cloth on a tube.
    pub fn at(&self, local: &Local) -> Colour {
        let (u, v) = unrolled(local);
        self.at_place(u, v)
    }

    /// The colour at (u, v) on the cloth, world units.
    pub fn at_place(&self, u: f64, v: f64) -> Colour {
        match self.pattern {
            Pattern::Plain => self.ground,
            Pattern::Blossoms => {
                sprinkled(u, v, self.pitch, 0.62, self.seed, [self.motif, self.accent]).unwrap_or(self.ground)
            }
            Pattern::Roundels => {
                roundels(u, v, 1.5 * self.pitch, [self.motif, self.ground, self.accent]).unwrap_or(self.ground)
            }
            Pattern::Stripes => {
                let t = (v / (0.8 * self.pitch)).rem_euclid(1.0);
                if t < 0.24 {
                    self.motif
                } else if (0.30..0.36).contains(&t) {
                    self.accent
                } else {
                    self.ground
                }
            }
            Pattern::Scales => {
                let d = scallops(u, v, 0.8 * self.pitch);
                if d > 0.82 || (0.40..0.52).contains(&d) {
                    self.motif
                } else {
                    self.ground
                }
            }
        }
    }
}
