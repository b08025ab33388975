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
/// Keys that one task hands out to buckets, at most: with fewer keys there are eight tasks.
const CHUNK: usize = 16_384;
/// Below this a comparison sort is faster than counting digits.
const FEW: usize = 1024;

/// The indices of keys in the order of their depths. The keys come in parts, in the order of their indices. The most
/// significant digit first: runs of parts are handed out to buckets; then each bucket is put together in the order of the
/// runs and sorted by the digits that are left, the least significant first.
pub(crate) fn front_to_back(parts: &[&[Key]]) -> Vec<u32> {
    let extremes = |part: &&[Key]| {
        let depths = || part.iter().map(|key| key.depth());
        Some((depths().min()?, depths().max()?))
    };
    let ends = parts.par_iter().with_min_len(8).filter_map(extremes);
    let Some((least, most)) = ends.reduce_with(|a, b| (a.0.min(b.0), a.1.max(b.1))) else {
        return Vec::new();
    };
    let bits = u32::BITS - (most - least).leading_zeros();
    let shift = bits.saturating_sub(BUCKETS.trailing_zeros());
    let total: usize = parts.iter().map(|part| part.len()).sum();
    let share = total.div_ceil(8).min(CHUNK);
    let chunks: Vec<Vec<Vec<Key>>> = runs(parts, share)
        .into_par_iter()
        .map(|run| {
            let mut buckets = vec![Vec::new(); BUCKETS];
            for &key in run.iter().copied().flatten() {
                buckets[((key.depth() - least) >> shift) as usize].push(key);
            }
            buckets
        })
        .collect();
    let mut ids = vec![0; total];
    let mut rest = ids.as_mut_slice();
    let mut places = Vec::with_capacity(BUCKETS);
    for bucket in 0..BUCKETS {
        let here = chunks.iter().map(|chunk| chunk[bucket].len()).sum();
        let (place, after) = rest.split_at_mut(here);
        places.push(place);
        rest = after;
    }
    places.into_par_iter().enumerate().for_each(|(bucket, place)| {
        let parts: Vec<&[Key]> = chunks.iter().map(|chunk| chunk[bucket].as_slice()).collect();
        let keys = sort_bucket(parts.concat(), least, shift);
        place.iter_mut().zip(keys).for_each(|(id, key)| *id = key.id());
    });
    ids
}

/// Runs of parts with about `share` keys each.
fn runs<'a, 'k>(parts: &'a [&'k [Key]], share: usize) -> Vec<&'a [&'k [Key]]> {
    let mut runs = Vec::new();
    let (mut first, mut keys) = (0, 0);
    for (i, part) in parts.iter().enumerate() {
        keys += part.len();
        if keys >= share {
            runs.push(&parts[first..=i]);
            (first, keys) = (i + 1, 0);
        }
    }
    runs.push(&parts[first..]);
    runs
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
        // Parts of several lengths, empty ones among them.
        let (first, rest) = keys.split_at(keys.len() / 3);
        let mut parts = vec![first, &[]];
        parts.extend(rest.chunks(1000));
        front_to_back(&parts)
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
