//! Where the crate goes, and what else changes there.

use std::path::{Path, PathBuf};

use gear_graph::Registry;

use super::plan::{Edit, Plan};
use super::template;
use super::{Draft, Refusal};
use crate::commands::nodes::markdown;

/// The list of registrations.
const REGISTRY: &str = "crates/gear-cli/src/registry.rs";
/// The reference in the book.
const REFERENCE: &str = "docs/src/reference.md";

/// Where the crate goes.
#[derive(Debug)]
pub enum Place {
    /// Into the repository of gear.
    Repository { root: PathBuf },
    /// Into a folder of its own, beside a repository of gear that it builds upon.
    Outside {
        parent: PathBuf,
        gear: PathBuf,
        why: &'static str,
    },
}

impl Place {
    /// The repository that `here` lies in; or `here`, building upon the repository that this binary was made from.
    pub fn find(here: &Path) -> Result<Self, Refusal> {
        if let Some(root) = here.ancestors().find(|folder| is_gear(folder)) {
            return Ok(Self::Repository {
                root: root.to_path_buf(),
            });
        }
        // crates/gear-cli
        let built_from = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2);
        match built_from.filter(|folder| is_gear(folder)) {
            Some(gear) => Ok(Self::Outside {
                parent: here.to_path_buf(),
                gear: gear.to_path_buf(),
                why: "the one that this gear was built from; `--gear DIR` gives another",
            }),
            None => Err(Refusal::new(
                "this folder is not in gear's repository, and the one that this gear was built from is gone; \
                 say with --gear DIR where gear's repository is",
            )),
        }
    }

    /// `here`, building upon the repository `gear`.
    pub fn outside(here: &Path, gear: &Path) -> Result<Self, Refusal> {
        let found = gear.canonicalize().ok().filter(|folder| is_gear(folder));
        match found {
            Some(gear) => Ok(Self::Outside {
                parent: here.to_path_buf(),
                gear,
                why: "as given",
            }),
            None => Err(Refusal::new(format!(
                "--gear {}: this is not gear's repository; expected a folder with crates/gear-graph and crates/gear-cli",
                gear.display()
            ))),
        }
    }

    /// What is to be written.
    pub fn plan(&self, draft: &Draft, registry: &Registry) -> Result<Plan, Refusal> {
        match self {
            Self::Repository { root } => inside(root, draft),
            Self::Outside { parent, gear, why } => beside(parent, gear, why, draft, registry),
        }
    }
}

fn is_gear(folder: &Path) -> bool {
    let package = |name: &str| folder.join("crates").join(name).join("Cargo.toml").is_file();
    folder.join("Cargo.toml").is_file()
        && package("gear-graph")
        && package("gear-cli")
        && folder.join(REGISTRY).is_file()
}

fn inside(root: &Path, draft: &Draft) -> Result<Plan, Refusal> {
    let names = &draft.names;
    let (package, kebab) = (names.package(), &names.kebab);
    let mut edits = vec![
        edit(root, "Cargo.toml", "in the dependency table", |text| {
            sorted_in(text, "node-", &format!("{package} = {{ path = \"nodes/{kebab}\" }}"))
        })?,
        edit(
            root,
            "crates/gear-cli/Cargo.toml",
            "a dependency of the binary",
            |text| sorted_in(text, "node-", &format!("{package}.workspace = true")),
        )?,
        edit(root, REGISTRY, "registered", |text| {
            after_last(
                text,
                "    node_",
                &format!("    {}::register(&mut registry);", names.module()),
            )
        })?,
    ];
    let mut notes = Vec::new();
    let reference = std::fs::read_to_string(root.join(REFERENCE)).ok().and_then(|before| {
        let after = markdown::with_node(&before, &template::spec(draft))?;
        Some(Edit::new(root, REFERENCE, "described", before, after))
    });
    match reference {
        Some(edit) => edits.push(edit),
        None => notes.push(format!("then `{}`, which describes it", markdown::UPDATE)),
    }
    notes.insert(
        0,
        format!("now `cargo test -p {package}`, then write its `run` in nodes/{kebab}/src/lib.rs"),
    );
    Ok(Plan {
        folder: root.join("nodes").join(kebab),
        shown: format!("nodes/{kebab}"),
        files: template::inside(draft)?,
        edits,
        notes,
    })
}

