//! The functions over slices: plain loops, compiled once per SIMD level. Bits do not depend on the level.

use multiversion::multiversion;

macro_rules! in_place {
    ($($(#[$doc:meta])* $name:ident = $f:path;)*) => {$(
        $(#[$doc])*
        #[multiversion(targets = "simd")]
        pub fn $name(xs: &mut [f32]) {
            for x in xs {
                *x = $f(*x);
            }
        }
    )*};
}

in_place! {
    /// Replaces every value by its exponential.
    exp_slice = super::exp;
    /// Replaces every value by its natural logarithm.
    ln_slice = super::ln;
    /// Replaces every value by its cube root.
    cbrt_slice = super::cbrt;
    /// Replaces every value by 1/(1 + e⁻ˣ).
    logistic_slice = super::logistic;
}

/// Replaces every value x by x^y.
#[multiversion(targets = "simd")]
pub fn pow_slice(xs: &mut [f32], y: f32) {
    for x in xs {
        *x = super::pow(*x, y);
    }
}

/// Replaces every value by `f` of it, over threads; `f` sees chunks, so that it can call the slice functions.
pub fn map_slice(xs: &mut [f32], f: impl Fn(&mut [f32]) + Sync + Send) {
    use rayon::prelude::*;
    xs.par_chunks_mut(1 << 14).for_each(f);
}
