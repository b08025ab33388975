//! Renders a scene from around it.
//!
//! Cameras stand on a circle about the scene's centre, turned by a yaw from the canonical camera, under which the scene
//! shows its painting. At yaw 0 and canonical size the view has the painting's pixels. Turned frames are widened, never
//! shrunk, until they hold the whole scene, at the same scale. Colours are blended in encoded values over white.

use std::sync::Arc;

use gear_graph::{Choice, Context, Inputs, Node, NodeError, Outputs, Params, Registry, Resources, Want};
use gear_splat::{Device, RenderOptions, Scene, Views, orbit};

/// Pictures of a scene from several directions: colour, coverage, depth and normals.
#[derive(Clone, Debug, Params)]
pub struct RenderViews {
    /// Directions to look from; 0 is the painting's own, positive ones show more of the right side.
    #[param(default = vec![-90.0, -60.0, -30.0, 0.0, 30.0, 60.0, 90.0], range = -360.0..=360.0, unit = "degrees")]
    pub yaws: Vec<f64>,

    /// Number of views on a full turn, all in the same frame; given, it replaces `yaws`.
    #[param(default = None, range = 1..=720)]
    pub orbit: Option<u32>,

    /// Longer side of the canonical frame; 0 keeps the canonical camera's.
    #[param(default = 0, range = 0..=8192, unit = "px")]
    pub size: u32,

    /// What each view carries.
    #[param(default = Channels::All)]
    pub channels: Channels,
}

/// What a view carries.
#[derive(Clone, Debug, PartialEq, Choice)]
pub enum Channels {
    /// Colour, coverage, depth and normals.
    All,
    /// Colour alone: enough to look at, at a third of the size.
    Color,
}

/// Input ports.
#[derive(Inputs)]
pub struct In {
    /// The scene to look at.
    pub scene: Arc<Scene>,
}

/// Output ports.
#[derive(Outputs)]
pub struct Out {
    /// The pictures, in the order of the yaws.
    pub views: Arc<Views>,
}

impl Node for RenderViews {
    const NAME: &str = "RenderViews";
    const VERSION: u32 = 1;
    type Inputs = In;
    type Outputs = Out;

    fn realm(&self, resources: &Resources) -> String {
        Device::lent(resources).realm()
    }

    fn run(&self, inputs: In, _want: &Want, ctx: &Context) -> Result<Out, NodeError> {
        let scene = valid_part(&inputs.scene, ctx)?;
        let yaws = self.yaws();
        let mut cameras = orbit::cameras(&scene, &yaws, self.size);
        if self.orbit.is_some() {
            orbit::with_common_frame(&mut cameras);
        }
        let device = Device::lent(ctx.resources());
        let options = RenderOptions::default();
        let everything = self.channels == Channels::All;
        let mut views = Views::default();
        for (i, (camera, yaw)) in cameras.iter().zip(&yaws).enumerate() {
            ctx.checkpoint()?;
            ctx.progress_with(i as f64 / yaws.len() as f64, orbit::yaw_name(*yaw));
            let name = orbit::yaw_name(*yaw);
            let view = orbit::view_on(&device, &scene, camera, name, &options, everything)?;
            views.views.push(view);
        }
        Ok(Out { views: Arc::new(views) })
    }
}

impl RenderViews {
    fn yaws(&self) -> Vec<f64> {
        match self.orbit {
            Some(count) => (0..count).map(|i| 360.0 * f64::from(i) / f64::from(count)).collect(),
            None => self.yaws.clone(),
        }
    }
}

/// The scene without Gaussians that are not finite; the user hears how many there were.
fn valid_part(scene: &Arc<Scene>, ctx: &Context) -> Result<Arc<Scene>, NodeError> {
    scene.validate().map_err(|e| NodeError::input("scene", e.to_string()))?;
    if scene.count_invalid() == 0 {
        return Ok(Arc::clone(scene));
    }
    let (valid, dropped) = scene.without_invalid();
    ctx.note(format!("{dropped} Gaussians were not finite and are left out"));
    Ok(Arc::new(valid))
}

/// Adds the node to a registry.
pub fn register(registry: &mut Registry) {
    registry.node::<RenderViews>();
}

#[cfg(test)]
mod tests {
    use super::*;
    use gear_graph::{Value, testing};
    use gear_splat::{Camera, Gaussian};
    use glam::{Quat, Vec3};

