//! The binary `gear`.
fn main() {}
