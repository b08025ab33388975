//! The node edit
