//! Analytic f32 gradients against central differences of the f64 reference.
//!
//! The loss is a random linear function of colour and coverage, and of depth and normals in tests that say so. Step 1e-6: the difference quotient is then good
//! to about 1e-8 of the loss's curvature scale, and the chance that a step moves some pixel across the 1/255
//! cut, which would break the quotient, is small; the seeds are chosen once and stay. The bound, 2e-3 of the
//! attribute's largest derivative, is what f32 sums over some thousand pixels with cancelling signs leave.

use gear_splat::cpu::Frame;
use gear_splat::reference::{self, Gaussian64};
use gear_splat::render::{PixelGradients, Wanted};
use gear_splat::{Camera, Gaussian, Outputs, RenderOptions, Scene, ScreenFilter};
use glam::{DVec3, Vec3};

use crate::scenes::{Random, cameras, cloud};

const STEP: f64 = 1e-6;

fn loss(
    gaussians: &[Gaussian64],
    degree: u8,
    camera: &Camera,
    options: &RenderOptions,
    pixels: &PixelGradients,
) -> f64 {
    let picture = reference::render_gaussians(gaussians, degree, camera, options);
    let dot = |a: &[f64; 3], b: &[f32; 3]| (0..3).map(|c| a[c] * f64::from(b[c])).sum::<f64>();
    let mut total = 0.0;
    for i in 0..picture.rgb.len() {
        total += dot(&picture.rgb[i], &pixels.rgb[i]) + picture.alpha[i] * f64::from(pixels.alpha[i]);
        if let Some(g) = pixels.depth.get(i)
            && picture.depth[i].is_finite()
        {
            total += picture.depth[i] * f64::from(*g);
        }
        if let Some(g) = pixels.normal.get(i) {
            total += dot(&picture.normal[i], g);
        }
    }
    total
}

pub fn assert_gradients(scene: &Scene, camera: &Camera, options: &RenderOptions) {
    assert_gradients_of(scene, camera, options, false);
}

fn assert_gradients_of(scene: &Scene, camera: &Camera, options: &RenderOptions, surfaces: bool) {
    let mut random = Random(77);
    let count = (camera.width * camera.height) as usize;
    let pixels = PixelGradients {
        rgb: (0..count)
            .map(|_| {
                [
                    random.within(-1.0, 1.0),
                    random.within(-1.0, 1.0),
                    random.within(-1.0, 1.0),
                ]
            })
            .collect(),
        alpha: (0..count).map(|_| random.within(-1.0, 1.0)).collect(),
        ..PixelGradients::default()
    };
    let pixels = PixelGradients {
        depth: (0..if surfaces { count } else { 0 })
            .map(|_| random.within(-1.0, 1.0))
            .collect(),
        normal: (0..if surfaces { count } else { 0 })
            .map(|_| random.vec3(1.0).to_array())
            .collect(),
        ..pixels
    };
    let outputs = if surfaces { Outputs::ALL } else { Outputs::RGBA };
    let frame = Frame::new(scene, camera, options, outputs);
    let fast = frame.backward(scene, &frame.draw(), &pixels, Wanted::ALL);
    let colors = frame.backward(scene, &frame.draw(), &pixels, Wanted::COLORS);
    assert_eq!(fast.sh_dc, colors.sh_dc, "colours alone get the same gradient");
    #[cfg(feature = "gpu")]
    crate::gpu::assert_gradients_agree(scene, camera, options, &pixels, &fast);

    let start = reference::gaussians(scene);
    let difference = |change: &dyn Fn(&mut Gaussian64, f64), i: usize| {
        let at = |step: f64| {
            let mut moved = start.clone();
            change(&mut moved[i], step);
            loss(&moved, scene.sh_degree, camera, options, &pixels)
        };
        (at(STEP) - at(-STEP)) / (2.0 * STEP)
    };
    let check = |name: &str, analytic: &dyn Fn(usize) -> f32, change: &dyn Fn(&mut Gaussian64, f64)| {
        let pairs: Vec<(f64, f64)> = (0..scene.len())
            .map(|i| (f64::from(analytic(i)), difference(change, i)))
            .collect();
        // The last bit of a loss of 30 is 4e-9 of the quotient: derivatives below 1e-5 are compared with that floor.
        let scale = pairs.iter().map(|p| p.1.abs()).fold(1e-5, f64::max);
        for (i, (analytic, numeric)) in pairs.into_iter().enumerate() {
            assert!(
                (analytic - numeric).abs() <= 2e-3 * scale,
                "{name} of {i}: {analytic:e} against {numeric:e} (scale {scale:e})"
            );
        }
    };
    for axis in 0..3 {
        check("center", &|i| fast.centers[i][axis], &|g, h| g.center[axis] += h);
        check("log scale", &|i| fast.log_scales[i][axis], &|g, h| {
            g.log_scale[axis] += h
        });
        check("colour", &|i| fast.sh_dc[i][axis], &|g, h| g.dc[axis] += h);
    }
    for axis in 0..4 {
        check("rotation", &|i| fast.rotations[i][axis], &|g, h| g.rotation[axis] += h);
    }
    check("opacity", &|i| fast.opacity_logits[i], &|g, h| g.opacity_logit += h);
    let stride = scene.sh_rest_stride();
    for k in 0..stride {
        check("SH", &|i| fast.sh_rest[i * stride + k], &|g, h| g.rest[k] += h);
    }
}

