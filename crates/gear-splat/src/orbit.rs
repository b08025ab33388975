//! Views of a scene from around it.

use gear_image::{Rgb, SrgbImage};

use crate::{Bounds, Camera, Device, DeviceError, Outputs, RenderOptions, Rendering, Scene, View, render};

/// A frame that is widened to hold a scene grows to at most so many times its longer side. A turned box of a
/// painting's size needs √3; only scenes with strays far away ask for more.
const WIDEST: u32 = 3;

/// Angle under which [`facing`] shows a scene, along the shorter side.
const FACING_DEGREES: f32 = 40.0;

/// Cameras around the scene's centre, at these yaws in degrees, from its canonical camera.
///
/// Each frame is the canonical one, widened by whole pixels where the turned scene would leave it; at yaw 0 it is the
/// canonical frame exactly. `longer_side` samples it so that the canonical frame's longer side has that many pixels;
/// 0 leaves it.
pub fn cameras(scene: &Scene, yaws_degrees: &[f64], longer_side: u32) -> Vec<Camera> {
    let canonical = scene.camera_or_default();
    let canonical = if longer_side == 0 {
        canonical
    } else {
        canonical.resized(longer_side)
    };
    let center = scene.bounds().map_or(glam::Vec3::ZERO, |b| b.center());
    let extent = extent(scene);
    yaws_degrees
        .iter()
        .map(|&yaw| {
            let camera = canonical.orbit(center, yaw as f32, 0.0);
            match &extent {
                Some(extent) if yaw != 0.0 => camera.framing(extent, WIDEST * camera.width.max(camera.height)),
                _ => camera,
            }
        })
        .collect()
}

/// `count` cameras around the scene's centre, the canonical one first and the others evenly over all directions; frames and
/// `longer_side` as in [`cameras`], but the canonical frame is widened too.
pub fn all_around(scene: &Scene, count: u32, longer_side: u32) -> Vec<Camera> {
    let canonical = scene.camera_or_default().resized(longer_side.max(1));
    let center = scene.bounds().map_or(glam::Vec3::ZERO, |b| b.center());
    let extent = extent(scene);
    (0..count)
        .map(|k| {
            let (yaw, pitch) = match k {
                0 => (0.0, 0.0),
                // A Fibonacci sphere: turns of the golden angle at equal steps of height.
                _ => {
                    let height = 1.0 - (2.0 * f64::from(k) - 1.0) / f64::from(count - 1);
                    (137.507_764 * f64::from(k) % 360.0, libm::asin(height).to_degrees())
                }
            };
            let camera = canonical.orbit(center, yaw as f32, pitch as f32);
            match &extent {
                Some(extent) => camera.framing(extent, WIDEST * camera.width.max(camera.height)),
                None => camera,
            }
        })
        .collect()
}

/// A pinhole camera for a scene that has none: before its middle (98 % of the centres along each axis), at the distance
/// at which a ball around that fills the shorter side of the picture.
pub fn facing(scene: &Scene, width: u32, height: u32) -> Camera {
    let middle = scene.middle_bounds(0.01).unwrap_or(Bounds {
        min: glam::Vec3::splat(-0.5),
        max: glam::Vec3::splat(0.5),
    });
    let valid = (0..scene.len()).filter(|&i| scene.is_valid(i));
    let mut scales: Vec<f32> = valid.map(|i| scene.log_scales[i].max_element()).collect();
    scales.sort_unstable_by(f32::total_cmp);
    let typical = scales.get(scales.len() / 2).map_or(0.0, |&log| libm::expf(log));
    // Within these the distance and its square are f32 numbers.
    let radius = (0.5 * middle.size().length() + 3.0 * typical).clamp(1e-12, 1e12);
    let half = f64::from(FACING_DEGREES).to_radians() / 2.0;
    let focal_px = 0.5 * f64::from(width.min(height)) / libm::tan(half);
    let away = (f64::from(radius) / libm::sin(half)) as f32;
    let center = middle.center();
    let eye = center + glam::Vec3::Z * away;
    Camera::look_at(eye, center, glam::Vec3::Y, width, height, focal_px as f32)
}

/// The same frame for all cameras, as large as the largest needs: for frames that one flips through.
pub fn with_common_frame(cameras: &mut [Camera]) {
    let mut low = [f32::INFINITY; 2];
    let mut high = [f32::NEG_INFINITY; 2];
    for camera in cameras.iter() {
        for (axis, side) in [camera.width, camera.height].into_iter().enumerate() {
            low[axis] = low[axis].min(-camera.principal[axis]);
            high[axis] = high[axis].max(side as f32 - camera.principal[axis]);
        }
    }
    for camera in cameras {
        camera.principal = [-low[0], -low[1]];
        camera.width = (high[0] - low[0]).round() as u32;
        camera.height = (high[1] - low[1]).round() as u32;
    }
}

/// The box of what is to stay in frame: every Gaussian to two standard deviations. A few stray ones of enormous
/// size do not count.
fn extent(scene: &Scene) -> Option<Bounds> {
    let centers = scene.bounds()?;
    let whole = scene.bounds_with_extent(2.0)?;
    let room = glam::Vec3::splat(0.1 * centers.longest_side());
    Some(Bounds {
        min: whole.min.max(centers.min - room),
        max: whole.max.min(centers.max + room),
    })
}

/// Renders one view on the CPU. `everything`: coverage, depth and normals too, not only colour.
pub fn view(scene: &Scene, camera: &Camera, name: String, options: &RenderOptions, everything: bool) -> View {
    shown(camera, name, render(scene, camera, options, outputs(everything)))
}

