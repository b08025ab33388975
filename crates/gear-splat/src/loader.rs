//! Scene files as inputs of a graph.

use gear_graph::{Context, FileSource, Loader, NodeError, Params, Registry};

use crate::{Scene, formats};

/// A Gaussian scene from a 3DGS PLY, PlayCanvas compressed PLY, SPZ or .splat file, told apart by content.
#[derive(Clone, Debug, Params)]
pub struct SceneFile {
    /// Whether y points downwards in the file, as it usually does in scenes made from photographs; the scene is turned over.
    #[param(default = false)]
    pub y_down: bool,
}

impl Loader for SceneFile {
    const VERSION: u32 = 2;
    type Value = Scene;

    fn load(&self, file: &FileSource, ctx: &Context) -> Result<Scene, NodeError> {
        let loaded = match file.as_path() {
            Some(path) => formats::open(path),
            None => file.read().map_err(Into::into).and_then(|bytes| formats::read(&bytes)),
        };
        let loaded = loaded.map_err(|e| NodeError::new(e.to_string()))?;
        loaded.notes.into_iter().for_each(|note| ctx.note(note));
        Ok(if self.y_down {
            loaded.scene.turned_over()
        } else {
            loaded.scene
        })
    }
}

/// Adds the value types of this crate and the loader of scenes to a registry.
pub fn register(registry: &mut Registry) {
    registry.loader::<SceneFile>().value::<crate::Views>();
}
