//! A picture of a palette: one bar a tone, as wide as its share.

use std::sync::Arc;

use gear_graph::{Context, Inputs, Node, NodeError, Outputs, Params, Want, Wanted};
use gear_image::{Image, Rgb};

use crate::Palette;

/// A strip of bars in the colours of a palette, each as wide as its share.
#[derive(Clone, Debug, Params)]
pub struct ColourCard {
    /// Width of the strip; it is an eighth as high.
    #[param(default = 512, range = 8..=8192, unit = "px")]
    pub width: u32,
}

/// Input ports.
#[derive(Inputs)]
pub struct In {
    /// The colours.
    pub palette: Arc<Palette>,
}

/// Output ports.
#[derive(Outputs)]
pub struct Out {
    /// The strip.
    pub card: Wanted<Image>,
}

impl Node for ColourCard {
    const NAME: &str = "ColourCard";
    const VERSION: u32 = 1;
    type Inputs = In;
    type Outputs = Out;

    fn run(&self, inputs: In, want: &Want, _ctx: &Context) -> Result<Out, NodeError> {
        let Palette(tones) = &*inputs.palette;
        let all: f64 = tones.iter().map(|tone| tone.share).sum();
        if all.is_nan() || all <= 0.0 {
            return Err(NodeError::input(
                "palette",
                format!(
                    "expected shares with a sum above 0, found {} tones with {all}",
                    tones.len()
                ),
            ));
        }
        Ok(Out {
            card: want.compute("card", || card(&inputs.palette, all, self.width as usize)),
        })
    }
}

fn card(palette: &Palette, all: f64, width: usize) -> Image {
    // The tone of each column: the first whose shares, summed up to it, pass the column's middle.
    let tone = |x: usize| {
        let middle = (x as f64 + 0.5) / width as f64 * all;
        let mut passed = 0.0;
        let found = palette.0.iter().find(|tone| {
            passed += tone.share;
            passed > middle
        });
        let colour = found.or(palette.0.last()).map_or([0.0; 3], |tone| tone.colour);
        colour.map(|c| c.clamp(0.0, 1.0))
    };
    let row: Vec<[f32; 3]> = (0..width).map(tone).collect();
    Image::opaque(Rgb::from_fn(width, width / 8, |x, _| row[x]))
}

#[cfg(test)]
mod tests {
    use gear_graph::testing;

    use super::*;
    use crate::Tone;

    fn inputs() -> In {
        let tone = |grey, share| Tone {
            colour: [grey; 3],
            share,
        };
        In {
            palette: Arc::new(Palette(vec![tone(1.0, 0.75), tone(0.0, 0.25)])),
        }
    }

    #[test]
    fn bars_are_as_wide_as_their_shares() {
        let out = testing::run(&ColourCard { width: 80 }, inputs()).unwrap();
        let card = out.card.unwrap();
        assert_eq!(card.size(), (80, 10));
        let white = card.rgb.row(5).iter().filter(|pixel| pixel[0] == 1.0).count();
        assert_eq!(white, 60);
    }

    #[test]
    fn same_bits_twice_on_any_threads_and_whatever_is_wanted() {
        testing::assert_pure(&ColourCard::default(), inputs);
    }

    #[test]
    fn an_answer_or_an_error_on_every_extreme_input() {
        testing::assert_extremes(&ColourCard::default());
    }
}
