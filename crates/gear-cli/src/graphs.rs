//! The graphs that are embedded in the binary, and graphs from files.

use gear_graph::graph::nearest;
use gear_graph::{Graph, GraphSource, Library, Registry, Store, Unreadable};

use crate::args::GraphArgs;
use crate::error::CliError;

/// A graph that comes with gear.
#[derive(Clone, Copy, Debug)]
pub struct Shipped {
    /// Its name: the path below `graphs/` without `.yaml`.
    pub name: &'static str,
    /// The file's text.
    pub text: &'static str,
}

macro_rules! embed {
    ($($name:literal),* $(,)?) => {
        &[$(Shipped {
            name: $name,
            text: include_str!(concat!("../../../graphs/", $name, ".yaml")),
        }),*]
    };
}

/// The graphs that come with gear: the files of `graphs/`, without the experiments.
pub fn shipped() -> &'static [Shipped] {
    embed![
        "gear",
        "gear-full",
        "baselines/raw",
        "baselines/histogram-equalization",
        "baselines/retinex",
        "baselines/trellis",
        "baselines/lgm",
        "baselines/splatter-image",
        "ablations/without-translation",
        "ablations/fixed-gain",
        "ablations/without-grounding",
        "ablations/without-restitution",
        "services/images",
        "services/comfyui",
        "services/judge",
        "networks/edges",
        "networks/foreground",
        "networks/depth",
        "networks/translate",
    ]
}

/// The experiments that come with gear: studies and curves.
pub fn experiments() -> &'static [Shipped] {
    embed![
        "studies/table-1",
        "studies/table-2",
        "studies/table-3",
        "studies/table-4",
        "studies/table-5",
        "studies/table-6",
        "studies/alpha",
        "studies/collection",
        "curves/pyramid",
        "curves/shading",
        "curves/gaussians",
        "curves/refine",
        "curves/refine-size",
        "curves/edit",
        "curves/depth-maps",
        "curves/normal-cells",
    ]
}

/// What experiments read besides: collections of pictures.
const MANIFESTS: &[(&str, &str)] = &[(
    "studies/collection.csv",
    include_str!("../../../graphs/studies/collection.csv"),
)];

/// The collection that an experiment of this name reads, with the name of its file.
pub fn manifest_of(name: &str) -> Option<(&'static str, &'static str)> {
    let found = MANIFESTS.iter().find(|(file, _)| file.trim_end_matches(".csv") == name);
    found.copied()
}

impl Shipped {
    /// What it is for: the first comment line.
    pub fn summary(&self) -> &'static str {
        self.text
            .lines()
            .next()
            .unwrap_or_default()
            .trim_start_matches('#')
            .trim()
    }
}

/// The shipped graph of that name.
pub fn find(name: &str) -> Result<&'static Shipped, CliError> {
    let all = || shipped().iter().chain(experiments());
    all().find(|graph| graph.name == name).ok_or_else(|| {
        let names: Vec<_> = all().map(|graph| graph.name).collect();
        let help = match nearest(name, names.iter().copied()) {
            Some(near) => format!("did you mean `@{near}`?"),
            None => format!("there are {}", names.join(", ")),
        };
        CliError::UnknownGraph {
            name: name.to_owned(),
            help,
        }
    })
}

/// Where graphs are found: on disk, and those that come with gear.
pub fn library() -> Library {
    let yaml = shipped().iter().chain(experiments()).map(|file| (file.name, file.text));
    Library::holding(yaml.chain(MANIFESTS.iter().copied()))
}

/// Reads and checks the graph that was asked for, as one whose inputs are given as files; its warnings are the
/// caller's to show.
pub fn open_for_files(args: &GraphArgs, registry: &Registry) -> Result<Graph, CliError> {
    source(args)?.check_for_files(registry).map_err(CliError::Graph)
}

/// Reads and checks the graph that was asked for; its warnings are the caller's to show.
pub fn open(args: &GraphArgs, registry: &Registry) -> Result<Graph, CliError> {
    source(args)?.check(registry).map_err(CliError::Graph)
}

/// The same, but a graph that checked clean before comes from the store.
pub fn open_in(args: &GraphArgs, registry: &Registry, store: Option<&Store>) -> Result<Graph, CliError> {
    let Some(store) = store else {
        return open(args, registry);
    };
    source(args)?.check_in(registry, store).map_err(CliError::Graph)
}

/// Reads the graph that was asked for.
pub fn source(args: &GraphArgs) -> Result<GraphSource, Unreadable> {
    let mut source = GraphSource::open(&args.graph, &library())?;
    source.set = args.set.clone();
    Ok(source)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn files(folder: &Path, found: &mut Vec<std::path::PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                files(&path, found);
            } else {
                found.push(path);
            }
        }
    }

    #[test]
    fn every_file_in_graphs_is_embedded() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../graphs");
        let mut found = Vec::new();
        files(&root, &mut found);
        // The pinned pipelines are the project's own tests.
        found.retain(|path| !path.starts_with(root.join("snapshots")));
        let mut names: Vec<_> = found
            .iter()
            .map(|path| {
                path.strip_prefix(&root)
                    .unwrap()
                    .with_extension("")
                    .display()
                    .to_string()
            })
            .collect();
        names.sort();
        let files = shipped().iter().chain(experiments()).map(|file| file.name.to_owned());
        let manifests = MANIFESTS
            .iter()
            .map(|(name, _)| name.trim_end_matches(".csv").to_owned());
        let mut embedded: Vec<_> = files.chain(manifests).collect();
        embedded.sort();
        assert_eq!(names, embedded);
    }

    #[test]
    fn every_shipped_graph_is_clean_and_says_what_it_is_for() {
        let registry = crate::with_shipped(crate::registry());
        for graph in shipped() {
            assert!(graph.summary().len() > 20, "{}", graph.name);
            let source = GraphSource::open(format!("@{}", graph.name), &library()).unwrap();
            let checked = source.check(&registry).unwrap();
            assert!(checked.warnings().is_empty(), "{}", checked.warnings());
        }
    }

    #[test]
    fn every_shipped_experiment_is_clean_and_says_what_it_is_for() {
        let registry = crate::registry();
        for file in experiments() {
            assert!(file.summary().len() > 20, "{}", file.name);
            let checked = crate::commands::study::mistakes(&format!("@{}", file.name), file.text, &registry);
            assert!(checked.is_none(), "{}: {}", file.name, checked.unwrap().render(false));
        }
    }

    #[test]
    fn a_misspelt_graph_gets_the_nearest_name() {
        assert!(find("gaer").unwrap_err().to_string().contains("did you mean `@gear`?"));
    }
}
