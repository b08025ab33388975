//! Counter-based random numbers: a hash of seed and counter, so that no order of evaluation matters.

/// 64 well-mixed bits (SplitMix64's finaliser) of a seed and two counters.
pub(crate) fn bits(seed: u64, a: u64, b: u64) -> u64 {
    let mut z = seed
        .wrapping_add(a.wrapping_mul(0x9E37_79B9_7F4A_7C15))
        .wrapping_add(b.wrapping_mul(0xD1B5_4A32_D192_ED03))
        .wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// An integer in 0..n.
pub(crate) fn below(bits: u64, n: usize) -> usize {
    (((bits >> 32) * n as u64) >> 32) as usize
}

/// A number in −1..1.
fn signed(bits: u64) -> f64 {
    (bits >> 11) as f64 * (2.0 / (1u64 << 53) as f64) - 1.0
}

/// A rotation matrix, uniform over all rotations: a unit quaternion by rejection from the 4-cube.
pub(crate) fn rotation(seed: u64, index: u64) -> [[f64; 3]; 3] {
    let (mut q, mut square) = ([1.0, 0.0, 0.0, 0.0], 1.0);
    for attempt in 0..64 {
        let tried: [f64; 4] = std::array::from_fn(|k| signed(bits(seed, index, attempt * 4 + k as u64)));
        let length = tried.iter().fold(0.0, |s, v| s + v * v);
        if (1e-4..=1.0).contains(&length) {
            (q, square) = (tried, length);
            break;
        }
    }
    let [w, x, y, z] = q.map(|v| v / f64::sqrt(square));
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_are_orthonormal_and_differ() {
        for index in 0..50 {
            let r = rotation(3, index);
            for i in 0..3 {
                for j in 0..3 {
                    let dot = (0..3).fold(0.0, |s, k| s + r[k][i] * r[k][j]);
                    assert!((dot - f64::from(u8::from(i == j))).abs() < 1e-12);
                }
            }
            assert_ne!(r, rotation(3, index + 1));
        }
    }

    #[test]
    fn integers_fill_their_range() {
        let mut seen = [0; 7];
        for i in 0..7000 {
            seen[below(bits(1, i, 2), 7)] += 1;
        }
        assert!(seen.iter().all(|n| (850..1150).contains(n)), "{seen:?}");
    }
}
