//! Adversarial scenes, each against the reference.

use gear_splat::cpu::Frame;
use gear_splat::render::{Counts, PixelGradients, Wanted};
use gear_splat::{Camera, FRONT_DISTANCE, Gaussian, Outputs, RenderOptions, Scene, ScreenFilter, render};
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

/// What a stack hides is not there: T falls below 1e-4 within the first thousand.
fn assert_front_decides(stack: &Scene, camera: &Camera) {
    let draw = |scene: &Scene| render(scene, camera, &RenderOptions::default(), Outputs::RGBA);
    let whole = draw(stack);
    assert!(whole.alpha.as_ref().unwrap().at(8, 8) > 0.999);
    let front = stack.filtered(|i| i < 1000);
    assert_eq!(whole, draw(&front));
    #[cfg(feature = "gpu")]
    assert_eq!(crate::gpu::draw(stack, camera), crate::gpu::draw(&front, camera));
}

#[test]
fn a_million_gaussians_in_one_pixel_show_the_front_ones() {
    let camera = Camera::front(16, 16);
    let at = camera.unproject(8.0, 8.0, FRONT_DISTANCE);
    assert_front_decides(
        &scene((0..1_000_000).map(|i| gaussian(at - Vec3::Z * 1e-6 * i as f32, Vec3::splat(1e-4), 0.05))),
        &camera,
    );
}

#[test]
fn of_a_million_coincident_gaussians_the_first_in_the_scene_are_in_front() {
    let mut random = Random(6);
    let many = scene((0..1_000_000).map(|_| Gaussian {
        color: [random.next(), random.next(), random.next()],
        ..gaussian(Vec3::ZERO, Vec3::splat(2.0), 0.05)
    }));
    assert_front_decides(&many, &Camera::front(16, 16));
}

/// Opacity 0 (logit −16) is left out, opacity 1 is held at α = 0.99. Logits beyond are as good as these.
#[test]
fn opacity_exactly_zero_and_one_and_logits_beyond() {
    let camera = Camera::front(9, 9);
    let mut one = scene([gaussian(Vec3::ZERO, Vec3::splat(10.0), 0.0)]);
    let draw = |scene: &Scene| Frame::new(scene, &camera, &RenderOptions::default(), Outputs::RGBA);
    for logit in [gear_splat::logit(0.0), -80.0, -1e30, f32::MIN] {
        one.opacity_logits[0] = logit;
        assert_eq!(draw(&one).counts().transparent, 1);
        assert_eq!(draw(&one).draw().alpha.unwrap().at(4, 4), 0.0);
    }
    for logit in [gear_splat::logit(1.0), 80.0, 1e30, f32::MAX] {
        one.opacity_logits[0] = logit;
        assert_eq!(draw(&one).draw().alpha.unwrap().at(4, 4), 0.99);
    }
}

/// f32 holds 1e6 in steps of 1/16: detail of 1e-3 is gone from the centres before anything is drawn, but not from the
/// scales. What is left is drawn as exactly as near the origin.
#[test]
fn coordinates_of_a_million_with_detail_of_a_thousandth() {
    let far = Vec3::new(1e6, -1e6, 1e6);
    let mut random = Random(13);
    let detail = scene((0..100).map(|_| Gaussian {
        rotation: random.rotation(),
        ..gaussian(far + random.vec3(0.5), Vec3::splat(1e-3) + random.vec3(5e-4), 0.9)
    }));
    for (camera, eye) in [
        (Camera::front(40, 40), far),
        (Camera::front_pinhole(40, 40, 0.8), far),
        (
            Camera::look_at(far + Vec3::Z * 2.0, far, Vec3::Y, 40, 40, 100.0),
            Vec3::ZERO,
        ),
    ] {
        let camera = Camera {
            translation: camera.translation - camera.rotation * eye,
            ..camera
        };
        let slow = assert_agrees(&detail, &camera, &RenderOptions::default());
        assert!(slow.alpha.iter().any(|&a| a > 0.1), "something must be seen");
    }
}

#[test]
fn a_picture_of_8192_squared_holds_a_gaussian_in_its_last_pixel() {
    let camera = Camera::front(8192, 8192);
    let corner = camera.unproject(8191.0, 8191.0, FRONT_DISTANCE);
    let outputs = Outputs {
        alpha: true,
        ..Outputs::default()
    };
    let all = scene([
        gaussian(corner, Vec3::splat(1e-4), 0.9),
        gaussian(Vec3::ZERO, Vec3::splat(1e30), 0.5),
    ]);
    let alpha = render(&all, &camera, &RenderOptions::default(), outputs).alpha.unwrap();
    assert!((alpha.at(0, 0) - 0.5).abs() < 1e-5 && (alpha.at(8191, 8191) - 0.95).abs() < 1e-4);
}

