//! A value as what a snapshot keeps of it: a small raster, from which norms are taken, and numbers.
//!
//! | type | raster | numbers |
//! |---|---|---|
//! | Image, Field, Mask | itself, area-averaged; of a mask the share that is inside | its summary |
//! | Views | a sheet: a row of colours and, where there are, a row of normals | its summary |
//! | Scene | the same sheet of two renderings, from the front and from 60° to the side | its summary |
//! | Report, Number | none | itself |
//! | any other | none | its summary |
//!
//! Normals are shown as 0.5 + 0.5 n, so that everything in a sheet is in [0, 1] and one tolerance fits all of it.

use gear_graph::{AnyValue, Number, Report, Value};
use gear_image::{Field, Image, Mask, SrgbImage};
use gear_report::PictureError;
use gear_report::picture::{Picture, Pixels};
use gear_splat::{RenderOptions, Scene, View, Views, orbit};
use serde_json::Value as Json;

use super::SnapError;

/// Yaws in degrees from which a scene is looked at.
const YAWS: [f64; 2] = [0.0, 60.0];

/// A small raster.
#[derive(Clone, Debug, PartialEq)]
pub enum Raster {
    /// Colours.
    Colors(SrgbImage),
    /// One number a pixel; NaN where there is nothing.
    Numbers(Field),
}

/// What is kept of a value.
#[derive(Clone, Debug)]
pub struct Reduced {
    /// The raster, if the value is something to look at.
    pub raster: Option<Raster>,
    /// Its numbers, as JSON.
    pub numbers: Json,
}

/// Reduces a value to at most `size` pixels on the longer side of each of its pictures.
pub fn reduce(value: &AnyValue, size: usize) -> Reduced {
    let summary = || Json::Object(value.summary());
    let (raster, numbers) = if let Some(image) = value.get::<Image>() {
        (Some(Raster::Colors(small_colors(&image.rgb, size))), summary())
    } else if let Some(field) = value.get::<Field>() {
        (Some(Raster::Numbers(small_field(&field, size))), summary())
    } else if let Some(mask) = value.get::<Mask>() {
        (Some(Raster::Numbers(small_field(&mask.to_field(), size))), summary())
    } else if let Some(views) = value.get::<Views>() {
        (sheet(&views.views, size), summary())
    } else if let Some(scene) = value.get::<Scene>() {
        (sheet(&looks(&scene, size), size), summary())
    } else if let Some(report) = value.get::<Report>() {
        (None, report.0.clone())
    } else if let Some(number) = value.get::<Number>() {
        let text = || Json::from(number.0.to_string());
        (
            None,
            serde_json::Number::from_f64(number.0).map_or_else(text, Json::Number),
        )
    } else {
        (None, summary())
    };
    Reduced { raster, numbers }
}

/// A scene from its sides.
fn looks(scene: &Scene, size: usize) -> Vec<View> {
    let (scene, _) = scene.without_invalid();
    let side = u32::try_from(size).unwrap_or(u32::MAX);
    let cameras = orbit::cameras(&scene, &YAWS, side);
    let options = RenderOptions::default();
    let look = |(camera, yaw)| orbit::view(&scene, camera, orbit::yaw_name(yaw), &options, true);
    cameras.iter().zip(YAWS).map(look).collect()
}

/// Views beside each other, colours above normals.
fn sheet(views: &[View], size: usize) -> Option<Raster> {
    let normals = |view: &View| {
        let (width, height) = view.rgb.size();
        let shown = view.normal.as_ref()?.iter().map(|n| n.map(|c| 0.5 + 0.5 * c));
        Some(SrgbImage::from_vec(width, height, shown.collect()))
    };
    let colors: Vec<_> = views.iter().map(|view| small_colors(&view.rgb, size)).collect();
    let normals: Vec<_> = views
        .iter()
        .filter_map(normals)
        .map(|n| small_colors(&n, size))
        .collect();
    let rows: Vec<_> = [colors, normals].into_iter().filter(|row| !row.is_empty()).collect();
    let width = rows.iter().map(|row| row.iter().map(SrgbImage::width).sum()).max()?;
    let height: usize = rows.iter().map(|row| tallest(row)).sum();
    let mut sheet = SrgbImage::filled(width, height, [1.0; 3]);
    let mut top = 0;
    for row in &rows {
        let mut left = 0;
        for picture in row {
            for y in 0..picture.height() {
                for x in 0..picture.width() {
                    sheet.set(left + x, top + y, picture.at(x, y));
                }
            }
            left += picture.width();
        }
        top += tallest(row);
    }
    Some(Raster::Colors(sheet))
}

fn tallest(row: &[SrgbImage]) -> usize {
    row.iter().map(SrgbImage::height).max().unwrap_or(0)
}

fn small_colors(rgb: &SrgbImage, size: usize) -> SrgbImage {
    let channel = |c: usize| {
        let plane = rgb.data().iter().map(|pixel| pixel[c]).collect();
        small_field(&Field::from_vec(rgb.width(), rgb.height(), plane), size)
    };
    let [r, g, b] = [channel(0), channel(1), channel(2)];
    let pixels = r.data().iter().zip(g.data()).zip(b.data());
    SrgbImage::from_vec(r.width(), r.height(), pixels.map(|((&r, &g), &b)| [r, g, b]).collect())
}

