//! Counter-based random numbers and noise: the same bits whatever the order or the thread.

/// A hash of a seed and three counters (the finaliser of SplitMix64, applied once a counter).
pub fn hash(seed: u64, x: i64, y: i64, z: i64) -> u64 {
    let mut state = seed ^ 0x9e37_79b9_7f4a_7c15;
    for counter in [x, y, z] {
        state = mix(state.wrapping_add(0x9e37_79b9_7f4a_7c15) ^ (counter as u64).wrapping_mul(0xd6e8_feb8_6659_fd93));
    }
    state
}

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Uniform in [0, 1).
pub fn uniform(seed: u64, x: i64, y: i64) -> f64 {
    (hash(seed, x, y, 0) >> 11) as f64 / (1u64 << 53) as f64
}

/// Smooth value noise on the unit lattice, in [−1, 1].
pub fn noise(seed: u64, x: f64, y: f64) -> f64 {
    let (x0, y0) = (x.floor(), y.floor());
    let (i, j) = (x0 as i64, y0 as i64);
    let (u, v) = (fade(x - x0), fade(y - y0));
    let at = |di, dj| 2.0 * uniform(seed, i + di, j + dj) - 1.0;
    let top = at(0, 0) + u * (at(1, 0) - at(0, 0));
    let bottom = at(0, 1) + u * (at(1, 1) - at(0, 1));
    top + v * (bottom - top)
}

/// `octaves` of [`noise`], each twice as fine and half as strong, in about [−1, 1].
pub fn fractal(seed: u64, x: f64, y: f64, octaves: u32) -> f64 {
    let (mut sum, mut norm, mut scale, mut gain) = (0.0, 0.0, 1.0, 1.0);
    for octave in 0..octaves {
        sum += gain * noise(seed.wrapping_add(u64::from(octave) * 7919), x * scale, y * scale);
        norm += gain;
        scale *= 2.0;
        gain *= 0.5;
    }
    sum / norm
}

fn fade(t: f64) -> f64 {
    t * t * t * (t * (6.0 * t - 15.0) + 10.0)
}

/// 0 below `from`, 1 above `to`, a cubic between; `from > to` turns it round.
pub fn smoothstep(from: f64, to: f64, x: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_stays_in_its_range_and_repeats() {
        for i in 0..2000 {
            let (x, y) = (i as f64 * 0.37 - 300.0, i as f64 * 0.11);
            let value = fractal(3, x, y, 4);
            assert!(value.abs() <= 1.0);
            assert_eq!(value.to_bits(), fractal(3, x, y, 4).to_bits());
        }
        assert_ne!(noise(1, 0.5, 0.5), noise(2, 0.5, 0.5));
    }

    #[test]
    fn uniform_fills_the_unit_interval() {
        let mean = (0..4000).map(|i| uniform(9, i, -i)).sum::<f64>() / 4000.0;
        assert!((mean - 0.5).abs() < 0.02, "{mean}");
    }
}
