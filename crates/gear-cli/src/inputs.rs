//! What is given for the inputs of a graph.

use std::ffi::{OsStr, OsString};

use gear_graph::{Graph, GraphInput, Input, NodeError, Value};
use gear_image::Image;
use gear_sample::{Options, Request, Sample, Show};

use crate::error::CliError;

/// Raise when a sample's pixels change: `sample:NAME` inputs are known to the store by this number.
const SAMPLE_VERSION: u32 = 1;

/// Reads every `NAME=PATH` and `NAME=sample:NAME`. Whether the graph has such inputs is the run's to say.
pub fn parse(given: &[OsString], graph: &Graph) -> Result<Vec<(String, Input)>, CliError> {
    let mut inputs: Vec<(String, Input)> = Vec::new();
    for text in given {
        let form = || CliError::InputForm {
            given: text.to_string_lossy().into_owned(),
        };
        let (name, value) = split(text).ok_or_else(form)?;
        if name.is_empty() || value.is_empty() {
            return Err(form());
        }
        if inputs.iter().any(|(known, _)| known == name) {
            return Err(CliError::InputTwice { name: name.to_owned() });
        }
        let input = graph.inputs().iter().find(|input| input.name == name);
        let parsed = match (sample_name(value), input) {
            (Some(sample), Some(input)) => sampled(sample, input, working_size(graph, input))?,
            _ => Input::file(value),
        };
        inputs.push((name.to_owned(), parsed));
    }
    Ok(inputs)
}

/// Name and path of an `--input`. A path may hold any bytes; a name is text.
pub fn split(given: &OsStr) -> Option<(&str, &OsStr)> {
    if let Some(text) = given.to_str() {
        let (name, path) = text.split_once('=')?;
        return Some((name, OsStr::new(path)));
    }
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;
        let bytes = given.as_bytes();
        let at = bytes.iter().position(|byte| *byte == b'=')?;
        let name = std::str::from_utf8(&bytes[..at]).ok()?;
        Some((name, OsStr::from_bytes(&bytes[at + 1..])))
    }
    #[cfg(not(unix))]
    {
        None
    }
}

/// The sample that is meant by `sample:NAME`.
pub fn sample_name(path: &OsStr) -> Option<&str> {
    path.to_str()?.strip_prefix("sample:")
}

/// The size at which a sample is painted for an input. A picture sets it; a mask follows the graph's first picture, as
/// its own size is only an upper limit.
fn working_size(graph: &Graph, input: &GraphInput) -> usize {
    let picture = |input: &&GraphInput| input.value_type.name == "Image";
    let sets = Some(input)
        .filter(picture)
        .or_else(|| graph.inputs().iter().find(picture));
    let size = sets.and_then(|input| input.params().get("size")?.as_u64());
    let size = size.and_then(|size| usize::try_from(size).ok());
    size.unwrap_or(Options::default().longer_side)
        .clamp(gear_sample::MIN_SIDE, gear_sample::MAX_SIDE)
}

/// A sample, painted only when its pixels are needed.
fn sampled(sample: &str, input: &GraphInput, longer_side: usize) -> Result<Input, CliError> {
    let encode: fn(&Sample, Show) -> Result<Vec<u8>, String> = match input.value_type.name {
        "Image" => |sample, show| match show {
            Show::Painting => gear_image::io::png_bytes(&sample.painting),
            Show::Normals => gear_image::io::png_bytes(&Image::opaque(sample.normal_map())),
            Show::Albedo => gear_image::io::png_bytes(&Image::opaque(sample.albedo.to_srgb())),
        },
        "Mask" => |sample, _| gear_image::io::png_bytes(&white_on_black(sample)),
        "Field" => |sample, _| sample.front().encode().map_err(|e| e.to_string()),
        "Scene" => |sample, _| sample.scene(1).encode().map_err(|e| e.to_string()),
        value_type => {
            return Err(CliError::SampleType {
                name: input.name.clone(),
                sample: sample.to_owned(),
                value_type,
            });
        }
    };
    let request = Request::parse(sample, longer_side).map_err(|cause| CliError::Sample {
        asked: format!("--input {}=sample:{sample}", input.name),
        cause,
    })?;
    let key = match request.has_default_options() {
        true => format!(
            "sample {SAMPLE_VERSION} {} {longer_side} {}",
            request.name, input.value_type.name
        ),
        false => format!("sample {SAMPLE_VERSION} {request:?} {}", input.value_type.name),
    };
    Ok(Input::made(format!("sample:{sample}"), &key, move || {
        let painted = gear_sample::paint(&request.name, &request.options);
        let painted = painted.map_err(|e| NodeError::because("no such sample", e))?;
        encode(&painted, request.show).map_err(NodeError::new)
    }))
}

