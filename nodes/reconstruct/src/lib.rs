//! Reconstruct: one picture and its mask become a closed, double-sided Gaussian scene.
//!
//! The embedded method of [`gear_relief`]: the body is the inflated silhouette (`−Δu = 4`, `h = √u`; a relief when the
//! mask is the whole canvas), detail is what the shading says beyond the body and the creases that drawn lines stand
//! for, and the surface is lifted to surfels along the rays of the canonical camera, so that the front view is aligned
//! with the picture to the pixel. A network for depth or for normals takes the silhouette's place with the method `depth-network`; a model
//! trained on objects takes the same ports.

mod network;

use std::sync::Arc;

use gear_graph::{
    Choice, Context, Demand, Inputs, Known, Lazy, Node, NodeError, Numerics, OrAuto, Outputs, Params, Registry, Report,
    Resources, Want, Wanted,
};
use gear_image::{Field, Image, Mask, Rgb, colour, filter};
use gear_onnx::{Model, Provider};
use gear_relief::base::BaseSettings;
use gear_relief::crease::CreaseSettings;
use gear_relief::detail::DetailSettings;
use gear_relief::fields;
use gear_relief::height::{self, HeightSettings, Mode, Relief};
use gear_relief::layers::LayerSettings;
use gear_relief::light::Calibration;
use gear_relief::surfels::{self, Counts, SurfelSettings};
use gear_splat::{Camera, Scene};
use serde_json::json;

/// Surface and Gaussian scene from one picture.
#[derive(Clone, Debug, Params)]
pub struct Reconstruct {
    /// How the height is found.
    #[param(default = Method::shading())]
    pub method: Method,
    /// The camera under which the scene shows the picture.
    #[param(default = View::Orthographic)]
    pub camera: View,
    /// Depth of a figure's body relative to a circular profile: few are as deep as they are wide.
    #[param(default = 0.8, range = 0.0..=4.0)]
    pub inflate: f64,
    /// Depth of the crease that a drawn line makes in a figure; lines of another colour than what lies beside them, or
    /// crowded ones, are ornament and make none.
    #[param(default = 0.09, range = 0.0..=1.0, unit = "share of the longer side")]
    pub crease: f64,
    /// Relief mode: how much nearer the lower rim is than the upper.
    #[param(default = 0.15, range = -1.0..=1.0, unit = "share of the height")]
    pub ramp: f64,
    /// Relief mode: how steeply the surface rises across a full contour towards its lower side, since what is drawn lower
    /// stands before what is above it; 0 looks at no contour. Only with the method `shading`.
    #[param(default = 0.5, range = 0.0..=4.0, unit = "height a pixel")]
    pub layers: f64,
    /// Depth of a figure's back relative to its front.
    #[param(default = 0.6, range = 0.0..=2.0)]
    pub back: f64,
    /// Largest deviation of the surface from a surfel's plane.
    #[param(default = 0.25, range = 0.0..=100.0, unit = "px")]
    pub plane_tolerance: f64,
    /// Largest deviation of the picture from a surfel's colour, rms.
    #[param(default = 0.015, range = 0.0..=1.0, unit = "encoded colour")]
    pub colour_tolerance: f64,
    /// Number of Gaussians above which both tolerances are loosened, threefold at most.
    #[param(default = 120_000, range = 1..=100_000_000)]
    pub max_gaussians: usize,
}

