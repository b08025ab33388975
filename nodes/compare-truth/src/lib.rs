//! How far a reconstruction is from a surface that is known, such as a sample's.
//!
//! ```json
//! {
//!   "depth": 0.41, "scale": 0.83, "normals_degrees": 16.2, "fitted_normals_degrees": 15.1,
//!   "detail": 0.46, "silhouette": 0.97, "pixels": 12345,
//!   "views": {"psnr_db": 21.3, "ssim": 0.71, "yaws": {"yaw-30": {"psnr_db": 22.0, "ssim": 0.74}}}
//! }
//! ```
//!
//! `depth` is the RMS error after the best affine fit over the truth's deviation (0 right, 1 no better than a plane),
//! `scale` the fit's factor; `detail` correlates what is smaller than 4 % of the picture; see [`gear_relief::truth`].
//! What is not defined is `null`, and `views` is absent without scenes.

use std::sync::Arc;

use gear_graph::{Context, Inputs, Node, NodeError, Numerics, Outputs, Params, Registry, Report, Want};
use gear_image::{Field, Image};
use gear_relief::fields::eroded;
use gear_relief::truth::{self, ViewError, surface};
use gear_splat::{Scene, orbit};
use serde_json::{Map, Value, json};

/// Version of the measures in `gear_relief::truth`, which its own number does not cover. Raise it when figures change.
const MEASURES: Numerics = Numerics::new("gear-relief-truth", 2);

/// Depth, normals, detail, silhouette and novel views beside the truth.
#[derive(Clone, Debug, Params)]
pub struct CompareTruth {
    /// Yaws from the canonical camera at which novel views are compared.
    #[param(default = vec![-60.0, -30.0, 30.0, 60.0], range = -360.0..=360.0, unit = "degrees")]
    pub yaws: Vec<f64>,
    /// Longer side of the canonical frame in those views; 0 keeps the true scene's.
    #[param(default = 0, range = 0..=4096, unit = "px")]
    pub size: u32,
}

/// What is compared, and with what.
#[derive(Inputs)]
pub struct In {
    /// World z of the front towards the viewer (the picture's longer side is 1); NaN outside the figure.
    pub depth: Arc<Field>,
    /// The true one, the same size.
    pub true_depth: Arc<Field>,
    /// Normals as colours `n/2 + ½`; those of `depth` where left out.
    pub normals: Option<Arc<Image>>,
    /// The true ones, the same size; those of `true_depth` where left out.
    pub true_normals: Option<Arc<Image>>,
    /// The scene, for novel views.
    pub scene: Option<Arc<Scene>>,
    /// The true surface as a scene with its canonical camera.
    pub true_scene: Option<Arc<Scene>>,
}

/// The measures.
#[derive(Outputs)]
pub struct Out {
    /// The figures; see the crate's documentation for the keys.
    pub report: Arc<Report>,
}

impl Node for CompareTruth {
    const NAME: &str = "CompareTruth";
    const VERSION: u32 = 1;
    const USES: &'static [Numerics] = &[MEASURES];
    type Inputs = In;
    type Outputs = Out;

    fn run(&self, inputs: In, _want: &Want, ctx: &Context) -> Result<Out, NodeError> {
        let expected = inputs.depth.size();
        same_size("true_depth", inputs.true_depth.size(), expected)?;
        let error = truth::surface_error(&inputs.depth, &inputs.true_depth);
        let mut normals_degrees = error.normals_degrees;
        if let Some((ours, theirs)) = pair("normals", &inputs.normals, "true_normals", &inputs.true_normals)? {
            same_size("normals", ours.size(), expected)?;
            same_size("true_normals", theirs.size(), expected)?;
            let inside = surface::finite(&inputs.true_depth);
            let rim = (0.01 * inside.longer_side() as f32).max(2.0) as u32;
            normals_degrees = surface::mean_angle(&decoded(ours), &decoded(theirs), &eroded(&inside, rim));
        }
        let mut report = json!({
            "depth": error.depth,
            "scale": error.scale,
            "normals_degrees": normals_degrees,
            "fitted_normals_degrees": error.fitted_normals_degrees,
            "detail": error.detail,
            "silhouette": error.silhouette,
            "pixels": error.pixels,
        });
        ctx.checkpoint()?;
        if let Some((scene, truth)) = pair("scene", &inputs.scene, "true_scene", &inputs.true_scene)? {
            for (name, scene) in [("scene", scene), ("true_scene", truth)] {
                scene.validate().map_err(|e| NodeError::input(name, e.to_string()))?;
            }
            ctx.progress_with(0.3, "novel views");
            let (scene, truth) = (scene.without_invalid().0, truth.without_invalid().0);
            report["views"] = views(&truth::novel_views(&scene, &truth, &self.yaws, self.size));
        }
        Ok(Out {
            report: Arc::new(Report(report)),
        })
    }
}

/// Both of two optional inputs, or neither.
fn pair<'a, T>(
    name: &'static str,
    ours: &'a Option<Arc<T>>,
    true_name: &'static str,
    theirs: &'a Option<Arc<T>>,
) -> Result<Option<(&'a T, &'a T)>, NodeError> {
    match (ours, theirs) {
        (Some(ours), Some(theirs)) => Ok(Some((ours, theirs))),
        (None, None) => Ok(None),
        (Some(_), None) => Err(NodeError::input(
            true_name,
            format!("`{name}` is given and has nothing to be compared with: wire `{true_name}` too, or neither"),
        )),
        (None, Some(_)) => Err(NodeError::input(
            name,
            format!("`{true_name}` is given and nothing to compare with it: wire `{name}` too, or neither"),
        )),
    }
}

fn same_size(name: &'static str, found: (usize, usize), expected: (usize, usize)) -> Result<(), NodeError> {
    if found == expected {
        return Ok(());
    }
    let ((fw, fh), (ew, eh)) = (found, expected);
    Err(NodeError::input(
        name,
        format!("it has {fw}×{fh} pixels, `depth` {ew}×{eh}; expected the same picture at the same size"),
    ))
}

/// Normals from their colours; ½ grey is none.
fn decoded(image: &Image) -> Vec<[f32; 3]> {
    image
        .rgb
        .data()
        .iter()
        .map(|c| c.map(|c| 2.0 * c - 1.0))
        .map(|n| if n.iter().all(|c| c.is_finite()) { n } else { [0.0; 3] })
        .collect()
}

fn views(errors: &[ViewError]) -> Value {
    let mean = |values: Vec<f64>| (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
    let each: Map<String, Value> = errors
        .iter()
        .map(|e| (orbit::yaw_name(e.yaw), json!({"psnr_db": e.psnr_db, "ssim": e.ssim})))
        .collect();
    json!({
        "psnr_db": mean(errors.iter().filter_map(|e| e.psnr_db).collect()),
        "ssim": mean(errors.iter().filter_map(|e| e.ssim).collect()),
        "yaws": each,
    })
}

/// Adds the node to a registry.
pub fn register(registry: &mut Registry) {
    registry.node::<CompareTruth>();
}

#[cfg(test)]
mod tests;
