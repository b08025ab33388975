//! What goes into a network and what comes out, in YAML beside its file.
//!
//! ```yaml
//! network: 1                     # the version of this format
//! licence: MIT
//! source: https://example.org/lines
//! channels: [red, green, blue]   # sRGB-encoded, 0 to 1, times `white`, minus `mean`, over `std`
//! mean: [0.485, 0.456, 0.406]
//! std: [0.229, 0.224, 0.225]
//! size: any                      # or {fixed: {width: 320, height: 320}}, {fit: {longer_side: 518, multiple: 14}}
//! answer: edges                  # or saliency, depth, surface, picture
//! ```

use gear_graph::graph::{Mistakes, read_declaration};
use gear_graph::{Choice, Params};

use crate::OnnxError;

/// What goes into a network and what comes out.
#[derive(Clone, Debug, PartialEq, Params)]
pub struct Declaration {
    /// Version of the format of declarations: 1.
    #[param(range = 1..=1)]
    pub network: u32,
    /// The licence of the weights; for people.
    #[param(default = String::new())]
    pub licence: String,
    /// Where the network comes from; for people.
    #[param(default = String::new())]
    pub source: String,
    /// The name of the input; the only one if not given.
    pub input: Option<String>,
    /// The name of the output; the first if not given.
    pub output: Option<String>,
    /// The order of the axes of input and output.
    #[param(default = Layout::Nchw)]
    pub layout: Layout,
    /// What the channels of the input are, in order.
    #[param(default = vec![Channel::Red, Channel::Green, Channel::Blue])]
    pub channels: Vec<Channel>,
    /// What 1 becomes before mean and standard deviation, such as 255.
    #[param(default = 1.0, above = 0.0, range = 0.0..=1e6)]
    pub white: f64,
    /// Subtracted: one number, or one a channel.
    #[param(default = Vec::new())]
    pub mean: Vec<f64>,
    /// Divided by, after the mean: one number, or one a channel.
    #[param(default = Vec::new())]
    pub std: Vec<f64>,
    /// Whether colours are first divided by the largest sample of the picture.
    #[param(default = false)]
    pub divide_by_maximum: bool,
    /// The sizes that the network takes.
    #[param(default = Size::Any { multiple: 1, at_most: 2048 })]
    pub size: Size,
    /// What comes out.
    pub answer: Answer,
}

/// The order of a tensor's axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum Layout {
    /// One picture, channels, rows, columns.
    Nchw,
    /// One picture, rows, columns, channels.
    Nhwc,
}

/// What a channel of the input is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum Channel {
    /// sRGB-encoded red, 0 to 1.
    Red,
    /// sRGB-encoded green, 0 to 1.
    Green,
    /// sRGB-encoded blue, 0 to 1.
    Blue,
    /// Rec. 601 luma of the encoded colour, 0 to 1.
    Grey,
    /// The mask, 0 or 1.
    Mask,
    /// Contours, 0 to 1.
    Edges,
    /// x of the unit normal of the body that the silhouette suggests (to the right); 0 off the mask.
    BaseNormalX,
    /// y of that normal (downwards).
    BaseNormalY,
    /// Height of that body, in pixels over 32.
    BaseHeight,
}

impl Channel {
    /// The name in declarations.
    pub fn name(self) -> String {
        match gear_graph::Param::write(&self) {
            gear_graph::ParamValue::String(name) => name,
            other => other.to_string(),
        }
    }

    pub(crate) fn is_colour(self) -> bool {
        matches!(self, Self::Red | Self::Green | Self::Blue | Self::Grey)
    }
}

