//! The node adaptive-gain
