//! A picture to a tensor, and a tensor back to fields of the picture's size.

use gear_image::filter::{fit_longer_side, resize, resize_rgb};
use gear_image::{Field, SrgbImage, math};

use crate::declaration::{Activation, Layout, Size};
use crate::{Channel, Declaration, Given, OnnxError};

/// Samples of a tensor: 256 MiB.
pub(crate) const MOST_SAMPLES: usize = 1 << 26;

/// A tensor of rank four in the declared layout.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tensor {
    pub shape: [usize; 4],
    pub data: Vec<f32>,
}

/// Sizes on the way: the picture, resized, padded. Width first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Way {
    pub picture: (usize, usize),
    pub resized: (usize, usize),
    pub padded: (usize, usize),
}

impl Way {
    /// How a picture of this size comes to a size that the network takes.
    pub fn of(size: &Size, picture: (usize, usize)) -> Self {
        let up = |side: usize, multiple: usize| side.div_ceil(multiple) * multiple;
        let (resized, multiple) = match *size {
            Size::Fixed { width, height } => ((width as usize, height as usize), 1),
            Size::Any { multiple, at_most } => {
                let longer = picture.0.max(picture.1).min(at_most as usize);
                (fit_longer_side(picture.0, picture.1, longer), multiple as usize)
            }
            Size::Fit { longer_side, multiple } => {
                let scale = f64::from(longer_side) / picture.0.max(picture.1) as f64;
                let multiple = multiple as usize;
                let side = |side: usize| {
                    let steps = (side as f64 * scale / multiple as f64).round() as usize;
                    steps.max(1) * multiple
                };
                ((side(picture.0), side(picture.1)), 1)
            }
        };
        Self {
            picture,
            resized,
            padded: (up(resized.0, multiple), up(resized.1, multiple)),
        }
    }
}

/// The tensor that the declaration asks for. The picture has pixels.
pub(crate) fn prepare(declaration: &Declaration, given: &Given<'_>) -> Result<(Tensor, Way), OnnxError> {
    let way = Way::of(&declaration.size, given.rgb.size());
    let (width, height) = way.padded;
    let channels = declaration.channels.len();
    if width * height > MOST_SAMPLES / channels {
        return Err(OnnxError::Mismatch(format!(
            "its input would be {channels} channels of {width}x{height}, which is too much to compute"
        )));
    }
    let rgb = resize_rgb(given.rgb, way.resized.0, way.resized.1);
    let rgb = SrgbImage::from_vec(
        way.resized.0,
        way.resized.1,
        rgb.data().iter().map(|pixel| pixel.map(unit)).collect(),
    );
    let brightest = rgb.data().as_flattened().iter().fold(0.0f32, |most, x| most.max(*x));
    let scale = if declaration.divide_by_maximum && brightest > 0.0 {
        1.0 / brightest
    } else {
        1.0
    };
    let mut data = vec![0.0; channels * width * height];
    for (c, &channel) in declaration.channels.iter().enumerate() {
        let plane = plane(channel, &rgb, given, way.resized)?;
        let scale = if channel.is_colour() { scale } else { 1.0 };
        let pick = |list: &[f64], otherwise: f64| match list {
            [] => otherwise,
            [one] => *one,
            many => many[c],
        };
        let white = if channel.is_colour() { declaration.white } else { 1.0 };
        let (mean, std) = (pick(&declaration.mean, 0.0) as f32, pick(&declaration.std, 1.0) as f32);
        for y in 0..height {
            for x in 0..width {
                // What lies beyond the rim is the rim.
                let sample = plane.at(x.min(way.resized.0 - 1), y.min(way.resized.1 - 1));
                let at = match declaration.layout {
                    Layout::Nchw => (c * height + y) * width + x,
                    Layout::Nhwc => (y * width + x) * channels + c,
                };
                data[at] = (sample * scale * white as f32 - mean) / std;
            }
        }
    }
    let shape = match declaration.layout {
        Layout::Nchw => [1, channels, height, width],
        Layout::Nhwc => [1, height, width, channels],
    };
    Ok((Tensor { shape, data }, way))
}

/// Within 0 and 1; what is no number is 0.
fn unit(x: f32) -> f32 {
    if x > 0.0 { x.min(1.0) } else { 0.0 }
}

