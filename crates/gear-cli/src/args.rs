//! The arguments.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use gear_splat::DeviceChoice;

use crate::commands::new_plugin::NewPluginArgs;
use crate::commands::plugin::PluginCommand;

const AFTER: &str = "\
Begin with:
  gear run @gear --input painting=sample:court-lady --out out

Exit codes:
  0    all is done
  1    a node failed, or a result could not be written
  2    something in the command or its files must be mended; nothing was written of what depends on it
  130  interrupted; the next run goes on from what is stored";

/// Turns one classical painting into an explorable 3D Gaussian scene, by running a graph of typed nodes.
#[derive(Debug, Parser)]
#[command(name = "gear", version, max_term_width = 100, after_help = AFTER)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// A folder with nodes in another language; may be given several times. Its program runs as you
    #[arg(long = "plugin", value_name = "DIR", global = true)]
    pub plugins: Vec<PathBuf>,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run a graph and write what it puts out
    Run(RunArgs),
    /// Find every mistake in a graph file, without running it
    Check(CheckArgs),
    /// Tell what a run would do: what runs, what is stored, what is left out and why
    ///
    /// Takes the arguments of `gear run` and writes nothing.
    #[command(
        mut_arg("out", |arg| arg.hide(true)),
        mut_arg("force", |arg| arg.hide(true)),
        mut_arg("quiet", |arg| arg.hide(true)),
        mut_arg("keep_going", |arg| arg.hide(true)),
        mut_arg("fail_fast", |arg| arg.hide(true)),
        mut_arg("memory", |arg| arg.hide(true))
    )]
    Plan(RunArgs),
    /// Tell why a node would run, or which run its stored results came from
    ///
    /// Takes the arguments of `gear run`, and computes nothing: compares with what the store remembers.
    #[command(
        mut_arg("out", |arg| arg.hide(true)),
        mut_arg("force", |arg| arg.hide(true)),
        mut_arg("quiet", |arg| arg.hide(true)),
        mut_arg("keep_going", |arg| arg.hide(true)),
        mut_arg("fail_fast", |arg| arg.hide(true)),
        mut_arg("memory", |arg| arg.hide(true))
    )]
    Why(WhyArgs),
    /// Look after the store: how much it holds, what is damaged, what to carry to another machine
    #[command(subcommand)]
    Cache(CacheCommand),
    /// List the nodes, or show a node or a kind of input: ports, parameters, ranges, units
    Nodes(NodesArgs),
    /// Write the crate of a new node, registered, documented and tested
    ///
    /// In gear's repository it goes to nodes/. Elsewhere it goes to the current folder, with a binary that is gear plus
    /// the node.
    NewNode(NewNodeArgs),
    /// Look after a plugin: nodes in another language, in a process of their own
    #[command(subcommand)]
    Plugin(PluginCommand),
    /// Write the folder of a new plugin in Python, which works as it stands
    NewPlugin(NewPluginArgs),
    /// Draw a graph, or print it with all that it extends
    Graph(DrawArgs),
    /// Write the JSON Schema of graph files, for editors
    Schema,
    /// The graphs that come with gear
    #[command(subcommand)]
    Graphs(GraphsCommand),
    /// Write a Gaussian scene in another format, and tell what that cannot hold
    ///
    /// Reads 3DGS PLY, PlayCanvas compressed PLY, SPZ 2 and 3, and .splat, told apart by content. Writes .ply, .spz,
    /// .splat and .glb (glTF with KHR_gaussian_splatting).
    Convert(ConvertArgs),
    /// Take pictures of a Gaussian scene
    ///
    /// From the camera under which it shows its painting; a scene without one is faced from the front. The cameras are
    /// written beside the pictures, as cameras.json.
    Render(RenderArgs),
    /// List the samples, or paint one, with its true depth and normals beside it
    Sample(SampleArgs),
    /// Run variants of a graph over many pictures, and compare them in tables
    Study(crate::commands::study::StudyArgs),
    /// Measure what accuracy costs: error against run time, as CSV and as a diagram
    Curve(crate::commands::curve::CurveArgs),
    /// Tell what differs between two runs: parameters, keys, outputs, times
    Diff(crate::commands::diff::DiffArgs),
    /// Run the catalogue of stiff and extreme cases on a node, a graph, or every node; exit code 1 on a surprise
    Stress(crate::commands::stress::StressArgs),
    /// Pin what ports of a graph give, and tell what moved; exit code 1 if something did
    Snap(crate::commands::snap::SnapArgs),
    /// Make a page on which people say which results they prefer, or count what they said
    Ballot(crate::commands::ballot::BallotArgs),
}

