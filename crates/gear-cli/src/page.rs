//! The page of a run, filled in from its record, its graph, and its pictures.

use std::collections::BTreeMap;

use gear_graph::{Graph, NodeReport, NodeStatus, RunReport, RunStatus, ValueType};
use gear_image::{Field, Image, Mask};
use gear_report::plot::Curve;
use gear_report::{Comparison, Cost, Drawing, Figure, Measure, Page, Picture, Row, Shape, Standing};
use gear_splat::Views;
use serde_json::Value;

use crate::gallery::Gallery;
use crate::words::{self, DOUBTS, MEASURES};

/// The graph output whose views are the frames of a full turn.
const ORBIT: &str = "orbit";

/// What the page is made from.
pub struct Sources<'a> {
    /// The record of the run.
    pub report: &'a RunReport,
    /// The graph that ran.
    pub graph: &'a Graph,
    /// The pictures.
    pub gallery: &'a Gallery,
    /// The graph's outputs of type Report, by name.
    pub reports: &'a BTreeMap<String, Value>,
}

/// Fills the page in.
pub fn page(sources: &Sources<'_>) -> Page {
    let report = sources.report;
    let mut page = Page {
        title: title(report),
        subtitle: format!("Made by the graph {}{}", report.graph, status(report.status)),
        problems: report.failures.iter().map(ToString::to_string).collect(),
        graph: drawing(sources),
        left_out: left_out(report),
        stages: stages(sources),
        comparisons: comparisons(sources),
        orbit: orbit(sources),
        curve: sources
            .reports
            .get("curve")
            .map(|loss| curve(loss, colours_first(report)))
            .unwrap_or_default(),
        mask: sources.reports.get("foreground").map(mask).unwrap_or_default(),
        measures: sources.reports.get("metrics").map(measures).unwrap_or_default(),
        costs: costs(report),
        colophon: format!(
            "gear {} on {} {}, {} threads.",
            report.version,
            std::env::consts::OS,
            std::env::consts::ARCH,
            report.jobs
        ),
        ..Page::default()
    };
    let gaussians = sources
        .reports
        .get("metrics")
        .and_then(|metrics| metrics["gaussians"].as_u64());
    if let Some(count) = gaussians {
        page.facts.push(("Gaussians".into(), thousands(count)));
    }
    // What the results cost when they were computed, in this run or an earlier one.
    let seconds: f64 = report.nodes.iter().map(|node| node.seconds).sum();
    page.facts.push(("seconds of work".into(), format!("{seconds:.1}")));
    if let Some(peak) = report
        .nodes
        .iter()
        .map(|node| node.peak_memory)
        .max()
        .filter(|peak| *peak > 0)
    {
        page.facts
            .push(("peak memory".into(), format!("{} MiB", thousands(peak >> 20))));
    }
    let cached = report.with_status(NodeStatus::Cached).len();
    let (ran, all) = (report.ran().len(), report.ran().len() + cached);
    page.facts
        .push(("computed in this run".into(), format!("{ran} of {all}")));
    page
}

/// The name of the first thing that was given, without folder and extension.
fn title(report: &RunReport) -> String {
    let source = report.nodes.iter().find_map(|node| node.source.as_deref());
    let name = source.unwrap_or(&report.graph);
    let name = name.strip_prefix("sample:").unwrap_or(name);
    let stem = std::path::Path::new(name).file_stem();
    stem.map_or(name.to_owned(), |stem| stem.to_string_lossy().into_owned())
}

fn status(status: RunStatus) -> &'static str {
    match status {
        RunStatus::Done => "",
        RunStatus::Failed => "; not finished, something failed",
        RunStatus::Interrupted => "; interrupted",
    }
}

fn standing(node: &NodeReport) -> Standing {
    match node.status {
        NodeStatus::Ran => Standing::Ran,
        NodeStatus::Cached => Standing::Hit,
        NodeStatus::LeftOut | NodeStatus::NotGiven | NodeStatus::Unfinished => Standing::LeftOut,
        NodeStatus::Given => Standing::End,
        NodeStatus::Failed => Standing::Failed,
        NodeStatus::Skipped => Standing::Skipped,
    }
}

fn drawing(sources: &Sources<'_>) -> Drawing {
    let graph = sources.graph;
    let mut drawing = Drawing::default();
    let mut place = BTreeMap::new();
    for node in &sources.report.nodes {
        place.insert(node.id.as_str(), drawing.shapes.len());
        let ran = matches!(node.status, NodeStatus::Ran | NodeStatus::Cached);
        drawing.shapes.push(Shape {
            id: node.id.clone(),
            kind: node.type_name.clone(),
            standing: standing(node),
            note: match &node.reason {
                Some(reason) => reason.clone(),
                None if ran => format!("{:.2} s", node.seconds),
                None if node.status == NodeStatus::NotGiven => "not given (optional)".to_owned(),
                None if node.input => "input".to_owned(),
                None => String::new(),
            },
        });
    }
    let producer = |source: &str| place.get(source.split('.').next().unwrap_or(source)).copied();
    for (i, node) in graph.nodes().iter().enumerate() {
        for (_, source) in graph.wiring(i) {
            drawing
                .edges
                .extend(producer(&source).zip(place.get(node.id.as_str()).copied()));
        }
    }
    for output in graph.outputs() {
        let from = producer(&graph.output_source(output));
        drawing.edges.extend(from.map(|from| (from, drawing.shapes.len())));
        drawing.shapes.push(Shape {
            id: output.name.clone(),
            kind: graph.output_type(output).name.to_owned(),
            standing: Standing::End,
            note: "output".into(),
        });
    }
    drawing
}

