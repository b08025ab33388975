//! The whole chain from a picture and its mask to a height field.

use gear_image::{Field, LinearImage, Mask};

use crate::base::{self, BaseSettings};
use crate::crease::{self, CreaseSettings};
use crate::detail::{self, DetailSettings};
use crate::fields::{map, zip};
use crate::ink::{self, InkSettings};
use crate::layers::{self, LayerSettings};
use crate::light::{self, Calibration, LightFit};
use crate::shading::{self, ShadingSettings};

/// Settings of every step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeightSettings {
    /// Lines.
    pub ink: InkSettings,
    /// Body.
    pub base: BaseSettings,
    /// Lines that draw form.
    pub crease: CreaseSettings,
    /// Contours of a whole canvas, where one thing stands before another.
    pub layers: LayerSettings,
    /// Split of shading and paint.
    pub shading: ShadingSettings,
    /// What shading is believed.
    pub calibration: Calibration,
    /// Detail.
    pub detail: DetailSettings,
}

impl Default for HeightSettings {
    fn default() -> Self {
        Self {
            ink: InkSettings::default(),
            base: BaseSettings::default(),
            crease: CreaseSettings::default(),
            layers: LayerSettings::default(),
            shading: ShadingSettings::default(),
            calibration: Calibration::NATURAL,
            detail: DetailSettings::default(),
        }
    }
}

/// What kind of surface was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// A body inflated from a silhouette.
    Figure,
    /// A relief over the whole canvas.
    Relief,
}

/// A height field and how it came about. Rasters have the picture's size.
#[derive(Clone, Debug)]
pub struct Relief {
    /// Height in pixels towards the viewer, at least 0; 0 outside the mask.
    pub height: Field,
    /// The base alone, in pixels.
    pub base: Field,
    /// The mask the surface lives on: the one given, or the whole canvas for an empty one.
    pub mask: Mask,
    /// Figure or relief.
    pub mode: Mode,
    /// Slope of a relief's ground, height per pixel downwards; 0 for a figure.
    pub tilt: f32,
    /// The light fit; `None` when shading was not looked at.
    pub light: Option<LightFit>,
    /// Robust deviation of brushwork, log luminance; 0 when shading was not looked at.
    pub noise: f32,
    /// Whether detail from shading was solved for.
    pub detailed: bool,
}

/// Estimates the height of what `image` shows inside `mask`. A full or an empty mask means the whole canvas as a
/// relief. Without iterations of detail the shading is not looked at.
pub fn estimate(image: &LinearImage, mask: &Mask, settings: &HeightSettings) -> Relief {
    let (width, height) = image.size();
    let mode = if mask.is_full() || mask.count() == 0 {
        Mode::Relief
    } else {
        Mode::Figure
    };
    let mask = match mode {
        Mode::Relief => Mask::filled(width, height, true),
        Mode::Figure => mask.clone(),
    };
    let ink = ink::ink_lines(image, &mask, &settings.ink);
    let base = base::body(image, &mask, &settings.base.round());
    let mut relief = Relief {
        height: base.clone(),
        base,
        mask,
        mode,
        tilt: if mode == Mode::Relief { settings.base.ramp } else { 0.0 },
        light: None,
        noise: 0.0,
        detailed: false,
    };
    let detail = relief.shade(image, &ink, settings);
    if mode == Mode::Figure {
        // Detail is as deep as it looks, whatever depth the body is given.
        relief.base = map(&relief.base, |b| settings.base.inflate * b);
        relief.height = relief.base.clone();
    }
    relief.raise(detail.as_ref());
    // Lines of a whole canvas bound things that lie before others as often as they lie in hollows: no creases there.
    if mode == Mode::Relief {
        relief.raise(layers::layers(image, &settings.layers).as_ref());
    }
    if mode == Mode::Figure && settings.crease.depth > 0.0 {
        let drawn = ink::drawn_lines(image, &ink, &relief.mask, &settings.ink);
        relief.raise(crease::creases(&drawn, &relief.mask, &settings.crease).as_ref());
    }
    relief
}

impl Relief {
    /// Looks at the shading of `image` on the base: the detail that it shows, in pixels. `None` without iterations, or
    /// when there is nothing to tell.
    pub(crate) fn shade(&mut self, image: &LinearImage, ink: &Field, settings: &HeightSettings) -> Option<Field> {
        if settings.detail.iterations == 0 || self.mask.is_empty() {
            return None;
        }
        let shading = shading::shading(image, &self.mask, ink, &settings.shading);
        let fit = light::fit(&shading, &self.base, &self.mask, &settings.calibration);
        let (base, mask, calibration) = (&self.base, &self.mask, &settings.calibration);
        let detail = detail::detail(&shading, base, ink, mask, &fit, calibration, &settings.detail);
        self.detailed = detail.is_some();
        self.light = Some(fit);
        self.noise = shading.noise;
        detail
    }

    /// Adds to the height, which stays at least 0.
    pub(crate) fn raise(&mut self, by: Option<&Field>) {
        if let Some(by) = by {
            self.height = zip(&self.height, by, |h, d| (h + d).max(0.0));
        }
    }
}
