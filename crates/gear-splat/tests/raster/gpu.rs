//! The GPU against the CPU and the reference.
//!
//! Every scene that the CPU is tested on (`agreement`, `extremes`, `gradients`) comes here too, so that both are held
//! against the same reference. Pictures have the CPU's tolerances. Gradients agree with the CPU's, which are checked
//! with central differences, within 1e-4 of their group's largest: the CPU takes the chain rule in f64, the GPU in f32.
//!
//! Without a GPU these tests say so and pass; with `GEAR_REQUIRE_GPU=1` they fail.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

use gear_splat::gpu::{Frame, Gpu, GpuError};
use gear_splat::reference::Reference;
use gear_splat::render::{PixelGradients, SceneGradients, Wanted};
use gear_splat::{Camera, Device, DeviceChoice, Fallback, Outputs, RenderOptions, Rendering, Scene, cpu, render};
use glam::Vec3;

use crate::agreement::{compare_colors, compare_surfaces};
use crate::extremes::{gaussian, scene};
use crate::scenes::{Random, cameras, cloud};

const GRADIENT: f32 = 1e-4;

/// Opens a GPU, or says why there is none.
fn open() -> Option<Gpu> {
    let required = std::env::var_os("GEAR_REQUIRE_GPU").is_some_and(|value| value == "1");
    match Gpu::open(None) {
        Ok(gpu) => Some(gpu),
        Err(error) if required => panic!("a GPU is required, but {error}"),
        Err(error) => {
            println!("skipped: {error}");
            None
        }
    }
}

/// The GPU that all tests share.
fn shared() -> Option<&'static Arc<Gpu>> {
    static GPU: OnceLock<Option<Arc<Gpu>>> = OnceLock::new();
    GPU.get_or_init(|| open().map(Arc::new)).as_ref()
}

pub fn assert_agrees(scene: &Scene, camera: &Camera, options: &RenderOptions, slow: &Reference) {
    if let Some(gpu) = shared() {
        let frame = Frame::new(gpu, scene, camera, options, Outputs::ALL).unwrap();
        let fast = frame.draw().unwrap();
        compare_colors(&fast, slow);
        compare_surfaces(&fast, slow);
    }
}

/// What the GPU draws, if there is one.
pub fn draw(scene: &Scene, camera: &Camera) -> Option<Rendering> {
    let frame = Frame::new(shared()?, scene, camera, &RenderOptions::default(), Outputs::RGBA);
    Some(frame.unwrap().draw().unwrap())
}

/// The GPU's gradients by a loss on colour and coverage, if there is one.
pub fn gradients(
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
    pixels: &PixelGradients,
) -> Option<SceneGradients> {
    let frame = Frame::new(shared()?, scene, camera, options, Outputs::RGBA).unwrap();
    let picture = frame.draw().unwrap();
    Some(frame.backward(scene, &picture, pixels, Wanted::ALL).unwrap())
}

pub fn assert_gradients_agree(
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
    pixels: &PixelGradients,
    cpu: &SceneGradients,
) {
    let Some(gpu) = shared() else { return };
    let surfaces = !pixels.depth.is_empty() || !pixels.normal.is_empty();
    let outputs = if surfaces { Outputs::ALL } else { Outputs::RGBA };
    let frame = Frame::new(gpu, scene, camera, options, outputs).unwrap();
    let picture = frame.draw().unwrap();
    compare_gradients(&frame.backward(scene, &picture, pixels, Wanted::ALL).unwrap(), cpu);
    let colors = frame.backward(scene, &picture, pixels, Wanted::COLORS).unwrap();
    let only_colors = SceneGradients {
        sh_dc: cpu.sh_dc.clone(),
        sh_rest: cpu.sh_rest.clone(),
        ..SceneGradients::default()
    };
    compare_gradients(&colors, &only_colors);
}

fn compare_gradients(gpu: &SceneGradients, cpu: &SceneGradients) {
    let three = |values: &[Vec3]| values.iter().flat_map(|v| v.to_array()).collect::<Vec<f32>>();
    let four = |g: &SceneGradients| g.rotations.iter().flat_map(|v| v.to_array()).collect::<Vec<f32>>();
    for (name, gpu, cpu) in [
        ("centre", three(&gpu.centers), three(&cpu.centers)),
        ("log scale", three(&gpu.log_scales), three(&cpu.log_scales)),
        ("rotation", four(gpu), four(cpu)),
        ("opacity", gpu.opacity_logits.clone(), cpu.opacity_logits.clone()),
        ("colour", gpu.sh_dc.concat(), cpu.sh_dc.concat()),
        ("SH", gpu.sh_rest.clone(), cpu.sh_rest.clone()),
    ] {
        assert_eq!(gpu.len(), cpu.len(), "{name}");
        let scale = cpu.iter().map(|x| x.abs()).fold(1e-9, f32::max);
        for (i, (gpu, cpu)) in gpu.iter().zip(&cpu).enumerate() {
            assert!(
                (gpu - cpu).abs() <= GRADIENT * scale,
                "{name} number {i}: {gpu:e} on the GPU, {cpu:e} on the CPU (scale {scale:e})"
            );
        }
    }
}

