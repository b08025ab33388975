//! Networks in ONNX files, run by the ONNX Runtime library that is found when the first one runs.
//!
//! ```text
//! model.onnx + model.yaml ─ ModelFile ─ Model ─┐
//!                     picture, mask, edges … ──┴─ answer: tensor in ─ session ─ tensor out ─ fields
//! ```
//!
//! A network is a value of the graph ([`Model`]) and comes as an input of type `Model`; so keys hold its content and
//! never its path. What goes into it and what comes out is declared in YAML beside the file ([`Declaration`]): a new
//! network needs no code. A few that are published are known by name ([`Familiar`]). Without the library everything else works, and a node that asks a network says how to get
//! it ([`library`]).
//!
//! *What a network gives is not trusted.* Shapes and types are compared with the declaration before and after it runs,
//! sizes are limited, samples that are not finite are an error, a model cannot read other files, and a run that is
//! interrupted stops the network.

mod answer;
pub mod declaration;
mod dylib;
mod error;
mod familiar;
pub mod library;
mod model;
mod planes;
pub mod proto;
mod provider;
mod session;
pub mod testing;

pub use answer::{Given, MODEL_PORT, answer, demand, missing, required};
pub use declaration::{Answer, Channel, Declaration};
pub use error::OnnxError;
pub use familiar::Familiar;
pub use library::LibraryFile;
pub use model::{Model, ModelFile};
pub use provider::Provider;

use gear_graph::{Registry, Resources};

/// Version of what surrounds the network: preparation and interpretation. Part of every model's digest, so that raising
/// it touches the results of networks only.
pub(crate) const NUMERICS: u32 = 2;

/// Where the bits of a network's results are valid: `ort:VERSION:PROVIDER`.
///
/// Without the library the version is `missing`: results made with it stay under their own keys.
pub fn realm(resources: &Resources, provider: Provider) -> String {
    match library::open(resources) {
        Ok(library) => format!("ort:{}:{}", library.version(), provider.name()),
        Err(error) => {
            tracing::debug!(%error, "no ONNX Runtime");
            format!("ort:missing:{}", provider.name())
        }
    }
}

/// Adds the type of networks and its loader to a registry.
pub fn register(registry: &mut Registry) {
    registry.loader::<ModelFile>();
}
