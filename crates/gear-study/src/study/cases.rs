//! What the graphs of a study are run on: samples, files by pattern, or a collection with its manifest.

use std::path::{Path, PathBuf};

use gear_graph::{Graph, GraphInput, Input, Library, Tree};

use super::file::folder_of;
use super::manifest;
use crate::read::{Entries, Reader, get};

/// Makes samples; whoever knows how to paint them lends it.
pub trait Samples: Sync {
    /// The motifs.
    fn names(&self) -> Vec<String>;

    /// What is wrong with `NAME` or `NAME,OPTION=VALUE,…`, if anything is.
    fn flaw(&self, sample: &str) -> Option<String>;

    /// The sample as an input of a graph: the picture itself for a picture, its true mask for a mask.
    fn input(&self, sample: &str, input: &GraphInput, graph: &Graph) -> Result<Input, String>;
}

/// Where a picture comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// `NAME,OPTION=VALUE,…`, as [`Samples`] reads it.
    Sample(String),
    /// A file.
    File(PathBuf),
}

/// One picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Case {
    /// Its name in tables and of files; no other case has it.
    pub name: String,
    /// The picture.
    pub picture: Source,
    /// Its mask, if one is known.
    pub mask: Option<Source>,
    /// What is known of it, such as (`tradition`, `Ukiyo-e`), in the order of the manifest.
    pub fields: Vec<(String, String)>,
}

impl Case {
    /// A field of the manifest or an option of the sample.
    pub fn field(&self, name: &str) -> Option<&str> {
        let found = self.fields.iter().find(|(field, _)| field == name);
        found.map(|(_, value)| value.as_str())
    }
}

impl std::fmt::Display for Source {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Sample(name) => write!(f, "sample:{name}"),
            Self::File(path) => write!(f, "{}", path.display()),
        }
    }
}

impl Source {
    /// `sample:NAME…`, or a path from a folder.
    pub fn parse(text: &str, folder: &Path) -> Self {
        match text.strip_prefix("sample:") {
            Some(sample) => Self::Sample(sample.to_owned()),
            None => Self::File(folder.join(text)),
        }
    }

    /// What is wrong with it, if anything is.
    pub(crate) fn flaw(&self, samples: &dyn Samples) -> Option<String> {
        match self {
            Self::Sample(sample) => samples.flaw(sample),
            Self::File(path) => (!path.is_file()).then(|| format!("{}: there is no such file", path.display())),
        }
    }
}

/// Most cases of one study: what is more was meant otherwise.
const MOST: usize = 100_000;

/// Reads the section `cases` of a study. Paths begin at its folder.
pub(super) fn read(
    tree: &Tree,
    study: &str,
    library: &Library,
    samples: &dyn Samples,
    reader: &mut Reader,
) -> Vec<Case> {
    let folder = &folder_of(study);
    let mut cases = Vec::new();
    let Some(entries) = reader.map(tree, "`cases`") else {
        return cases;
    };
    reader.keys(entries, "`cases`", &["samples", "files", "manifest"]);
    if let Some(tree) = get(entries, "samples")
        && let Some(entries) = reader.map(tree, "`samples`")
    {
        sampled(entries, tree, samples, reader, &mut cases);
    }
    if let Some(tree) = get(entries, "files") {
        let mut seen = std::collections::BTreeSet::new();
        for pattern in reader.words(tree, "`files`") {
            let mut found = matching(folder, &pattern.value);
            if found.is_empty() {
                let message = format!("no file matches `{}`", pattern.value);
                let help = format!(
                    "patterns begin at {}; `*` and `?` stand for parts of names",
                    folder.display()
                );
                reader.error("no-case", message, pattern.span, "nothing found", Some(help));
            }
            // A file that two patterns match is one case.
            found.retain(|path| seen.insert(path.canonicalize().unwrap_or_else(|_| path.clone())));
            cases.extend(found.into_iter().map(|path| Case {
                name: stem(&path),
                picture: Source::File(path),
                mask: None,
                fields: Vec::new(),
            }));
        }
    }
    if let Some(tree) = get(entries, "manifest")
        && let Some(path) = reader.text(tree, "`manifest`", "the path of a manifest")
    {
        cases.extend(manifest::open(path, tree.span, (study, library), samples, reader));
    }
    if cases.is_empty() && reader.clean() {
        let help = "give `samples`, `files` or `manifest`".to_owned();
        reader.error(
            "no-case",
            "the study has no case",
            tree.span,
            "nothing to run on",
            Some(help),
        );
    }
    name_apart(&mut cases);
    cases
}

/// Every combination of the motifs and the values of the options.
fn sampled(entries: &Entries, tree: &Tree, samples: &dyn Samples, reader: &mut Reader, cases: &mut Vec<Case>) {
    let mut axes: Vec<(String, Vec<String>)> = Vec::new();
    let mut names = samples.names();
    for (key, tree) in entries {
        let words = reader.words(tree, &format!("`{}` of `samples`", key.value));
        // Each value is looked at alone, so that a mistake is shown where it stands.
        for word in &words {
            let probe = match (key.value.as_str(), names.first()) {
                ("names", _) => word.value.clone(),
                (option, Some(name)) => format!("{name},{option}={}", word.value),
                (_, None) => continue,
            };
            if let Some(flaw) = samples.flaw(&probe) {
                reader.error("bad-sample", flaw, word.span, "not a sample", None);
            }
        }
        let words: Vec<String> = words.into_iter().map(|word| word.value).collect();
        if key.value == "names" {
            names = words;
        } else {
            axes.push((key.value.clone(), words));
        }
    }
    let combinations: usize = axes.iter().map(|(_, values)| values.len()).product();
    let count = combinations.saturating_mul(names.len());
    if count > MOST {
        let message = format!("these are {count} samples");
        reader.error(
            "too-many",
            message,
            tree.span,
            "too many",
            Some(format!("at most {MOST} are run")),
        );
        return;
    }
    for name in names {
        for combination in 0..combinations {
            let mut rest = combination;
            let mut chosen = Vec::new();
            for (option, values) in axes.iter().rev() {
                chosen.push((option.clone(), values[rest % values.len()].clone(), values.len() > 1));
                rest /= values.len();
            }
            chosen.reverse();
            cases.push(sample_case(&name, &chosen));
        }
    }
}

