//! Procedural paintings with known depth and normals
