//! The true surface as a dense scene, to compare novel views with.
//!
//! One surfel a pixel stands on the front, another on a plausible closed back, and walls fill every gap that a
//! height field cannot show: along the silhouette between front and back, and behind every contour where one
//! part hides another. The front carries the colours that the painter saw (lines included); walls and back
//! carry the colour of the part itself, without its lines.

use gear_image::{Field, SrgbImage};
use gear_splat::{Camera, Projection, Scene};
use glam::{Mat3, Quat, Vec3};

use crate::Sample;

/// Depth of the back, as a share of the front's.
const BACK: f32 = 0.6;
/// Distance of the canonical camera from the ground plane, world units.
const DISTANCE: f32 = 2.0;
/// Standard deviation of a surfel across, pixels.
const COVER: f32 = 0.6;
/// Standard deviation along the normal, pixels.
const THIN: f32 = 0.15;
/// Logit of opacity 0.99.
const OPAQUE: f32 = 4.595_12;
/// Degree-0 spherical harmonic.
const SH0: f32 = 0.282_094_79;

impl Sample {
    /// The camera under which the scene shows the painting: orthographic, before the centre.
    pub fn camera(&self) -> Camera {
        let (width, height) = self.painting.size();
        Camera {
            rotation: Mat3::from_diagonal(Vec3::new(1.0, -1.0, -1.0)),
            translation: Vec3::new(0.0, 0.0, DISTANCE),
            projection: Projection::Orthographic {
                pixels_per_unit: width.max(height) as f32,
            },
            principal: [0.5 * (width as f32 - 1.0), 0.5 * (height as f32 - 1.0)],
            width: width as u32,
            height: height as u32,
        }
    }

    /// World z of the front towards the viewer, the picture's longer side being 1; NaN outside the mask.
    pub fn front(&self) -> Field {
        let (width, height) = self.painting.size();
        let front = |(&h, &inside): (&f32, &bool)| if inside { h } else { f32::NAN };
        Field::from_vec(
            width,
            height,
            self.height.data().iter().zip(self.mask.data()).map(front).collect(),
        )
    }

    /// True normals as colours `n/2 + ½`; ½ outside the mask.
    pub fn normal_map(&self) -> SrgbImage {
        let (width, height) = self.painting.size();
        let colours = self.normals.iter().map(|n| n.map(|c| 0.5 + 0.5 * c)).collect();
        SrgbImage::from_vec(width, height, colours)
    }

    /// True depth along the canonical camera's axis, world units; NaN outside the mask.
    pub fn depth(&self) -> Field {
        let (width, height) = self.painting.size();
        let depth = |(&h, &inside): (&f32, &bool)| if inside { DISTANCE - h } else { f32::NAN };
        Field::from_vec(
            width,
            height,
            self.height.data().iter().zip(self.mask.data()).map(depth).collect(),
        )
    }

    /// The true surface with its true colours. `step` takes every `step`-th pixel (1 is dense).
    pub fn scene(&self, step: usize) -> Scene {
        let step = step.max(1);
        let (width, height) = self.painting.size();
        let mut lift = Lift::new(self, step);
        for y in (0..height).step_by(step) {
            for x in (0..width).step_by(step) {
                if self.mask.at(x, y) {
                    lift.pixel(x, y);
                }
            }
        }
        lift.scene.canonical_camera = Some(self.camera());
        lift.scene
    }
}

struct Lift<'a> {
    sample: &'a Sample,
    scene: Scene,
    step: usize,
    px: f32,
    open: bool,
}

impl<'a> Lift<'a> {
    fn new(sample: &'a Sample, step: usize) -> Self {
        let scene = Scene {
            centers: Vec::new(),
            log_scales: Vec::new(),
            rotations: Vec::new(),
            opacity_logits: Vec::new(),
            sh_dc: Vec::new(),
            sh_rest: Vec::new(),
            sh_degree: 0,
            canonical_camera: None,
        };
        let px = step as f32 / sample.mask.longer_side() as f32;
        Self {
            sample,
            scene,
            step,
            px,
            open: sample.mask.is_full(),
        }
    }

    fn pixel(&mut self, x: usize, y: usize) {
        let index = y * self.sample.mask.width() + x;
        let normal = Vec3::from_array(self.sample.normals[index]);
        let z = self.sample.height.data()[index];
        let front = self.sample.painting.rgb.data()[index];
        let bare = self.sample.unlined.data()[index];
        self.surfel(self.place(x, y, z), normal, front);
        if !self.open {
            let behind = Vec3::new(normal.x, normal.y, -normal.z.max(0.15)).normalize_or(Vec3::NEG_Z);
            self.surfel(self.place(x, y, -BACK * z), behind, bare.map(|c| 0.85 * c));
        }
        self.walls(x, y, z, bare);
    }

