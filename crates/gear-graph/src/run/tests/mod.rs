//! What the executor promises, one small test each.

mod demand;
mod durability;
mod failure;
mod invariants;
pub(crate) mod kit;
mod memory;
mod oracle;
mod scale;
mod why;
