//! The OpenAI-compatible call `POST chat/completions`, with pictures.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use ureq::http::Method;

use crate::images::kind;
use crate::transport::{Request, Transport};
use crate::{Endpoint, Policy, ServiceError};

/// A part of what the user says.
#[derive(Clone, Debug)]
pub enum Part {
    /// Words.
    Text(String),
    /// A PNG picture.
    Png(Vec<u8>),
}

/// What was said.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Said {
    /// The text.
    pub text: String,
    /// The model that the answer names.
    pub model: Option<String>,
}

/// The service.
pub struct Chat<'a>(Transport<'a>);

impl<'a> Chat<'a> {
    /// The service at `endpoint`.
    pub fn new(endpoint: &Endpoint, policy: Policy, interrupted: &'a (dyn Fn() -> bool + Sync)) -> Self {
        Self(Transport::new(endpoint, policy, interrupted))
    }

    /// The way to it.
    pub fn transport(&self) -> &Transport<'a> {
        &self.0
    }

    /// Says something and asks for a JSON object in return. Not every model knows a temperature.
    pub fn ask(&self, system: &str, parts: &[Part], seed: u64, temperature: Option<f64>) -> Result<Said, ServiceError> {
        let content: Vec<Value> = parts
            .iter()
            .map(|part| match part {
                Part::Text(text) => json!({"type": "text", "text": text}),
                Part::Png(bytes) => {
                    let url = format!("data:image/png;base64,{}", STANDARD.encode(bytes));
                    json!({"type": "image_url", "image_url": {"url": url}})
                }
            })
            .collect();
        let mut body = json!({
            "model": self.0.endpoint().model(),
            "messages": [{"role": "system", "content": system}, {"role": "user", "content": content}],
            "response_format": {"type": "json_object"},
            "seed": seed,
        });
        if let Some(temperature) = temperature {
            body["temperature"] = temperature.into();
        }
        let body = body.to_string();
        let answer = self.0.send(&Request {
            method: Method::POST,
            address: "/chat/completions".to_owned(),
            body: body.as_bytes(),
            content_type: "application/json",
        })?;
        let expected = "JSON with choices[0].message.content";
        let json: Value = serde_json::from_slice(&answer.body)
            .map_err(|_| self.0.unexpected(kind(&answer.content_type), expected))?;
        let text = json["choices"][0]["message"]["content"].as_str();
        let text = text.ok_or_else(|| self.0.unexpected("JSON without a message", expected))?;
        Ok(Said {
            text: text.to_owned(),
            model: json.get("model").and_then(Value::as_str).map(str::to_owned),
        })
    }
}
