//! The node reconstruct
