//! What is reconstructed: the silhouette, the picture, and the picture enhanced.

use std::sync::Arc;

use gear_graph::{Lazy, OrAuto, testing};
use gear_image::{Field, Image, Mask, colour};
use gear_relief::height::{HeightSettings, Relief, estimate};
use gear_sample::Sample;
use node_recompose::{In, Recompose};

/// A version of the picture, or how much of it is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// The inflated silhouette and nothing of the picture (a whole canvas has none: the relief of its contours).
    Plain,
    /// The same with drawn lines as creases, and layers of a whole canvas; no shading.
    Lines,
    /// The picture as it is.
    Raw,
    /// Its histogram equalized.
    HistogramEqualization,
    /// Multi-scale retinex.
    Retinex,
    /// Grounded, whatever the picture's light.
    Grounded,
    /// Grounded as far as its light is not natural: the shipped default.
    Auto,
}

impl Variant {
    pub const ALL: [Self; 7] = [
        Self::Plain,
        Self::Lines,
        Self::Raw,
        Self::HistogramEqualization,
        Self::Retinex,
        Self::Grounded,
        Self::Auto,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::Plain => "silhouette only",
            Self::Lines => "lines",
            Self::Raw => "raw",
            Self::HistogramEqualization => "HE",
            Self::Retinex => "Retinex",
            Self::Grounded => "grounded, β = .5",
            Self::Auto => "grounded, auto",
        }
    }

    /// Whether its shading is looked at.
    pub fn is_lit(self) -> bool {
        !matches!(self, Self::Plain | Self::Lines)
    }
}

/// Reconstructs every variant; with found masks only those that the pipeline makes.
pub fn reconstruct(sample: &Sample, mask: &Mask, few: bool) -> Vec<(Variant, Relief)> {
    let painting = Arc::new(sample.painting.clone());
    let relief = |image: &Image, settings: &HeightSettings| estimate(&colour::light(&image.rgb), mask, settings);
    let settings = HeightSettings::default();
    let mut lines = settings;
    lines.detail.iterations = 0;
    let mut plain = lines;
    plain.crease.depth = 0.0;
    plain.layers.step = 0.0;
    let mut out = vec![
        (Variant::Plain, relief(&painting, &plain)),
        (Variant::Lines, relief(&painting, &lines)),
        (Variant::Raw, relief(&painting, &settings)),
    ];
    if !few {
        for (variant, method) in [
            (
                Variant::HistogramEqualization,
                node_enhance::Method::HistogramEqualization,
            ),
            (
                Variant::Retinex,
                node_enhance::Method::Retinex {
                    scales: vec![0.03, 0.12, 0.3],
                },
            ),
        ] {
            let inputs = node_enhance::In {
                image: painting.clone(),
            };
            let enhanced = testing::run(&node_enhance::Enhance { method }, inputs).expect("a sample can be enhanced");
            out.push((variant, relief(&enhanced.image, &settings)));
        }
        let ratio = ratio(&painting, mask);
        for (variant, beta) in [(Variant::Grounded, OrAuto::Value(0.5)), (Variant::Auto, OrAuto::Auto)] {
            out.push((variant, relief(&grounded(&painting, mask, &ratio, beta), &settings)));
        }
    }
    out
}

/// The chain of the main graph from the painting and its mask to the illumination ratio.
fn ratio(painting: &Arc<Image>, mask: &Mask) -> Arc<Field> {
    let image = painting.clone();
    let edges = testing::run(
        &node_edge_detect::EdgeDetect::default(),
        node_edge_detect::In { image, model: None },
    );
    let edges = edges.expect("a sample has edges").edges;
    let inputs = node_translate::In {
        image: painting.clone(),
        edges: Lazy::given(edges.clone()),
        mask: Lazy::given(Arc::new(mask.clone())),
        model: None,
    };
    let translated = testing::run(&node_translate::Translate::default(), inputs).expect("a sample can be translated");
    let inputs = node_log_ratio::In {
        image: translated.image,
    };
    let ratio = testing::run(&node_log_ratio::LogRatio::default(), inputs).expect("a translation has a ratio");
    let (ratio, smooth) = (ratio.ratio.unwrap(), ratio.smooth.unwrap());
    let inputs = node_pyramid::In {
        ratio,
        edges: Lazy::given(edges),
    };
    let pyramid = testing::run(&node_pyramid::Pyramid::default(), inputs).expect("a ratio has a pyramid");
    let inputs = node_adaptive_gain::In {
        multiscale: pyramid.ratio,
        smooth: Lazy::given(smooth),
    };
    let gain = testing::run(&node_adaptive_gain::AdaptiveGain::default(), inputs).expect("a pyramid has a gain");
    gain.ratio.unwrap()
}

/// The last node of the chain.
fn grounded(painting: &Arc<Image>, mask: &Mask, ratio: &Arc<Field>, beta: OrAuto<f64>) -> Arc<Image> {
    let inputs = In {
        painting: painting.clone(),
        mask: Lazy::given(Arc::new(mask.clone())),
        ratio: Lazy::given(ratio.clone()),
    };
    let recompose = Recompose {
        beta,
        ..Recompose::default()
    };
    let out = testing::run(&recompose, inputs).expect("a sample can be grounded");
    out.grounded.unwrap()
}
