//! Stage 2: front to back. A stable radix sort of depths; ties keep scene order.

/// Maps an f32 to a u32 of the same order: negatives are flipped whole, the others get the sign bit.
fn ordered(x: f32) -> u32 {
    let bits = (x + 0.0).to_bits(); // −0 becomes +0
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

const DIGIT_BITS: u32 = 11;
const DIGITS: usize = 1 << DIGIT_BITS;

/// The given indices, ordered by `depths[index]`, smallest first; equal depths keep their order. Least significant
/// digit first, three passes of 11 bits; a pass in which all keys share their digit is skipped.
pub(crate) fn front_to_back(indices: Vec<u32>, depths: &[f32]) -> Vec<u32> {
    let mut items: Vec<(u32, u32)> = indices.into_iter().map(|i| (ordered(depths[i as usize]), i)).collect();
    let mut spare = vec![(0, 0); items.len()];
    for pass in 0..32_u32.div_ceil(DIGIT_BITS) {
        let digit = |key: u32| (key >> (pass * DIGIT_BITS)) as usize & (DIGITS - 1);
        let mut starts = [0usize; DIGITS];
        for &(key, _) in &items {
            starts[digit(key)] += 1;
        }
        if starts.contains(&items.len()) {
            continue;
        }
        let mut total = 0;
        for start in &mut starts {
            let count = *start;
            *start = total;
            total += count;
        }
        for &item in &items {
            let place = &mut starts[digit(item.0)];
            spare[*place] = item;
            *place += 1;
        }
        std::mem::swap(&mut items, &mut spare);
    }
    items.into_iter().map(|(_, i)| i).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn agrees_with_the_standard_stable_sort(depths in prop::collection::vec(
            prop_oneof![-1e30f32..1e30, -1f32..1.0, Just(0.0), Just(-0.0), Just(2.0)], 0..300)) {
            let all: Vec<u32> = (0..depths.len() as u32).collect();
            let mut expected = all.clone();
            expected.sort_by(|&a, &b| depths[a as usize].partial_cmp(&depths[b as usize]).unwrap());
            prop_assert_eq!(front_to_back(all, &depths), expected);
        }
    }

    #[test]
    fn a_hundred_thousand_equal_depths_keep_scene_order() {
        let depths = vec![1.5; 100_000];
        let all: Vec<u32> = (0..100_000).collect();
        assert_eq!(front_to_back(all.clone(), &depths), all);
    }
}
