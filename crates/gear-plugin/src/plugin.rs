//! A plugin: a folder, the nodes in it, and the worker that runs them.
//!
//! Its nodes are described without starting anything where that is possible: by the file that plugin.yaml names, or by
//! what an earlier handshake said (kept by the fingerprint of the sources). A worker is started when a node has to be
//! keyed or run, since only it knows the versions and weights that are part of the key; it then stays for the nodes that
//! follow. It runs one node at a time, and whoever comes meanwhile waits. Nodes of all plugins that need a GPU take turns
//! at that as well.
//!
//! A worker that fails is gone; the next node starts another. Should that one state other versions or weights than the
//! one that the keys were made with, it does not run: its results would be kept under the wrong keys.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use gear_graph::{
    AnyValue, Context, Digest, Foreign, Hasher, NodeError, ParamValues, Registry, Resources, Slot, ValueType, Want,
};
use serde_json::{Value, json};

use crate::describe::{self, NodesFile};
use crate::lines::for_people;
use crate::worker::{Hello, Worker};
use crate::{Failure, Manifest, NodeDescription, PluginError, fingerprint};

/// How often one who waits for a worker looks whether the run was interrupted.
const TICK: Duration = Duration::from_millis(50);

/// Notes that a run may leave.
const MOST_NOTES: usize = 100;

/// A plugin.
pub struct Plugin {
    folder: PathBuf,
    manifest: Manifest,
    fingerprint: Digest,
    nodes: Vec<NodeDescription>,
    worker: Turn<Option<Worker>>,
    /// What the keys of this process say of the worker; found out once.
    identity: OnceLock<String>,
}

/// A thing that one at a time has.
struct Turn<T> {
    thing: Mutex<(bool, T)>,
    free: Condvar,
}

/// Somebody's turn.
struct Taken<'t, T>(&'t Turn<T>);

/// The GPUs of the machine, as plugins share them.
static GPU: Turn<()> = Turn::new(());

