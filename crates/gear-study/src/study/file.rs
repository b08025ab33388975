//! A study file, checked completely before anything runs.

use std::collections::BTreeMap;
use std::path::Path;

use gear_graph::{Graph, Library, Mistakes, Registry, Spanned, Tree, TreeKind};

use super::cases::{self, Case, Samples};
use crate::overlay::Overlay;
use crate::read::{Entries, Reader, did_you_mean, get};

/// The version of study files that is read.
pub const STUDY_VERSION: i64 = 1;

const KEYS: [&str; 15] = [
    "study", "title", "about", "graph", "inputs", "nodes", "outputs", "set", "input", "mask", "cases", "variants",
    "baseline", "measures", "groups",
];
const MORE_KEYS: [&str; 3] = ["views", "seed", "paper"];

/// A study that can run.
pub struct Study {
    /// The file's name.
    pub name: String,
    /// The heading of its tables.
    pub title: String,
    /// What it asks, in a few sentences.
    pub about: String,
    /// The input of the graphs that takes the picture of a case.
    pub input: String,
    /// The input of the graphs that takes the mask of a case, if one is to be given.
    pub mask: Option<String>,
    /// What is run on.
    pub cases: Vec<Case>,
    /// What is compared.
    pub variants: Vec<Variant>,
    /// The variant that the others are compared with.
    pub baseline: usize,
    /// What is measured.
    pub measures: Vec<Measure>,
    /// The fields of the cases that tables are broken down by.
    pub groups: Vec<String>,
    /// The output of the graphs whose views are put on contact sheets.
    pub views: Option<String>,
    /// Seed of the intervals.
    pub seed: u64,
    /// Published numbers, if there are any.
    pub paper: Option<Paper>,
}

/// One of the things compared.
pub struct Variant {
    /// Its name in files.
    pub name: String,
    /// Its name in tables.
    pub label: String,
    /// Its graph.
    pub graph: Graph,
    /// Published numbers by measure.
    pub paper: BTreeMap<String, f64>,
}

/// A number of a case and a variant.
#[derive(Clone, Debug, PartialEq)]
pub struct Measure {
    /// Its name in files.
    pub name: String,
    /// Its name in tables.
    pub label: String,
    /// The output of the graph that holds it.
    pub output: String,
    /// Where it stands in that output; empty for a Number.
    pub path: Vec<String>,
    /// Which way is better.
    pub better: Better,
    /// Digits after the point in tables.
    pub digits: usize,
}

/// Which way a measure is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    /// More is better.
    More,
    /// Less is better.
    Less,
    /// Neither; it only describes.
    Neither,
}

/// Published numbers beside which ours are shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Paper {
    /// Where they stand, such as `Table 5 of the paper`.
    pub source: String,
    /// Rows of the published table that no variant stands for: label and numbers by measure.
    pub others: Vec<(String, BTreeMap<String, f64>)>,
}

impl Measure {
    /// The arrow of its label.
    pub fn arrow(&self) -> &'static str {
        match self.better {
            Better::More => " ↑",
            Better::Less => " ↓",
            Better::Neither => "",
        }
    }
}

/// Whether a YAML file is a study: whether it begins with the key `study`.
pub fn is_study(text: &str) -> bool {
    has_key(text, "study")
}

/// Whether a key stands at the left margin of a text.
pub(crate) fn has_key(text: &str, key: &str) -> bool {
    text.lines()
        .any(|line| line.strip_prefix(key).is_some_and(|rest| rest.starts_with(':')))
}

impl Study {
    /// Reads and checks everything; all mistakes at once. `name` is the file's name, or `@name` of one that the library
    /// holds; paths in the study begin at its folder.
    pub fn read(
        name: &str,
        text: &str,
        library: &Library,
        registry: &Registry,
        samples: &dyn Samples,
    ) -> Result<Self, Mistakes> {
        let mut reader = Reader::default();
        let study = reader
            .yaml(name, text)
            .and_then(|tree| read(name, &tree, library, registry, samples, &mut reader));
        match study {
            Some(study) if reader.clean() => Ok(study),
            _ => Err(reader.mistakes()),
        }
    }

