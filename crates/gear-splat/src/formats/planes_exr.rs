//! Planes of one view as OpenEXR that any viewer opens: one flat layer of f32 channels, uncompressed.

use std::io::Cursor;

use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer};
use exr::meta::header::LayerAttributes;
use exr::prelude::{SmallVec, WritableImage};
use gear_image::Field;

/// Depth along the camera's z axis as channel `Z`; NaN where nothing is.
pub fn depth(depth: &Field) -> Result<Vec<u8>, String> {
    write(depth.size(), vec![("Z", depth.data().to_vec())])
}

/// World-space unit normals as channels `NX NY NZ`, row-major; zero where nothing is.
pub fn normal(size: (usize, usize), normals: &[[f32; 3]]) -> Result<Vec<u8>, String> {
    let plane = |axis: usize| normals.iter().map(|n| n[axis]).collect();
    write(size, vec![("NX", plane(0)), ("NY", plane(1)), ("NZ", plane(2))])
}

fn write(size: (usize, usize), planes: Vec<(&str, Vec<f32>)>) -> Result<Vec<u8>, String> {
    let expected = size.0 * size.1;
    if expected == 0 || planes.iter().any(|p| p.1.len() != expected) {
        return Err(format!("planes without {}x{} samples, or with none", size.0, size.1));
    }
    let channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = planes
        .into_iter()
        .map(|(name, samples)| AnyChannel::new(name, FlatSamples::F32(samples)))
        .collect();
    let layer = Layer::new(
        size,
        LayerAttributes::default(),
        Encoding::UNCOMPRESSED,
        AnyChannels::sort(channels),
    );
    let mut bytes = Vec::new();
    Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(Cursor::new(&mut bytes))
        .map_err(|e| e.to_string())?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use exr::prelude::{ReadChannels, ReadLayers, read};

    use super::*;

    #[test]
    fn what_is_written_is_read_by_channel() {
        let normals = [[0.0, -1.0, 0.0], [0.6, 0.0, 0.8]];
        let image = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_buffered(Cursor::new(normal((1, 2), &normals).unwrap()))
            .unwrap();
        let planes = &image.layer_data.channel_data.list;
        let values = |i: usize| planes[i].sample_data.values_as_f32().collect::<Vec<_>>();
        assert_eq!(
            planes.iter().map(|p| p.name.to_string()).collect::<Vec<_>>(),
            ["NX", "NY", "NZ"]
        );
        assert_eq!(
            (values(0), values(1), values(2)),
            (vec![0.0, 0.6], vec![-1.0, 0.0], vec![0.0, 0.8])
        );
        assert!(depth(&Field::filled(0, 4, 1.0)).is_err());
        assert!(normal((2, 2), &normals).is_err());
    }
}
