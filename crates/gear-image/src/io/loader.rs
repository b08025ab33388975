//! Picture and mask files as inputs of a graph.

use gear_graph::{Context, FileSource, Loader, NodeError, Params, Value};

use super::{DEFAULT_SIZE, Limits, Options, Problem, Source, decode_image, decode_mask};
use crate::{Field, Image, Mask};

/// A picture from a PNG, JPEG, TIFF, WebP or EXR file.
#[derive(Clone, Debug, Params)]
pub struct ImageFile {
    /// Longer side of the working picture; larger files are averaged down to it, smaller ones stay as they are.
    #[param(default = DEFAULT_SIZE as u32, range = 1..=16384, unit = "px")]
    pub size: u32,
}

/// A mask from a picture file: inside is white, or opaque if the file has transparency.
#[derive(Clone, Debug, Params)]
pub struct MaskFile {
    /// Longer side of the mask; larger files are averaged down to it.
    #[param(default = 4096, range = 1..=16384, unit = "px")]
    pub size: u32,
}

/// A field from an EXR file with a channel Y, as gear writes depth and ratios: samples as they are, NaN included.
#[derive(Clone, Debug, Params)]
pub struct FieldFile {}

fn options(size: u32) -> Options {
    Options {
        size: size as usize,
        limits: Limits::default(),
    }
}

fn extension(file: &FileSource) -> Option<String> {
    Some(file.as_path()?.extension()?.to_str()?.to_ascii_lowercase())
}

fn reading<T>(file: &FileSource, decode: impl FnOnce(&mut dyn Source) -> Result<T, Problem>) -> Result<T, NodeError> {
    let read = || {
        if file.as_path().is_some_and(|path| path.is_dir()) {
            return Err(Problem::Folder);
        }
        decode(&mut file.open()?)
    };
    read().map_err(|problem| NodeError::new(problem.to_string()))
}

impl Loader for ImageFile {
    const VERSION: u32 = 1;
    type Value = Image;

    fn load(&self, file: &FileSource, ctx: &Context) -> Result<Image, NodeError> {
        let loaded = reading(file, |source| {
            decode_image(source, extension(file), &options(self.size))
        })?;
        loaded.notes.into_iter().for_each(|note| ctx.note(note));
        Ok(loaded.image)
    }
}

impl Loader for MaskFile {
    const VERSION: u32 = 1;
    type Value = Mask;

    fn load(&self, file: &FileSource, ctx: &Context) -> Result<Mask, NodeError> {
        let (mask, notes) = reading(file, |source| decode_mask(source, extension(file), &options(self.size)))?;
        notes.into_iter().for_each(|note| ctx.note(note));
        Ok(mask)
    }
}

impl Loader for FieldFile {
    const VERSION: u32 = 1;
    type Value = Field;

    fn load(&self, file: &FileSource, _ctx: &Context) -> Result<Field, NodeError> {
        let bytes = file
            .read()
            .map_err(|e| NodeError::because("the file cannot be read", e))?;
        Field::decode(&bytes).map_err(|e| NodeError::new(e.to_string()))
    }
}

/// Adds the value types of this crate and their loaders to a registry.
pub fn register(registry: &mut gear_graph::Registry) {
    registry
        .loader::<ImageFile>()
        .loader::<MaskFile>()
        .loader::<FieldFile>();
}
