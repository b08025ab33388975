//! The node log-ratio
