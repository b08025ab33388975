//! Procedural paintings with known depth and normals.
//!
//! A picture is painted from a surface that is known exactly, so every later estimate can be compared with the
//! truth: mask, height, normals, reflectance, and what the surface looks like from the side ([`Sample::scene`]).
//! The painter works as classical court painters did: flat mineral colours, patterned cloth, ink outlines,
//! washes along the lines, and only weak modelling by light.
//!
//! Three motifs have names of their own ([`names`]). A benchmark of scenes in four families ([`Family`], [`benchmark`])
//! is drawn from numbers: `figure-1`, `vessel-5`, …

mod court_lady;
mod families;
mod ground;
mod landscape;
mod paint;
mod palette;
mod random;
mod request;
mod shape;
mod stage;
mod surface;
mod textile;
mod vessel;

pub use families::{BENCHMARK_SCENES, Family, benchmark};
pub use request::{LIGHTS, Request, Show, light};

use gear_image::{Field, Image, LinearImage, Mask, SrgbImage};

/// What lies behind the figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Background {
    /// Clean paper of one colour.
    Plain,
    /// Old silk with stains, brush writing and a seal.
    Textured,
    /// Old silk in a brocade mount; the figure is a seventh smaller. Ignored where the whole canvas is the subject.
    Bordered,
}

/// How the surface is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// As a painting: lines, washes, weak modelling, brush grain.
    Paint,
    /// As a photograph of the coloured surface: full Lambert shading, no line.
    Photo,
    /// Flat colours and lines, no modelling, no grain.
    Flat,
}

/// How a sample is painted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Pixels of the longer side.
    pub longer_side: usize,
    /// What lies behind the figure.
    pub background: Background,
    /// How the surface is shown.
    pub condition: Condition,
    /// Direction towards the light: x right, y up, z to the viewer; any length.
    pub light: [f64; 3],
    /// Seed of everything that is random.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            longer_side: 768,
            background: Background::Textured,
            condition: Condition::Paint,
            light: [-0.5, 0.55, 0.67],
            seed: 1,
        }
    }
}

/// A painting and its truth. All rasters have the painting's size.
#[derive(Clone, Debug)]
pub struct Sample {
    /// Name of the motif or scene.
    pub name: String,
    /// The picture.
    pub painting: Image,
    /// The picture without its ink lines: the colour of the surface itself.
    pub unlined: SrgbImage,
    /// Reflectance, linear light, ground included.
    pub albedo: LinearImage,
    /// The figure; full when the whole canvas is the subject.
    pub mask: Mask,
    /// Height over the ground plane towards the viewer, world units (the longer side is 1); 0 outside the mask.
    pub height: Field,
    /// World-space unit normals (x right, y up, z to the viewer); zero outside the mask.
    pub normals: Vec<[f32; 3]>,
    /// Which part is seen, counted from 1; 0 is the ground.
    pub parts: Vec<u16>,
}

/// What can go wrong.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SampleError {
    /// No motif has that name.
    #[error(
        "there is no sample {found:?}; there are {}, and the scenes {} with N from 1",
        names().join(", "),
        Family::ALL.map(|family| format!("{}-N", family.name())).join(", ")
    )]
    UnknownName {
        /// The name asked for.
        found: String,
    },
    /// An option of a written request is none.
    #[error("a sample has no option {found:?}; expected {expected}")]
    Option {
        /// What was written.
        found: String,
        /// What can be.
        expected: String,
    },
    /// The size cannot be painted.
    #[error("a sample of {found} px cannot be painted; ask for {MIN_SIDE} to {MAX_SIDE} px on the longer side")]
    Size {
        /// The size asked for.
        found: usize,
    },
}

/// Smallest longer side, pixels.
pub const MIN_SIDE: usize = 16;
/// Largest longer side, pixels.
pub const MAX_SIDE: usize = 4096;

/// The motifs that have names of their own.
pub fn names() -> &'static [&'static str] {
    &["court-lady", "vessel", "landscape-relief"]
}

/// Whether a motif or a scene has this name.
pub fn exists(name: &str) -> bool {
    names().contains(&name) || Family::of(name).is_some()
}

