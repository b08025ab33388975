//! Stage 2: front to back. A stable radix sort of depths; ties keep scene order.

use rayon::prelude::*;

/// A Gaussian to be sorted: its depth as an integer of the same order in the upper half, its index in the lower. No two
/// are equal, and among equal depths the scene's order holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Key(u64);

impl Key {
    pub fn new(depth: f32, id: u32) -> Self {
        Self(u64::from(ordered(depth)) << 32 | u64::from(id))
    }

    pub fn id(self) -> u32 {
        self.0 as u32
    }

    fn depth(self) -> u32 {
        (self.0 >> 32) as u32
    }
}

/// Maps an f32 to a u32 of the same order: negatives are flipped whole, the others get the sign bit.
fn ordered(x: f32) -> u32 {
    let bits = (x + 0.0).to_bits(); // −0 becomes +0
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

const DIGIT_BITS: u32 = 11;
const DIGITS: usize = 1 << DIGIT_BITS;
/// The keys' range of depths is cut into so many buckets, which are sorted at the same time.
const BUCKETS: usize = 64;
/// Keys that one task hands out to buckets.
const CHUNK: usize = 16_384;
/// Below this a comparison sort is faster than counting digits.
const FEW: usize = 1024;

/// Sorts keys that come in the order of their indices. The most significant digit first: chunks of the keys are handed
/// out to buckets; then each bucket is put together in the order of the chunks and sorted by the digits that are left,
/// the least significant first.
pub(crate) fn front_to_back(keys: &[Key]) -> Vec<Key> {
    let depths = || keys.iter().map(|key| key.depth());
    let (Some(least), Some(most)) = (depths().min(), depths().max()) else {
        return Vec::new();
    };
    let bits = u32::BITS - (most - least).leading_zeros();
    let shift = bits.saturating_sub(BUCKETS.trailing_zeros());
    let chunks: Vec<Vec<Vec<Key>>> = keys
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut buckets = vec![Vec::new(); BUCKETS];
            for &key in chunk {
                buckets[((key.depth() - least) >> shift) as usize].push(key);
            }
            buckets
        })
        .collect();
    let buckets: Vec<Vec<Key>> = (0..BUCKETS)
        .into_par_iter()
        .map(|bucket| {
            let parts: Vec<&[Key]> = chunks.iter().map(|chunk| chunk[bucket].as_slice()).collect();
            sort_bucket(parts.concat(), least, shift)
        })
        .collect();
    buckets.concat()
}

/// A stable sort by the lower `bits` of the depths above `least`.
fn sort_bucket(mut keys: Vec<Key>, least: u32, bits: u32) -> Vec<Key> {
    if keys.len() < FEW {
        keys.sort_unstable();
        return keys;
    }
    let mut spare = vec![Key::default(); keys.len()];
    for pass in 0..bits.div_ceil(DIGIT_BITS) {
        let digit = |key: Key| ((key.depth() - least) >> (pass * DIGIT_BITS)) as usize & (DIGITS - 1);
        let mut starts = [0u32; DIGITS];
        for &key in &keys {
            starts[digit(key)] += 1;
        }
        let mut total = 0;
        for start in &mut starts {
            let count = *start;
            *start = total;
            total += count;
        }
        for &key in &keys {
            let place = &mut starts[digit(key)];
            spare[*place as usize] = key;
            *place += 1;
        }
        std::mem::swap(&mut keys, &mut spare);
    }
    keys
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sorted(depths: &[f32]) -> Vec<u32> {
        let keys: Vec<Key> = depths.iter().enumerate().map(|(i, &d)| Key::new(d, i as u32)).collect();
        front_to_back(&keys).into_iter().map(Key::id).collect()
    }

    #[test]
    fn many_keys_agree_with_the_standard_sort_however_they_lie() {
        let spread: [fn(u32) -> f32; 4] = [
            |i| (i % 977) as f32 - 400.0,
            |i| 2.0 + (i % 4099) as f32 * 1e-6,
            |i| {
                if i % 1000 == 0 {
                    1e30
                } else {
                    1.0 + (i % 8191) as f32 * 1e-3
                }
            },
            |i| i.wrapping_mul(2_654_435_761) as f32,
        ];
        for depth in spread {
            let depths: Vec<f32> = (0..100_000).map(depth).collect();
            let mut expected: Vec<u32> = (0..100_000).collect();
            expected.sort_by(|&a, &b| depths[a as usize].total_cmp(&depths[b as usize]));
            assert!(sorted(&depths) == expected);
        }
    }

    proptest! {
        #[test]
        fn agrees_with_the_standard_stable_sort(depths in prop::collection::vec(
            prop_oneof![-1e30f32..1e30, -1f32..1.0, Just(0.0), Just(-0.0), Just(2.0)], 0..300)) {
            let mut expected: Vec<u32> = (0..depths.len() as u32).collect();
            expected.sort_by(|&a, &b| depths[a as usize].partial_cmp(&depths[b as usize]).unwrap());
            prop_assert_eq!(sorted(&depths), expected);
        }
    }

    #[test]
    fn a_million_equal_depths_keep_scene_order() {
        let all: Vec<u32> = (0..1_000_000).collect();
        assert_eq!(sorted(&vec![1.5; 1_000_000]), all);
    }
}
