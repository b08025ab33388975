//! The OpenAI-compatible call `POST images/edits`.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;
use ureq::http::Method;

use crate::multipart::Form;
use crate::transport::{Request, Transport};
use crate::{Endpoint, Policy, ServiceError};

/// One edit.
#[derive(Clone, Debug, Default)]
pub struct ImageEdit<'a> {
    /// The picture, PNG.
    pub image: &'a [u8],
    /// Where it may change: transparent pixels of a PNG of the same size.
    pub mask: Option<&'a [u8]>,
    /// What is asked for.
    pub prompt: &'a str,
    /// `size` as the service knows it, such as `auto` or `1024x1024`; not sent if empty.
    pub size: &'a str,
    /// Not every service knows it; not sent if `None`.
    pub seed: Option<u64>,
    /// `response_format: b64_json`: some services send a link otherwise, others do not know the field.
    pub ask_for_bytes: bool,
}

/// The service.
pub struct Images<'a>(Transport<'a>);

impl<'a> Images<'a> {
    /// The service at `endpoint`.
    pub fn new(endpoint: &Endpoint, policy: Policy, interrupted: &'a (dyn Fn() -> bool + Sync)) -> Self {
        Self(Transport::new(endpoint, policy, interrupted))
    }

    /// The way to it.
    pub fn transport(&self) -> &Transport<'a> {
        &self.0
    }

    /// Asks for an edit: the bytes of the picture that came back, and the model that the answer names.
    pub fn edit(&self, edit: &ImageEdit<'_>) -> Result<(Vec<u8>, Option<String>), ServiceError> {
        let mut form = Form::new(edit.image);
        form.text("model", self.0.endpoint().model())
            .text("prompt", edit.prompt)
            .text("n", "1");
        if !edit.size.is_empty() {
            form.text("size", edit.size);
        }
        if let Some(seed) = edit.seed {
            form.text("seed", &seed.to_string());
        }
        if edit.ask_for_bytes {
            form.text("response_format", "b64_json");
        }
        form.png("image", "image.png", edit.image);
        if let Some(mask) = edit.mask {
            form.png("mask", "mask.png", mask);
        }
        let (content_type, body) = form.finish();
        let answer = self.0.send(&Request {
            method: Method::POST,
            address: "/images/edits".to_owned(),
            body: &body,
            content_type: &content_type,
        })?;
        let expected = "JSON with data[0].b64_json or data[0].url";
        let json: Value = serde_json::from_slice(&answer.body)
            .map_err(|_| self.0.unexpected(kind(&answer.content_type), expected))?;
        let model = json.get("model").and_then(Value::as_str).map(str::to_owned);
        let first = json.get("data").and_then(|data| data.get(0));
        let text = |name: &str| first.and_then(|first| first.get(name)).and_then(Value::as_str);
        let bytes = if let Some(coded) = text("b64_json") {
            STANDARD
                .decode(coded.trim())
                .map_err(|_| self.0.unexpected("a b64_json that is no base64", expected))?
        } else if let Some(link) = text("url") {
            if !self.0.endpoint().owns(link) {
                return Err(self.0.unexpected(
                    "a link to another host",
                    "the picture itself: set `ask_for_bytes: true`, or use a service that sends it",
                ));
            }
            self.0.send(&Request::get(self.0.endpoint().absolute(link)))?.body
        } else {
            return Err(self.0.unexpected("JSON without a picture", expected));
        };
        Ok((bytes, model))
    }
}

/// An answer's kind, for a message.
pub(crate) fn kind(content_type: &str) -> String {
    let plain: String = content_type.chars().filter(|c| !c.is_control()).take(80).collect();
    if plain.is_empty() {
        "something that is no JSON".to_owned()
    } else {
        format!("`{plain}` that is no JSON")
    }
}
