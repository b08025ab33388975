//! Height from outside: what a network says of depth or of normals, on the terms of the silhouette's body.
//!
//! *Depth* comes in a scale that is not known. Nearness (disparity, relative depth) is fixed by the body: its spread
//! inside the mask becomes the body's, or a given share of the picture. Distance in one unit is fixed by the angle
//! under which the picture is seen: at the median distance z the longer side spans `2 z tan(fov/2)`. Either way the
//! farthest of the figure (2 % quantile) becomes height 0, so that the surface closes as the embedded one does.
//!
//! *Normals* become slopes, the target of the screened Poisson operator of the detail step, held to the depth head:
//!
//! ```text
//! (1/ℓ² − Δ) h = −div(p, q) + h_net/ℓ²,   p = −n_x/n_z, q = −n_y/n_z, clipped
//! ```
//!
//! with h_net moved so that its median is the body's. Detail from shading is then drawn on top, as ever.

use gear_image::solve::{Coefficients, GridSystem, SolveOptions};
use gear_image::{Field, LinearImage, Mask, stats};

use crate::base::{self, BaseSettings};
use crate::fields::{inside, map, masked, normals};
use crate::height::{HeightSettings, Mode, Relief};
use crate::ink;

/// What the silhouette says before a network is asked. Rasters have the picture's size.
#[derive(Clone, Debug)]
pub struct Foundation {
    /// The mask the surface lives on: the one given, or the whole canvas for an empty one.
    pub mask: Mask,
    /// Figure or relief.
    pub mode: Mode,
    /// Drawn lines.
    pub ink: Field,
    /// The body in pixels, 0 outside the mask. A relief's is not tilted: the network knows what is nearer.
    pub base: Field,
}

impl Foundation {
    /// Of a picture and its mask; a full or an empty mask means the whole canvas as a relief.
    pub fn of(image: &LinearImage, mask: &Mask, settings: &HeightSettings) -> Self {
        let (width, height) = image.size();
        let whole = mask.is_full() || mask.count() == 0;
        let mask = if whole {
            Mask::filled(width, height, true)
        } else {
            mask.clone()
        };
        let flat = BaseSettings {
            ramp: 0.0,
            ..settings.base.round()
        };
        let ink = ink::ink_lines(image, &mask, &settings.ink);
        let base = base::body(image, &mask, &flat);
        Self {
            mask,
            mode: if whole { Mode::Relief } else { Mode::Figure },
            ink,
            base,
        }
    }

    /// x and y of the body's unit normals (x right, y down); 0 off the mask.
    pub fn base_normals(&self) -> [Field; 2] {
        let (width, height) = self.mask.size();
        let normals = normals(&self.base);
        [0, 1].map(|c| {
            let plane = Field::from_vec(width, height, normals.iter().map(|n| n[c]).collect());
            masked(&plane, &self.mask)
        })
    }
}

