//! YAML files besides graphs that hold one set of parameters, read with the same positions and messages.

use super::{Mistakes, Source, yaml};
use crate::{Fields, Params, Problem, Severity, Span, Tree, TreeKind};

/// Reads the YAML text of a file that people call `name` into parameters.
///
/// `check` says what the parameters' own ranges cannot: the key at fault, and what was found and expected.
pub fn read_declaration<P: Params>(
    name: &str,
    text: &str,
    check: impl FnOnce(&P) -> Vec<(&'static str, String)>,
) -> Result<P, Mistakes> {
    let mut problems = Vec::new();
    let tree = yaml::parse(text, 0, &mut problems);
    let mut read = None;
    if let Some(tree) = &tree {
        yaml::duplicate_keys(tree, &mut problems);
        let fields = Fields::new(Some(tree), tree.span, format!("`{name}`"), &mut problems);
        read = fields.and_then(|mut fields| P::read(&mut fields));
    }
    if let (Some(read), Some(tree)) = (&read, &tree) {
        problems.extend(check(read).into_iter().map(|(key, message)| {
            Problem::error("parameters-do-not-fit", message, place_of(tree, key), "does not fit")
        }));
    }
    let failed = problems.iter().any(|problem| problem.severity == Severity::Error);
    match read {
        Some(read) if !failed => Ok(read),
        _ => {
            let source = Source {
                name: name.to_owned(),
                text: text.to_owned(),
            };
            Err(Mistakes::new(vec![source], problems))
        }
    }
}

/// Where the value of a key stands; the whole where it is not given.
fn place_of(tree: &Tree, key: &str) -> Span {
    let TreeKind::Map(entries) = &tree.kind else {
        return tree.span;
    };
    let entry = entries.iter().find(|(name, _)| name.value == key);
    entry.map_or(tree.span, |(_, value)| value.span)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file with a few numbers.
    #[derive(Clone, Debug, PartialEq, Params)]
    struct Lamp {
        /// Power.
        #[param(range = 1.0..=100.0)]
        watts: f64,
        /// Colours.
        #[param(default = Vec::new())]
        colours: Vec<f64>,
    }

    fn read(text: &str) -> Result<Lamp, Mistakes> {
        read_declaration("lamp.yaml", text, |lamp: &Lamp| {
            let three = lamp.colours.len() == 3 || lamp.colours.is_empty();
            let message = format!("`colours` holds {} numbers, expected 3", lamp.colours.len());
            if three { Vec::new() } else { vec![("colours", message)] }
        })
    }

    #[test]
    fn every_mistake_is_shown_at_its_place() {
        assert_eq!(read("watts: 40\n").unwrap().watts, 40.0);
        let mistakes = read("watts: 400\ncolour: [1]\n").unwrap_err();
        let found: Vec<_> = mistakes.problems().iter().map(|p| (p.code, p.labels[0].0)).collect();
        assert_eq!(found.len(), 2, "{mistakes}");
        assert_eq!(mistakes.position(found[0].1), ("lamp.yaml", 1, 8));
        assert_eq!(mistakes.position(found[1].1), ("lamp.yaml", 2, 1));
        assert!(mistakes.to_string().contains("did you mean `colours`?"), "{mistakes}");
    }

    #[test]
    fn what_does_not_fit_together_is_shown_where_it_stands() {
        let mistakes = read("watts: 40\ncolours: [1, 2]\n").unwrap_err();
        assert_eq!(
            mistakes.position(mistakes.problems()[0].labels[0].0),
            ("lamp.yaml", 2, 10)
        );
        assert!(read("{").is_err() && read("").is_err() && read("watts: 1\nwatts: 2\n").is_err());
    }
}
