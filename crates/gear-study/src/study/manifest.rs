//! The manifest of a collection: one row a picture, with what is known of it.
//!
//! CSV with a head line, or a YAML list of maps. `file` is needed: a path from the folder of the manifest, or
//! `sample:NAME…`. `mask` is a file or sample as well. `title`, `artist`, `date`, `tradition`, `licence` and every other
//! column are what tables can be broken down by and what pages show.

use std::path::{Path, PathBuf};

use gear_graph::graph::nearest;
use gear_graph::{Library, Span, Spanned, Tree, TreeKind};

use super::cases::{Case, Samples, Source, plain, stem};
use super::file::folder_of;
use crate::csv;
use crate::read::Reader;

/// The columns that every collection should have; others are welcome.
pub const COLUMNS: [&str; 7] = ["file", "title", "artist", "date", "tradition", "licence", "mask"];

/// A row: columns and texts, each with its place.
type Line = (Span, Vec<(String, Spanned<String>)>);

/// Opens a manifest that a study (its name, and the library it is from) names at `span`.
pub(super) fn open(
    path: &str,
    span: Span,
    (study, library): (&str, &Library),
    samples: &dyn Samples,
    reader: &mut Reader,
) -> Vec<Case> {
    let (path, text) = match study.strip_prefix('@') {
        Some(study) => {
            let path = Path::new(study).with_file_name(path);
            let held = library.read(&format!("@{}", path.display()));
            (path, held.map(|text| text.into_owned()).map_err(|e| e.cause))
        }
        None => {
            let path = folder_of(study).join(path);
            let text = std::fs::read_to_string(&path).map_err(|e| e.to_string());
            (path, text)
        }
    };
    match text {
        Ok(text) => read(&path, &text, samples, reader),
        Err(cause) => {
            let message = format!("the manifest {} cannot be read: {cause}", path.display());
            reader.error("unreadable-manifest", message, span, "this file", None);
            Vec::new()
        }
    }
}

/// Reads a manifest.
pub fn read(path: &Path, text: &str, samples: &dyn Samples, reader: &mut Reader) -> Vec<Case> {
    let folder: PathBuf = path.parent().map(Path::to_path_buf).unwrap_or_default();
    let name = path.display().to_string();
    let lines = match path.extension().is_some_and(|e| e == "csv") {
        true => table(&name, text, reader),
        false => match reader.yaml(&name, text) {
            Some(tree) => yaml(&tree, reader),
            None => Vec::new(),
        },
    };
    let mut cases = Vec::new();
    for (line, cells) in lines {
        let cell = |column: &str| cells.iter().find(|(name, _)| name == column).map(|(_, cell)| cell);
        let Some(file) = cell("file").filter(|file| !file.value.is_empty()) else {
            let help = "every row needs a path, or `sample:NAME`".to_owned();
            reader.error("no-file", "the row names no file", line, "no `file`", Some(help));
            continue;
        };
        let mut source = |cell: &Spanned<String>| {
            let source = Source::parse(&cell.value, &folder);
            // A file that is not there is a row that fails, as one that cannot be decoded: the others go on.
            if let (Source::Sample(_), Some(flaw)) = (&source, source.flaw(samples)) {
                reader.error("bad-file", flaw, cell.span, "cannot be used", None);
            }
            source
        };
        let picture = source(file);
        let mask = cell("mask").filter(|cell| !cell.value.is_empty()).map(&mut source);
        let name = match &picture {
            Source::Sample(sample) => plain(sample),
            Source::File(path) => stem(path),
        };
        let fields = cells
            .iter()
            .filter(|(column, cell)| column != "file" && column != "mask" && !cell.value.is_empty());
        cases.push(Case {
            name,
            mask: mask.or_else(|| matches!(picture, Source::Sample(_)).then(|| picture.clone())),
            picture,
            fields: fields
                .map(|(column, cell)| (column.clone(), cell.value.clone()))
                .collect(),
        });
    }
    cases
}

fn yaml(tree: &Tree, reader: &mut Reader) -> Vec<Line> {
    let TreeKind::List(items) = &tree.kind else {
        reader.expected(
            tree,
            "a manifest",
            "a list of maps with `file`, `title`, `tradition`, …",
        );
        return Vec::new();
    };
    let mut lines = Vec::new();
    for item in items {
        let Some(entries) = reader.map(item, "a row of the manifest") else {
            continue;
        };
        let mut cells = Vec::new();
        for (key, tree) in entries {
            if let Some(value) = reader.word(tree, &format!("`{}`", key.value)) {
                cells.push((key.value.clone(), Spanned { value, span: tree.span }));
            }
        }
        lines.push((item.span, cells));
    }
    lines
}

