//! Counter-based random numbers: a hash of a seed and a counter, so that no order of evaluation matters.

/// 64 well-mixed bits of a seed and two counters (SplitMix64's finaliser, Steele et al. 2014).
pub fn bits(seed: u64, a: u64, b: u64) -> u64 {
    let mut z = seed
        .wrapping_add(a.wrapping_mul(0x9E37_79B9_7F4A_7C15))
        .wrapping_add(b.wrapping_mul(0xD1B5_4A32_D192_ED03))
        .wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// A whole number in `0..n`; 0 when `n` is 0.
pub fn below(bits: u64, n: usize) -> usize {
    (((bits >> 32) * n as u64) >> 32) as usize
}

/// The numbers `0..n` in a random order that depends on the seed and the stream alone.
pub fn shuffled(seed: u64, stream: u64, n: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..n).collect();
    for i in (1..n).rev() {
        order.swap(i, below(bits(seed, stream, i as u64), i + 1));
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_is_a_permutation_that_the_seed_decides() {
        let order = shuffled(7, 0, 50);
        assert_eq!(order, shuffled(7, 0, 50));
        assert_ne!(order, shuffled(8, 0, 50));
        assert_ne!(order, shuffled(7, 1, 50));
        let mut sorted = order;
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..50));
    }

    #[test]
    fn every_number_below_n_comes_up_about_equally_often() {
        let mut counts = [0usize; 7];
        for i in 0..70_000 {
            counts[below(bits(1, 2, i), 7)] += 1;
        }
        // Ten standard deviations of a binomial with p = 1/7.
        assert!(counts.iter().all(|c| c.abs_diff(10_000) < 930), "{counts:?}");
    }
}