/// Without closing covered tiles this would be 256 million entries, a gigabyte.
#[test]
fn many_gaussians_larger_than_the_picture_take_little_memory() {
    let camera = Camera::front(512, 512);
    let many = scene((0..500_000).map(|i| gaussian(Vec3::Z * 1e-6 * i as f32, Vec3::splat(3.0), 0.6)));
    let frame = Frame::new(&many, &camera, &RenderOptions::default(), Outputs::RGBA);
    assert!(frame.pairs() < 512 * 16 * 20, "{} entries", frame.pairs());
    assert!(frame.draw().alpha.unwrap().data().iter().all(|&a| a > 0.9998));
}

#[test]
fn closing_covered_tiles_changes_no_bit() {
    let mut random = Random(19);
    let layers = scene((0..400).map(|_| Gaussian {
        color: [random.next(), random.next(), random.next()],
        rotation: random.rotation(),
        ..gaussian(
            random.vec3(0.4),
            Vec3::splat(0.2) + random.vec3(0.19),
            random.within(0.1, 0.9),
        )
    }));
    for camera in cameras(100, 90) {
        assert_agrees(&layers, &camera, &RenderOptions::default());
    }
}

#[test]
fn what_is_left_out_is_counted_by_its_first_cause() {
    let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 30, 30, 40.0);
    let mut all = scene([
        gaussian(Vec3::ZERO, Vec3::splat(0.1), 0.9),
        gaussian(Vec3::X * 50.0, Vec3::splat(0.1), 0.9),
        gaussian(Vec3::ZERO, Vec3::splat(0.1), 0.003),
        gaussian(Vec3::Z * 2.0, Vec3::splat(0.1), 0.003),
        gaussian(Vec3::Z * f32::NAN, Vec3::splat(0.1), 0.9),
        gaussian(Vec3::ZERO, Vec3::splat(0.1), 0.9),
    ]);
    all.log_scales[5].y = f32::INFINITY;
    let frame = Frame::new(&all, &camera, &RenderOptions::default(), Outputs::RGBA);
    let expected = Counts {
        invalid: 2,
        behind: 1,
        transparent: 1,
        outside: 1,
        seen: 1,
    };
    assert_eq!(frame.counts(), expected);
}

#[test]
fn higher_coefficients_that_are_zero_change_no_bit() {
    let plain = cloud(200, 23, 0.02, 0.1, 0);
    let zeros = Scene {
        sh_degree: 3,
        sh_rest: vec![0.0; 200 * 45],
        ..plain.clone()
    };
    for camera in cameras(30, 30) {
        let draw = |scene: &Scene| render(scene, &camera, &RenderOptions::default(), Outputs::RGBA);
        assert_eq!(draw(&plain), draw(&zeros));
    }
}

/// By colour and coverage all are finite. By depth one may be beyond f32: the plane of a ball of 1e30 turns with any
/// change of its shape; such a derivative is infinite, and still not NaN.
#[test]
fn gradients_of_extreme_scenes_are_finite_or_beyond_f32_but_never_nan() {
    let mut random = Random(29);
    let extreme = scene([
        gaussian(Vec3::ZERO, Vec3::splat(1e30), 0.9),
        gaussian(Vec3::ZERO, Vec3::splat(1e-40), 1.0),
        gaussian(Vec3::X * 0.1, Vec3::new(1.0, 1e-6, 1e-6), 1.0),
        gaussian(Vec3::Y * 0.1, Vec3::new(1e-7, 0.2, 0.3), 0.95),
        gaussian(Vec3::Z * 0.1, Vec3::new(0.2, 0.1, 1e-20), 1.0 / 255.0 + 1e-6),
        gaussian(Vec3::X * 1e6, Vec3::splat(1e6), 0.9),
    ]);
    let count = 24 * 24;
    let by_color = PixelGradients {
        rgb: (0..count).map(|_| random.vec3(1.0).to_array()).collect(),
        alpha: vec![1.0; count],
        ..PixelGradients::default()
    };
    let by_all = PixelGradients {
        depth: vec![1.0; count],
        normal: (0..count).map(|_| random.vec3(1.0).to_array()).collect(),
        ..by_color.clone()
    };
    for camera in cameras(24, 24) {
        for filter in [ScreenFilter::Dilate(0.3), ScreenFilter::AntiAlias(0.1)] {
            let options = RenderOptions {
                filter,
                ..RenderOptions::default()
            };
            let frame = Frame::new(&extreme, &camera, &options, Outputs::ALL);
            let numbers = |pixels: &PixelGradients| {
                let g = frame.backward(&extreme, &frame.draw(), pixels, Wanted::ALL);
                let triples = [g.centers, g.log_scales]
                    .concat()
                    .into_iter()
                    .flat_map(|v| v.to_array());
                let rotations = g.rotations.into_iter().flat_map(|v| v.to_array());
                let all = triples.chain(rotations).chain(g.opacity_logits);
                all.chain(g.sh_dc.into_flattened()).collect::<Vec<f32>>()
            };
            assert!(numbers(&by_color).iter().all(|g| g.is_finite()));
            assert!(numbers(&by_all).iter().all(|g| !g.is_nan()));
        }
    }
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
