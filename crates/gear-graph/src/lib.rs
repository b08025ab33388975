//! Typed dataflow graphs: nodes, YAML, planning, scheduling, storing.
//!
//! The framework knows no image and no Gaussian: it is generic over [`Value`]s.

mod digest;
mod value;

pub use digest::{Digest, Hasher};
pub use value::{Summary, Value, ValueError};
