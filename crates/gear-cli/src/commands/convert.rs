//! `gear convert`: a scene in another format.

use gear_image::io::{WriteError, write_atomically};
use gear_splat::formats::{self, Format};
use gear_splat::{RenderOptions, Scene, orbit, prune, render};

use crate::args::ConvertArgs;
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::{scenes, sizes};

pub fn convert(args: &ConvertArgs, console: &Console) -> Result<Exit, CliError> {
    let (input, output) = (&args.input, &args.output);
    let format = Format::of_path(output).ok_or_else(|| CliError::SceneName { file: output.clone() })?;
    let same = |a: &std::path::Path, b: &std::path::Path| a.canonicalize().ok().zip(b.canonicalize().ok());
    if same(input, output).is_some_and(|(a, b)| a == b) {
        return Err(CliError::OntoItself { file: output.clone() });
    }
    let scene = scenes::open(input, args.y_down, console)?;
    let scene = match args.prune {
        Some(views) => pruned(&scene, views, console),
        None => scene,
    };
    let written = formats::write(&scene, format).map_err(|cause| CliError::SceneFile {
        file: output.clone(),
        cause,
    })?;
    write_atomically(output, &written.bytes).map_err(|error| CliError::Write {
        file: output.clone(),
        cause: match error {
            WriteError::Io { source, .. } => source,
            other => std::io::Error::other(other),
        },
    })?;
    for loss in &written.losses {
        console.note(&loss.to_string());
    }
    let size = sizes::bytes(written.bytes.len() as u64);
    console.remark(&format!("{}: {format}, {size}", output.display()));
    console.result(&output.display().to_string());
    Ok(Exit::Done)
}

/// Longer side of the views by which a scene is pruned: what is smaller than a pixel there is still seen, if less.
const SIDE: u32 = 768;

fn pruned(scene: &Scene, views: u32, console: &Console) -> Scene {
    let cameras = orbit::all_around(scene, views, SIDE);
    let (kept, dropped) = prune::pruned(scene, &cameras, &RenderOptions::default(), render::ALPHA_MIN);
    console.note(&format!(
        "left out {dropped} of {} Gaussians, those that {views} views from all around do not need",
        scene.len()
    ));
    kept
}
