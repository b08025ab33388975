//! `gear render`: pictures of a scene.

use gear_image::Image;
use gear_image::io::png_bytes;
use gear_splat::formats::planes_exr;
use gear_splat::{Camera, Device, Fallback, RenderOptions, Scene, View, orbit};

use crate::args::RenderArgs;
use crate::bundle::File;
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::folder::Folder;
use crate::scenes::{self, Named};

/// Picture of a scene without a canonical camera.
const SIDE: u32 = 768;

pub fn render(args: &RenderArgs, console: &Console) -> Result<Exit, CliError> {
    let folder = Folder::probe(&args.out)?;
    let given = args.camera.as_deref().map(scenes::cameras).transpose()?;
    let (mut scene, dropped) = scenes::open(&args.scene, args.y_down, console)?.without_invalid();
    if dropped > 0 {
        console.note(&format!("{dropped} Gaussians are not finite and are left out"));
    }
    if scene.is_empty() {
        console.warning("the scene has no Gaussian; its pictures are white");
    }
    let cameras = match given {
        Some(cameras) => sized(cameras, args),
        None => around(&mut scene, args),
    };
    for named in &cameras {
        let Camera { width, height, .. } = named.camera;
        scenes::check_size(width, height).map_err(|cause| CliError::PictureSize {
            name: named.name.clone(),
            cause,
        })?;
    }
    let fallback = Fallback::telling(|why| Console::new().warning(why)).unless_required();
    let device = Device::open(&args.device, fallback).map_err(CliError::Device)?;
    for named in &cameras {
        let options = RenderOptions {
            near: near(&scene, &named.camera),
            ..RenderOptions::default()
        };
        let everything = args.depth || args.normal;
        let view = orbit::view_on(&device, &scene, &named.camera, named.name.clone(), &options, everything)
            .map_err(CliError::Device)?;
        let files = files(view, args).map_err(|cause| CliError::Encode {
            output: named.name.clone(),
            cause,
        })?;
        for file in files {
            console.result(&folder.write(&file)?.display().to_string());
        }
    }
    let list = File::new("cameras.json", scenes::cameras_json(&cameras));
    console.result(&folder.write(&list)?.display().to_string());
    Ok(Exit::Done)
}

fn sized(mut cameras: Vec<Named>, args: &RenderArgs) -> Vec<Named> {
    if let Some(size) = args.size {
        cameras
            .iter_mut()
            .for_each(|named| named.camera = size.of(&named.camera));
    }
    cameras
}

/// Views from the scene's own camera, or from one that faces it: one, or so many on a full turn in one frame.
fn around(scene: &mut Scene, args: &RenderArgs) -> Vec<Named> {
    let own = scene
        .canonical_camera
        .unwrap_or_else(|| orbit::facing(scene, SIDE, SIDE));
    scene.canonical_camera = Some(own);
    let count = args.orbit.unwrap_or(1);
    let yaws: Vec<f64> = (0..count).map(|i| 360.0 * f64::from(i) / f64::from(count)).collect();
    let mut cameras = orbit::cameras(scene, &yaws, 0);
    if count > 1 {
        orbit::with_common_frame(&mut cameras);
    }
    let name = |yaw: f64| match args.orbit {
        Some(_) => orbit::yaw_name(yaw),
        None => "view".to_owned(),
    };
    let named = cameras.into_iter().zip(yaws).map(|(camera, yaw)| Named {
        name: name(yaw),
        camera,
    });
    sized(named.collect(), args)
}

/// The near plane: the usual one, but nearer where the scene itself is.
fn near(scene: &Scene, camera: &Camera) -> f32 {
    let usual = RenderOptions::default().near;
    let center = scene.middle_bounds(0.01).map(|bounds| bounds.center());
    let depth = center.map_or(1.0, |c| camera.to_camera(c).z);
    if depth > 0.0 { usual.min(0.01 * depth) } else { usual }
}

fn files(view: View, args: &RenderArgs) -> Result<Vec<File>, String> {
    let size = view.rgb.size();
    let name = view.name;
    let mut files = vec![File::new(format!("{name}.png"), png_bytes(&Image::opaque(view.rgb))?)];
    if let (true, Some(depth)) = (args.depth, &view.depth) {
        files.push(File::new(format!("{name}.depth.exr"), planes_exr::depth(depth)?));
    }
    if let (true, Some(normal)) = (args.normal, &view.normal) {
        files.push(File::new(
            format!("{name}.normal.exr"),
            planes_exr::normal(size, normal)?,
        ));
    }
    Ok(files)
}
