//! Pictures of what a run computes, made on a thread of their own while the run goes on.
//!
//! The gallery hears of every value ([`Event::Value`]) and every hit ([`Event::Hit`]). A value that can be shown is
//! handed to the painter's thread; what came from the store is painted at the end, if its picture is not stored too. The
//! run never waits for a picture.

use std::collections::BTreeMap;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use gear_graph::{AnyValue, Digest, Event, ValueType};
use gear_image::{Field, Image, Mask};
use gear_report::Picture;
use gear_report::picture::{self, PictureError, Pixels};
use gear_splat::Views;

use crate::artefacts::Artefacts;
use crate::bundle::{self, File};
use crate::outputs::{is_height, picture_of};

/// Longer side of the picture of a stage, and of a view, in pixels.
const STAGE: usize = 720;
const VIEW: usize = 400;
/// Raise when the same value gives another picture.
const PICTURE_VERSION: u32 = 2;

/// The pictures of a run.
pub struct Gallery {
    artefacts: Arc<Artefacts>,
    /// Digest of every (node, output) that took part.
    seen: Mutex<BTreeMap<(String, String), Digest>>,
    to_painter: Mutex<Option<Sender<(String, Digest, AnyValue)>>>,
    painter: Mutex<Option<JoinHandle<()>>>,
}

impl Gallery {
    /// Opens a gallery; its painter starts to wait.
    pub fn open(artefacts: Arc<Artefacts>) -> Self {
        let (sender, receiver) = channel::<(String, Digest, AnyValue)>();
        let at_work = Arc::clone(&artefacts);
        let painter = std::thread::Builder::new().name("painter".into()).spawn(move || {
            for (output, digest, value) in receiver {
                paint(&at_work, &output, &digest, || Some(value));
            }
        });
        Self {
            artefacts,
            seen: Mutex::default(),
            to_painter: Mutex::new(painter.is_ok().then_some(sender)),
            painter: Mutex::new(painter.ok()),
        }
    }

    /// Notes what happens.
    pub fn event(&self, event: &Event<'_>) {
        match event {
            Event::Value {
                node,
                output,
                digest,
                value,
            } => {
                self.note(node, output, digest);
                let to_painter = self.to_painter.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some(sender) = to_painter.as_ref().filter(|_| showable(&value.value_type())) {
                    // A painter that died paints nothing; the page then lacks a picture.
                    let _ = sender.send(((*output).to_owned(), **digest, (*value).clone()));
                }
            }
            Event::Hit { node, output, digest } => self.note(node, output, digest),
            _ => {}
        }
    }

    fn note(&self, node: &str, output: &str, digest: &Digest) {
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        seen.insert((node.to_owned(), output.to_owned()), *digest);
    }

    /// Waits until everything handed over is painted.
    pub fn finish(&self) {
        self.to_painter.lock().unwrap_or_else(PoisonError::into_inner).take();
        let painter = self.painter.lock().unwrap_or_else(PoisonError::into_inner).take();
        if painter.is_some_and(|painter| painter.join().is_err()) {
            tracing::error!("the painter of the report's pictures panicked");
        }
    }

    /// The pictures of an output: one, or one a view with the view's name. Empty if there is none. The name of a single
    /// picture is empty, or the value that is fully red in it (see [`picture::scale`]).
    pub fn pictures(&self, node: &str, output: &str, value_type: &ValueType) -> Vec<(String, Picture)> {
        let seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(digest) = seen.get(&(node.to_owned(), output.to_owned())).copied() else {
            return Vec::new();
        };
        drop(seen);
        if !showable(value_type) {
            return Vec::new();
        }
        let stored = || self.artefacts.store()?.load(&digest, value_type);
        let packed = paint(&self.artefacts, output, &digest, stored);
        let files = packed.and_then(|packed| bundle::unpack(&packed)).unwrap_or_default();
        let pictures = files.into_iter();
        pictures
            .filter_map(|file| Some((file.name, Picture::unpack(&file.bytes)?)))
            .collect()
    }
}

fn showable(value_type: &ValueType) -> bool {
    value_type.is::<Image>() || value_type.is::<Mask>() || value_type.is::<Field>() || value_type.is::<Views>()
}

/// The stored picture of a value, or a new one.
fn paint(
    artefacts: &Artefacts,
    output: &str,
    digest: &Digest,
    value: impl FnOnce() -> Option<AnyValue>,
) -> Option<Arc<[u8]>> {
    let kind = format!("picture {PICTURE_VERSION} {output}");
    if let Some(packed) = artefacts.get(&kind, digest) {
        return Some(packed);
    }
    let value = value()?;
    match pictures_of(output, &value) {
        Ok(files) => Some(artefacts.put(&kind, digest, bundle::pack(&files))),
        Err(error) => {
            tracing::warn!(output, %error, "no picture for the report");
            None
        }
    }
}

fn pictures_of(output: &str, value: &AnyValue) -> Result<Vec<File>, PictureError> {
    let one = |picture: Picture| vec![File::new("", picture.pack())];
    if let Some(image) = value.get::<Image>() {
        Ok(one(Pixels::of_image(&image).at_most(STAGE).jpeg()?))
    } else if let Some(mask) = value.get::<Mask>() {
        Ok(one(Pixels::of_mask(&mask).at_most(STAGE).png()?))
    } else if let Some(field) = value.get::<Field>() {
        let picture = picture_of(output, &field).at_most(STAGE).jpeg()?;
        let scale = picture::scale(&field).filter(|_| !is_height(output));
        let name = scale.map(|scale| scale.to_string()).unwrap_or_default();
        Ok(vec![File::new(name, picture.pack())])
    } else if let Some(views) = value.get::<Views>() {
        let paint = |view| Pixels::of_view(view).at_most(VIEW).jpeg();
        views
            .views
            .iter()
            .map(|view| Ok(File::new(view.name.clone(), paint(view)?.pack())))
            .collect()
    } else {
        Ok(Vec::new())
    }
}

#[cfg(test)]
mod tests {
    use gear_graph::Value;

    use super::*;

    #[test]
    fn a_value_is_painted_while_the_run_goes_on() {
        let gallery = Gallery::open(Arc::new(Artefacts::new(None)));
        let field = Field::from_fn(8, 5, |x, y| (x + y) as f32);
        let (digest, value) = (field.digest(), AnyValue::new(field));
        gallery.event(&Event::Value {
            node: "edges",
            output: "edges",
            digest: &digest,
            value: &value,
        });
        gallery.finish();
        let pictures = gallery.pictures("edges", "edges", &ValueType::of::<Field>());
        assert_eq!((pictures.len(), pictures[0].1.width, pictures[0].1.height), (1, 8, 5));
        assert!(gallery.pictures("edges", "other", &ValueType::of::<Field>()).is_empty());
    }

    #[test]
    fn a_hit_is_painted_from_the_store() {
        let folder = tempfile::tempdir().unwrap();
        let store = Arc::new(gear_graph::Store::open(folder.path()));
        let gallery = Gallery::open(Arc::new(Artefacts::new(Some(store))));
        let digest = Field::filled(2, 2, 0.0).digest();
        gallery.event(&Event::Hit {
            node: "edges",
            output: "edges",
            digest: &digest,
        });
        gallery.finish();
        // Neither the value nor its picture is in this store: the page goes without.
        assert!(gallery.pictures("edges", "edges", &ValueType::of::<Field>()).is_empty());
    }
}