fn left_out(report: &RunReport) -> Vec<Row> {
    let nodes = report.nodes.iter().filter(|node| node.status == NodeStatus::LeftOut);
    nodes
        .map(|node| Row {
            name: node.id.clone(),
            text: node.reason.clone().unwrap_or_default(),
        })
        .collect()
}

/// The type of an output of a node, or of an input.
fn port_type(graph: &Graph, node: &NodeReport, port: &str) -> Option<(ValueType, String)> {
    if node.input {
        let input = graph.inputs().iter().find(|input| input.name == node.id)?;
        return Some((input.value_type, "As given, at the size that is worked at.".to_owned()));
    }
    let spec = &graph.nodes().iter().find(|known| known.id == node.id)?.spec;
    let port = spec.outputs.iter().find(|output| output.name == port)?;
    Some((port.value_type, words::caption(&node.type_name, port.name, port.doc)))
}

fn stages(sources: &Sources<'_>) -> Vec<Figure> {
    let mut figures = Vec::new();
    for node in &sources.report.nodes {
        for port in &node.outputs {
            let Some((value_type, caption)) = port_type(sources.graph, node, &port.port) else {
                continue;
            };
            if !(value_type.is::<Image>() || value_type.is::<Mask>() || value_type.is::<Field>()) {
                continue;
            }
            let source = if node.input {
                node.id.clone()
            } else {
                format!("{}.{}", node.id, port.port)
            };
            let pictures = sources.gallery.pictures(&node.id, &port.port, &value_type);
            figures.extend(pictures.into_iter().map(|(scale, picture)| Figure {
                source: source.clone(),
                caption: caption.clone(),
                legend: scale.parse().ok().map(ends),
                picture,
            }));
        }
    }
    figures
}

/// The values at the ends of a scale.
fn ends(scale: f32) -> (String, String) {
    (format!("−{scale:.2}"), format!("+{scale:.2}"))
}

/// A column of views: its heading, and the pictures with their cameras' names.
type Column = (String, Vec<(String, Picture)>);

fn comparisons(sources: &Sources<'_>) -> Vec<Comparison> {
    let orbit = orbit_node(sources.graph);
    let mut columns: Vec<Column> = Vec::new();
    let mut edited = false;
    for node in &sources.report.nodes {
        for port in &node.outputs {
            let Some((value_type, _)) = port_type(sources.graph, node, &port.port) else {
                continue;
            };
            if !value_type.is::<Views>() || orbit.as_deref() == Some(node.id.as_str()) {
                continue;
            }
            let pictures = sources.gallery.pictures(&node.id, &port.port, &value_type);
            // Views that feed an edit are those before it.
            let role = match (node.type_name.as_str(), edited) {
                ("Edit", _) => "target",
                (_, false) => "before",
                (_, true) => "after",
            };
            let known = columns.iter().any(|(heading, _)| heading == role);
            edited |= node.type_name == "Edit";
            if !pictures.is_empty() {
                let heading = if known {
                    format!("{role} ({})", node.id)
                } else {
                    role.to_owned()
                };
                columns.push((heading, pictures));
            }
        }
    }
    // Alone they are before nothing.
    if let [(heading, _)] = &mut columns[..] {
        *heading = "views".to_owned();
    }
    let Some((_, first)) = columns.first() else {
        return Vec::new();
    };
    let cameras: Vec<String> = first.iter().map(|(camera, _)| camera.clone()).collect();
    let complete = |camera: &String| {
        let pictures = columns.iter().map(|(heading, views)| {
            let found = views.iter().find(|(name, _)| name == camera);
            found.map(|(_, picture)| (heading.clone(), picture.clone()))
        });
        pictures.collect::<Option<Vec<_>>>().map(|pictures| Comparison {
            camera: spoken(camera),
            pictures,
        })
    };
    cameras.iter().filter_map(complete).collect()
}

/// `yaw+30` as people write it.
fn spoken(camera: &str) -> String {
    match camera.strip_prefix("yaw") {
        Some("+0") => "0°".to_owned(),
        Some(angle) => format!("{}°", angle.replace('-', "−")),
        None => camera.to_owned(),
    }
}

/// The node behind the output `orbit`.
fn orbit_node(graph: &Graph) -> Option<String> {
    let output = graph.outputs().iter().find(|output| output.name == ORBIT)?;
    Some(graph.output_source(output).split('.').next()?.to_owned())
}

