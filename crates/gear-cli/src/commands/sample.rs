//! `gear sample`: a painting that gear makes itself, with its truth.

use gear_graph::Value;
use gear_image::io::png_bytes;
use gear_image::{Field, Image};
use gear_report::picture::Pixels;
use gear_sample::{BENCHMARK_SCENES, Background, Condition, Family, LIGHTS, Options, Sample};

use crate::args::{BackgroundArg, ConditionArg, SampleArgs};
use crate::bundle::File;
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::folder::Folder;

pub fn sample(args: &SampleArgs, console: &Console) -> Result<Exit, CliError> {
    if args.list {
        families().iter().for_each(|line| console.result(line));
        return Ok(Exit::Done);
    }
    let (Some(name), Some(out)) = (&args.name, &args.out) else {
        let motifs = gear_sample::names().iter().map(ToString::to_string);
        motifs
            .chain(gear_sample::benchmark())
            .for_each(|name| console.result(&name));
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
        // clap knows the names
        light: gear_sample::light(&args.light).unwrap_or(Options::default().light),
        seed: args.seed,
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

/// What there is, for people.
fn families() -> Vec<String> {
    let mut scenes = vec![(
        gear_sample::names().join(", "),
        "motifs with names of their own".to_owned(),
    )];
    for family in Family::ALL {
        let names = format!("{0}-1 … {0}-{BENCHMARK_SCENES}", family.name());
        scenes.push((names, family.about().to_string()));
    }
    let width = scenes.iter().map(|(names, _)| names.chars().count()).max().unwrap_or(0);
    let mut lines: Vec<String> = scenes
        .iter()
        .map(|(names, about)| format!("{names:<width$}  {about}"))
        .collect();
    lines.push(format!("lights: {}", LIGHTS.map(|(name, _)| name).join(", ")));
    lines.push(
        "as input: sample:NAME,condition=photo|paint|flat,light=LIGHT,seed=N,background=plain|textured|bordered".into(),
    );
    lines.push(
        "          of an Image also show=painting|normals|albedo; a Field is the true depth, a Scene the true surface"
            .into(),
    );
    lines.push("any higher number makes a scene too: figure-1000".into());
    lines
}

/// The painting and its truth. `depth.exr` is world z towards the viewer, NaN outside the mask, as `Reconstruct` gives it.
fn files(sample: &Sample) -> Result<Vec<File>, String> {
    let encoded = |value: &Field| value.encode().map_err(|e| e.to_string());
    let png = |pixels: Pixels| pixels.png().map(|picture| picture.bytes).map_err(|e| e.to_string());
    let depth = sample.front();
    let normals = Image::opaque(sample.normal_map());
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
