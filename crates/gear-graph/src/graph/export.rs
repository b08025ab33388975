//! The graph as a picture's source: Mermaid and Graphviz.

use std::fmt::Write;

use super::Graph;

impl Graph {
    /// A Mermaid flowchart, left to right; wires carry the names of their ports.
    pub fn to_mermaid(&self) -> String {
        let mut text = String::from("flowchart LR\n");
        for (site, input) in self.inputs.iter().enumerate() {
            let _ = writeln!(text, "    s{site}([\"{}: {}\"])", input.name, input.value_type.name);
        }
        for (i, node) in self.nodes.iter().enumerate() {
            let site = self.inputs.len() + i;
            let _ = writeln!(
                text,
                "    s{site}[\"{}<br/><small>{}</small>\"]",
                node.id, node.spec.name
            );
        }
        for (i, output) in self.outputs.iter().enumerate() {
            let _ = writeln!(
                text,
                "    o{i}([\"{}: {}\"])",
                output.name,
                self.output_type(output).name
            );
        }
        self.each_wire(|from, label, to| {
            let _ = writeln!(text, "    s{from} -->|{label}| s{to}");
        });
        for (i, output) in self.outputs.iter().enumerate() {
            let site = self.site_of[output.slot as usize];
            let _ = writeln!(text, "    s{site} -->|{}| o{i}", self.port_name(output.slot));
        }
        text
    }

    /// A Graphviz digraph, left to right; wires carry the names of their ports.
    pub fn to_dot(&self) -> String {
        let mut text = String::from("digraph {\n    rankdir=LR\n    node [shape=box]\n");
        for (site, input) in self.inputs.iter().enumerate() {
            let _ = writeln!(
                text,
                "    s{site} [shape=oval label=\"{}: {}\"]",
                input.name, input.value_type.name
            );
        }
        for (i, node) in self.nodes.iter().enumerate() {
            let site = self.inputs.len() + i;
            let _ = writeln!(text, "    s{site} [label=\"{}\\n{}\"]", node.id, node.spec.name);
        }
        for (i, output) in self.outputs.iter().enumerate() {
            let _ = writeln!(
                text,
                "    o{i} [shape=oval label=\"{}: {}\"]",
                output.name,
                self.output_type(output).name
            );
        }
        self.each_wire(|from, label, to| {
            let _ = writeln!(text, "    s{from} -> s{to} [label=\"{label}\"]");
        });
        for (i, output) in self.outputs.iter().enumerate() {
            let site = self.site_of[output.slot as usize];
            let _ = writeln!(text, "    s{site} -> o{i} [label=\"{}\"]", self.port_name(output.slot));
        }
        text.push_str("}\n");
        text
    }

    fn each_wire(&self, mut each: impl FnMut(u32, &str, u32)) {
        for (i, node) in self.nodes.iter().enumerate() {
            let site = (self.inputs.len() + i) as u32;
            for wire in self.wires_of(site) {
                let port = node.spec.inputs[usize::from(wire.port)].name;
                let from = self.site_of[wire.from as usize];
                let label = match self.node_at(from) {
                    Some(_) if self.port_name(wire.from) != port => format!("{} → {port}", self.port_name(wire.from)),
                    _ => port.to_string(),
                };
                each(from, &label, site);
            }
        }
    }
}