#[test]
fn gradients_agree_with_central_differences() {
    for camera in cameras(24, 20) {
        assert_gradients(&cloud(12, 11, 0.02, 0.2, 0), &camera, &RenderOptions::default());
    }
}

#[test]
fn gradients_of_view_dependent_colours_agree() {
    for camera in cameras(16, 16) {
        assert_gradients(&cloud(4, 12, 0.05, 0.2, 3), &camera, &RenderOptions::default());
    }
}

#[test]
fn gradients_of_the_anti_aliased_mode_agree() {
    let options = RenderOptions {
        filter: ScreenFilter::AntiAlias(0.3),
        ..RenderOptions::default()
    };
    for camera in cameras(24, 20) {
        assert_gradients(&cloud(10, 13, 0.02, 0.2, 0), &camera, &options);
    }
}

#[test]
fn gradients_of_unnormalised_quaternions_agree() {
    let mut scene = cloud(6, 14, 0.03, 0.2, 0);
    for (i, q) in scene.rotations.iter_mut().enumerate() {
        *q *= 0.5 + i as f32;
    }
    assert_gradients(&scene, &cameras(20, 20)[1], &RenderOptions::default());
}

#[test]
fn gradients_of_needles_discs_and_opaque_stacks_agree() {
    let mut scene = cloud(3, 15, 0.05, 0.1, 0);
    let mut random = Random(5);
    for (scales, opacity) in [
        (Vec3::new(0.6, 0.002, 0.002), 0.7),
        (Vec3::new(0.2, 0.2, 1e-4), 0.9),
        (Vec3::new(0.3, 0.25, 1e-3), 0.9999),
        (Vec3::splat(0.3), 0.9999),
    ] {
        scene.push(Gaussian {
            center: random.vec3(0.15),
            scales,
            rotation: random.rotation(),
            opacity,
            color: [random.next(), random.next(), random.next()],
        });
    }
    for camera in cameras(24, 24) {
        assert_gradients(&scene, &camera, &RenderOptions::default());
    }
}

