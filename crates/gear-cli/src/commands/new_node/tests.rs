//! Plans, looked at without a compiler; that what they write compiles is shown by the system tests.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::*;
use crate::commands::nodes::markdown;

/// A repository that has just what is looked at.
fn repository() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let real = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for name in [
        "Cargo.toml",
        "crates/gear-cli/Cargo.toml",
        "crates/gear-cli/src/registry.rs",
        "crates/gear-graph/Cargo.toml",
    ] {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::copy(real.join(name), path).unwrap();
    }
    std::fs::create_dir_all(folder.path().join("nodes")).unwrap();
    std::fs::create_dir_all(folder.path().join("docs/src")).unwrap();
    let reference = markdown::reference(&crate::registry());
    std::fs::write(folder.path().join("docs/src/reference.md"), reference).unwrap();
    folder
}

fn drafted(name: &str, inputs: &[&str], outputs: &[&str]) -> Result<Draft, Refusal> {
    let args = NewNodeArgs {
        name: name.to_owned(),
        input: inputs.iter().map(ToString::to_string).collect(),
        output: outputs.iter().map(ToString::to_string).collect(),
        gear: None,
    };
    draft(&args, &crate::registry())
}

fn write(root: &Path, draft: &Draft) -> Result<String, Refusal> {
    Place::find(root)?.plan(draft, &crate::registry())?.write()
}

/// Every file below a folder, with its text.
fn everything(root: &Path) -> BTreeMap<PathBuf, String> {
    let mut found = BTreeMap::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                found.insert(path.clone(), std::fs::read_to_string(&path).unwrap());
            }
        }
    }
    found
}

#[test]
fn a_node_is_entered_everywhere_once() {
    let root = repository();
    let done = write(root.path(), &drafted("OilCrackle", &[], &[]).unwrap()).unwrap();
    assert!(done.contains("cargo test -p node-oil-crackle"), "{done}");
    let files = everything(root.path());
    let text = |name: &str| &files[&root.path().join(name)];
    for (name, line) in [
        ("Cargo.toml", "node-oil-crackle = { path = \"nodes/oil-crackle\" }"),
        ("crates/gear-cli/Cargo.toml", "node-oil-crackle.workspace = true"),
        (
            "crates/gear-cli/src/registry.rs",
            "    node_oil_crackle::register(&mut registry);",
        ),
        ("docs/src/reference.md", "### OilCrackle"),
    ] {
        assert_eq!(text(name).lines().filter(|other| *other == line).count(), 1, "{name}");
    }
    assert!(text("nodes/oil-crackle/src/lib.rs").contains("pub struct OilCrackle {"));
    assert!(text("nodes/oil-crackle/src/tests.rs").contains("testing::assert_extremes"));
    assert!(text("docs/src/reference.md").contains("[OilCrackle](#oilcrackle)"));
}

#[test]
fn what_is_refused_leaves_everything_as_it_was() {
    let root = repository();
    write(root.path(), &drafted("OilCrackle", &[], &[]).unwrap()).unwrap();
    let before = everything(root.path());
    let again = write(root.path(), &drafted("OilCrackle", &[], &[]).unwrap()).unwrap_err();
    assert!(again.to_string().contains("nothing was written"), "{again}");
    std::fs::create_dir(root.path().join("nodes/varnish")).unwrap();
    let there = write(root.path(), &drafted("Varnish", &[], &[]).unwrap()).unwrap_err();
    assert!(there.to_string().contains("nodes/varnish exists already"), "{there}");
    assert_eq!(everything(root.path()), before);

    // An edit that cannot be written takes the crate back.
    let draft = drafted("Craquelure", &[], &[]).unwrap();
    let mut plan = Place::find(root.path())
        .unwrap()
        .plan(&draft, &crate::registry())
        .unwrap();
    let gone = root.path().join("gone");
    plan.edits
        .push(plan::Edit::new(&gone, "Cargo.toml", "", String::new(), String::new()));
    let error = plan.write().unwrap_err().to_string();
    assert!(error.contains("Cargo.toml cannot be written"), "{error}");
    assert_eq!(everything(root.path()), before);
}

#[test]
fn a_list_that_is_not_found_is_refused() {
    let root = repository();
    std::fs::write(root.path().join("crates/gear-cli/src/registry.rs"), "// none\n").unwrap();
    let before = everything(root.path());
    let error = write(root.path(), &drafted("OilCrackle", &[], &[]).unwrap()).unwrap_err();
    assert!(error.to_string().contains("registry.rs: expected lines"), "{error}");
    assert_eq!(everything(root.path()), before);
}

#[test]
fn outputs_that_no_input_gives_say_so() {
    let draft = drafted("Guess", &["image:Image"], &["scene:Scene"]).unwrap();
    let files = template::inside(&draft).unwrap();
    let library = &files[1].1;
    assert!(library.contains("does not compute `scene` yet"), "{library}");
    assert!(files[0].1.contains("gear-splat.workspace = true"));
    assert!(drafted("Guess", &["image:Image"], &[]).is_err());
}

#[test]
fn outside_the_repository_a_binary_of_ten_lines_comes_with_it() {
    let root = tempfile::tempdir().unwrap();
    let gear = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let place = Place::outside(root.path(), &gear).unwrap();
    let draft = drafted("OilCrackle", &[], &[]).unwrap();
    place.plan(&draft, &crate::registry()).unwrap().write().unwrap();
    let main = std::fs::read_to_string(root.path().join("oil-crackle/src/main.rs")).unwrap();
    assert!(
        main.lines().count() <= 10 && main.contains("node_oil_crackle::register"),
        "{main}"
    );
    assert!(root.path().join("oil-crackle/graph.yaml").is_file());
    assert!(Place::outside(root.path(), root.path()).is_err());
}
