//! Figures with drapery: standing, enthroned, dancing.
//!
//! As in [`crate::court_lady`], parts are tubes and ellipsoids from back to front; here knots, folds, cloth, poses and
//! hair are drawn. Silhouettes of bodies stand at height 0, fronts at about .1.

mod arms;
mod dress;
mod head;
mod poses;
mod throne;

use crate::palette::Palette;
use crate::shape::Local;
use crate::stage::{Skin, Stage};
use crate::textile::Pleats;

use super::cloth::Cloth;
use super::dice::Dice;
use head::Hair;

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
        1 => poses::standing(&mut stage, dice, &wear),
        2 => poses::enthroned(&mut stage, dice, &wear),
        _ => poses::dancing(&mut stage, dice, &wear),
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