    /// The number of a measure by its name.
    pub fn measure(&self, name: &str) -> Option<usize> {
        self.measures.iter().position(|measure| measure.name == name)
    }
}

fn read(
    name: &str,
    tree: &Tree,
    library: &Library,
    registry: &Registry,
    samples: &dyn Samples,
    reader: &mut Reader,
) -> Option<Study> {
    let top = reader.map(tree, "a study file")?;
    of_kind(top, "study", tree, reader)?;
    let known: Vec<&str> = KEYS.into_iter().chain(MORE_KEYS).collect();
    reader.keys(top, "a study file", &known);
    version(top, "study", STUDY_VERSION, tree, reader);
    let cases = match get(top, "cases") {
        Some(tree) => cases::read(tree, name, library, samples, reader),
        None => {
            let help = "add `cases: {samples: …}`, `{files: …}` or `{manifest: …}`".to_owned();
            reader.error(
                "missing-key",
                "the study has no `cases`",
                tree.span,
                "`cases` is missing",
                Some(help),
            );
            Vec::new()
        }
    };
    let measures = measures(top, tree, reader);
    let variants = variants(name, top, tree, &measures, library, registry, reader);
    let text = |key: &str, reader: &mut Reader| {
        let tree = get(top, key)?;
        let value = reader.text(tree, &format!("`{key}`"), "a text")?;
        Some(Spanned {
            value: value.to_owned(),
            span: tree.span,
        })
    };
    let title = text("title", reader).map(|title| title.value);
    let about = text("about", reader).map(|about| about.value).unwrap_or_default();
    let (given, mask, views) = (text("input", reader), text("mask", reader), text("views", reader));
    let input = input_of(given, &variants, reader);
    for variant in &variants {
        lacks(
            &mask,
            "input",
            variant,
            &variant
                .graph
                .inputs()
                .iter()
                .map(|i| i.name.as_str())
                .collect::<Vec<_>>(),
            reader,
        );
        let views_of = variant
            .graph
            .outputs()
            .iter()
            .filter(|o| variant.graph.output_type(o).name == "Views");
        lacks(
            &views,
            "output of type Views",
            variant,
            &views_of.map(|o| o.name.as_str()).collect::<Vec<_>>(),
            reader,
        );
    }
    let baseline = match text("baseline", reader) {
        None => 0,
        Some(given) => variants.iter().position(|v| v.name == given.value).unwrap_or_else(|| {
            let names: Vec<&str> = variants.iter().map(|v| v.name.as_str()).collect();
            let help = did_you_mean(&given.value, names.iter().copied());
            let help = help.unwrap_or_else(|| format!("there are {}", names.join(", ")));
            let message = format!("no variant is named `{}`", given.value);
            reader.error("unknown-variant", message, given.span, "no variant", Some(help));
            0
        }),
    };
    let groups = get(top, "groups")
        .map(|tree| reader.words(tree, "`groups`"))
        .unwrap_or_default();
    for group in &groups {
        if !cases.is_empty() && cases.iter().all(|case| case.field(&group.value).is_none()) {
            let fields: Vec<&str> = cases
                .iter()
                .flat_map(|case| case.fields.iter().map(|(f, _)| f.as_str()))
                .collect();
            let message = format!("no case has the field `{}`", group.value);
            let help = did_you_mean(&group.value, fields.iter().copied());
            reader.error("unknown-group", message, group.span, "no such field", help);
        }
    }
    let seed = get(top, "seed").and_then(|tree| reader.count(tree, "`seed`", 0..=i64::MAX));
    let paper = get(top, "paper").and_then(|tree| paper(tree, &measures, reader));
    (!variants.is_empty()).then(|| Study {
        title: title.unwrap_or_else(|| name.to_owned()),
        name: name.to_owned(),
        about,
        input,
        mask: mask.map(|mask| mask.value),
        cases,
        variants,
        baseline,
        measures,
        groups: groups.into_iter().map(|group| group.value).collect(),
        views: views.map(|views| views.value),
        seed: seed.unwrap_or(1) as u64,
        paper,
    })
}

