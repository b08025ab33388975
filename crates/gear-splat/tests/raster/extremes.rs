//! Adversarial scenes, each against the reference.

use gear_splat::{Camera, Gaussian, Outputs, RenderOptions, Scene, render};
use glam::{Quat, Vec3};

use crate::agreement::assert_agrees;
use crate::scenes::{Random, cameras, cloud};

pub fn gaussian(center: Vec3, scales: Vec3, opacity: f32) -> Gaussian {
    Gaussian {
        center,
        scales,
        rotation: Quat::IDENTITY,
        opacity,
        color: [0.8, 0.3, 0.1],
    }
}

pub fn scene(gaussians: impl IntoIterator<Item = Gaussian>) -> Scene {
    let mut scene = Scene::default();
    gaussians.into_iter().for_each(|g| scene.push(g));
    scene
}

fn both(scene: &Scene) {
    for camera in cameras(37, 29) {
        assert_agrees(scene, &camera, &RenderOptions::default());
    }
}

#[test]
fn an_empty_scene_is_background() {
    both(&Scene::default());
    let picture = render(
        &Scene::default(),
        &Camera::front(3, 2),
        &RenderOptions::default(),
        Outputs::ALL,
    );
    assert_eq!(picture.rgb.unwrap().data(), [[1.0; 3]; 6]);
    assert!(picture.depth.unwrap().data().iter().all(|d| d.is_nan()));
}

#[test]
fn a_picture_of_one_pixel() {
    let scene = cloud(50, 20, 0.05, 0.5, 0);
    for camera in cameras(1, 1) {
        assert_agrees(&scene, &camera, &RenderOptions::default());
    }
}

#[test]
fn one_gaussian_covers_everything() {
    both(&scene([gaussian(Vec3::ZERO, Vec3::splat(50.0), 0.9)]));
    both(&scene([gaussian(Vec3::ZERO, Vec3::splat(1e30), 0.9)]));
}

#[test]
fn denormal_scales_are_a_dilated_point() {
    both(&scene([gaussian(Vec3::ZERO, Vec3::splat(1e-40), 0.9)]));
}

#[test]
fn needles_of_a_million_to_one() {
    let mut random = Random(1);
    both(&scene((0..20).map(|_| Gaussian {
        rotation: random.rotation(),
        ..gaussian(random.vec3(0.3), Vec3::new(1.0, 1e-6, 1e-6), 0.8)
    })));
}

#[test]
fn discs_seen_edge_on() {
    let discs = scene((0..10).map(|i| gaussian(Vec3::Z * 0.05 * i as f32, Vec3::new(0.1, 0.2, 1e-7), 0.95)));
    for yaw in [90.0, 89.99, 45.0, 0.0] {
        for camera in [Camera::front(40, 40), Camera::front_pinhole(40, 40, 0.8)] {
            assert_agrees(&discs, &camera.orbit(Vec3::ZERO, yaw, 0.0), &RenderOptions::default());
        }
    }
}

#[test]
fn behind_and_at_the_pinhole_nothing_is_seen() {
    let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 30, 30, 40.0);
    let behind = scene([1.0, 1.5, 40.0, 0.995].map(|z| gaussian(Vec3::Z * z, Vec3::splat(0.2), 0.9)));
    let slow = assert_agrees(&behind, &camera, &RenderOptions::default());
    assert!(slow.alpha.iter().all(|&a| a == 0.0));
    let front = scene([0.9, 0.98].map(|z| gaussian(Vec3::Z * z, Vec3::splat(0.05), 0.9)));
    assert_agrees(&front, &camera, &RenderOptions::default());
}

#[test]
fn an_orthographic_camera_sees_along_the_whole_line() {
    let far = scene([-1e4, 1e4].map(|z| gaussian(Vec3::Z * z, Vec3::splat(0.1), 0.9)));
    let picture = render(&far, &Camera::front(9, 9), &RenderOptions::default(), Outputs::RGBA);
    assert!(picture.alpha.unwrap().at(4, 4) > 0.98);
}