fn plane(channel: Channel, rgb: &SrgbImage, given: &Given<'_>, size: (usize, usize)) -> Result<Field, OnnxError> {
    let colour = |f: fn([f32; 3]) -> f32| Field::from_vec(size.0, size.1, rgb.data().iter().map(|&c| f(c)).collect());
    Ok(match channel {
        Channel::Red => colour(|c| c[0]),
        Channel::Green => colour(|c| c[1]),
        Channel::Blue => colour(|c| c[2]),
        Channel::Grey => colour(|c| 0.299 * c[0] + 0.587 * c[1] + 0.114 * c[2]),
        other => {
            let found = given.planes.iter().find(|(name, _)| *name == other);
            let Some((_, field)) = found else {
                return Err(OnnxError::Mismatch(format!(
                    "it declares the channel `{}`, which there is none of here",
                    other.name()
                )));
            };
            // A height in pixels is less of them in a smaller picture.
            let scale = match other {
                Channel::BaseHeight => size.0 as f32 / given.rgb.width() as f32,
                _ => 1.0,
            };
            let sound = |x: f32| if x.is_finite() { scale * x } else { 0.0 };
            let finite = field.data().iter().map(|&x| sound(x)).collect();
            resize(&Field::from_vec(field.width(), field.height(), finite), size.0, size.1)
        }
    })
}

/// The channels of an answer of these dimensions, at the size that went in.
pub(crate) fn channels(
    declaration: &Declaration,
    dims: &[usize],
    data: &[f32],
    way: &Way,
) -> Result<Vec<Field>, OnnxError> {
    let expected = declaration.answer.channels();
    let kind = declaration.answer.name();
    let unfit = || {
        OnnxError::BadAnswer(format!(
            "its shape is {dims:?}, and `answer: {kind}` in the layout {} has {expected} channel{} of rows and columns",
            match declaration.layout {
                Layout::Nchw => "nchw",
                Layout::Nhwc => "nhwc",
            },
            if expected == 1 { "" } else { "s" },
        ))
    };
    let batchless = match dims {
        [1, rest @ ..] if rest.len() == 3 => rest,
        rest => rest,
    };
    let (count, height, width) = match (batchless, declaration.layout) {
        ([height, width], _) => (1, *height, *width),
        ([count, height, width], Layout::Nchw) => (*count, *height, *width),
        ([height, width, count], Layout::Nhwc) => (*count, *height, *width),
        _ => return Err(unfit()),
    };
    let samples = count.checked_mul(height).and_then(|n| n.checked_mul(width));
    if count != expected || height == 0 || width == 0 || samples != Some(data.len()) {
        return Err(unfit());
    }
    let bad = data.iter().filter(|x| !x.is_finite()).count();
    if bad > 0 {
        return Err(OnnxError::BadAnswer(format!(
            "{bad} of its {} samples are not finite",
            data.len()
        )));
    }
    let plane = |c: usize| {
        let samples = match declaration.layout {
            Layout::Nchw => data[c * height * width..(c + 1) * height * width].to_vec(),
            Layout::Nhwc => data.iter().skip(c).step_by(count).copied().collect(),
        };
        let whole = resize(&Field::from_vec(width, height, samples), way.padded.0, way.padded.1);
        Field::from_fn(way.resized.0, way.resized.1, |x, y| whole.at(x, y))
    };
    Ok((0..count).map(plane).collect())
}

/// Fields at the picture's size.
pub(crate) fn restored(fields: Vec<Field>, way: &Way) -> Vec<Field> {
    fields
        .iter()
        .map(|field| resize(field, way.picture.0, way.picture.1))
        .collect()
}