/// The folder at which the paths of a file begin.
pub(crate) fn folder_of(name: &str) -> std::path::PathBuf {
    match name.starts_with('@') {
        true => Path::new(".").to_path_buf(),
        false => match Path::new(name).parent() {
            Some(folder) if folder != Path::new("") => folder.to_path_buf(),
            _ => Path::new(".").to_path_buf(),
        },
    }
}

/// Whether the file is what it is taken for. One that says to be something else is one mistake, and not many.
pub(crate) fn of_kind(top: &Entries, kind: &str, tree: &Tree, reader: &mut Reader) -> Option<()> {
    const KINDS: [(&str, &str, &str); 3] = [
        ("gear", "a graph", "`gear run` runs it"),
        ("study", "a study", "`gear study` runs it"),
        ("curve", "a curve", "`gear curve` measures it"),
    ];
    let is = |key: &str| top.iter().any(|(name, _)| name.value == key);
    if is(kind) {
        return Some(());
    }
    let Some((key, found, help)) = KINDS.iter().find(|(key, ..)| is(key)) else {
        return Some(());
    };
    let message = format!("this is {found}, not a {kind}");
    let help = format!(
        "{help}; `gear graphs list` lists the {} that come with gear",
        match kind {
            "curve" => "curves",
            _ => "studies",
        }
    );
    let place = top.iter().find(|(name, _)| name.value == *key);
    let span = place.map_or(tree.span, |(name, _)| name.span);
    reader.error(
        "missing-version",
        message,
        span,
        &format!("says that it is {found}"),
        Some(help),
    );
    None
}

/// `study: 1`.
pub(crate) fn version(top: &Entries, key: &str, version: i64, tree: &Tree, reader: &mut Reader) {
    match get(top, key).map(|tree| (&tree.kind, tree)) {
        Some((TreeKind::Integer(found), _)) if *found == version => {}
        Some((TreeKind::Integer(found), tree)) if *found > version => {
            let message = format!("the file is of version {found}, this program reads up to version {version}");
            reader.error(
                "version-too-new",
                message,
                tree.span,
                "too new",
                Some("use a newer gear".to_owned()),
            );
        }
        Some((_, tree)) => reader.expected(
            tree,
            &format!("`{key}`"),
            &format!("the version of the format, {version}"),
        ),
        None => {
            let help = Some(format!("begin with `{key}: {version}`"));
            reader.error(
                "missing-version",
                "the file does not say which version it is",
                tree.span,
                "no version",
                help,
            );
        }
    }
}

/// A name that a variant's graph does not have.
fn lacks(given: &Option<Spanned<String>>, what: &str, variant: &Variant, names: &[&str], reader: &mut Reader) {
    if let Some(given) = given
        && !names.contains(&given.value.as_str())
    {
        let help = did_you_mean(&given.value, names.iter().copied());
        let message = format!("the graph of `{}` has no {what} `{}`", variant.name, given.value);
        let help = help.or_else(|| Some(format!("it has {}", names.join(", "))));
        reader.error("unknown-name", message, given.span, "no such name", help);
    }
}

/// The input that takes the pictures: the one that is named, or the only one that every graph needs.
fn input_of(given: Option<Spanned<String>>, variants: &[Variant], reader: &mut Reader) -> String {
    if let Some(given) = &given {
        for variant in variants {
            let names: Vec<&str> = variant.graph.inputs().iter().map(|i| i.name.as_str()).collect();
            lacks(&Some(given.clone()), "input", variant, &names, reader);
        }
        return given.value.clone();
    }
    let first = variants
        .first()
        .and_then(|v| v.graph.inputs().iter().find(|input| !input.optional));
    first.map(|input| input.name.clone()).unwrap_or_default()
}

