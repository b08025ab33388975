//! Ports: what may stand as a field of a node's `Inputs` and `Outputs`.

use std::sync::Arc;

use crate::{AnyValue, NodeError, Value, ValueType};

/// A port of a node type.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct PortSpec {
    /// The name in graph files.
    pub name: &'static str,
    /// The doc comment.
    pub doc: &'static str,
    /// The type of its value.
    #[serde(rename = "type")]
    pub value_type: ValueType,
    /// An input that need not be wired.
    pub optional: bool,
    /// An input that is only computed when `demand` asks for it; an output that is only computed when wanted.
    pub lazy: bool,
    /// An input that takes a list of any length.
    pub many: bool,
}

/// The input ports of a node; derived.
pub trait Inputs: Send + Sized + 'static {
    /// The ports, in order.
    fn specs() -> Vec<PortSpec>;

    /// Takes the values, one slot a port, in order.
    fn take(slots: &mut Slots<'_>) -> Result<Self, NodeError>;

    /// The values again, one slot a port, in order.
    fn give(self) -> Vec<Slot>;
}

/// The output ports of a node; derived.
pub trait Outputs: Send + Sized + 'static {
    /// The ports, in order.
    fn specs() -> Vec<PortSpec>;

    /// The values, one slot a port, in order; `None` where it was not wanted.
    fn give(self) -> Vec<Option<AnyValue>>;
}

/// A node without outputs makes no sense, one without inputs does.
impl Inputs for () {
    fn specs() -> Vec<PortSpec> {
        Vec::new()
    }

    fn take(_: &mut Slots<'_>) -> Result<Self, NodeError> {
        Ok(())
    }

    fn give(self) -> Vec<Slot> {
        Vec::new()
    }
}

/// The values at one input port: none if it is not wired or was not demanded, one, or for a `Vec` port any number.
pub type Slot = Vec<AnyValue>;

/// The values given to a node, in the order of its input ports.
pub struct Slots<'a>(std::slice::IterMut<'a, Slot>);

impl<'a> Slots<'a> {
    /// Over the values, one slot a port.
    pub fn new(values: &'a mut [Slot]) -> Self {
        Self(values.iter_mut())
    }

    /// The next port's slot. Its values are moved out, so that a node that is their last reader owns them.
    pub fn next_port(&mut self) -> Slot {
        self.0.next().map(std::mem::take).unwrap_or_default()
    }
}

/// What may stand as a field of `Inputs`: `Arc<T>`, `Option<Arc<T>>`, `Lazy<T>`, `Option<Lazy<T>>`, `Vec<Arc<T>>`.
pub trait InputField: Sized {
    /// The port.
    fn spec(name: &'static str, doc: &'static str) -> PortSpec;

    /// The field, from its slot.
    fn take(port: &'static str, slot: Slot) -> Result<Self, NodeError>;

    /// The slot again.
    fn give(self) -> Slot;
}

/// What may stand as a field of `Outputs`: `Arc<T>` and `Wanted<T>`.
pub trait OutputField: Sized {
    /// The port.
    fn spec(name: &'static str, doc: &'static str) -> PortSpec;

    /// The value, if it was computed.
    fn give(self) -> Option<AnyValue>;
}

fn port<T: Value>(name: &'static str, doc: &'static str, optional: bool, lazy: bool) -> PortSpec {
    PortSpec {
        name,
        doc,
        value_type: ValueType::of::<T>(),
        optional,
        lazy,
        many: false,
    }
}

fn all_taken<T: Value>(port: &'static str, slot: Slot) -> Result<Vec<Arc<T>>, NodeError> {
    slot.into_iter()
        .map(|value| {
            value
                .expect()
                .map_err(|error| NodeError::input(port, error.to_string()))
        })
        .collect()
}

fn taken<T: Value>(port: &'static str, slot: Slot) -> Result<Option<Arc<T>>, NodeError> {
    all_taken(port, slot).map(|mut values| values.pop())
}

fn slot<T: Value>(value: Option<Arc<T>>) -> Slot {
    value.map(AnyValue::shared).into_iter().collect()
}

impl<T: Value> InputField for Arc<T> {
    fn spec(name: &'static str, doc: &'static str) -> PortSpec {
        port::<T>(name, doc, false, false)
    }

    fn take(port: &'static str, slot: Slot) -> Result<Self, NodeError> {
        taken(port, slot)?.ok_or_else(|| NodeError::input(port, "is required and was not given"))
    }

    fn give(self) -> Slot {
        slot(Some(self))
    }
}

impl<T: Value> InputField for Option<Arc<T>> {
    fn spec(name: &'static str, doc: &'static str) -> PortSpec {
        port::<T>(name, doc, true, false)
    }

    fn take(port: &'static str, slot: Slot) -> Result<Self, NodeError> {
        taken(port, slot)
    }

    fn give(self) -> Slot {
        slot(self)
    }
}

/// How the message of [`Lazy::demanded`] ends.
pub(crate) const NOT_DEMANDED: &str = "that its `demand` did not ask for";

/// An input that is there only when [`crate::Node::demand`] asked for it.
#[derive(Clone, Debug)]
pub struct Lazy<T>(Option<Arc<T>>);

impl<T: Value> Lazy<T> {
    /// A value that was demanded.
    pub fn given(value: impl Into<Arc<T>>) -> Self {
        Self(Some(value.into()))
    }

