//! The node enhance
