//! A node under test, its Rust type forgotten.

use std::sync::Arc;

use crate::node::KnownPort;
use crate::registry::AnyNode;
use crate::{
    AnyValue, Context, Demand, Digest, Known, Node, NodeError, NodeSpec, NodeType, ParamKind, Problem, Slot, Want,
    tagged,
};

/// Digests of a node's outputs, or its error.
type Answered = Result<Vec<Option<Digest>>, String>;

/// A node with its parameters, under test.
#[derive(Clone)]
pub struct Subject {
    pub(super) node: Arc<dyn AnyNode>,
    pub(super) spec: Arc<NodeSpec>,
    /// The node's name, and the method it runs with if that is not the default.
    pub(super) title: String,
}

/// What came out of a run, and its notes: all that must be the same in another run.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Bits {
    pub outputs: Vec<(&'static str, Option<Digest>)>,
    pub notes: Vec<String>,
}

impl Subject {
    /// A node.
    pub fn new<N: Node>(node: &N) -> Self {
        Self {
            node: Arc::new(node.clone()),
            spec: Arc::new(NodeSpec::of::<N>()),
            title: N::NAME.to_owned(),
        }
    }

    /// A registered node type, with parameters as a graph gives them; the mistakes in these if there are any.
    pub fn of(node_type: &NodeType, params: &serde_json::Value) -> Result<Self, Vec<Problem>> {
        Ok(Self {
            node: super::read_with(params, |fields| (node_type.read)(fields))?,
            spec: Arc::clone(&node_type.spec),
            title: node_type.spec.name.to_owned(),
        })
    }

    /// A registered node type with its default parameters but for `params`, and with each method of each of its choices
    /// that these do not set.
    ///
    /// # Panics
    /// If the parameters are refused, or one that must be given is not.
    pub fn with_every_method(node_type: &NodeType, params: &serde_json::Value) -> Vec<Self> {
        let read = |title: String, params: &serde_json::Value| {
            let subject = Self::of(node_type, params).unwrap_or_else(|problems| {
                let causes: Vec<_> = problems.iter().map(|p| p.message.as_str()).collect();
                panic!("{title} cannot be tested with {params}: {}", causes.join("; "))
            });
            Self { title, ..subject }
        };
        let name = node_type.spec.name;
        let mut subjects = vec![read(name.to_owned(), params)];
        for param in &node_type.spec.params {
            let ParamKind::Choice { variants } = &param.kind else {
                continue;
            };
            for variant in variants.iter().filter(|_| params.get(param.name).is_none()) {
                let method = if variant.params.is_empty() {
                    variant.name.into()
                } else {
                    tagged(variant.name, Default::default())
                };
                let is_default = |default: &serde_json::Value| {
                    *default == method || default.as_object().is_some_and(|tag| tag.contains_key(variant.name))
                };
                // A method that must be told more has no defaults; its author tests it.
                let told = variant.params.iter().all(|p| p.default.is_some());
                if told && !param.default.as_ref().is_some_and(is_default) {
                    let title = format!("{name} with {}: {}", param.name, variant.name);
                    let mut params = params.clone();
                    params[param.name] = method;
                    subjects.push(read(title, &params));
                }
            }
        }
        subjects
    }

    /// What people and tools see of the node.
    pub fn spec(&self) -> &NodeSpec {
        &self.spec
    }

    /// Its answers to the first extreme cases that the types of its inputs declare: what each case is, and the digests of
    /// the outputs or the error. To be compared with those of another process, or another machine.
    pub fn answers(&self, most: usize) -> Vec<(String, Answered)> {
        let cases = super::cases::together(&self.spec.inputs);
        let answer = |case: super::cases::Case| {
            let run = self.run(case.inputs, &self.want(|_| true), &Context::detached());
            let digests = |outputs: Vec<Option<AnyValue>>| {
                outputs
                    .iter()
                    .map(|value| value.as_ref().map(AnyValue::digest))
                    .collect()
            };
            (case.name, run.map(digests).map_err(|error| error.to_string()))
        };
        cases.into_iter().take(most).map(answer).collect()
    }

    pub(super) fn want(&self, wanted: impl Fn(&str) -> bool) -> Want {
        let ports = self.spec.outputs.iter();
        Want::from_ports(ports.map(|port| (port.name, wanted(port.name))).collect())
    }

    /// Runs on exactly these inputs: one slot a port.
    pub(super) fn run(
        &self,
        mut inputs: Vec<Slot>,
        want: &Want,
        ctx: &Context,
    ) -> Result<Vec<Option<AnyValue>>, NodeError> {
        self.node.run(&mut inputs, want, ctx)
    }

    pub(super) fn bits(&self, outputs: &[Option<AnyValue>], ctx: &Context) -> Bits {
        let ports = self.spec.outputs.iter().map(|port| port.name);
        Bits {
            outputs: ports
                .zip(outputs.iter().map(|value| value.as_ref().map(AnyValue::digest)))
                .collect(),
            notes: ctx.notes(),
        }
    }

    /// Of the inputs those that a graph would give to a run with all outputs wanted: lazy ports only if `demand` asks
    /// for them. An error of `demand`, or what it does wrong.
    pub(super) fn demanded(&self, inputs: &[Slot]) -> Result<Result<Vec<Slot>, NodeError>, String> {
        let ports = &self.spec.inputs;
        let mut given: Vec<bool> = ports.iter().map(|port| !port.lazy).collect();
        for output in &self.spec.outputs {
            let mut known: Vec<bool> = ports.iter().map(|port| !port.lazy).collect();
            loop {
                let seen = ports.iter().enumerate().map(|(i, port)| KnownPort {
                    name: port.name,
                    lazy: port.lazy,
                    wired: !inputs[i].is_empty(),
                    known: known[i] && !inputs[i].is_empty(),
                });
                let fetch = |i: usize| {
                    inputs[i]
                        .first()
                        .cloned()
                        .ok_or_else(|| NodeError::Unknown { port: String::new() })
                };
                let demand = self
                    .node
                    .demand(output.name, &Known::new(seen.collect(), Box::new(fetch)));
                match demand {
                    Err(error) => return Ok(Err(error)),
                    Ok(Demand::Ready { .. }) => break,
                    Ok(Demand::Need { ports: names, .. }) => {
                        let asked: Vec<usize> = (0..ports.len())
                            .filter(|&i| names.contains(&ports[i].name))
                            .filter(|&i| ports[i].lazy && !inputs[i].is_empty() && !known[i])
                            .collect();
                        if asked.len() != names.len() || names.is_empty() {
                            return Err(format!(
                                "`demand` asks for {names:?} for `{}`; it may ask only for lazy ports that are wired and \
                                 not known yet, and for at least one",
                                output.name
                            ));
                        }
                        asked.into_iter().for_each(|i| known[i] = true);
                    }
                }
            }
            given.iter_mut().zip(known).for_each(|(given, known)| *given |= known);
        }
        let slots = inputs.iter().zip(given);
        Ok(Ok(slots
            .map(|(slot, given)| if given { slot.clone() } else { Slot::new() })
            .collect()))
    }
}