fn random_loss(camera: &Camera, seed: u64) -> PixelGradients {
    let mut random = Random(seed);
    let count = (camera.width * camera.height) as usize;
    PixelGradients {
        rgb: (0..count).map(|_| random.vec3(1.0).to_array()).collect(),
        alpha: (0..count).map(|_| random.within(-1.0, 1.0)).collect(),
        ..PixelGradients::default()
    }
}

#[test]
fn a_scene_of_many_blocks_and_tiles_agrees_with_the_cpu() {
    let Some(gpu) = shared() else { return };
    let options = RenderOptions::default();
    let scene = cloud(9000, 31, 0.002, 0.04, 1);
    for camera in cameras(150, 131) {
        let loss = random_loss(&camera, 5);
        let frame = cpu::Frame::new(&scene, &camera, &options, Outputs::RGBA);
        let picture = frame.draw();
        let gradients = frame.backward(&scene, &picture, &loss, Wanted::ALL);
        let twin = Frame::new(gpu, &scene, &camera, &options, Outputs::RGBA).unwrap();
        let drawn = twin.draw().unwrap();
        let (a, b) = (drawn.rgb.as_ref().unwrap(), picture.rgb.as_ref().unwrap());
        let worst = a.data().iter().flatten().zip(b.data().iter().flatten());
        let worst = worst.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst <= 1.0 / 255.0, "{worst}");
        compare_gradients(&twin.backward(&scene, &drawn, &loss, Wanted::ALL).unwrap(), &gradients);
    }
}

#[test]
fn the_same_bits_on_every_run_and_every_opening() {
    let (Some(gpu), Some(again)) = (shared(), open()) else {
        return;
    };
    let scene = cloud(3000, 9, 0.002, 0.05, 1);
    let [_, camera] = cameras(90, 70);
    let loss = random_loss(&camera, 3);
    let run = |gpu: &Arc<Gpu>| {
        let frame = Frame::new(gpu, &scene, &camera, &RenderOptions::default(), Outputs::RGBA).unwrap();
        let picture = frame.draw().unwrap();
        let gradients = frame.backward(&scene, &picture, &loss, Wanted::ALL).unwrap();
        (picture, gradients)
    };
    let first = run(gpu);
    assert!(first == run(gpu) && first == run(&Arc::new(again)));
}

#[test]
fn new_colours_on_an_old_frame_are_a_new_frame() {
    let Some(gpu) = shared() else { return };
    let mut scene = cloud(200, 12, 0.02, 0.08, 2);
    let [camera, _] = cameras(40, 40);
    let options = RenderOptions::default();
    let mut frame = Frame::new(gpu, &scene, &camera, &options, Outputs::RGBA).unwrap();
    scene.sh_dc.iter_mut().for_each(|c| c[0] = -c[0]);
    scene.sh_rest.iter_mut().for_each(|c| *c *= 2.0);
    frame.recolor(&scene);
    let fresh = Frame::new(gpu, &scene, &camera, &options, Outputs::RGBA).unwrap();
    assert_eq!(frame.draw().unwrap(), fresh.draw().unwrap());
}

#[test]
fn what_is_not_wanted_is_absent_and_changes_nothing() {
    let Some(gpu) = shared() else { return };
    let scene = cloud(100, 6, 0.01, 0.06, 0);
    let [camera, _] = cameras(33, 20);
    let draw = |outputs| {
        let frame = Frame::new(gpu, &scene, &camera, &RenderOptions::default(), outputs);
        frame.unwrap().draw().unwrap()
    };
    let all = draw(Outputs::ALL);
    assert_eq!(
        draw(Outputs::default()),
        Rendering {
            rgb: None,
            alpha: None,
            depth: None,
            median_depth: None,
            normal: None,
        }
    );
    let normal = Outputs {
        normal: true,
        ..Outputs::default()
    };
    assert_eq!(draw(normal).normal, all.normal);
    let rgba = draw(Outputs::RGBA);
    assert_eq!((rgba.rgb, rgba.alpha), (all.rgb, all.alpha));
    assert!(rgba.depth.is_none() && rgba.median_depth.is_none() && rgba.normal.is_none());
}

#[test]
fn gradients_of_extreme_scenes_are_numbers() {
    let Some(gpu) = shared() else { return };
    let scales = [1e-40, 1e-6, 1.0, 50.0, 1e30];
    let shapes = scales.iter().flat_map(|&a| scales.map(|b| Vec3::new(a, b, 1e-3)));
    let mut extreme = scene(shapes.map(|scales| gaussian(Vec3::ZERO, scales, 0.9)));
    for center in [Vec3::X * 1e20, Vec3::Y * 3e38, Vec3::Z * 1e6, Vec3::NAN] {
        extreme.push(gaussian(center, Vec3::splat(0.1), 1.0));
    }
    for camera in cameras(20, 20) {
        let frame = Frame::new(gpu, &extreme, &camera, &RenderOptions::default(), Outputs::RGBA).unwrap();
        let picture = frame.draw().unwrap();
        assert!(
            picture
                .rgb
                .as_ref()
                .unwrap()
                .data()
                .iter()
                .flatten()
                .all(|x| x.is_finite())
        );
        let gradients = frame
            .backward(&extreme, &picture, &random_loss(&camera, 4), Wanted::ALL)
            .unwrap();
        let finite = |v: &[Vec3]| v.iter().all(|v| v.is_finite());
        assert!(finite(&gradients.centers) && finite(&gradients.log_scales));
        assert!(gradients.rotations.iter().all(|q| q.is_finite()));
        assert!(gradients.opacity_logits.iter().all(|x| x.is_finite()));
    }
}

