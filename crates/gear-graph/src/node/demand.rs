//! What an output needs: a pure function, never a side effect of running.

use std::borrow::Cow;
use std::sync::Arc;

use crate::{AnyValue, Inputs, NodeError, Value};

/// The answer of [`crate::Node::demand`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Demand {
    /// These lazy ports are needed too. Never empty, never ports that are known already or not wired.
    Need {
        /// The ports.
        ports: Vec<&'static str>,
        /// Why, such as `beta = 0.5`.
        reason: Cow<'static, str>,
    },
    /// Nothing more is needed.
    Ready {
        /// Why the ports that were never asked for are not needed; empty when there are none.
        reason: Cow<'static, str>,
    },
}

impl Demand {
    /// These ports are needed too, because of `reason`.
    pub fn need(ports: &[&'static str], reason: impl Into<Cow<'static, str>>) -> Self {
        Self::Need {
            ports: ports.to_vec(),
            reason: reason.into(),
        }
    }

    /// Nothing more is needed.
    pub fn ready() -> Self {
        Self::Ready { reason: "".into() }
    }

    /// Nothing more is needed; the ports left out are not, because of `reason` (shown to the user).
    pub fn ready_because(reason: impl Into<Cow<'static, str>>) -> Self {
        Self::Ready { reason: reason.into() }
    }
}

/// How a [`Known`] gets at a value.
pub(crate) type Fetch<'a> = dyn Fn(usize) -> Result<AnyValue, NodeError> + 'a;

/// What `demand` may look at: which ports are wired, which are known, and the values of the known ones.
pub struct Known<'a> {
    /// In the order of the input ports.
    ports: Vec<KnownPort>,
    fetch: Box<Fetch<'a>>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct KnownPort {
    pub name: &'static str,
    pub lazy: bool,
    pub wired: bool,
    pub known: bool,
}

impl<'a> Known<'a> {
    pub(crate) fn new(ports: Vec<KnownPort>, fetch: Box<Fetch<'a>>) -> Self {
        Self { ports, fetch }
    }

    /// For tests of `demand`: the values that are known; every port is wired.
    pub fn of<I: Inputs>(values: Vec<(&'static str, AnyValue)>) -> Known<'static> {
        let ports = I::specs()
            .iter()
            .map(|port| KnownPort {
                name: port.name,
                lazy: port.lazy,
                wired: true,
                known: values.iter().any(|(name, _)| *name == port.name),
            })
            .collect::<Vec<_>>();
        let names: Vec<_> = ports.iter().map(|port| port.name).collect();
        Known::new(
            ports,
            Box::new(move |i| {
                values
                    .iter()
                    .find(|(name, _)| *name == names[i])
                    .map(|(_, value)| value.clone())
                    .ok_or_else(|| NodeError::Unknown {
                        port: names[i].to_string(),
                    })
            }),
        )
    }

    fn index(&self, port: &str) -> Result<usize, NodeError> {
        self.ports.iter().position(|p| p.name == port).ok_or_else(|| {
            NodeError::new(format!(
                "`demand` asks about `{port}`, which is no input port of the node"
            ))
        })
    }

    /// Whether something is wired to the port.
    pub fn is_wired(&self, port: &str) -> bool {
        self.index(port).is_ok_and(|i| self.ports[i].wired)
    }

    /// Whether the port's value may be taken: it is always needed, or was asked for in an earlier answer.
    pub fn has(&self, port: &str) -> bool {
        self.index(port).is_ok_and(|i| self.ports[i].known)
    }

    /// The value at a known port. Hand the error on: it also says that a plan is made without values.
    pub fn get<T: Value>(&self, port: &str) -> Result<Arc<T>, NodeError> {
        let i = self.index(port)?;
        if !self.ports[i].known {
            return Err(NodeError::Unknown { port: port.to_string() });
        }
        Ok((self.fetch)(i)?.expect()?)
    }

    /// The lazy ports that are wired and not known yet.
    pub fn lazy_unknown(&self) -> Vec<&'static str> {
        self.ports
            .iter()
            .filter(|p| p.lazy && p.wired && !p.known)
            .map(|p| p.name)
            .collect()
    }

    /// `Need` for those of `ports` that are wired and not known yet, or `Ready` when there are none.
    pub fn need(&self, ports: &[&'static str], reason: impl Into<Cow<'static, str>>) -> Demand {
        let ports: Vec<_> = self.lazy_unknown().into_iter().filter(|p| ports.contains(p)).collect();
        if ports.is_empty() {
            Demand::ready()
        } else {
            Demand::Need {
                ports,
                reason: reason.into(),
            }
        }
    }
}