fn orbit(sources: &Sources<'_>) -> Vec<Picture> {
    let Some(id) = orbit_node(sources.graph) else {
        return Vec::new();
    };
    let Some(node) = sources.report.node(&id) else {
        return Vec::new();
    };
    let mut frames = Vec::new();
    for port in &node.outputs {
        if let Some((value_type, _)) = port_type(sources.graph, node, &port.port) {
            frames.extend(sources.gallery.pictures(&node.id, &port.port, &value_type));
        }
    }
    frames.into_iter().map(|(_, picture)| picture).collect()
}

/// The steps of a refinement in which only colours move, which come before its `iterations`.
fn colours_first(report: &RunReport) -> u64 {
    let refine = report.nodes.iter().find(|node| node.type_name == "Refine");
    refine
        .and_then(|node| node.params.get("color_iterations")?.as_u64())
        .unwrap_or(0)
}

/// The loss in a report `{"loss": [...]}`, whose entries are numbers, or objects with `iteration` and `loss`.
fn curve(report: &Value, colours_first: u64) -> Curve {
    let entries = report["loss"].as_array().or_else(|| report["curve"].as_array());
    let points = entries
        .into_iter()
        .flatten()
        .enumerate()
        .filter_map(|(i, entry)| match entry {
            Value::Object(entry) => {
                let step = entry.get("iteration").and_then(Value::as_f64).unwrap_or(i as f64);
                Some((step, entry.get("loss")?.as_f64()?))
            }
            Value::Array(pair) => Some((pair.first()?.as_f64()?, pair.get(1)?.as_f64()?)),
            number => Some((i as f64, number.as_f64()?)),
        });
    Curve {
        step: match colours_first {
            0 => "iteration".into(),
            first => format!("iteration (the first {first} move colours only)"),
        },
        quantity: "loss".into(),
        points: points.collect(),
    }
}

fn measure(name: &str, value: &Value, unit: &str, meaning: &str) -> Measure {
    Measure {
        name: name.to_owned(),
        value: match value.as_f64() {
            Some(number) if number.abs() < 1.0 => format!("{number:.3}{unit}"),
            Some(number) => format!("{number:.2}{unit}"),
            None => "undefined".to_owned(),
        },
        meaning: meaning.to_owned(),
    }
}

/// What `Foreground` reports.
fn mask(report: &Value) -> Vec<Measure> {
    let mode = report["mode"].as_str().unwrap_or_default();
    let mut all = vec![Measure {
        name: "kind".to_owned(),
        value: mode.to_owned(),
        meaning: words::mode(mode).to_owned(),
    }];
    for (pointer, name, meaning) in DOUBTS {
        // Of a mask that was given nothing is measured.
        if let Some(value) = report.pointer(pointer).filter(|value| !value.is_null()) {
            all.push(measure(name, value, "", meaning));
        }
    }
    all
}

fn measures(metrics: &Value) -> Vec<Measure> {
    let mut all = Vec::new();
    for (pointer, name, unit, meaning) in MEASURES {
        if let Some(value) = metrics.pointer(pointer) {
            all.push(measure(name, value, unit, meaning));
        }
        if *pointer == "/ddi/average" {
            let yaws = metrics.pointer("/ddi/yaws").and_then(Value::as_object);
            for (yaw, value) in yaws.into_iter().flatten() {
                all.push(measure(&format!("DDI, {yaw}°"), value, "", "At this yaw."));
            }
        }
    }
    all
}

/// What took part, each with its cost.
fn costs(report: &RunReport) -> Vec<Cost> {
    let nodes = report.nodes.iter();
    let nodes = nodes.filter(|node| !matches!(node.status, NodeStatus::Given | NodeStatus::NotGiven));
    nodes.map(cost).collect()
}

fn cost(node: &NodeReport) -> Cost {
    let took_part = matches!(node.status, NodeStatus::Ran | NodeStatus::Cached);
    let bytes: u64 = node.outputs.iter().map(|port| port.bytes).sum();
    Cost {
        node: node.id.clone(),
        standing: standing(node),
        seconds: took_part.then_some(node.seconds),
        peak_bytes: Some(node.peak_memory).filter(|peak| took_part && *peak > 0),
        result_bytes: Some(bytes).filter(|bytes| *bytes > 0),
    }
}

fn thousands(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn thousands_are_set_apart() {
        assert_eq!(thousands(0), "0");
        assert_eq!(thousands(999), "999");
        assert_eq!(thousands(1_234_567), "1,234,567");
    }

    #[test]
    fn what_is_undefined_is_said_to_be() {
        let all = measures(&json!({"vend": 64.25, "niqe": {"grounded": null}}));
        let told: Vec<_> = all.iter().map(|m| (m.name.as_str(), m.value.as_str())).collect();
        assert_eq!(told, [("VEND", "64.25"), ("NIQE, grounded image", "undefined")]);
    }

    #[test]
    fn a_curve_is_read_from_numbers_or_objects() {
        let plain = curve(&json!({"loss": [0.5, 0.25]}), 0);
        let told = curve(
            &json!({"loss": [{"iteration": 0, "loss": 0.5}, {"iteration": 1, "loss": 0.25}]}),
            0,
        );
        assert_eq!(plain.points, [(0.0, 0.5), (1.0, 0.25)]);
        assert_eq!(plain, told);
    }
}