impl<T> Turn<T> {
    const fn new(thing: T) -> Self {
        Self {
            thing: Mutex::new((false, thing)),
            free: Condvar::new(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, (bool, T)> {
        self.thing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for a turn; gives up when the run is interrupted.
    fn take(&self, ctx: Option<&Context>) -> Result<Taken<'_, T>, Failure> {
        let mut thing = self.lock();
        while thing.0 {
            if ctx.is_some_and(Context::is_cancelled) {
                return Err(Failure::Cancelled);
            }
            let waited = self.free.wait_timeout(thing, TICK);
            thing = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        thing.0 = true;
        Ok(Taken(self))
    }
}

impl<T> Drop for Taken<'_, T> {
    fn drop(&mut self) {
        self.0.lock().0 = false;
        self.0.free.notify_one();
    }
}

impl Plugin {
    /// Opens the plugin in a folder. Its worker is started only if nothing else describes its nodes; what it says then is
    /// kept in the folder `cache`, if one is given.
    ///
    /// # Errors
    /// If the folder is no plugin, or its nodes cannot be learnt.
    pub fn open(folder: &Path, cache: Option<&Path>) -> Result<Arc<Self>, PluginError> {
        let mut plugin = Self::without_nodes(folder)?;
        plugin.nodes = match plugin.described()? {
            Some(nodes) => nodes,
            None => plugin.learnt(cache)?,
        };
        Ok(Arc::new(plugin))
    }

    /// Opens the plugin in a folder and asks its worker, whatever else describes its nodes.
    ///
    /// # Errors
    /// If the folder is no plugin, or the worker does not answer.
    pub fn ask(folder: &Path) -> Result<Arc<Self>, PluginError> {
        let mut plugin = Self::without_nodes(folder)?;
        plugin.nodes = plugin.introduced()?;
        Ok(Arc::new(plugin))
    }

    fn without_nodes(folder: &Path) -> Result<Self, PluginError> {
        let manifest = Manifest::read(folder)?;
        let folder = folder.canonicalize().map_err(|cause| PluginError::Unreadable {
            path: folder.to_path_buf(),
            cause,
        })?;
        Ok(Self {
            fingerprint: fingerprint(&folder, &manifest)?,
            folder,
            manifest,
            nodes: Vec::new(),
            worker: Turn::new(None),
            identity: OnceLock::new(),
        })
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.manifest.name
    }

    /// Its folder, without links.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Its `plugin.yaml`.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Its nodes, as it describes them.
    pub fn nodes(&self) -> &[NodeDescription] {
        &self.nodes
    }

    /// The file in which its nodes stand described, if plugin.yaml names one.
    pub fn nodes_file(&self) -> Option<PathBuf> {
        self.manifest.nodes.as_ref().map(|file| self.folder.join(file))
    }

    /// What the file that plugin.yaml names says.
    fn described(&self) -> Result<Option<Vec<NodeDescription>>, PluginError> {
        let Some(path) = self.nodes_file() else {
            return Ok(None);
        };
        let text = std::fs::read_to_string(&path).map_err(|cause| PluginError::Source {
            path: path.clone(),
            cause: format!("cannot be read: {cause}; `gear plugin describe DIR` writes it"),
        })?;
        let file = NodesFile::parse(&text).map_err(|cause| PluginError::Manifest { path, cause })?;
        Ok(Some(file.nodes))
    }

    /// What the worker says, now or when these sources were asked last.
    fn learnt(&self, cache: Option<&Path>) -> Result<Vec<NodeDescription>, PluginError> {
        let kept = cache.map(|cache| cache.join(format!("{}.json", self.fingerprint.hex())));
        let read = |path: &PathBuf| NodesFile::parse(&std::fs::read_to_string(path).ok()?).ok();
        if let Some(file) = kept.as_ref().and_then(read) {
            return Ok(file.nodes);
        }
        let nodes = self.introduced()?;
        if let Some(path) = kept
            && let Err(error) = keep(&path, &NodesFile::new(nodes.clone()))
        {
            tracing::warn!(plugin = self.name(), %error, "what the plugin says of its nodes is not kept");
        }
        Ok(nodes)
    }

    /// Its nodes, as a worker tells them, which then stays: keys are made of what it said, and nodes run in it.
    fn introduced(&self) -> Result<Vec<NodeDescription>, PluginError> {
        let hello = self.hello(None).map_err(|failure| self.failed(failure))?;
        self.identity.get_or_init(|| self.identity_of(&hello));
        Ok(hello.nodes)
    }

    fn failed(&self, failure: Failure) -> PluginError {
        PluginError::Worker {
            plugin: self.name().to_owned(),
            failure,
        }
    }

    /// What a worker says of itself: a fresh one is started, and stays.
    ///
    /// # Errors
    /// If it cannot be started, or does not answer.
    pub fn hello(&self, ctx: Option<&Context>) -> Result<Hello, Failure> {
        let turn = self.worker.take(ctx)?;
        let (worker, hello) = self.start()?;
        turn.0.lock().1 = Some(worker);
        Ok(hello)
    }

    fn start(&self) -> Result<(Worker, Hello), Failure> {
        let mut worker = Worker::start(&self.folder, &self.manifest)?;
        let hello = worker.greet()?;
        Ok((worker, hello))
    }

    /// Ends the worker, if there is one; the next node starts another.
    pub fn rest(&self) {
        if let Ok(turn) = self.worker.take(None) {
            let worker = turn.0.lock().1.take();
            drop(worker);
        }
    }

    /// Adds its nodes to a registry.
    ///
    /// # Errors
    /// If their description cannot be taken, or a name is taken.
    pub fn register(self: &Arc<Self>, registry: &mut Registry) -> Result<(), PluginError> {
        let refused = |cause: String| PluginError::Description {
            plugin: self.name().to_owned(),
            cause,
        };
        for spec in describe::specs(self.name(), &self.nodes, registry).map_err(refused)? {
            let node = PluginNode {
                plugin: Arc::clone(self),
                name: spec.name,
                inputs: spec.inputs.iter().map(|port| (port.name, port.many)).collect(),
                outputs: spec.outputs.iter().map(|port| (port.name, port.value_type)).collect(),
            };
            registry
                .foreign(spec, Arc::new(node))
                .map_err(|error| refused(error.to_string()))?;
        }
        Ok(())
    }

    /// What keys say of where its results come from: the sources and what the worker states. The worker is started for
    /// it, once. A plugin whose worker cannot be started has a realm of its own, in which nothing is ever kept.
    fn realm(&self) -> &str {
        self.identity.get_or_init(|| match self.hello(None) {
            Ok(hello) if hello.nodes == self.nodes => self.identity_of(&hello),
            // The run will tell.
            Ok(_) => {
                self.rest();
                format!("plugin:{}:unknown", self.name())
            }
            Err(error) => {
                tracing::warn!(plugin = self.name(), %error, "the plugin's worker cannot be asked what it is");
                format!("plugin:{}:unknown", self.name())
            }
        })
    }

    fn identity_of(&self, hello: &Hello) -> String {
        let mut states = Value::Object(hello.states.clone());
        states.sort_all_objects();
        let digest = Hasher::new("plugin states")
            .digest(&self.fingerprint)
            .bytes(states.to_string().as_bytes())
            .finish();
        format!("plugin:{}:{}", self.name(), &digest.hex()[..32])
    }

    /// A worker that is what the keys say; the caller has the turn.
    fn ready(&self) -> Result<Worker, Failure> {
        let kept = self.worker.lock().1.take();
        if let Some(mut worker) = kept
            && worker.alive()
        {
            return Ok(worker);
        }
        let (worker, hello) = self.start()?;
        if hello.nodes != self.nodes {
            return Err(Failure::Remote {
                code: 0,
                message: format!(
                    "the worker of the plugin `{}` describes its nodes differently from {}; `gear plugin describe {}` \
                     brings that up to date",
                    self.name(),
                    self.nodes_file()
                        .map_or("before".to_owned(), |file| file.display().to_string()),
                    self.folder.display()
                ),
            });
        }
        let now = self.identity_of(&hello);
        if self.identity.get_or_init(|| now.clone()) != &now {
            return Err(Failure::Remote {
                code: 0,
                message: format!(
                    "the plugin `{}` states other versions or weights than when the run began; run again",
                    self.name()
                ),
            });
        }
        Ok(worker)
    }

    /// Runs a node.
    fn run(&self, job: &Job<'_>, ctx: &Context) -> Result<Vec<Option<AnyValue>>, Failure> {
        let turn = self.worker.take(Some(ctx))?;
        let _gpu = match self.manifest.resources.gpu {
            0 => None,
            _ => Some(GPU.take(Some(ctx))?),
        };
        let mut worker = self.ready()?;
        let result = job.run(&mut worker, &self.manifest, ctx);
        if worker.alive() {
            turn.0.lock().1 = Some(worker);
        }
        result
    }
}

fn keep(path: &Path, file: &NodesFile) -> std::io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)?;
    let mut temporary = tempfile::NamedTempFile::new_in(folder)?;
    temporary.write_all(&serde_json::to_vec(file)?)?;
    temporary.persist(path).map_err(|error| error.error)?;
    Ok(())
}

/// A node of a plugin.
struct PluginNode {
    plugin: Arc<Plugin>,
    name: &'static str,
    /// Names, and whether a list is taken.
    inputs: Vec<(&'static str, bool)>,
    outputs: Vec<(&'static str, ValueType)>,
}

impl Foreign for PluginNode {
    fn realm(&self, _: &Resources) -> String {
        self.plugin.realm().to_owned()
    }

    fn run(
        &self,
        params: &ParamValues,
        inputs: &mut [Slot],
        want: &Want,
        ctx: &Context,
    ) -> Result<Vec<Option<AnyValue>>, NodeError> {
        let job = Job {
            node: self,
            params,
            inputs,
            want,
        };
        self.plugin
            .run(&job, ctx)
            .map_err(|failure| failure.of_node(self.plugin.name()))
    }
}

/// A run of a node.
struct Job<'j> {
    node: &'j PluginNode,
    params: &'j ParamValues,
    inputs: &'j [Slot],
    want: &'j Want,
}

impl Job<'_> {
    fn run(&self, worker: &mut Worker, manifest: &Manifest, ctx: &Context) -> Result<Vec<Option<AnyValue>>, Failure> {
        ctx.checkpoint().map_err(|_| Failure::Cancelled)?;
        let input_failed = |port: &str, cause: String| Failure::Input {
            port: port.to_owned(),
            cause,
        };
        let folder = worker
            .scratch
            .run()
            .map_err(|error| input_failed("", format!("no folder for the run: {error}")))?;
        let mut inputs = serde_json::Map::new();
        for ((port, many), slot) in self.node.inputs.iter().zip(self.inputs) {
            let mut files = Vec::new();
            for (i, value) in slot.iter().enumerate() {
                let name = if *many {
                    format!("{port}-{i}")
                } else {
                    (*port).to_owned()
                };
                files.push(folder.give(&name, value).map_err(|cause| input_failed(port, cause))?);
            }
            inputs.insert((*port).to_owned(), json!(files));
        }
        let wanted: serde_json::Map<_, _> = self
            .node
            .outputs
            .iter()
            .filter(|(port, _)| self.want.has(port))
            .map(|(port, value_type)| ((*port).to_owned(), json!(value_type.extension)))
            .collect();
        let request = json!({
            "node": self.node.name,
            "params": self.params,
            "inputs": inputs,
            "outputs": wanted,
            "folder": folder.out(),
            // Seeds go up to 2⁵³, which every reader of JSON keeps exactly.
            "seed": ctx.seed() >> 11,
        });
        let answer = worker.ask("run", request, manifest.timeouts.run(), "while a node ran", Some(ctx))?;
        notes(&answer, ctx);
        let most = manifest.limits.output_bytes();
        let take = |(port, value_type): &(&'static str, ValueType)| {
            if !self.want.has(port) {
                return Ok(None);
            }
            let failed = |cause: String| Failure::Output {
                port: (*port).to_owned(),
                cause,
            };
            let name = answer["outputs"][*port]
                .as_str()
                .ok_or_else(|| failed("the worker names no file for it, and it was wanted".to_owned()))?;
            folder.take(name, value_type, most).map(Some).map_err(failed)
        };
        self.node.outputs.iter().map(take).collect()
    }
}

fn notes(answer: &Value, ctx: &Context) {
    let notes = answer["notes"].as_array().into_iter().flatten();
    for note in notes.filter_map(Value::as_str).take(MOST_NOTES) {
        ctx.note(for_people(note));
    }
}
