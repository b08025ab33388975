//! Where graph files are found: on disk, and in the program itself under names such as `@gear`.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{ErrorKind, Read};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use super::nearest;
use crate::Digest;

/// Graphs of 100,000 nodes take 10 MB; what is much larger is no graph, and a device has no end.
const LARGEST: u64 = 256 << 20;

/// Where graph files are found: on disk, and as `@NAME` in the program itself.
#[derive(Clone, Debug, Default)]
pub struct Library {
    held: Arc<BTreeMap<String, Cow<'static, str>>>,
}

/// A file that a graph was read from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GraphFile {
    /// The name under which [`Library::read`] finds it.
    pub name: String,
    /// The digest of its bytes.
    pub digest: Digest,
}

/// Why a graph file could not be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the graph {name} cannot be read: {cause}{}", help.as_ref().map(|help| format!("; {help}")).unwrap_or_default())]
pub struct Unreadable {
    /// The file.
    pub name: String,
    /// Why.
    pub cause: String,
    /// What to do.
    pub help: Option<String>,
}

impl Unreadable {
    /// What happened, without what to do.
    pub(super) fn summary(&self) -> String {
        format!("the graph `{}` cannot be read: {}", self.name, self.cause)
    }
}

impl Library {
    /// A library that holds these graphs besides the files on disk, each by its name without `@`.
    pub fn holding<N: Into<String>, T: Into<Cow<'static, str>>>(graphs: impl IntoIterator<Item = (N, T)>) -> Self {
        let held = graphs.into_iter().map(|(name, text)| (name.into(), text.into()));
        Self {
            held: Arc::new(held.collect()),
        }
    }

    /// The text of a file: `@NAME`, or a path.
    pub fn read(&self, name: &str) -> Result<Cow<'static, str>, Unreadable> {
        let unreadable = |cause: &str, help: Option<String>| Unreadable {
            name: name.to_owned(),
            cause: cause.to_owned(),
            help,
        };
        if let Some(held) = name.strip_prefix('@') {
            return self.held.get(held).cloned().ok_or_else(|| {
                // What has an extension is no graph, but read by one.
                let names = self.held.keys().map(String::as_str).filter(|name| !name.contains('.'));
                let help = match nearest(held, names.clone()) {
                    Some(near) => Some(format!("did you mean `@{near}`?")),
                    None if self.held.is_empty() => None,
                    None => Some(format!("there are @{}", names.collect::<Vec<_>>().join(", @"))),
                };
                unreadable("no graph of that name comes with gear", help)
            });
        }
        match read(Path::new(name)) {
            Ok(text) => Ok(text.into()),
            Err(cause) => Err(match cause.kind() {
                ErrorKind::NotFound => unreadable(
                    "there is no such file",
                    self.without_at(name).or_else(|| neighbour(Path::new(name))),
                ),
                ErrorKind::IsADirectory => unreadable("this is a folder", self.without_at(name)),
                ErrorKind::InvalidData => unreadable("this is not text in UTF-8", self.without_at(name)),
                ErrorKind::FileTooLarge => unreadable(&format!("it is larger than {} MiB", LARGEST >> 20), None),
                _ => unreadable(&cause.to_string(), None),
            }),
        }
    }

    /// What to write for the name of a graph in the program that lacks its `@`, or also its folder. A path that
    /// was resolved begins at the folder of the file that names it: what is behind the last `/` may be such a name.
    fn without_at(&self, name: &str) -> Option<String> {
        let plain = name.trim_start_matches("./").trim_end_matches(".yaml");
        let last = plain.rsplit('/').next().unwrap_or(plain);
        let names = || self.held.keys().map(String::as_str);
        let is = |held: &&str| *held == plain || held.rsplit('/').next() == Some(last);
        let held = names().find(|held| *held == plain).or_else(|| names().find(is))?;
        Some(format!("a file of that name comes with gear: write `@{held}`"))
    }

    /// The name of the file that `reference` means in the file `from`. Paths begin at the folder of that file.
    pub(super) fn resolve(&self, from: &str, reference: &str) -> String {
        if reference.starts_with('@') || Path::new(reference).is_absolute() {
            return reference.to_owned();
        }
        if let Some(from) = from.strip_prefix('@') {
            let path = tidy(&Path::new(from).with_file_name(reference));
            let name = path.with_extension("").to_string_lossy().replace('\\', "/");
            return format!("@{name}");
        }
        let path = Path::new(from).with_file_name(reference);
        let tidy = tidy(&path);
        // Behind a link to a folder, `..` is not the folder before it.
        let same = identity(&path.to_string_lossy()) == identity(&tidy.to_string_lossy());
        (if same { tidy } else { path }).to_string_lossy().into_owned()
    }
}