#[test]
fn opacities_at_their_limits() {
    for opacity in [0.0, 1.0, 1.0 / 255.0, 1.001 / 255.0, 0.99, 0.990_001] {
        both(&scene(
            (0..5).map(|i| gaussian(Vec3::Z * 0.1 * i as f32, Vec3::splat(0.1), opacity)),
        ));
    }
}

#[test]
fn equal_depths_are_blended_in_scene_order() {
    let mut random = Random(8);
    let flat = scene((0..200).map(|_| Gaussian {
        color: [random.next(), random.next(), random.next()],
        ..gaussian(
            Vec3::new(random.within(-0.3, 0.3), random.within(-0.3, 0.3), 0.1),
            Vec3::splat(0.08),
            0.6,
        )
    }));
    for camera in [Camera::front(40, 40), Camera::front_pinhole(40, 40, 0.8)] {
        assert_agrees(&flat, &camera, &RenderOptions::default());
    }
}

#[test]
fn far_coordinates_do_not_panic_and_stay_finite() {
    let far = scene([1e6, -1e6, 1e20, 3e38].map(|x| gaussian(Vec3::new(x, 0.0, 0.0), Vec3::splat(0.1 * x.abs()), 0.9)));
    for camera in cameras(20, 20) {
        let picture = render(&far, &camera, &RenderOptions::default(), Outputs::ALL);
        assert!(picture.rgb.unwrap().data().iter().flatten().all(|x| x.is_finite()));
    }
}

#[test]
fn invalid_gaussians_are_as_if_absent() {
    let clean = cloud(50, 21, 0.02, 0.1, 0);
    let mut dirty = clean.clone();
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        dirty.push(gaussian(Vec3::X * bad, Vec3::ONE, 0.9));
        dirty.push(gaussian(Vec3::ZERO, Vec3::ONE, 0.9));
        *dirty.sh_dc.last_mut().unwrap() = [bad; 3];
    }
    dirty.push(Gaussian {
        rotation: Quat::from_xyzw(0.0, 0.0, 0.0, 0.0),
        ..gaussian(Vec3::ZERO, Vec3::ONE, 0.9)
    });
    for camera in cameras(30, 30) {
        let draw = |scene: &Scene| render(scene, &camera, &RenderOptions::default(), Outputs::RGBA);
        assert_eq!(draw(&clean), draw(&dirty));
    }
}

#[test]
fn a_hundred_thousand_gaussians_in_one_pixel() {
    let stack = scene((0..100_000).map(|i| gaussian(Vec3::Z * 1e-5 * i as f32, Vec3::splat(1e-4), 0.05)));
    let picture = render(&stack, &Camera::front(16, 16), &RenderOptions::default(), Outputs::ALL);
    assert!(picture.alpha.unwrap().at(8, 8) > 0.5);
}

#[test]
fn a_surfel_facing_the_camera_obliquely_has_the_depth_of_its_plane() {
    let tilt = Quat::from_axis_angle(Vec3::Y, 0.9);
    let disc = scene([Gaussian {
        rotation: tilt,
        ..gaussian(Vec3::ZERO, Vec3::new(0.2, 0.2, 1e-3), 0.9)
    }]);
    let camera = Camera::front(81, 81);
    let picture = render(&disc, &camera, &RenderOptions::default(), Outputs::ALL);
    let (median, normal) = (picture.median_depth.unwrap(), tilt * Vec3::Z);
    for x in [35, 40, 46] {
        let ray = camera.ray(x as f32, 44.0);
        let depth = -normal.dot(ray.origin) / normal.dot(ray.direction);
        assert!((median.at(x, 44) - depth).abs() < 1e-3, "{} {depth}", median.at(x, 44));
    }
    let seen = Vec3::from(picture.normal.unwrap()[44 * 81 + 40]);
    assert!((seen - normal).length() < 1e-5);
}
