//! What the files of a new crate say.
//!
//! The node does the least honest thing that its ports allow: an output of a type that is also an input gets that
//! input, dimmed by a parameter where the type has numbers; for any other output the node says that it is not written
//! yet. Either way the crate compiles and its tests pass, and they go on holding for what takes its place.

use std::fmt::Write;
use std::path::Path;

use gear_graph::{Limits, NodeSpec, ParamKind, ParamSpec, PortSpec, Registry, ValueType, interned};

use super::names::Port;
use super::{Draft, Refusal};

/// The graph that runs the node, for a crate of its own.
pub const GRAPH: &str = "graph.yaml";

const AMOUNT: &str = "How much of the effect there is: with 1 nothing changes.";

/// Files of a crate: name and text.
pub type Files = Vec<(String, String)>;

/// How an output comes about.
enum Step<'d> {
    /// The input, dimmed.
    Dimmed(&'d Port),
    /// The input as it is.
    Same(&'d Port),
    /// Not yet.
    Unwritten,
}

impl Draft {
    fn steps(&self) -> Vec<(&Port, Step<'_>)> {
        let step = |output: &Port| {
            let alike: Vec<&Port> = self
                .inputs
                .iter()
                .filter(|i| i.value_type == output.value_type)
                .collect();
            let of_that_name = alike.iter().find(|input| input.name == output.name);
            match (of_that_name.or(alike.first()), output.value_type.name) {
                (None, _) => Step::Unwritten,
                (Some(input), "Number" | "Image" | "Field") => Step::Dimmed(input),
                (Some(input), _) => Step::Same(input),
            }
        };
        self.outputs.iter().map(|output| (output, step(output))).collect()
    }

    fn unwritten(&self) -> Option<&Port> {
        let steps = self.steps().into_iter();
        steps
            .filter(|(_, step)| matches!(step, Step::Unwritten))
            .map(|(port, _)| port)
            .next()
    }

    /// Whether the node has the parameter `amount`.
    fn dims(&self) -> bool {
        self.unwritten().is_none() && self.steps().iter().any(|(_, step)| matches!(step, Step::Dimmed(_)))
    }

    fn types(&self) -> Vec<ValueType> {
        let mut types: Vec<ValueType> = Vec::new();
        for port in self.inputs.iter().chain(&self.outputs) {
            if !types.contains(&port.value_type) {
                types.push(port.value_type);
            }
        }
        types.sort_by_key(|value| value.name);
        types
    }

    fn doc(&self) -> String {
        let name = &self.names.node;
        format!("Say here in a sentence what {name} gives.\n\nWhat follows the first sentence is the node's reference.")
    }
}

fn port_doc(port: &Port) -> String {
    format!("Say here what `{}` holds.", port.name)
}

/// What the node will say of itself when it is compiled: for the reference, before it is.
pub fn spec(draft: &Draft) -> NodeSpec {
    let kept = |text: String| interned(&text);
    let port = |port: &Port, lazy: bool| PortSpec {
        name: kept(port.name.clone()),
        doc: kept(port_doc(port)),
        value_type: port.value_type,
        optional: false,
        lazy,
        many: false,
    };
    let mut numerics: Vec<_> = draft.types().iter().map(|value| value.numerics).collect();
    numerics.retain(|numerics| !numerics.name.is_empty());
    numerics.sort_unstable();
    numerics.dedup();
    let amount = ParamSpec {
        name: "amount",
        doc: AMOUNT,
        kind: ParamKind::Number,
        limits: Limits::none().within(0.0..=1.0).unit("share"),
        default: Some(1.0.into()),
    };
    NodeSpec {
        name: kept(draft.names.node.clone()),
        version: 1,
        doc: kept(draft.doc()),
        deterministic: true,
        kept: true,
        numerics,
        inputs: draft.inputs.iter().map(|p| port(p, false)).collect(),
        outputs: draft.outputs.iter().map(|p| port(p, true)).collect(),
        params: draft.dims().then_some(amount).into_iter().collect(),
        plugin: None,
    }
}

/// The crate in gear's repository.
pub fn inside(draft: &Draft) -> Result<Files, Refusal> {
    let mut manifest = format!(
        "[package]\nname = \"{}\"\ndescription = \"The node {}\"\n",
        draft.names.package(),
        draft.names.node
    );
    for key in ["version", "edition", "rust-version", "license", "publish"] {
        let _ = writeln!(manifest, "{key}.workspace = true");
    }
    manifest.push_str("\n[lints]\nworkspace = true\n\n[dependencies]\n");
    for package in packages(draft)? {
        let _ = writeln!(manifest, "{package}.workspace = true");
    }
    manifest.push_str("\n[dev-dependencies]\nserde_json.workspace = true\n");
    Ok(vec![
        ("Cargo.toml".to_owned(), manifest),
        ("src/lib.rs".to_owned(), library(draft)?),
        ("src/tests.rs".to_owned(), tests(draft)?),
    ])
}

/// The crate outside of it, with a binary of its own, on the repository `gear`.
pub fn outside(draft: &Draft, gear: &Path, registry: &Registry) -> Result<Files, Refusal> {
    let names = &draft.names;
    let Some(gear) = gear.to_str() else {
        return Err(Refusal::new(format!("the path {} is no text", gear.display())));
    };
    let path = |package: &str| toml_text(&format!("{gear}/crates/{package}"));
    let mut packages = packages(draft)?;
    packages.push("gear-cli".to_owned());
    packages.sort();
    let dependencies: String = packages
        .iter()
        .map(|package| format!("{package} = {{ path = {} }}\n", path(package)))
        .collect();
    let manifest = include_str!("templates/Cargo.toml.in")
        .replace("{{package}}", &names.package())
        .replace("{{kebab}}", &names.kebab)
        .replace("{{Node}}", &names.node)
        .replace("{{dependencies}}\n", &dependencies);
    let main = include_str!("templates/main.rs.in")
        .replace("{{module}}", &names.module())
        .replace("{{Node}}", &names.node);
    let mut files = vec![
        ("Cargo.toml".to_owned(), manifest),
        (".gitignore".to_owned(), "/target\n/out\n".to_owned()),
        ("src/main.rs".to_owned(), main),
        ("src/lib.rs".to_owned(), library(draft)?),
        ("src/tests.rs".to_owned(), tests(draft)?),
    ];
    // What no loader reads cannot be given as a file.
    if !draft.inputs.is_empty()
        && draft
            .inputs
            .iter()
            .all(|p| registry.find_loader(p.value_type.name).is_some())
    {
        files.push((GRAPH.to_owned(), graph(draft)));
    }
    Ok(files)
}

fn graph(draft: &Draft) -> String {
    let mut text = "gear: 1\ninputs:\n".to_owned();
    for port in &draft.inputs {
        let _ = writeln!(text, "  {}: {}", port.name, port.value_type.name);
    }
    let wires: Vec<_> = draft.inputs.iter().map(|p| format!("{0}: {0}", p.name)).collect();
    let _ = writeln!(
        text,
        "nodes:\n  new: {{node: {}, in: {{{}}}}}",
        draft.names.node,
        wires.join(", ")
    );
    text.push_str("outputs:\n");
    for port in &draft.outputs {
        let _ = writeln!(text, "  {0}: new.{0}", port.name);
    }
    text
}

/// The crates that the types of the ports come from, by the name that each type's numerics have.
fn packages(draft: &Draft) -> Result<Vec<String>, Refusal> {
    let mut packages = vec!["gear-graph".to_owned()];
    for value in draft.types() {
        packages.push(package(&value)?);
    }
    packages.sort();
    packages.dedup();
    Ok(packages)
}

fn package(value: &ValueType) -> Result<String, Refusal> {
    match value.numerics.name {
        // Its numerics are in its digest, so that they touch only what a network made.
        "" if value.name == "Model" => Ok("gear-onnx".to_owned()),
        "" => Ok("gear-graph".to_owned()),
        name if name.starts_with("gear-") => Ok(name.to_owned()),
        _ => Err(Refusal::new(format!(
            "the type `{}` is not one of gear's, and its crate is not known here; leave the port out and add it by hand",
            value.name
        ))),
    }
}

fn toml_text(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

fn library(draft: &Draft) -> Result<String, Refusal> {
    let node = &draft.names.node;
    let mut uses = String::new();
    let mut framework = vec![
        "Context",
        "Node",
        "NodeError",
        "Outputs",
        "Params",
        "Registry",
        "Want",
        "Wanted",
    ];
    if !draft.inputs.is_empty() {
        uses.push_str("use std::sync::Arc;\n\n");
        framework.push("Inputs");
    }
    let types = draft.types();
    let of = |wanted: &str| -> Result<Vec<&'static str>, Refusal> {
        let mut names = Vec::new();
        for value in &types {
            if package(value)? == wanted {
                names.push(value.name);
            }
        }
        Ok(names)
    };
    framework.extend(of("gear-graph")?);
    let _ = writeln!(uses, "{}", import("gear_graph", framework));
    for package in packages(draft)?.iter().filter(|package| *package != "gear-graph") {
        let _ = writeln!(uses, "{}", import(&package.replace('-', "_"), of(package)?));
    }
    let params = if draft.dims() {
        format!(
            " {{\n    /// {AMOUNT}\n    #[param(default = 1.0, range = 0.0..=1.0, unit = \"share\")]\n    pub amount: f64,\n}}"
        )
    } else {
        " {}".to_owned()
    };
    let ports = |ports: &[Port], wrapper: &str| -> String {
        let port = |p: &Port| {
            format!(
                "    /// {}\n    pub {}: {wrapper}<{}>,\n",
                port_doc(p),
                p.name,
                p.value_type.name
            )
        };
        ports.iter().map(port).collect()
    };
    let inputs = if draft.inputs.is_empty() {
        String::new()
    } else {
        format!(
            "/// Input ports.\n#[derive(Inputs)]\npub struct In {{\n{}}}\n\n",
            ports(&draft.inputs, "Arc")
        )
    };
    Ok(include_str!("templates/lib.rs.in")
        .replace("{{uses}}\n", &uses)
        .replace("{{doc}}", &comment(&draft.doc()))
        .replace("{{params}}", &params)
        .replace("{{inputs}}\n", &inputs)
        .replace("{{outputs}}\n", &ports(&draft.outputs, "Wanted"))
        .replace("{{In}}", if draft.inputs.is_empty() { "()" } else { "In" })
        .replace("{{run}}\n", &run(draft))
        .replace("{{steps}}\n", &steps(draft))
        .replace("{{Node}}", node))
}

/// A doc comment.
fn comment(text: &str) -> String {
    let lines = text.lines().map(|line| format!("/// {line}").trim_end().to_owned());
    lines.collect::<Vec<_>>().join("\n")
}

/// A `use`, as rustfmt writes it.
fn import(module: &str, mut names: Vec<&str>) -> String {
    names.sort_unstable();
    let line = match names.as_slice() {
        [one] => format!("use {module}::{one};"),
        _ => format!("use {module}::{{{}}};", names.join(", ")),
    };
    if line.len() <= WIDTH {
        return line;
    }
    let mut text = format!("use {module}::{{\n   ");
    let mut width = 3;
    for name in names {
        if width + name.len() + 2 > WIDTH {
            text.push_str("\n   ");
            width = 3;
        }
        let _ = write!(text, " {name},");
        width += name.len() + 2;
    }
    text + "\n};"
}

/// Of `rustfmt.toml`; a crate elsewhere gets the same.
const WIDTH: usize = 120;

/// The parameters of `run` and its body.
fn run(draft: &Draft) -> String {
    if let Some(port) = draft.unwritten() {
        return format!(
            "    fn run(&self, _inputs: {}, _want: &Want, _ctx: &Context) -> Result<Out, NodeError> {{\n        \
             Err(NodeError::new(\"{} does not compute `{}` yet: write its `run`\"))\n    }}\n",
            if draft.inputs.is_empty() { "()" } else { "In" },
            draft.names.node,
            port.name
        );
    }
    let mut text = "    fn run(&self, inputs: In, want: &Want, ctx: &Context) -> Result<Out, NodeError> {\n        \
                    ctx.checkpoint()?; // stops here when the user pressed Ctrl-C\n"
        .to_owned();
    text.push_str("        Ok(Out {\n");
    for (output, step) in draft.steps() {
        let name = &output.name;
        let line = match step {
            Step::Dimmed(from) if output.value_type.name == "Number" => {
                format!(
                    "{name}: want.try_compute(\"{name}\", || dimmed_number(\"{0}\", inputs.{0}.0, self.amount))?",
                    from.name
                )
            }
            Step::Dimmed(from) => {
                let value = output.value_type.name.to_ascii_lowercase();
                format!(
                    "{name}: want.compute(\"{name}\", || dimmed_{value}(&inputs.{}, self.amount as f32))",
                    from.name
                )
            }
            Step::Same(from) if output.value_type.name == "Scene" => {
                // A scene from a file may hold Gaussians that no node may put out.
                format!(
                    "{name}: want.compute(\"{name}\", || inputs.{}.without_invalid().0)",
                    from.name
                )
            }
            Step::Same(from) => format!("{name}: want.compute(\"{name}\", || (*inputs.{}).clone())", from.name),
            Step::Unwritten => continue,
        };
        let _ = writeln!(text, "            {line},");
    }
    text.push_str("        })\n    }\n");
    text
}

/// The functions that `run` names.
fn steps(draft: &Draft) -> String {
    if !draft.dims() {
        return String::new();
    }
    let mut text = String::new();
    for value in draft.types() {
        let used = draft
            .steps()
            .iter()
            .any(|(output, step)| matches!(step, Step::Dimmed(_)) && output.value_type == value);
        text.push_str(match value.name {
            "Number" if used => include_str!("templates/number.rs.in"),
            "Image" if used => include_str!("templates/image.rs.in"),
            "Field" if used => include_str!("templates/field.rs.in"),
            _ => continue,
        });
        text.push('\n');
    }
    text
}

fn tests(draft: &Draft) -> Result<String, Refusal> {
    let mut text =
        "//! The kit is `gear_graph::testing`; the book's chapter \"Writing a node\" tells what it checks.\n\n"
            .to_owned();
    text.push_str("use gear_graph::testing;\n\nuse super::*;\n\n");
    let fields: Vec<_> = draft
        .inputs
        .iter()
        .map(|port| format!("        {}: Arc::new({}),\n", port.name, sample(&port.value_type)))
        .collect();
    let (inputs, given) = if draft.inputs.is_empty() {
        (String::new(), "|| ()")
    } else {
        let text = format!("fn inputs() -> In {{\n    In {{\n{}    }}\n}}\n\n", fields.concat());
        (text, "inputs")
    };
    let node = &draft.names.node;
    let written = draft.unwritten().is_none();
    if written || !draft.inputs.is_empty() {
        text.push_str(&inputs);
    }
    if written {
        let _ = write!(
            text,
            "#[test]\nfn same_bits_twice_on_any_threads_and_whatever_is_wanted() {{\n    \
             testing::assert_pure(&{node}::default(), {given});\n}}\n\n"
        );
    } else {
        let call = if draft.inputs.is_empty() { "()" } else { "inputs()" };
        let _ = write!(
            text,
            "#[test]\nfn it_says_that_it_is_not_written_yet() {{\n    \
             let error = testing::run(&{node}::default(), {call}).map(|_| ()).unwrap_err();\n    \
             assert!(error.to_string().contains(\"yet\"), \"{{error}}\");\n}}\n\n"
        );
    }
    let _ = write!(
        text,
        "#[test]\nfn an_answer_or_an_error_on_every_extreme_input() {{\n    \
         testing::assert_extremes(&{node}::default());\n}}\n"
    );
    if draft.dims() {
        text.push_str(&include_str!("templates/amount.rs.in").replace("{{Node}}", node));
    }
    let _ = write!(
        text,
        "\n#[test]\nfn unknown_parameters_are_refused() {{\n    \
         assert!(testing::read::<{node}>(&serde_json::json!({{\"none_such\": 1}})).is_err());\n}}\n"
    );
    Ok(text)
}

/// A value to test with.
fn sample(value: &ValueType) -> String {
    match value.name {
        "Number" => "Number(2.0)".to_owned(),
        "Report" => "Report(serde_json::json!({\"mean\": 0.5}))".to_owned(),
        "Image" => "gear_image::testing::sample_painting()".to_owned(),
        "Field" => "gear_image::testing::sample_field()".to_owned(),
        "Mask" => "Mask::from_fn(61, 43, |x, y| x.abs_diff(30) < 9 && y.abs_diff(21) < 14)".to_owned(),
        // One of the type's own cases, the first that is not empty.
        name => format!("<{name} as gear_graph::Value>::extremes().swap_remove(1).1"),
    }
}
