//! Views as OpenEXR: one layer a view, f32, uncompressed.
//!
//! Channels are `R G B` (sRGB-encoded, an attribute says so) and, where there are any, `A` (coverage), `Z` (depth),
//! `NX NY NZ` (world-space normal) and `W` (weight of a target). Each layer's attributes `gear:camera` (JSON), `gear:view`
//! (its name) and `gear:index` (its place) say what it shows; attributes of the image as a whole do not survive reading.
//! Layers are named by index and name, since EXR wants distinct names.
//!
//! A layer's data window leaves out what surrounds the subject: whole rows and columns at the rim whose pixels are, to the
//! bit, what the first pixel is. The attribute `gear:outside` says what that was, by channel. A viewer that shows the window
//! shows the subject; half of a set of views and more is often surroundings.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, Layers};
use exr::math::Vec2;
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
const OUTSIDE: &str = "gear:outside";
/// Sets of views with more samples are written whole, so that a small file cannot claim much memory.
const MOST_CROPPED: usize = 1 << 28;

/// Writes the views.
pub fn write(views: &Views) -> Result<Vec<u8>, String> {
    let mut layers: SmallVec<[Layer<AnyChannels<FlatSamples>>; 2]> = SmallVec::new();
    let samples = |view: &View| {
        let planes = [&view.alpha, &view.depth, &view.weight].into_iter().flatten().count();
        view.rgb.len() * (3 + planes + 3 * usize::from(view.normal.is_some()))
    };
    let crops = views.views.iter().map(samples).sum::<usize>() <= MOST_CROPPED;
    for (index, view) in views.views.iter().enumerate() {
        layers.push(layer(index, view, crops)?);
    }
    let sizes = layers
        .iter()
        .map(|layer| layer.size.area() * layer.channel_data.list.len() * 4);
    let size = sizes.sum::<usize>();
    if layers.is_empty() {
        // EXR needs a layer; one without a camera is no view.
        let plane = AnyChannel::new("Y", FlatSamples::F32(vec![0.0]));
        let attributes = LayerAttributes::named("no views");
        let channels = AnyChannels::sort(SmallVec::from_iter([plane]));
        layers.push(Layer::new((1, 1), attributes, Encoding::UNCOMPRESSED, channels));
    }
    let area = |v: &View| v.rgb.width().max(1) as i32;
    let widest = views.views.iter().map(area).max().unwrap_or(1);
    let display = Vec2(
        widest as usize,
        views.views.iter().map(|v| v.rgb.height()).max().unwrap_or(1),
    );
    let image = Image {
        attributes: ImageAttributes::with_size(display),
        layer_data: Layers::from(layers),
    };
    let mut bytes = Vec::with_capacity(size + size / 64 + (64 << 10));
    image
        .write()
        .non_parallel()
        .to_buffered(Cursor::new(&mut bytes))
        .map_err(|e| e.to_string())?;
    Ok(bytes)
}

fn layer(index: usize, view: &View, crops: bool) -> Result<Layer<AnyChannels<FlatSamples>>, String> {
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
    let mut sources: Vec<(&str, Samples<'_>)> = Vec::new();
    for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
        sources.push((name, Samples::Third(view.rgb.data(), c)));
    }
    if let Some(normal) = &view.normal {
        for (c, name) in ["NX", "NY", "NZ"].into_iter().enumerate() {
            sources.push((name, Samples::Third(normal, c)));
        }
    }
    for (name, plane) in [("A", &view.alpha), ("Z", &view.depth), ("W", &view.weight)] {
        if let Some(plane) = plane {
            sources.push((name, Samples::Plane(plane.data())));
        }
    }
    if let Some((name, samples)) = sources.iter().find(|s| s.1.len() != width * height) {
        return Err(format!(
            "view `{}`: plane {name} has {} samples; expected {width}x{height}",
            view.name,
            samples.len()
        ));
    }
    let whole = Window::whole(width, height);
    let window = if crops { whole.around_subject(&sources) } else { whole };
    let outside: BTreeMap<&str, u32> = sources.iter().map(|(name, s)| (*name, s.at(0).to_bits())).collect();
    let outside = serde_json::to_string(&outside).map_err(|e| e.to_string())?;
    let planes = sources
        .iter()
        .map(|(name, samples)| (*name, samples.within(&window, width)));
    let channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = planes
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
        (OUTSIDE, outside.as_str()),
        ("gear:colourSpace", "sRGB-encoded"),
    ] {
        attributes
            .other
            .insert(Text::from(key), AttributeValue::Text(Text::from(value)));
    }
    attributes.layer_position = Vec2(window.left as i32, window.top as i32);
    let channels = AnyChannels::sort(channels);
    Ok(Layer::new(
        (window.width(), window.height()),
        attributes,
        Encoding::UNCOMPRESSED,
        channels,
    ))
}

/// One channel where it lies.
enum Samples<'v> {
    Plane(&'v [f32]),
    Third(&'v [[f32; 3]], usize),
}

impl Samples<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Plane(plane) => plane.len(),
            Self::Third(pixels, _) => pixels.len(),
        }
    }

    fn at(&self, i: usize) -> f32 {
        match self {
            Self::Plane(plane) => plane[i],
            Self::Third(pixels, c) => pixels[i][*c],
        }
    }

    fn within(&self, window: &Window, width: usize) -> Vec<f32> {
        let mut out = Vec::with_capacity(window.width() * window.height());
        for y in window.top..window.bottom {
            let row = y * width + window.left..y * width + window.right;
            match self {
                Self::Plane(plane) => out.extend_from_slice(&plane[row]),
                Self::Third(pixels, c) => out.extend(pixels[row].iter().map(|p| p[*c])),
            }
        }
        out
    }
}

