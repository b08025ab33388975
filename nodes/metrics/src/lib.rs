//! Measures of a finished scene.
//!
//! | figure | says | range | defined in |
//! |---|---|---|---|
//! | VEND | how voluminous the shape is, and in how many directions its surface looks | 0..=100, more is fuller | [`vend`] |
//! | DDI | how much detail its depth shows at a yaw, and on average | 0..=100, more is finer | [`ddi`] |
//! | NIQE | how unlike photographs the views and the grounded image are | ≥ 0, less is more natural | [`niqe`] |
//! | PSNR, SSIM | how well the front view shows the painting inside the mask | dB; −1..=1, more is closer | [`gear_image::fidelity`] |
//!
//! None of them measures whether the shape is *right*: VEND rewards roundness and DDI noise. What is undefined is
//! `null`, never 0; VEND and DDI are defined, as 0, for scenes without extent.
//!
//! The report:
//!
//! ```json
//! {
//!   "vend": 64.2, "extent": 0.470, "diversity": 0.878,
//!   "ddi": {"average": 14.1, "yaws": {"15": 11.7, "30": 11.8, "45": 11.9, "60": 13.2, "75": 16.6, "90": 19.9}},
//!   "niqe": {"views_average": 5.1, "views": {"yaw-90": 5.6, "yaw+0": 4.9}, "grounded": 4.2},
//!   "front": {"psnr_db": 33.0, "ssim": 0.95, "mask_pixels": 120000},
//!   "gaussians": 37000, "dropped": 0
//! }
//! ```
//!
//! `views_average` is the mean over the views where NIQE is defined. `dropped` counts Gaussians with a number that is not
//! finite; they take part in nothing.

pub mod ddi;
pub mod niqe;
pub mod surfels;
pub mod vend;
mod views;

use std::sync::Arc;

use gear_graph::{Context, Inputs, Node, NodeError, Outputs, Params, Registry, Report, Want};
use gear_image::{Image, Mask, fidelity};
use gear_splat::{RenderOptions, Scene, orbit};
use serde_json::{Map, Value, json};

use crate::surfels::Surfels;

/// VEND, DDI, NIQE, and fidelity of the front view to the painting.
///
/// The node renders what it measures itself, so that its figures depend on nothing but the scene and the pictures.
#[derive(Clone, Debug, Params)]
pub struct Metrics {
    /// Yaws at which depth detail is measured.
    #[param(default = vec![15.0, 30.0, 45.0, 60.0, 75.0, 90.0], range = -360.0..=360.0, unit = "degrees")]
    pub ddi_yaws: Vec<f64>,
    /// Side of the depth maps for DDI. The spacing of surfels should be under half a pixel's smoothing: coarser scenes
    /// read higher, because their facets count as detail.
    #[param(default = 192, range = 32..=2048, unit = "px")]
    pub ddi_size: u32,
    /// Cells of equal area over which VEND counts the directions of normals. More of them tell finer bends apart, and need
    /// more surfels to fill them: figures with other numbers of cells do not compare.
    #[param(default = vend::CELLS, range = 2..=65_536)]
    pub normal_cells: usize,
    /// Yaws of the views whose NIQE is taken.
    #[param(default = vec![-90.0, -60.0, -30.0, 0.0, 30.0, 60.0, 90.0], range = -360.0..=360.0, unit = "degrees")]
    pub view_yaws: Vec<f64>,
    /// Longer side of the canonical frame in those views; 0 keeps the canonical camera's.
    #[param(default = 0, range = 0..=8192, unit = "px")]
    pub view_size: u32,
}

/// What is measured, and what against.
#[derive(Inputs)]
pub struct In {
    /// The finished scene, with its canonical camera.
    pub scene: Arc<Scene>,
    /// The grounded image that its geometry came from.
    pub grounded: Arc<Image>,
    /// The painting that its front should show.
    pub painting: Arc<Image>,
    /// What of the painting is the subject, the same size.
    pub mask: Arc<Mask>,
}

/// The measures.
#[derive(Outputs)]
pub struct Out {
    /// The figures; see the crate's documentation for the keys.
    pub report: Arc<Report>,
}

impl Node for Metrics {
    const NAME: &str = "Metrics";
    const VERSION: u32 = 1;
    type Inputs = In;
    type Outputs = Out;

