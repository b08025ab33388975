//! Services over HTTP: the OpenAI-compatible `images/edits` and `chat/completions`, and ComfyUI.
//!
//! A service is untrusted and unreliable. Everything that goes out and comes in passes through [`Transport`]:
//!
//! * The address, the model and the key come from the environment ([`Endpoint::from_env`]) and from nowhere else. The
//!   key is a [`Secret`]: it has no way into a log, an error, a graph, the store or a record.
//! * TLS is verified. Plain HTTP is for the loopback address, and for servers that get no key.
//! * Redirects to another host are refused, and so are links to another host in an answer.
//! * An answer has a largest size, a picture in it the limits of every other picture.
//! * Requests time out, are repeated with growing, jittered pauses when that makes sense, keep to a server's
//!   `Retry-After`, and are never more at a time than was asked for. Waiting ends when the run is interrupted.
//!
//! | file | what it holds |
//! |---|---|
//! | `endpoint` | where a service is, and its key |
//! | `transport` | one request, with all of the above |
//! | `pace` | how many at a time, and when again |
//! | `multipart` | the body of an upload |
//! | `images`, `comfy`, `chat` | the three protocols |
//! | `editing` | what image-editing nodes share: one picture through either protocol |
//! | `memory` | answers that outlive an interruption |
//! | `answer` | from the bytes of an answer to a picture like the one that was sent |
//! | `testing` | a server that misbehaves on demand |

mod answer;
mod chat;
mod comfy;
mod editing;
mod endpoint;
mod error;
mod images;
mod memory;
mod multipart;
mod pace;
mod retry_after;
#[cfg(feature = "testing")]
pub mod testing;
mod transport;

pub use answer::{agreement, restored};
pub use chat::{Chat, Part, Said};
pub use comfy::{Comfy, Job};
pub use editing::{Asked, Edited, Editor, Service, words};
pub use endpoint::{Endpoint, Kind, Secret, Services};
pub use error::ServiceError;
pub use images::{ImageEdit, Images};
pub use memory::Memory;
pub use transport::{Patience, Policy, Transport};
