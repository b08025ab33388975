//! The one mask: what of a picture is figure, what is ground.
//!
//! Made from the original painting and wired to everyone who needs it: later pictures have shifted colours. A mask
//! that the user gives comes first; then a rough box; else the figure is searched for before the ground
//! that the picture's rim shows (colour models and a minimum cut: Rother et al., *GrabCut*, 2004; see
//! `gear_relief::mask`), or a saliency network is asked, such as U²-Net. When no figure can be trusted the whole canvas is
//! the subject, and the mask is full.

use std::sync::Arc;

use gear_graph::{
    Choice, Context, Demand, Inputs, Known, Lazy, Node, NodeError, Outputs, Params, Registry, Report, Resources, Want,
    Wanted,
};
use gear_image::{Field, Image, Mask};
use gear_onnx::{Given, Model, Provider};
use gear_relief::mask::{self, Found, Mode, Settings};
use serde_json::json;

/// The figure in front of its ground, or the whole canvas when none can be told apart.
///
/// Give a mask file or a rough box where the automatic mask is wrong: the mask decides the result more than
/// anything after it.
#[derive(Clone, Debug, Params)]
pub struct Foreground {
    /// Where the mask comes from when none is given at the `mask` port.
    #[param(default = Method::Auto)]
    pub method: Method,

    /// Rounds of colour models and cut.
    #[param(default = 5, range = 1..=20)]
    pub iterations: u32,

    /// Price of a boundary through flat colour; higher is smoother.
    #[param(default = 8.0, range = 0.0..=100.0, unit = "nats a pixel")]
    pub smoothness: f64,

    /// Gaussians in each colour model.
    #[param(default = 5, range = 1..=16)]
    pub components: u32,

    /// Longer side at which figure and ground are told apart; only the boundary is found at full size.
    #[param(default = 384, range = 32..=2048, unit = "px")]
    pub working_size: u32,

    /// An automatic mask with less confidence becomes the whole canvas.
    #[param(default = 0.5, range = 0.0..=1.0)]
    pub least_confidence: f64,
}

/// Where a mask comes from.
#[derive(Clone, Debug, PartialEq, Choice)]
pub enum Method {
    /// Searched for, from the colours of the rim.
    Auto,
    /// Searched for inside a rough box, shares of width and height from the upper left corner.
    Box {
        /// Left.
        #[param(default = 0.1, range = 0.0..=1.0, unit = "share of the width")]
        x0: f64,
        /// Top.
        #[param(default = 0.1, range = 0.0..=1.0, unit = "share of the height")]
        y0: f64,
        /// Right.
        #[param(default = 0.9, range = 0.0..=1.0, unit = "share of the width")]
        x1: f64,
        /// Bottom.
        #[param(default = 0.9, range = 0.0..=1.0, unit = "share of the height")]
        y1: f64,
    },
    /// The whole canvas.
    Relief,
    /// What a saliency network takes for figure, its boundary cut anew; its declaration says `answer: saliency`. A
    /// degenerate answer (nothing, everything, undecided, in crumbs) becomes the whole canvas.
    Network {
        /// What computes it.
        #[param(default = Provider::Cpu)]
        provider: Provider,
    },
}

/// Input ports.
#[derive(Inputs)]
pub struct In {
    /// The original painting.
    pub image: Arc<Image>,
    /// The user's own mask, of any size.
    pub mask: Option<Arc<Mask>>,
    /// The network, for the method `network`; not asked where a mask is given.
    pub model: Option<Lazy<Model>>,
}

/// Output ports.
#[derive(Outputs)]
pub struct Out {
    /// The figure, the picture's size; full for a whole-canvas relief.
    pub mask: Wanted<Mask>,
    /// Confidence (null where nothing was measured: for a given mask, a box, and the method `relief`), mode (`figure`,
    /// `relief`, `given`, `box`), share of the canvas, and what was doubted.
    pub report: Wanted<Report>,
}

impl Node for Foreground {
    const NAME: &str = "Foreground";
    const VERSION: u32 = 3;
    type Inputs = In;
    type Outputs = Out;

