//! The node pyramid
