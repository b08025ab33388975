//! What the executor promises, one small test each.

mod demand;
mod durability;
mod failure;
mod invariants;
mod kit;
mod oracle;
mod scale;