/// Counts what a fallback tells.
fn counting() -> (Fallback, Arc<AtomicUsize>) {
    let told = Arc::new(AtomicUsize::new(0));
    let count = Arc::clone(&told);
    let fallback = Fallback::telling(move |cause| {
        assert!(cause.contains("the CPU is used instead"), "{cause}");
        count.fetch_add(1, Ordering::Relaxed);
    });
    (fallback, told)
}

/// Draws twice and differentiates once on `device`; it must be what the CPU gives, to the bit.
fn assert_is_the_cpu(device: &Device) {
    let scene = cloud(100, 6, 0.01, 0.06, 1);
    let [camera, _] = cameras(40, 40);
    let options = RenderOptions::default();
    let loss = random_loss(&camera, 1);
    let expected = render(&scene, &camera, &options, Outputs::RGBA);
    for _ in 0..2 {
        let mut frame = device.frame(&scene, &camera, &options, Outputs::RGBA).unwrap();
        let picture = frame.draw(&scene).unwrap();
        assert_eq!(picture, expected);
        let gradients = frame.backward(&scene, &picture, &loss, Wanted::COLORS).unwrap();
        let cpu = cpu::Frame::new(&scene, &camera, &options, Outputs::RGBA);
        assert_eq!(gradients, cpu.backward(&scene, &expected, &loss, Wanted::COLORS));
    }
}

#[test]
fn without_the_gpu_asked_for_the_cpu_does_it_and_tells_once() {
    let (fallback, told) = counting();
    let choice = DeviceChoice::Gpu(Some("no GPU is called this".into()));
    let device = Device::open(&choice, fallback).unwrap();
    assert_eq!(device.realm(), "cpu");
    assert_is_the_cpu(&device);
    assert_eq!(told.load(Ordering::Relaxed), 1);
    let error = Device::open(&choice, Fallback::forbidden()).unwrap_err().to_string();
    assert!(error.starts_with("a GPU is required, but"), "{error}");
}

#[test]
fn a_gpu_whose_buffers_are_too_small_leaves_it_to_the_cpu_and_tells_once() {
    let Some(gpu) = open() else { return };
    let (fallback, told) = counting();
    let device = Device::on(gpu.with_largest_buffer(4096), fallback);
    assert!(device.realm().starts_with("gpu:"));
    assert_is_the_cpu(&device);
    assert_eq!(told.load(Ordering::Relaxed), 1);
    let Some(gpu) = open() else { return };
    let strict = Device::on(gpu.with_largest_buffer(4096), Fallback::forbidden());
    let scene = cloud(100, 6, 0.01, 0.06, 1);
    let [camera, _] = cameras(40, 40);
    let refused = strict.render(&scene, &camera, &RenderOptions::default(), Outputs::RGBA);
    assert!(refused.unwrap_err().to_string().contains("4096 bytes a buffer"));
}

/// 67 million pixels: either the adapter's buffers hold them, or it says which limit is too small and the CPU draws.
#[test]
fn a_picture_of_8192_squared_is_drawn_or_left_to_the_cpu() {
    let Some(gpu) = open() else { return };
    let (fallback, told) = counting();
    let device = Device::on(gpu, fallback);
    let ball = scene([gaussian(Vec3::ZERO, Vec3::splat(1e30), 0.5)]);
    let outputs = Outputs {
        alpha: true,
        ..Outputs::default()
    };
    let camera = Camera::front(8192, 8192);
    let picture = device
        .render(&ball, &camera, &RenderOptions::default(), outputs)
        .unwrap();
    let alpha = picture.alpha.unwrap();
    assert!((alpha.at(0, 0) - 0.5).abs() < 1e-5 && (alpha.at(8191, 8191) - 0.5).abs() < 1e-5);
    assert!(told.load(Ordering::Relaxed) <= 1);
}

#[test]
fn a_lost_gpu_leaves_it_to_the_cpu_and_tells_once() {
    let Some(gpu) = open() else { return };
    let scene = cloud(100, 6, 0.01, 0.06, 1);
    let [camera, _] = cameras(40, 40);
    let options = RenderOptions::default();
    let gpu = Arc::new(gpu);
    let frame = Frame::new(&gpu, &scene, &camera, &options, Outputs::RGBA).unwrap();
    gpu.close();
    assert!(matches!(frame.draw(), Err(GpuError::Failed { .. })));
    drop(frame);

    let (fallback, told) = counting();
    let device = Device::on(Arc::into_inner(gpu).unwrap(), fallback);
    assert_is_the_cpu(&device);
    assert_eq!(told.load(Ordering::Relaxed), 1);
}