    fn check(&self) -> Result<(), NodeError> {
        match self.method {
            Method::Box { x0, y0, x1, y1 } if x0 >= x1 || y0 >= y1 => Err(NodeError::param(
                "method",
                format!("the box {x0}, {y0} to {x1}, {y1} is empty; give x0 < x1 and y0 < y1"),
            )),
            _ => Ok(()),
        }
    }

    fn realm(&self, resources: &Resources) -> String {
        match self.method {
            Method::Network { provider } => gear_onnx::realm(resources, provider),
            _ => "cpu".to_owned(),
        }
    }

    fn demand(&self, _output: &str, known: &Known<'_>) -> Result<Demand, NodeError> {
        match self.method {
            Method::Network { .. } if known.is_wired("mask") => Ok(Demand::ready_because("a mask is given")),
            Method::Network { .. } => gear_onnx::demand(known),
            _ => Ok(Demand::ready_because("the method is no network")),
        }
    }

    fn run(&self, inputs: In, want: &Want, ctx: &Context) -> Result<Out, NodeError> {
        let (width, height) = inputs.image.size();
        ctx.checkpoint()?;
        if let Some(given) = &inputs.mask {
            for note in oddities(given, width, height) {
                ctx.note(note);
            }
        }
        let found = match (&inputs.mask, &self.method) {
            (Some(given), _) => mask::given(given, width, height),
            (None, Method::Relief) => mask::relief(width, height),
            (None, Method::Box { x0, y0, x1, y1 }) => {
                mask::in_box(&inputs.image.rgb, [*x0, *y0, *x1, *y1], &self.settings())
            }
            (None, Method::Auto) => mask::automatic(&inputs.image.rgb, &self.settings()),
            (None, Method::Network { provider }) => {
                let saliency = saliency(&inputs, *provider, ctx)?;
                mask::from_saliency(&inputs.image.rgb, &saliency, &self.settings())
            }
        };
        if matches!(self.method, Method::Network { .. }) && found.mode == Mode::Relief && inputs.mask.is_none() {
            ctx.note("the network's answer is no figure that can be trusted; the whole canvas is used");
        }
        if let Some(note) = faint(&found) {
            ctx.note(note);
        }
        if inputs.mask.is_none() && self.method == Method::unspecified_box() {
            ctx.note(
                "the box was not said and is 0.1, 0.1 to 0.9, 0.9 of the picture; \
                 method={box: {x0: …, y0: …, x1: …, y1: …}} says where the figure is",
            );
        }
        let report = want.try_compute("report", || Report::new(describe(&found)))?;
        Ok(Out {
            mask: want.compute("mask", || found.mask),
            report,
        })
    }
}

impl Foreground {
    fn settings(&self) -> Settings {
        Settings {
            iterations: self.iterations as usize,
            smoothness: self.smoothness,
            components: self.components as usize,
            working_size: self.working_size as usize,
            least_confidence: self.least_confidence,
        }
    }
}

impl Method {
    /// The box of someone who asked for one and did not say where.
    fn unspecified_box() -> Self {
        Self::Box {
            x0: 0.1,
            y0: 0.1,
            x1: 0.9,
            y1: 0.9,
        }
    }
}

/// An automatic figure with less confidence is used, but not without a word.
const SURE: f64 = 0.7;

/// What a user should hear about a figure that was found with little confidence: what lies outside it is lost.
fn faint(found: &Found) -> Option<String> {
    let confidence = found.confidence.filter(|c| *c < SURE && found.mode == Mode::Figure)?;
    Some(format!(
        "a figure was told apart with confidence {confidence:.2} only; it fills {:.0} % of the canvas, and the rest is left out \
         of the scene: look at the mask. If it is wrong, method=relief keeps the whole canvas, and a mask or a box says where \
         the figure is",
        100.0 * found.share()
    ))
}

/// What the network takes for figure, 0 to 1.
fn saliency(inputs: &In, provider: Provider, ctx: &Context) -> Result<Field, NodeError> {
    let model = gear_onnx::required(&inputs.model)?;
    model.declaration().expect(&["saliency"])?;
    let given = Given {
        rgb: &inputs.image.rgb,
        planes: &[],
    };
    let mut fields = gear_onnx::answer(model, provider, given, ctx)?;
    // An answer has as many fields as it declares: one.
    Ok(fields.swap_remove(0))
}

