//! The backward pass on the scenes of `extremes`: what must come of each, on the CPU and on the GPU.
//!
//! Where a step of 1e-6 means something, the gradients are held against central differences of the reference. Elsewhere
//! what they must be is known.

use gear_splat::cpu;
use gear_splat::render::{PixelGradients, SceneGradients, Wanted};
use gear_splat::{Camera, FRONT_DISTANCE, Gaussian, Outputs, RenderOptions, Scene, sh};
use glam::{Quat, Vec3};

use crate::extremes::{gaussian, scene};
use crate::gradients::assert_gradients;
use crate::scenes::{Random, cameras, cloud};

/// What each device there is gives.
fn everywhere(scene: &Scene, camera: &Camera, pixels: &PixelGradients) -> Vec<(&'static str, SceneGradients)> {
    let options = RenderOptions::default();
    let frame = cpu::Frame::new(scene, camera, &options, Outputs::RGBA);
    #[cfg_attr(not(feature = "gpu"), allow(unused_mut))]
    let mut all = vec![("CPU", frame.backward(scene, &frame.draw(), pixels, Wanted::ALL))];
    #[cfg(feature = "gpu")]
    all.extend(crate::gpu::gradients(scene, camera, &options, pixels).map(|found| ("GPU", found)));
    all
}

/// A loss that every pixel's colour and coverage have the same part in.
fn even(camera: &Camera) -> PixelGradients {
    let count = (camera.width * camera.height) as usize;
    PixelGradients {
        rgb: vec![[1.0, -0.5, 0.25]; count],
        alpha: vec![0.5; count],
        ..PixelGradients::default()
    }
}

/// True when nothing of Gaussian `i` has a gradient.
fn is_still(g: &SceneGradients, i: usize) -> bool {
    g.centers[i] == Vec3::ZERO
        && g.log_scales[i] == Vec3::ZERO
        && g.rotations[i] == glam::Vec4::ZERO
        && g.opacity_logits[i] == 0.0
        && g.sh_dc[i] == [0.0; 3]
}

fn assert_finite(device: &str, g: &SceneGradients) {
    let vectors = g.centers.iter().chain(&g.log_scales).all(|v| v.is_finite());
    let rest = g
        .opacity_logits
        .iter()
        .chain(g.sh_dc.as_flattened())
        .all(|x| x.is_finite());
    assert!(vectors && rest && g.rotations.iter().all(|q| q.is_finite()), "{device}");
}

#[test]
fn an_empty_scene_has_empty_gradients() {
    for camera in cameras(5, 4) {
        for (_, g) in everywhere(&Scene::default(), &camera, &even(&camera)) {
            assert_eq!(g, SceneGradients::default());
        }
    }
}

#[test]
fn in_a_picture_of_one_pixel_gradients_agree_with_differences() {
    for camera in cameras(1, 1) {
        assert_gradients(&cloud(5, 41, 0.2, 0.6, 0), &camera, &RenderOptions::default());
    }
}

#[test]
fn gradients_of_one_that_covers_everything_agree_with_differences() {
    let wide = scene([gaussian(Vec3::new(3.0, 1.0, 0.1), Vec3::new(8.0, 9.0, 7.0), 0.9)]);
    for camera in cameras(12, 10) {
        assert_gradients(&wide, &camera, &RenderOptions::default());
    }
}

/// Nothing that happens to a ball of 1e30 is seen but its colour and its opacity, whose gradients are sums over all pixels.
#[test]
fn a_ball_of_1e30_moves_its_colour_and_its_opacity_only() {
    let ball = scene([gaussian(Vec3::ZERO, Vec3::splat(1e30), 0.9)]);
    let camera = Camera::front(20, 16);
    for (device, g) in everywhere(&ball, &camera, &even(&camera)) {
        let pixels = 320.0;
        for (c, by) in [1.0, -0.5, 0.25].into_iter().enumerate() {
            let expected = pixels * 0.9 * by * sh::Y0;
            assert!((g.sh_dc[0][c] - expected).abs() < 1e-3, "{device}: {:?}", g.sh_dc);
        }
        // Σ_c g_c (c − background) + g_A, with dα/dlogit = α (1 − α).
        let felt = 1.0 * (0.8 - 1.0) - 0.5 * (0.3 - 1.0) + 0.25 * (0.1 - 1.0) + 0.5;
        let expected = pixels * felt * 0.9 * 0.1;
        assert!(
            (g.opacity_logits[0] - expected).abs() < 1e-2,
            "{device}: {:?}",
            g.opacity_logits
        );
        assert!(
            g.centers[0].length() < 1e-6 && g.log_scales[0].length() < 1e-6,
            "{device}: {g:?}"
        );
        assert!(g.rotations[0].length() < 1e-6, "{device}: {g:?}");
    }
}

