//! Views as OpenEXR: one layer a view, f32, uncompressed.
//!
//! Channels are `R G B` (sRGB-encoded, an attribute says so) and, where there are any, `A` (coverage), `Z` (depth),
//! `NX NY NZ` (world-space normal) and `W` (weight of a target). Each layer's attributes `gear:camera` (JSON), `gear:view`
//! (its name) and `gear:index` (its place) say what it shows; attributes of the image as a whole do not survive reading.
//! Layers are named by index and name, since EXR wants distinct names.

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, Layers};
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Text};
use exr::meta::header::{ImageAttributes, LayerAttributes};
use exr::prelude::{ReadChannels, ReadLayers, SmallVec, WritableImage, read as reader};
use gear_image::{Field, Rgb};

use crate::{Camera, View, Views};

/// No stored set of views has more samples; a header that claims more is damaged.
const MOST_SAMPLES: usize = 1 << 32;
const CAMERA: &str = "gear:camera";
const NAME: &str = "gear:view";
const INDEX: &str = "gear:index";

/// Writes the views.
pub fn write(views: &Views) -> Result<Vec<u8>, String> {
    let mut layers: SmallVec<[Layer<AnyChannels<FlatSamples>>; 2]> = SmallVec::new();
    for (index, view) in views.views.iter().enumerate() {
        layers.push(layer(index, view)?);
    }
    if layers.is_empty() {
        // EXR needs a layer; one without a camera is no view.
        let plane = AnyChannel::new("Y", FlatSamples::F32(vec![0.0]));
        let attributes = LayerAttributes::named("no views");
        let channels = AnyChannels::sort(SmallVec::from_iter([plane]));
        layers.push(Layer::new((1, 1), attributes, Encoding::UNCOMPRESSED, channels));
    }
    let area = |v: &View| v.rgb.width().max(1) as i32;
    let widest = views.views.iter().map(area).max().unwrap_or(1);
    let display = exr::math::Vec2(
        widest as usize,
        views.views.iter().map(|v| v.rgb.height()).max().unwrap_or(1),
    );
    let image = Image {
        attributes: ImageAttributes::with_size(display),
        layer_data: Layers::from(layers),
    };
    let mut bytes = Vec::new();
    image
        .write()
        .non_parallel()
        .to_buffered(Cursor::new(&mut bytes))
        .map_err(|e| e.to_string())?;
    Ok(bytes)
}

fn layer(index: usize, view: &View) -> Result<Layer<AnyChannels<FlatSamples>>, String> {
    let (width, height) = view.rgb.size();
    if !view.camera.is_valid() {
        return Err(format!("view `{}`: its camera is not finite", view.name));
    }
    if (width, height) != (view.camera.width as usize, view.camera.height as usize) {
        return Err(format!(
            "view `{}` has {width}x{height} pixels, its camera {}x{}",
            view.name, view.camera.width, view.camera.height
        ));
    }
    let mut planes: Vec<(&str, Vec<f32>)> = Vec::new();
    let mut three = |names: [&'static str; 3], pixels: &[[f32; 3]]| {
        for (c, name) in names.into_iter().enumerate() {
            planes.push((name, pixels.iter().map(|p| p[c]).collect()));
        }
    };
    three(["R", "G", "B"], view.rgb.data());
    if let Some(normal) = &view.normal {
        three(["NX", "NY", "NZ"], normal);
    }
    for (name, plane) in [("A", &view.alpha), ("Z", &view.depth), ("W", &view.weight)] {
        if let Some(plane) = plane {
            planes.push((name, plane.data().to_vec()));
        }
    }
    if let Some((name, plane)) = planes.iter().find(|p| p.1.len() != width * height) {
        return Err(format!(
            "view `{}`: plane {name} has {} samples; expected {width}x{height}",
            view.name,
            plane.len()
        ));
    }
    let channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = planes
        .into_iter()
        .map(|(name, samples)| AnyChannel::new(name, FlatSamples::F32(samples)))
        .collect();
    let camera = serde_json::to_string(&view.camera).map_err(|e| e.to_string())?;
    let ascii: String = view.name.chars().filter(char::is_ascii_graphic).collect();
    let mut attributes = LayerAttributes::named(format!("{index:03} {ascii}").as_str());
    // Names go through JSON, which keeps what is not ASCII as escapes of ASCII.
    let name = ascii_json(&view.name);
    for (key, value) in [
        (CAMERA, camera.as_str()),
        (NAME, name.as_str()),
        (INDEX, index.to_string().as_str()),
        ("gear:colourSpace", "sRGB-encoded"),
    ] {
        attributes
            .other
            .insert(Text::from(key), AttributeValue::Text(Text::from(value)));
    }
    let channels = AnyChannels::sort(channels);
    Ok(Layer::new(
        (width, height),
        attributes,
        Encoding::UNCOMPRESSED,
        channels,
    ))
}