/// What a user should hear about the mask that was given for a picture of this size.
fn oddities(mask: &Mask, width: usize, height: usize) -> Vec<String> {
    let mut odd = Vec::new();
    let inside = mask.count();
    if inside == 0 {
        odd.push("the mask is empty (black everywhere, and white is inside); the whole canvas is used".to_owned());
    } else if inside < mask.len() && mask::given(mask, width, height).mode == Mode::Relief {
        odd.push("nothing of the mask is left at the painting's size; the whole canvas is used".to_owned());
    }
    if looks_inverted(mask) {
        odd.push(
            "the mask takes in the picture's rim and leaves out what it surrounds; white is the figure: is it inverted?".to_owned(),
        );
    }
    // Half a pixel either way, in both: what rounding to whole pixels can make of equal proportions.
    let (mw, mh) = mask.size();
    let [w, h, across, down] = [width, height, mw, mh].map(|n| n as f64);
    let slack = 0.01 + 0.5 * (1.0 / w + 1.0 / h + 1.0 / across + 1.0 / down);
    if ((w * down) / (h * across)).max((h * across) / (w * down)) > 1.0 + slack {
        odd.push(format!(
            "the mask's proportions ({mw}x{mh}) differ from the painting's ({width}x{height}); it is stretched to fit"
        ));
    }
    odd
}

/// Whether a mask holds nearly all of the rim and leaves a good part of the middle out: a figure in the negative.
fn looks_inverted(mask: &Mask) -> bool {
    let (w, h) = mask.size();
    let rim = |x: usize, y: usize| x == 0 || y == 0 || x + 1 == w || y + 1 == h;
    let (mut on_rim, mut held) = (0usize, 0usize);
    for (x, y) in (0..h)
        .flat_map(|y| (0..w).map(move |x| (x, y)))
        .filter(|&(x, y)| rim(x, y))
    {
        on_rim += 1;
        held += usize::from(mask.at(x, y));
    }
    held * 10 > on_rim * 9 && mask.count() * 20 < mask.len() * 19
}

fn describe(found: &Found) -> serde_json::Value {
    let mut report = json!({
        "mode": found.mode.name(),
        "confidence": found.confidence,
        "share": found.share(),
        "frame": found.frame,
    });
    if let Some(d) = found.doubts {
        report["measured"] = json!({
            "rim": d.rim, "main": d.main, "thick": d.thick, "fill": d.fill, "boxy": d.boxy, "edges": d.edges,
            "explained": d.explained, "sides": d.sides, "told_apart": d.told_apart, "busy": d.busy, "spanned": d.spanned,
        });
    }
    report
}

/// Makes the node known.
pub fn register(registry: &mut Registry) {
    registry.node::<Foreground>();
}

#[cfg(test)]
mod tests {
    use super::*;
    use gear_graph::{Value, testing};
    use gear_sample::{Options, paint};

    fn vessel() -> gear_sample::Sample {
        paint(
            "vessel",
            &Options {
                longer_side: 160,
                ..Options::default()
            },
        )
        .unwrap()
    }

    fn inputs(image: Image, mask: Option<Mask>) -> In {
        In {
            image: Arc::new(image),
            mask: mask.map(Arc::new),
            model: None,
        }
    }

    #[test]
    fn summary_of_a_sample() {
        let sample = vessel();
        let out = testing::run(&Foreground::default(), inputs(sample.painting, None)).unwrap();
        insta::assert_json_snapshot!("mask", out.mask.unwrap().summary());
        insta::assert_json_snapshot!("report", out.report.unwrap().summary());
    }

    #[test]
    fn an_answer_or_an_error_on_every_extreme_input() {
        testing::assert_extremes(&Foreground::default());
    }

    #[test]
    fn the_same_bits_on_any_number_of_threads() {
        let painting = vessel().painting;
        testing::assert_pure(&Foreground::default(), || inputs(painting.clone(), None));
    }