#[test]
fn gradients_of_needles_of_a_million_to_one_agree_with_differences() {
    let mut random = Random(3);
    let needles = scene((0..3).map(|_| Gaussian {
        rotation: random.rotation(),
        color: [random.next(), random.next(), random.next()],
        ..gaussian(random.vec3(0.1), Vec3::new(0.5, 5e-7, 5e-7), 0.8)
    }));
    for camera in cameras(20, 20) {
        assert_gradients(&needles, &camera, &RenderOptions::default());
    }
}

#[test]
fn gradients_of_discs_seen_edge_on_agree_with_differences() {
    let discs = scene((0..3).map(|i| gaussian(Vec3::Z * 0.1 * i as f32, Vec3::new(0.1, 0.2, 1e-7), 0.7)));
    for yaw in [90.0, 89.9] {
        for camera in [Camera::front(20, 20), Camera::front_pinhole(20, 20, 0.8)] {
            assert_gradients(&discs, &camera.orbit(Vec3::ZERO, yaw, 0.0), &RenderOptions::default());
        }
    }
}

#[test]
fn at_and_behind_the_near_plane_nothing_moves() {
    let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 30, 30, 40.0);
    let depths = [1.0, 1.5, 40.0, 0.995, 0.98, 0.9];
    let all = scene(depths.map(|z| gaussian(Vec3::Z * z, Vec3::splat(0.05), 0.5)));
    for (device, g) in everywhere(&all, &camera, &even(&camera)) {
        assert_finite(device, &g);
        let still: Vec<bool> = (0..all.len()).map(|i| is_still(&g, i)).collect();
        assert_eq!(still, [true, true, true, true, false, false], "{device}");
    }
}

/// Opacity 0 is not seen. Opacity 1 is held at α = 0.99 wherever the ball is that opaque, here everywhere: its logit and its
/// shape then decide nothing, and its colour all.
#[test]
fn at_opacity_zero_nothing_moves_and_at_one_the_colour_alone() {
    let camera = Camera::front(9, 9);
    let mut one = scene([gaussian(Vec3::ZERO, Vec3::splat(1e3), 0.0)]);
    for logit in [gear_splat::logit(0.0), -1e30, f32::MIN] {
        one.opacity_logits[0] = logit;
        for (device, g) in everywhere(&one, &camera, &even(&camera)) {
            assert!(is_still(&g, 0), "{device}: {g:?}");
        }
    }
    for logit in [gear_splat::logit(1.0), 1e30, f32::MAX] {
        one.opacity_logits[0] = logit;
        for (device, g) in everywhere(&one, &camera, &even(&camera)) {
            assert!((g.sh_dc[0][0] - 81.0 * 0.99 * sh::Y0).abs() < 1e-3, "{device}: {g:?}");
            let mut rest = g;
            rest.sh_dc[0] = [0.0; 3];
            assert!(is_still(&rest, 0), "{device}: {rest:?}");
        }
    }
}

#[test]
fn a_point_of_denormal_scale_moves_all_but_its_shape() {
    let camera = Camera::front(16, 16);
    let point = scene([gaussian(Vec3::new(0.01, 0.02, 0.0), Vec3::splat(1e-40), 0.5)]);
    let mut random = Random(8);
    let uneven = PixelGradients {
        rgb: (0..256).map(|_| random.vec3(1.0).to_array()).collect(),
        ..PixelGradients::default()
    };
    for (device, g) in everywhere(&point, &camera, &uneven) {
        assert_finite(device, &g);
        assert!(
            g.log_scales[0].length() < 1e-9 && g.rotations[0].length() < 1e-9,
            "{device}: {g:?}"
        );
        assert!(
            g.centers[0].truncate().length() > 0.1 && g.opacity_logits[0] != 0.0,
            "{device}: {g:?}"
        );
    }
}

