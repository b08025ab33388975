//! The dominant colours of a picture: the fullest cells of a colour cube (uniform quantisation; Heckbert, "Color image
//! quantization for frame buffer display", 1982, section 3.1).
//!
//! The cube of sRGB-encoded colours is cut into n³ cells. Each of the fullest is told by the mean of the colours that
//! fell into it. Sums run in the order of the pixels, so the bits do not depend on the number of threads.

use std::sync::Arc;

use gear_graph::{Context, Inputs, Node, NodeError, Outputs, Params, Want};
use gear_image::{Image, Mask, colour};

use crate::{Palette, Tone};

/// The most frequent colours of a picture, or of what lies inside a mask.
#[derive(Clone, Debug, Params)]
pub struct DominantColours {
    /// How many colours at most.
    #[param(default = 6, range = 1..=64)]
    pub count: u32,

    /// Cells along each side of the colour cube.
    #[param(default = 6, range = 1..=32)]
    pub cells: u32,
}

/// Input ports.
#[derive(Inputs)]
pub struct In {
    /// The picture.
    pub image: Arc<Image>,
    /// What of it counts; all of it if nothing is wired.
    pub mask: Option<Arc<Mask>>,
}

/// Output ports.
#[derive(Outputs)]
pub struct Out {
    /// The colours, with their shares of what counts.
    pub palette: Arc<Palette>,
}

impl Node for DominantColours {
    const NAME: &str = "DominantColours";
    const VERSION: u32 = 1;
    type Inputs = In;
    type Outputs = Out;

    fn run(&self, inputs: In, _want: &Want, ctx: &Context) -> Result<Out, NodeError> {
        if let Some(mask) = &inputs.mask
            && mask.size() != inputs.image.size()
        {
            let (found, expected) = (mask.size(), inputs.image.size());
            return Err(NodeError::input(
                "mask",
                format!("expected the size of the image, {expected:?}, found {found:?}"),
            ));
        }
        let palette = dominant(
            &inputs.image,
            inputs.mask.as_deref(),
            self.count as usize,
            self.cells as usize,
        );
        if palette.0.is_empty() {
            ctx.note("nothing is inside the mask, so the palette is empty");
        }
        Ok(Out {
            palette: Arc::new(palette),
        })
    }
}

/// Sum of the colours in a cell, and how many there are.
#[derive(Clone, Copy, Default)]
struct Cell {
    sum: [f64; 3],
    count: u64,
}

fn dominant(image: &Image, mask: Option<&Mask>, count: usize, cells: usize) -> Palette {
    let mut cube = vec![Cell::default(); cells.pow(3)];
    for (i, pixel) in image.rgb.data().iter().enumerate() {
        if mask.is_some_and(|mask| !mask.data()[i]) {
            continue;
        }
        let colour = pixel.map(|c| colour::sanitise_sample(c).min(1.0));
        let [r, g, b] = colour.map(|c| ((c * cells as f32) as usize).min(cells - 1));
        let cell = &mut cube[(r * cells + g) * cells + b];
        cell.count += 1;
        for (sum, c) in cell.sum.iter_mut().zip(colour) {
            *sum += f64::from(c);
        }
    }
    let all: u64 = cube.iter().map(|cell| cell.count).sum();
    cube.retain(|cell| cell.count > 0);
    // Stable: cells that are equally full stay in the order of their colours.
    cube.sort_by_key(|cell| std::cmp::Reverse(cell.count));
    let tone = |cell: &Cell| Tone {
        colour: cell.sum.map(|sum| (sum / cell.count as f64) as f32),
        share: cell.count as f64 / all as f64,
    };
    Palette(cube.iter().take(count).map(tone).collect())
}

#[cfg(test)]
mod tests {
    use gear_graph::testing;
    use gear_image::Rgb;
    use gear_image::testing::sample_painting;

    use super::*;

    fn inputs() -> In {
        In {
            image: Arc::new(sample_painting()),
            mask: None,
        }
    }

    #[test]
    fn a_picture_of_two_colours_has_two_tones() {
        let image = Image::opaque(Rgb::from_fn(8, 4, |x, _| {
            if x < 6 { [0.9, 0.1, 0.1] } else { [0.1, 0.1, 0.9] }
        }));
        let Palette(tones) = dominant(&image, None, 6, 6);
        let shares: Vec<_> = tones.iter().map(|tone| tone.share).collect();
        assert_eq!(shares, [0.75, 0.25]);
        assert!((tones[0].colour[0] - 0.9).abs() < 1e-6);
        let right = Mask::from_fn(8, 4, |x, _| x >= 6);
        assert_eq!(dominant(&image, Some(&right), 6, 6).0[0].share, 1.0);
    }

    #[test]
    fn same_bits_twice_on_any_threads_and_whatever_is_wanted() {
        testing::assert_pure(&DominantColours::default(), inputs);
    }

    #[test]
    fn an_answer_or_an_error_on_every_extreme_input() {
        testing::assert_extremes(&DominantColours::default());
        testing::assert_extremes(&DominantColours { count: 64, cells: 1 });
    }

    #[test]
    fn tones_come_by_their_shares_of_the_whole() {
        let out = testing::run(&DominantColours::default(), inputs()).unwrap();
        let Palette(tones) = &*out.palette;
        assert_eq!(tones.len(), 6);
        assert!(tones.is_sorted_by(|a, b| a.share >= b.share));
        assert!(tones.iter().map(|tone| tone.share).sum::<f64>() <= 1.0);
    }
}