    #[test]
    fn a_given_mask_passes_at_the_picture_s_size() {
        let sample = vessel();
        let out = testing::run(
            &Foreground::default(),
            inputs(sample.painting.clone(), Some(sample.mask.clone())),
        )
        .unwrap();
        assert_eq!(*out.mask.unwrap(), sample.mask);
        let tiny = Mask::from_fn(8, 10, |x, _| x < 4);
        let out = testing::run(&Foreground::default(), inputs(sample.painting.clone(), Some(tiny))).unwrap();
        let mask = out.mask.unwrap();
        let (w, h) = sample.painting.size();
        assert_eq!(mask.size(), (w, h));
        assert!(mask.at(0, h / 2) && !mask.at(w - 1, h / 2));
    }

    #[test]
    fn an_odd_mask_is_told_of() {
        let told = |mask: Mask, width, height| oddities(&mask, width, height).join("; ");
        assert_eq!(told(Mask::from_fn(30, 40, |x, _| x < 9), 120, 160), "");
        // The same picture at two working sizes: sides are rounded.
        assert_eq!(told(Mask::filled(4096, 3001, true), 768, 563), "");
        assert!(told(Mask::filled(30, 40, false), 120, 160).contains("empty"));
        assert!(told(Mask::filled(40, 30, true), 120, 160).contains("proportions (40x30)"));
        let inverted = Mask::from_fn(30, 40, |x, y| !((8..22).contains(&x) && (5..35).contains(&y)));
        assert!(told(inverted, 120, 160).contains("inverted"));
        // A canvas with a stain left out, and a figure that stands on the lower rim.
        assert_eq!(told(Mask::from_fn(30, 40, |x, y| x + y > 6), 120, 160), "");
        assert_eq!(told(Mask::from_fn(30, 40, |x, _| x > 4 && x < 26), 120, 160), "");
        assert!(told(Mask::from_fn(900, 900, |x, y| x + y == 0), 90, 90).contains("nothing of the mask is left"));
    }

    #[test]
    fn a_figure_found_with_little_confidence_is_told_of() {
        let found = |confidence, mode| Found {
            confidence,
            mode,
            ..mask::relief(10, 10)
        };
        let said = faint(&found(Some(0.345), Mode::Figure)).unwrap();
        assert!(
            said.contains("0.34") && said.contains("100 %") && said.contains("method=relief"),
            "{said}"
        );
        assert_eq!(faint(&found(Some(0.8), Mode::Figure)), None);
        assert_eq!(faint(&found(Some(0.1), Mode::Relief)), None);
        assert_eq!(faint(&found(None, Mode::Given)), None);
    }

    #[test]
    fn a_box_that_was_not_said_is_told_of() {
        let node = Foreground {
            method: Method::unspecified_box(),
            ..Foreground::default()
        };
        let parsed: Foreground = testing::read(&json!({"method": "box"})).unwrap();
        assert_eq!(parsed.method, node.method);
    }

    #[test]
    fn relief_is_the_whole_canvas() {
        let node = Foreground {
            method: Method::Relief,
            ..Foreground::default()
        };
        let out = testing::run(&node, inputs(vessel().painting, None)).unwrap();
        assert!(out.mask.unwrap().is_full());
    }

    #[test]
    fn an_empty_box_is_refused() {
        let method = Method::Box {
            x0: 0.9,
            y0: 0.1,
            x1: 0.2,
            y1: 0.8,
        };
        assert!(
            Foreground {
                method,
                ..Foreground::default()
            }
            .check()
            .is_err()
        );
    }

    mod network {
        //! Networks that the tests make, and U²-Net where its file is.

        use super::*;
        use gear_onnx::Familiar;
        use gear_onnx::testing::{Net, can_run, model, shared, with};

        fn node() -> Foreground {
            let method = Method::Network {
                provider: Provider::Cpu,
            };
            Foreground {
                method,
                ..Foreground::default()
            }
        }

        fn asked(model: Model, image: Image) -> Out {
            let inputs = In {
                model: Some(Lazy::given(model)),
                ..inputs(image, None)
            };
            testing::run(&node(), inputs).unwrap()
        }