fn ascii_json(text: &str) -> String {
    let mut out = String::from('"');
    for unit in text.encode_utf16() {
        match char::from_u32(unit.into()) {
            Some(c) if (c.is_ascii_graphic() || c == ' ') && c != '"' && c != '\\' => out.push(c),
            _ => out.push_str(&format!("\\u{unit:04x}")),
        }
    }
    out.push('"');
    out
}

/// Reads the views. Never panics, whatever the bytes hold.
pub fn read(bytes: &[u8]) -> Result<Views, String> {
    catch_unwind(AssertUnwindSafe(|| read_layers(bytes)))
        .unwrap_or_else(|_| Err("the EXR data contradict themselves".into()))
}

fn read_layers(bytes: &[u8]) -> Result<Views, String> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|e| e.to_string())?;
    let mut samples = 0usize;
    for header in &meta.headers {
        let size = header.layer_size.area().saturating_mul(header.channels.list.len());
        samples = samples.saturating_add(size);
    }
    if samples > MOST_SAMPLES || samples > bytes.len().saturating_mul(64) {
        return Err(format!("the header claims {samples} samples for {} bytes", bytes.len()));
    }
    let image = reader()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| e.to_string())?;
    let mut views = Vec::new();
    for layer in image.layer_data {
        if layer.attributes.other.contains_key(&Text::from(CAMERA)) {
            views.push(view(layer)?);
        }
    }
    views.sort_by_key(|(index, _)| *index);
    Ok(Views {
        views: views.into_iter().map(|(_, view)| view).collect(),
    })
}

fn view(layer: Layer<AnyChannels<FlatSamples>>) -> Result<(usize, View), String> {
    let text = |key: &str| match layer.attributes.other.get(&Text::from(key)) {
        Some(AttributeValue::Text(text)) => Ok(text.to_string()),
        _ => Err(format!("a layer has no text attribute {key}")),
    };
    let camera: Camera = serde_json::from_str(&text(CAMERA)?).map_err(|e| format!("{CAMERA}: {e}"))?;
    let name: String = serde_json::from_str(&text(NAME)?).map_err(|e| format!("{NAME}: {e}"))?;
    let index = text(INDEX)?.parse().map_err(|e| format!("{INDEX}: {e}"))?;
    let (width, height) = (layer.size.x(), layer.size.y());
    if !camera.is_valid() || (width, height) != (camera.width as usize, camera.height as usize) {
        return Err(format!(
            "view `{name}` has {width}x{height} pixels, its camera other ones"
        ));
    }
    let mut planes = Vec::new();
    for channel in layer.channel_data.list {
        match channel.sample_data {
            FlatSamples::F32(samples) if samples.len() == width * height => {
                planes.push((channel.name.to_string(), samples));
            }
            _ => return Err(format!("view `{name}`: channel {} is not whole f32", channel.name)),
        }
    }
    let mut take = |name: &str| {
        let at = planes.iter().position(|p| p.0 == name)?;
        Some(planes.swap_remove(at).1)
    };
    let mut three = |names: [&str; 3]| {
        let [a, b, c] = names.map(&mut take);
        let (a, b, c) = (a?, b?, c?);
        Some(a.iter().zip(&b).zip(&c).map(|((&a, &b), &c)| [a, b, c]).collect())
    };
    let rgb = three(["R", "G", "B"]).ok_or_else(|| format!("view `{name}` has no channels R, G, B"))?;
    let normal = three(["NX", "NY", "NZ"]);
    let mut field = |name: &str| take(name).map(|data| Field::from_vec(width, height, data));
    let view = View {
        camera,
        name,
        rgb: Rgb::from_vec(width, height, rgb),
        alpha: field("A"),
        depth: field("Z"),
        normal,
        weight: field("W"),
    };
    Ok((index, view))
}