/// As [`view`], on `device`.
pub fn view_on(
    device: &Device,
    scene: &Scene,
    camera: &Camera,
    name: String,
    options: &RenderOptions,
    everything: bool,
) -> Result<View, DeviceError> {
    let picture = device.render(scene, camera, options, outputs(everything))?;
    Ok(shown(camera, name, picture))
}

fn outputs(everything: bool) -> Outputs {
    if everything {
        Outputs::ALL
    } else {
        Outputs {
            rgb: true,
            ..Outputs::default()
        }
    }
}

fn shown(camera: &Camera, name: String, mut picture: Rendering) -> View {
    let depth = picture.surface_depth();
    let rgb = picture.rgb.take().map_or_else(|| Rgb::filled(0, 0, [0.0; 3]), clamped);
    View {
        camera: *camera,
        name,
        rgb,
        alpha: picture.alpha,
        depth,
        normal: picture.normal,
        weight: None,
    }
}

fn clamped(mut rgb: SrgbImage) -> SrgbImage {
    for pixel in rgb.data_mut() {
        *pixel = pixel.map(|x| x.clamp(0.0, 1.0));
    }
    rgb
}

/// The name of a view by its yaw: `yaw+30`, `yaw-7.5`.
pub fn yaw_name(yaw_degrees: f64) -> String {
    format!("yaw{yaw_degrees:+}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Gaussian;
    use glam::{Quat, Vec3};

    fn deep_scene() -> Scene {
        let mut scene = Scene {
            canonical_camera: Some(Camera::front(20, 60)),
            ..Scene::default()
        };
        for i in 0..200 {
            let t = i as f32 / 199.0 - 0.5;
            scene.push(Gaussian {
                center: Vec3::new(0.3 * t, 0.9 * t, (i % 7) as f32 * 0.1),
                scales: Vec3::splat(0.01),
                rotation: Quat::IDENTITY,
                opacity: 0.9,
                color: [0.5; 3],
            });
        }
        scene
    }

    #[test]
    fn the_whole_scene_stays_in_frame_at_every_yaw() {
        let scene = deep_scene();
        let yaws: Vec<f64> = (-6..=6).map(|i| 30.0 * f64::from(i)).collect();
        for camera in cameras(&scene, &yaws, 0) {
            for &center in &scene.centers {
                let [u, v] = camera.project(center).unwrap().pixel;
                assert!(u > -0.6 && u < camera.width as f32 - 0.4, "{u} of {}", camera.width);
                assert!(v > -0.6 && v < camera.height as f32 - 0.4);
            }
        }
    }

    #[test]
    fn at_yaw_zero_the_camera_is_the_canonical_one() {
        let scene = deep_scene();
        assert_eq!(cameras(&scene, &[0.0], 0)[0], scene.canonical_camera.unwrap());
    }

    #[test]
    fn from_all_around_every_side_is_faced_and_the_scene_stays_in_frame() {
        let scene = deep_scene();
        let all = all_around(&scene, 64, 60);
        assert_eq!(all.len(), 64);
        assert_eq!(all[0].forward(), scene.canonical_camera.unwrap().forward());
        let mut z = 1.0f32;
        for i in 0..200 {
            z -= 0.01;
            let (sin, cos) = libm::sincosf(i as f32);
            let direction = Vec3::new(
                (1.0 - z * z).max(0.0).sqrt() * cos,
                (1.0 - z * z).max(0.0).sqrt() * sin,
                z,
            );
            let nearest = all.iter().map(|c| c.forward().dot(direction)).fold(-1.0, f32::max);
            assert!(nearest > 0.9, "{direction}: {nearest}");
        }
        for camera in all {
            for &center in &scene.centers {
                let [u, v] = camera.project(center).unwrap().pixel;
                assert!(u > -0.6 && u < camera.width as f32 - 0.4, "{u} of {}", camera.width);
                assert!(v > -0.6 && v < camera.height as f32 - 0.4, "{v} of {}", camera.height);
            }
        }
    }

    #[test]
    fn a_common_frame_shows_what_each_frame_showed() {
        let scene = deep_scene();
        let apart = cameras(&scene, &[0.0, 45.0, 90.0], 0);
        let mut together = apart.clone();
        with_common_frame(&mut together);
        for (a, b) in apart.iter().zip(&together) {
            assert_eq!((together[0].width, together[0].height), (b.width, b.height));
            assert!(b.width >= a.width && b.height >= a.height);
            let shift = [b.principal[0] - a.principal[0], b.principal[1] - a.principal[1]];
            assert!(shift.iter().all(|s| *s >= 0.0 && s.fract() == 0.0), "{shift:?}");
        }
    }

    #[test]
    fn a_scene_without_a_camera_is_faced_whole_whatever_its_size() {
        for unit in [1e-6, 1.0, 1e6] {
            let mut scene = deep_scene();
            scene.canonical_camera = None;
            scene
                .centers
                .iter_mut()
                .for_each(|c| *c = *c * unit + Vec3::splat(3.0 * unit));
            scene.log_scales = vec![Vec3::splat(libm::logf(0.01 * unit)); scene.len()];
            let camera = facing(&scene, 80, 60);
            for &center in &scene.centers {
                let seen = camera.project(center).unwrap();
                let [u, v] = seen.pixel;
                assert!((0.0..79.0).contains(&u) && (0.0..59.0).contains(&v), "{unit}: {u} {v}");
            }
        }
        assert!(facing(&Scene::default(), 80, 60).is_valid());
    }

    #[test]
    fn names_say_the_yaw() {
        assert_eq!([30.0, -7.5, 0.0].map(yaw_name), ["yaw+30", "yaw-7.5", "yaw+0"]);
    }
}
