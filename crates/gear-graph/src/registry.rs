//! The node types, value types and loaders that a graph may use. Filled explicitly: a registry that fills itself at
//! link time is silently empty when nothing names the crate.

use std::collections::BTreeMap;
use std::panic::{RefUnwindSafe, UnwindSafe};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::{
    AnyValue, Context, Demand, Digest, Fields, FileSource, Hasher, Inputs, Known, Loader, Node, NodeError, Number,
    Numerics, Outputs, ParamSpec, ParamValues, PortSpec, Report, Resources, Slot, Slots, Value, ValueType, Want,
};

/// A node type as people and tools see it.
#[derive(Clone, Debug, serde::Serialize)]
pub struct NodeSpec {
    /// [`Node::NAME`].
    pub name: &'static str,
    /// [`Node::VERSION`].
    pub version: u32,
    /// The doc comment of the parameter struct.
    pub doc: &'static str,
    /// Whether equal inputs give equal bits.
    pub deterministic: bool,
    /// [`Node::KEPT`].
    pub kept: bool,
    /// Everything that its results' bits depend on besides the version, sorted.
    pub numerics: Vec<Numerics>,
    /// Input ports, in order.
    pub inputs: Vec<PortSpec>,
    /// Output ports, in order.
    pub outputs: Vec<PortSpec>,
    /// Parameters, in order.
    pub params: Vec<ParamSpec>,
    /// What the node comes from, if it is not part of the program: a plugin's name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plugin: Option<&'static str>,
}

impl NodeSpec {
    /// The description of `N`.
    pub fn of<N: Node>() -> Self {
        let (inputs, outputs) = (N::Inputs::specs(), N::Outputs::specs());
        Self {
            name: N::NAME,
            version: N::VERSION,
            doc: N::DOC,
            deterministic: N::DETERMINISTIC,
            kept: N::KEPT,
            numerics: numerics(N::USES, inputs.iter().chain(&outputs).map(|port| port.value_type)),
            inputs,
            outputs,
            params: N::specs(),
            plugin: None,
        }
    }
}

/// A loader as people and tools see it.
#[derive(Clone, Debug, serde::Serialize)]
pub struct LoaderSpec {
    /// The type of value that it makes.
    #[serde(rename = "type")]
    pub value_type: ValueType,
    /// [`Loader::VERSION`].
    pub version: u32,
    /// The doc comment of the parameter struct.
    pub doc: &'static str,
    /// Everything that its results' bits depend on besides the version, sorted.
    pub numerics: Vec<Numerics>,
    /// Parameters, in order.
    pub params: Vec<ParamSpec>,
}

/// A node with its parameters, of whatever type.
pub(crate) trait AnyNode: Send + Sync {
    fn params(&self) -> ParamValues;
    fn realm(&self, resources: &Resources) -> String;
    fn check(&self) -> Result<(), NodeError>;
    fn memory(&self, inputs: &[u64]) -> Option<u64>;
    fn demand(&self, output: &str, known: &Known<'_>) -> Result<Demand, NodeError>;
    fn run(&self, inputs: &mut [Slot], want: &Want, ctx: &Context) -> Result<Vec<Option<AnyValue>>, NodeError>;
}

impl<N: Node> AnyNode for N {
    fn params(&self) -> ParamValues {
        self.write()
    }

    fn realm(&self, resources: &Resources) -> String {
        Node::realm(self, resources)
    }

    fn check(&self) -> Result<(), NodeError> {
        Node::check(self)
    }

    fn memory(&self, inputs: &[u64]) -> Option<u64> {
        Node::memory(self, inputs)
    }

    fn demand(&self, output: &str, known: &Known<'_>) -> Result<Demand, NodeError> {
        Node::demand(self, output, known)
    }

    fn run(&self, inputs: &mut [Slot], want: &Want, ctx: &Context) -> Result<Vec<Option<AnyValue>>, NodeError> {
        let inputs = N::Inputs::take(&mut Slots::new(inputs))?;
        Node::run(self, inputs, want, ctx).map(Outputs::give)
    }
}

/// A loader with its parameters, of whatever type.
pub(crate) trait AnyLoader: Send + Sync {
    fn params(&self) -> ParamValues;
    fn check(&self) -> Result<(), NodeError>;
    fn beside(&self, path: &Path) -> Vec<PathBuf>;
    fn load(&self, file: &FileSource, ctx: &Context) -> Result<AnyValue, NodeError>;
}

impl<L: Loader> AnyLoader for L {
    fn params(&self) -> ParamValues {
        self.write()
    }

    fn check(&self) -> Result<(), NodeError> {
        Loader::check(self)
    }

    fn beside(&self, path: &Path) -> Vec<PathBuf> {
        Loader::beside(self, path)
    }

