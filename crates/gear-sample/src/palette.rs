//! The pigments of the classical East Asian palette, as linear reflectances.

use std::sync::LazyLock;

use crate::stage::Colour;

/// Linear light from an sRGB code of eight bits a channel.
pub const fn code(rgb: u32) -> [u8; 3] {
    [(rgb >> 16) as u8, (rgb >> 8) as u8, rgb as u8]
}

/// The sRGB transfer function.
pub fn linear(rgb: [u8; 3]) -> Colour {
    rgb.map(|c| decode(f64::from(c) / 255.0))
}

/// sRGB-encoded to linear light.
pub fn decode(c: f64) -> f64 {
    if c <= 0.04045 {
        c / 12.92
    } else {
        libm::pow((c + 0.055) / 1.055, 2.4)
    }
}

/// Linear light to sRGB-encoded.
pub fn encode(c: f64) -> f64 {
    if c <= 0.003_130_8 {
        12.92 * c.max(0.0)
    } else {
        1.055 * libm::pow(c, 1.0 / 2.4) - 0.055
    }
}

/// Pigments.
pub struct Palette {
    /// Mercury red.
    pub cinnabar: Colour,
    /// A deeper, browner red.
    pub lac: Colour,
    /// Copper green.
    pub malachite: Colour,
    /// A pale, whitened green.
    pub celadon: Colour,
    /// Copper blue.
    pub azurite: Colour,
    /// Nearly black blue.
    pub indigo: Colour,
    /// Gamboge and gold paint.
    pub gold: Colour,
    /// Lead white, aged.
    pub white: Colour,
    /// Powdered face.
    pub skin: Colour,
    /// Cheeks and lips.
    pub rouge: Colour,
    /// Pine soot.
    pub ink: Colour,
    /// Pale pink.
    pub peony: Colour,
    /// Earth yellow.
    pub ochre: Colour,
    /// Aged silk.
    pub silk: Colour,
}

impl Palette {
    /// The palette used throughout.
    pub fn court() -> &'static Self {
        static COURT: LazyLock<Palette> = LazyLock::new(Palette::mixed);
        &COURT
    }

    fn mixed() -> Self {
        let p = |rgb| linear(code(rgb));
        Self {
            cinnabar: p(0xb8402c),
            lac: p(0x7e2a28),
            malachite: p(0x4f8a6c),
            celadon: p(0xa9bfa0),
            azurite: p(0x2f5482),
            indigo: p(0x223048),
            gold: p(0xcfa24c),
            white: p(0xeee4d0),
            skin: p(0xf0d8bd),
            rouge: p(0xcf6d58),
            ink: p(0x1d1916),
            peony: p(0xe3a79b),
            ochre: p(0xb98b52),
            silk: p(0xc9b48a),
        }
    }
}

/// `a` to `b` by `t` in [0, 1].
pub fn mix(a: Colour, b: Colour, t: f64) -> Colour {
    std::array::from_fn(|k| a[k] + t * (b[k] - a[k]))
}

/// A colour times a number.
pub fn scale(a: Colour, t: f64) -> Colour {
    a.map(|c| c * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoding_undoes_decoding() {
        for i in 0..=255 {
            let c = f64::from(i) / 255.0;
            assert!((encode(decode(c)) - c).abs() < 1e-9);
        }
    }
}
