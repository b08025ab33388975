//! A curve file, checked completely before anything runs.
//!
//! ```yaml
//! curve: 1
//! title: Levels of the pyramid
//! graph: '@gear'
//! set: {painting.size: 384}
//! picture: 'sample:court-lady'
//! outputs: {ratio: pyramid.ratio}
//! knobs:
//!   levels: {at: pyramid.levels, values: [1, 2, 3, 4, 5]}
//! reference: {pyramid.levels: 7}
//! time: pyramid
//! error: {of: ratio, norm: rms}
//! ```

use gear_graph::{Graph, Library, Mistakes, ParamValues, Registry, Spanned, Tree, TreeKind};

use crate::norms::Norm;
use crate::overlay::Overlay;
use crate::read::{Entries, Reader, did_you_mean, get};
use crate::study::Samples;
use crate::study::cases::Source;
use crate::study::file::{folder_of, of_kind, version};

/// The version of curve files that is read.
pub const CURVE_VERSION: i64 = 1;

const KEYS: [&str; 19] = [
    "curve",
    "title",
    "graph",
    "inputs",
    "nodes",
    "outputs",
    "set",
    "input",
    "picture",
    "mask",
    "knobs",
    "reference",
    "time",
    "error",
    "operations",
    "repeats",
    "warm-up",
    "decision",
    "family",
];

/// A curve that can be measured.
pub struct Plan {
    /// The file's name.
    pub name: String,
    /// What is varied.
    pub title: String,
    /// The input that takes the picture.
    pub input: String,
    /// The picture.
    pub picture: Source,
    /// The input that takes the sample's true mask, if one is to be given.
    pub mask: Option<String>,
    /// The settings, the shipped one first.
    pub settings: Vec<Setting>,
    /// What the errors are taken against.
    pub reference: Setting,
    /// The nodes whose seconds count.
    pub time: Vec<String>,
    /// The output that is compared.
    pub output: String,
    /// Where a number stands in it; empty for values with norms of their own.
    pub path: Vec<String>,
    /// How it is compared.
    pub norm: Norm,
    /// What is counted in place of seconds, if anything.
    pub operations: Option<Operations>,
    /// Timed runs of each setting.
    pub repeats: usize,
    /// Runs before them that are not timed.
    pub warm_up: usize,
    /// The decision record that says why the default is off the front.
    pub decision: Option<String>,
}

/// One setting of the knobs.
pub struct Setting {
    /// In words.
    pub label: String,
    /// The value of the knob that parts families, if one does.
    pub family: String,
    /// The values of the knobs in their order, where they are numbers.
    pub numbers: Vec<Option<f64>>,
    /// The graph with them.
    pub graph: Graph,
    /// Whether it is what is shipped.
    pub default: bool,
}

/// A count of operations.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Operations {
    /// The product of the values of knobs.
    Knobs {
        /// Numbers of the knobs.
        knobs: Vec<usize>,
        /// Their names.
        names: Vec<String>,
    },
    /// A number in a report that the graph puts out.
    Report {
        /// The output.
        output: String,
        /// Where it stands in it.
        path: Vec<String>,
    },
}

impl std::fmt::Display for Operations {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Knobs { names, .. } => write!(f, "{}", names.join(" × ")),
            Self::Report { output, path } => write!(f, "{}", path.last().unwrap_or(output)),
        }
    }
}

/// Whether a YAML file is a curve.
pub fn is_curve(text: &str) -> bool {
    crate::study::file::has_key(text, "curve")
}

/// A knob as the file has it.
struct Knob {
    name: String,
    at: Spanned<String>,
    values: Vec<Tree>,
}

impl Plan {
    /// Reads and checks everything; all mistakes at once.
    pub fn read(
        name: &str,
        text: &str,
        library: &Library,
        registry: &Registry,
        samples: &dyn Samples,
    ) -> Result<Self, Mistakes> {
        let mut reader = Reader::default();
        let plan = reader
            .yaml(name, text)
            .and_then(|tree| read(name, &tree, library, registry, samples, &mut reader));
        match plan {
            Some(plan) if reader.clean() => Ok(plan),
            _ => Err(reader.mistakes()),
        }
    }
}

