//! Reconstructs and translates a picture and writes what comes out as PNG files, with times:
//! `cargo run -p node-reconstruct --example look -- PICTURE|sample:NAME OUT [MASK.png]`.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use gear_graph::{Lazy, testing};
use gear_image::{Field, Image, Mask, SrgbImage, io};
use gear_splat::{Outputs, RenderOptions, render};
use node_reconstruct::{In, Reconstruct};
use node_translate::{Style, Translate};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [source, out] = [&arguments[0], &arguments[1]];
    std::fs::create_dir_all(out)?;
    let (picture, mask) = match source.strip_prefix("sample:") {
        Some(name) => {
            let sample = gear_sample::paint(name, &gear_sample::Options::default())?;
            (sample.painting, sample.mask)
        }
        None => {
            let picture = io::read_image(Path::new(source), &io::Options::default())?.image;
            let (width, height) = picture.size();
            let mask = match arguments.get(2) {
                Some(path) => io::read_mask(Path::new(path), &io::Options::default())?.0,
                None => Mask::filled(width, height, true),
            };
            (picture, mask)
        }
    };
    let (width, height) = picture.size();
    let write = |name: &str, image: &SrgbImage| {
        io::write_png(
            &Path::new(out).join(format!("{name}.png")),
            &Image::opaque(image.clone()),
        )
    };
    write("picture", &picture.rgb)?;
    let painted = picture.rgb.clone();
    let inside = mask.clone();
    let picture = Arc::new(picture);
    for style in [Style::Sculpture, Style::PencilSketch, Style::Woodcut] {
        let start = Instant::now();
        let inputs = node_translate::In {
            image: picture.clone(),
            edges: Lazy::given(Field::filled(width, height, 0.0)),
            mask: Lazy::given(mask.clone()),
            model: None,
        };
        let translated = testing::run(
            &Translate {
                style,
                ..Translate::default()
            },
            inputs,
        )?;
        println!("{style:?}: {:.2} s", start.elapsed().as_secs_f64());
        write(&format!("{style:?}").to_lowercase(), &translated.image.rgb)?;
    }
    let start = Instant::now();
    let inputs = In {
        image: picture,
        mask: Arc::new(mask),
        model: None,
    };
    let made = testing::run(&Reconstruct::default(), inputs)?;
    println!("Reconstruct: {:.2} s", start.elapsed().as_secs_f64());
    println!("{}", made.report.unwrap().0);
    write("normals", &made.normals.unwrap().rgb)?;
    let Some(camera) = made.scene.canonical_camera else {
        return Ok(());
    };
    let Some(bounds) = made.scene.bounds() else {
        return Ok(());
    };
    for yaw in [0.0f32, 30.0, 60.0, 90.0, 150.0] {
        let camera = camera.orbit(bounds.center(), yaw, 0.0);
        let camera = if yaw == 0.0 {
            camera
        } else {
            camera.framing(&bounds, 2000)
        };
        let options = RenderOptions {
            background: [0.25, 0.3, 0.9],
            ..RenderOptions::default()
        };
        let view = render(
            &made.scene,
            &camera,
            &options,
            Outputs {
                rgb: true,
                ..Outputs::default()
            },
        );
        if let Some(rgb) = view.rgb {
            if yaw == 0.0 {
                let (mut sum, mut n) = (0.0f64, 0.0f64);
                for ((a, b), _) in rgb
                    .data()
                    .iter()
                    .zip(painted.data())
                    .zip(inside.data())
                    .filter(|(_, m)| **m)
                {
                    for (a, b) in a.iter().zip(b) {
                        sum += f64::from(a - b) * f64::from(a - b);
                        n += 1.0;
                    }
                }
                println!("front PSNR {:.2} dB", -10.0 * libm::log10(sum / n));
            }
            write(&format!("yaw{yaw}"), &rgb)?;
        }
    }
    Ok(())
}
