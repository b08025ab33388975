//! Prompt: the text that an image editor or a judge is told about a painting.
//!
//! The paper's T_g asks for a geometry-friendly version (sculpture, pencil sketch, woodcut), T_a for the painting's own
//! look. Here a text has places for what is recorded of the painting (title, tradition, medium) and for its palette,
//! which is measured. What was made of it is a report like any other: it stands in the store and on the page.

mod palette;

use std::sync::Arc;

use gear_graph::{Choice, Context, Inputs, Node, NodeError, Outputs, Params, Registry, Report, Want};
use gear_image::{Image, Mask};
use serde_json::json;

/// The text that an editor or a judge is told about a painting.
#[derive(Clone, Debug, Params)]
pub struct Prompt {
    /// What is asked for.
    #[param(default = Purpose::Appearance)]
    pub purpose: Purpose,
    /// The painting's title; empty if it is not known.
    #[param(default = String::new())]
    pub title: String,
    /// Where it comes from, such as `Mughal miniature`.
    #[param(default = String::new())]
    pub tradition: String,
    /// What it is made of, such as `ink and colours on silk`.
    #[param(default = String::new())]
    pub medium: String,
    /// How many colours of its palette are named.
    #[param(default = 5, range = 0..=12)]
    pub colours: usize,
}

/// What is asked for. In YAML: `purpose: sculpture`, `purpose: {text: {text: "… {palette} …"}}`.
#[derive(Clone, Debug, PartialEq, Choice)]
pub enum Purpose {
    /// T_g: a marble sculpture of what is painted.
    Sculpture,
    /// T_g: a pencil sketch.
    PencilSketch,
    /// T_g: a woodcut.
    Woodcut,
    /// T_a: the painting's own look, in another view.
    Appearance,
    /// Words of your own, with the places `{title}`, `{tradition}`, `{medium}` and `{palette}`.
    Text {
        /// The words.
        #[param(default = String::new())]
        text: String,
    },
}

/// Input ports.
#[derive(Inputs)]
pub struct In {
    /// The painting, whose palette is measured.
    pub image: Arc<Image>,
    /// What of it counts.
    pub mask: Option<Arc<Mask>>,
}

/// Output ports.
#[derive(Outputs)]
pub struct Out {
    /// `prompt`, and what it was made of: `palette` (name, share, sRGB), `title`, `tradition`, `medium`.
    pub prompt: Arc<Report>,
}

impl Node for Prompt {
    const NAME: &str = "Prompt";
    const VERSION: u32 = 1;
    type Inputs = In;
    type Outputs = Out;

    fn check(&self) -> Result<(), NodeError> {
        match &self.purpose {
            Purpose::Text { text } if text.trim().is_empty() => Err(NodeError::param(
                "purpose",
                "found no words; expected `{text: {text: …}}`",
            )),
            _ => Ok(()),
        }
    }

    fn run(&self, inputs: In, _want: &Want, _ctx: &Context) -> Result<Out, NodeError> {
        let colours = palette::of(&inputs.image.rgb, inputs.mask.as_deref(), self.colours);
        let names: Vec<&str> = colours.iter().map(|colour| colour.name).collect();
        let palette: Vec<_> = colours
            .iter()
            .map(|colour| json!({"name": colour.name, "share": colour.share, "srgb": colour.srgb}))
            .collect();
        let report = json!({
            "prompt": self.text(&names.join(", ")),
            "title": self.title,
            "tradition": self.tradition,
            "medium": self.medium,
            "palette": palette,
        });
        Ok(Out {
            prompt: Arc::new(Report(report)),
        })
    }
}

impl Prompt {
    fn text(&self, palette: &str) -> String {
        let keep = "Keep every contour, the pose, the framing and the size exactly as they are.";
        let made = |what: &str| format!("{what} of exactly what this painting shows. {keep} Plain background.");
        match &self.purpose {
            Purpose::Sculpture => made("A marble sculpture, matte, lit softly from the upper left, without colour,"),
            Purpose::PencilSketch => made("A shaded pencil sketch, with tone that follows the form,"),
            Purpose::Woodcut => made("A woodcut, with black hatching that follows the form,"),
            Purpose::Appearance => self.appearance(palette, keep),
            Purpose::Text { text } => text
                .replace("{title}", &self.title)
                .replace("{tradition}", &self.tradition)
                .replace("{medium}", &self.medium)
                .replace("{palette}", palette),
        }
    }

    /// What is not known is not mentioned.
    fn appearance(&self, palette: &str, keep: &str) -> String {
        let part = |before: &str, text: &str| match text {
            "" => String::new(),
            text => format!("{before}{text}"),
        };
        let painting = match self.title.as_str() {
            "" => "the painting".to_owned(),
            title => format!("the painting “{title}”"),
        };
        format!(
            "This is a rendering of a scene made from {painting}{}{}. Restore the painting's own look: its brushwork, its \
             lines and its surface{}. {keep} Add nothing and remove nothing.",
            part(", ", &self.tradition),
            part(", ", &self.medium),
            part(", in its palette of ", palette),
        )
    }
}

/// Adds the node to a registry.
pub fn register(registry: &mut Registry) {
    registry.node::<Prompt>();
}

#[cfg(test)]
mod tests {
    use gear_graph::testing;
    use gear_image::SrgbImage;

    use super::*;

    fn painting() -> Arc<Image> {
        Arc::new(Image {
            rgb: SrgbImage::from_fn(
                40,
                20,
                |x, _| if x < 30 { [0.76, 0.2, 0.13] } else { [0.95, 0.92, 0.82] },
            ),
            alpha: None,
        })
    }

    fn prompt(node: &Prompt) -> serde_json::Value {
        let inputs = In {
            image: painting(),
            mask: None,
        };
        let out = node.run(inputs, &Want::all::<Out>(), &Context::detached()).unwrap();
        out.prompt.0.clone()
    }

    fn node(purpose: Purpose) -> Prompt {
        Prompt {
            purpose,
            ..Prompt::default()
        }
    }

    #[test]
    fn what_is_recorded_and_measured_is_said() {
        let node = Prompt {
            title: "Night".into(),
            tradition: "Pahari".into(),
            medium: "opaque watercolour on paper".into(),
            ..Prompt::default()
        };
        insta::assert_json_snapshot!(prompt(&node));
    }

    #[test]
    fn what_is_not_known_is_not_mentioned() {
        let said = prompt(&node(Purpose::Appearance));
        let said = said["prompt"].as_str().unwrap();
        assert!(
            !said.contains("“”") && !said.contains(", ,") && !said.contains(", ."),
            "{said}"
        );
    }

    #[test]
    fn places_of_a_text_are_filled() {
        let text = Purpose::Text {
            text: "{title}|{palette}".into(),
        };
        assert_eq!(prompt(&node(text))["prompt"], "|vermilion, ivory");
        assert!(node(Purpose::Text { text: " ".into() }).check().is_err());
    }

    #[test]
    fn the_kit_finds_nothing() {
        testing::assert_pure(&Prompt::default(), || In {
            image: painting(),
            mask: None,
        });
    }
}
