//! Bringing lit colours into [0, 1].

use gear_graph::Choice;
use gear_image::math;

/// How colours are brought into [0, 1].
#[derive(Clone, Debug, PartialEq, Choice)]
pub enum Gamut {
    /// A shoulder above the knee that keeps the ratios of the channels, hence the hue: white becomes .967.
    Soft {
        /// Largest channel, in linear light, that is left as it is.
        #[param(default = 0.8, range = 0.0..=0.99)]
        knee: f64,
    },
    /// Each channel is cut at 1.
    Clip,
    /// Nothing is cut: HDR and negative values are kept.
    None,
}

/// m' = knee + (1 − knee)(1 − exp(−(m − knee)/(1 − knee))) for m above the knee; as the factor m'/m on all channels.
/// Continuous in its first derivative, monotone, below 1.
#[inline(always)]
pub(crate) fn shoulder(rgb: [f32; 3], knee: f32) -> [f32; 3] {
    let m = max3(rgb);
    let room = 1.0 - knee;
    let over = if m > knee { m - knee } else { 0.0 };
    let compressed = knee + room * (1.0 - math::exp(-over / room));
    let factor = if m > knee { compressed / m } else { 1.0 };
    [rgb[0] * factor, rgb[1] * factor, rgb[2] * factor]
}

/// The largest s in [0, 1] for which base + s·detail stays in [0, 1] in all channels; base lies there.
#[inline(always)]
pub(crate) fn limiter(base: [f32; 3], detail: [f32; 3]) -> f32 {
    let room = |b: f32, d: f32| {
        let space = if d > 0.0 { 1.0 - b } else { b };
        let d = d.abs();
        space / if d > 1e-30 { d } else { 1e-30 }
    };
    let s = [
        room(base[0], detail[0]),
        room(base[1], detail[1]),
        room(base[2], detail[2]),
    ];
    let least = if s[0] < s[1] { s[0] } else { s[1] };
    let least = if least < s[2] { least } else { s[2] };
    if least < 1.0 { least } else { 1.0 }
}

#[inline(always)]
fn max3(rgb: [f32; 3]) -> f32 {
    let m = if rgb[0] > rgb[1] { rgb[0] } else { rgb[1] };
    if m > rgb[2] { m } else { rgb[2] }
}

#[inline(always)]
pub(crate) fn unit(x: f32) -> f32 {
    let x = if x > 0.0 { x } else { 0.0 };
    if x < 1.0 { x } else { 1.0 }
}
