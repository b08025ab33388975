//! The body by a network's word: depth, or normals and height (see `gear_relief::guided`).

use gear_graph::{Context, NodeError};
use gear_image::edges::soft_edges;
use gear_image::{Field, LinearImage, Mask};
use gear_onnx::declaration::Depth;
use gear_onnx::{Answer, Channel, Given};
use gear_relief::guided::{self, Foundation, Guide};
use gear_relief::height::{Mode, Relief};

use crate::{In, Method, Reconstruct};

/// Pixels of height that a network is told as 1.
const HEIGHT_UNIT: f32 = 32.0;

/// The height field that the network and the shading give.
pub(crate) fn relief(
    node: &Reconstruct,
    inputs: &In,
    light: &LinearImage,
    mask: &Mask,
    ctx: &Context,
) -> Result<Relief, NodeError> {
    let Method::DepthNetwork {
        provider,
        extent,
        field_of_view,
        ..
    } = node.method
    else {
        return Err(NodeError::new("only the method depth-network asks a network"));
    };
    let model = gear_onnx::required(&inputs.model)?;
    model.declaration().expect(&["depth", "surface"])?;
    let answer = &model.declaration().answer;
    let settings = node.height_settings();
    let foundation = Foundation::of(light, mask, &settings);
    ctx.checkpoint()?;
    ctx.progress_with(0.2, "network");
    let inside = foundation.mask.to_field();
    let edges = soft_edges(light, 1.0, 0.98);
    let [normal_x, normal_y] = foundation.base_normals();
    let (width, height) = foundation.base.size();
    let base = foundation.base.data().iter().map(|h| h / HEIGHT_UNIT).collect();
    let base = Field::from_vec(width, height, base);
    let planes = [
        (Channel::Mask, &inside),
        (Channel::Edges, &edges),
        (Channel::BaseNormalX, &normal_x),
        (Channel::BaseNormalY, &normal_y),
        (Channel::BaseHeight, &base),
    ];
    let given = Given {
        rgb: &inputs.image.rgb,
        planes: &planes,
    };
    let said = gear_onnx::answer(model, provider, given, ctx)?;
    ctx.checkpoint()?;
    ctx.progress_with(0.5, "height");
    let guide = match (answer, said.as_slice()) {
        (Answer::Depth { of: Depth::Inverse }, [near]) => Guide::Nearness(near),
        (Answer::Depth { of: Depth::Metric }, [depth]) => Guide::Distance {
            depth,
            fov_radians: field_of_view.to_radians() as f32,
        },
        (_, [x, y, z, height]) => Guide::Surface {
            normals: [x, y, z],
            height,
        },
        _ => {
            return Err(NodeError::new(
                "the network's answer has another number of channels than it declares",
            ));
        }
    };
    let extent = extent.value().map(|share| share as f32);
    let (mut relief, used) = guided::estimate(light, foundation, guide, extent, &settings);
    if !used {
        ctx.note("the network says the same depth everywhere; the body of the silhouette is used");
    }
    // Depth tells which rim of a whole canvas is nearer; normals and a height beside them hardly do.
    if relief.mode == Mode::Relief && (!used || matches!(answer, Answer::Surface { .. })) {
        tilt(&mut relief, settings.base.ramp);
    }
    Ok(relief)
}

/// Brings the lower rim nearer, as the embedded relief does.
fn tilt(relief: &mut Relief, ramp: f32) {
    let width = relief.height.width();
    for field in [&mut relief.height, &mut relief.base] {
        for (y, row) in field.data_mut().chunks_mut(width).enumerate() {
            row.iter_mut().for_each(|h| *h += ramp * y as f32);
        }
    }
    relief.tilt = ramp;
}
