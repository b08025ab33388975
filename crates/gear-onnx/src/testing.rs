//! Small networks for tests, written byte by byte: what the library is asked with where no weights can be had.

use std::path::Path;

use gear_graph::Resources;

use crate::proto::{put_bytes, put_varint};
use crate::{Familiar, Model, library};

/// A small network. All take `x`, `[1, 3, h, w]`, unless they say otherwise, and give `y`.
#[derive(Clone, Debug, PartialEq)]
pub enum Net {
    /// Contours: the absolute value of a Laplacian of the mean colour, `[1, 1, h, w]`.
    Edges,
    /// The mean of the colours, `[1, 1, h, w]`: bright is figure, or near.
    Mean,
    /// One less the colours, `[1, 3, h, w]`.
    Negative,
    /// `0 / 0` everywhere, `[1, 1, h, w]`.
    NotFinite,
    /// `[1, 1, n, n]` of an n that cannot be held.
    Huge,
    /// `y` of whole numbers.
    Integers,
    /// Four channels for three colours: (0, 0, 1) and the mean of the colours.
    Surface,
    /// The mean over the channels of any number of channels, `[1, n, h, w]` to `[1, 1, h, w]`.
    MeanOf(u64),
    /// Counts to a number that is not reached in a lifetime.
    Endless,
}

impl Net {
    /// The declaration that goes with it.
    pub fn declaration(&self) -> &'static str {
        match self {
            Self::Mean => "network: 1\nlicence: own\nanswer: saliency\n",
            Self::Negative => "network: 1\nlicence: own\nanswer: picture\n",
            Self::Surface => "network: 1\nlicence: own\nanswer: {surface: {height: 32}}\n",
            _ => "network: 1\nlicence: own\nanswer: edges\n",
        }
    }
}

/// A network with its own declaration.
///
/// # Panics
/// Never: these declarations are read by a test.
pub fn model(net: &Net) -> Model {
    with(net, net.declaration())
}

/// A network with another declaration.
///
/// # Panics
/// If the declaration has a mistake.
pub fn with(net: &Net, declaration: &str) -> Model {
    Model::new("declaration", &onnx(net), Some(declaration)).unwrap_or_else(|error| panic!("{error}"))
}

/// What networks may be that come from a file: of every kind of answer, and misbehaving.
pub(crate) fn extremes() -> Vec<(&'static str, Model)> {
    let depth = "network: 1\nanswer: {depth: {of: inverse}}\n";
    let garbage = Model::new("declaration", &[0x08, 0x08], Some(Net::Edges.declaration()));
    let mut all = vec![
        ("edges", model(&Net::Edges)),
        ("saliency", model(&Net::Mean)),
        ("depth", with(&Net::Mean, depth)),
        ("picture", model(&Net::Negative)),
        ("answer not finite", with(&Net::NotFinite, depth)),
    ];
    all.extend(garbage.ok().map(|garbage| ("no graph", garbage)));
    all
}

/// Whether networks can run here; says so on standard error where not.
///
/// # Panics
/// If the library is missing and `GEAR_REQUIRE_ONNX` is set: then a skipped test would hide something.
pub fn can_run() -> bool {
    match library::open(&Resources::default()) {
        Ok(_) => true,
        Err(error) if std::env::var_os("GEAR_REQUIRE_ONNX").is_some() => panic!("{error}"),
        Err(error) => {
            eprintln!("skipped: {error}");
            false
        }
    }
}

/// A model from the folder that `GEAR_TEST_MODELS` names, which gear knows; `None`, and a word on standard error, where
/// it is not set or there is no such file.
///
/// # Panics
/// If the file cannot be read as a network.
pub fn shared(file: &str, known_as: Familiar) -> Option<Model> {
    let folder = std::env::var_os("GEAR_TEST_MODELS");
    let path = folder.map(|folder| Path::new(&folder).join(file));
    let bytes = path.and_then(|path| std::fs::read(path).ok());
    if bytes.is_none() {
        eprintln!("skipped: GEAR_TEST_MODELS names no folder with {file}");
    }
    let read = |bytes: Vec<u8>| Model::new(file, &bytes, Some(known_as.declaration()));
    bytes.map(|bytes| read(bytes).unwrap_or_else(|error| panic!("{file}: {error}")))
}