    /// Fills from this pixel's height down to lower neighbours: the side of a part that hides what is behind it.
    fn walls(&mut self, x: usize, y: usize, z: f32, colour: [f32; 3]) {
        let step = self.step as isize;
        let (mut outward, mut floor) = (Vec3::ZERO, z);
        for (dx, dy) in [(-step, 0), (step, 0), (0, -step), (0, step)] {
            let (i, j) = (x as isize + dx, y as isize + dy);
            let within =
                i >= 0 && j >= 0 && (i as usize) < self.sample.mask.width() && (j as usize) < self.sample.mask.height();
            if !within {
                continue;
            }
            let (i, j) = (i as usize, j as usize);
            let below = if self.sample.mask.at(i, j) {
                self.sample.height.at(i, j)
            } else {
                -BACK * z
            };
            if z - below > 1.5 * self.px {
                outward += Vec3::new(dx as f32, -dy as f32, 0.0);
                floor = floor.min(below);
            }
        }
        let outward = outward.normalize_or_zero();
        if outward == Vec3::ZERO {
            return;
        }
        let count = ((z - floor) / self.px).floor() as usize;
        for k in 1..=count {
            self.surfel(self.place(x, y, z - k as f32 * self.px), outward, colour);
        }
    }

    fn place(&self, x: usize, y: usize, z: f32) -> Vec3 {
        let (width, height) = self.sample.mask.size();
        let unit = 1.0 / width.max(height) as f32;
        Vec3::new(
            (x as f32 - 0.5 * (width as f32 - 1.0)) * unit,
            -(y as f32 - 0.5 * (height as f32 - 1.0)) * unit,
            z,
        )
    }

    fn surfel(&mut self, center: Vec3, normal: Vec3, colour: [f32; 3]) {
        let n = normal.normalize_or(Vec3::Z);
        let rotation = frame(n);
        // first axis downhill: a pixel covers 1 / n_z of a slope
        let stretch = if n.z.abs() < 1e-3 {
            1.0
        } else {
            1.0 / n.z.abs().max(0.15)
        };
        let size = Vec3::new(COVER * self.px * stretch, COVER * self.px, THIN * self.px);
        self.scene.centers.push(center);
        self.scene.log_scales.push(Vec3::from_array(
            size.to_array().map(|s| libm::log(f64::from(s)) as f32),
        ));
        self.scene.rotations.push(rotation);
        self.scene.opacity_logits.push(OPAQUE);
        self.scene.sh_dc.push(colour.map(|c| (c - 0.5) / SH0));
    }
}

/// The turn that brings z to `n` and x to the downhill direction.
fn frame(n: Vec3) -> Quat {
    let downhill = Vec3::new(n.x, n.y, 0.0);
    let across = if downhill.length_squared() < 1e-12 {
        Vec3::Y
    } else {
        Vec3::new(-n.y, n.x, 0.0).normalize()
    };
    let first = across.cross(n);
    Quat::from_mat3(&Mat3::from_cols(first, across, n)).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Options, paint};

    #[test]
    fn the_surface_is_closed_and_its_front_is_the_painting() {
        let sample = paint(
            "vessel",
            &Options {
                longer_side: 64,
                ..Options::default()
            },
        )
        .unwrap();
        let scene = sample.scene(1);
        assert!(scene.centers.len() > 2 * sample.mask.count());
        assert!(scene.centers.iter().all(|c| c.is_finite()));
        assert!(scene.rotations.iter().all(|q| (q.length() - 1.0).abs() < 1e-4));
        let first = sample.mask.data().iter().position(|m| *m).unwrap();
        let colour = sample.painting.rgb.data()[first];
        for k in 0..3 {
            assert!((scene.sh_dc[0][k] * SH0 + 0.5 - colour[k]).abs() < 1e-5);
        }
        let back = scene.centers.iter().map(|c| c.z).fold(0.0f32, f32::min);
        let front = scene.centers.iter().map(|c| c.z).fold(0.0f32, f32::max);
        assert!((back + BACK * front).abs() < 1e-5);
    }

    #[test]
    fn the_third_axis_is_the_normal() {
        for n in [Vec3::Z, Vec3::X, Vec3::new(0.3, -0.5, 0.2).normalize(), Vec3::NEG_Z] {
            assert!((frame(n) * Vec3::Z - n).length() < 1e-5);
        }
    }

    #[test]
    fn depth_is_height_seen_from_the_camera() {
        let sample = paint(
            "landscape-relief",
            &Options {
                longer_side: 48,
                ..Options::default()
            },
        )
        .unwrap();
        let depth = sample.depth();
        assert!(sample.mask.is_full());
        assert!((depth.at(3, 4) + sample.height.at(3, 4) - DISTANCE).abs() < 1e-6);
    }
}
