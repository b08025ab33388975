//! EditService: appearance targets from an image-editing service (the paper's D(R_k, T_a)).
//!
//! It has the ports of Edit, so one line of a graph swaps them. Every view is sent with the prompt; its answer, brought
//! back to the view's size, is the target where the scene covers the view, white elsewhere. A view that looks along the
//! painter's own rays is not sent: there the painting is the target. Answers that came before a run was interrupted are
//! kept and not asked for again.

use std::sync::Arc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use gear_graph::{Context, Inputs, Node, NodeError, Outputs, Params, Registry, Report, Resources, Want, Wanted};
use gear_image::{Field, Image, Mask, SrgbImage, colour, filter};
use gear_service::{Asked, Edited, Editor, Patience, Policy, Service, ServiceError, Services};
use gear_splat::{Scene, View, Views};
use serde_json::json;

/// Whole pixels from a view to the painting.
type Offset = (isize, isize);

/// Coverage below which nothing is seen in 8 bits.
const SEEN: f32 = 1.0 / 255.0;

/// Appearance targets: every view with the painting's look, by an image-editing service.
#[derive(Clone, Debug, Params)]
pub struct EditService {
    /// The protocol; address, model and key are in the environment.
    #[param(default = Service::images())]
    pub service: Service,
    /// What is asked for, if nothing is wired to `prompt`.
    #[param(default = "Restore the look of the painting that this rendering was made from: its brushwork, lines and palette. Keep every contour, the pose, the framing and the size exactly as they are.".to_owned())]
    pub prompt: String,
    /// The seed; the same for every view. Answers are kept under it.
    #[param(default = 0, range = 0..=1_000_000_000)]
    pub seed: u64,
    /// Trust in what the service painted, where the painting itself counts 1.
    #[param(default = 0.5, range = 0.0..=1.0)]
    pub trust: f64,
    /// The least agreement of an answer's contours with the view's, -1 to 1.
    #[param(default = 0.3, range = -1.0..=1.0)]
    pub agreement: f64,
    /// Requests that are out at a time.
    #[param(default = 2, range = 1..=64)]
    pub at_a_time: usize,
    /// How patient it is with the service.
    #[param(flatten)]
    pub patience: Patience,
}

/// Input ports.
#[derive(Inputs)]
pub struct In {
    /// Rendered views with coverage.
    pub views: Arc<Views>,
    /// The scene that they show, with its canonical camera.
    pub scene: Arc<Scene>,
    /// The painting.
    pub painting: Arc<Image>,
    /// What of the painting is the subject.
    pub mask: Arc<Mask>,
    /// A report with a text `prompt`, such as from Prompt.
    pub prompt: Option<Arc<Report>>,
    /// A ComfyUI workflow in its API format.
    pub workflow: Option<Arc<Report>>,
}

/// Output ports.
#[derive(Outputs)]
pub struct Out {
    /// The views with edited colours and a weight for every pixel; the rest as it came.
    pub targets: Arc<Views>,
    /// The prompt, and for every view the model that answered and how far the contours agree.
    pub report: Wanted<Report>,
}

impl Node for EditService {
    const NAME: &str = "EditService";
    const VERSION: u32 = 1;
    const DETERMINISTIC: bool = false;
    const KEPT: bool = true;
    type Inputs = In;
    type Outputs = Out;

    fn realm(&self, resources: &Resources) -> String {
        Services::lent(resources).realm(self.service.kind())
    }

    fn run(&self, inputs: In, want: &Want, ctx: &Context) -> Result<Out, NodeError> {
        let prompt = gear_service::words(inputs.prompt.as_deref(), &self.prompt)?;
        let views = &inputs.views.views;
        for view in views {
            if view.alpha.as_ref().is_none_or(|alpha| alpha.size() != view.rgb.size()) {
                let problem = format!(
                    "view `{}` has no coverage; render the views with all channels",
                    view.name
                );
                return Err(NodeError::input("views", problem));
            }
        }
        let policy = Policy {
            at_a_time: self.at_a_time,
            ..self.patience.policy()
        };
        let interrupted = || ctx.is_cancelled();
        let workflow = inputs.workflow.as_deref().map(|workflow| &workflow.0);
        let editor = Editor::open(&self.service, workflow, policy, ctx, &interrupted)?;
        let (longer, camera) = (inputs.painting.rgb.longer_side() as u32, inputs.scene.canonical_camera);
        let painter = camera.map(|camera| camera.resized(longer));
        let fronts: Vec<Option<Offset>> = views
            .iter()
            .map(|view| painter.and_then(|painter| view.camera.offset_to(&painter)))
            .collect();
        let names: Vec<String> = views
            .iter()
            .enumerate()
            .map(|(i, view)| format!("{i} {}", view.name))
            .collect();
        let (width, height) = inputs.painting.rgb.size();
        let mask = filter::resize_mask(&inputs.mask, width, height);
        let answers = self.ask(&editor, views, &fronts, &names, &prompt, ctx)?;

        let mut targets = Vec::with_capacity(views.len());
        let mut told = Vec::with_capacity(views.len());
        for ((view, front), answer) in views.iter().zip(&fronts).zip(answers) {
            match (answer, front) {
                (Some(edited), _) => {
                    targets.push(self.target(view, &edited.picture));
                    told.push(json!({"view": view.name, "answered": edited.model, "agreement": edited.agreement}));
                }
                (None, front) => {
                    let offset = front.unwrap_or_default();
                    targets.push(self.front(view, &inputs.painting.rgb, &mask, offset));
                    told.push(json!({"view": view.name, "answered": "the painting itself"}));
                }
            }
        }
        let asked = Services::lent(ctx.resources()).realm(self.service.kind());
        let report = json!({"prompt": prompt, "seed": self.seed, "asked": asked, "views": told});
        Ok(Out {
            targets: Arc::new(Views { views: targets }),
            report: want.compute("report", || Report(report)),
        })
    }
}