/// gear's own prior, which is a file of the repository.
///
/// # Panics
/// If it is not there.
pub fn prior() -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("networks/prior_unet.onnx");
    let bytes = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let model = Model::new("prior_unet", &bytes, Some(Familiar::PriorUnet.declaration()));
    model.unwrap_or_else(|error| panic!("{error}"))
}

const FLOAT: u64 = 1;
const INT64: u64 = 7;

/// The bytes of its ONNX file (IR version 8, operator set 13).
pub fn onnx(net: &Net) -> Vec<u8> {
    let mut graph = Vec::new();
    let third = 1.0 / 3.0;
    match net {
        Net::Edges => {
            let laplacian = [0.0, 1.0, 0.0, 1.0, -4.0, 1.0, 0.0, 1.0, 0.0].map(|w: f32| w * third);
            floats(&mut graph, "w", &[1, 3, 3, 3], &laplacian.repeat(3));
            node(&mut graph, "Conv", &["x", "w"], "c", &[ints("pads", &[1, 1, 1, 1])]);
            node(&mut graph, "Abs", &["c"], "y", &[]);
        }
        Net::Mean | Net::MeanOf(_) => mean(&mut graph, "y"),
        Net::Negative => {
            floats(&mut graph, "one", &[1], &[1.0]);
            node(&mut graph, "Sub", &["one", "x"], "y", &[]);
        }
        Net::NotFinite => {
            mean(&mut graph, "m");
            node(&mut graph, "Sub", &["m", "m"], "zero", &[]);
            node(&mut graph, "Div", &["zero", "zero"], "y", &[]);
        }
        Net::Huge => {
            integers(&mut graph, "shape", &[4], &[1, 1, 30_000, 30_000]);
            mean(&mut graph, "m");
            integers(&mut graph, "axes", &[4], &[0, 1, 2, 3]);
            node(&mut graph, "ReduceMax", &["m"], "top", &[]);
            node(&mut graph, "Expand", &["top", "shape"], "y", &[]);
        }
        Net::Integers => node(&mut graph, "Cast", &["x"], "y", &[int("to", INT64)]),
        Net::Surface => {
            mean(&mut graph, "m");
            node(&mut graph, "Sub", &["m", "m"], "zero", &[]);
            floats(&mut graph, "one", &[1], &[1.0]);
            node(&mut graph, "Add", &["zero", "one"], "up", &[]);
            node(
                &mut graph,
                "Concat",
                &["zero", "zero", "up", "m"],
                "y",
                &[int("axis", 1)],
            );
        }
        Net::Endless => {
            integers(&mut graph, "rounds", &[], &[i64::MAX]);
            bools(&mut graph, "on", true);
            mean(&mut graph, "m");
            node(&mut graph, "Loop", &["rounds", "on", "m"], "y", &[body()]);
        }
    }
    let channels = match net {
        Net::MeanOf(n) => *n,
        _ => 3,
    };
    put_bytes(&mut graph, 2, b"graph");
    let sides = [Side::Is(1), Side::Is(channels), Side::Any("h"), Side::Any("w")];
    put_bytes(&mut graph, 11, &tensor_info("x", FLOAT, &sides));
    let kind = if *net == Net::Integers { INT64 } else { FLOAT };
    let any = [Side::Any("a"), Side::Any("b"), Side::Any("c"), Side::Any("d")];
    put_bytes(&mut graph, 12, &tensor_info("y", kind, &any));
    let mut model = Vec::new();
    put_varint(&mut model, 1, 8);
    put_bytes(&mut model, 2, b"gear");
    put_bytes(&mut model, 7, &graph);
    let mut operators = Vec::new();
    put_varint(&mut operators, 2, 13);
    put_bytes(&mut model, 8, &operators);
    model
}

fn mean(graph: &mut Vec<u8>, name: &str) {
    node(
        graph,
        "ReduceMean",
        &["x"],
        name,
        &[ints("axes", &[1]), int("keepdims", 1)],
    );
}

