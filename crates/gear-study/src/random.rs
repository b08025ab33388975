//! Random numbers that are the same everywhere, by the mixing of SplitMix64 (Steele, Lea and Flood 2014): a stream, and a
//! hash of counters where no order of evaluation may matter.

/// The step of the stream: 2⁶⁴ over the golden ratio, odd.
const STEP: u64 = 0x9E37_79B9_7F4A_7C15;

fn mixed(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// 64 random bits of a seed and two counters.
pub fn bits(seed: u64, a: u64, b: u64) -> u64 {
    let counters = a.wrapping_mul(STEP).wrapping_add(b.wrapping_mul(0xD1B5_4A32_D192_ED03));
    mixed(seed.wrapping_add(counters).wrapping_add(STEP))
}

/// A whole number in `0..count` from random bits; 0 of nothing. The bias is below count / 2³².
pub fn below(bits: u64, count: usize) -> usize {
    (((bits >> 32) * count as u64) >> 32) as usize
}

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// The stream of a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(STEP);
        mixed(self.0)
    }

    /// Uniform in [0, 1), in steps of 2⁻²⁴.
    pub fn share(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 24) as f32
    }

    /// One of `0..count`; 0 of nothing.
    pub fn below(&mut self, count: usize) -> usize {
        below(self.bits(), count)
    }

    /// Puts items in a random order (Fisher and Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i + 1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_order_of_three_is_about_as_likely() {
        let mut random = Random::new(3);
        let mut counts = std::collections::BTreeMap::new();
        for _ in 0..6000 {
            let mut items = [0, 1, 2];
            random.shuffle(&mut items);
            *counts.entry(items).or_insert(0) += 1;
        }
        assert_eq!(counts.len(), 6);
        assert!(counts.values().all(|count| (850..1150).contains(count)), "{counts:?}");
    }

    #[test]
    fn every_number_below_a_count_comes_up_about_equally_often() {
        let mut counts = [0usize; 7];
        for i in 0..70_000 {
            counts[below(bits(1, 2, i), 7)] += 1;
        }
        // Ten standard deviations of a binomial with p = 1/7.
        assert!(counts.iter().all(|c| c.abs_diff(10_000) < 930), "{counts:?}");
        assert_eq!(below(u64::MAX, 0), 0);
    }
}
