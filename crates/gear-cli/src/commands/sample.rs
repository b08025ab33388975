//! `gear sample`: a painting that gear makes itself, with its truth.

use gear_graph::Value;
use gear_image::io::png_bytes;
use gear_image::{Field, Image, SrgbImage};
use gear_report::picture::Pixels;
use gear_sample::{Background, Condition, Options, Sample};

use crate::args::{BackgroundArg, ConditionArg, SampleArgs};
use crate::bundle::File;
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::folder::Folder;

pub fn sample(args: &SampleArgs, console: &Console) -> Result<Exit, CliError> {
    let (Some(name), Some(out)) = (&args.name, &args.out) else {
        for name in gear_sample::names() {
            console.result(name);
        }
        return Ok(Exit::Done);
    };
    let folder = Folder::probe(out)?;
    let options = Options {
        longer_side: args.size,
        background: match args.background {
            BackgroundArg::Plain => Background::Plain,
            BackgroundArg::Textured => Background::Textured,
            BackgroundArg::Bordered => Background::Bordered,
        },
        condition: match args.condition {
            ConditionArg::Paint => Condition::Paint,
            ConditionArg::Photo => Condition::Photo,
            ConditionArg::Flat => Condition::Flat,
        },
        seed: args.seed,
        ..Options::default()
    };
    let sample = gear_sample::paint(name, &options).map_err(|cause| CliError::Sample {
        asked: format!("gear sample {name}"),
        cause,
    })?;
    let files = files(&sample).map_err(|cause| CliError::Encode {
        output: name.clone(),
        cause,
    })?;
    for file in files {
        console.result(&folder.write(&file)?.display().to_string());
    }
    Ok(Exit::Done)
}

/// The painting and its truth. `depth.exr` is world z towards the viewer, NaN outside the mask, as `Reconstruct` gives it.
fn files(sample: &Sample) -> Result<Vec<File>, String> {
    let (width, height) = sample.painting.size();
    let encoded = |value: &Field| value.encode().map_err(|e| e.to_string());
    let png = |pixels: Pixels| pixels.png().map(|picture| picture.bytes).map_err(|e| e.to_string());
    let inside = sample.height.data().iter().zip(sample.mask.data());
    let depth = inside.map(|(&z, &inside)| if inside { z } else { f32::NAN }).collect();
    let depth = Field::from_vec(width, height, depth);
    let colours = sample.normals.iter().map(|n| n.map(|c| 0.5 + 0.5 * c)).collect();
    let normals = Image::opaque(SrgbImage::from_vec(width, height, colours));
    Ok(vec![
        File::new("painting.png", png_bytes(&sample.painting)?),
        File::new("mask.png", png(Pixels::of_share(&sample.mask.to_field()))?),
        File::new("depth.exr", encoded(&depth)?),
        File::new("depth.png", png(Pixels::of_height(&depth))?),
        File::new("height.exr", encoded(&sample.height)?),
        File::new("normals.exr", normals.encode().map_err(|e| e.to_string())?),
        File::new("normals.png", png_bytes(&normals)?),
    ])
}
