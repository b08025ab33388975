//! Running a graph: what is asked for, what comes back.
//!
//! ```
//! # use gear_graph::{GraphSource, Registry, Report, Run, Store};
//! # let registry = Registry::new();
//! let text = "gear: 1\ninputs: {note: Report}\noutputs: {note: note}\n";
//! let graph = GraphSource::new("note.yaml", text).check(&registry).unwrap();
//! let run = Run::new(&graph).input_value("note", Report(serde_json::json!({"x": 1})));
//! let outcome = run.go().unwrap();
//! assert_eq!(outcome.value("note").unwrap().get::<Report>().unwrap().0["x"], 1);
//! ```

mod cancel;
mod inputs;
mod jobs;
mod keys;
mod machine;
mod memory;
mod observe;
mod outcome;
mod plan;
mod report;
mod scheduler;
mod threads;
mod why;

use std::any::Any;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Instant;

pub use cancel::Cancel;
pub use inputs::{Input, RunMistake};
pub use memory::peak_memory;
pub use observe::{Event, Observer};
pub use outcome::Outcome;
pub use plan::{Plan, PlannedNode, PlannedState};
pub use report::{
    ElidedPort, Failure, FailureKind, InputSummary, MemoryReport, NodeReport, NodeStatus, OutputReport, PortReport,
    RunReport, RunStatus, StoreReport,
};

pub use threads::Threads;
pub use why::{Difference, EarlierRun, Part, Why, WhyAhead};

use crate::{AnyValue, Digest, Graph, Resources, Store, Value};

/// A run that is being set up. Nothing happens before [`Run::go`] or [`Run::plan`].
#[derive(Clone)]
pub struct Run<'g> {
    pub(crate) graph: &'g Graph,
    pub(crate) inputs: BTreeMap<String, Input>,
    pub(crate) outputs: Option<Vec<String>>,
    pub(crate) values: Values,
    pub(crate) store: Option<Arc<Store>>,
    pub(crate) jobs: usize,
    pub(crate) fresh: BTreeSet<String>,
    pub(crate) elision: bool,
    pub(crate) fail_fast: bool,
    pub(crate) memory: Option<u64>,
    pub(crate) cache_nondeterministic: bool,
    pub(crate) cancel: Cancel,
    pub(crate) observer: Option<Arc<dyn Observer>>,
    pub(crate) resources: Resources,
}

impl<'g> Run<'g> {
    /// A run of all outputs, without inputs and without a store, on all cores.
    pub fn new(graph: &'g Graph) -> Self {
        Self {
            graph,
            inputs: BTreeMap::new(),
            outputs: None,
            values: Values::Digests,
            store: None,
            jobs: std::thread::available_parallelism().map_or(1, usize::from),
            fresh: BTreeSet::new(),
            elision: true,
            fail_fast: false,
            memory: None,
            cache_nondeterministic: false,
            cancel: Cancel::new(),
            observer: None,
            resources: Resources::default(),
        }
    }

    /// Gives an input of the graph.
    pub fn input(mut self, name: impl Into<String>, input: Input) -> Self {
        self.inputs.insert(name.into(), input);
        self
    }

    /// Gives an input of the graph as a value.
    pub fn input_value(self, name: impl Into<String>, value: impl Value) -> Self {
        self.input(name, Input::Value(AnyValue::new(value)))
    }

    /// Asks for some outputs only.
    pub fn outputs<S: Into<String>>(mut self, names: impl IntoIterator<Item = S>) -> Self {
        self.outputs = Some(names.into_iter().map(Into::into).collect());
        self
    }

    /// Makes sure that the outputs' values can be had afterwards, not only their digests: what the store knows but
    /// does not hold any more is computed again. [`Outcome::value`] does this when it has to.
    pub fn with_values(mut self) -> Self {
        self.values = Values::All;
        self
    }

