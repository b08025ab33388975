//! Writes the targets of the sample paintings, for looking at: `targets DIR [LONGER_SIDE]`.

use std::error::Error;
use std::sync::Arc;

use gear_image::SrgbImage;
use gear_splat::{RenderOptions, Views, orbit};
use node_edit::{Edit, In};

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let folder = words.next().ok_or("usage: targets DIR [LONGER_SIDE]")?;
    let longer_side = words.next().map_or(Ok(384), |w| w.parse())?;
    for name in gear_sample::names() {
        let options = gear_sample::Options {
            longer_side,
            ..gear_sample::Options::default()
        };
        let sample = gear_sample::paint(name, &options)?;
        let mut scene = sample.scene(1);
        for dc in &mut scene.sh_dc {
            *dc = dc.map(|c| 0.5 * c - 0.6);
        }
        let yaws = [-90.0, -60.0, -30.0, 0.0, 30.0, 60.0, 180.0];
        let cameras = orbit::cameras(&scene, &yaws, 0);
        let view = |(camera, yaw): (&gear_splat::Camera, &f64)| {
            orbit::view(&scene, camera, orbit::yaw_name(*yaw), &RenderOptions::default(), true)
        };
        let inputs = In {
            views: Arc::new(Views {
                views: cameras.iter().zip(&yaws).map(view).collect(),
            }),
            painting: Arc::new(sample.painting.clone()),
            mask: Arc::new(sample.mask.clone()),
            scene: Arc::new(scene),
        };
        let start = std::time::Instant::now();
        let out = gear_graph::testing::run(&Edit::default(), inputs)?;
        println!("{name}: {:.2} s", start.elapsed().as_secs_f64());
        for target in &out.targets.views {
            save(&target.rgb, &format!("{folder}/{name}-{}.png", target.name))?;
        }
    }
    Ok(())
}

fn save(picture: &SrgbImage, path: &str) -> Result<(), Box<dyn Error>> {
    let code = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
    let bytes: Vec<u8> = picture.data().iter().flat_map(|c| c.map(code)).collect();
    let (width, height) = (picture.width() as u32, picture.height() as u32);
    image::save_buffer(path, &bytes, width, height, image::ColorType::Rgb8)?;
    Ok(())
}