fn beside(parent: &Path, gear: &Path, why: &str, draft: &Draft, registry: &Registry) -> Result<Plan, Refusal> {
    let kebab = &draft.names.kebab;
    let mut files = template::outside(draft, gear, registry)?;
    // The versions that gear is tested with; the functions that have other bits on other machines; the width of lines.
    for name in ["Cargo.lock", "clippy.toml", "rustfmt.toml"] {
        if let Ok(text) = std::fs::read_to_string(gear.join(name)) {
            files.push((name.to_owned(), text));
        }
    }
    let mut notes = vec![
        format!("gear's crates are those in {} ({why})", gear.display()),
        format!("now `cd {kebab}` and `cargo test`, then write the node's `run` in src/lib.rs"),
    ];
    if files.iter().any(|(name, _)| name == template::GRAPH) {
        notes.push(format!("`cargo run --release -- run {} …` runs it", template::GRAPH));
    }
    Ok(Plan {
        folder: parent.join(kebab),
        shown: kebab.clone(),
        files,
        edits: Vec::new(),
        notes,
    })
}

fn edit(
    root: &Path,
    name: &'static str,
    done: &'static str,
    change: impl FnOnce(&str) -> Result<String, String>,
) -> Result<Edit, Refusal> {
    let path = root.join(name);
    let before = std::fs::read_to_string(&path).map_err(|e| Refusal::new(format!("{name} cannot be read: {e}")))?;
    let after = change(&before).map_err(|cause| Refusal::new(format!("{name}: {cause}")))?;
    Ok(Edit::new(root, name, done, before, after))
}

/// The text with `line` among the lines that begin alike, in order.
fn sorted_in(text: &str, begin: &str, line: &str) -> Result<String, String> {
    let name = |line: &str| line.split(['.', ' ', '=']).next().unwrap_or_default().to_owned();
    let lines: Vec<&str> = text.lines().collect();
    let alike = |i: &usize| lines[*i].starts_with(begin);
    if let Some(there) = (0..lines.len()).filter(alike).find(|&i| name(lines[i]) == name(line)) {
        return Err(format!("`{}` is there already; take another name", name(lines[there])));
    }
    let before = (0..lines.len()).filter(alike).find(|&i| name(lines[i]) > name(line));
    let last = (0..lines.len()).rfind(alike);
    match before.or(last.map(|i| i + 1)) {
        Some(at) => Ok(with_line(&lines, at, line)),
        None => Err(format!("expected lines that begin with `{begin}`, found none")),
    }
}

/// The text with `line` after the last line that begins so.
fn after_last(text: &str, begin: &str, line: &str) -> Result<String, String> {
    let lines: Vec<&str> = text.lines().collect();
    match lines.iter().rposition(|other| other.starts_with(begin)) {
        _ if lines.contains(&line) => Err(format!("`{}` is there already; take another name", line.trim())),
        Some(i) => Ok(with_line(&lines, i + 1, line)),
        None => Err(format!("expected lines that begin with `{}`, found none", begin.trim())),
    }
}

fn with_line(lines: &[&str], at: usize, line: &str) -> String {
    let mut lines = lines.to_vec();
    lines.insert(at, line);
    lines.join("\n") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_goes_where_its_name_belongs() {
        let text = "a\nnode-b.workspace = true\nnode-d = {}\nz\n";
        let at = |name: &str| {
            let text = sorted_in(text, "node-", &format!("{name}.workspace = true")).unwrap();
            text.lines().position(|line| line.starts_with(name)).unwrap()
        };
        assert_eq!([at("node-a"), at("node-c"), at("node-e")], [1, 2, 3]);
        assert!(sorted_in(text, "node-", "node-d.workspace = true").is_err());
        assert!(sorted_in("a\n", "node-", "node-d = {}").is_err());
    }
}
