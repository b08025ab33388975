//! Parameters of a scene, drawn by name.
//!
//! A draw is a hash of the scene's number and of the parameter's name, so a parameter that is added or taken away
//! changes no other.

use crate::random::uniform;

/// The dice of one scene, or of one thing in it.
#[derive(Clone, Copy, Debug)]
pub struct Dice(u64);

impl Dice {
    /// The dice of scene `number` of a family.
    pub fn of(family: &str, number: u64) -> Self {
        Self(fnv(family, number.wrapping_mul(0x9e37_79b9_7f4a_7c15)))
    }

    /// Dice of one of many equal things.
    pub fn each(self, what: &str, index: usize) -> Self {
        Self(fnv(
            what,
            self.0 ^ (index as u64 + 1).wrapping_mul(0xd6e8_feb8_6659_fd93),
        ))
    }

    /// Uniform in [0, 1).
    pub fn unit(self, what: &str) -> f64 {
        uniform(self.0, fnv(what, 0) as i64, 0)
    }

    /// Uniform in [low, high).
    pub fn between(self, what: &str, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit(what)
    }

    /// True with this probability.
    pub fn chance(self, what: &str, share: f64) -> bool {
        self.unit(what) < share
    }

    /// One of several.
    pub fn pick<T: Copy>(self, what: &str, of: &[T]) -> T {
        of[((self.unit(what) * of.len() as f64) as usize).min(of.len() - 1)]
    }

    /// A seed for noise.
    pub fn seed(self, what: &str) -> u64 {
        fnv(what, self.0) >> 16
    }
}

/// FNV-1a.
fn fnv(text: &str, start: u64) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325 ^ start, |h, b| {
        (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_draw_depends_on_scene_and_name_and_on_nothing_else() {
        let dice = Dice::of("figure", 1);
        assert_eq!(
            dice.unit("width").to_bits(),
            Dice::of("figure", 1).unit("width").to_bits()
        );
        assert_ne!(dice.unit("width"), dice.unit("height"));
        assert_ne!(dice.unit("width"), Dice::of("figure", 2).unit("width"));
        assert_ne!(dice.unit("width"), Dice::of("vessel", 1).unit("width"));
        assert_ne!(dice.each("fold", 0).unit("width"), dice.each("fold", 1).unit("width"));
    }

    #[test]
    fn draws_fill_their_range() {
        let mean = (0..2000)
            .map(|n| Dice::of("any", n).between("x", 2.0, 4.0))
            .sum::<f64>()
            / 2000.0;
        assert!((mean - 3.0).abs() < 0.05, "{mean}");
    }
}