/// Paints the motif or scene `name`.
pub fn paint(name: &str, options: &Options) -> Result<Sample, SampleError> {
    if !(MIN_SIDE..=MAX_SIDE).contains(&options.longer_side) {
        return Err(SampleError::Size {
            found: options.longer_side,
        });
    }
    let stage = match (name, Family::of(name)) {
        ("court-lady", _) => court_lady::stage(options.seed),
        ("vessel", _) => vessel::stage(options.seed),
        ("landscape-relief", _) => landscape::stage(options.seed),
        (_, Some((family, number))) => family.stage(number, options.seed),
        (_, None) => return Err(SampleError::UnknownName { found: name.to_owned() }),
    };
    Ok(paint::paint(name, &stage, options))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small(background: Background, condition: Condition) -> Options {
        Options {
            longer_side: 96,
            background,
            condition,
            ..Options::default()
        }
    }

    #[test]
    fn every_sample_has_a_picture_and_its_truth() {
        for name in names() {
            let sample = paint(name, &small(Background::Textured, Condition::Paint)).unwrap();
            let size = sample.painting.size();
            assert_eq!(size.0.max(size.1), 96);
            assert_eq!(sample.mask.size(), size);
            assert!(
                sample
                    .painting
                    .rgb
                    .data()
                    .iter()
                    .flatten()
                    .all(|c| (0.0..=1.0).contains(c))
            );
            assert!(
                sample
                    .height
                    .data()
                    .iter()
                    .all(|h| h.is_finite() && *h >= 0.0 && *h < 0.5)
            );
            for ((normal, inside), height) in sample.normals.iter().zip(sample.mask.data()).zip(sample.height.data()) {
                let length = normal.iter().map(|c| c * c).sum::<f32>();
                assert!((length - f32::from(u8::from(*inside))).abs() < 1e-4);
                assert!(*inside || *height == 0.0);
            }
        }
    }

    #[test]
    fn every_scene_of_the_benchmark_has_a_picture_and_a_truth_with_depth() {
        let scenes = benchmark();
        assert!(scenes.len() >= 24);
        for name in scenes {
            let sample = paint(&name, &small(Background::Plain, Condition::Paint)).unwrap();
            let finite = |c: &f32| (0.0..=1.0).contains(c);
            assert!(sample.painting.rgb.data().iter().flatten().all(finite), "{name}");
            let inside: Vec<f32> = (0..sample.mask.len())
                .filter(|&p| sample.mask.data()[p])
                .map(|p| sample.height.data()[p])
                .collect();
            let (low, high) = gear_image::stats::range(&inside).unwrap();
            assert!(low >= 0.0 && high < 0.5 && high - low > 0.03, "{name}: {low} to {high}");
            let share = inside.len() as f64 / sample.mask.len() as f64;
            assert!(share > 0.12, "{name}: {share}");
            // a figure has ground all round it
            if !sample.mask.is_full() {
                let (w, h) = sample.mask.size();
                let rim = (0..w).all(|x| !sample.mask.at(x, 0) && !sample.mask.at(x, h - 1))
                    && (0..h).all(|y| !sample.mask.at(0, y) && !sample.mask.at(w - 1, y));
                assert!(rim, "{name} touches the frame");
            }
        }
    }

    #[test]
    fn scenes_of_a_family_differ_and_a_scene_keeps_its_shape_whatever_the_light() {
        let options = small(Background::Plain, Condition::Photo);
        let one = paint("vessel-1", &options).unwrap();
        assert_ne!(one.mask, paint("vessel-7", &options).unwrap().mask);
        let lit = Options {
            light: light("right").unwrap(),
            ..options
        };
        let other = paint("vessel-1", &lit).unwrap();
        assert_eq!((&one.height, &one.mask), (&other.height, &other.mask));
        assert_ne!(one.painting, other.painting);
    }

    #[test]
    fn same_seed_same_picture_another_seed_another_picture() {
        let options = small(Background::Textured, Condition::Paint);
        let one = paint("vessel", &options).unwrap();
        assert_eq!(one.painting, paint("vessel", &options).unwrap().painting);
        let other = paint("vessel", &Options { seed: 2, ..options }).unwrap();
        assert_ne!(one.painting, other.painting);
        assert_eq!(one.mask, other.mask);
    }

    #[test]
    fn the_background_does_not_touch_the_truth() {
        let plain = paint("court-lady", &small(Background::Plain, Condition::Paint)).unwrap();
        let textured = paint("court-lady", &small(Background::Textured, Condition::Paint)).unwrap();
        assert_eq!(plain.mask, textured.mask);
        assert_eq!(plain.height, textured.height);
        assert_ne!(plain.painting, textured.painting);
    }

    #[test]
    fn a_photograph_is_shaded_by_the_true_normals() {
        let options = small(Background::Plain, Condition::Photo);
        let sample = paint("vessel", &options).unwrap();
        let other = paint(
            "vessel",
            &Options {
                light: [0.5, 0.55, 0.67],
                ..options
            },
        )
        .unwrap();
        let luma = |s: &Sample, x| s.painting.rgb.at(x, 55).iter().sum::<f32>();
        let (w, _) = sample.painting.size();
        let (left, right) = (w / 2 - 20, w / 2 + 20);
        assert!(luma(&sample, left) > luma(&other, left) && luma(&sample, right) < luma(&other, right));
    }

    #[test]
    fn a_motif_that_does_not_exist_is_named_with_those_that_do() {
        let error = paint("cat", &Options::default()).unwrap_err().to_string();
        assert!(error.contains("cat") && error.contains("court-lady"));
        assert!(
            paint(
                "vessel",
                &Options {
                    longer_side: 0,
                    ..Options::default()
                }
            )
            .is_err()
        );
    }
}