/// `gear`, `nodes`, `set`, … of the study or of a variant.
fn changes<'t>(entries: &'t Entries, what: &str, reader: &mut Reader, overlay: &mut Overlay<'t>) {
    for (key, tree) in entries {
        match key.value.as_str() {
            "inputs" | "nodes" | "outputs" => overlay.sections.push((key, tree)),
            "set" => {
                let sets = reader.map(tree, &format!("`set` of {what}")).unwrap_or_default();
                overlay.sets.extend(sets.iter().map(|(key, tree)| (key, tree)));
            }
            _ => {}
        }
    }
}

fn variants(
    name: &str,
    top: &Entries,
    tree: &Tree,
    measures: &[Measure],
    library: &Library,
    registry: &Registry,
    reader: &mut Reader,
) -> Vec<Variant> {
    let graph = get(top, "graph").and_then(|tree| {
        let value = reader.text(tree, "`graph`", "the path of a graph file, or `@name`")?;
        Some(Spanned {
            value: value.to_owned(),
            span: tree.span,
        })
    });
    let Some(section) = get(top, "variants") else {
        let help = "add `variants: {one: {set: {NODE.PARAM: VALUE}}, two: {}}`".to_owned();
        reader.error(
            "missing-key",
            "the study has no `variants`",
            tree.span,
            "`variants` is missing",
            Some(help),
        );
        return Vec::new();
    };
    let entries = reader.map(section, "`variants`").unwrap_or_default();
    if entries.is_empty() && reader.clean() {
        reader.error("missing-key", "the study has no variant", section.span, "empty", None);
    }
    let mut variants = Vec::new();
    for (key, tree) in entries {
        let what = format!("variant `{}`", key.value);
        let nothing: &Entries = &[];
        let own = match tree.kind {
            TreeKind::Null => nothing,
            _ => reader.map(tree, &what).unwrap_or_default(),
        };
        reader.keys(
            own,
            &what,
            &["label", "graph", "inputs", "nodes", "outputs", "set", "paper"],
        );
        let given = get(own, "graph").and_then(|tree| {
            let value = reader.text(
                tree,
                &format!("`graph` of {what}"),
                "the path of a graph file, or `@name`",
            )?;
            Some(Spanned {
                value: value.to_owned(),
                span: tree.span,
            })
        });
        let Some(base) = given.or_else(|| graph.clone()) else {
            let help = "add `graph: '@gear'` to the variant, or to the study for all of them".to_owned();
            reader.error(
                "missing-key",
                format!("{what} has no graph"),
                key.span,
                "no graph",
                Some(help),
            );
            continue;
        };
        let mut overlay = Overlay {
            graph: base,
            sections: Vec::new(),
            sets: Vec::new(),
        };
        // What the study changes comes first; sections of a variant replace those of the study.
        changes(top, "the study", reader, &mut overlay);
        let sections: Vec<&str> = own.iter().map(|(key, _)| key.value.as_str()).collect();
        overlay
            .sections
            .retain(|(key, _)| !sections.contains(&key.value.as_str()));
        changes(own, &what, reader, &mut overlay);
        let label = get(own, "label").and_then(|tree| reader.word(tree, &format!("`label` of {what}")));
        let paper = get(own, "paper").map(|tree| numbers(tree, &format!("`paper` of {what}"), measures, reader));
        if let Some(graph) = overlay.check(reader, name, library, registry) {
            for measure in measures {
                measured(measure, &key.value, &graph, top, reader);
            }
            variants.push(Variant {
                name: cases::plain(&key.value),
                label: label.unwrap_or_else(|| key.value.clone()),
                graph,
                paper: paper.unwrap_or_default(),
            });
        }
    }
    variants
}