fn read(
    name: &str,
    tree: &Tree,
    library: &Library,
    registry: &Registry,
    samples: &dyn Samples,
    reader: &mut Reader,
) -> Option<Plan> {
    let top = reader.map(tree, "a curve file")?;
    of_kind(top, "curve", tree, reader)?;
    reader.keys(top, "a curve file", &KEYS);
    version(top, "curve", CURVE_VERSION, tree, reader);
    let needed = |key: &str, reader: &mut Reader| {
        let found = get(top, key);
        if found.is_none() {
            let message = format!("the curve has no `{key}`");
            reader.error("missing-key", message, tree.span, &format!("`{key}` is missing"), None);
        }
        found
    };
    let graph = needed("graph", reader);
    let picture = needed("picture", reader);
    let knobs = needed("knobs", reader);
    let reference = needed("reference", reader);
    let time = needed("time", reader);
    let error = needed("error", reader);
    let graph = graph.and_then(|tree| {
        let value = reader
            .text(tree, "`graph`", "the path of a graph file, or `@name`")?
            .to_owned();
        Some(Spanned { value, span: tree.span })
    })?;
    let picture = picture.and_then(|tree| {
        let text = reader.text(tree, "`picture`", "a path, or `sample:NAME`")?;
        let picture = Source::parse(text, &folder_of(name));
        if let Some(flaw) = picture.flaw(samples) {
            reader.error("bad-file", flaw, tree.span, "cannot be used", None);
        }
        Some(picture)
    });
    let knobs = knobs.map(|tree| read_knobs(tree, reader)).unwrap_or_default();
    let family = get(top, "family").and_then(|tree| {
        let given = reader.text(tree, "`family`", "the name of a knob")?.to_owned();
        let found = knobs.iter().position(|knob| knob.name == given);
        if found.is_none() {
            let help = did_you_mean(&given, knobs.iter().map(|knob| knob.name.as_str()));
            reader.error(
                "unknown-knob",
                format!("no knob is named `{given}`"),
                tree.span,
                "no knob",
                help,
            );
        }
        found
    });
    let made = Made {
        name,
        top,
        graph: &graph,
        library,
        registry,
    };
    let base = made.graph(&[], reader)?;
    let reference = reference.and_then(|tree| {
        let entries = reader.map(tree, "`reference`")?;
        let sets: Vec<_> = entries.iter().map(|(key, tree)| (key.clone(), tree.clone())).collect();
        let told = entries
            .iter()
            .map(|(key, tree)| format!("{} = {}", key.value, words(tree)));
        Some(Setting {
            label: told.collect::<Vec<_>>().join(", "),
            family: String::new(),
            numbers: Vec::new(),
            graph: made.graph(&sets, reader)?,
            default: false,
        })
    });
    let settings = settings(&made, &knobs, family, base, reader);
    let first = settings.first().map(|setting| &setting.graph)?;
    let time = time.map(|tree| reader.words(tree, "`time`")).unwrap_or_default();
    for node in &time {
        let names: Vec<&str> = first.nodes().iter().map(|node| node.id.as_str()).collect();
        exists(node, "node", &names, reader);
    }
    let error = error.and_then(|tree| read_error(tree, first, reader));
    let operations = get(top, "operations").and_then(|tree| read_operations(tree, &knobs, first, reader));
    let mask = get(top, "mask").and_then(|tree| {
        let value = reader.text(tree, "`mask`", "the name of an input")?.to_owned();
        let given = Spanned { value, span: tree.span };
        let names: Vec<&str> = first.inputs().iter().map(|input| input.name.as_str()).collect();
        exists(&given, "input", &names, reader);
        Some(given.value)
    });
    let input = match get(top, "input") {
        Some(tree) => reader.text(tree, "`input`", "the name of an input").map(str::to_owned),
        None => first
            .inputs()
            .iter()
            .find(|input| !input.optional)
            .map(|input| input.name.clone()),
    };
    let count = |key: &str, default: usize, reader: &mut Reader| {
        get(top, key).map_or(Some(default), |tree| reader.count(tree, &format!("`{key}`"), 0..=1000))
    };
    let repeats = count("repeats", 3, reader);
    let warm_up = count("warm-up", 1, reader);
    let title = get(top, "title").and_then(|tree| reader.word(tree, "`title`"));
    let decision = get(top, "decision").and_then(|tree| reader.word(tree, "`decision`"));
    let (output, path, norm) = error?;
    Some(Plan {
        name: name.to_owned(),
        title: title.unwrap_or_else(|| name.to_owned()),
        input: input.unwrap_or_default(),
        picture: picture?,
        mask,
        settings,
        reference: reference?,
        time: time.into_iter().map(|node| node.value).collect(),
        output,
        path,
        norm,
        operations,
        repeats: repeats?.max(1),
        warm_up: warm_up?,
        decision,
    })
}