fn table(name: &str, text: &str, reader: &mut Reader) -> Vec<Line> {
    let source = reader.source(name, text);
    let mut rows = csv::rows(text, source);
    if rows.is_empty() {
        rows.push(Vec::new());
    }
    let head: Vec<Spanned<String>> = rows.remove(0);
    let begin = Span {
        source,
        start: 0,
        len: text.lines().next().unwrap_or_default().len() as u32,
    };
    if !head.iter().any(|cell| cell.value == "file") {
        let near = nearest("file", head.iter().map(|cell| cell.value.as_str()));
        let near = near.map(|near| format!("is `{near}` meant to be `file`?"));
        let help = near.unwrap_or_else(|| format!("the first line names the columns: {}", COLUMNS.join(",")));
        reader.error(
            "no-file",
            "the manifest has no column `file`",
            begin,
            "the columns",
            Some(help),
        );
        return Vec::new();
    }
    let mut lines = Vec::new();
    for row in rows {
        let (Some(first), Some(last)) = (row.first(), row.last()) else {
            continue;
        };
        let span = Span {
            len: last.span.start + last.span.len - first.span.start,
            ..first.span
        };
        if row.len() != head.len() {
            let message = format!(
                "this row has {} cells, the first line names {} columns",
                row.len(),
                head.len()
            );
            let help = "a cell that holds a comma needs quotes around it".to_owned();
            reader.error("wrong-cells", message, span, "this row", Some(help));
            continue;
        }
        let cells = head.iter().map(|cell| cell.value.clone()).zip(row);
        lines.push((span, cells.collect()));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Two;

    impl Samples for Two {
        fn names(&self) -> Vec<String> {
            vec!["lady".into(), "vase".into()]
        }
        fn flaw(&self, sample: &str) -> Option<String> {
            let name = sample.split(',').next().unwrap_or_default();
            (!["lady", "vase"].contains(&name)).then(|| format!("there is no sample {name}"))
        }
        fn input(
            &self,
            _: &str,
            _: &gear_graph::GraphInput,
            _: &gear_graph::Graph,
        ) -> Result<gear_graph::Input, String> {
            Err("paints nothing".into())
        }
    }

    fn cases(name: &str, text: &str) -> (Vec<Case>, String) {
        let mut reader = Reader::default();
        let cases = read(Path::new(name), text, &Two, &mut reader);
        (cases, reader.mistakes().render(false))
    }

    #[test]
    fn csv_and_yaml_say_the_same() {
        let csv = "file,title,tradition\r\n\"sample:lady,seed=2\",\"A lady, seated\",Court Ladies\r\n\r\nsample:vase,\"say \"\"vase\"\"\",\r\n";
        let yaml = "- {file: 'sample:lady,seed=2', title: 'A lady, seated', tradition: Court Ladies}\n\
                    - {file: 'sample:vase', title: say \"vase\"}\n";
        let (from_csv, mistakes) = cases("collection.csv", csv);
        assert_eq!(mistakes, "");
        assert_eq!(from_csv, cases("collection.yaml", yaml).0);
        assert_eq!(from_csv[0].field("title"), Some("A lady, seated"));
        assert_eq!(from_csv[1].field("title"), Some("say \"vase\""));
        assert_eq!(from_csv[1].field("tradition"), None);
        assert_eq!(from_csv[0].picture, Source::Sample("lady,seed=2".into()));
    }

    #[test]
    fn every_mistake_of_a_manifest_is_shown_at_its_row() {
        let (_, told) = cases(
            "c.csv",
            "file,title\nsample:cat,x\nmissing.jpg,y\nsample:lady,a,b\n,z\n",
        );
        for says in ["no sample cat", "c.csv:2:1", "3 cells", "names no file"] {
            assert!(told.contains(says), "{says} in {told}");
        }
        let (found, told) = cases("c.csv", "file\nmissing.jpg\nsample:lady\n");
        assert!(
            found.len() == 2 && told.is_empty(),
            "a file that is not there fails when it is run: {told}"
        );
        let (_, told) = cases("c.csv", "fil,title\nx,y\n");
        assert!(told.contains("is `fil` meant to be `file`?"), "{told}");
    }
}