/// The case of one sample with options (name, value, whether the name of the case tells it).
fn sample_case(name: &str, options: &[(String, String, bool)]) -> Case {
    let query: Vec<_> = options
        .iter()
        .map(|(option, value, _)| format!("{option}={value}"))
        .collect();
    let sample = match query.is_empty() {
        true => name.to_owned(),
        false => format!("{name},{}", query.join(",")),
    };
    let told = options
        .iter()
        .filter(|(.., told)| *told)
        .map(|(_, value, _)| value.as_str());
    let mut fields = vec![("motif".to_owned(), name.to_owned())];
    fields.extend(options.iter().map(|(option, value, _)| (option.clone(), value.clone())));
    Case {
        name: plain(&std::iter::once(name).chain(told).collect::<Vec<_>>().join("-")),
        picture: Source::Sample(sample.clone()),
        mask: Some(Source::Sample(sample)),
        fields,
    }
}

/// The name of a file without its extension, as a part of other names.
pub(super) fn stem(path: &Path) -> String {
    plain(&path.file_stem().unwrap_or_default().to_string_lossy())
}

/// A text as a part of the names of files on any system.
pub(super) fn plain(text: &str) -> String {
    let kept = |c: char| {
        if c.is_alphanumeric() || "+-_.,".contains(c) {
            c
        } else {
            '_'
        }
    };
    text.chars().map(kept).collect()
}

/// Gives cases of one name different ones.
fn name_apart(cases: &mut [Case]) {
    let mut seen = std::collections::BTreeSet::new();
    for case in cases {
        let name = case.name.clone();
        let mut number = 2;
        while !seen.insert(case.name.to_lowercase()) {
            case.name = format!("{name}-{number}");
            number += 1;
        }
    }
}

/// The files that match a pattern, sorted: `*` is any part of one name, `?` any character of it.
fn matching(folder: &Path, pattern: &str) -> Vec<PathBuf> {
    let mut places = vec![PathBuf::new()];
    let root = if Path::new(pattern).is_absolute() {
        PathBuf::from("/")
    } else {
        folder.to_path_buf()
    };
    for part in pattern.split('/').filter(|part| !part.is_empty() && *part != ".") {
        let mut next = Vec::new();
        for place in &places {
            if part == ".." || !part.contains(['*', '?']) {
                next.push(place.join(part));
                continue;
            }
            let entries = std::fs::read_dir(root.join(place)).into_iter().flatten().flatten();
            let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
            let mut names: Vec<_> = names
                .filter(|name| !name.starts_with('.') && matches(part, name))
                .collect();
            names.sort();
            next.extend(names.into_iter().map(|name| place.join(name)));
        }
        places = next;
    }
    let files = places.into_iter().map(|place| root.join(place));
    files.filter(|path| path.is_file()).collect()
}

/// Whether a name matches a pattern of one name.
fn matches(pattern: &str, name: &str) -> bool {
    let (pattern, name): (Vec<char>, Vec<char>) = (pattern.chars().collect(), name.chars().collect());
    let (mut p, mut n) = (0, 0);
    // Where the last `*` stood, and how much of the name it holds.
    let mut star: Option<(usize, usize)> = None;
    while n < name.len() {
        if p < pattern.len() && (pattern[p] == '?' || (pattern[p] == name[n] && pattern[p] != '*')) {
            (p, n) = (p + 1, n + 1);
        } else if p < pattern.len() && pattern[p] == '*' {
            star = Some((p, n));
            p += 1;
        } else if let Some((at, held)) = star {
            star = Some((at, held + 1));
            (p, n) = (at + 1, held + 1);
        } else {
            return false;
        }
    }
    pattern[p..].iter().all(|c| *c == '*')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_match_as_in_a_shell() {
        for (pattern, name, expected) in [
            ("*.jpg", "a.jpg", true),
            ("*.jpg", "a.png", false),
            ("a*b*c", "aXbYc", true),
            ("a*b*c", "abbc", true),
            ("a*b*c", "acb", false),
            ("??.png", "ab.png", true),
            ("??.png", "a.png", false),
            ("*", "", true),
        ] {
            assert_eq!(matches(pattern, name), expected, "{pattern} {name}");
        }
    }

    #[test]
    fn files_are_found_below_folders_in_a_fixed_order() {
        let root = tempfile::tempdir().unwrap();
        for name in ["b/two.jpg", "a/one.jpg", "a/note.txt", "a/.hidden.jpg"] {
            let path = root.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "x").unwrap();
        }
        let found = matching(root.path(), "*/*.jpg");
        let names: Vec<_> = found.iter().map(|path| stem(path)).collect();
        assert_eq!(names, ["one", "two"]);
        assert_eq!(matching(root.path(), "a/one.jpg").len(), 1);
        assert!(matching(root.path(), "a/three.jpg").is_empty());
    }

    #[test]
    fn cases_of_one_name_are_told_apart() {
        let case = |name: &str| sample_case(name, &[]);
        let mut cases = vec![case("a"), case("A"), case("a")];
        name_apart(&mut cases);
        let names: Vec<_> = cases.iter().map(|case| case.name.as_str()).collect();
        assert_eq!(names, ["a", "A-2", "a-3"]);
    }
}