impl Command {
    /// Whether it looks at node types.
    pub fn needs_plugins(&self) -> bool {
        match self {
            Self::Run(_) | Self::Check(_) | Self::Plan(_) | Self::Why(_) | Self::Cache(_) | Self::Nodes(_) => true,
            Self::Graph(_) | Self::Schema | Self::Study(_) | Self::Curve(_) | Self::Diff(_) => true,
            Self::Stress(_) | Self::Snap(_) => true,
            Self::NewNode(_) | Self::Plugin(_) | Self::NewPlugin(_) => false,
            Self::Graphs(_) | Self::Convert(_) | Self::Render(_) | Self::Sample(_) | Self::Ballot(_) => false,
        }
    }
}

/// Which graph.
#[derive(Debug, Args)]
pub struct GraphArgs {
    /// A graph file, or `@NAME` for one that comes with gear (`@gear` is the main one)
    pub graph: String,
    /// Change a parameter of a node or an input; the value is YAML
    #[arg(long, value_name = "NODE.PARAM=VALUE")]
    pub set: Vec<String>,
}

/// `gear check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// The graph.
    #[command(flatten)]
    pub graph: GraphArgs,
    /// For people, or for programs on standard output
    #[arg(long, value_enum, default_value_t = CheckFormat::Text)]
    pub format: CheckFormat,
}

/// How mistakes are told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum CheckFormat {
    /// As a compiler does
    Text,
    /// With files, lines and columns, for editors
    Json,
}

/// What a run is made of.
#[derive(Debug, Args)]
pub struct PlanArgs {
    /// The graph.
    #[command(flatten)]
    pub graph: GraphArgs,
    /// Give an input of the graph: a file, or `sample:NAME` for a painting that gear makes itself, with options if need
    /// be: `sample:figure-3,condition=photo,light=right,seed=2,background=plain`
    #[arg(long, value_name = "NAME=PATH|sample:NAME")]
    pub input: Vec<OsString>,
    /// Ask for some outputs only
    #[arg(long, value_name = "NAME")]
    pub output: Vec<String>,
    /// Threads in all
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: Option<u16>,
    /// Where results are kept between runs [default: $GEAR_STORE, or `gear` in the user's cache folder]
    #[arg(long, value_name = "DIR")]
    pub store: Option<PathBuf>,
    /// Run this node (or read this input) although its results are stored
    #[arg(long, value_name = "NODE")]
    pub fresh: Vec<String>,
    /// Keep nothing and use nothing that was kept
    #[arg(long, conflicts_with = "store")]
    pub no_cache: bool,
    /// Keep and use also the results of nodes that do not promise the same bits again
    #[arg(long, conflicts_with = "no_cache")]
    pub cache_nondeterministic: bool,
    /// What rasterises: the CPU, or a GPU (by a part of its name); `auto` takes one that is not played by the CPU
    #[arg(long, value_name = "auto|cpu|gpu[:NAME]", default_value_t)]
    pub device: DeviceChoice,
    /// The ONNX Runtime library that computes networks [default: $ORT_DYLIB_PATH, that of the active Python environment,
    /// or the system's]
    #[arg(long, value_name = "FILE")]
    pub onnxruntime: Option<PathBuf>,
    /// Compute also what is not needed: every input that is wired, whatever parameters and values say; to compare
    #[arg(long)]
    pub no_elision: bool,
}

/// `gear run`.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// The run.
    #[command(flatten)]
    pub run: PlanArgs,
    /// Where the files go; made if it is not there
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Replace files in that folder that no earlier run wrote
    #[arg(long)]
    pub force: bool,
    /// Finish, and write, everything that does not depend on a node that failed or on a file that cannot be used; this
    /// is so unless --fail-fast is given. Run also if a plugin is known to be missing
    #[arg(long, conflicts_with = "fail_fast")]
    pub keep_going: bool,
    /// Start nothing more once a node has failed
    #[arg(long)]
    pub fail_fast: bool,
    /// Hold back nodes while values and the estimates of running nodes exceed this, such as 2GiB
    #[arg(long, value_name = "LIMIT", value_parser = crate::sizes::parse)]
    pub memory: Option<u64>,
    /// Tell nothing but notes, warnings and errors on standard error
    #[arg(long, short)]
    pub quiet: bool,
}

