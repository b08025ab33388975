//! The node metrics
