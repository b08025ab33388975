//! The one mask: what of a picture is figure (notes C1).
//!
//! ```text
//! picture ─ features ─ frame ─ rim ─┐
//!                                   ├─ mixture ⇄ cut (GrabCut, ~384 px) ─ shape ─ judge ─ cut (full size, narrow band)
//!                           box ────┘
//! ```
//!
//! The ground is guessed from the rim inside a frame, if there is one; then colour models of figure and ground and a
//! minimum cut improve each other at a small size; the boundary alone is cut again at full size. What comes out is
//! judged: when the picture has no figure that can be told from a ground, the whole canvas is the subject
//! (relief) and the confidence says so. The mask decides the result more than anything after it.

mod cut;
mod features;
mod frame;
mod judge;
pub mod maxflow;
mod mixture;
mod rim;
mod saliency;
mod shape;

use gear_image::filter::{Beyond, close, dilate, erode, fit_longer_side, resize_mask};
use gear_image::{Mask, SrgbImage};

use cut::{Prior, cut};
use features::{Feature, Features};
use frame::Window;
pub use judge::Doubts;
use mixture::Mixture;
pub use saliency::from_saliency;

/// How the mask came to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// A figure was found.
    Figure,
    /// The whole canvas is the subject.
    Relief,
    /// The user gave the mask.
    Given,
    /// The user gave a rough box.
    Box,
}

impl Mode {
    /// The name used in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Figure => "figure",
            Self::Relief => "relief",
            Self::Given => "given",
            Self::Box => "box",
        }
    }
}

/// Settings of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Rounds of colour models and cut.
    pub iterations: usize,
    /// Price of a boundary through flat colour, nats a pixel.
    pub smoothness: f64,
    /// Gaussians of each colour model.
    pub components: usize,
    /// Longer side at which the models are fitted, pixels.
    pub working_size: usize,
    /// Masks found with less confidence become the whole canvas.
    pub least_confidence: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            iterations: 5,
            smoothness: 8.0,
            components: 5,
            working_size: 384,
            least_confidence: 0.5,
        }
    }
}

/// A mask and what is known about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The mask, the picture's size; full in relief mode.
    pub mask: Mask,
    /// How far an automatic mask can be trusted, 0 to 1; `None` where nothing was searched for or measured.
    pub confidence: Option<f64>,
    /// How it came to be.
    pub mode: Mode,
    /// What the confidence was made of; `None` where nothing was measured.
    pub doubts: Option<Doubts>,
    /// The best figure that was found, even if it was not trusted.
    pub candidate: Option<Mask>,
    /// The window inside a frame or mount, `[x0, y0, x1, y1]` as shares of width and height.
    pub frame: Option<[f64; 4]>,
}

impl Found {
    /// Share of the canvas inside the mask.
    pub fn share(&self) -> f64 {
        self.mask.count() as f64 / self.mask.len().max(1) as f64
    }
}

/// The whole canvas.
pub fn relief(width: usize, height: usize) -> Found {
    Found {
        mask: Mask::filled(width, height, true),
        confidence: None,
        mode: Mode::Relief,
        doubts: None,
        candidate: None,
        frame: None,
    }
}

/// The whole canvas, because no figure was found.
fn untrusted(width: usize, height: usize) -> Found {
    Found {
        confidence: Some(0.0),
        ..relief(width, height)
    }
}

/// A mask that the user gave, brought to the picture's size. One with nothing inside means the whole canvas.
pub fn given(mask: &Mask, width: usize, height: usize) -> Found {
    let mask = if mask.size() == (width, height) {
        mask.clone()
    } else {
        resize_mask(mask, width, height)
    };
    if mask.count() == 0 {
        return relief(width, height);
    }
    Found {
        mask,
        confidence: None,
        mode: Mode::Given,
        doubts: None,
        candidate: None,
        frame: None,
    }
}