/// `gear why`.
#[derive(Debug, Args)]
pub struct WhyArgs {
    /// The run.
    #[command(flatten)]
    pub run: RunArgs,
    /// The node or input, or one output of a node
    #[arg(value_name = "NODE[.PORT]")]
    pub node: String,
    /// Show also every value in which inputs differ
    #[arg(long)]
    pub values: bool,
    /// For people, or for programs
    #[arg(long, value_enum, default_value_t = TextFormat::Text)]
    pub format: TextFormat,
}

/// `gear cache`.
#[derive(Debug, Subcommand)]
pub enum CacheCommand {
    /// Tell what the store holds
    Stat {
        /// The store.
        #[command(flatten)]
        store: StoreArgs,
        /// For people, or for programs
        #[arg(long, value_enum, default_value_t = TextFormat::Text)]
        format: TextFormat,
    },
    /// Remove values until the store is within its limit: first what was quick to compute and is large
    Gc {
        /// The store.
        #[command(flatten)]
        store: StoreArgs,
        /// Bytes that the store may take, such as 500MiB or 2GiB
        #[arg(long, value_name = "SIZE", value_parser = crate::sizes::parse, default_value = "8GiB")]
        limit: u64,
    },
    /// Read everything that the store holds, and tell what is damaged; exit code 1 if anything is
    Verify {
        /// The store.
        #[command(flatten)]
        store: StoreArgs,
        /// Remove what is damaged; it is computed again when it is needed
        #[arg(long)]
        repair: bool,
    },
    /// Remove everything from the store
    Clear {
        /// The store.
        #[command(flatten)]
        store: StoreArgs,
    },
    /// Write the store into one file, to import it elsewhere
    ///
    /// Everything, or with --graph (and the arguments of the run) what that run needs.
    Export(ExportArgs),
    /// Add what `gear cache export` wrote; all of it is verified first
    Import {
        /// The archive
        file: PathBuf,
        /// The store.
        #[command(flatten)]
        store: StoreArgs,
    },
}

/// Which store.
#[derive(Debug, Args)]
pub struct StoreArgs {
    /// The store [default: $GEAR_STORE, or `gear` in the user's cache folder]
    #[arg(long, value_name = "DIR")]
    pub store: Option<PathBuf>,
}

/// `gear cache export`.
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// The archive to write
    pub file: PathBuf,
    /// Only what a run of this graph needs
    #[arg(long, value_name = "GRAPH")]
    pub graph: Option<String>,
    /// As given to that run
    #[arg(long, value_name = "NODE.PARAM=VALUE", requires = "graph")]
    pub set: Vec<String>,
    /// As given to that run
    #[arg(long, value_name = "NAME=PATH|sample:NAME", requires = "graph")]
    pub input: Vec<OsString>,
    /// As given to that run
    #[arg(long, value_name = "NAME", requires = "graph")]
    pub output: Vec<String>,
    /// The store.
    #[command(flatten)]
    pub store: StoreArgs,
}

/// Who reads what is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TextFormat {
    /// People
    Text,
    /// Programs
    Json,
}

/// `gear nodes`.
#[derive(Debug, Args)]
pub struct NodesArgs {
    /// A node type, or the type of an input that can be given as a file
    pub name: Option<String>,
    /// Write the reference in Markdown: of all nodes and values, or of one
    #[arg(long)]
    pub markdown: bool,
}

/// `gear new-node`.
#[derive(Debug, Args)]
pub struct NewNodeArgs {
    /// Its name in graphs, such as OilCrackle
    pub name: String,
    /// An input port; without any port the node takes and gives an Image
    #[arg(long, value_name = "NAME:TYPE")]
    pub input: Vec<String>,
    /// An output port
    #[arg(long, value_name = "NAME:TYPE")]
    pub output: Vec<String>,
    /// Write a crate of its own that builds upon gear's repository in this folder
    #[arg(long, value_name = "DIR")]
    pub gear: Option<PathBuf>,
}

/// `gear graph`.
#[derive(Debug, Args)]
pub struct DrawArgs {
    /// The graph.
    #[command(flatten)]
    pub graph: GraphArgs,
    /// What to draw it with
    #[arg(long, value_enum, default_value_t = DrawFormat::Mermaid)]
    pub format: DrawFormat,
    /// Print it as one YAML file instead, with what it extends and every --set in it
    #[arg(long, conflicts_with = "format")]
    pub resolved: bool,
}

