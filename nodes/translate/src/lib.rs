//! The node translate