/// What is done to the samples.
pub(crate) fn activate(field: &mut Field, activation: Activation) {
    match activation {
        Activation::None => {}
        Activation::Sigmoid => {
            for x in field.data_mut() {
                *x = 1.0 / (1.0 + math::exp(-x.clamp(-80.0, 80.0)));
            }
        }
        Activation::MinMax => {
            let (low, high) = gear_image::stats::range(field.data()).unwrap_or((0.0, 0.0));
            let span = high - low;
            for x in field.data_mut() {
                *x = if span > 0.0 { (*x - low) / span } else { 0.0 };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn declaration(yaml: &str) -> Declaration {
        Declaration::read("test", &format!("network: 1\n{yaml}\n")).unwrap()
    }

    fn picture() -> SrgbImage {
        SrgbImage::from_fn(5, 3, |x, y| [x as f32 / 4.0, y as f32 / 2.0, 0.5])
    }

    fn given(rgb: &SrgbImage) -> Given<'_> {
        Given { rgb, planes: &[] }
    }

    #[test]
    fn channels_come_in_the_declared_order_layout_and_scale() {
        let rgb = picture();
        let d = declaration("channels: [blue, red]\nwhite: 255\nmean: [1, 2]\nstd: [2, 4]\nanswer: edges");
        let (tensor, _) = prepare(&d, &given(&rgb)).unwrap();
        assert_eq!(tensor.shape, [1, 2, 3, 5]);
        assert!(
            tensor.data[..15]
                .iter()
                .all(|&x| (x - (127.5 - 1.0) / 2.0).abs() < 1e-4)
        );
        assert!((tensor.data[15 + 4] - (255.0 - 2.0) / 4.0).abs() < 1e-4);
        let d = declaration("channels: [blue, red]\nlayout: nhwc\nanswer: edges");
        let (tensor, _) = prepare(&d, &given(&rgb)).unwrap();
        assert_eq!(tensor.shape, [1, 3, 5, 2]);
        assert_eq!(tensor.data[8..10], [0.5, 1.0]);
    }

    #[test]
    fn a_picture_is_padded_by_its_rim_and_the_answer_cut_to_it() {
        let rgb = picture();
        let d = declaration("channels: [red]\nsize: {any: {multiple: 4}}\nanswer: edges");
        let (tensor, way) = prepare(&d, &given(&rgb)).unwrap();
        assert_eq!(tensor.shape, [1, 1, 4, 8]);
        assert_eq!(tensor.data[4..8], [1.0; 4]);
        let back = channels(&d, &[1, 1, 4, 8], &tensor.data, &way).unwrap();
        assert_eq!((back[0].size(), back[0].at(4, 2), back[0].at(0, 0)), ((5, 3), 1.0, 0.0));
    }

    #[test]
    fn sizes_are_brought_to_what_the_network_takes() {
        let way = |yaml: &str, size| Way::of(&declaration(&format!("{yaml}\nanswer: edges")).size, size);
        assert_eq!(
            way("size: {fixed: {width: 320, height: 200}}", (30, 40)).padded,
            (320, 200)
        );
        assert_eq!(
            way("size: {fit: {longer_side: 518, multiple: 14}}", (768, 512)).padded,
            (518, 350)
        );
        assert_eq!(
            way("size: {any: {multiple: 16, at_most: 64}}", (100, 30)).resized,
            (64, 19)
        );
        assert_eq!(
            way("size: {any: {multiple: 16, at_most: 64}}", (100, 30)).padded,
            (64, 32)
        );
        assert_eq!(
            way("size: {fit: {longer_side: 10, multiple: 14}}", (1, 900)).padded,
            (14, 14)
        );
    }

    #[test]
    fn an_answer_of_another_shape_or_with_nan_is_refused_in_one_sentence() {
        let d = declaration("answer: edges");
        let way = Way::of(&d.size, (5, 3));
        let told = |dims: &[usize], data: &[f32]| channels(&d, dims, data, &way).unwrap_err().to_string();
        for dims in [
            &[1usize, 2, 3, 5][..],
            &[15],
            &[],
            &[1, 1, 0, 5],
            &[2, 1, 3, 5],
            &[1 << 62, 1 << 62],
        ] {
            assert!(told(dims, &[0.0; 30]).contains("shape"), "{dims:?}");
        }
        assert!(told(&[3, 5], &[f32::NAN; 15]).contains("15 of its 15 samples are not finite"));
        assert!(channels(&d, &[1, 3, 5], &[0.5; 15], &way).is_ok());
    }

    #[test]
    fn a_channel_that_is_not_there_is_named() {
        let d = declaration("channels: [red, mask]\nanswer: edges");
        let message = prepare(&d, &given(&picture())).unwrap_err().to_string();
        assert!(message.contains("`mask`"), "{message}");
    }
}