/// A rectangle of pixels, ends excluded; never empty.
struct Window {
    left: usize,
    top: usize,
    right: usize,
    bottom: usize,
}

impl Window {
    fn whole(width: usize, height: usize) -> Self {
        Self {
            left: 0,
            top: 0,
            right: width,
            bottom: height,
        }
    }

    fn width(&self) -> usize {
        self.right - self.left
    }

    fn height(&self) -> usize {
        self.bottom - self.top
    }

    /// Without the rows and columns at the rim that hold nothing but what the first pixel holds. A pixel stays.
    fn around_subject(mut self, channels: &[(&str, Samples<'_>)]) -> Self {
        let width = self.width();
        let outside: Vec<u32> = channels.iter().map(|(_, samples)| samples.at(0).to_bits()).collect();
        let surroundings = |i: usize| {
            let mut pairs = channels.iter().zip(&outside);
            pairs.all(|((_, samples), outside)| samples.at(i).to_bits() == *outside)
        };
        let row = |window: &Self, y: usize| (window.left..window.right).all(|x| surroundings(y * width + x));
        let column = |window: &Self, x: usize| (window.top..window.bottom).all(|y| surroundings(y * width + x));
        while self.height() > 1 && row(&self, self.bottom - 1) {
            self.bottom -= 1;
        }
        while self.height() > 1 && row(&self, self.top) {
            self.top += 1;
        }
        while self.width() > 1 && column(&self, self.right - 1) {
            self.right -= 1;
        }
        while self.width() > 1 && column(&self, self.left) {
            self.left += 1;
        }
        self
    }
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
    let mut room = MOST_CROPPED.max(samples);
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
            views.push(view(layer, &mut room)?);
        }
    }
    views.sort_by_key(|(index, _)| *index);
    Ok(Views {
        views: views.into_iter().map(|(_, view)| view).collect(),
    })
}

fn view(layer: Layer<AnyChannels<FlatSamples>>, room: &mut usize) -> Result<(usize, View), String> {
    let text = |key: &str| match layer.attributes.other.get(&Text::from(key)) {
        Some(AttributeValue::Text(text)) => Ok(text.to_string()),
        _ => Err(format!("a layer has no text attribute {key}")),
    };
    let camera: Camera = serde_json::from_str(&text(CAMERA)?).map_err(|e| format!("{CAMERA}: {e}"))?;
    let name: String = serde_json::from_str(&text(NAME)?).map_err(|e| format!("{NAME}: {e}"))?;
    let index = text(INDEX)?.parse().map_err(|e| format!("{INDEX}: {e}"))?;
    let (width, height) = (camera.width as usize, camera.height as usize);
    let size = layer.size;
    let position = layer.attributes.layer_position;
    let inside = |at: i32, length: usize, all: usize| {
        usize::try_from(at)
            .ok()
            .filter(|at| at.checked_add(length).is_some_and(|end| end <= all))
    };
    let (left, top) = match (
        inside(position.x(), size.x(), width),
        inside(position.y(), size.y(), height),
    ) {
        (Some(left), Some(top)) if camera.is_valid() => (left, top),
        _ => {
            return Err(format!(
                "view `{name}` has {}x{} pixels at {}, {}, which is not within its camera's {width}x{height}",
                size.x(),
                size.y(),
                position.x(),
                position.y()
            ));
        }
    };
    let cropped = (size.x(), size.y()) != (width, height);
    let outside: BTreeMap<String, u32> = match text(OUTSIDE) {
        Ok(text) if cropped => serde_json::from_str(&text).map_err(|e| format!("{OUTSIDE}: {e}"))?,
        Err(missing) if cropped => return Err(missing),
        _ => BTreeMap::new(),
    };
    let whole = (width.saturating_mul(height)).saturating_mul(layer.channel_data.list.len());
    *room = room
        .checked_sub(whole)
        .ok_or_else(|| format!("view `{name}` claims {whole} samples, which is too many"))?;
    let window = Window {
        left,
        top,
        right: left + size.x(),
        bottom: top + size.y(),
    };
    let mut planes = Vec::new();
    for channel in layer.channel_data.list {
        let channel_name = channel.name.to_string();
        match channel.sample_data {
            FlatSamples::F32(samples) if samples.len() != size.area() => {
                return Err(format!("view `{name}`: channel {channel_name} is subsampled"));
            }
            FlatSamples::F32(samples) if !cropped => planes.push((channel_name, samples)),
            FlatSamples::F32(samples) => {
                let bits = outside.get(&channel_name);
                let fill = bits.ok_or_else(|| format!("view `{name}`: {OUTSIDE} has no channel {channel_name}"))?;
                let mut plane = vec![f32::from_bits(*fill); width * height];
                for (y, row) in (window.top..).zip(samples.chunks_exact(window.width())) {
                    plane[y * width + left..][..row.len()].copy_from_slice(row);
                }
                planes.push((channel_name, plane));
            }
            _ => return Err(format!("view `{name}`: channel {channel_name} is not f32")),
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