        fn mode(out: &Out) -> String {
            out.report.get().unwrap().summary()["mode"]
                .as_str()
                .unwrap_or_default()
                .to_owned()
        }

        /// A bright disc on dark ground, and which pixels it has.
        fn disc() -> (Image, Mask) {
            let inside = |x: usize, y: usize| x.abs_diff(60).pow(2) + y.abs_diff(50).pow(2) < 30 * 30;
            let colour = move |x, y| {
                if inside(x, y) {
                    [1.0, 0.9, 0.85]
                } else {
                    [0.02, 0.04, 0.08]
                }
            };
            let image = Image::opaque(gear_image::Rgb::from_fn(120, 100, colour));
            (image, Mask::from_fn(120, 100, inside))
        }

        #[test]
        fn what_the_network_takes_for_figure_is_the_mask() {
            if !can_run() {
                return;
            }
            let (image, truth) = disc();
            let found = asked(model(&Net::Mean), image);
            assert_eq!(mode(&found), "figure");
            let mask = found.mask.unwrap();
            let differ = mask.data().iter().zip(truth.data()).filter(|(a, b)| a != b).count();
            assert!(
                differ < truth.count() / 15,
                "{differ} of {} pixels differ",
                truth.count()
            );
        }

        #[test]
        fn a_degenerate_answer_is_the_whole_canvas() {
            if !can_run() {
                return;
            }
            let grey = |value: f32| Image::opaque(gear_image::Rgb::filled(120, 100, [value; 3]));
            let spots = |inside: fn(usize, usize) -> bool| {
                let colour = move |x, y| if inside(x, y) { [1.0; 3] } else { [0.0; 3] };
                Image::opaque(gear_image::Rgb::from_fn(120, 100, colour))
            };
            for (name, image) in [
                ("nothing", grey(0.0)),
                ("everything", grey(1.0)),
                ("undecided", grey(0.55)),
            ] {
                let found = asked(model(&Net::Mean), image);
                assert_eq!(mode(&found), "relief", "{name}");
                assert!(found.mask.unwrap().is_full());
            }
            let crumbs = spots(|x, y| x % 8 < 3 && y % 8 < 3);
            let speck = spots(|x, y| x + y < 6);
            for (name, image) in [("crumbs", crumbs), ("a speck", speck)] {
                assert_eq!(mode(&asked(model(&Net::Mean), image)), "relief", "{name}");
            }
        }

        #[test]
        fn a_given_mask_needs_no_network() {
            let (image, mask) = disc();
            let out = testing::run(&node(), inputs(image, Some(mask.clone()))).unwrap();
            assert_eq!(*out.mask.unwrap(), mask);
            let error = testing::run(&node(), inputs(disc().0, None)).err().unwrap();
            assert!(error.to_string().contains("model"), "{error}");
        }

        #[test]
        fn an_answer_or_an_error_on_every_extreme_input() {
            testing::assert_extremes(&node());
        }

        #[test]
        fn u2net_finds_the_vessel() {
            let Some(u2net) = shared("u2netp.onnx", Familiar::U2netp).filter(|_| can_run()) else {
                return;
            };
            let sample = vessel();
            let found = asked(u2net, sample.painting);
            assert_eq!(mode(&found), "figure");
            let mask = found.mask.unwrap();
            let both = mask
                .data()
                .iter()
                .zip(sample.mask.data())
                .filter(|(a, b)| **a && **b)
                .count();
            let either = mask.count() + sample.mask.count() - both;
            assert!(both * 10 > either * 8, "IoU {}", both as f64 / either as f64);
        }

        #[test]
        fn the_declaration_must_be_of_saliency() {
            let inputs = In {
                model: Some(Lazy::given(with(&Net::Mean, "network: 1\nanswer: edges\n"))),
                ..inputs(disc().0, None)
            };
            let error = testing::run(&node(), inputs).err().unwrap();
            assert!(
                error.to_string().contains("`answer: saliency` is needed here"),
                "{error}"
            );
        }
    }
}
