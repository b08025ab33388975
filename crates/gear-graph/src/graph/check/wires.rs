//! References and wires.

use super::Names;
use crate::graph::file::{File, FileNode, Wiring};
use crate::graph::suggest::{glued, with_article};
use crate::graph::{GraphInput, Wire, nearest};
use crate::{NodeSpec, Problem, Spanned};

/// Resolves references and checks the wires.
pub(super) struct Checker<'c, 'f> {
    pub file: &'c File<'f>,
    pub names: &'c Names<'f>,
    pub inputs: &'c [Option<GraphInput>],
    pub first_slot: &'c [u32],
    pub problems: &'c mut Vec<Problem>,
    /// How many more unknown names are compared with all names: in a large file that costs much for each.
    pub guesses: u32,
}

impl Checker<'_, '_> {
    /// Adds the wires into a node that are right, and reports those that are not.
    pub fn wires_into(&mut self, node: &FileNode<'_>, spec: Option<&NodeSpec>, wires: &mut Vec<Wire>) {
        let mut given = 0u64;
        for (key, wiring) in &node.inputs {
            let port = spec.map(|spec| spec.inputs.iter().position(|port| port.name == key.value));
            if let (Some(None), Some(spec)) = (port, spec) {
                let names = spec.inputs.iter().map(|port| port.name);
                let meant = key.value.split(':').next().unwrap_or_default();
                if let Some(meant) = spec.inputs.iter().position(|port| port.name == meant) {
                    given |= 1 << meant; // the space that is missing is mistake enough
                }
                let help = match (glued(&key.value), nearest(&key.value, names.clone())) {
                    (Some(apart), _) => apart,
                    (None, Some(name)) => format!("did you mean `{name}`?"),
                    (None, None) if spec.inputs.is_empty() => "it has no input ports".to_string(),
                    (None, None) => format!("its input ports are {}", names.collect::<Vec<_>>().join(", ")),
                };
                let mut problem = Problem::error(
                    "unknown-port",
                    format!(
                        "node `{}` ({}) has no input port `{}`",
                        node.id.value, spec.name, key.value
                    ),
                    key.span,
                    "unknown port",
                )
                .help(help);
                let shown = problem.labels.len();
                problem = Self::elsewhere(problem, &node.id.value, node.node.as_ref());
                if problem.labels.len() > shown {
                    problem = problem.help(format!("`in: {{{}: null}}` there removes the wire", key.value));
                }
                self.problems.push(problem);
            }
            // References are resolved also where the port is unknown, to report all that is wrong with them.
            for source in &wiring.refs {
                let slot = self.resolve(source);
                let (Some(spec), Some(Some(port))) = (spec, port) else {
                    continue;
                };
                given |= 1 << port;
                if let Some(slot) = slot
                    && self.fits(node, spec, port, source, slot, wiring)
                {
                    wires.push(Wire {
                        port: port as u16,
                        from: slot,
                    });
                }
            }
        }
        for (i, port) in spec.map(|spec| &spec.inputs[..]).unwrap_or_default().iter().enumerate() {
            if !port.optional && given & (1 << i) == 0 {
                self.problems.push(
                    Problem::error(
                        "missing-input",
                        format!(
                            "nothing is wired to the port `{}` of node `{}`, which needs {}",
                            port.name,
                            node.id.value,
                            with_article(port.value_type.name)
                        ),
                        node.id.span,
                        format!("`{}` is missing", port.name),
                    )
                    .help(format!("add `{}: …` to its `in`: {}", port.name, first_line(port.doc))),
                );
            }
        }
    }

    /// Whether a source may be wired to a port; reports why not.
    fn fits(
        &mut self,
        node: &FileNode<'_>,
        spec: &NodeSpec,
        port: usize,
        source: &Spanned<&str>,
        slot: u32,
        wiring: &Wiring<'_>,
    ) -> bool {
        let port = &spec.inputs[port];
        let what = format!("port `{}` of node `{}`", port.name, node.id.value);
        if wiring.list && !port.many {
            self.problems.push(Problem::error(
                "wrong-type",
                format!("{what} takes one {}, found a list", port.value_type.name),
                source.span,
                "expected one source",
            ));
            return false;
        }
        let (found, optional) = match self.inputs.get(slot as usize) {
            // Inputs have one slot each, and come first.
            Some(Some(input)) => (input.value_type, input.optional),
            Some(None) => return false, // its type is unknown, and reported
            None => {
                let site = self.first_slot.partition_point(|first| *first <= slot) - 1;
                let Some(from) = &self.names.specs[site - self.inputs.len()] else {
                    return false;
                };
                (from.outputs[(slot - self.first_slot[site]) as usize].value_type, false)
            }
        };
        if found != port.value_type {
            let problem = Problem::error(
                "wrong-port-type",
                format!(
                    "{what} takes {}, but `{}` is {}",
                    with_article(port.value_type.name),
                    source.value,
                    with_article(found.name)
                ),
                source.span,
                format!("expected {}, found {}", port.value_type.name, found.name),
            )
            .maybe_help(self.sources_of(port.value_type.name));
            let id = source.value.split('.').next().unwrap_or_default();
            let said = match (self.names.nodes.get(id), self.names.inputs.get(id)) {
                (Some(node), _) => self.file.nodes[*node as usize].node.as_ref(),
                (_, Some(input)) => self.file.inputs[*input as usize].type_name.as_ref(),
                _ => None,
            };
            self.problems.push(Self::elsewhere(problem, id, said));
            return false;
        }
        if optional && !port.optional {
            self.problems.push(
                Problem::error(
                    "optional-into-required",
                    format!("{what} needs a value, but the input `{}` is optional", source.value),
                    source.span,
                    "may be absent",
                )
                .help("make the input required, or wire something that is always there"),
            );
            return false;
        }
        true
    }

