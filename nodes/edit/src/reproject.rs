//! What each pixel of a view knows of the painting, through the known geometry.
//!
//! A view pixel with a depth is a world point; the canonical camera shows that point at some place of the painting.
//! The painting saw it if the front surface there has the same depth. Colours are taken with a facing weight
//! clip((n·v − 0.2)/0.25, 0, 1), because an oblique projection smears. A point that faces away from the painter takes
//! the colour of the same place: a back is the mirrored front, as in the scene itself, so that views from opposite
//! sides agree.

use gear_image::filter::{self, Beyond};
use gear_image::{Field, Mask, SrgbImage};
use gear_splat::{Camera, View};
use glam::Vec3;
use rayon::prelude::*;

/// Cosine to the painter's ray below which a surface takes nothing from the painting, and the width of the ramp.
const GRAZING: f32 = 0.2;
const RAMP: f32 = 0.25;
/// Coverage from which a pixel belongs to the silhouette.
pub(crate) const SOLID: f32 = 0.5;

/// The painting and the geometry it is seen through.
pub(crate) struct Source<'a> {
    pub painting: &'a SrgbImage,
    pub mask: &'a Mask,
    /// The camera under which the scene shows the painting, of the painting's size.
    pub camera: Camera,
    /// Depth of the front surface under `camera`, world units; NaN where nothing is.
    pub depth: Field,
    /// How far the depths of one point may differ, pixels of the painting.
    pub tolerance_px: f32,
    /// Blur of visibility borders, pixels.
    pub feather_px: f64,
}

/// What a view knows of the painting. All rasters have the view's size.
pub(crate) struct Known {
    /// Where the scene is seen.
    pub silhouette: Mask,
    /// The painting's colour; white where it says nothing.
    pub colour: SrgbImage,
    /// How much of a pixel's colour comes from where the painter saw it, in 0..=1.
    pub front: Field,
    /// How much comes from the mirrored front, in 0..=1; of what `front` leaves.
    pub back: Field,
}

impl Known {
    /// Share of a pixel's colour that the painting gives.
    pub fn share(&self, i: usize) -> f32 {
        let front = self.front.data()[i];
        front + (1.0 - front) * self.back.data()[i]
    }

    /// Whether the painting tells every pixel of the silhouette.
    pub fn is_complete(&self) -> bool {
        (0..self.front.len()).all(|i| !self.silhouette.data()[i] || self.share(i) >= 1.0)
    }
}

#[derive(Clone, Copy)]
struct Seen {
    colour: [f32; 3],
    /// Cosine of the surface to the painter.
    facing: f32,
    visible: bool,
    inside: bool,
}

/// What the painting tells of a view that looks along the painter's own rays: itself, exactly, on its mask (the
/// second raster).
pub(crate) fn same_rays(source: &Source, view: &View, (dx, dy): (isize, isize)) -> (SrgbImage, Mask) {
    let (width, height) = source.mask.size();
    let place = |x: usize, y: usize| {
        let (x, y) = (x as isize + dx, y as isize + dy);
        let inside = x >= 0 && y >= 0 && (x as usize) < width && (y as usize) < height;
        (inside && source.mask.at(x as usize, y as usize)).then_some((x as usize, y as usize))
    };
    let (w, h) = view.rgb.size();
    let rgb = SrgbImage::from_fn(w, h, |x, y| {
        place(x, y).map_or([1.0; 3], |(x, y)| source.painting.at(x, y))
    });
    (rgb, Mask::from_fn(w, h, |x, y| place(x, y).is_some()))
}

/// What the painting tells of any view.
pub(crate) fn known(source: &Source, view: &View, alpha: &Field, depth: &Field, normal: &[[f32; 3]]) -> Known {
    let (width, height) = view.rgb.size();
    let solid = |i: usize| alpha.data()[i] >= SOLID && depth.data()[i].is_finite();
    let silhouette = Mask::from_vec(width, height, (0..width * height).map(solid).collect());
    let seen: Vec<Option<Seen>> = (0..width * height)
        .into_par_iter()
        .map(|i| {
            let point = silhouette.data()[i].then(|| {
                let (u, v) = ((i % width) as f32, (i / width) as f32);
                view.camera.unproject(u, v, depth.data()[i])
            })?;
            look_up(source, point, Vec3::from(normal[i]))
        })
        .collect();
    let flag =
        |f: fn(&Seen) -> bool| Mask::from_vec(width, height, seen.iter().map(|s| s.as_ref().is_some_and(f)).collect());
    let visible = filter::open(&flag(|s| s.visible), 1, Beyond::Inside);
    let front = feathered(&visible, &silhouette, source.feather_px);
    let mirrored = feathered(&flag(|s| s.inside && s.facing < 0.0), &silhouette, source.feather_px);
    let ramp = |cosine: f32| ((cosine - GRAZING) / RAMP).clamp(0.0, 1.0);
    let weight = |border: &Field, sign: f32| {
        let data = border.data().iter().zip(&seen);
        let data = data.map(|(b, s)| s.map_or(0.0, |s| b * ramp(sign * s.facing)));
        Field::from_vec(width, height, data.collect())
    };
    Known {
        front: weight(&front, 1.0),
        back: weight(&mirrored, -1.0),
        colour: SrgbImage::from_vec(
            width,
            height,
            seen.iter().map(|s| s.map_or([1.0; 3], |s| s.colour)).collect(),
        ),
        silhouette,
    }
}

/// The painting's view of a world point, where it falls on the canvas.
fn look_up(source: &Source, point: Vec3, normal: Vec3) -> Option<Seen> {
    let (width, height) = source.mask.size();
    let place = source.camera.project(point)?;
    let [u, v] = place.pixel;
    if !(u >= -0.5 && v >= -0.5 && u < width as f32 - 0.5 && v < height as f32 - 0.5) {
        return None;
    }
    let tolerance = source.tolerance_px / source.camera.pixels_per_unit(place.depth);
    // A front surface that agrees at any of the four pixels around: interpolating over a jump agrees with neither side.
    let (x0, y0) = (u.floor() as isize, v.floor() as isize);
    let agrees = |dx, dy| {
        let front = source.depth.at_clamped(x0 + dx, y0 + dy);
        (front - place.depth).abs() <= tolerance
    };
    let inside = source.mask.at_clamped(u.round() as isize, v.round() as isize);
    Some(Seen {
        colour: filter::bilinear_rgb(source.painting, u, v),
        facing: -normal.dot(source.camera.direction_to(point)),
        visible: inside && (agrees(0, 0) || agrees(1, 0) || agrees(0, 1) || agrees(1, 1)),
        inside,
    })
}

/// 1 well inside `area`, falling to 0 at its borders with the rest of the silhouette; the silhouette's own rim, behind
/// which there is nothing to blend with, is no border.
fn feathered(area: &Mask, silhouette: &Mask, sigma: f64) -> Field {
    let blurred = filter::gaussian(&area.to_field(), sigma);
    let all = filter::gaussian(&silhouette.to_field(), sigma);
    let ratio = blurred.data().iter().zip(all.data()).zip(area.data());
    let soft = ratio.map(|((b, a), &inside)| {
        if !inside {
            0.0
        } else if *b >= a - 1e-5 {
            1.0
        } else {
            (2.0 * b / a.max(1e-6) - 1.0).clamp(0.0, 1.0)
        }
    });
    Field::from_vec(area.width(), area.height(), soft.collect())
}
