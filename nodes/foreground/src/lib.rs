//! The node foreground
