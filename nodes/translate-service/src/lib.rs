//! TranslateService: the geometry-friendly version of a painting, from an image-editing service.
//!
//! It has the ports of Translate, so one line of a graph swaps them. The paper asks a text-guided translator with the
//! edge map as its control; here the protocol decides what the service gets: `images/edits` takes the painting and the
//! prompt, a ComfyUI workflow may use the edge map too. The answer is brought back to the painting's size; one that lost
//! the painting's contours is an error.

use std::sync::Arc;

use gear_graph::{
    Context, Demand, Inputs, Known, Lazy, Node, NodeError, Outputs, Params, Registry, Report, Resources, Want, Wanted,
};
use gear_image::{Field, Image, Mask, filter};
use gear_service::{Asked, Editor, Kind, Patience, Service, Services};
use serde_json::json;

/// A geometry-friendly picture of the painting, by an image-editing service.
#[derive(Clone, Debug, Params)]
pub struct TranslateService {
    /// The protocol; address, model and key are in the environment.
    #[param(default = Service::images())]
    pub service: Service,
    /// What is asked for, if nothing is wired to `prompt`.
    #[param(default = "A marble sculpture of exactly what this painting shows. Keep every contour, the pose, the framing and the size exactly as they are. Plain background.".to_owned())]
    pub prompt: String,
    /// The seed; answers are kept under it.
    #[param(default = 0, range = 0..=1_000_000_000)]
    pub seed: u64,
    /// The least agreement of the answer's contours with the painting's, -1 to 1.
    #[param(default = 0.15, range = -1.0..=1.0)]
    pub agreement: f64,
    /// How patient it is with the service.
    #[param(flatten)]
    pub patience: Patience,
}

/// Input ports.
#[derive(Inputs)]
pub struct In {
    /// The painting.
    pub image: Arc<Image>,
    /// Contour strength in [0, 1], for workflows that have a place for it.
    pub edges: Option<Lazy<Field>>,
    /// Where the picture may change, for services that are told (`send_mask`).
    pub mask: Option<Lazy<Mask>>,
    /// A report with a text `prompt`, such as from Prompt.
    pub prompt: Option<Arc<Report>>,
    /// A ComfyUI workflow in its API format.
    pub workflow: Option<Arc<Report>>,
}

/// Output ports.
#[derive(Outputs)]
pub struct Out {
    /// The translated picture, the size of the painting.
    pub image: Arc<Image>,
    /// The prompt, the model that answered, how far the contours agree.
    pub report: Wanted<Report>,
}

impl Node for TranslateService {
    const NAME: &str = "TranslateService";
    const VERSION: u32 = 1;
    const DETERMINISTIC: bool = false;
    const KEPT: bool = true;
    type Inputs = In;
    type Outputs = Out;

    fn realm(&self, resources: &Resources) -> String {
        Services::lent(resources).realm(self.service.kind())
    }

    fn demand(&self, _output: &str, known: &Known<'_>) -> Result<Demand, NodeError> {
        let ports: &[_] = match self.service.kind() {
            Kind::ComfyUi => &["edges"],
            _ if self.service.takes_mask() => &["mask"],
            _ => &[],
        };
        Ok(match known.need(ports, "the service is told") {
            Demand::Ready { .. } => Demand::ready_because("the service is told nothing more"),
            need => need,
        })
    }

    fn run(&self, inputs: In, want: &Want, ctx: &Context) -> Result<Out, NodeError> {
        let painting = inputs.image;
        if painting.rgb.is_empty() {
            return Err(NodeError::input("image", "it has no pixels; expected a picture"));
        }
        let prompt = gear_service::words(inputs.prompt.as_deref(), &self.prompt)?;
        let (width, height) = painting.size();
        let mask = inputs.mask.as_ref().and_then(Lazy::get);
        let inside = mask.map(|mask| filter::resize_mask(mask, width, height));
        let interrupted = || ctx.is_cancelled();
        let workflow = inputs.workflow.as_deref().map(|workflow| &workflow.0);
        let editor = Editor::open(&self.service, workflow, self.patience.policy(), ctx, &interrupted)?;
        ctx.progress_with(0.0, "waiting for the service");
        let edited = editor.edit(&Asked {
            picture: &painting.rgb,
            edges: inputs.edges.as_ref().and_then(Lazy::get).map(|edges| &**edges),
            inside: inside.as_ref(),
            prompt: &prompt,
            seed: self.seed,
            agreement: self.agreement,
            name: "translation",
        })?;
        let asked = Services::lent(ctx.resources()).realm(self.service.kind());
        let report = json!({
            "prompt": prompt,
            "seed": self.seed,
            "asked": asked,
            "answered": edited.model,
            "agreement": edited.agreement,
        });
        Ok(Out {
            image: Arc::new(Image {
                rgb: edited.picture,
                alpha: painting.alpha.clone(),
            }),
            report: want.compute("report", || Report(report)),
        })
    }
}