    /// A value that was not demanded.
    pub fn absent() -> Self {
        Self(None)
    }

    /// The value, if it was demanded.
    pub fn get(&self) -> Option<&Arc<T>> {
        self.0.as_ref()
    }

    /// The value; an error if it was not demanded (then `demand` and `run` disagree: a mistake in the node).
    pub fn demanded(&self) -> Result<&Arc<T>, NodeError> {
        self.0
            .as_ref()
            .ok_or_else(|| NodeError::new(format!("the node reads a {} {NOT_DEMANDED}", T::TYPE)))
    }
}

impl<T: Value> InputField for Lazy<T> {
    fn spec(name: &'static str, doc: &'static str) -> PortSpec {
        port::<T>(name, doc, false, true)
    }

    fn take(port: &'static str, slot: Slot) -> Result<Self, NodeError> {
        taken(port, slot).map(Self)
    }

    fn give(self) -> Slot {
        slot(self.0)
    }
}

impl<T: Value> InputField for Option<Lazy<T>> {
    fn spec(name: &'static str, doc: &'static str) -> PortSpec {
        port::<T>(name, doc, true, true)
    }

    fn take(port: &'static str, slot: Slot) -> Result<Self, NodeError> {
        Ok(taken(port, slot)?.map(|value| Lazy(Some(value))))
    }

    fn give(self) -> Slot {
        slot(self.and_then(|lazy| lazy.0))
    }
}

impl<T: Value> InputField for Vec<Arc<T>> {
    fn spec(name: &'static str, doc: &'static str) -> PortSpec {
        PortSpec {
            many: true,
            ..port::<T>(name, doc, true, false)
        }
    }

    fn take(port: &'static str, slot: Slot) -> Result<Self, NodeError> {
        all_taken(port, slot)
    }

    fn give(self) -> Slot {
        self.into_iter().map(AnyValue::shared).collect()
    }
}

impl<T: Value> OutputField for Arc<T> {
    fn spec(name: &'static str, doc: &'static str) -> PortSpec {
        port::<T>(name, doc, false, false)
    }

    fn give(self) -> Option<AnyValue> {
        Some(AnyValue::shared(self))
    }
}

/// An output that is computed only if it is wanted; made by [`Want::compute`].
#[derive(Clone, Debug)]
pub struct Wanted<T>(Option<Arc<T>>);

impl<T: Value> Wanted<T> {
    /// A computed value.
    pub fn value(value: impl Into<Arc<T>>) -> Self {
        Self(Some(value.into()))
    }

    /// Not wanted, not computed.
    pub fn skipped() -> Self {
        Self(None)
    }

    /// The value, if it was computed.
    pub fn get(&self) -> Option<&Arc<T>> {
        self.0.as_ref()
    }

    /// The value.
    ///
    /// # Panics
    /// If it was not wanted.
    pub fn unwrap(self) -> Arc<T> {
        match self.0 {
            Some(value) => value,
            None => panic!("this {} was not wanted, so it was not computed", T::TYPE),
        }
    }
}

impl<T: Value> From<T> for Wanted<T> {
    fn from(value: T) -> Self {
        Self::value(value)
    }
}

impl<T: Value> OutputField for Wanted<T> {
    fn spec(name: &'static str, doc: &'static str) -> PortSpec {
        port::<T>(name, doc, false, true)
    }

    fn give(self) -> Option<AnyValue> {
        self.0.map(AnyValue::shared)
    }
}

/// Which outputs are wanted.
#[derive(Clone, Debug)]
pub struct Want {
    ports: Vec<(&'static str, bool)>,
}

impl Want {
    /// All outputs of `O`.
    pub fn all<O: Outputs>() -> Self {
        Self::these::<O>(|_| true)
    }

    /// The outputs of `O` whose names are listed.
    pub fn only<O: Outputs>(names: &[&str]) -> Self {
        Self::these::<O>(|name| names.contains(&name))
    }

    fn these<O: Outputs>(wanted: impl Fn(&str) -> bool) -> Self {
        Self::from_ports(O::specs().iter().map(|port| (port.name, wanted(port.name))).collect())
    }

    pub(crate) fn from_ports(ports: Vec<(&'static str, bool)>) -> Self {
        Self { ports }
    }

    /// Whether the output is wanted.
    ///
    /// # Panics
    /// If the node has no such output: a misspelt name in the node's code.
    pub fn has(&self, output: &str) -> bool {
        match self.ports.iter().find(|(name, _)| *name == output) {
            Some((_, wanted)) => *wanted,
            None => panic!("the node has no output `{output}`"),
        }
    }

    /// Computes the output if it is wanted.
    pub fn compute<T: Value>(&self, output: &str, compute: impl FnOnce() -> T) -> Wanted<T> {
        if self.has(output) {
            Wanted::value(compute())
        } else {
            Wanted::skipped()
        }
    }

    /// Computes the output if it is wanted, or fails.
    pub fn try_compute<T: Value, E>(
        &self,
        output: &str,
        compute: impl FnOnce() -> Result<T, E>,
    ) -> Result<Wanted<T>, E> {
        if self.has(output) {
            compute().map(Wanted::value)
        } else {
            Ok(Wanted::skipped())
        }
    }
}