/// What a graph is drawn with.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum DrawFormat {
    /// Mermaid, as in Markdown files
    Mermaid,
    /// Graphviz
    Dot,
}

/// `gear graphs`.
#[derive(Debug, Subcommand)]
pub enum GraphsCommand {
    /// List them
    List,
    /// Copy one (or all) to edit
    Copy {
        /// Its name; all of them if it is not given
        name: Option<String>,
        /// The folder to copy to
        #[arg(long, value_name = "DIR", default_value = ".")]
        to: PathBuf,
    },
}

/// `gear convert`.
#[derive(Debug, Args)]
pub struct ConvertArgs {
    /// The scene
    #[arg(value_name = "IN")]
    pub input: PathBuf,
    /// The file to write; its extension says in which format
    #[arg(value_name = "OUT")]
    pub output: PathBuf,
    /// In IN, y points downwards, as in most scenes made from photographs; turn it over
    #[arg(long)]
    pub y_down: bool,
    /// Leave out what N views from all around do not need: no pixel of theirs changes by more than 1/255
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub prune: Option<u32>,
}

/// `gear render`.
#[derive(Debug, Args)]
pub struct RenderArgs {
    /// The scene, in any format that `gear convert` reads
    pub scene: PathBuf,
    /// The cameras: JSON, one or a list, as cameras.json or the comment of a PLY file has them
    #[arg(long, value_name = "FILE", conflicts_with = "orbit")]
    pub camera: Option<PathBuf>,
    /// So many views on a full turn, all in the same frame
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=720))]
    pub orbit: Option<u32>,
    /// Size of the pictures in pixels, or their longer side alone [default: the camera's]
    #[arg(long, value_name = "WxH")]
    pub size: Option<crate::scenes::Size>,
    /// What rasterises: the CPU, or a GPU (by a part of its name); `auto` takes one that is not played by the CPU
    #[arg(long, value_name = "auto|cpu|gpu[:NAME]", default_value_t)]
    pub device: DeviceChoice,
    /// Where the files go; made if it is not there
    #[arg(long, value_name = "DIR", default_value = "pictures")]
    pub out: PathBuf,
    /// Write depths too, NAME.depth.exr
    #[arg(long)]
    pub depth: bool,
    /// Write world-space normals too, NAME.normal.exr
    #[arg(long)]
    pub normal: bool,
    /// In the scene, y points downwards, as in most scenes made from photographs; turn it over
    #[arg(long)]
    pub y_down: bool,
}

/// `gear sample`.
#[derive(Debug, Args)]
pub struct SampleArgs {
    /// The motif (court-lady, vessel, landscape-relief) or the scene of the benchmark (figure-1, relief-3, …); without it
    /// they are listed
    #[arg(requires = "out")]
    pub name: Option<String>,
    /// Say what families of scenes there are, and which lights
    #[arg(long, conflicts_with_all = ["name", "out"])]
    pub list: bool,
    /// Where the files go; made if it is not there
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Longer side in pixels
    #[arg(long, value_name = "PX", default_value_t = 768)]
    pub size: usize,
    /// What lies behind the figure
    #[arg(long, value_enum, default_value_t = BackgroundArg::Textured)]
    pub background: BackgroundArg,
    /// How the surface is shown
    #[arg(long, value_enum, default_value_t = ConditionArg::Paint)]
    pub condition: ConditionArg,
    /// Where the light comes from
    #[arg(long, value_name = "LIGHT", default_value = "upper-left", value_parser = lights())]
    pub light: String,
    /// Seed of everything that is random
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

fn lights() -> clap::builder::PossibleValuesParser {
    gear_sample::LIGHTS.map(|(name, _)| name).into()
}

/// What lies behind the figure.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum BackgroundArg {
    /// Clean paper of one colour
    Plain,
    /// Old silk with stains, writing and a seal
    Textured,
    /// Old silk in a brocade mount
    Bordered,
}

/// How the surface is shown.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum ConditionArg {
    /// As a painting: lines, washes, weak modelling, brush grain
    Paint,
    /// As a photograph of the coloured surface
    Photo,
    /// Flat colours and lines
    Flat,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_arguments_are_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn a_store_and_no_cache_exclude_each_other() {
        let parsed = Arguments::try_parse_from(["gear", "run", "@gear", "--store", "x", "--no-cache"]);
        assert!(parsed.is_err());
    }
}
