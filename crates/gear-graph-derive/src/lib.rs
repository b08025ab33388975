//! Derive macros of node definitions