    fn load(&self, file: &FileSource, ctx: &Context) -> Result<AnyValue, NodeError> {
        Loader::load(self, file, ctx).map(AnyValue::new)
    }
}

type ReadNode = Arc<dyn Fn(&mut Fields<'_, '_>) -> Option<Arc<dyn AnyNode>> + Send + Sync>;
/// Sets of ports are kept as bits of one word.
pub(crate) const MOST_PORTS: usize = 64;

type ReadLoader = fn(&mut Fields<'_, '_>) -> Option<Arc<dyn AnyLoader>>;

/// A registered node type.
#[derive(Clone)]
pub struct NodeType {
    /// What people and tools see of it.
    pub spec: Arc<NodeSpec>,
    pub(crate) read: ReadNode,
}

// Reading parameters changes nothing, so a panic in it leaves nothing half changed.
impl UnwindSafe for NodeType {}
impl RefUnwindSafe for NodeType {}

/// A registered loader.
#[derive(Clone)]
pub struct LoaderType {
    /// What people and tools see of it.
    pub spec: Arc<LoaderSpec>,
    pub(crate) read: ReadLoader,
}

/// The node types, value types and loaders that a graph may use.
#[derive(Clone)]
pub struct Registry {
    nodes: BTreeMap<&'static str, NodeType>,
    values: BTreeMap<&'static str, ValueType>,
    loaders: BTreeMap<&'static str, LoaderType>,
}

impl Default for Registry {
    fn default() -> Self {
        Self::new()
    }
}

impl Registry {
    /// A registry with the framework's own values, [`Number`] and [`Report`].
    pub fn new() -> Self {
        let mut registry = Self {
            nodes: BTreeMap::new(),
            values: BTreeMap::new(),
            loaders: BTreeMap::new(),
        };
        registry.value::<Number>().value::<Report>();
        registry
    }

    /// Adds a node type and the value types of its ports.
    ///
    /// # Panics
    /// If another node type or value type has the same name, or the node has more than 64 ports on one side: mistakes
    /// in the list of registrations.
    pub fn node<N: Node>(&mut self) -> &mut Self {
        let spec = NodeSpec::of::<N>();
        for port in spec.inputs.iter().chain(&spec.outputs) {
            self.add_value(port.value_type);
        }
        assert!(
            spec.inputs.len() <= MOST_PORTS && spec.outputs.len() <= MOST_PORTS,
            "`{}` has more than {MOST_PORTS} ports",
            N::NAME
        );
        let node_type = NodeType {
            spec: Arc::new(spec),
            read: Arc::new(|fields| N::read(fields).map(|node| Arc::new(node) as Arc<dyn AnyNode>)),
        };
        let before = self.nodes.insert(N::NAME, node_type);
        assert!(before.is_none(), "two node types are named `{}`", N::NAME);
        self
    }

    /// Adds a value type that no registered node has at a port.
    ///
    /// # Panics
    /// If another value type has the same name.
    pub fn value<T: Value>(&mut self) -> &mut Self {
        self.add_value(ValueType::of::<T>());
        self
    }

    /// Adds the loader of a value type, so that graphs may have inputs of that type given as files.
    ///
    /// # Panics
    /// If the type has a loader already.
    pub fn loader<L: Loader>(&mut self) -> &mut Self {
        let value_type = ValueType::of::<L::Value>();
        self.add_value(value_type);
        let spec = LoaderSpec {
            value_type,
            version: L::VERSION,
            doc: L::DOC,
            numerics: numerics(L::USES, [value_type]),
            params: L::specs(),
        };
        let loader = LoaderType {
            spec: Arc::new(spec),
            read: |fields| L::read(fields).map(|loader| Arc::new(loader) as Arc<dyn AnyLoader>),
        };
        let before = self.loaders.insert(value_type.name, loader);
        assert!(before.is_none(), "two loaders make a {}", value_type.name);
        self
    }

    /// Identifies everything that a graph file may name: node types, ports, parameters, loaders and their versions.
    pub fn digest(&self) -> Digest {
        let nodes: Vec<_> = self.nodes().map(|node| &node.spec).collect();
        let loaders: Vec<_> = self.loaders().map(|loader| &loader.spec).collect();
        let values: Vec<_> = self.values().map(|value| value.name).collect();
        // Specs are plain data: they have no keys that JSON cannot write.
        let specs = serde_json::to_vec(&(nodes, loaders, values)).unwrap_or_default();
        Hasher::new("registry")
            .bytes(env!("CARGO_PKG_VERSION").as_bytes())
            .bytes(&specs)
            .finish()
    }

    /// Adds what [`Registry::foreign`] has checked.
    pub(crate) fn insert_checked(&mut self, node_type: NodeType) {
        self.nodes.insert(node_type.spec.name, node_type);
    }

    fn add_value(&mut self, value_type: ValueType) {
        let before = self.values.insert(value_type.name, value_type);
        assert!(
            before.is_none_or(|before| before == value_type),
            "two value types are named `{}`",
            value_type.name
        );
    }

    /// The node types, sorted by name.
    pub fn nodes(&self) -> impl Iterator<Item = &NodeType> {
        self.nodes.values()
    }

    /// The value types, sorted by name.
    pub fn values(&self) -> impl Iterator<Item = &ValueType> {
        self.values.values()
    }

    /// The loaders, sorted by the name of their value type.
    pub fn loaders(&self) -> impl Iterator<Item = &LoaderType> {
        self.loaders.values()
    }

    /// The node type of that name.
    pub fn find_node(&self, name: &str) -> Option<&NodeType> {
        self.nodes.get(name)
    }

    /// The value type of that name.
    pub fn find_value(&self, name: &str) -> Option<ValueType> {
        self.values.get(name).copied()
    }

    /// The loader of that value type.
    pub fn find_loader(&self, value_type: &str) -> Option<&LoaderType> {
        self.loaders.get(value_type)
    }
}

pub(crate) fn numerics(uses: &[Numerics], types: impl IntoIterator<Item = ValueType>) -> Vec<Numerics> {
    let mut all: Vec<_> = uses
        .iter()
        .copied()
        .chain(types.into_iter().map(|value_type| value_type.numerics))
        .filter(|numerics| !numerics.name.is_empty())
        .collect();
    all.sort_unstable();
    all.dedup();
    all
}