    fn run(&self, inputs: In, _want: &Want, ctx: &Context) -> Result<Out, NodeError> {
        inputs
            .scene
            .validate()
            .map_err(|e| NodeError::input("scene", e.to_string()))?;
        if inputs.mask.size() != inputs.painting.size() {
            let ((mw, mh), (pw, ph)) = (inputs.mask.size(), inputs.painting.size());
            return Err(NodeError::input(
                "mask",
                format!("it has {mw}×{mh} pixels, the painting {pw}×{ph}; expected the mask of this painting"),
            ));
        }
        let (scene, dropped) = inputs.scene.without_invalid();
        if dropped > 0 {
            ctx.note(format!("{dropped} Gaussians were not finite and are left out"));
        }
        let surfels = Surfels::of(&scene);
        let vend = vend::vend(&surfels, self.normal_cells);
        ctx.progress_with(0.1, "depth detail");
        let ddi = self.ddi(&scene, &surfels);
        ctx.progress_with(0.3, "front");
        let front = front(&scene, &inputs);
        let niqe = self.niqe(&scene, &inputs.grounded, ctx)?;
        let report = json!({
            "vend": vend.vend,
            "extent": vend.extent,
            "diversity": vend.diversity,
            "ddi": ddi,
            "niqe": niqe,
            "front": front,
            "gaussians": scene.len(),
            "dropped": dropped,
        });
        Ok(Out {
            report: Arc::new(Report(report)),
        })
    }
}

impl Metrics {
    fn ddi(&self, scene: &Scene, surfels: &Surfels) -> Value {
        let deviations = vend::principal_deviations(surfels);
        let maps = views::depth_maps(scene, &self.ddi_yaws, self.ddi_size);
        let at: Vec<f64> = maps.iter().map(|map| ddi::ddi(map, deviations)).collect();
        let yaws = self
            .ddi_yaws
            .iter()
            .zip(&at)
            .map(|(yaw, ddi)| (yaw.to_string(), json!(ddi)));
        json!({"average": mean(&at), "yaws": yaws.collect::<Map<_, _>>()})
    }

    fn niqe(&self, scene: &Scene, grounded: &Image, ctx: &Context) -> Result<Value, NodeError> {
        let cameras = orbit::cameras(scene, &self.view_yaws, self.view_size);
        let mut each = Map::new();
        let mut defined = Vec::new();
        for (i, (camera, yaw)) in cameras.iter().zip(&self.view_yaws).enumerate() {
            ctx.checkpoint()?;
            let name = orbit::yaw_name(*yaw);
            ctx.progress_with(0.4 + 0.6 * i as f64 / cameras.len() as f64, name.as_str());
            let view = orbit::view(scene, camera, name.clone(), &RenderOptions::default(), false);
            let score = niqe::niqe(&view.rgb);
            defined.extend(score);
            each.insert(name, json!(score));
        }
        Ok(json!({
            "views_average": mean(&defined),
            "views": each,
            "grounded": niqe::niqe(&grounded.rgb),
        }))
    }
}

/// The mean, `None` of nothing.
fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().fold(0.0, |sum, v| sum + v) / values.len() as f64)
}

/// Fidelity of the canonical view; undefined where the scene has no canonical camera of the painting's shape.
fn front(scene: &Scene, inputs: &In) -> Value {
    let (painting, mask) = (&inputs.painting.rgb, &*inputs.mask);
    let camera = scene.canonical_camera.map(|c| c.resized(painting.longer_side() as u32));
    let camera = camera.filter(|c| (c.width as usize, c.height as usize) == painting.size());
    let shown = camera.map(|camera| {
        let view = orbit::view(scene, &camera, String::new(), &RenderOptions::default(), false);
        (
            fidelity::psnr(&view.rgb, painting, mask),
            fidelity::ssim(&view.rgb, painting, mask),
        )
    });
    let (psnr, ssim) = shown.unwrap_or((None, None));
    json!({"psnr_db": psnr, "ssim": ssim, "mask_pixels": mask.count()})
}

/// Registers the node.
pub fn register(registry: &mut Registry) {
    registry.node::<Metrics>();
}

#[cfg(test)]
mod tests;
