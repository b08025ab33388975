//! Files: scenes as 3DGS PLY, views as layered OpenEXR.

pub mod ply;
pub mod views_exr;
