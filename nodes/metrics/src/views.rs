//! What is rendered for the measures: depth maps for DDI.

use gear_image::Mask;
use gear_splat::{Camera, Outputs, Projection, RenderOptions, Scene, render};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::ddi::DepthMap;

/// Room around the scene's box: the frame is this times twice the largest distance from its centre along an axis.
const ROOM: f64 = 1.15;

/// Median depth of a scene of valid Gaussians, seen orthographically at each yaw, in a square of `side` pixels. The
/// scene is brought to unit size first, so that its scale and position do not count, not even in the last bits of
/// depth.
pub(crate) fn depth_maps(scene: &Scene, yaws_degrees: &[f64], side: u32) -> Vec<DepthMap> {
    let nothing = || DepthMap {
        visible: Mask::filled(side as usize, side as usize, false),
        depth: vec![0.0; (side * side) as usize],
    };
    let Some(unit) = unit_sized(scene) else {
        return yaws_degrees.iter().map(|_| nothing()).collect();
    };
    let mut camera = Camera::front(side, side);
    camera.projection = Projection::Orthographic {
        pixels_per_unit: side as f32,
    };
    let outputs = Outputs {
        median_depth: true,
        ..Outputs::default()
    };
    yaws_degrees
        .par_iter()
        .map(|&yaw| {
            let camera = camera.orbit(Vec3::ZERO, yaw as f32, 0.0);
            let rendering = render(&unit, &camera, &RenderOptions::default(), outputs);
            rendering.median_depth.map_or_else(nothing, |depth| {
                let (width, height) = depth.size();
                DepthMap {
                    visible: Mask::from_vec(width, height, depth.data().iter().map(|d| d.is_finite()).collect()),
                    depth: depth.data().iter().map(|&d| f64::from(d) * f64::from(side)).collect(),
                }
            })
        })
        .collect()
}

/// The scene moved to the origin and scaled so that [`ROOM`] times its box is 1; `None` without a visible extent.
fn unit_sized(scene: &Scene) -> Option<Scene> {
    let bounds = scene.bounds()?;
    let (low, high) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let center = (low + high) / 2.0;
    let extent = ROOM * (high - low).max_element();
    if !extent.is_finite() || extent <= 0.0 {
        return None;
    }
    let log_extent = libm::log(extent);
    let shrunk = |c: &Vec3| ((c.as_dvec3() - center) / extent).as_vec3();
    Some(Scene {
        centers: scene.centers.iter().map(shrunk).collect(),
        log_scales: scene
            .log_scales
            .iter()
            .map(|s| (s.as_dvec3() - DVec3::splat(log_extent)).as_vec3())
            .collect(),
        ..scene.clone()
    })
}
