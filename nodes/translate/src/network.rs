//! What an image-to-image network makes of the painting.

use gear_graph::{Context, Demand, Known, NodeError};
use gear_image::{Field, Image, Mask, SrgbImage, filter};
use gear_onnx::{Channel, Given, MODEL_PORT, Model, Provider};

/// The network first; then what its declaration takes beside the colours.
pub(crate) fn demand(known: &Known<'_>) -> Result<Demand, NodeError> {
    if !known.has(MODEL_PORT) {
        return gear_onnx::demand(known);
    }
    let model = known.get::<Model>(MODEL_PORT)?;
    let channels = &model.declaration().channels;
    let taken = [(Channel::Edges, "edges"), (Channel::Mask, "mask")];
    let ports: Vec<_> = taken
        .iter()
        .filter(|(channel, _)| channels.contains(channel))
        .map(|(_, port)| *port)
        .collect();
    Ok(match known.need(&ports, "the network takes them beside the colours") {
        Demand::Ready { .. } => Demand::ready_because("the network takes nothing more"),
        need => need,
    })
}

/// The network's picture, the painting's size.
pub(crate) fn translate(
    painting: &Image,
    model: &Model,
    provider: Provider,
    edges: Option<&Field>,
    mask: Option<&std::sync::Arc<Mask>>,
    ctx: &Context,
) -> Result<SrgbImage, NodeError> {
    model.declaration().expect(&["picture"])?;
    let (width, height) = painting.size();
    let inside = mask
        .filter(|mask| !mask.is_empty())
        .map(|mask| filter::resize_mask(mask, width, height).to_field());
    let planes: Vec<_> = [(Channel::Edges, edges), (Channel::Mask, inside.as_ref())]
        .into_iter()
        .filter_map(|(channel, field)| Some((channel, field?)))
        .collect();
    let given = Given {
        rgb: &painting.rgb,
        planes: &planes,
    };
    let colours = gear_onnx::answer(model, provider, given, ctx)?;
    // An answer has as many fields as it declares: three.
    let pixel = |p: usize| std::array::from_fn(|c| colours[c].data()[p]);
    Ok(SrgbImage::from_vec(
        width,
        height,
        (0..width * height).map(pixel).collect(),
    ))
}
