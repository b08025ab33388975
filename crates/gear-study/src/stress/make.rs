//! Recipes → values.
//!
//! A recipe is a few numbers in the catalogue, so that sizes and positions can be read and changed there. Everything
//! random is counted from a seed.

use gear_graph::{AnyValue, Registry};
use gear_image::{Field, Image, Mask, SrgbImage};
use gear_splat::{Camera, Gaussian, Scene, View, Views};
use glam::{Quat, Vec3};
use serde::Deserialize;

use crate::random::Random;

/// How a value is made.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Recipe {
    /// An extreme case that the type declares itself.
    Extreme(Declared),
    /// A colour picture.
    Image(Raster),
    /// A field.
    Field(Raster),
    /// A mask: inside where the raster is above one half.
    Mask(Raster),
    /// A scene.
    Scene(SceneRecipe),
    /// Views.
    Views(Vec<ViewRecipe>),
}

/// An extreme case that a type declares.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Declared {
    #[serde(rename = "type")]
    value_type: String,
    name: String,
}

/// Samples on a grid.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Raster {
    /// Width and height.
    size: [usize; 2],
    fill: Fill,
    /// Single pixels that are otherwise.
    #[serde(default)]
    pixels: Vec<Pixel>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Fill {
    Constant(f32),
    /// From the left rim to the right one.
    Ramp([f32; 2]),
    /// Left and right half.
    Halves([f32; 2]),
    Checker([f32; 2]),
    /// Powers of ten from the first pixel to the last, in reading order.
    Powers([f64; 2]),
    /// Uniform in [0, 1), of this seed; each channel its own.
    Noise(u64),
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Pixel {
    at: [usize; 2],
    value: f32,
}

/// Groups of Gaussians, and the canonical camera.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneRecipe {
    groups: Vec<Group>,
    #[serde(default)]
    camera: CameraRecipe,
}

/// Gaussians that are alike.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Group {
    #[serde(default = "one")]
    count: usize,
    #[serde(default)]
    center: [f32; 3],
    /// Each stands so far from the one before.
    #[serde(default)]
    step: [f32; 3],
    /// Random places so far around the centre.
    #[serde(default)]
    spread: f32,
    scales: [f32; 3],
    /// Degrees about y.
    #[serde(default)]
    yaw: f32,
    /// Whether each is turned at random instead.
    #[serde(default)]
    tumbled: bool,
    opacity: f32,
    /// Random where it is not given.
    #[serde(default)]
    color: Option<[f32; 3]>,
    /// Replaces the logit of the opacity, which may be beyond what an opacity can say.
    #[serde(default)]
    opacity_logit: Option<f32>,
}

fn one() -> usize {
    1
}

#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
enum CameraRecipe {
    /// Orthographic, from the front.
    Front([u32; 2]),
    /// A pinhole at `eye` that looks at the origin, with this focal length in pixels.
    Pinhole {
        eye: [f32; 3],
        size: [u32; 2],
        focal_px: f32,
    },
    None,
}

impl Default for CameraRecipe {
    fn default() -> Self {
        Self::Front([40, 30])
    }
}

/// A view of one colour on everything, as a target.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViewRecipe {
    name: String,
    size: [u32; 2],
    #[serde(default)]
    yaw: f32,
    color: [f32; 3],
    /// The weight of every pixel; none where it is not given.
    #[serde(default)]
    weight: Option<f32>,
    /// Whether it has depth and normals: of a wall that faces the camera.
    #[serde(default)]
    surface: bool,
}

/// The value; else what is wrong with the recipe.
pub fn value(recipe: &Recipe, registry: &Registry) -> Result<AnyValue, String> {
    Ok(match recipe {
        Recipe::Extreme(declared) => {
            let value_type = registry
                .find_value(&declared.value_type)
                .ok_or_else(|| format!("there is no type `{}`", declared.value_type))?;
            let found = value_type
                .extremes()
                .into_iter()
                .find(|(name, _)| *name == declared.name);
            found
                .ok_or_else(|| format!("{} declares no extreme `{}`", declared.value_type, declared.name))?
                .1
        }
        Recipe::Image(raster) => {
            let planes = [raster.plane(0)?, raster.plane(1)?, raster.plane(2)?];
            let [w, h] = raster.size;
            AnyValue::new(Image::opaque(SrgbImage::from_fn(w, h, |x, y| {
                [0, 1, 2].map(|c: usize| planes[c][y * w + x])
            })))
        }
        Recipe::Field(raster) => AnyValue::new(Field::from_vec(raster.size[0], raster.size[1], raster.plane(0)?)),
        Recipe::Mask(raster) => {
            let plane = raster.plane(0)?;
            let [w, h] = raster.size;
            AnyValue::new(Mask::from_fn(w, h, |x, y| plane[y * w + x] > 0.5))
        }
        Recipe::Scene(recipe) => AnyValue::new(recipe.scene()),
        Recipe::Views(views) => AnyValue::new(Views {
            views: views.iter().map(ViewRecipe::view).collect(),
        }),
    })
}