/// Means over cells of equal size, of the finite samples; NaN where less than half of a cell is finite.
fn small_field(field: &Field, size: usize) -> Field {
    let (width, height) = field.size();
    let longer = width.max(height).max(1);
    if longer <= size {
        return field.clone();
    }
    let scaled = |n: usize| ((n * size + longer / 2) / longer).max(1);
    let (w, h) = (scaled(width), scaled(height));
    Field::from_fn(w, h, |x, y| {
        let (mut sum, mut finite, mut all) = (0.0, 0, 0);
        for j in y * height / h..((y + 1) * height / h).max(y * height / h + 1) {
            for i in x * width / w..((x + 1) * width / w).max(x * width / w + 1) {
                let sample = field.at(i, j);
                all += 1;
                if sample.is_finite() {
                    sum += f64::from(sample);
                    finite += 1;
                }
            }
        }
        if 2 * finite >= all {
            (sum / f64::from(finite)) as f32
        } else {
            f32::NAN
        }
    })
}

impl Raster {
    /// Width and height.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::Colors(rgb) => rgb.size(),
            Self::Numbers(field) => field.size(),
        }
    }

    /// All of its numbers, row by row.
    pub fn numbers(&self) -> &[f32] {
        match self {
            Self::Colors(rgb) => rgb.data().as_flattened(),
            Self::Numbers(field) => field.data(),
        }
    }

    /// OpenEXR, bit for bit.
    pub fn encode(&self) -> Result<Vec<u8>, SnapError> {
        let encoded = match self {
            Self::Colors(rgb) => Image::opaque(rgb.clone()).encode(),
            Self::Numbers(field) => field.encode(),
        };
        encoded.map_err(|e| SnapError::Picture { cause: e.to_string() })
    }

    /// What [`Raster::encode`] wrote.
    pub fn decode(bytes: &[u8]) -> Result<Self, String> {
        match Image::decode(bytes) {
            Ok(image) => Ok(Self::Colors(image.rgb)),
            Err(_) => Field::decode(bytes).map(Self::Numbers).map_err(|e| e.to_string()),
        }
    }

    /// A picture to look at.
    pub fn picture(&self) -> Result<Picture, PictureError> {
        match self {
            Self::Colors(rgb) => Pixels::of_rgb(rgb).png(),
            Self::Numbers(field) => Pixels::of_field(field).png(),
        }
    }

    /// A picture of how it differs from another one: grey where they are the same, brighter where this one is larger. The
    /// scale goes with it: the difference that is white. `None` if they have different sizes.
    pub fn difference(&self, before: &Self) -> Option<(Result<Picture, PictureError>, f32)> {
        if self.size() != before.size() || self.numbers().len() != before.numbers().len() {
            return None;
        }
        let pairs = self.numbers().iter().zip(before.numbers());
        let off: Vec<f32> = pairs
            .map(|(&a, &b)| match (a.is_finite(), b.is_finite()) {
                (true, true) => a - b,
                (false, false) => 0.0,
                // There is something where nothing was, or the other way round.
                _ => f32::NAN,
            })
            .collect();
        let scale = off
            .iter()
            .filter(|x| x.is_finite())
            .fold(0.0, |most: f32, x| most.max(x.abs()));
        let shown = |x: &f32| match (x.is_nan(), scale > 0.0) {
            (true, _) => 1.0,
            (false, true) => 0.5 + 0.5 * x / scale,
            (false, false) => 0.5,
        };
        let (width, height) = self.size();
        let pixels = match self {
            Self::Colors(_) => {
                let colors = off.chunks_exact(3).map(|c| [shown(&c[0]), shown(&c[1]), shown(&c[2])]);
                SrgbImage::from_vec(width, height, colors.collect())
            }
            Self::Numbers(_) => SrgbImage::from_vec(width, height, off.iter().map(|x| [shown(x); 3]).collect()),
        };
        Some((Pixels::of_rgb(&pixels).png(), scale))
    }
}

#[cfg(test)]
mod tests {
    use gear_graph::ValueType;

    use super::*;

    #[test]
    fn a_small_raster_has_the_mean_of_the_large_one_and_knows_where_nothing_is() {
        let field = Field::from_fn(64, 32, |x, _| if x < 16 { f32::NAN } else { x as f32 });
        let small = small_field(&field, 16);
        assert_eq!(small.size(), (16, 8));
        assert!(small.at(0, 0).is_nan() && small.at(3, 7).is_nan());
        assert_eq!((small.at(4, 0), small.at(15, 7)), (17.5, 61.5));
        assert_eq!(small_field(&small, 16).size(), (16, 8));
    }

    #[test]
    fn every_extreme_value_of_every_type_is_reduced_and_comes_back() {
        for value_type in [
            ValueType::of::<Image>(),
            ValueType::of::<Field>(),
            ValueType::of::<Mask>(),
            ValueType::of::<Views>(),
            ValueType::of::<Scene>(),
            ValueType::of::<Report>(),
            ValueType::of::<Number>(),
        ] {
            for (name, value) in value_type.extremes() {
                let Some(raster) = reduce(&value, 8).raster else {
                    continue;
                };
                let back = Raster::decode(&raster.encode().unwrap()).unwrap();
                let bits = |r: &Raster| r.numbers().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(&back), bits(&raster), "{} {name}", value_type.name);
            }
        }
    }

    #[test]
    fn a_difference_is_grey_where_nothing_moved() {
        let before = Raster::Numbers(Field::from_fn(3, 1, |x, _| x as f32));
        let after = Raster::Numbers(Field::from_fn(3, 1, |x, _| if x == 2 { 2.5 } else { x as f32 }));
        let (picture, scale) = after.difference(&before).unwrap();
        let decoded = image::load_from_memory(&picture.unwrap().bytes).unwrap().to_rgb8();
        assert_eq!(scale, 0.5);
        assert_eq!([decoded.get_pixel(0, 0).0[0], decoded.get_pixel(2, 0).0[0]], [128, 255]);
        assert!(after.difference(&Raster::Numbers(Field::filled(2, 1, 0.0))).is_none());
    }
}
