//! From a picture to what a network says about it.

use std::sync::Arc;

use gear_graph::{Context, Demand, Known, Lazy, NodeError};
use gear_image::{Field, SrgbImage};

use crate::declaration::{Answer, Axis, Size};
use crate::planes::{activate, channels, prepare, restored};
use crate::{Channel, Declaration, Model, OnnxError, Provider, session};

/// The input port at which nodes take a network.
pub const MODEL_PORT: &str = "model";

/// What a network is given: a picture, and planes of its size beside it.
#[derive(Clone, Copy, Debug)]
pub struct Given<'a> {
    /// The picture.
    pub rgb: &'a SrgbImage,
    /// What else there is.
    pub planes: &'a [(Channel, &'a Field)],
}

/// What the network says, as fields of the picture's size; their number and meaning are those of its
/// [`Answer`]:
///
/// * `edges`, `saliency`: one, within 0 and 1;
/// * `depth`: one, as it comes;
/// * `surface`: unit normal (x to the right, y down, z to the viewer) and height in pixels, up to an offset;
/// * `picture`: sRGB-encoded red, green and blue, within 0 and 1.
pub fn answer(model: &Model, provider: Provider, given: Given<'_>, ctx: &Context) -> Result<Vec<Field>, OnnxError> {
    let (width, height) = given.rgb.size();
    if width == 0 || height == 0 {
        return Err(OnnxError::Mismatch("it is given a picture without pixels".to_owned()));
    }
    let declaration = model.declaration();
    let ask = |declaration: &Declaration| -> Result<Vec<Field>, OnnxError> {
        let (tensor, way) = prepare(declaration, &given)?;
        let raw = session::run(model, provider, &tensor, ctx)?;
        let mut fields = channels(declaration, &raw.dims, &raw.data, &way)?;
        if let Answer::Edges { activation } | Answer::Saliency { activation } = declaration.answer {
            activate(&mut fields[0], activation);
            clamp(&mut fields[0]);
        }
        let mut fields = restored(fields, &way);
        if let Answer::Surface { height, .. } = declaration.answer {
            // Heights are pixels of the picture that the network saw.
            let scale = height as f32 * way.picture.0 as f32 / way.resized.0 as f32;
            fields[3].data_mut().iter_mut().for_each(|h| *h *= scale);
        }
        Ok(fields)
    };
    let mut fields = ask(declaration)?;
    match &declaration.answer {
        Answer::Surface { half_size, y, .. } => {
            if *half_size && width.min(height) >= 32 {
                let half = Declaration {
                    size: half(&declaration.size, width.max(height)),
                    ..declaration.clone()
                };
                let other = ask(&half)?;
                average(&mut fields, &other);
            }
            if *y == Axis::Up {
                fields[1].data_mut().iter_mut().for_each(|y| *y = -*y);
            }
            normalise(&mut fields);
        }
        Answer::Picture {
            white,
            mean,
            std,
            channels,
        } => fields = colours(fields, *white as f32, mean, std, channels),
        Answer::Edges { .. } | Answer::Saliency { .. } | Answer::Depth { .. } => {}
    }
    Ok(fields)
}

fn clamp(field: &mut Field) {
    field.data_mut().iter_mut().for_each(|x| *x = x.clamp(0.0, 1.0));
}

/// The sizes of half a picture whose longer side is this.
fn half(size: &Size, longer: usize) -> Size {
    match *size {
        Size::Any { multiple, at_most } => Size::Any {
            multiple,
            at_most: (longer as u32).min(at_most).div_ceil(2).max(16),
        },
        Size::Fit { longer_side, multiple } => Size::Fit {
            longer_side: longer_side.div_ceil(2),
            multiple,
        },
        fixed @ Size::Fixed { .. } => fixed,
    }
}

/// Normals are averaged, and so are heights, each freed of its median.
fn average(fields: &mut [Field], others: &[Field]) {
    for (c, (field, other)) in fields.iter_mut().zip(others).enumerate() {
        let middle = |field: &Field| gear_image::stats::median(field.data()).unwrap_or(0.0);
        let (a, b) = if c == 3 {
            (middle(field), middle(other))
        } else {
            (0.0, 0.0)
        };
        for (x, y) in field.data_mut().iter_mut().zip(other.data()) {
            *x = 0.5 * ((*x - a) + (*y - b));
        }
    }
}

/// Makes the first three fields unit vectors that face the viewer, if only just.
fn normalise(fields: &mut [Field]) {
    for p in 0..fields[0].len() {
        let n: [f32; 3] = std::array::from_fn(|c| fields[c].data()[p]);
        let n = [n[0], n[1], n[2].max(1e-3)];
        let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        for (c, x) in n.iter().enumerate() {
            fields[c].data_mut()[p] = x / length;
        }
    }
}

/// Red, green and blue within 0 and 1.
fn colours(fields: Vec<Field>, white: f32, mean: &[f64], std: &[f64], order: &[Channel]) -> Vec<Field> {
    let pick = |list: &[f64], c: usize, otherwise: f64| match list {
        [] => otherwise as f32,
        [one] => *one as f32,
        many => many[c] as f32,
    };
    let mut sorted = Vec::new();
    for colour in [Channel::Red, Channel::Green, Channel::Blue] {
        // The declaration was checked: each colour stands in it once.
        let c = order.iter().position(|channel| *channel == colour).unwrap_or(0);
        let mut field = fields[c].clone();
        let (mean, std) = (pick(mean, c, 0.0), pick(std, c, 1.0));
        for x in field.data_mut() {
            *x = ((*x * std + mean) / white).clamp(0.0, 1.0);
        }
        sorted.push(field);
    }
    sorted
}

/// What a node whose method asks a network demands: the network, at [`MODEL_PORT`].
pub fn demand(known: &Known<'_>) -> Result<Demand, NodeError> {
    if !known.is_wired(MODEL_PORT) {
        return Err(missing());
    }
    Ok(known.need(&[MODEL_PORT], "the method asks a network"))
}

/// The network that was demanded.
pub fn required(port: &Option<Lazy<Model>>) -> Result<&Arc<Model>, NodeError> {
    port.as_ref().and_then(Lazy::get).ok_or_else(missing)
}

/// The error of a method that asks a network where none is given.
pub fn missing() -> NodeError {
    NodeError::input(
        MODEL_PORT,
        "the method asks a network and none is given; add an input of type Model to the graph, wire it here, and give \
         its ONNX file with `--input NAME=FILE`",
    )
}
