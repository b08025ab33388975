//! A handler that behaves: it edits pictures and judges them, by both picture protocols and by chat.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gear_image::io::{self, Options};
use gear_image::{Image, SrgbImage};
use serde_json::{Value, json};

use super::{Received, Reply};

type Edit = dyn Fn(SrgbImage) -> SrgbImage + Send + Sync;

/// A service that does what it is asked, with a function for its model.
pub struct Studio {
    edit: Box<Edit>,
    uploads: Mutex<BTreeMap<String, Vec<u8>>>,
}

impl Studio {
    /// A studio that edits pictures this way.
    pub fn new(edit: impl Fn(SrgbImage) -> SrgbImage + Send + Sync + 'static) -> Self {
        Self {
            edit: Box::new(edit),
            uploads: Mutex::default(),
        }
    }

    /// The picture that it makes of a PNG, as PNG.
    pub fn edited(&self, png: &[u8]) -> Option<Vec<u8>> {
        let options = Options {
            size: 1 << 14,
            ..Options::default()
        };
        let loaded = io::decode_image(&mut std::io::Cursor::new(png), None, &options).ok()?;
        let rgb = (self.edit)(loaded.image.rgb);
        io::png_bytes(&Image { rgb, alpha: None }).ok()
    }

    /// Answers.
    pub fn answer(&self, asked: &Received) -> Reply {
        let path = asked.path.split('?').next().unwrap_or_default();
        let answer = match path {
            "/images/edits" => self.images_edits(asked),
            "/upload/image" => self.upload(asked),
            "/prompt" => self.prompt(asked),
            "/view" => self.view(asked),
            "/chat/completions" => judged(asked),
            path => path.strip_prefix("/history/").map(history),
        };
        answer.unwrap_or_else(|| Reply::json(404, r#"{"error": {"message": "there is nothing here"}}"#))
    }

    fn images_edits(&self, asked: &Received) -> Option<Reply> {
        let edited = self.edited(&asked.field("image")?)?;
        let model = String::from_utf8(asked.field("model")?).ok()?;
        let body = json!({"model": format!("{model}-2026"), "data": [{"b64_json": STANDARD.encode(edited)}]});
        Some(Reply::json(200, &body.to_string()))
    }

    fn upload(&self, asked: &Received) -> Option<Reply> {
        let bytes = asked.field("image")?;
        let name = format!("{}.png", gear_graph::Digest::of(&bytes).hex());
        self.uploads().insert(name.clone(), bytes);
        Some(Reply::json(
            200,
            &json!({"name": name, "subfolder": "", "type": "input"}).to_string(),
        ))
    }

    /// The job's number is the name of the picture that its `LoadImage` node reads.
    fn prompt(&self, asked: &Received) -> Option<Reply> {
        let body: Value = serde_json::from_slice(&asked.body).ok()?;
        let nodes = body["prompt"].as_object()?;
        let load = nodes.values().find(|node| node["class_type"] == "LoadImage")?;
        let name = load["inputs"]["image"].as_str()?;
        let id = name.strip_suffix(".png")?;
        self.uploads()
            .contains_key(name)
            .then(|| Reply::json(200, &json!({"prompt_id": id}).to_string()))
    }

    fn view(&self, asked: &Received) -> Option<Reply> {
        let name = asked.path.split("filename=").nth(1)?.split('&').next()?.to_owned();
        let bytes = self.uploads().get(&name).cloned()?;
        Some(Reply::new(200, "image/png", self.edited(&bytes)?))
    }

    fn uploads(&self) -> std::sync::MutexGuard<'_, BTreeMap<String, Vec<u8>>> {
        self.uploads.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Scores of every picture after the first, by how near its mean tone is to the first's: whatever the order.
fn judged(asked: &Received) -> Option<Reply> {
    let body: Value = serde_json::from_slice(&asked.body).ok()?;
    let parts = body["messages"]
        .as_array()?
        .iter()
        .filter_map(|message| message["content"].as_array());
    let pictures = parts.flatten().filter_map(|part| part["image_url"]["url"].as_str());
    let tones: Vec<f64> = pictures.map(tone).collect::<Option<_>>()?;
    let (painting, candidates) = tones.split_first()?;
    let scores = candidates.iter().zip('A'..).map(|(tone, letter)| {
        let score = (10.0 * (1.0 - (tone - painting).abs())).clamp(1.0, 10.0);
        (
            letter.to_string(),
            json!({"TF": score, "GA": score, "VC": score, "AC": score}),
        )
    });
    let text = Value::Object(scores.collect()).to_string();
    let model = format!("{}-2026", body["model"].as_str()?);
    Some(Reply::json(
        200,
        &json!({"model": model, "choices": [{"message": {"content": text}}]}).to_string(),
    ))
}

/// The mean tone of a PNG that stands in an address.
fn tone(url: &str) -> Option<f64> {
    let png = STANDARD.decode(url.strip_prefix("data:image/png;base64,")?).ok()?;
    let loaded = io::decode_image(&mut std::io::Cursor::new(png), None, &Options::default()).ok()?;
    Some(gear_image::stats::mean(loaded.image.rgb.data().as_flattened()))
}

fn history(id: &str) -> Reply {
    let picture = json!({"filename": format!("{id}.png"), "subfolder": "", "type": "output"});
    let entry =
        json!({"outputs": {"9": {"images": [picture]}}, "status": {"status_str": "success", "completed": true}});
    Reply::json(200, &json!({ id: entry }).to_string())
}