/// Adds the node to a registry.
pub fn register(registry: &mut Registry) {
    registry.node::<TranslateService>();
}

#[cfg(test)]
mod tests {
    use gear_image::SrgbImage;
    use gear_service::testing::{Server, Studio};
    use gear_service::{Endpoint, Kind};

    use super::*;

    fn painting() -> Arc<Image> {
        Arc::new(Image {
            rgb: SrgbImage::from_fn(40, 32, |x, y| {
                if (x / 10 + y / 8) % 2 == 0 {
                    [0.8, 0.3, 0.2]
                } else {
                    [0.2, 0.3, 0.7]
                }
            }),
            alpha: Some(Field::filled(40, 32, 0.5)),
        })
    }

    fn run(server: &Server, prompt: Option<serde_json::Value>) -> Result<Out, NodeError> {
        run_as(&TranslateService::default(), server, prompt)
    }

    fn run_as(node: &TranslateService, server: &Server, prompt: Option<serde_json::Value>) -> Result<Out, NodeError> {
        let endpoint = Endpoint::new(&server.url(), "sculptor", None).unwrap();
        let services = Services::default().with(Kind::Images, endpoint);
        let ctx = Context::detached().with_resources(Resources::default().with(services));
        let inputs = In {
            image: painting(),
            edges: None,
            mask: Some(Lazy::given(Mask::from_fn(20, 16, |x, _| x < 10))),
            prompt: prompt.map(|prompt| Arc::new(Report(prompt))),
            workflow: None,
        };
        node.run(inputs, &Want::all::<Out>(), &ctx)
    }

    #[test]
    fn the_answer_is_the_picture_and_the_report_says_whose() {
        let studio = Studio::new(|mut picture| {
            picture.data_mut().iter_mut().for_each(|pixel| *pixel = [pixel[0]; 3]);
            picture
        });
        let server = Server::start(move |asked| studio.answer(asked));
        let out = run(&server, Some(json!({"prompt": "as marble"}))).unwrap();
        assert_eq!((out.image.size(), out.image.alpha.is_some()), ((40, 32), true));
        let report = out.report.get().unwrap();
        assert_eq!(
            (&report.0["prompt"], &report.0["answered"]),
            (&json!("as marble"), &json!("sculptor-2026"))
        );
        assert_eq!(server.received()[0].field("prompt").unwrap(), b"as marble");
        let endpoint = Endpoint::new(&server.url(), "sculptor", None).unwrap();
        let services = Resources::default().with(Services::default().with(Kind::Images, endpoint));
        assert_eq!(TranslateService::default().realm(&services), "service:sculptor");
    }

    #[test]
    fn where_the_picture_may_change_is_told_to_those_who_want_to_know() {
        let studio = Studio::new(|picture| picture);
        let server = Server::start(move |asked| studio.answer(asked));
        run(&server, None).unwrap();
        assert_eq!(server.received()[0].field("mask"), None, "not every service knows it");
        let given = json!({"service": {"images": {"send_mask": true}}});
        let told: TranslateService = gear_graph::testing::read(&given).unwrap();
        run_as(&told, &server, None).unwrap();
        let png = server.received()[1].field("mask").unwrap();
        let sent = gear_image::io::decode_image(&mut std::io::Cursor::new(png), None, &Default::default()).unwrap();
        assert_eq!(sent.image.size(), (40, 32), "the picture's size");
        let alpha = sent.image.alpha.unwrap();
        assert_eq!(
            (alpha.at(4, 8), alpha.at(30, 8)),
            (0.0, 1.0),
            "transparent where it may change"
        );
    }

    #[test]
    fn only_what_the_service_is_told_is_computed() {
        let asked = |service: serde_json::Value| {
            let node: TranslateService = gear_graph::testing::read(&json!({ "service": service })).unwrap();
            match node.demand("image", &Known::of::<In>(Vec::new())).unwrap() {
                Demand::Need { ports, .. } => ports,
                Demand::Ready { .. } => Vec::new(),
            }
        };
        assert_eq!(asked(json!("images")), [""; 0]);
        assert_eq!(asked(json!({"images": {"send_mask": true}})), ["mask"]);
        assert_eq!(asked(json!("comfy-ui")), ["edges"]);
    }

    #[test]
    fn a_prompt_that_is_none_is_refused() {
        let server = Server::start(|_| gear_service::testing::Reply::json(500, ""));
        let error = run(&server, Some(json!({"text": 1}))).err().unwrap().to_string();
        assert!(error.contains("`prompt`"), "{error}");
        assert!(server.received().is_empty());
    }
}
