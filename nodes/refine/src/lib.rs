//! The node refine