/// Centres at 1e6 lie on f32's grid of 1/16. The same scene and camera at the origin have the same gradients.
#[test]
fn at_coordinates_of_a_million_gradients_are_those_at_the_origin() {
    let mut random = Random(13);
    let near = scene((0..60).map(|_| {
        let cell = random.vec3(5.0).round() / 16.0;
        Gaussian {
            rotation: random.rotation(),
            color: [random.next(), random.next(), random.next()],
            ..gaussian(cell, Vec3::splat(1e-3) + random.vec3(9e-4), 0.9)
        }
    }));
    let offset = Vec3::new(1e6, -1e6, 1e6);
    let mut far = near.clone();
    far.centers.iter_mut().for_each(|c| *c += offset);
    let camera = Camera::front(60, 60);
    let moved = Camera {
        translation: camera.translation - camera.rotation * offset,
        ..camera
    };
    let here = everywhere(&near, &camera, &even(&camera));
    let there = everywhere(&far, &moved, &even(&camera));
    for ((device, a), (_, b)) in here.into_iter().zip(there) {
        let largest = a.centers.iter().map(|c| c.length()).fold(0.0, f32::max);
        assert!(largest > 0.1, "{device}: the scene must be seen");
        for (a, b) in a.centers.iter().zip(&b.centers) {
            // Relative to the camera the centres are off by 1e-10, f64's rounding at 1e6: 1e-7 of the scales. The rest is
            // f32's rounding in sums over a few hundred pixels.
            assert!((*a - *b).length() <= 1e-5 * largest, "{device}: {a} and {b}");
        }
        assert_eq!(a.sh_dc, b.sh_dc, "{device}");
    }
}

/// Where the front decides, what is behind it does not move.
fn assert_front_moves(stack: &Scene, camera: &Camera) {
    for (device, g) in everywhere(stack, camera, &even(camera)) {
        assert_finite(device, &g);
        assert!(!is_still(&g, 0), "{device}");
        assert!((1000..stack.len()).all(|i| is_still(&g, i)), "{device}");
    }
}

#[test]
fn of_a_million_in_one_pixel_the_front_ones_move() {
    let camera = Camera::front(16, 16);
    let at = camera.unproject(8.0, 8.0, FRONT_DISTANCE);
    assert_front_moves(
        &scene((0..1_000_000).map(|i| gaussian(at - Vec3::Z * 1e-6 * i as f32, Vec3::splat(1e-4), 0.05))),
        &camera,
    );
}

#[test]
fn of_a_million_coincident_gaussians_the_first_ones_move() {
    assert_front_moves(
        &scene((0..1_000_000).map(|_| gaussian(Vec3::ZERO, Vec3::splat(2.0), 0.05))),
        &Camera::front(16, 16),
    );
}

#[test]
fn invalid_gaussians_do_not_move_and_change_nothing_for_the_others() {
    let clean = cloud(50, 21, 0.02, 0.1, 1);
    let mut dirty = clean.clone();
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        dirty.push(gaussian(Vec3::X * bad, Vec3::ONE, 0.9));
        dirty.push(gaussian(Vec3::ZERO, Vec3::ONE, 0.9));
        *dirty.sh_dc.last_mut().unwrap() = [bad; 3];
        dirty.push(gaussian(Vec3::ZERO, Vec3::ONE, 0.9));
        *dirty.opacity_logits.last_mut().unwrap() = bad;
        dirty.push(gaussian(Vec3::ZERO, Vec3::ONE, 0.9));
        *dirty.sh_rest.last_mut().unwrap() = bad;
    }
    dirty.push(Gaussian {
        rotation: Quat::from_xyzw(0.0, 0.0, 0.0, 0.0),
        ..gaussian(Vec3::ZERO, Vec3::ONE, 0.9)
    });
    for camera in cameras(30, 30) {
        let found = everywhere(&dirty, &camera, &even(&camera));
        for ((device, g), (_, expected)) in found.into_iter().zip(everywhere(&clean, &camera, &even(&camera))) {
            assert!((50..dirty.len()).all(|i| is_still(&g, i)), "{device}");
            assert!(g.sh_rest[50 * 9..].iter().all(|&x| x == 0.0), "{device}");
            assert_eq!(g.centers[..50], expected.centers, "{device}");
            assert_eq!(g.rotations[..50], expected.rotations, "{device}");
            assert_eq!(g.sh_rest[..50 * 9], expected.sh_rest, "{device}");
        }
    }
}

/// 67 million pixels, each with a part of α (1 − α) in the gradient of the one opacity.
#[test]
fn at_8192_squared_every_pixel_has_its_part() {
    let camera = Camera::front(8192, 8192);
    let ball = scene([gaussian(Vec3::ZERO, Vec3::splat(1e30), 0.5)]);
    let outputs = Outputs {
        alpha: true,
        ..Outputs::default()
    };
    let pixels = PixelGradients {
        alpha: vec![1.0; 8192 * 8192],
        ..PixelGradients::default()
    };
    let frame = cpu::Frame::new(&ball, &camera, &RenderOptions::default(), outputs);
    let g = frame.backward(&ball, &frame.draw(), &pixels, Wanted::ALL);
    let expected = 8192.0 * 8192.0 * 0.25;
    assert!(
        (g.opacity_logits[0] - expected).abs() < 1e-3 * expected,
        "{:?}",
        g.opacity_logits
    );
}
