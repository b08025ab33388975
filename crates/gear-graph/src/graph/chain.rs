//! A graph file and those that it extends, read one after the other.

use super::library::identity;
use super::{GraphFile, GraphSource, Source, file, yaml};
use crate::{Digest, Problem, Span, Tree};

/// What was read: the file that was asked for comes first, what it extends after it.
pub struct Chain {
    /// The files, of the same number as in `trees`.
    pub files: Vec<GraphFile>,
    /// What they say.
    pub trees: Vec<Tree>,
}

/// Reads a graph file and all that it extends. `None`, with the mistakes in `problems`, if one of them cannot be read:
/// to call anything in the others a mistake would mislead.
pub fn read(graph: &GraphSource, sources: &mut Vec<Source>, problems: &mut Vec<Problem>) -> Option<Chain> {
    let mut chain = Chain {
        files: Vec::new(),
        trees: Vec::new(),
    };
    let mut links: Vec<Span> = Vec::new();
    let mut seen = Vec::new();
    let (mut name, mut text) = (graph.name.clone(), graph.text.clone());
    loop {
        let number = chain.trees.len() as u32;
        seen.push(identity(&name));
        chain.files.push(GraphFile {
            name: name.clone(),
            digest: Digest::of(text.as_bytes()),
        });
        let tree = yaml::parse(&text, number, problems);
        sources.push(Source {
            name: name.clone(),
            text,
        });
        let tree = tree?;
        // What a newer version means is not known here.
        if let Some(problem) = file::too_new(&tree) {
            *problems = vec![problem];
            return None;
        }
        file::version(&tree, problems);
        yaml::duplicate_keys(&tree, problems);
        let before = problems.len();
        let next = file::extends(&tree, problems).map(|next| (graph.library.resolve(&name, next.value), next.span));
        chain.trees.push(tree);
        let Some((next, span)) = next else {
            return (problems.len() == before).then_some(chain);
        };
        links.push(span);
        let same = identity(&next);
        if let Some(first) = seen.iter().position(|file| *file == same) {
            problems.push(cycle(&chain.files[first..], &links[first..]));
            return None;
        }
        match graph.library.read(&next) {
            Ok(read) => (name, text) = (next, read.into_owned()),
            Err(unreadable) => {
                problems.push(
                    Problem::error("unreadable-graph", unreadable.summary(), span, "this file")
                        .maybe_help(unreadable.help),
                );
                return None;
            }
        }
    }
}

/// Files that extend each other in a ring.
fn cycle(files: &[GraphFile], links: &[Span]) -> Problem {
    let mut names: Vec<_> = files.iter().map(|file| file.name.as_str()).collect();
    names.push(names[0]);
    let mut problem = Problem::error(
        "extends-cycle",
        format!("these files extend each other: {}", names.join(" → ")),
        links[0],
        "the loop begins here",
    )
    .help("a graph must end in one that extends no other; remove one of these lines");
    for (i, span) in links.iter().enumerate().skip(1).take(9) {
        problem = problem.label(*span, format!("extends `{}`", names[i + 1]));
    }
    problem
}