/// The body of a loop that goes on and changes nothing.
fn body() -> Vec<u8> {
    let mut graph = Vec::new();
    node(&mut graph, "Identity", &["go"], "go_on", &[]);
    node(&mut graph, "Abs", &["state"], "next", &[]);
    put_bytes(&mut graph, 2, b"body");
    put_bytes(&mut graph, 11, &tensor_info("round", INT64, &[]));
    put_bytes(&mut graph, 11, &tensor_info("go", 9, &[]));
    let any = [Side::Any("a"), Side::Any("b"), Side::Any("c"), Side::Any("d")];
    put_bytes(&mut graph, 11, &tensor_info("state", FLOAT, &any));
    put_bytes(&mut graph, 12, &tensor_info("go_on", 9, &[]));
    put_bytes(&mut graph, 12, &tensor_info("next", FLOAT, &any));
    let mut out = Vec::new();
    put_bytes(&mut out, 1, b"body");
    put_bytes(&mut out, 6, &graph);
    put_varint(&mut out, 20, 5);
    out
}

fn node(graph: &mut Vec<u8>, operator: &str, inputs: &[&str], output: &str, attributes: &[Vec<u8>]) {
    let mut out = Vec::new();
    inputs.iter().for_each(|name| put_bytes(&mut out, 1, name.as_bytes()));
    put_bytes(&mut out, 2, output.as_bytes());
    put_bytes(&mut out, 4, operator.as_bytes());
    attributes
        .iter()
        .for_each(|attribute| put_bytes(&mut out, 5, attribute));
    put_bytes(graph, 1, &out);
}

fn ints(name: &str, values: &[u64]) -> Vec<u8> {
    let mut out = Vec::new();
    put_bytes(&mut out, 1, name.as_bytes());
    values.iter().for_each(|value| put_varint(&mut out, 8, *value));
    put_varint(&mut out, 20, 7);
    out
}

fn int(name: &str, value: u64) -> Vec<u8> {
    let mut out = Vec::new();
    put_bytes(&mut out, 1, name.as_bytes());
    put_varint(&mut out, 3, value);
    put_varint(&mut out, 20, 2);
    out
}

fn constant(graph: &mut Vec<u8>, name: &str, kind: u64, dims: &[u64], raw: &[u8]) {
    let mut out = Vec::new();
    dims.iter().for_each(|side| put_varint(&mut out, 1, *side));
    put_varint(&mut out, 2, kind);
    put_bytes(&mut out, 8, name.as_bytes());
    put_bytes(&mut out, 9, raw);
    put_bytes(graph, 5, &out);
}

fn floats(graph: &mut Vec<u8>, name: &str, dims: &[u64], values: &[f32]) {
    let raw: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
    constant(graph, name, FLOAT, dims, &raw);
}

fn integers(graph: &mut Vec<u8>, name: &str, dims: &[u64], values: &[i64]) {
    let raw: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
    constant(graph, name, INT64, dims, &raw);
}

fn bools(graph: &mut Vec<u8>, name: &str, value: bool) {
    constant(graph, name, 9, &[], &[u8::from(value)]);
}

/// A side of a tensor: known, or named.
enum Side {
    Is(u64),
    Any(&'static str),
}

fn tensor_info(name: &str, kind: u64, sides: &[Side]) -> Vec<u8> {
    let mut shape = Vec::new();
    for side in sides {
        let mut out = Vec::new();
        match side {
            Side::Is(n) => put_varint(&mut out, 1, *n),
            Side::Any(name) => put_bytes(&mut out, 2, name.as_bytes()),
        }
        put_bytes(&mut shape, 1, &out);
    }
    let mut tensor = Vec::new();
    put_varint(&mut tensor, 1, kind);
    put_bytes(&mut tensor, 2, &shape);
    let mut of = Vec::new();
    put_bytes(&mut of, 1, &tensor);
    let mut info = Vec::new();
    put_bytes(&mut info, 1, name.as_bytes());
    put_bytes(&mut info, 2, &of);
    info
}