/// The sizes that a network takes. A picture of another one is brought there, and the answer back.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum Size {
    /// Any; padded by its own rim where sides must be multiples.
    Any {
        /// What sides must be a multiple of.
        #[param(default = 1, range = 1..=512, unit = "px")]
        multiple: u32,
        /// Larger pictures are reduced to this longer side.
        #[param(default = 2048, range = 16..=16384, unit = "px")]
        at_most: u32,
    },
    /// One; the picture is stretched.
    Fixed {
        /// Width.
        #[param(range = 1..=16384, unit = "px")]
        width: u32,
        /// Height.
        #[param(range = 1..=16384, unit = "px")]
        height: u32,
    },
    /// The picture is resized to a longer side, both sides rounded to multiples.
    Fit {
        /// Longer side.
        #[param(range = 1..=16384, unit = "px")]
        longer_side: u32,
        /// What sides must be a multiple of.
        #[param(default = 1, range = 1..=512, unit = "px")]
        multiple: u32,
    },
}

/// What is done to the samples of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum Activation {
    /// Nothing: they are what they should be.
    None,
    /// The logistic function: they are log-odds.
    Sigmoid,
    /// Scaled so that the least becomes 0 and the largest 1.
    MinMax,
}

/// What larger depths mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum Depth {
    /// Larger is nearer, scale and offset are unknown (disparity, relative depth).
    Inverse,
    /// Distance from the camera in any one unit: larger is farther, 0 is the camera.
    Metric,
}

/// Where y of a normal points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum Axis {
    /// Downwards, as rows go.
    Down,
    /// Upwards.
    Up,
}

/// What comes out of a network.
#[derive(Clone, Debug, PartialEq, Choice)]
pub enum Answer {
    /// One channel: contours, 0 to 1.
    Edges {
        /// What is done to its samples.
        #[param(default = Activation::None)]
        activation: Activation,
    },
    /// One channel: what is figure, 0 to 1.
    Saliency {
        /// What is done to its samples.
        #[param(default = Activation::None)]
        activation: Activation,
    },
    /// One channel: depth.
    Depth {
        /// What larger means.
        of: Depth,
    },
    /// Four channels: the unit normal (x to the right, y, z to the viewer) and the height towards the viewer.
    Surface {
        /// Pixels that a height of 1 stands for.
        #[param(default = 1.0, above = 0.0, range = 0.0..=1e6, unit = "px")]
        height: f64,
        /// Where y points.
        #[param(default = Axis::Down)]
        y: Axis,
        /// Whether it is asked at half size too, and the two answers averaged.
        #[param(default = false)]
        half_size: bool,
    },
    /// Three channels: a picture.
    Picture {
        /// The sample of white, before `mean` and `std` are undone.
        #[param(default = 1.0, above = 0.0, range = 0.0..=1e6)]
        white: f64,
        /// Added, after multiplication by `std`: none, one number, or three.
        #[param(default = Vec::new())]
        mean: Vec<f64>,
        /// Multiplied by: none, one number, or three.
        #[param(default = Vec::new())]
        std: Vec<f64>,
        /// The order of the colours.
        #[param(default = vec![Channel::Red, Channel::Green, Channel::Blue])]
        channels: Vec<Channel>,
    },
}

impl Answer {
    /// The name in declarations.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Edges { .. } => "edges",
            Self::Saliency { .. } => "saliency",
            Self::Depth { .. } => "depth",
            Self::Surface { .. } => "surface",
            Self::Picture { .. } => "picture",
        }
    }

    /// Channels of the answer.
    pub fn channels(&self) -> usize {
        match self {
            Self::Edges { .. } | Self::Saliency { .. } | Self::Depth { .. } => 1,
            Self::Surface { .. } => 4,
            Self::Picture { .. } => 3,
        }
    }
}

impl Declaration {
    /// Reads a declaration. `name` is what people call the file.
    pub fn read(name: &str, yaml: &str) -> Result<Self, Mistakes> {
        read_declaration(name, yaml, Self::check)
    }

