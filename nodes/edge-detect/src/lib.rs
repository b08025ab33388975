//! The node edge-detect