fn white_on_black(sample: &Sample) -> Image {
    let mask = sample.mask.to_field();
    let pixels = mask.data().iter().map(|&inside| [inside; 3]).collect();
    Image::opaque(gear_image::SrgbImage::from_vec(mask.width(), mask.height(), pixels))
}

#[cfg(test)]
mod tests {
    use gear_graph::{Digest, GraphSource};

    use super::*;

    fn key_of(input: &Input) -> Option<Digest> {
        match input {
            Input::Made { key, .. } => Some(*key),
            _ => None,
        }
    }

    fn graph(size: u32) -> Graph {
        let text = format!(
            "gear: 1\ninputs: {{painting: {{type: Image, with: {{size: {size}}}}}, note: Report}}\n\
             nodes:\n  edges: {{node: EdgeDetect, in: {{image: painting}}}}\noutputs: {{edges: edges.edges}}\n"
        );
        GraphSource::new("test", text).check(&crate::registry()).unwrap()
    }

    fn parsed(given: &[&str], size: u32) -> Result<Vec<(String, Input)>, CliError> {
        let given: Vec<OsString> = given.iter().map(OsString::from).collect();
        parse(&given, &graph(size))
    }

    #[test]
    fn a_sample_is_another_input_at_another_size() {
        let key = |size| key_of(&parsed(&["painting=sample:vessel"], size).unwrap()[0].1);
        assert!(key(64).is_some());
        assert_eq!(key(64), key(64));
        assert_ne!(key(64), key(65));
    }

    #[test]
    fn a_sample_is_another_input_with_other_options() {
        let key = |sample: &str| key_of(&parsed(&[&format!("painting=sample:{sample}")], 64).unwrap()[0].1);
        assert_eq!(key("vessel"), key("vessel,condition=paint,light=upper-left,seed=1"));
        for other in [
            "vessel-1",
            "vessel,light=right",
            "vessel,seed=2",
            "vessel,condition=flat",
            "vessel,show=normals",
        ] {
            assert_ne!(key("vessel"), key(other), "{other}");
        }
    }

    #[test]
    fn a_sample_s_mask_has_the_size_of_its_painting() {
        let graph = |inputs: &str, nodes: &str, output: &str| {
            let text = format!("gear: 1\ninputs: {{{inputs}}}\nnodes: {{{nodes}}}\noutputs: {{mask: {output}}}\n");
            GraphSource::new("test", text).check(&crate::registry()).unwrap()
        };
        let mask = |graph: &Graph| working_size(graph, graph.inputs().iter().find(|i| i.name == "mask").unwrap());
        let painted = graph(
            "painting: {type: Image, with: {size: 96}}, mask: Mask",
            "foreground: {node: Foreground, in: {image: painting, mask: mask}}",
            "foreground.mask",
        );
        assert_eq!(mask(&painted), 96);
        assert_eq!(mask(&graph("mask: Mask", "", "mask")), 768);
    }

    #[test]
    fn malformed_inputs_are_named() {
        for given in ["painting", "=a.png", "painting="] {
            assert!(parsed(&[given], 64).unwrap_err().to_string().contains(given));
        }
        let twice = parsed(&["painting=a.png", "painting=b.png"], 64).unwrap_err();
        assert!(twice.to_string().contains("more than once"));
    }

    #[cfg(unix)]
    #[test]
    fn a_path_may_hold_any_bytes() {
        use std::os::unix::ffi::OsStrExt;
        let bytes = |bytes: &[u8]| OsStr::from_bytes(bytes).to_owned();
        let path = bytes(b"a\xff=b.png");
        let read = parse(&[bytes(b"painting=a\xff=b.png")], &graph(64)).unwrap();
        assert!(matches!(&read[0].1, Input::File(found) if found.as_os_str() == path));
        assert!(parse(&[bytes(b"p\xff=a.png")], &graph(64)).is_err(), "a name is text");
    }

    #[test]
    fn an_unknown_sample_is_named_with_those_that_exist() {
        let message = parsed(&["painting=sample:cat"], 64).unwrap_err().to_string();
        assert!(message.contains("cat") && message.contains("court-lady"), "{message}");
        let message = parsed(&["painting=sample:vessel,light=moon"], 64)
            .unwrap_err()
            .to_string();
        assert!(message.contains("moon") && message.contains("upper-left"), "{message}");
        assert!(matches!(
            parsed(&["note=sample:vessel"], 64),
            Err(CliError::SampleType { .. })
        ));
    }
}