/// Reports a measure that a graph does not give.
fn measured(measure: &Measure, variant: &str, graph: &Graph, top: &Entries, reader: &mut Reader) {
    let span = get(top, "measures").and_then(|tree| match &tree.kind {
        TreeKind::Map(entries) => entries
            .iter()
            .find(|(key, _)| key.value == measure.name)
            .map(|(_, tree)| tree.span),
        _ => None,
    });
    let span = span.unwrap_or_default();
    let output = graph.outputs().iter().find(|output| output.name == measure.output);
    let problem = match output.map(|output| graph.output_type(output).name) {
        Some("Report") if !measure.path.is_empty() => return,
        Some("Number") if measure.path.is_empty() => return,
        Some("Report") => format!(
            "`{}` is a Report; name the number in it, as in `{}.vend`",
            measure.output, measure.output
        ),
        Some(other) => format!(
            "`{}` is a {other}, and a measure is taken from a Report or a Number",
            measure.output
        ),
        None => format!("the graph of `{variant}` has no output `{}`", measure.output),
    };
    let names = graph.outputs().iter().map(|output| output.name.as_str());
    let help = output.is_none().then(|| did_you_mean(&measure.output, names)).flatten();
    reader.error("unknown-measure", problem, span, "cannot be measured", help);
}

fn measures(top: &Entries, tree: &Tree, reader: &mut Reader) -> Vec<Measure> {
    let Some(section) = get(top, "measures") else {
        let help = "add `measures: {vend: metrics.vend}`".to_owned();
        reader.error(
            "missing-key",
            "the study has no `measures`",
            tree.span,
            "`measures` is missing",
            Some(help),
        );
        return Vec::new();
    };
    let mut measures = Vec::new();
    for (key, tree) in reader.map(section, "`measures`").unwrap_or_default() {
        let what = format!("measure `{}`", key.value);
        let nothing: &Entries = &[];
        let (at, own) = match &tree.kind {
            TreeKind::Map(entries) => {
                reader.keys(entries, &what, &["at", "label", "better", "digits"]);
                (get(entries, "at").unwrap_or(tree), &entries[..])
            }
            _ => (tree, nothing),
        };
        let Some(at) = reader.text(at, &what, "an output and a place in it, such as `metrics.vend`") else {
            continue;
        };
        let mut path = at.split('.').map(str::to_owned);
        let label = get(own, "label").and_then(|tree| reader.word(tree, &format!("`label` of {what}")));
        let better = get(own, "better")
            .and_then(|tree| reader.one_of(tree, &format!("`better` of {what}"), &["more", "less", "neither"]));
        let digits = get(own, "digits").and_then(|tree| reader.count(tree, &format!("`digits` of {what}"), 0..=9));
        measures.push(Measure {
            name: key.value.clone(),
            label: label.unwrap_or_else(|| key.value.clone()),
            output: path.next().unwrap_or_default(),
            path: path.collect(),
            better: match better {
                Some("more") => Better::More,
                Some("less") => Better::Less,
                _ => Better::Neither,
            },
            digits: digits.unwrap_or(2),
        });
    }
    measures
}

/// Numbers by measure.
fn numbers(tree: &Tree, what: &str, measures: &[Measure], reader: &mut Reader) -> BTreeMap<String, f64> {
    let mut numbers = BTreeMap::new();
    let names: Vec<&str> = measures.iter().map(|measure| measure.name.as_str()).collect();
    let entries = reader.map(tree, what).unwrap_or_default();
    reader.keys(entries, what, &names);
    for (key, tree) in entries {
        if let Some(number) = reader.number(tree, &format!("`{}` of {what}", key.value)) {
            numbers.insert(key.value.clone(), number);
        }
    }
    numbers
}

fn paper(tree: &Tree, measures: &[Measure], reader: &mut Reader) -> Option<Paper> {
    let entries = reader.map(tree, "`paper`")?;
    reader.keys(entries, "`paper`", &["source", "others"]);
    let source = get(entries, "source").and_then(|tree| reader.word(tree, "`source` of `paper`"));
    let mut others = Vec::new();
    if let Some(tree) = get(entries, "others") {
        for (key, tree) in reader.map(tree, "`others` of `paper`").unwrap_or_default() {
            others.push((
                key.value.clone(),
                numbers(tree, &format!("`{}`", key.value), measures, reader),
            ));
        }
    }
    Some(Paper {
        source: source.unwrap_or_else(|| "the paper".to_owned()),
        others,
    })
}