impl Raster {
    fn plane(&self, channel: u64) -> Result<Vec<f32>, String> {
        let [w, h] = self.size;
        if w == 0 || h == 0 {
            return Err(format!("a raster of {w}×{h} has no pixel"));
        }
        let last = (w * h - 1).max(1) as f64;
        let share = |x: usize, of: usize| x as f32 / (of.max(2) - 1) as f32;
        let fill = |i: usize| {
            let (x, y) = (i % w, i / w);
            match self.fill {
                Fill::Constant(value) => value,
                Fill::Ramp([a, b]) => a + (b - a) * share(x, w),
                Fill::Halves([a, b]) => [a, b][usize::from(2 * x >= w)],
                Fill::Checker([a, b]) => [a, b][(x + y) % 2],
                Fill::Powers([a, b]) => libm::exp10(a + (b - a) * i as f64 / last) as f32,
                Fill::Noise(seed) => {
                    let counter = (seed << 34) ^ (channel << 32) ^ i as u64;
                    Random::new(counter).share()
                }
            }
        };
        let mut plane: Vec<f32> = (0..w * h).map(fill).collect();
        for pixel in &self.pixels {
            let [x, y] = pixel.at;
            *plane
                .get_mut(y * w + x)
                .filter(|_| x < w)
                .ok_or_else(|| format!("the pixel {x}, {y} is outside"))? = pixel.value;
        }
        Ok(plane)
    }
}

impl SceneRecipe {
    fn scene(&self) -> Scene {
        let mut scene = Scene {
            canonical_camera: match self.camera {
                CameraRecipe::Front([w, h]) => Some(Camera::front(w, h)),
                CameraRecipe::Pinhole { eye, size, focal_px } => Some(Camera::look_at(
                    eye.into(),
                    Vec3::ZERO,
                    Vec3::Y,
                    size[0],
                    size[1],
                    focal_px,
                )),
                CameraRecipe::None => None,
            },
            ..Scene::default()
        };
        let mut random = Random::new(7);
        for group in &self.groups {
            for i in 0..group.count {
                let around = |random: &mut Random| group.spread * (2.0 * random.share() - 1.0);
                let jitter = Vec3::new(around(&mut random), around(&mut random), around(&mut random));
                let turned = if group.tumbled {
                    tumbled(&mut random)
                } else {
                    Quat::from_rotation_y(group.yaw.to_radians())
                };
                let colour = [random.share(), random.share(), random.share()];
                scene.push(Gaussian {
                    center: Vec3::from(group.center) + Vec3::from(group.step) * i as f32 + jitter,
                    scales: group.scales.into(),
                    rotation: turned,
                    opacity: group.opacity,
                    color: group.color.unwrap_or(colour),
                });
                if let (Some(logit), Some(last)) = (group.opacity_logit, scene.opacity_logits.last_mut()) {
                    *last = logit;
                }
            }
        }
        scene
    }
}

impl ViewRecipe {
    fn view(&self) -> View {
        let [width, height] = self.size;
        let (w, h) = (width as usize, height as usize);
        View {
            camera: Camera::front(width, height).orbit(Vec3::ZERO, self.yaw, 0.0),
            name: self.name.clone(),
            rgb: SrgbImage::filled(w, h, self.color),
            alpha: Some(Field::filled(w, h, 1.0)),
            depth: self.surface.then(|| Field::filled(w, h, 2.0)),
            normal: self.surface.then(|| vec![[0.0, 0.0, 1.0]; w * h]),
            weight: self.weight.map(|weight| Field::filled(w, h, weight)),
        }
    }
}

fn tumbled(random: &mut Random) -> Quat {
    let mut component = || 2.0 * random.share() - 1.0;
    let q = Quat::from_xyzw(component(), component(), component(), component());
    if q.length_squared() > 1e-3 {
        q.normalize()
    } else {
        Quat::IDENTITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recipe_makes_what_it_says() {
        let raster = |fill, pixels| Raster {
            size: [4, 3],
            fill,
            pixels,
        };
        let at = |x, y, value| Pixel { at: [x, y], value };
        let plane = raster(Fill::Halves([0.0, 1.0]), vec![at(3, 2, f32::NAN)])
            .plane(0)
            .unwrap();
        assert_eq!(plane[..4], [0.0, 0.0, 1.0, 1.0]);
        assert!(plane[11].is_nan() && plane[10] == 1.0);
        assert!(raster(Fill::Constant(0.0), vec![at(4, 0, 1.0)]).plane(0).is_err());
        let powers = raster(Fill::Powers([-30.0, 30.0]), vec![]).plane(0).unwrap();
        assert!((powers[0] / 1e-30 - 1.0).abs() < 1e-6 && (powers[11] / 1e30 - 1.0).abs() < 1e-6);
        let noise = |channel| raster(Fill::Noise(1), vec![]).plane(channel).unwrap();
        assert_eq!(noise(0), noise(0));
        assert_ne!(noise(0), noise(1));
    }
}