/// How the height is found. In YAML: `method: inflation`, `method: shading`, `method: {shading: {iterations: 20}}`.
#[derive(Clone, Debug, PartialEq, Choice)]
pub enum Method {
    /// The inflated silhouette, with creases.
    Inflation,
    /// Detail from shading on top of it.
    Shading {
        /// Alternations of normals and integration.
        #[param(default = 10, range = 0..=1000)]
        iterations: usize,
        /// Shading contrast that is not believed: .25 expects a natural picture, .03 a painted one.
        #[param(default = 0.25, range = 0.0..=4.0)]
        gain_floor: f64,
        /// Largest structure that shading may shape.
        #[param(default = 0.09, range = 0.001..=1.0, unit = "share of √area")]
        detail_scale: f64,
        /// Share of the Newton step taken in each alternation.
        #[param(default = 0.8, range = 0.0..=1.0)]
        step: f64,
    },
    /// What a network says of depth (`answer: depth`) or of normals and height (`answer: surface`) in place of the
    /// inflated body, with detail from shading on top of it.
    DepthNetwork {
        /// What computes it.
        #[param(default = Provider::Cpu)]
        provider: Provider,
        /// Height of the surface. `auto`: as the inflated body's for inverse depth, by the field of view for distances,
        /// as the normals say for surfaces.
        #[param(default = OrAuto::Auto, range = 0.0..=4.0, unit = "share of the longer side")]
        extent: OrAuto<f64>,
        /// Angle under which the longer side was seen; for distances only.
        #[param(default = 40.0, range = 1.0..=150.0, unit = "degrees")]
        field_of_view: f64,
        /// Alternations of normals and integration; 0 leaves the network's surface.
        #[param(default = 10, range = 0..=1000)]
        iterations: usize,
        /// Shading contrast that is not believed: .25 expects a natural picture, .03 a painted one.
        #[param(default = 0.25, range = 0.0..=4.0)]
        gain_floor: f64,
        /// Largest structure that shading may shape.
        #[param(default = 0.09, range = 0.001..=1.0, unit = "share of √area")]
        detail_scale: f64,
        /// Share of the Newton step taken in each alternation.
        #[param(default = 0.8, range = 0.0..=1.0)]
        step: f64,
    },
}

impl Method {
    fn shading() -> Self {
        Self::Shading {
            iterations: 10,
            gain_floor: 0.25,
            detail_scale: 0.09,
            step: 0.8,
        }
    }
}

/// The camera under which the scene shows the picture. In YAML: `camera: orthographic`,
/// `camera: {pinhole: {fov: 40}}`.
#[derive(Clone, Debug, PartialEq, Choice)]
pub enum View {
    /// Parallel rays.
    Orthographic,
    /// Rays through a centre; the plane z = 0 is seen as by the orthographic camera.
    Pinhole {
        /// Angle under which the picture's longer side is seen.
        #[param(default = 40.0, range = 1.0..=120.0, unit = "degrees")]
        fov: f64,
    },
}

/// Input ports.
#[derive(Inputs)]
pub struct In {
    /// The picture, best grounded.
    pub image: Arc<Image>,
    /// What belongs to the object, resized to the picture if need be; full or empty means a relief of the whole canvas.
    pub mask: Arc<Mask>,
    /// The network, for the method `depth-network`.
    pub model: Option<Lazy<Model>>,
}

/// Output ports.
#[derive(Outputs)]
pub struct Out {
    /// The scene, with the camera under which it shows the picture; centred on z = 0.
    pub scene: Arc<Scene>,
    /// World z of the front surface, towards the viewer (the picture's longer side is 1); NaN outside the mask.
    pub depth: Wanted<Field>,
    /// World-space unit normals of the front as colours `n/2 + ½` (x right, y up, z to the viewer); ½ outside.
    pub normals: Wanted<Image>,
    /// Trust in the shading, light, mode, counts.
    pub report: Wanted<Report>,
}

impl Node for Reconstruct {
    const NAME: &str = "Reconstruct";
    const VERSION: u32 = 2;
    const USES: &'static [Numerics] = &[Numerics::new("gear-relief", gear_relief::NUMERICS)];
    type Inputs = In;
    type Outputs = Out;

    fn realm(&self, resources: &Resources) -> String {
        match self.method {
            Method::DepthNetwork { provider, .. } => gear_onnx::realm(resources, provider),
            Method::Inflation | Method::Shading { .. } => "cpu".to_owned(),
        }
    }

    fn demand(&self, _output: &str, known: &Known<'_>) -> Result<Demand, NodeError> {
        match self.method {
            Method::DepthNetwork { .. } => gear_onnx::demand(known),
            Method::Inflation | Method::Shading { .. } => Ok(Demand::ready_because("the method is no network")),
        }
    }

