//! How good are automatic masks? For every picture of the folder in `GEAR_PAINTINGS` prints mode and
//! confidence, then intersection over union on the samples over three backgrounds; overlays go to the folder that is
//! given:
//! `cargo run -p gear-relief --example masks -- OUT`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use gear_image::filter::{fit_longer_side, resize_rgb};
use gear_image::{Mask, SrgbImage};
use gear_relief::mask::{self, Found, Settings};
use gear_sample::{Background, Condition, Options};

const SIZE: usize = 768;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let out = PathBuf::from(std::env::args().nth(1).ok_or("give the folder to write to")?);
    std::fs::create_dir_all(&out)?;
    paintings(&out)?;
    samples(&out)
}

fn samples(out: &Path) -> Result<(), Box<dyn std::error::Error>> {
    println!(
        "| sample | background | condition | IoU | mode | confidence | s | doubts |\n|---|---|---|---|---|---|---|---|"
    );
    for name in gear_sample::names() {
        for background in [Background::Plain, Background::Textured, Background::Bordered] {
            for condition in [Condition::Paint, Condition::Photo] {
                let options = Options {
                    longer_side: SIZE,
                    background,
                    condition,
                    ..Options::default()
                };
                let sample = gear_sample::paint(name, &options)?;
                let start = Instant::now();
                let found = mask::automatic(&sample.painting.rgb, &Settings::default());
                let seconds = start.elapsed().as_secs_f64();
                let iou = overlap(&found.mask, &sample.mask);
                let (mode, sure) = (found.mode.name(), found.confidence.unwrap_or(f64::NAN));
                println!(
                    "| {name} | {background:?} | {condition:?} | {iou:.3} | {mode} | {sure:.2} | {seconds:.2} | {} |",
                    list(&found)
                );
                overlay(
                    &out.join(format!("{name}-{background:?}-{condition:?}.png")),
                    &sample.painting.rgb,
                    &found,
                )?;
            }
        }
    }
    Ok(())
}

fn paintings(out: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let Some(folder) = std::env::var_os("GEAR_PAINTINGS") else {
        return Ok(());
    };
    println!("| painting | mode | confidence | share | s | doubts |\n|---|---|---|---|---|---|");
    for path in pictures(Path::new(&folder))? {
        let decoded = image::open(&path)?.to_rgb32f();
        let (w, h) = (decoded.width() as usize, decoded.height() as usize);
        let full = SrgbImage::from_vec(w, h, decoded.pixels().map(|p| p.0).collect());
        let (w, h) = fit_longer_side(w, h, SIZE);
        let picture = resize_rgb(&full.to_linear(), w, h).to_srgb();
        let start = Instant::now();
        let found = mask::automatic(&picture, &Settings::default());
        let seconds = start.elapsed().as_secs_f64();
        let stem = path
            .file_stem()
            .map(|s| s.to_string_lossy().into_owned())
            .unwrap_or_default();
        let doubts = list(&found);
        println!(
            "| {stem} | {} | {:.2} | {:.2} | {seconds:.2} | {doubts} |",
            found.mode.name(),
            found.confidence.unwrap_or(f64::NAN),
            found.share()
        );
        overlay(&out.join(format!("{stem}.png")), &picture, &found)?;
    }
    println!();
    Ok(())
}

fn list(found: &Found) -> String {
    found.doubts.map_or(String::from("-"), |d| {
            format!(
                "rim {:.2} main {:.2} thick {:.2} fill {:.2} boxy {:.2} edges {:.2} explained {:.2} apart {:.2} spanned {:.3} busy {:.2}",
                d.rim, d.main, d.thick, d.fill, d.boxy, d.edges, d.explained, d.told_apart, d.spanned, d.busy
            )
    })
}

fn pictures(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next)? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "jpg" || e == "png") {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}

fn overlap(a: &Mask, b: &Mask) -> f64 {
    let pairs = || a.data().iter().zip(b.data());
    let both = pairs().filter(|(a, b)| **a && **b).count();
    let any = pairs().filter(|(a, b)| **a || **b).count();
    both as f64 / any.max(1) as f64
}

/// Ground dimmed towards blue, boundary red; a figure that was not trusted is outlined in yellow.
fn overlay(path: &Path, picture: &SrgbImage, found: &Found) -> image::ImageResult<()> {
    let (w, h) = picture.size();
    let rim = |mask: &Mask, x: usize, y: usize| {
        let here = mask.at(x, y);
        (x + 1 < w && mask.at(x + 1, y) != here) || (y + 1 < h && mask.at(x, y + 1) != here)
    };
    let mut bytes = Vec::with_capacity(3 * w * h);
    for y in 0..h {
        for x in 0..w {
            let mut c = picture.at(x, y);
            if !found.mask.at(x, y) {
                c = [0.25 * c[0] + 0.1, 0.25 * c[1] + 0.15, 0.25 * c[2] + 0.45];
            }
            if rim(&found.mask, x, y) {
                c = [1.0, 0.0, 0.0];
            }
            if found.candidate.as_ref().is_some_and(|m| rim(m, x, y)) {
                c = [1.0, 1.0, 0.0];
            }
            let on = |edge: f64, at: usize, n: usize| (edge * n as f64 - at as f64).abs() < 1.0;
            if found
                .frame
                .is_some_and(|f| on(f[0], x, w) || on(f[2], x, w) || on(f[1], y, h) || on(f[3], y, h))
            {
                c = [0.0, 1.0, 0.0];
            }
            bytes.extend(c.map(|v| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8));
        }
    }
    image::save_buffer(path, &bytes, w as u32, h as u32, image::ColorType::Rgb8)
}