    /// Shows as well where the type of `name` is said, if a graph says so over the one in which the mistake shows.
    fn elsewhere(problem: Problem, name: &str, said: Option<&Spanned<&str>>) -> Problem {
        match (said, problem.labels.first()) {
            (Some(said), Some((main, _))) if said.span.source < main.source => {
                problem.label(said.span, format!("the type of `{name}` is said here"))
            }
            _ => problem,
        }
    }

    /// Some sources in the file that have the type, for help.
    fn sources_of(&self, type_name: &str) -> Option<String> {
        let inputs = self
            .inputs
            .iter()
            .flatten()
            .filter(|input| input.value_type.name == type_name)
            .map(|input| input.name.clone());
        let ports = self.file.nodes.iter().zip(&self.names.specs).flat_map(|(node, spec)| {
            spec.iter()
                .flat_map(|spec| spec.outputs.iter())
                .filter(|port| port.value_type.name == type_name)
                .map(|port| format!("{}.{}", node.id.value, port.name))
        });
        let some: Vec<_> = inputs.chain(ports).take(4).collect();
        (!some.is_empty()).then(|| format!("of type {type_name} are {}", some.join(", ")))
    }

    /// The slot that a reference means; reports why there is none. `None` without a report if the node's type is
    /// unknown, which was reported.
    pub fn resolve(&mut self, source: &Spanned<&str>) -> Option<u32> {
        let Some((id, port)) = source.value.split_once('.') else {
            if let Some(input) = self.names.inputs.get(source.value) {
                return Some(*input);
            }
            self.unknown_source(source);
            return None;
        };
        let Some(node) = self.names.nodes.get(id) else {
            self.unknown_source(source);
            return None;
        };
        let spec = self.names.specs[*node as usize].as_ref()?;
        if let Some(i) = spec.outputs.iter().position(|output| output.name == port) {
            return Some(self.first_slot[self.inputs.len() + *node as usize] + i as u32);
        }
        let names = spec.outputs.iter().map(|output| output.name);
        let help = match nearest(port, names.clone()) {
            Some(name) => format!("did you mean `{id}.{name}`?"),
            None => format!("its outputs are {}", names.collect::<Vec<_>>().join(", ")),
        };
        let problem = Problem::error(
            "unknown-output",
            format!("node `{id}` ({}) has no output `{port}`", spec.name),
            source.span,
            "unknown output",
        )
        .help(help);
        let problem = Self::elsewhere(problem, id, self.file.nodes[*node as usize].node.as_ref());
        self.problems.push(problem);
        None
    }

    fn unknown_source(&mut self, source: &Spanned<&str>) {
        let (name, port) = match source.value.split_once('.') {
            Some((id, port)) => (id, Some(port)),
            None => (source.value, None),
        };
        if let Some(removed) = self.file.removed.get(name) {
            self.problems.push(
                Problem::error(
                    "removed-but-read",
                    format!("`{name}` is removed here, but `{}` is still read", source.value),
                    *removed,
                    "removed here",
                )
                .label(source.span, "still read here")
                .help("wire something else there, or remove what reads it as well"),
            );
            return;
        }
        let guess = self.guesses > 0;
        self.guesses = self.guesses.saturating_sub(1);
        let outputs_of = |id: &str| -> Vec<String> {
            let spec = self
                .names
                .nodes
                .get(id)
                .and_then(|i| self.names.specs[*i as usize].as_ref());
            spec.iter()
                .flat_map(|spec| spec.outputs.iter())
                .map(|output| format!("{id}.{}", output.name))
                .collect()
        };
        let (message, help) = match port {
            None if self.names.nodes.contains_key(name) => (
                format!("`{name}` is a node, not one of its outputs"),
                Some(match outputs_of(name) {
                    outputs if outputs.is_empty() => {
                        format!("write `{name}.OUTPUT`; what its outputs are shows once its type is known")
                    }
                    outputs => format!("write {}", outputs.join(" or ")),
                }),
            ),
            None => {
                let names = self.names.inputs.keys().chain(self.names.nodes.keys());
                let near = nearest(name, names.copied().take(if guess { usize::MAX } else { 0 }));
                let help = near.map(|near| match outputs_of(near).first() {
                    Some(output) => format!("did you mean `{output}`?"),
                    None => format!("did you mean `{near}`?"),
                });
                (format!("there is no input `{name}`"), help)
            }
            Some(_) if self.names.inputs.contains_key(name) => (
                format!("`{name}` is an input; an input has no ports"),
                Some(format!("write `{name}`")),
            ),
            Some(port) => {
                let names = self.names.nodes.keys().copied();
                let near = nearest(name, names.take(if guess { usize::MAX } else { 0 }));
                (
                    format!("there is no node `{name}`"),
                    near.map(|near| format!("did you mean `{near}.{port}`?")),
                )
            }
        };
        self.problems
            .push(Problem::error("unknown-source", message, source.span, "unknown source").maybe_help(help));
    }
}

fn first_line(doc: &str) -> &str {
    doc.lines().next().unwrap_or_default()
}
