//! Which vector instructions the hot loops are compiled for.
//!
//! Every kernel is plain Rust over fixed arrays of lanes, compiled once for each level by the crate `multiversion`. The
//! arithmetic is the same at every level: no fused multiply-add, sums of a fixed shape, and nothing depends on the width
//! of a register. So the bits are the same too, and a level only changes the time.

use std::sync::OnceLock;

/// A set of vector instructions. On AArch64 the baseline has NEON.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SimdLevel {
    /// What every CPU of the architecture has.
    Baseline,
    /// x86-64 with AVX2.
    Avx2,
    /// x86-64 with AVX-512 as Ice Lake and Zen 4 have it.
    Avx512,
}

impl SimdLevel {
    /// The level in use: the best that this CPU has, or what the variable `GEAR_SIMD` says (`avx512`, `avx2` or
    /// `baseline`). An unknown value, and a level that this CPU lacks, are told of once and not used.
    pub fn current() -> Self {
        static CURRENT: OnceLock<SimdLevel> = OnceLock::new();
        *CURRENT.get_or_init(|| {
            let best = Self::best();
            match std::env::var("GEAR_SIMD") {
                Err(_) => best,
                Ok(text) => Self::choose(&text, best).unwrap_or_else(|problem| {
                    tracing::warn!("{problem}");
                    best
                }),
            }
        })
    }

    /// The best level of this CPU.
    pub fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::is_x86_feature_detected as has;
            let avx512 = has!("avx512f") && has!("avx512vl") && has!("avx512bw") && has!("avx512dq");
            if avx512 && has!("avx512vbmi2") {
                return Self::Avx512;
            }
            if has!("avx2") {
                return Self::Avx2;
            }
        }
        Self::Baseline
    }

    /// All levels that this CPU has.
    pub fn available() -> impl Iterator<Item = Self> {
        let all = [Self::Baseline, Self::Avx2, Self::Avx512];
        all.into_iter().filter(|&level| level <= Self::best())
    }

    fn choose(text: &str, best: Self) -> Result<Self, String> {
        let wanted = match text.trim().to_ascii_lowercase().as_str() {
            "" => return Ok(best),
            "baseline" => Self::Baseline,
            "avx2" => Self::Avx2,
            "avx512" => Self::Avx512,
            _ => return Err(format!("GEAR_SIMD is `{text}`; expected avx512, avx2 or baseline")),
        };
        if wanted > best {
            return Err(format!("GEAR_SIMD is `{text}`, which this CPU lacks; {best:?} is used"));
        }
        Ok(wanted)
    }
}

/// Defines functions whose body is compiled for each [`SimdLevel`]; the first argument of a call is the level. What the
/// body calls must be `#[inline(always)]`, or it is compiled for the baseline only.
macro_rules! simd_kernels {
    ($($(#[$meta:meta])* fn $name:ident($($arg:ident: $type:ty),* $(,)?) $body:block)*) => {
        $($(#[$meta])*
        fn $name(level: $crate::cpu::simd::SimdLevel, $($arg: $type),*) {
            #[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq+avx512vbmi2+avx2"))]
            fn avx512($($arg: $type),*) $body
            #[multiversion::multiversion(targets("x86_64+avx2"))]
            fn avx2($($arg: $type),*) $body
            fn baseline($($arg: $type),*) $body
            match level {
                $crate::cpu::simd::SimdLevel::Avx512 => avx512($($arg),*),
                $crate::cpu::simd::SimdLevel::Avx2 => avx2($($arg),*),
                $crate::cpu::simd::SimdLevel::Baseline => baseline($($arg),*),
            }
        })*
    };
}
pub(crate) use simd_kernels;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_and_missing_levels_are_told_of() {
        assert_eq!(SimdLevel::choose(" AVX2 ", SimdLevel::Avx512), Ok(SimdLevel::Avx2));
        assert_eq!(SimdLevel::choose("", SimdLevel::Avx2), Ok(SimdLevel::Avx2));
        let unknown = SimdLevel::choose("sse9", SimdLevel::Avx2).unwrap_err();
        assert!(unknown.contains("sse9") && unknown.contains("expected avx512, avx2 or baseline"));
        assert!(
            SimdLevel::choose("avx512", SimdLevel::Baseline)
                .unwrap_err()
                .contains("lacks")
        );
    }
}
