//! OpenEXR as this crate uses it: one flat layer of f32 channels, written uncompressed (fast and lossless).

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer};
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Text};
use exr::meta::header::LayerAttributes;
use exr::prelude::{ReadChannels, ReadLayers, SmallVec, WritableImage, read};

/// Named f32 planes of one size.
pub(crate) struct Channels {
    pub width: usize,
    pub height: usize,
    /// In alphabetical order of names, as the format stores them.
    pub planes: Vec<(String, Vec<f32>)>,
}

impl Channels {
    /// Takes the plane of a name (case ignored) out of the list.
    pub fn take(&mut self, name: &str) -> Option<Vec<f32>> {
        let at = self.planes.iter().position(|(n, _)| n.eq_ignore_ascii_case(name))?;
        Some(self.planes.swap_remove(at).1)
    }
}

/// Writes planes; `space` is kept as the attribute `gear:colourSpace`, since EXR viewers assume linear light.
pub(crate) fn write(
    width: usize,
    height: usize,
    planes: Vec<(&str, Vec<f32>)>,
    space: &str,
) -> Result<Vec<u8>, String> {
    if width == 0 || height == 0 {
        return Err(format!(
            "a {width}x{height} raster has no pixels, and EXR cannot hold it"
        ));
    }
    let list: SmallVec<[AnyChannel<FlatSamples>; 4]> = planes
        .into_iter()
        .map(|(name, samples)| AnyChannel::new(name, FlatSamples::F32(samples)))
        .collect();
    let mut attributes = LayerAttributes::default();
    attributes
        .other
        .insert(Text::from("gear:colourSpace"), AttributeValue::Text(Text::from(space)));
    let layer = Layer::new(
        (width, height),
        attributes,
        Encoding::UNCOMPRESSED,
        AnyChannels::sort(list),
    );
    let mut bytes = Vec::with_capacity(width * height * 16 + 1024);
    Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(Cursor::new(&mut bytes))
        .map_err(|e| e.to_string())?;
    Ok(bytes)
}

/// Size of the first layer and its number of channels, from the header alone.
pub(crate) fn size(bytes: &[u8]) -> Result<(usize, usize, usize), String> {
    guarded(|| {
        let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|e| e.to_string())?;
        let header = meta.headers.first().ok_or("the file has no layer")?;
        Ok((header.layer_size.x(), header.layer_size.y(), header.channels.list.len()))
    })
}

/// Reads the first flat layer, f16 and u32 channels converted to f32. Refuses more than `most` samples before
/// taking memory for them.
pub(crate) fn decode(bytes: &[u8], most: usize) -> Result<Channels, String> {
    let (width, height, channels) = size(bytes)?;
    let samples = width.checked_mul(height).and_then(|n| n.checked_mul(channels));
    if samples.is_none_or(|n| n > most) {
        return Err(format!(
            "{width}x{height} with {channels} channels is more than the {most} samples allowed"
        ));
    }
    guarded(|| {
        let image = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_buffered(Cursor::new(bytes))
            .map_err(|e| e.to_string())?;
        let layer = image.layer_data;
        let planes = layer
            .channel_data
            .list
            .into_iter()
            .map(|channel| {
                let samples = match channel.sample_data {
                    FlatSamples::F32(samples) => samples,
                    FlatSamples::F16(samples) => samples.iter().map(|x| x.to_f32()).collect(),
                    FlatSamples::U32(samples) => samples.iter().map(|&x| x as f32).collect(),
                };
                if samples.len() != layer.size.area() {
                    return Err(format!("channel {} is subsampled", channel.name));
                }
                Ok((channel.name.to_string(), samples))
            })
            .collect::<Result<_, String>>()?;
        Ok(Channels {
            width: layer.size.x(),
            height: layer.size.y(),
            planes,
        })
    })
}

/// A decoder of foreign bytes must return, whatever they hold: should it panic, that is an error too.
fn guarded<T>(f: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(f)).unwrap_or_else(|_| Err("the EXR data contradict themselves".into()))
}
