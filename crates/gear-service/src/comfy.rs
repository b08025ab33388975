//! A ComfyUI server: upload, queue, poll, fetch.
//!
//! A workflow is what ComfyUI saves with “Export (API)”: an object of numbered nodes. Places in it are marked by texts
//! that stand alone as an input: `{{image}}` (the name of the uploaded picture), `{{edges}}` (of the edge map),
//! `{{seed}}` (a number); `{{prompt}}` may also stand within a longer text.

use std::time::{Duration, Instant};

use serde_json::{Value, json};
use ureq::http::Method;

use crate::images::kind;
use crate::multipart::Form;
use crate::transport::{Request, Transport};
use crate::{Endpoint, Policy, ServiceError};

/// One run of a workflow.
#[derive(Clone, Debug)]
pub struct Job<'a> {
    /// The workflow, with its places.
    pub workflow: &'a Value,
    /// The picture, PNG.
    pub image: &'a [u8],
    /// The edge map, PNG; needed if the workflow has a place for it.
    pub edges: Option<&'a [u8]>,
    /// What is asked for.
    pub prompt: &'a str,
    /// The seed.
    pub seed: u64,
}

/// The server.
pub struct Comfy<'a> {
    transport: Transport<'a>,
    poll: Duration,
    patience: Duration,
}

impl<'a> Comfy<'a> {
    /// The server at `endpoint`, which is asked every `poll` whether a job is done, for `patience` at most.
    pub fn new(
        endpoint: &Endpoint,
        policy: Policy,
        poll: Duration,
        patience: Duration,
        interrupted: &'a (dyn Fn() -> bool + Sync),
    ) -> Self {
        Self {
            transport: Transport::new(endpoint, policy, interrupted),
            poll: poll.max(Duration::from_millis(1)),
            patience,
        }
    }

    /// The way to it.
    pub fn transport(&self) -> &Transport<'a> {
        &self.transport
    }

    /// Runs a workflow: the bytes of the first picture that it put out.
    pub fn run(&self, job: &Job<'_>) -> Result<Vec<u8>, ServiceError> {
        let needs_edges = mentions(job.workflow, "{{edges}}");
        check(job.workflow)?;
        let image = self.upload(job.image)?;
        let edges = match (needs_edges, job.edges) {
            (false, _) => None,
            (true, Some(edges)) => Some(self.upload(edges)?),
            (true, None) => {
                return Err(ServiceError::Workflow {
                    problem: "has a place {{edges}}, but no edge map is given; wire `edges`".to_owned(),
                });
            }
        };
        let filled = fill(job.workflow, &|text| match text {
            "{{image}}" => Some(Value::from(image.clone())),
            "{{edges}}" => edges.clone().map(Value::from),
            "{{seed}}" => Some(Value::from(job.seed)),
            text if text.contains("{{prompt}}") => Some(Value::from(text.replace("{{prompt}}", job.prompt))),
            _ => None,
        });
        let id = self.queue(&filled)?;
        let place = self.wait(&id)?;
        Ok(self.transport.send(&Request::get(place))?.body)
    }

    fn json(&self, request: &Request<'_>, expected: &str) -> Result<Value, ServiceError> {
        let answer = self.transport.send(request)?;
        serde_json::from_slice(&answer.body)
            .map_err(|_| self.transport.unexpected(kind(&answer.content_type), expected))
    }

    /// Uploads a picture under a name made from its content: the same picture twice is one file.
    fn upload(&self, png: &[u8]) -> Result<String, ServiceError> {
        let name = format!("gear-{}.png", &gear_graph::Digest::of(png).hex()[..24]);
        let mut form = Form::new(png);
        form.png("image", &name, png)
            .text("type", "input")
            .text("overwrite", "true");
        let (content_type, body) = form.finish();
        let expected = "JSON with the name of the uploaded picture";
        let request = Request {
            method: Method::POST,
            address: "/upload/image".to_owned(),
            body: &body,
            content_type: &content_type,
        };
        let json = self.json(&request, expected)?;
        let text = |name: &str| json.get(name).and_then(Value::as_str).unwrap_or_default();
        match (text("subfolder"), text("name")) {
            (_, "") => Err(self.transport.unexpected("JSON without a name", expected)),
            ("", name) => Ok(name.to_owned()),
            (folder, name) => Ok(format!("{folder}/{name}")),
        }
    }

    fn queue(&self, workflow: &Value) -> Result<String, ServiceError> {
        let body = json!({"prompt": workflow, "client_id": "gear"}).to_string();
        let expected = "JSON with a prompt_id";
        let request = Request {
            method: Method::POST,
            address: "/prompt".to_owned(),
            body: body.as_bytes(),
            content_type: "application/json",
        };
        let json = self.json(&request, expected)?;
        let id = json.get("prompt_id").and_then(Value::as_str).unwrap_or_default();
        // It becomes a part of an address.
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if id.is_empty() || id.len() > 100 || !id.chars().all(plain) {
            return Err(self.transport.unexpected("JSON without a usable prompt_id", expected));
        }
        Ok(id.to_owned())
    }

    /// Asks until the job is done: where its first picture is.
    fn wait(&self, id: &str) -> Result<String, ServiceError> {
        let since = Instant::now();
        loop {
            let history = self.json(&Request::get(format!("/history/{id}")), "the history of the job")?;
            if let Some(entry) = history.get(id) {
                if entry["status"]["status_str"] == "error" {
                    let said = entry["status"]["messages"].to_string();
                    let short: String = said.chars().take(300).collect();
                    return Err(self.transport.unexpected(format!("a failed job: {short}"), "a picture"));
                }
                let outputs = entry.get("outputs").and_then(Value::as_object);
                let pictures = outputs.into_iter().flat_map(|outputs| outputs.values());
                let pictures = pictures.filter_map(|output| output.get("images")?.as_array());
                // Nodes that save come before those that only show.
                let mut all: Vec<&Value> = pictures.flatten().collect();
                all.sort_by_key(|picture| picture["type"] != "output");
                if let Some(picture) = all.first() {
                    let part = |name: &str| encoded(picture[name].as_str().unwrap_or_default());
                    let (file, folder, place) = (part("filename"), part("subfolder"), part("type"));
                    return Ok(format!("/view?filename={file}&subfolder={folder}&type={place}"));
                }
                if entry["status"]["completed"] == true {
                    return Err(self
                        .transport
                        .unexpected("a job without a picture", "a workflow that saves one"));
                }
            }
            if since.elapsed() > self.patience {
                let waited = format!("no picture after {} s", self.patience.as_secs());
                return Err(self.transport.unexpected(waited, "a picture; raise `patience`"));
            }
            self.transport.sleep(self.poll)?;
        }
    }
}

