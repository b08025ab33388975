//! What is done on the threads of the pool, and what comes back from them.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Instant;

use super::inputs::Source;
use crate::node::KnownPort;
use crate::registry::{AnyLoader, AnyNode};
use crate::store::{Content, Done, Store};
use crate::{AnyValue, Context, Demand, Digest, Known, NodeError, Slot, ValueType, Want};

/// Encoded values up to about this size are encoded right where they are computed: a job of their own costs more.
const SMALL: usize = 2048;

pub(super) enum Job {
    /// Runs a node for some of its outputs.
    Run {
        slots: Vec<u32>,
        node: Arc<dyn AnyNode>,
        inputs: Vec<Slot>,
        want: Want,
        ports: Vec<usize>,
    },
    /// Loads an input from its file.
    LoadInput {
        slot: u32,
        loader: Arc<dyn AnyLoader>,
        source: Source,
        value_type: ValueType,
        /// A guess of its size in memory.
        bytes: u64,
    },
    /// Asks a node what it needs, with values.
    Decide {
        slot: u32,
        node: Arc<dyn AnyNode>,
        output: &'static str,
        ports: Vec<KnownPort>,
        values: Vec<Option<AnyValue>>,
    },
    /// Reads a value from the store.
    Load {
        slot: u32,
        digest: Digest,
        value_type: ValueType,
        /// Its size in memory.
        bytes: u64,
    },
    /// Writes a value to the store.
    Keep { value: AnyValue, done: Box<Done> },
}

/// Why a job gave nothing.
pub(super) enum Trouble {
    Error(NodeError),
    Panic(String),
}

/// Seconds of threads that went into the store rather than into the nodes' work.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StoreCost {
    /// Taking digests of values.
    pub hash: f64,
    /// Encoding and writing values.
    pub write: f64,
    /// Reading, verifying and decoding values.
    pub read: f64,
}

impl std::ops::AddAssign for StoreCost {
    fn add_assign(&mut self, other: Self) {
        self.hash += other.hash;
        self.write += other.write;
        self.read += other.read;
    }
}

/// A computed value.
pub(super) struct Computed {
    pub value: AnyValue,
    pub digest: Digest,
    /// Its encoding, if it was small enough to be encoded on the way.
    pub content: Option<Content>,
}

pub(super) enum Back {
    Ran {
        slots: Vec<u32>,
        result: Result<Vec<Computed>, Trouble>,
        seconds: f64,
        cost: StoreCost,
        notes: Vec<String>,
    },
    Decided {
        slot: u32,
        result: Result<Demand, Trouble>,
    },
    Loaded {
        slot: u32,
        value: Option<AnyValue>,
        cost: StoreCost,
    },
    Kept {
        done: Box<Done>,
        cost: StoreCost,
    },
}

impl Job {
    /// Bytes that the job is estimated to need besides the values that it reads; 0 for one that frees memory.
    pub fn memory(&self) -> u64 {
        match self {
            Self::Run { node, inputs, .. } => {
                let sizes: Vec<u64> = inputs
                    .iter()
                    .map(|slot| slot.iter().map(|value| value.size_bytes() as u64).sum())
                    .collect();
                node.memory(&sizes).unwrap_or_else(|| 2 * sizes.iter().sum::<u64>())
            }
            Self::Load { bytes, .. } => *bytes,
            Self::LoadInput { bytes, .. } => *bytes,
            Self::Decide { .. } | Self::Keep { .. } => 0,
        }
    }

    pub fn execute(self, ctx: &Context, store: Option<&Store>) -> Back {
        match self {
            Self::Run {
                slots,
                node,
                mut inputs,
                want,
                ports,
            } => {
                let started = Instant::now();
                let outputs = caught(|| node.run(&mut inputs, &want, ctx));
                let seconds = started.elapsed().as_secs_f64();
                if outputs.is_ok() {
                    ctx.forget_unfinished();
                }
                drop(inputs);
                let mut cost = StoreCost::default();
                let result = outputs.and_then(|mut outputs| {
                    caught(|| {
                        ports
                            .iter()
                            .map(|port| match outputs.get_mut(*port).and_then(Option::take) {
                                Some(value) => Ok(computed(value, store, &mut cost)),
                                None => Err(NodeError::new(format!(
                                    "the node did not compute its output number {port}, which was wanted"
                                ))),
                            })
                            .collect()
                    })
                });
                Back::Ran {
                    slots,
                    result,
                    seconds,
                    cost,
                    notes: ctx.notes(),
                }
            }
            Self::LoadInput {
                slot,
                loader,
                source,
                value_type,
                ..
            } => {
                let started = Instant::now();
                let mut cost = StoreCost::default();
                let result = caught(|| {
                    let value = loader.load(&source.open()?, ctx)?;
                    source.still_the_same()?;
                    if value.value_type() != value_type {
                        return Err(NodeError::new(format!("the loader gave a {}", value.value_type().name)));
                    }
                    Ok(vec![computed(value, store, &mut cost)])
                });
                Back::Ran {
                    slots: vec![slot],
                    result,
                    seconds: started.elapsed().as_secs_f64() - cost.hash - cost.write,
                    cost,
                    notes: ctx.notes(),
                }
            }
            Self::Decide {
                slot,
                node,
                output,
                ports,
                values,
            } => {
                let names: Vec<_> = ports.iter().map(|port| port.name).collect();
                let known = Known::new(
                    ports,
                    Box::new(move |port| {
                        values[port].clone().ok_or_else(|| NodeError::Unknown {
                            port: names[port].to_string(),
                        })
                    }),
                );
                Back::Decided {
                    slot,
                    result: caught(|| node.demand(output, &known)),
                }
            }
            Self::Load {
                slot,
                digest,
                value_type,
                ..
            } => {
                let started = Instant::now();
                let value = store.and_then(|store| store.load(&digest, &value_type));
                let read = started.elapsed().as_secs_f64();
                Back::Loaded {
                    slot,
                    value,
                    cost: StoreCost {
                        read,
                        ..StoreCost::default()
                    },
                }
            }
            Self::Keep { value, mut done } => {
                // An encoder that panics costs the stored value, not the run.
                let keep = |store: &Store| catch_unwind(AssertUnwindSafe(|| store.keep(&value))).ok().flatten();
                let started = Instant::now();
                done.content = store.and_then(keep);
                let write = started.elapsed().as_secs_f64();
                Back::Kept {
                    done,
                    cost: StoreCost {
                        write,
                        ..StoreCost::default()
                    },
                }
            }
        }
    }
}

fn computed(value: AnyValue, store: Option<&Store>, cost: &mut StoreCost) -> Computed {
    let started = Instant::now();
    let digest = value.digest();
    let hashed = Instant::now();
    let content = store
        .filter(|_| value.size_bytes() <= SMALL)
        .and_then(|store| store.keep(&value));
    cost.hash += (hashed - started).as_secs_f64();
    cost.write += hashed.elapsed().as_secs_f64();
    Computed { value, digest, content }
}

/// Runs an author's code: errors and panics come back as what they are.
fn caught<T>(run: impl FnOnce() -> Result<T, NodeError>) -> Result<T, Trouble> {
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(result)) => Ok(result),
        Ok(Err(error)) => Err(Trouble::Error(error)),
        Err(panic) => Err(Trouble::Panic(
            panic
                .downcast_ref::<&str>()
                .map(ToString::to_string)
                .or_else(|| panic.downcast_ref::<String>().cloned())
                .unwrap_or_else(|| "no message".to_string()),
        )),
    }
}
