//! One view's target: what the painting tells, and for the rest what fits it.

use gear_image::{Field, Mask, SrgbImage};
use gear_splat::View;

use crate::fill::Filler;
use crate::reproject::{self, Known, Source};

/// Coverage below which nothing is seen in 8 bits.
const SEEN: f32 = 1.0 / 255.0;

/// How far invented pixels may be trusted, where a seen one counts 1.
pub(crate) struct Trust {
    pub back: f32,
    pub fill: f32,
}

/// The buffers a view must come with.
pub(crate) struct Buffers<'a> {
    pub alpha: &'a Field,
    pub depth: &'a Field,
    pub normal: &'a [[f32; 3]],
}

/// What the painting tells of one view.
pub(crate) enum Told {
    /// The view looks along the painter's rays: the painting itself on this mask, white beyond it.
    All(SrgbImage, Mask),
    /// Any other view.
    Part(Known),
}

impl Told {
    pub fn of(source: &Source, view: &View, buffers: &Buffers) -> Self {
        match view.camera.offset_to(&source.camera) {
            Some(offset) => {
                let (rgb, mask) = reproject::same_rays(source, view, offset);
                Self::All(rgb, mask)
            }
            None => Self::Part(reproject::known(
                source,
                view,
                buffers.alpha,
                buffers.depth,
                buffers.normal,
            )),
        }
    }

    /// Whether nothing is left to fill.
    pub fn is_complete(&self) -> bool {
        match self {
            Self::All(..) => true,
            Self::Part(known) => known.is_complete(),
        }
    }
}

/// The target of a view. The filler is asked only when the painting does not tell everything.
pub(crate) fn target(told: Told, view: &View, alpha: &Field, trust: &Trust, filler: Option<&Filler>) -> View {
    let known = match told {
        Told::All(rgb, mask) => return front(view, &rgb, &mask, alpha, trust),
        Told::Part(known) => known,
    };
    let edited = match filler {
        Some(filler) if !known.is_complete() => blended(&filler.fill(&view.rgb, &known), &known),
        _ => known.colour.clone(),
    };
    let rgb = over_white(&edited, &known.silhouette, alpha);
    finished(view, rgb, weights(&known, alpha, trust))
}

/// The painting, fully trusted, on its mask; the fringe that the scene spreads beyond it as in every other view. Asking
/// for white right beside the mask would bleach the rim's Gaussians, which show their true colour from the sides.
fn front(view: &View, rgb: &SrgbImage, mask: &Mask, alpha: &Field, trust: &Trust) -> View {
    let fringe = over_white(rgb, mask, alpha);
    let (width, height) = rgb.size();
    let target = SrgbImage::from_fn(width, height, |x, y| {
        if mask.at(x, y) { rgb.at(x, y) } else { fringe.at(x, y) }
    });
    let weight = Field::from_fn(width, height, |x, y| {
        let spread = !mask.at(x, y) && alpha.at(x, y) > SEEN;
        if spread { trust.fill } else { 1.0 }
    });
    finished(view, target, weight)
}

fn finished(view: &View, rgb: SrgbImage, weight: Field) -> View {
    View {
        rgb,
        weight: Some(weight),
        ..view.clone()
    }
}

/// fill + share · (painting − fill); exactly the painting where the share is 1.
fn blended(fill: &SrgbImage, known: &Known) -> SrgbImage {
    let pixels = fill
        .data()
        .iter()
        .zip(known.colour.data())
        .enumerate()
        .map(|(i, (f, t))| {
            let share = known.share(i);
            if share >= 1.0 {
                *t
            } else {
                std::array::from_fn(|c| (f[c] + share * (t[c] - f[c])).clamp(0.0, 1.0))
            }
        });
    SrgbImage::from_vec(fill.width(), fill.height(), pixels.collect())
}

/// Trust in each pixel: full where the painting tells it and where nothing is, less where it was mirrored or
/// invented; in the half-covered fringe as little as for the invented.
fn weights(known: &Known, alpha: &Field, trust: &Trust) -> Field {
    let weight = |i: usize| {
        if known.silhouette.data()[i] {
            let (front, back) = (known.front.data()[i], known.back.data()[i]);
            front + (1.0 - front) * (back * trust.back + (1.0 - back) * trust.fill)
        } else if alpha.data()[i] > SEEN {
            trust.fill
        } else {
            1.0
        }
    };
    Field::from_vec(alpha.width(), alpha.height(), (0..alpha.len()).map(weight).collect())
}

/// The edited colours as the renderer shows them: over white by coverage. The fringe takes the colour of the nearest
/// pixel of the silhouette.
fn over_white(edited: &SrgbImage, silhouette: &Mask, alpha: &Field) -> SrgbImage {
    let (width, height) = edited.size();
    let Some(nearest) = gear_image::filter::nearest(silhouette) else {
        return SrgbImage::filled(width, height, [1.0; 3]);
    };
    SrgbImage::from_fn(width, height, |x, y| {
        let (nx, ny) = nearest.at(x, y);
        let coverage = alpha.at(x, y).clamp(0.0, 1.0);
        edited.at(nx, ny).map(|c| 1.0 + coverage * (c - 1.0))
    })
}