fn exists(given: &Spanned<String>, what: &str, names: &[&str], reader: &mut Reader) {
    if !names.contains(&given.value.as_str()) {
        let help = did_you_mean(&given.value, names.iter().copied());
        let help = help.unwrap_or_else(|| format!("it has {}", names.join(", ")));
        let message = format!("the graph has no {what} `{}`", given.value);
        reader.error("unknown-name", message, given.span, "no such name", Some(help));
    }
}

fn read_knobs(tree: &Tree, reader: &mut Reader) -> Vec<Knob> {
    let mut knobs = Vec::new();
    let entries = reader.map(tree, "`knobs`").unwrap_or_default();
    if !(1..=2).contains(&entries.len()) {
        let message = format!("one or two knobs can be turned, found {}", entries.len());
        reader.error("wrong-knobs", message, tree.span, "knobs", None);
    }
    for (key, tree) in entries {
        let what = format!("knob `{}`", key.value);
        let Some(own) = reader.map(tree, &what) else {
            continue;
        };
        reader.keys(own, &what, &["at", "values"]);
        let at = get(own, "at").and_then(|tree| {
            let value = reader
                .text(tree, &format!("`at` of {what}"), "`NODE.PARAM`")?
                .to_owned();
            Some(Spanned { value, span: tree.span })
        });
        let values = match get(own, "values").map(|tree| &tree.kind) {
            Some(TreeKind::List(items)) if !items.is_empty() => items.clone(),
            _ => Vec::new(),
        };
        match at {
            Some(at) if !values.is_empty() => knobs.push(Knob {
                name: key.value.clone(),
                at,
                values,
            }),
            _ => {
                let help = "write `{at: NODE.PARAM, values: [1, 2, 3]}`".to_owned();
                reader.error(
                    "missing-key",
                    format!("{what} has no parameter or no values"),
                    key.span,
                    "incomplete",
                    Some(help),
                );
            }
        }
    }
    knobs
}

/// What the graphs of all settings are made of.
struct Made<'t> {
    name: &'t str,
    top: &'t Entries,
    graph: &'t Spanned<String>,
    library: &'t Library,
    registry: &'t Registry,
}

impl Made<'_> {
    fn graph(&self, sets: &[(Spanned<String>, Tree)], reader: &mut Reader) -> Option<Graph> {
        let sections = self
            .top
            .iter()
            .filter(|(key, _)| matches!(key.value.as_str(), "inputs" | "nodes" | "outputs"));
        let own = match get(self.top, "set") {
            Some(tree) => reader.map(tree, "`set`").unwrap_or_default(),
            None => &[],
        };
        let overlay = Overlay {
            graph: self.graph.clone(),
            sections: sections.map(|(key, tree)| (key, tree)).collect(),
            sets: own.iter().chain(sets).map(|(key, tree)| (key, tree)).collect(),
        };
        overlay.check(reader, self.name, self.library, self.registry)
    }
}

/// Every combination of the knobs; the shipped one is marked, and added in front if it is none of them.
fn settings(made: &Made<'_>, knobs: &[Knob], family: Option<usize>, base: Graph, reader: &mut Reader) -> Vec<Setting> {
    let mut settings = Vec::new();
    let combinations: usize = knobs.iter().map(|knob| knob.values.len()).product();
    for combination in 0..combinations.min(1000) {
        let mut rest = combination;
        let mut chosen: Vec<(&Knob, &Tree)> = Vec::new();
        for knob in knobs.iter().rev() {
            chosen.push((knob, &knob.values[rest % knob.values.len()]));
            rest /= knob.values.len();
        }
        chosen.reverse();
        let sets: Vec<_> = chosen
            .iter()
            .map(|(knob, value)| (knob.at.clone(), (*value).clone()))
            .collect();
        let Some(graph) = made.graph(&sets, reader) else {
            continue;
        };
        let told = chosen
            .iter()
            .map(|(knob, value)| format!("{} = {}", knob.name, words(value)));
        settings.push(Setting {
            label: told.collect::<Vec<_>>().join("; "),
            family: family
                .map(|f| format!("{} = {}", chosen[f].0.name, words(chosen[f].1)))
                .unwrap_or_default(),
            numbers: chosen.iter().map(|(_, value)| number(value)).collect(),
            default: params(&graph) == params(&base),
            graph,
        });
    }
    if !settings.iter().any(|setting| setting.default) && !settings.is_empty() {
        let shipped = knobs.iter().map(|knob| (knob, value_at(&base, &knob.at.value)));
        let told = shipped.clone().map(|(knob, value)| {
            let value = value.map_or("as shipped".to_owned(), |value| value.to_string());
            format!("{} = {}", knob.name, value.trim_matches('"'))
        });
        let setting = Setting {
            label: told.collect::<Vec<_>>().join("; "),
            family: "as shipped".to_owned(),
            numbers: shipped
                .map(|(_, value)| value.and_then(|value| value.as_f64()))
                .collect(),
            graph: base,
            default: true,
        };
        settings.insert(0, setting);
    }
    settings
}

