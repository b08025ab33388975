//! The same bits on any number of threads and at every SIMD level.

use gear_splat::cpu::{Frame, SimdLevel};
use gear_splat::render::{PixelGradients, SceneGradients, Wanted};
use gear_splat::{Camera, Gaussian, Outputs, RenderOptions, Scene};
use glam::{Quat, Vec3};

use crate::scenes::{Random, cameras, cloud};

/// Everything that the rasteriser computes, as bits: NaN is the depth of nothing.
fn everything(scene: &Scene, camera: &Camera, level: SimdLevel, threads: usize) -> (Vec<u32>, SceneGradients) {
    let count = (camera.width * camera.height) as usize;
    let mut random = Random(3);
    let pixels = PixelGradients {
        rgb: (0..count).map(|_| random.vec3(1.0).to_array()).collect(),
        alpha: (0..count).map(|_| random.within(-1.0, 1.0)).collect(),
        depth: (0..count).map(|_| random.within(-1.0, 1.0)).collect(),
        normal: (0..count).map(|_| random.vec3(1.0).to_array()).collect(),
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let frame = Frame::with_simd(scene, camera, &RenderOptions::default(), Outputs::ALL, level);
        let picture = frame.draw();
        let gradients = frame.backward(scene, &picture, &pixels, Wanted::ALL);
        let planes = [&picture.alpha, &picture.depth, &picture.median_depth].map(|p| p.as_ref().unwrap().data());
        let triples = [picture.rgb.as_ref().unwrap().data(), picture.normal.as_ref().unwrap()];
        let numbers = planes.concat().into_iter().chain(triples.concat().into_flattened());
        (numbers.map(f32::to_bits).collect(), gradients)
    })
}

fn assert_same_bits(scene: &Scene, camera: &Camera) {
    let one = everything(scene, camera, SimdLevel::Baseline, 1);
    for threads in [2, 7] {
        assert!(
            one == everything(scene, camera, SimdLevel::Baseline, threads),
            "{threads} threads"
        );
    }
    for level in SimdLevel::available() {
        assert!(one == everything(scene, camera, level, 3), "{level:?}");
    }
}

#[test]
fn pictures_and_gradients_have_the_same_bits_on_any_number_of_threads_and_at_every_simd_level() {
    let scene = cloud(20_000, 9, 0.002, 0.03, 1);
    for camera in cameras(150, 130) {
        assert_same_bits(&scene, &camera);
    }
}

#[test]
fn a_crowded_tile_that_is_cut_into_strips_has_the_same_bits() {
    let mut random = Random(12);
    let mut scene = Scene::default();
    for _ in 0..5000 {
        scene.push(Gaussian {
            center: random.vec3(0.02),
            scales: Vec3::splat(0.01) + random.vec3(0.008),
            rotation: Quat::IDENTITY,
            opacity: random.within(0.01, 0.1),
            color: [random.next(), random.next(), random.next()],
        });
    }
    assert_same_bits(&scene, &Camera::front(200, 200));
}