/// What a network says. Fields have the picture's size; samples are finite.
#[derive(Clone, Copy, Debug)]
pub enum Guide<'a> {
    /// Larger is nearer; scale and offset are unknown.
    Nearness(&'a Field),
    /// Distance from a pinhole camera, in any one unit.
    Distance {
        /// The distance.
        depth: &'a Field,
        /// The angle under which the picture's longer side is seen.
        fov_radians: f32,
    },
    /// A surface.
    Surface {
        /// The unit normal: x right, y down, z to the viewer.
        normals: [&'a Field; 3],
        /// Height in pixels, up to an offset.
        height: &'a Field,
    },
}

/// ℓ, as a share of the longer side: .004 per px² at 256 px.
const HOLD: f32 = 0.0625;
/// Steepest slope that is believed.
const SLOPE: f32 = 4.0;

/// The height of what `image` shows, by the network's word and the shading; and whether the network's word could be
/// used: one that says the same everywhere cannot, and the silhouette's body stands in for it.
///
/// `extent` is the height of the surface as a share of the longer side (2 % to 98 % quantile); without it the body or
/// the camera tell.
pub fn estimate(
    image: &LinearImage,
    foundation: Foundation,
    guide: Guide<'_>,
    extent: Option<f32>,
    settings: &HeightSettings,
) -> (Relief, bool) {
    let inflate = if foundation.mode == Mode::Figure {
        settings.base.inflate
    } else {
        1.0
    };
    let body = body(&foundation, guide, extent, inflate);
    let used = body.is_some();
    let Foundation { mask, mode, ink, base } = foundation;
    let body = body.unwrap_or_else(|| map(&base, |b| inflate * b));
    let mut relief = Relief {
        height: body.clone(),
        base: body,
        mask,
        mode,
        tilt: 0.0,
        light: None,
        noise: 0.0,
        detailed: false,
    };
    let detail = relief.shade(image, &ink, settings);
    relief.raise(detail.as_ref());
    (relief, used)
}

/// The body that the network's word makes, in pixels, at least 0, 0 outside the mask.
fn body(foundation: &Foundation, guide: Guide<'_>, extent: Option<f32>, inflate: f32) -> Option<Field> {
    let side = foundation.mask.longer_side() as f32;
    let height = match guide {
        Guide::Nearness(field) => nearness(foundation, field, extent.map(|share| share * side), inflate)?,
        Guide::Distance { depth, fov_radians } => {
            let near = map(depth, |z| -z);
            match extent {
                Some(share) => nearness(foundation, &near, Some(share * side), inflate)?,
                None => {
                    let middle = stats::median(&inside(depth, &foundation.mask))?;
                    let spans = 2.0 * middle * libm::tan(f64::from(fov_radians) / 2.0) as f32;
                    let scale = side / spans;
                    if !(scale.is_finite() && scale > 0.0) {
                        return None;
                    }
                    above_lowest(&map(&near, |z| scale * z), &foundation.mask, 2.0 * side)?
                }
            }
        }
        Guide::Surface { normals, height } => surface(foundation, normals, height, extent.map(|share| share * side))?,
    };
    let sound = height.data().iter().all(|h| h.is_finite());
    sound.then(|| masked(&height, &foundation.mask))
}

/// Nearness with the spread of the body, or so many pixels from the 2 % to the 98 % quantile.
fn nearness(foundation: &Foundation, near: &Field, pixels: Option<f32>, inflate: f32) -> Option<Field> {
    let mask = &foundation.mask;
    let (own, body) = (inside(near, mask), inside(&foundation.base, mask));
    let spread =
        |values: &[f32], share: f64| Some(stats::quantile(values, 1.0 - share)? - stats::quantile(values, share)?);
    let scale = match pixels {
        Some(pixels) => pixels / spread(&own, 0.02)?,
        None => inflate * spread(&body, 0.1)? / spread(&own, 0.1)?,
    };
    let largest = own.iter().fold(0.0f32, |most, x| most.max(x.abs()));
    // Differences that rounding makes are none.
    if !scale.is_finite() || spread(&own, 0.02)? <= 1e-5 * largest {
        return None;
    }
    above_lowest(&map(near, |v| scale * v), mask, 4.0 * mask.longer_side() as f32)
}

/// The field less its 2 % quantile inside the mask, at least 0 and at most `most`.
fn above_lowest(field: &Field, mask: &Mask, most: f32) -> Option<Field> {
    let lowest = stats::quantile(&inside(field, mask), 0.02)?;
    Some(map(field, |h| (h - lowest).clamp(0.0, most)))
}

/// The surface whose slopes are those of the normals, held to the network's height.
fn surface(foundation: &Foundation, normals: [&Field; 3], height: &Field, pixels: Option<f32>) -> Option<Field> {
    let mask = &foundation.mask;
    let (width, rows) = mask.size();
    let slope = |axis: usize| {
        let plane = normals[axis].data().iter().zip(normals[2].data());
        let slopes = plane.map(|(n, nz)| (-n / nz.max(1e-3)).clamp(-SLOPE, SLOPE)).collect();
        Field::from_vec(width, rows, slopes)
    };
    let (p, q) = (slope(0), slope(1));
    let middle = |field: &Field| stats::median(&inside(field, mask));
    let offset = middle(&foundation.base)? - middle(height)?;
    let length = HOLD * mask.longer_side() as f32;
    let hold = 1.0 / (length * length);
    let system = GridSystem::new(
        mask,
        &Coefficients {
            screening: hold,
            ..Default::default()
        },
    );
    let mut rhs = system.divergence_of_pixels(&p, &q);
    for (rhs, h) in rhs.iter_mut().zip(height.data()) {
        *rhs += f64::from(hold) * f64::from(h + offset);
    }
    let solved = system.solve(&rhs, None, SolveOptions::default()).to_field(width, rows);
    if let Some(pixels) = pixels {
        return nearness(foundation, &solved, Some(pixels), 1.0);
    }
    Some(map(&solved, |h| h.max(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fields::zip;
    use gear_image::Rgb;

    const SIDE: usize = 96;

    fn scene() -> (LinearImage, Mask, Field) {
        let height = Field::from_fn(SIDE, SIDE, |x, y| {
            let (u, v) = (x as f32 - 47.5, y as f32 - 47.5);
            (36.0 * 36.0 - u * u - v * v).max(0.0).sqrt()
        });
        let mask = Mask::from_fn(SIDE, SIDE, |x, y| height.at(x, y) > 0.0);
        (Rgb::filled(SIDE, SIDE, [0.5; 3]), mask, height)
    }

    fn guided(guide: Guide<'_>, extent: Option<f32>) -> (Relief, bool) {
        let (image, mask, _) = scene();
        let mut settings = HeightSettings::default();
        settings.detail.iterations = 0;
        settings.base = settings.base.round();
        estimate(
            &image,
            Foundation::of(&image, &mask, &settings),
            guide,
            extent,
            &settings,
        )
    }

    /// RMS of the difference inside the mask, each freed of its mean, in pixels.
    fn off(a: &Field, b: &Field, mask: &Mask) -> f64 {
        let d = inside(&zip(a, b, |a, b| a - b), mask);
        stats::mean_and_deviation(&d).1
    }

    #[test]
    fn nearness_in_any_scale_becomes_the_body_it_describes() {
        let (_, mask, truth) = scene();
        for (scale, offset) in [(1.0, 0.0), (1e-3, 5.0), (400.0, -3.0)] {
            let near = map(&truth, |h| scale * h + offset);
            let (relief, used) = guided(Guide::Nearness(&near), None);
            assert!(used && off(&relief.height, &truth, &mask) < 1.5, "{scale}");
            let (relief, _) = guided(Guide::Nearness(&near), Some(0.5));
            let values = inside(&relief.height, &mask);
            let top = stats::quantile(&values, 0.98).unwrap();
            assert!((top - 48.0).abs() < 1.0, "{top}");
        }
    }

    #[test]
    fn a_distance_needs_no_scale_and_no_unit() {
        let (_, mask, truth) = scene();
        let fov_radians = 0.8f32;
        let focal = SIDE as f32 / 2.0 / libm::tan(f64::from(fov_radians) / 2.0) as f32;
        for unit in [1.0, 0.01, 1000.0] {
            // The camera is `focal` pixels from the plane of the median height.
            let middle = stats::median(&inside(&truth, &mask)).unwrap();
            let depth = map(&truth, |h| unit * (focal + middle - h));
            let (relief, used) = guided(
                Guide::Distance {
                    depth: &depth,
                    fov_radians,
                },
                None,
            );
            assert!(used && off(&relief.height, &truth, &mask) < 0.5, "{unit}");
        }
    }

    #[test]
    fn normals_are_integrated_although_the_height_beside_them_is_flat() {
        let (_, mask, truth) = scene();
        let n = normals(&truth);
        let plane = |c: usize| Field::from_vec(SIDE, SIDE, n.iter().map(|n| n[c]).collect());
        let planes = [plane(0), plane(1), plane(2)];
        let height = map(&truth, |h| h - 100.0);
        let guide = Guide::Surface {
            normals: [&planes[0], &planes[1], &planes[2]],
            height: &height,
        };
        let (relief, used) = guided(guide, None);
        assert!(used && off(&relief.height, &truth, &mask) < 1.5);
        let flat = Field::filled(SIDE, SIDE, 7.0);
        let held_flat = Guide::Surface {
            normals: [&planes[0], &planes[1], &planes[2]],
            height: &flat,
        };
        let without = off(&Field::filled(SIDE, SIDE, 0.0), &truth, &mask);
        let with = off(&guided(held_flat, None).0.height, &truth, &mask);
        assert!(with < 0.97 * without, "{with} {without}");
    }

    #[test]
    fn a_word_that_says_nothing_leaves_the_silhouette_s_body() {
        let (image, mask, _) = scene();
        let body = Foundation::of(&image, &mask, &HeightSettings::default()).base;
        for value in [0.0, 1.0, -3e20] {
            let flat = Field::filled(SIDE, SIDE, value);
            let (relief, used) = guided(Guide::Nearness(&flat), None);
            assert!(!used && relief.height == body, "{value}");
        }
        let behind = Field::filled(SIDE, SIDE, -1.0);
        let (relief, used) = guided(
            Guide::Distance {
                depth: &behind,
                fov_radians: 0.8,
            },
            None,
        );
        assert!(!used && relief.height == body);
    }
}