impl EditService {
    /// Asks for every view but those of the painter, on threads of their own: waiting is no work for the pool.
    fn ask(
        &self,
        editor: &Editor<'_>,
        views: &[View],
        fronts: &[Option<Offset>],
        names: &[String],
        prompt: &str,
        ctx: &Context,
    ) -> Result<Vec<Option<Edited>>, NodeError> {
        let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let answers: Mutex<Vec<Option<Result<Edited, ServiceError>>>> =
            Mutex::new(views.iter().map(|_| None).collect());
        let failed = || {
            let answers = answers.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            answers.iter().flatten().any(Result::is_err)
        };
        let work = || {
            loop {
                let i = next.fetch_add(1, Ordering::Relaxed);
                if i >= views.len() || failed() {
                    return;
                }
                if fronts[i].is_some() {
                    continue;
                }
                let inside = self.service.takes_mask().then(|| covered(&views[i]));
                let answer = editor.edit(&Asked {
                    picture: &views[i].rgb,
                    edges: None,
                    inside: inside.as_ref(),
                    prompt,
                    seed: self.seed,
                    agreement: self.agreement,
                    name: &names[i],
                });
                let so_far = done.fetch_add(1, Ordering::Relaxed) + 1;
                ctx.progress_with(so_far as f64 / views.len() as f64, format!("{so_far} views answered"));
                answers.lock().unwrap_or_else(std::sync::PoisonError::into_inner)[i] = Some(answer);
            }
        };
        std::thread::scope(|scope| {
            for _ in 0..self.at_a_time.min(views.len()) {
                scope.spawn(work);
            }
        });
        let answers = answers.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        let named = |(i, answer): (usize, Option<Result<Edited, ServiceError>>)| match answer {
            Some(Ok(edited)) => Ok(Some(edited)),
            Some(Err(error @ ServiceError::Interrupted)) => Err(error.into()),
            Some(Err(error)) => Err(NodeError::because(
                format!("view `{}` was not edited", views[i].name),
                error,
            )),
            None => Ok(None),
        };
        answers.into_iter().enumerate().map(named).collect()
    }

    /// The painting on its mask, white beyond it; in the fringe that the scene spreads beyond the mask nothing is sure.
    fn front(&self, view: &View, painting: &SrgbImage, mask: &Mask, (dx, dy): Offset) -> View {
        let (width, height) = view.rgb.size();
        let place = |x: usize, y: usize| {
            let (x, y) = (x.checked_add_signed(dx)?, y.checked_add_signed(dy)?);
            (x < mask.width() && y < mask.height() && mask.at(x, y)).then_some((x, y))
        };
        let rgb = SrgbImage::from_fn(width, height, |x, y| {
            place(x, y).map_or([1.0; 3], |(x, y)| painting.at(x, y).map(colour::sanitise_sample))
        });
        let weight = Field::from_fn(width, height, |x, y| {
            let covered = view.alpha.as_ref().is_some_and(|alpha| alpha.at(x, y) > SEEN);
            if place(x, y).is_none() && covered {
                self.trust as f32
            } else {
                1.0
            }
        });
        View {
            rgb,
            weight: Some(weight),
            ..view.clone()
        }
    }

    /// The answer where the scene is, white elsewhere.
    fn target(&self, view: &View, answer: &SrgbImage) -> View {
        let (width, height) = view.rgb.size();
        let cover = |x: usize, y: usize| view.alpha.as_ref().map_or(1.0, |alpha| alpha.at(x, y)).clamp(0.0, 1.0);
        let rgb = SrgbImage::from_fn(width, height, |x, y| {
            let (alpha, pixel) = (cover(x, y), answer.at(x, y));
            pixel.map(|c| 1.0 + alpha * (c.clamp(0.0, 1.0) - 1.0))
        });
        // Where nothing is, nothing was asked for: white is certain.
        let weight = Field::from_fn(
            width,
            height,
            |x, y| {
                if cover(x, y) > SEEN { self.trust as f32 } else { 1.0 }
            },
        );
        View {
            rgb,
            weight: Some(weight),
            ..view.clone()
        }
    }
}

/// Where the scene is.
fn covered(view: &View) -> Mask {
    let (width, height) = view.rgb.size();
    Mask::from_fn(width, height, |x, y| {
        view.alpha.as_ref().is_none_or(|alpha| alpha.at(x, y) > SEEN)
    })
}

/// Adds the node to a registry.
pub fn register(registry: &mut Registry) {
    registry.node::<EditService>();
}

#[cfg(test)]
mod tests;
