//! A report: what a node says about its result, as JSON.

use serde::Serialize;

use crate::{Context, Digest, FileSource, Loader, NodeError, Params, Summary, Value, ValueError};

/// Any JSON value; by habit an object of named figures.
///
/// What is undefined is `null`, never a made-up number (JSON has no NaN).
#[derive(Clone, Debug, PartialEq)]
pub struct Report(pub serde_json::Value);

impl Report {
    /// A report made from anything that serialises.
    pub fn new(content: impl Serialize) -> Result<Self, ValueError> {
        serde_json::to_value(content)
            .map(Self)
            .map_err(|e| ValueError::new("Report", e.to_string()))
    }

    /// The canonical text: objects sorted by key, so that equal reports have equal digests.
    fn canonical(&self) -> Vec<u8> {
        let mut sorted = self.0.clone();
        sorted.sort_all_objects();
        sorted.to_string().into_bytes()
    }
}

impl Value for Report {
    const TYPE: &'static str = "Report";
    const DOC: &'static str = "What a node says about its result: any JSON, by habit an object of named figures. What is undefined is `null`.";
    const EXTENSION: &'static str = "json";

    fn digest(&self) -> Digest {
        Digest::of(&self.canonical())
    }

    fn size_bytes(&self) -> usize {
        self.0.to_string().len()
    }

    fn encode(&self) -> Result<Vec<u8>, ValueError> {
        serde_json::to_vec_pretty(&self.0).map_err(|e| ValueError::new("Report", e.to_string()))
    }

    fn decode(bytes: &[u8]) -> Result<Self, ValueError> {
        serde_json::from_slice(bytes)
            .map(Self)
            .map_err(|e| ValueError::new("Report", e.to_string()))
    }

    fn summary(&self) -> Summary {
        match &self.0 {
            serde_json::Value::Object(fields) => fields.clone(),
            other => Summary::from_iter([("value".to_string(), other.clone())]),
        }
    }

    fn extremes() -> Vec<(&'static str, Self)> {
        vec![
            ("null", Self(serde_json::Value::Null)),
            ("empty", Self(serde_json::json!({}))),
            ("a bare number", Self(serde_json::json!(-1e300))),
            ("nested", Self(serde_json::json!({"a": [{"b": null}, [], "\u{3b1}"]}))),
        ]
    }
}

/// Largest JSON file that is read.
const LARGEST: usize = 64 << 20;

/// A report from a JSON file: a workflow, recorded facts, figures of another program.
#[derive(Clone, Debug, Params)]
pub struct ReportFile {}

impl Loader for ReportFile {
    const VERSION: u32 = 1;
    type Value = Report;

    fn load(&self, file: &FileSource, _: &Context) -> Result<Report, NodeError> {
        let bytes = file.read()?;
        if bytes.len() > LARGEST {
            let found = bytes.len() >> 20;
            return Err(NodeError::new(format!(
                "found {found} MiB; a JSON file of at most {} MiB is read",
                LARGEST >> 20
            )));
        }
        serde_json::from_slice(&bytes)
            .map(Report)
            .map_err(|error| NodeError::new(format!("expected a JSON file, found something else ({error})")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_file_is_read_or_told_to_be_no_json() {
        let load = |text: &str| {
            ReportFile {}.load(
                &FileSource::bytes("a.json", text.as_bytes().to_vec()),
                &Context::detached(),
            )
        };
        assert_eq!(load("{\"a\": [1]}").unwrap().0, json!({"a": [1]}));
        assert!(load("a: 1").unwrap_err().to_string().contains("expected a JSON file"));
    }

    #[test]
    fn order_of_keys_is_kept_but_does_not_count() {
        let (a, b) = (
            Report(json!({"x": 1.5, "a": null})),
            Report(json!({"a": null, "x": 1.5})),
        );
        assert_eq!(a.digest(), b.digest());
        let back = Report::decode(&a.encode().unwrap()).unwrap();
        assert_eq!(back.0.to_string(), a.0.to_string());
    }
}
