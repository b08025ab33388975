//! How scenes and views travel through a graph: digests, encodings, summaries, extreme cases.
//!
//! A [`Scene`] is stored as 3DGS PLY, [`Views`] as an OpenEXR file with one layer a view.

use gear_graph::{AnyValue, Digest, Hasher, Numerics, Summary, Value, ValueError};
use gear_image::{Field, Image, Mask, Rgb};
use glam::{Quat, Vec3};
use serde_json::json;

use crate::formats::{ply, views_exr};
use crate::{Camera, Gaussian, Projection, Scene, View, Views};

/// Raised when the rasteriser or the optimiser gives other bits.
const NUMERICS: Numerics = Numerics::new("gear-splat", 2);

/// Six significant digits: what a person compares.
fn rounded(x: f64) -> serde_json::Value {
    if x.is_finite() {
        json!(format!("{x:.5e}").parse::<f64>().unwrap_or(x))
    } else {
        json!(x.to_string())
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for x in values {
        sum += x;
        count += 1.0;
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

fn hash_camera(hasher: &mut Hasher, camera: &Camera) {
    let (kind, scale) = match camera.projection {
        Projection::Orthographic { pixels_per_unit } => (0, pixels_per_unit),
        Projection::Pinhole { focal_px } => (1, focal_px),
    };
    hasher
        .u64(kind)
        .f32s(&[scale])
        .f32s(&camera.rotation.to_cols_array())
        .f32s(&camera.translation.to_array())
        .f32s(&camera.principal)
        .u64(camera.width.into())
        .u64(camera.height.into());
}

impl Value for Scene {
    const TYPE: &'static str = "Scene";
    const DOC: &'static str = "3D Gaussians in the parametrisation of 3DGS (x right, y up, z towards the viewer), and the camera under which they show the painting. Every number is finite and every rotation has a direction.";
    const EXTENSION: &'static str = "ply";
    const NUMERICS: Numerics = NUMERICS;

    fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("Scene");
        let flat = |v: &[Vec3]| v.iter().flat_map(|v| v.to_array()).collect::<Vec<f32>>();
        let rotations: Vec<f32> = self.rotations.iter().flat_map(|q| q.to_array()).collect();
        hasher
            .f32s(&flat(&self.centers))
            .f32s(&flat(&self.log_scales))
            .f32s(&rotations)
            .f32s(&self.opacity_logits)
            .f32s(self.sh_dc.as_flattened())
            .f32s(&self.sh_rest)
            .u64(self.sh_degree.into());
        if let Some(camera) = &self.canonical_camera {
            hash_camera(&mut hasher, camera);
        }
        hasher.finish()
    }

    fn size_bytes(&self) -> usize {
        self.len() * 14 * 4 + self.sh_rest.len() * 4
    }

    fn encode(&self) -> Result<Vec<u8>, ValueError> {
        ply::write(self).map_err(|e| ValueError::new("Scene", e.to_string()))
    }

    fn decode(bytes: &[u8]) -> Result<Self, ValueError> {
        ply::read(bytes).map_err(|e| ValueError::new("Scene", e.to_string()))
    }

    fn summary(&self) -> Summary {
        let mut out = Summary::new();
        out.insert("gaussians".into(), json!(self.len()));
        out.insert("sh_degree".into(), json!(self.sh_degree));
        let invalid = self.count_invalid();
        if invalid > 0 {
            out.insert("invalid".into(), json!(invalid));
        }
        let valid: Vec<usize> = (0..self.len()).filter(|&i| self.is_valid(i)).collect();
        let color = [0, 1, 2].map(|c| rounded(mean(valid.iter().map(|&i| self.color(i)[c].into()))));
        let scale = [0, 1, 2].map(|a| rounded(mean(valid.iter().map(|&i| self.log_scales[i][a].into()))));
        let opacity = rounded(mean(valid.iter().map(|&i| self.opacity(i).into())));
        let three = |v: Vec3| v.to_array().map(|x| rounded(x.into()));
        if let Some(bounds) = self.bounds() {
            out.insert("min".into(), json!(three(bounds.min)));
            out.insert("max".into(), json!(three(bounds.max)));
        }
        out.insert("mean_color".into(), json!(color));
        out.insert("mean_log_scale".into(), json!(scale));
        out.insert("mean_opacity".into(), opacity);
        if let Some(camera) = &self.canonical_camera {
            out.insert("canonical_size".into(), json!([camera.width, camera.height]));
        }
        out
    }

    fn flaw(&self) -> Option<String> {
        let invalid = self.count_invalid();
        (invalid > 0).then(|| format!("has {invalid} invalid Gaussians of {}", self.len()))
    }

    fn extremes() -> Vec<(&'static str, Self)> {
        let base = Gaussian {
            center: Vec3::ZERO,
            scales: Vec3::new(0.1, 0.1, 0.01),
            rotation: Quat::IDENTITY,
            opacity: 0.9,
            color: [0.7, 0.4, 0.2],
        };
        let of = |gaussians: Vec<Gaussian>| {
            let mut scene = Self {
                canonical_camera: Some(Camera::front(40, 30)),
                ..Self::default()
            };
            gaussians.into_iter().for_each(|g| scene.push(g));
            scene
        };
        let with = |change: fn(&mut Gaussian)| {
            let mut gaussian = base;
            change(&mut gaussian);
            of(vec![base, gaussian])
        };
        vec![
            ("empty", Self::default()),
            ("one gaussian", of(vec![base])),
            (
                "no camera",
                Self {
                    canonical_camera: None,
                    ..of(vec![base])
                },
            ),
            ("covers everything", with(|g| g.scales = Vec3::splat(1e3))),
            ("needle", with(|g| g.scales = Vec3::new(1.0, 1e-6, 1e-6))),
            (
                "edge-on disc",
                with(|g| g.rotation = Quat::from_xyzw(0.0, 0.5, 0.0, 0.5).normalize()),
            ),
            (
                "transparent and opaque",
                of(vec![
                    Gaussian { opacity: 0.0, ..base },
                    Gaussian { opacity: 1.0, ..base },
                ]),
            ),
            ("tiny and huge", with(|g| g.scales = Vec3::new(1e-40, 1e-20, 1e30))),
            ("far away", with(|g| g.center = Vec3::new(1e6, -1e6, 1e6))),
            ("coincident", of(vec![base; 500])),
            ("not finite", with(|g| g.center.x = f32::NAN)),
            ("infinite scale", with(|g| g.scales.x = f32::INFINITY)),
        ]
    }

    /// The canonical camera gets the size of the picture or mask.
    fn matched(&self, other: &AnyValue) -> Option<Self> {
        let image = other.get::<Image>().map(|image| image.size());
        let (width, height) = image.or_else(|| other.get::<Mask>().map(|mask| mask.size()))?;
        self.canonical_camera.as_ref()?;
        Some(Self {
            canonical_camera: Some(Camera::front(width as u32, height as u32)),
            ..self.clone()
        })
    }
}

fn plane_summary(samples: &[f32]) -> serde_json::Value {
    let finite = || samples.iter().copied().filter(|x| x.is_finite());
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for x in finite() {
        low = low.min(x.into());
        high = high.max(x.into());
    }
    let share = finite().count() as f64 / samples.len().max(1) as f64;
    json!({
        "min": rounded(low), "max": rounded(high), "mean": rounded(mean(finite().map(f64::from))),
        "finite": rounded(share),
    })
}

impl Value for Views {
    const TYPE: &'static str = "Views";
    const DOC: &'static str = "A list of named renderings, each with its camera, colour, and as far as known alpha, depth (NaN where nothing is), normals and weight. Colour, alpha, normals and weight are finite.";
    const EXTENSION: &'static str = "exr";
    const NUMERICS: Numerics = NUMERICS;

    fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("Views");
        hasher.u64(self.views.len() as u64);
        for view in &self.views {
            hash_camera(&mut hasher, &view.camera);
            hasher.bytes(view.name.as_bytes()).f32s(view.rgb.data().as_flattened());
            for (tag, plane) in [(1, &view.alpha), (2, &view.depth), (3, &view.weight)] {
                if let Some(plane) = plane {
                    hasher.u64(tag).f32s(plane.data());
                }
            }
            if let Some(normal) = &view.normal {
                hasher.u64(4).f32s(normal.as_flattened());
            }
        }
        hasher.finish()
    }

    fn size_bytes(&self) -> usize {
        let planes = |v: &View| {
            let single = [&v.alpha, &v.depth, &v.weight].into_iter().flatten().count();
            3 + single + 3 * usize::from(v.normal.is_some())
        };
        self.views.iter().map(|v| v.rgb.len() * 4 * planes(v)).sum()
    }

    fn encode(&self) -> Result<Vec<u8>, ValueError> {
        views_exr::write(self).map_err(|cause| ValueError::new("Views", cause))
    }

    fn decode(bytes: &[u8]) -> Result<Self, ValueError> {
        views_exr::read(bytes).map_err(|cause| ValueError::new("Views", cause))
    }

    fn summary(&self) -> Summary {
        let mut out = Summary::new();
        out.insert("views".into(), json!(self.views.len()));
        for view in &self.views {
            let mut about = serde_json::Map::new();
            about.insert("size".into(), json!([view.rgb.width(), view.rgb.height()]));
            let color = [0, 1, 2].map(|c| rounded(mean(view.rgb.data().iter().map(|p| p[c].into()))));
            about.insert("mean_color".into(), json!(color));
            for (name, plane) in [("alpha", &view.alpha), ("depth", &view.depth), ("weight", &view.weight)] {
                if let Some(plane) = plane {
                    about.insert(name.into(), plane_summary(plane.data()));
                }
            }
            if let Some(normal) = &view.normal {
                let average = [0, 1, 2].map(|c| rounded(mean(normal.iter().map(|n| n[c].into()))));
                about.insert("mean_normal".into(), json!(average));
            }
            out.insert(view.name.clone(), about.into());
        }
        out
    }

    fn flaw(&self) -> Option<String> {
        self.views.iter().find_map(|view| {
            let finite = |samples: &[f32]| samples.iter().all(|x| x.is_finite());
            let plane = |plane: &Option<Field>| plane.as_ref().is_none_or(|plane| finite(plane.data()));
            let sound = finite(view.rgb.data().as_flattened())
                && plane(&view.alpha)
                && plane(&view.weight)
                && view.normal.as_ref().is_none_or(|normal| finite(normal.as_flattened()))
                && view
                    .depth
                    .as_ref()
                    .is_none_or(|depth| !depth.data().iter().any(|x| x.is_infinite()));
            (!sound).then(|| format!("has samples that are not finite in the view `{}`", view.name))
        })
    }

    fn extremes() -> Vec<(&'static str, Self)> {
        let view = |width: u32, height: u32, name: &str| {
            let (w, h) = (width as usize, height as usize);
            View {
                camera: Camera::front(width, height),
                name: name.into(),
                rgb: Rgb::from_fn(w, h, |x, y| [(x % 7) as f32 / 6.0, (y % 5) as f32 / 4.0, 0.5]),
                alpha: Some(Field::filled(w, h, 1.0)),
                depth: Some(Field::filled(w, h, 2.0)),
                normal: Some(vec![[0.0, 0.0, 1.0]; w * h]),
                weight: None,
            }
        };
        let with = |change: fn(&mut View)| {
            let mut one = view(12, 9, "front");
            change(&mut one);
            Self { views: vec![one] }
        };
        vec![
            ("none", Self::default()),
            (
                "one pixel",
                Self {
                    views: vec![view(1, 1, "front")],
                },
            ),
            (
                "sizes differ",
                Self {
                    views: vec![view(30, 20, "yaw-30"), view(8, 40, "yaw+30")],
                },
            ),
            (
                "only colour",
                with(|v| (v.alpha, v.depth, v.normal) = (None, None, None)),
            ),
            (
                "nothing seen",
                with(|v| {
                    v.rgb = Rgb::filled(12, 9, [1.0; 3]);
                    v.alpha = Some(Field::filled(12, 9, 0.0));
                    v.depth = Some(Field::filled(12, 9, f32::NAN));
                    v.normal = Some(vec![[0.0; 3]; 108]);
                }),
            ),
            (
                "no weight anywhere",
                with(|v| v.weight = Some(Field::filled(12, 9, 0.0))),
            ),
            ("odd name", with(|v| v.name = "a.b: \u{3b1}\u{a0}".into())),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_survive_their_encoding() {
        gear_graph::testing::assert_codec(Scene::extremes().into_iter().map(|e| e.1));
    }

    #[test]
    fn views_survive_their_encoding() {
        gear_graph::testing::assert_codec(Views::extremes().into_iter().map(|e| e.1));
    }

    #[test]
    fn surroundings_of_a_subject_are_not_written() {
        let subject = |x: usize, y: usize| (40..60).contains(&x) && (20..70).contains(&y);
        let plane = |inside: f32, outside: f32| {
            Field::from_fn(100, 80, |x, y| if subject(x, y) { inside + x as f32 } else { outside })
        };
        let view = View {
            camera: Camera::front(100, 80),
            name: "front".into(),
            rgb: Rgb::from_fn(100, 80, |x, y| {
                if subject(x, y) {
                    [x as f32, 0.5, 0.0]
                } else {
                    [1.0, -0.0, 1.0]
                }
            }),
            alpha: Some(plane(1.0, 0.0)),
            depth: Some(plane(2.0, f32::NAN)),
            normal: None,
            weight: Some(plane(0.5, 0.0)),
        };
        let views = Views { views: vec![view] };
        let bytes = views.encode().expect("encodes");
        // Six channels of 20 x 50 pixels, of 100 x 80.
        assert!((24_000..32_000).contains(&bytes.len()), "{}", bytes.len());
        let back = Views::decode(&bytes).expect("decodes");
        assert_eq!(back.digest(), views.digest());

        // A window outside of its camera's picture is refused.
        let at = bytes.windows(10).position(|w| w == b"dataWindow").expect("a window");
        let left = at + b"dataWindow\0box2i\0".len() + 4;
        let mut moved = bytes.clone();
        assert_eq!(moved[left..left + 4], 40i32.to_le_bytes());
        moved[left..left + 4].copy_from_slice(&90i32.to_le_bytes());
        moved[left + 8..left + 12].copy_from_slice(&109i32.to_le_bytes());
        let error = Views::decode(&moved).expect_err("outside");
        assert!(error.to_string().contains("not within its camera's 100x80"), "{error}");
    }

    #[test]
    fn a_digest_sees_every_attribute_and_the_camera() {
        let (_, scene) = Scene::extremes().swap_remove(1);
        let mut seen = vec![scene.digest()];
        let mut note = |change: fn(&mut Scene)| {
            let mut other = scene.clone();
            change(&mut other);
            assert!(!seen.contains(&other.digest()));
            seen.push(other.digest());
        };
        note(|s| s.centers[0].y = 0.5);
        note(|s| s.log_scales[0].z = 0.5);
        note(|s| s.rotations[0].w = 0.5);
        note(|s| s.opacity_logits[0] = 0.5);
        note(|s| s.sh_dc[0][2] = 0.5);
        note(|s| s.canonical_camera = None);
        note(|s| s.canonical_camera = Some(Camera::front(41, 30)));
    }
}