#[test]
fn outside_the_clamp_of_the_jacobian_gradients_agree() {
    let mut scene = Scene::default();
    scene.push(Gaussian {
        center: Vec3::new(1.5, 0.2, 0.0),
        scales: Vec3::new(0.9, 0.5, 0.3),
        rotation: glam::Quat::IDENTITY,
        opacity: 0.8,
        color: [0.9, 0.1, 0.3],
    });
    let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 20, 20, 20.0);
    let point = camera.to_camera(scene.centers[0]).as_dvec3();
    assert!(DVec3::new(point.x / point.z, 0.0, 0.0).x > f64::from(camera.jacobian_limit()[0]));
    assert_gradients(&scene, &camera, &RenderOptions::default());
}

#[test]
fn gradients_by_depth_and_normals_agree() {
    for (k, camera) in cameras(24, 20).into_iter().enumerate() {
        assert_gradients_of(
            &cloud(8, 31 + k as u64, 0.03, 0.3, 0),
            &camera,
            &RenderOptions::default(),
            true,
        );
    }
}

#[test]
fn gradients_by_depth_and_normals_of_discs_and_needles_agree() {
    let mut random = Random(41);
    let mut scene = Scene::default();
    for (scales, opacity) in [
        (Vec3::new(0.3, 0.2, 2e-3), 0.8),
        (Vec3::new(0.01, 0.2, 0.25), 0.6),
        (Vec3::new(0.4, 0.01, 0.012), 0.7),
    ] {
        scene.push(Gaussian {
            center: random.vec3(0.15),
            scales,
            rotation: random.rotation(),
            opacity,
            color: [random.next(), random.next(), random.next()],
        });
    }
    for camera in cameras(24, 24) {
        assert_gradients_of(&scene, &camera, &RenderOptions::default(), true);
    }
}

#[test]
fn a_loss_on_the_depth_alone_moves_the_geometry() {
    let scene = cloud(30, 7, 0.05, 0.2, 0);
    let [_, camera] = cameras(32, 32);
    let outputs = Outputs {
        depth: true,
        ..Outputs::default()
    };
    let frame = Frame::new(&scene, &camera, &RenderOptions::default(), outputs);
    let pixels = PixelGradients {
        depth: vec![1.0; 32 * 32],
        ..PixelGradients::default()
    };
    let gradients = frame.backward(&scene, &frame.draw(), &pixels, Wanted::ALL);
    assert!(gradients.centers.iter().any(|g| g.length() > 0.1));
    assert!(gradients.sh_dc.iter().flatten().all(|&g| g == 0.0));
}

#[test]
fn frozen_groups_are_absent_and_the_others_do_not_depend_on_them() {
    let scene = cloud(300, 17, 0.01, 0.1, 1);
    let [_, camera] = cameras(40, 40);
    let frame = Frame::new(&scene, &camera, &RenderOptions::default(), Outputs::RGBA);
    let picture = frame.draw();
    let pixels = PixelGradients {
        rgb: vec![[1.0, -0.5, 0.25]; 1600],
        ..PixelGradients::default()
    };
    let all = frame.backward(&scene, &picture, &pixels, Wanted::ALL);
    for bits in 0..32u8 {
        let on = |bit: u8| bits & (1 << bit) != 0;
        let wanted = Wanted {
            centers: on(0),
            log_scales: on(1),
            rotations: on(2),
            opacity_logits: on(3),
            colors: on(4),
        };
        let some = frame.backward(&scene, &picture, &pixels, wanted);
        fn same<T: PartialEq>(some: &[T], all: &[T], wanted: bool) -> bool {
            if wanted { some == all } else { some.is_empty() }
        }
        assert!(same(&some.centers, &all.centers, on(0)), "{bits:b}");
        assert!(same(&some.log_scales, &all.log_scales, on(1)), "{bits:b}");
        assert!(same(&some.rotations, &all.rotations, on(2)), "{bits:b}");
        assert!(same(&some.opacity_logits, &all.opacity_logits, on(3)), "{bits:b}");
        assert!(same(&some.sh_dc, &all.sh_dc, on(4)), "{bits:b}");
        assert!(same(&some.sh_rest, &all.sh_rest, on(4)), "{bits:b}");
    }
}
