//! The node recompose