    /// The same, for the outputs of which `wants` says so: it is given their names and digests, must answer quickly,
    /// and equal questions must get equal answers while the run goes on. For who keeps what is made of values, and
    /// needs a value only where that is missing.
    pub fn with_values_where(mut self, wants: impl Fn(&str, &Digest) -> bool + Send + Sync + 'static) -> Self {
        self.values = Values::Where(Arc::new(wants));
        self
    }

    /// Uses a store.
    pub fn store(mut self, store: Arc<Store>) -> Self {
        self.store = Some(store);
        self
    }

    /// Uses so many threads in all, for nodes and within them.
    pub fn jobs(mut self, jobs: usize) -> Self {
        self.jobs = jobs.max(1);
        self
    }

    /// Runs this node (or loads this input) whatever the store knows of it.
    pub fn fresh(mut self, node: impl Into<String>) -> Self {
        self.fresh.insert(node.into());
        self
    }

    /// Switches elisions off: every lazy port that is wired is computed. For comparing.
    pub fn no_elision(mut self) -> Self {
        self.elision = false;
        self
    }

    /// Starts nothing more once a node has failed. Otherwise everything that does not depend on it is finished.
    pub fn fail_fast(mut self) -> Self {
        self.fail_fast = true;
        self
    }

    /// Holds back what could start while the values in memory and what the running nodes are estimated to need
    /// ([`crate::Node::memory`]) exceed so many bytes. When nothing runs, one node always starts, with a note.
    pub fn memory_limit(mut self, bytes: u64) -> Self {
        self.memory = Some(bytes);
        self
    }

    /// Stores also what nodes gave that do not promise the same bits again, and takes it from the store.
    pub fn cache_nondeterministic(mut self) -> Self {
        self.cache_nondeterministic = true;
        self
    }

    /// Interrupts the run when this is raised. A bare flag (`Arc<AtomicBool>`) serves as well; see [`Cancel`].
    pub fn cancel(mut self, cancel: impl Into<Cancel>) -> Self {
        self.cancel = cancel.into();
        self
    }

    /// Tells somebody what happens while it happens.
    pub fn observer(mut self, observer: Arc<dyn Observer>) -> Self {
        self.observer = Some(observer);
        self
    }

    /// Lends something to the nodes, such as a device: one value of each type.
    pub fn resource<T: Any + Send + Sync>(mut self, resource: T) -> Self {
        self.resources = self.resources.with(resource);
        self
    }

    /// What would run, what is stored, what is left out and why; nothing is computed.
    pub fn plan(&self) -> Result<Plan, Vec<RunMistake>> {
        let given = inputs::resolve(self)?;
        Ok(plan::plan(self, &given))
    }

    /// Why an output would run, or where its stored value came from; nothing is computed. `name` is an input, a node
    /// (all of its outputs that are needed) or `node.port`. Outputs of which the same is to be said are told together.
    pub fn why(&self, name: &str) -> Result<Vec<Why>, Vec<RunMistake>> {
        let given = inputs::resolve(self)?;
        why::why(self, &given, name).map_err(|mistake| vec![mistake])
    }

    /// Runs. `Err` is a mistake of the user, found before anything ran; a node that fails is told in the report.
    pub fn go(&self) -> Result<Outcome<'g>, Vec<RunMistake>> {
        let started = Instant::now();
        let given = inputs::resolve(self)?;
        scheduler::run(self, given, started).map_err(|mistake| vec![mistake])
    }

    /// Whether an output of the graph is asked for.
    pub(crate) fn asks_for(&self, output: &str) -> bool {
        let asked = |names: &Vec<String>| names.iter().any(|name| name == output);
        self.outputs.as_ref().is_none_or(asked)
    }
}

/// Whether somebody needs the value of the output with this name and digest.
type Wants = dyn Fn(&str, &Digest) -> bool + Send + Sync;

/// Which outputs' values a run must be able to give afterwards, and not only their digests.
#[derive(Clone)]
pub(crate) enum Values {
    /// None.
    Digests,
    /// All.
    All,
    /// Those of this name and digest.
    Where(Arc<Wants>),
}

#[cfg(test)]
pub(crate) mod tests;
