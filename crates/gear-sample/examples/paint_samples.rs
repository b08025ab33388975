//! Paints every sample and every scene of the benchmark and writes it, with its truth as pictures, into a folder:
//! `cargo run -p gear-sample --example paint_samples -- OUT [SIZE] [plain|textured|bordered] [paint|photo|flat] [NAME…]`.

use std::path::PathBuf;

use gear_sample::{Background, Condition, Options, benchmark, names, paint};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let out = PathBuf::from(arguments.first().ok_or("give the folder to write to")?);
    std::fs::create_dir_all(&out)?;
    let word = |index: usize| arguments.get(index).map(String::as_str).unwrap_or("");
    let background = match word(2) {
        "plain" => Background::Plain,
        "bordered" => Background::Bordered,
        _ => Background::Textured,
    };
    let condition = match word(3) {
        "photo" => Condition::Photo,
        "flat" => Condition::Flat,
        _ => Condition::Paint,
    };
    let options = Options {
        longer_side: word(1).parse().unwrap_or(768),
        background,
        condition,
        ..Options::default()
    };
    let asked = arguments.iter().skip(4).cloned().collect::<Vec<_>>();
    let every = names().iter().map(ToString::to_string).chain(benchmark()).collect();
    let scenes: Vec<String> = if asked.is_empty() { every } else { asked };
    for name in &scenes {
        let start = std::time::Instant::now();
        let sample = paint(name, &options)?;
        eprintln!("{name}: {:.2} s", start.elapsed().as_secs_f64());
        let (w, h) = sample.painting.size();
        let top = sample.height.data().iter().fold(1e-6f32, |a, b| a.max(*b));
        let code = |c: f32| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
        let save = |suffix: &str, pixel: &dyn Fn(usize) -> [f32; 3]| {
            let bytes: Vec<u8> = (0..w * h).flat_map(|i| pixel(i).map(code)).collect();
            image::save_buffer(
                out.join(format!("{name}{suffix}.png")),
                &bytes,
                w as u32,
                h as u32,
                image::ColorType::Rgb8,
            )
        };
        save("", &|i| sample.painting.rgb.data()[i])?;
        save("-height", &|i| [sample.height.data()[i] / top; 3])?;
        save("-normals", &|i| sample.normals[i].map(|c| 0.5 * c + 0.5))?;
        save("-mask", &|i| [f32::from(u8::from(sample.mask.data()[i])); 3])?;
    }
    Ok(())
}