fn params(graph: &Graph) -> Vec<(String, ParamValues)> {
    let nodes = graph.nodes().iter().map(|node| (node.id.clone(), node.params()));
    nodes.collect()
}

/// The value of `NODE.PARAM…` in a graph.
fn value_at(graph: &Graph, at: &str) -> Option<serde_json::Value> {
    let mut names = at.split('.');
    let node = names.next()?;
    let params = graph.nodes().iter().find(|n| n.id == node)?.params();
    let mut place = serde_json::Value::Object(params);
    for name in names {
        place = place.get(name)?.clone();
    }
    Some(place)
}

fn number(tree: &Tree) -> Option<f64> {
    match tree.kind {
        TreeKind::Integer(number) => Some(number as f64),
        TreeKind::Float(number) => Some(number),
        _ => None,
    }
}

/// A value in a label.
fn words(tree: &Tree) -> String {
    match &tree.kind {
        TreeKind::Text(text) => text.clone(),
        TreeKind::List(items) => items.iter().map(words).collect::<Vec<_>>().join(" "),
        TreeKind::Map(entries) => entries
            .iter()
            .map(|(key, tree)| format!("{} {}", key.value, words(tree)))
            .collect::<Vec<_>>()
            .join(" "),
        _ => tree.describe().trim_matches('`').to_owned(),
    }
}

/// `{of: OUTPUT[.PLACE], norm: NORM}`.
fn read_error(tree: &Tree, graph: &Graph, reader: &mut Reader) -> Option<(String, Vec<String>, Norm)> {
    let entries = reader.map(tree, "`error`")?;
    reader.keys(entries, "`error`", &["of", "norm"]);
    let (output, path) = match get(entries, "of") {
        Some(tree) => place(tree, "`of`", graph, reader)?,
        None => {
            let help = Some("write `error: {of: OUTPUT, norm: rms}`".to_owned());
            reader.error("missing-key", "`error` has no `of`", tree.span, "of what?", help);
            return None;
        }
    };
    let norm = match get(entries, "norm") {
        Some(tree) => Norm::parse(reader.one_of(tree, "`norm`", &Norm::NAMES)?)?,
        None if path.is_empty() => Norm::Rms,
        None => Norm::Abs,
    };
    Some((output, path, norm))
}

/// `OUTPUT` or `OUTPUT.PLACE` of a graph.
fn place(tree: &Tree, what: &str, graph: &Graph, reader: &mut Reader) -> Option<(String, Vec<String>)> {
    let text = reader.text(tree, what, "an output of the graph")?;
    let mut path = text.split('.').map(str::to_owned);
    let value = path.next()?;
    let given = Spanned { value, span: tree.span };
    let names: Vec<&str> = graph.outputs().iter().map(|output| output.name.as_str()).collect();
    exists(&given, "output", &names, reader);
    Some((given.value, path.collect()))
}

/// `{knob: NAME}`, `{knob: [NAME, NAME]}` or `{of: OUTPUT.PLACE}`.
fn read_operations(tree: &Tree, knobs: &[Knob], graph: &Graph, reader: &mut Reader) -> Option<Operations> {
    let entries = reader.map(tree, "`operations`")?;
    reader.keys(entries, "`operations`", &["knob", "of"]);
    if let Some(tree) = get(entries, "knob") {
        let names: Vec<&str> = knobs.iter().map(|knob| knob.name.as_str()).collect();
        let mut counted = Vec::new();
        let given = reader.words(tree, "`knob`");
        for name in &given {
            match names.iter().position(|known| *known == name.value) {
                Some(knob) => counted.push(knob),
                None => {
                    let help = did_you_mean(&name.value, names.iter().copied());
                    let message = format!("no knob is named `{}`", name.value);
                    reader.error("unknown-knob", message, name.span, "no knob", help);
                }
            }
        }
        return (!counted.is_empty()).then(|| Operations::Knobs {
            names: counted.iter().map(|knob| names[*knob].to_owned()).collect(),
            knobs: counted,
        });
    }
    let (output, path) = place(get(entries, "of")?, "`of`", graph, reader)?;
    Some(Operations::Report { output, path })
}