    /// A coloured hemisphere of surfels, 48 pixels wide.
    fn dome() -> Arc<Scene> {
        let mut scene = Scene {
            canonical_camera: Some(Camera::front(48, 40)),
            ..Scene::default()
        };
        for j in 0..40 {
            for i in 0..48 {
                let (x, y) = ((i as f32 - 23.5) / 48.0, -(j as f32 - 19.5) / 48.0);
                let rest = 0.16 - x * x - y * y;
                if rest > 0.0 {
                    let z = rest.sqrt();
                    let normal = Vec3::new(x, y, z) / 0.4;
                    scene.push(Gaussian {
                        center: Vec3::new(x, y, z),
                        scales: Vec3::new(0.6, 0.6, 0.15) / 48.0,
                        rotation: Quat::from_rotation_arc(Vec3::Z, normal),
                        opacity: 0.99,
                        color: [0.5 + x, 0.5 + y, z],
                    });
                }
            }
        }
        Arc::new(scene)
    }

    fn views(node: &RenderViews, scene: Arc<Scene>) -> Arc<Views> {
        testing::run(node, In { scene }).unwrap().views
    }

    #[test]
    fn the_front_view_shows_the_scene_in_the_paintings_pixels() {
        let views = views(&RenderViews::default(), dome());
        assert_eq!(views.views.len(), 7);
        let front = &views.views[3];
        assert_eq!((front.name.as_str(), front.rgb.size()), ("yaw+0", (48, 40)));
        let (depth, normal) = (front.depth.as_ref().unwrap(), front.normal.as_ref().unwrap());
        let distance = front
            .camera
            .project(Vec3::new(0.5 / 48.0, -0.5 / 48.0, 0.4))
            .unwrap()
            .depth;
        assert!((depth.at(24, 20) - distance).abs() < 0.01);
        assert!(normal[20 * 48 + 24][2] > 0.99);
        assert!((front.rgb.at(24, 20)[2] - 0.4).abs() < 0.02);
        assert_eq!(front.rgb.at(0, 0), [1.0; 3]);
    }

    #[test]
    fn the_sides_show_the_sides() {
        let views = views(
            &RenderViews {
                yaws: vec![-90.0, 90.0],
                ..RenderViews::default()
            },
            dome(),
        );
        let red = |i: usize| {
            let view = &views.views[i];
            let alpha = view.alpha.as_ref().unwrap();
            let (mut sum, mut weight) = (0.0, 0.0);
            for (pixel, a) in view.rgb.data().iter().zip(alpha.data()) {
                if *a > 0.9 {
                    sum += pixel[0];
                    weight += 1.0;
                }
            }
            sum / weight
        };
        assert!(red(1) > red(0) + 0.2, "the right side is redder: {} {}", red(1), red(0));
    }

    #[test]
    fn an_orbit_has_one_frame_and_goes_all_the_way_round() {
        let node = RenderViews {
            orbit: Some(8),
            size: 24,
            channels: Channels::Color,
            ..RenderViews::default()
        };
        let views = views(&node, dome());
        assert_eq!(views.views.len(), 8);
        assert!(views.views.iter().all(|v| v.rgb.size() == views.views[0].rgb.size()));
        assert!(views.views.iter().all(|v| v.alpha.is_none() && v.depth.is_none()));
        assert_eq!(views.views[7].name, "yaw+315");
    }

    #[test]
    fn every_extreme_scene_gives_finite_pictures() {
        for (name, scene) in Scene::extremes() {
            let node = RenderViews {
                size: 32,
                yaws: vec![0.0, 50.0],
                ..RenderViews::default()
            };
            let out = views(&node, Arc::new(scene));
            for view in &out.views {
                assert!(
                    view.rgb.data().iter().flatten().all(|x| (0.0..=1.0).contains(x)),
                    "{name}"
                );
                assert!(view.rgb.longer_side() <= 20_000, "{name}");
            }
        }
    }

    #[test]
    fn an_answer_or_an_error_on_every_extreme_input() {
        testing::assert_extremes(&RenderViews {
            size: 32,
            yaws: vec![0.0, 50.0],
            ..RenderViews::default()
        });
    }

    #[test]
    fn the_same_bits_on_any_number_of_threads() {
        let scene = dome();
        testing::assert_pure(&RenderViews::default(), || In {
            scene: Arc::clone(&scene),
        });
    }

    #[test]
    fn the_numbers_of_a_dome_stay_as_they_are() {
        let views = views(
            &RenderViews {
                yaws: vec![0.0, 60.0],
                ..RenderViews::default()
            },
            dome(),
        );
        insta::assert_json_snapshot!(views.summary());
    }
}
