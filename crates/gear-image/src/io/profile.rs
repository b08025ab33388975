//! ICC profiles to sRGB, by moxcms at 16 bits.
//!
//! The crate is built without its SIMD paths, so that the bits are the same on every CPU.

use std::sync::Arc;

use moxcms::{ColorProfile, DataColorSpace, Layout, Transform16BitExecutor, TransformOptions};

use super::Problem;

/// A conversion of encoded rows to sRGB.
pub(super) struct Profile {
    transform: Arc<Transform16BitExecutor>,
    grey: bool,
    source: Vec<u16>,
    target: Vec<u16>,
}

/// What moves by less than this is sRGB itself, stored with rounding: 2 of 65535 would be exact, 257 is one
/// 8-bit code.
const SAME: u16 = 257;

impl Profile {
    /// The conversion, or none when the profile is sRGB within one 8-bit code over the whole cube.
    pub fn parse(bytes: &[u8], grey_samples: bool) -> Result<Option<Self>, Problem> {
        let error = |cause: String| Problem::Profile { cause };
        let profile = ColorProfile::new_from_slice(bytes).map_err(|e| error(format!("{e:?}")))?;
        let grey = match profile.color_space {
            DataColorSpace::Rgb => false,
            DataColorSpace::Gray => true,
            DataColorSpace::Cmyk => return Err(Problem::Cmyk),
            other => return Err(error(format!("it describes {other:?} colours, expected RGB or grey"))),
        };
        if grey && !grey_samples {
            return Err(error("it describes grey, but the picture has colours".into()));
        }
        let layout = if grey { Layout::Gray } else { Layout::Rgb };
        let transform = profile
            .create_transform_16bit(
                layout,
                &ColorProfile::new_srgb(),
                Layout::Rgb,
                TransformOptions::default(),
            )
            .map_err(|e| error(format!("{e:?}")))?;
        let mut profile = Self {
            transform,
            grey,
            source: Vec::new(),
            target: Vec::new(),
        };
        Ok(if profile.is_identity() { None } else { Some(profile) })
    }

    fn is_identity(&mut self) -> bool {
        const STEPS: usize = 9;
        let code = |i: usize| (i * 65535 / (STEPS - 1)) as u16;
        let cube: Vec<[u16; 3]> = (0..STEPS * STEPS * STEPS)
            .map(|i| [code(i % STEPS), code(i / STEPS % STEPS), code(i / (STEPS * STEPS))])
            .filter(|c| !self.grey || (c[0] == c[1] && c[1] == c[2]))
            .collect();
        let source: Vec<u16> = match self.grey {
            true => cube.iter().map(|c| c[0]).collect(),
            false => cube.as_flattened().to_vec(),
        };
        let mut target = vec![0; cube.len() * 3];
        self.transform.transform(&source, &mut target).is_ok()
            && cube
                .as_flattened()
                .iter()
                .zip(&target)
                .all(|(a, b)| a.abs_diff(*b) <= SAME)
    }

    /// Converts a row of encoded r g b samples in place.
    pub fn apply(&mut self, rgb: &mut [f32]) {
        let code = |x: f32| (x.clamp(0.0, 1.0) * 65535.0 + 0.5) as u16;
        self.source.clear();
        match self.grey {
            true => self.source.extend(rgb.chunks_exact(3).map(|p| code(p[0]))),
            false => self.source.extend(rgb.iter().map(|&x| code(x))),
        }
        self.target.resize(rgb.len(), 0);
        // Both slices have the lengths that the layouts ask for, the only thing that can be wrong here.
        if self.transform.transform(&self.source, &mut self.target).is_ok() {
            for (x, &code) in rgb.iter_mut().zip(&self.target) {
                *x = f32::from(code) / 65535.0;
            }
        }
    }
}
