#![doc = include_str!("../README.md")]

// The derive macros name this crate `::gear_graph`, also when they are used within it.
extern crate self as gear_graph;

mod any;
mod digest;
mod foreign;
pub mod graph;
mod node;
mod params;
mod registry;
mod run;
mod store;
pub mod testing;
mod value;
mod values;

pub use any::{AnyValue, ValueType};
pub use digest::{Digest, Hasher};
pub use foreign::{Foreign, ForeignRefusal, interned};
pub use gear_graph_derive::{Choice, Inputs, Outputs, Params};
pub use graph::{Graph, GraphFile, GraphInput, GraphNode, GraphOutput, GraphSource, Library, Mistakes, Unreadable};
pub use node::{
    Context, Demand, FileSource, InputField, Inputs, Known, Lazy, Loader, Node, NodeError, Numerics, OutputField,
    Outputs, PortSpec, Progress, Resources, Slot, Slots, Unfinished, Want, Wanted,
};
pub use params::{
    Bound, Fields, Limits, OrAuto, Param, ParamKind, ParamSpec, ParamValue, ParamValues, Params, Problem, Reader,
    Severity, Span, Spanned, Tree, TreeKind, Variant, tagged,
};
pub use registry::{LoaderSpec, LoaderType, NodeSpec, NodeType, Registry};
pub use run::{
    Cancel, Difference, EarlierRun, ElidedPort, Event, Failure, FailureKind, Input, InputSummary, MemoryReport,
    NodeReport, NodeStatus, Observer, Outcome, OutputReport, Part, Plan, PlannedNode, PlannedState, PortReport, Run,
    RunMistake, RunReport, RunStatus, StoreReport, Threads, Why, WhyAhead, peak_memory,
};
pub use store::{ArchiveError, Archived, Collected, DEFAULT_STORE_LIMIT, Store, StoreStat, TypeStat, Verified};
pub use value::{Summary, Value, ValueError};
pub use values::{Number, Report, ReportFile};