/// Whether the workflow is one, and has a place for the picture.
fn check(workflow: &Value) -> Result<(), ServiceError> {
    let problem = |text: &str| {
        Err(ServiceError::Workflow {
            problem: text.to_owned(),
        })
    };
    let Some(nodes) = workflow.as_object().filter(|nodes| !nodes.is_empty()) else {
        return problem("is no object of nodes; save it in ComfyUI with Export (API)");
    };
    if nodes.contains_key("nodes") && nodes.contains_key("links") {
        return problem("is in ComfyUI's editor format; save it with Export (API)");
    }
    if !nodes.values().all(|node| node.get("class_type").is_some()) {
        return problem("has a node without `class_type`; save it in ComfyUI with Export (API)");
    }
    if !mentions(workflow, "{{image}}") {
        return problem("has no place for the picture; write {{image}} as the file name of a LoadImage node");
    }
    Ok(())
}

fn mentions(value: &Value, place: &str) -> bool {
    match value {
        Value::String(text) => text == place,
        Value::Array(items) => items.iter().any(|item| mentions(item, place)),
        Value::Object(fields) => fields.values().any(|item| mentions(item, place)),
        _ => false,
    }
}

fn fill(value: &Value, with: &dyn Fn(&str) -> Option<Value>) -> Value {
    match value {
        Value::String(text) => with(text).unwrap_or_else(|| value.clone()),
        Value::Array(items) => items.iter().map(|item| fill(item, with)).collect(),
        Value::Object(fields) => fields
            .iter()
            .map(|(name, item)| (name.clone(), fill(item, with)))
            .collect(),
        other => other.clone(),
    }
}

/// Percent-encoding of everything that is not plain.
fn encoded(text: &str) -> String {
    let mut out = String::new();
    for byte in text.bytes() {
        if byte.is_ascii_alphanumeric() || b"-_.".contains(&byte) {
            out.push(char::from(byte));
        } else {
            out.push_str(&format!("%{byte:02X}"));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn workflow() -> Value {
        json!({
            "1": {"class_type": "LoadImage", "inputs": {"image": "{{image}}"}},
            "2": {"class_type": "CLIPTextEncode", "inputs": {"text": "{{prompt}}, best quality", "clip": ["4", 1]}},
            "3": {"class_type": "KSampler", "inputs": {"seed": "{{seed}}"}},
        })
    }

    #[test]
    fn places_are_filled() {
        let filled = fill(&workflow(), &|text| match text {
            "{{seed}}" => Some(7.into()),
            text => Some(text.replace("{{prompt}}", "marble").into()),
        });
        assert_eq!(filled["2"]["inputs"]["text"], "marble, best quality");
        assert_eq!(filled["3"]["inputs"]["seed"], 7);
        assert_eq!(filled["2"]["inputs"]["clip"], json!(["4", 1]));
    }

    #[test]
    fn what_is_no_workflow_is_told() {
        assert!(check(&workflow()).is_ok());
        for bad in [
            json!(null),
            json!({}),
            json!({"nodes": [], "links": []}),
            json!({"1": {"inputs": {}}}),
            json!({"1": {"class_type": "LoadImage", "inputs": {"image": "a.png"}}}),
        ] {
            assert!(check(&bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn names_are_encoded() {
        assert_eq!(encoded("a b&c=ü.png"), "a%20b%26c%3D%C3%BC.png");
    }
}