    /// What the ranges of single keys do not say.
    fn check(&self) -> Vec<(&'static str, String)> {
        let mut mistakes = Vec::new();
        let channels = self.channels.len();
        if channels == 0 || channels > 64 {
            mistakes.push(("channels", format!("`channels` holds {channels}, expected 1 to 64")));
        }
        let mut fits = |key: &'static str, what: &str, numbers: &[f64], channels: usize, divides: bool| {
            if !(numbers.len() <= 1 || numbers.len() == channels) {
                let found = numbers.len();
                mistakes.push((
                    key,
                    format!("{what} holds {found} numbers, expected one, or one a channel, which are {channels}"),
                ));
            }
            if divides && numbers.iter().any(|x| x.abs() < 1e-12) {
                mistakes.push((key, format!("{what} holds 0, by which nothing can be divided")));
            }
        };
        fits("mean", "`mean`", &self.mean, channels, false);
        fits("std", "`std`", &self.std, channels, true);
        if let Answer::Picture {
            mean, std, channels, ..
        } = &self.answer
        {
            fits("answer", "`mean` of the answer", mean, 3, false);
            fits("answer", "`std` of the answer", std, 3, true);
            let order: Vec<_> = [Channel::Red, Channel::Green, Channel::Blue]
                .iter()
                .filter(|colour| channels.contains(colour))
                .collect();
            if order.len() != 3 || channels.len() != 3 {
                let message = "`channels` of the answer must be red, green and blue, each once, in some order";
                mistakes.push(("answer", message.to_owned()));
            }
        }
        mistakes
    }

    /// An error if the network answers something else than one of these, names of [`Answer`]s.
    pub fn expect(&self, wanted: &[&str]) -> Result<(), OnnxError> {
        if wanted.contains(&self.answer.name()) {
            return Ok(());
        }
        let wanted: Vec<_> = wanted.iter().map(|answer| format!("`answer: {answer}`")).collect();
        Err(OnnxError::Mismatch(format!(
            "it declares `answer: {}`, and {} is needed here",
            self.answer.name(),
            wanted.join(" or ")
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "network: 1\nmean: [0.5]\nstd: [0.2, 0.2, 0.3]\nsize: {any: {multiple: 16}}\nanswer: edges\n";

    #[test]
    fn what_is_written_is_read_again() {
        let read = Declaration::read("a.yaml", GOOD).unwrap();
        assert_eq!(
            read.size,
            Size::Any {
                multiple: 16,
                at_most: 2048
            }
        );
        let json = serde_json::Value::Object(Params::write(&read)).to_string();
        assert_eq!(Declaration::read("stored", &json).unwrap(), read);
    }

    #[test]
    fn a_mistake_is_told_with_its_line_what_was_expected_and_the_nearest_name() {
        let told = |yaml: &str| Declaration::read("lines.yaml", yaml).unwrap_err().to_string();
        let message = told(&GOOD.replace("answer: edges", "answer: edge"));
        assert!(
            message.contains("did you mean `edges`?") && message.contains("lines.yaml:5"),
            "{message}"
        );
        let message = told(&GOOD.replace("[0.5]", "[0.5, 0.5]"));
        assert!(
            message.contains("expected one, or one a channel, which are 3"),
            "{message}"
        );
        assert!(message.contains("lines.yaml:2"), "{message}");
        let message = told(&GOOD.replace("0.3]", "0]"));
        assert!(message.contains("nothing can be divided"), "{message}");
        assert!(told("network: 2\nanswer: edges\n").contains("network"));
        assert!(told("network: 1\n").contains("answer"));
        assert!(told("network: 1\nanswer: {picture: {channels: [red, red, blue]}}\n").contains("each once"));
        assert!(told("network: 1\nchannel: [red]\nanswer: edges\n").contains("did you mean `channels`?"));
    }

    #[test]
    fn an_answer_of_another_kind_is_named() {
        let read = Declaration::read("a.yaml", GOOD).unwrap();
        assert!(read.expect(&["edges"]).is_ok());
        let message = read.expect(&["depth", "surface"]).unwrap_err().to_string();
        assert!(
            message.contains("`answer: edges`") && message.contains("`answer: depth` or `answer: surface`"),
            "{message}"
        );
    }
}
