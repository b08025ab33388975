//! What image-editing nodes share: one picture sent through either protocol, its answer checked and brought back to the
//! picture's size.

use std::time::Duration;

use gear_graph::{Choice, Context, NodeError, Report};
use gear_image::{Field, Image, Mask, SrgbImage, io};
use serde_json::Value;

use crate::{
    Comfy, Endpoint, ImageEdit, Images, Job, Kind, Memory, Policy, ServiceError, Services, agreement, restored,
};

/// Which protocol the service speaks. Its address, model and key are in the environment.
#[derive(Clone, Debug, PartialEq, Choice)]
pub enum Service {
    /// OpenAI-compatible `images/edits` (`GEAR_IMAGES_URL`, `GEAR_IMAGES_MODEL`, `GEAR_IMAGES_KEY`).
    Images {
        /// The size that is asked for, as the service knows it; empty to say nothing.
        #[param(default = "auto".to_owned())]
        size: String,
        /// Say `response_format: b64_json`, for services that send links otherwise.
        #[param(default = false)]
        ask_for_bytes: bool,
        /// Send the seed; some services refuse fields that they do not know.
        #[param(default = false)]
        send_seed: bool,
        /// Send where the picture may change: the figure, as transparent pixels of the field `mask`.
        #[param(default = false)]
        send_mask: bool,
    },
    /// A ComfyUI server (`GEAR_COMFYUI_URL`, `GEAR_COMFYUI_MODEL`), with the workflow at the port `workflow`.
    ComfyUi {
        /// How often the server is asked whether a job is done.
        #[param(default = 1.0, range = 0.01..=60.0, unit = "s")]
        poll: f64,
        /// How long a job may take.
        #[param(default = 600.0, range = 1.0..=86_400.0, unit = "s")]
        patience: f64,
    },
}

impl Service {
    /// The default: `images`, as the protocol has it.
    pub fn images() -> Self {
        Self::Images {
            size: "auto".to_owned(),
            ask_for_bytes: false,
            send_seed: false,
            send_mask: false,
        }
    }

    /// Whether it is told where a picture may change.
    pub fn takes_mask(&self) -> bool {
        matches!(self, Self::Images { send_mask: true, .. })
    }

    /// The kind of service.
    pub fn kind(&self) -> Kind {
        match self {
            Self::Images { .. } => Kind::Images,
            Self::ComfyUi { .. } => Kind::ComfyUi,
        }
    }
}

/// One edit that is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Asked<'a> {
    /// The picture.
    pub picture: &'a SrgbImage,
    /// Its edge map, for workflows that have a place for it.
    pub edges: Option<&'a Field>,
    /// Where it may change, its size, for services that are told ([`Service::takes_mask`]).
    pub inside: Option<&'a Mask>,
    /// What is to be done.
    pub prompt: &'a str,
    /// The seed.
    pub seed: u64,
    /// The least [`agreement`] of contours that is accepted.
    pub agreement: f64,
    /// A name for the edit, unique in its node: its answer is kept under it until the node is done.
    pub name: &'a str,
}

/// An edit that came back.
#[derive(Clone, Debug)]
pub struct Edited {
    /// The picture, of the size of the one that was sent.
    pub picture: SrgbImage,
    /// The model that the answer names.
    pub model: Option<String>,
    /// How far the contours agree.
    pub agreement: f64,
    /// True if an earlier, interrupted run had the answer already.
    pub remembered: bool,
}

enum Way<'a> {
    Images {
        images: Images<'a>,
        size: String,
        ask_for_bytes: bool,
        send_seed: bool,
        send_mask: bool,
    },
    ComfyUi {
        comfy: Comfy<'a>,
        workflow: Value,
    },
}

/// The way to a service for one run of a node.
pub struct Editor<'a> {
    way: Way<'a>,
    memory: Memory<'a>,
}

impl<'a> Editor<'a> {
    /// Opens the way. `interrupted` is the context's, as a function that lives as long.
    pub fn open(
        service: &Service,
        workflow: Option<&Value>,
        policy: Policy,
        ctx: &'a Context,
        interrupted: &'a (dyn Fn() -> bool + Sync),
    ) -> Result<Self, NodeError> {
        let endpoint = endpoint(service.kind(), ctx)?;
        let way = match service {
            Service::Images {
                size,
                ask_for_bytes,
                send_seed,
                send_mask,
            } => Way::Images {
                images: Images::new(&endpoint, policy, interrupted),
                size: size.clone(),
                ask_for_bytes: *ask_for_bytes,
                send_seed: *send_seed,
                send_mask: *send_mask,
            },
            Service::ComfyUi { poll, patience } => Way::ComfyUi {
                comfy: Comfy::new(
                    &endpoint,
                    policy,
                    Duration::from_secs_f64(*poll),
                    Duration::from_secs_f64(*patience),
                    interrupted,
                ),
                workflow: workflow.cloned().ok_or_else(|| {
                    NodeError::input(
                        "workflow",
                        "found none; ComfyUI needs one: save it with Export (API) and give it as an input of type Report",
                    )
                })?,
            },
        };
        Ok(Self {
            way,
            memory: Memory::open(ctx),
        })
    }

    fn host(&self) -> &str {
        match &self.way {
            Way::Images { images, .. } => images.transport().endpoint().host(),
            Way::ComfyUi { comfy, .. } => comfy.transport().endpoint().host(),
        }
    }