    fn run(&self, inputs: In, want: &Want, ctx: &Context) -> Result<Out, NodeError> {
        let (width, height) = inputs.image.size();
        if width == 0 || height == 0 || inputs.mask.is_empty() {
            return Err(NodeError::input(
                "image",
                "expected a picture and a mask with pixels, found none",
            ));
        }
        let mask = filter::resize_mask(&inputs.mask, width, height);
        if mask.count() == 0 {
            ctx.note("the mask is empty: the whole canvas becomes a relief");
        }
        ctx.progress_with(0.0, "height");
        let light = colour::light(&inputs.image.rgb);
        let relief = match self.method {
            Method::DepthNetwork { .. } => network::relief(self, &inputs, &light, &mask, ctx)?,
            Method::Inflation | Method::Shading { .. } => height::estimate(&light, &mask, &self.height_settings()),
        };
        ctx.checkpoint()?;
        ctx.progress_with(0.8, "surfels");
        let settings = self.surfel_settings();
        let camera = self.canonical_camera(width, height);
        let (scene, counts) = surfels::lift(&relief, &inputs.image.rgb, &camera, &settings);
        Ok(Out {
            scene: Arc::new(scene),
            depth: want.compute("depth", || surfels::front_depth(&relief, &settings)),
            normals: want.compute("normals", || normal_map(&relief)),
            report: want.try_compute("report", || Report::new(report(&relief, counts)))?,
        })
    }
}

impl Reconstruct {
    fn height_settings(&self) -> HeightSettings {
        let mut settings = HeightSettings {
            base: BaseSettings {
                inflate: self.inflate as f32,
                ramp: self.ramp as f32,
            },
            crease: CreaseSettings {
                depth: self.crease as f32,
                ..CreaseSettings::default()
            },
            layers: LayerSettings {
                step: self.layers as f32,
                ..LayerSettings::default()
            },
            ..HeightSettings::default()
        };
        match self.method {
            Method::Inflation => {
                settings.detail.iterations = 0;
                settings.layers.step = 0.0;
            }
            Method::Shading {
                iterations,
                gain_floor,
                detail_scale,
                step,
            }
            | Method::DepthNetwork {
                iterations,
                gain_floor,
                detail_scale,
                step,
                ..
            } => {
                settings.calibration = Calibration {
                    gain_floor: gain_floor as f32,
                    ..Calibration::NATURAL
                };
                settings.detail = DetailSettings {
                    iterations,
                    step: step as f32,
                    scale: detail_scale as f32,
                    ..DetailSettings::default()
                };
            }
        }
        settings
    }

    fn surfel_settings(&self) -> SurfelSettings {
        SurfelSettings {
            back: self.back as f32,
            plane_tolerance: self.plane_tolerance as f32,
            colour_tolerance: self.colour_tolerance as f32,
            max_gaussians: self.max_gaussians,
            ..SurfelSettings::default()
        }
    }

    fn canonical_camera(&self, width: usize, height: usize) -> Camera {
        let (width, height) = (width as u32, height as u32);
        match self.camera {
            View::Orthographic => Camera::front(width, height),
            View::Pinhole { fov } => Camera::front_pinhole(width, height, fov.to_radians() as f32),
        }
    }
}

/// Normals as colours, from image space (y down) to the world's (y up).
fn normal_map(relief: &Relief) -> Image {
    let (width, height) = relief.height.size();
    let normals = fields::normals(&relief.height);
    let colours = normals
        .iter()
        .zip(relief.mask.data())
        .map(|(n, &inside)| {
            if inside {
                [n[0], -n[1], n[2]].map(|c| 0.5 * c + 0.5)
            } else {
                [0.5; 3]
            }
        })
        .collect();
    Image::opaque(Rgb::from_vec(width, height, colours))
}

fn report(relief: &Relief, counts: Counts) -> serde_json::Value {
    let light = relief.light.map(|light| {
        json!({
            "direction": light.direction,
            "ambient": light.ambient,
        })
    });
    json!({
        "mode": match relief.mode {
            Mode::Figure => "figure",
            Mode::Relief => "relief",
        },
        "trust": relief.light.map_or(0.0, |light| light.trust),
        "gain": relief.light.map_or(0.0, |light| light.gain),
        "r2": relief.light.map_or(0.0, |light| light.r2),
        "noise": relief.noise,
        "light": light,
        "detail": relief.detailed,
        "gaussians": counts.front + counts.back + counts.walls,
        "front": counts.front,
        "back": counts.back,
        "walls": counts.walls,
        "tolerances_loosened": counts.loosened,
    })
}

/// Adds the node to a registry.
pub fn register(registry: &mut Registry) {
    registry.node::<Reconstruct>();
}

#[cfg(test)]
mod tests;
