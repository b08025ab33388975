#![doc = include_str!("../README.md")]

mod absent;
mod claims;
mod conformance;
mod describe;
mod error;
mod fingerprint;
mod lines;
mod manifest;
mod plugin;
mod scratch;
mod worker;

pub use absent::register_absent;
pub use conformance::{Finding, conformance};
pub use describe::{
    Bounds, KindDescription, NodeDescription, NodesFile, ParamDescription, PortDescription, VariantDescription,
};
pub use error::{Failure, PluginError};
pub use fingerprint::fingerprint;
pub use manifest::{Environment, FILE_NAME, Limits, Manifest, Resources, Timeouts};
pub use plugin::Plugin;
pub use worker::{Hello, PROTOCOL};