    /// Asks for one edit, or takes the answer that an interrupted run had already.
    pub fn edit(&self, asked: &Asked<'_>) -> Result<Edited, ServiceError> {
        if let Some((bytes, model)) = self.memory.get(asked.name).and_then(|kept| unpack(&kept))
            && let Ok(mut edited) = self.check(asked, &bytes, model)
        {
            edited.remembered = true;
            return Ok(edited);
        }
        let (bytes, model) = self.ask(asked)?;
        let edited = self.check(asked, &bytes, model.clone())?;
        self.memory.keep(asked.name, pack(&bytes, model.as_deref()));
        Ok(edited)
    }

    fn ask(&self, asked: &Asked<'_>) -> Result<(Vec<u8>, Option<String>), ServiceError> {
        let png = |rgb: SrgbImage, alpha: Option<Field>| {
            io::png_bytes(&Image { rgb, alpha }).map_err(|problem| ServiceError::Unexpected {
                host: "this machine".to_owned(),
                found: problem,
                expected: "a picture that can be written as PNG".to_owned(),
            })
        };
        let image = png(asked.picture.clone(), None)?;
        match &self.way {
            Way::Images {
                images,
                size,
                ask_for_bytes,
                send_seed,
                send_mask,
            } => {
                // OpenAI's reference of images/edits: transparent pixels tell where the picture is to be edited.
                let kept = |inside: &Mask| {
                    let kept = inside.data().iter().map(|inside| f32::from(u8::from(!inside)));
                    let kept = Field::from_vec(inside.width(), inside.height(), kept.collect());
                    png(asked.picture.clone(), Some(kept))
                };
                let mask = asked.inside.filter(|_| *send_mask).map(kept).transpose()?;
                images.edit(&ImageEdit {
                    image: &image,
                    mask: mask.as_deref(),
                    prompt: asked.prompt,
                    size,
                    seed: send_seed.then_some(asked.seed),
                    ask_for_bytes: *ask_for_bytes,
                })
            }
            Way::ComfyUi { comfy, workflow } => {
                let grey = |edges: &Field| {
                    let tones = edges
                        .data()
                        .iter()
                        .map(|&e| [if e.is_finite() { e.clamp(0.0, 1.0) } else { 0.0 }; 3]);
                    SrgbImage::from_vec(edges.width(), edges.height(), tones.collect())
                };
                let edges = asked.edges.map(|edges| png(grey(edges), None)).transpose()?;
                let bytes = comfy.run(&Job {
                    workflow,
                    image: &image,
                    edges: edges.as_deref(),
                    prompt: asked.prompt,
                    seed: asked.seed,
                })?;
                Ok((bytes, None))
            }
        }
    }

    fn check(&self, asked: &Asked<'_>, bytes: &[u8], model: Option<String>) -> Result<Edited, ServiceError> {
        let picture = restored(bytes, asked.picture.size(), self.host())?;
        let found = agreement(asked.picture, &picture);
        if found < asked.agreement {
            return Err(ServiceError::Layout {
                found,
                least: asked.agreement,
            });
        }
        Ok(Edited {
            picture,
            model: model.map(|model| model.chars().filter(|c| !c.is_control()).take(200).collect()),
            agreement: found,
            remembered: false,
        })
    }
}

/// The endpoint that the run lends, or that the process's environment names where a node runs outside of `gear`.
pub(crate) fn endpoint(kind: Kind, ctx: &Context) -> Result<Endpoint, NodeError> {
    Services::lent(ctx.resources())
        .get(kind)
        .cloned()
        .map_err(NodeError::new)
}

/// What a service is told: the text of the report at the port `prompt`, or where nothing is wired a parameter's.
pub fn words(prompt: Option<&Report>, parameter: &str) -> Result<String, NodeError> {
    let Some(report) = prompt else {
        return Ok(parameter.to_owned());
    };
    let text = report.0.get("prompt").and_then(Value::as_str);
    let text = text.filter(|text| !text.trim().is_empty());
    text.map(str::to_owned).ok_or_else(|| {
        NodeError::input(
            "prompt",
            "found a report without a text `prompt`; wire Prompt here, or leave it open",
        )
    })
}

/// A model's name, its length before it, then the bytes of the picture.
fn pack(bytes: &[u8], model: Option<&str>) -> Vec<u8> {
    let model = model.unwrap_or_default().as_bytes();
    let mut page = (model.len() as u32).to_le_bytes().to_vec();
    page.extend_from_slice(model);
    page.extend_from_slice(bytes);
    page
}

fn unpack(page: &[u8]) -> Option<(Vec<u8>, Option<String>)> {
    let (length, rest) = page.split_first_chunk::<4>()?;
    let (model, bytes) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
    let model = String::from_utf8(model.to_vec()).ok()?;
    Some((bytes.to_vec(), Some(model).filter(|model| !model.is_empty())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_unpacked_as_it_was_packed() {
        assert_eq!(
            unpack(&pack(b"png", Some("m-1"))),
            Some((b"png".to_vec(), Some("m-1".to_owned())))
        );
        assert_eq!(unpack(&pack(b"png", None)), Some((b"png".to_vec(), None)));
        assert_eq!(unpack(&[255, 255, 255, 255, 1]), None);
        assert_eq!(unpack(b"a"), None);
    }
}