/// What is equal for two names of one file.
pub(super) fn identity(name: &str) -> PathBuf {
    if name.starts_with('@') {
        return name.into();
    }
    std::fs::canonicalize(name).unwrap_or_else(|_| tidy(Path::new(name)))
}

fn read(path: &Path) -> std::io::Result<String> {
    let mut text = String::new();
    let read = std::fs::File::open(path)?.take(LARGEST + 1).read_to_string(&mut text)?;
    if read as u64 > LARGEST {
        return Err(ErrorKind::FileTooLarge.into());
    }
    Ok(text)
}

/// A path without `.`, and without `folder/..`.
fn tidy(path: &Path) -> PathBuf {
    let mut tidy = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if matches!(tidy.components().next_back(), Some(Component::Normal(_))) => {
                tidy.pop();
            }
            part => tidy.push(part),
        }
    }
    tidy
}

/// The file beside a missing one that was most likely meant.
fn neighbour(missing: &Path) -> Option<String> {
    let folder = match missing.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let names: Vec<String> = std::fs::read_dir(folder)
        .ok()?
        .take(10_000)
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    let near = nearest(missing.file_name()?.to_str()?, names.iter().map(String::as_str))?;
    Some(format!("did you mean `{}`?", missing.with_file_name(near).display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_begin_at_the_folder_of_the_file() {
        let library = Library::default();
        for (from, reference, name) in [
            ("graph.yaml", "base.yaml", "base.yaml"),
            ("graph.yaml", "./base.yaml", "base.yaml"),
            ("a/b/graph.yaml", "../base.yaml", "a/base.yaml"),
            ("a/graph.yaml", "../../base.yaml", "../base.yaml"),
            ("a/graph.yaml", "/base.yaml", "/base.yaml"),
            ("a/graph.yaml", "@gear", "@gear"),
            ("@ablations/plain", "../gear.yaml", "@gear"),
            ("@ablations/plain", "other.yaml", "@ablations/other"),
        ] {
            assert_eq!(library.resolve(from, reference), name, "{reference} in {from}");
        }
    }

    #[test]
    fn what_cannot_be_read_is_told_in_plain_words() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).display().to_string();
        let library = Library::holding([("gear", "gear: 1"), ("baselines/raw", "gear: 1")]);
        let cause = |name: &str| library.read(name).unwrap_err().cause;
        let help = |name: &str| library.read(name).unwrap_err().help.unwrap_or_default();
        assert_eq!(library.read("@gear").unwrap(), "gear: 1");
        assert_eq!(cause("@gaer"), "no graph of that name comes with gear");
        assert_eq!(help("@gaer"), "did you mean `@gear`?");
        assert_eq!(help("@something-else"), "there are @baselines/raw, @gear");
        assert_eq!(help("gear"), "a file of that name comes with gear: write `@gear`");
        assert_eq!(
            help("raw.yaml"),
            "a file of that name comes with gear: write `@baselines/raw`"
        );
        assert_eq!(cause(&path("")), "this is a folder");
        assert_eq!(cause(&path("picture.yaml")), "there is no such file");
        std::fs::write(path("picture.yaml"), [0xff, 0xd8, 0xff]).unwrap();
        assert_eq!(cause(&path("picture.yaml")), "this is not text in UTF-8");
        assert_eq!(
            help(&path("pictrue.yaml")),
            format!("did you mean `{}`?", path("picture.yaml"))
        );
    }

    #[cfg(unix)]
    #[test]
    fn a_device_without_end_is_refused() {
        let cause = Library::default().read("/dev/zero").unwrap_err().cause;
        assert_eq!(cause, "it is larger than 256 MiB");
    }
}