/// The figure in front of the ground that the rim shows; the whole canvas when none can be trusted.
pub fn automatic(image: &SrgbImage, settings: &Settings) -> Found {
    let (width, height) = image.size();
    if width.min(height) < 16 {
        return untrusted(width, height);
    }
    let small = Small::new(image, settings);
    let (window, framed) = frame::window(&small.features);
    let frame = framed.then(|| {
        let (w, h) = (small.features.width as f64, small.features.height as f64);
        [
            window.x0 as f64 / w,
            window.y0 as f64 / h,
            window.x1 as f64 / w,
            window.y1 as f64 / h,
        ]
    });
    let Some(guess) = rim::ground(&small.features, &window) else {
        return Found {
            frame,
            ..untrusted(width, height)
        };
    };
    let Some((mask, known)) = small.grab(&guess.ground, &window, settings) else {
        return Found {
            frame,
            ..untrusted(width, height)
        };
    };
    let doubts = judge::measure(
        &mask,
        &small.features,
        &window,
        Doubts {
            explained: guess.explained,
            sides: guess.sides,
            ..known
        },
    );
    let confidence = judge::confidence(&doubts);
    tracing::debug!(framed, confidence, ?doubts, "foreground");
    let fine = small.refine(image, &mask, settings);
    if confidence <= settings.least_confidence || fine.count() == 0 {
        return Found {
            confidence: Some(confidence),
            doubts: Some(doubts),
            candidate: Some(fine),
            frame,
            ..relief(width, height)
        };
    }
    Found {
        mask: fine,
        confidence: Some(confidence),
        mode: Mode::Figure,
        doubts: Some(doubts),
        candidate: None,
        frame,
    }
}

/// The figure inside a rough box `[x0, y0, x1, y1]`, shares of width and height; everything outside is ground.
pub fn in_box(image: &SrgbImage, region: [f64; 4], settings: &Settings) -> Found {
    let (width, height) = image.size();
    let plain = |w: usize, h: usize| box_mask(region, w, h);
    let user = |mask: Mask| Found {
        mask,
        confidence: None,
        mode: Mode::Box,
        doubts: None,
        candidate: None,
        frame: None,
    };
    if width.min(height) < 16 {
        return user(plain(width, height));
    }
    let small = Small::new(image, settings);
    let (w, h) = (small.features.width, small.features.height);
    let inside = plain(w, h);
    let window = Window {
        x0: 0,
        y0: 0,
        x1: w,
        y1: h,
    };
    let outside = Mask::from_vec(w, h, inside.data().iter().map(|m| !m).collect());
    match small.grab_fixed(&outside, &window, settings) {
        Some((mask, _)) if mask.count() * 20 > inside.count() => user(small.refine(image, &mask, settings)),
        _ => user(plain(width, height)),
    }
}

fn box_mask([x0, y0, x1, y1]: [f64; 4], width: usize, height: usize) -> Mask {
    let mask = Mask::from_fn(width, height, |x, y| {
        let (u, v) = ((x as f64 + 0.5) / width as f64, (y as f64 + 0.5) / height as f64);
        u >= x0.min(x1) && u <= x0.max(x1) && v >= y0.min(y1) && v <= y0.max(y1)
    });
    if mask.count() == 0 {
        Mask::filled(width, height, true)
    } else {
        mask
    }
}

/// Widest gap that is closed, as a share of the longer side: a band of the ground's colour, such as gold leaf before a
/// golden ground, must not cut a body in two.
const GAP: f64 = 0.012;

/// The picture at working size.
struct Small {
    features: Features,
}

impl Small {
    fn new(image: &SrgbImage, settings: &Settings) -> Self {
        let (width, height) = image.size();
        let (w, h) = fit_longer_side(width, height, settings.working_size.max(16));
        Self {
            features: Features::new(image, w, h, 0.8),
        }
    }

    /// GrabCut from a guessed ground, of which the deep interior and the rim stay ground.
    fn grab(&self, ground: &Mask, window: &Window, settings: &Settings) -> Option<(Mask, Doubts)> {
        let (w, h) = ground.size();
        let deep = erode(ground, (w.max(h) / 40).max(2), Beyond::Inside);
        let fixed = Mask::from_fn(w, h, |x, y| deep.at(x, y) || !window.contains(x, y));
        self.iterate(ground, &fixed, window, settings)
    }

    /// GrabCut from a box: everything outside stays ground, everything inside may be either.
    fn grab_fixed(&self, outside: &Mask, window: &Window, settings: &Settings) -> Option<(Mask, Doubts)> {
        self.iterate(outside, outside, window, settings)
    }

