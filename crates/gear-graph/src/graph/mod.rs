//! Graph files.

mod suggest;

pub use suggest::nearest;
