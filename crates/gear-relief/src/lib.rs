//! From picture to surface: mask, inflation, light fit, shape from shading, surfels