    fn iterate(&self, ground: &Mask, fixed: &Mask, window: &Window, settings: &Settings) -> Option<(Mask, Doubts)> {
        let (w, h) = ground.size();
        let mut mask = Mask::from_vec(w, h, ground.data().iter().map(|g| !g).collect());
        let mut known = Doubts::default();
        // what belongs to the picture's frame is neither figure nor the ground behind it: no model learns from it
        let ledges = shape::drop_crumbs(&mut mask.clone(), 0.04, window);
        for round in 0..settings.iterations.max(1) {
            let (figure, back) = self.models(&mask, Some(&ledges), window, settings)?;
            let evidence = |c: Feature| (figure.log_density(c) - back.log_density(c)) as f32;
            let priors: Vec<Prior> = (0..mask.len())
                .map(|p| {
                    if fixed.data()[p] || ledges.data()[p] {
                        Prior::Ground
                    } else {
                        Prior::Evidence(evidence(self.features.data[p]))
                    }
                })
                .collect();
            let next = cut(&self.features, &priors, settings.smoothness as f32);
            let mut next = Mask::from_vec(w, h, next);
            let ground_like = |hole: &[usize]| {
                let sum: f64 = hole
                    .iter()
                    .map(|p| f64::from(evidence(self.features.data[*p])).clamp(-6.0, 6.0))
                    .sum();
                sum / (hole.len() as f64) < -1.0
            };
            shape::fill_holes(&mut next, 0.002, ground_like);
            known.rim = judge::rim_covered(&next, window);
            if round > 0 {
                shape::drop_crumbs(&mut next, 0.04, window);
            }
            known.told_apart = self.told_apart(&next, window, &evidence);
            let same = next == mask;
            mask = next;
            if same {
                break;
            }
        }
        shape::drop_crumbs(&mut mask, 0.08, window);
        (mask.count() > 0).then_some((mask, known))
    }

    fn models(
        &self,
        mask: &Mask,
        ledges: Option<&Mask>,
        window: &Window,
        settings: &Settings,
    ) -> Option<(Mixture, Mixture)> {
        let (mut inside, mut outside) = (Vec::new(), Vec::new());
        for y in window.y0..window.y1 {
            for x in (window.x0..window.x1).filter(|x| ledges.is_none_or(|l| !l.at(*x, y))) {
                let c = self.features.data[y * mask.width() + x];
                if mask.at(x, y) { inside.push(c) } else { outside.push(c) }
            }
        }
        Some((
            Mixture::fit(&inside, settings.components)?,
            Mixture::fit(&outside, settings.components)?,
        ))
    }

    fn told_apart(&self, mask: &Mask, window: &Window, evidence: &impl Fn(Feature) -> f32) -> f64 {
        let (mut right, mut all) = (0usize, 0usize);
        for y in window.y0..window.y1 {
            for x in window.x0..window.x1 {
                if !mask.at(x, y) {
                    all += 1;
                    right += usize::from(evidence(self.features.data[y * mask.width() + x]) < 0.0);
                }
            }
        }
        right as f64 / all.max(1) as f64
    }

    /// Brings a mask to the picture's size and cuts again in a band around its boundary.
    fn refine(&self, image: &SrgbImage, mask: &Mask, settings: &Settings) -> Mask {
        let (width, height) = image.size();
        let whole = Window {
            x0: 0,
            y0: 0,
            x1: mask.width(),
            y1: mask.height(),
        };
        let Some((figure, back)) = self.models(mask, None, &whole, settings) else {
            return resize_mask(mask, width, height);
        };
        let coarse = resize_mask(mask, width, height);
        let ratio = width.max(height) as f64 / mask.longer_side() as f64;
        let band = ((2.0 * ratio).ceil() as usize).clamp(2, 24);
        let sure = erode(&coarse, band, Beyond::Inside);
        let near = dilate(&coarse, band);
        let features = Features::new(image, width, height, 0.6);
        let priors: Vec<Prior> = (0..coarse.len())
            .map(|p| match (sure.data()[p], near.data()[p]) {
                (true, _) => Prior::Figure,
                (_, false) => Prior::Ground,
                _ => {
                    let c = features.data[p];
                    Prior::Evidence((figure.log_density(c) - back.log_density(c)) as f32)
                }
            })
            .collect();
        let fine = Mask::from_vec(width, height, cut(&features, &priors, settings.smoothness as f32));
        let reach = (0.5 * GAP * width.max(height) as f64).round() as usize;
        let fine = close(&fine, reach);
        shape::smooth(&fine, 1, (0.0016 * width.max(height) as f64).max(0.7))
    }
}

#[cfg(test)]
mod tests;
