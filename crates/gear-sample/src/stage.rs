//! A stage: parts laid over one another in painter's order, and what a ray straight into the picture meets.

use crate::shape::{Local, Shape};

/// Linear-light colour.
pub type Colour = [f64; 3];

/// What a part wears at a point.
#[derive(Clone, Copy, Debug)]
pub struct Skin {
    /// Linear reflectance.
    pub albedo: Colour,
    /// Height added to the bare shape, world units.
    pub relief: f64,
    /// Painted line, 0 none to 1 full.
    pub ink: f64,
}

impl Skin {
    /// A plain colour.
    pub fn plain(albedo: Colour) -> Self {
        Self {
            albedo,
            relief: 0.0,
            ink: 0.0,
        }
    }
}

/// The dress of a part: its skin as a function of where one is on it.
pub type Dress = Box<dyn Fn(&Local) -> Skin + Send + Sync>;

/// A shape with its dress.
pub struct Part {
    /// Silhouette and height.
    pub shape: Shape,
    /// True when the part lies on what is below it, instead of standing at its own height.
    pub over: bool,
    /// Width of the drawn outline, a share of the common one.
    pub outline: f64,
    /// Colours, folds and lines.
    pub dress: Dress,
}

/// What a ray meets.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Index of the part; the ground has none.
    pub part: Option<usize>,
    /// Height over the ground plane, world units.
    pub height: f64,
    /// What is seen there.
    pub skin: Skin,
}

/// Everything that stands before the ground.
pub struct Stage {
    /// Picture width by its height.
    pub aspect: f64,
    /// Back to front.
    pub parts: Vec<Part>,
    /// True when the parts cover the canvas and the whole of it is the subject.
    pub whole_canvas: bool,
}

impl Stage {
    /// The topmost part at (x, y), y down.
    ///
    /// Searched from the front, so that only what is seen, and what it lies on, is dressed.
    pub fn trace(&self, x: f64, y: f64) -> Hit {
        let mut seen: Option<(usize, Skin)> = None;
        let mut height = 0.0;
        for (index, part) in self.parts.iter().enumerate().rev() {
            let Some(local) = part.shape.local(x, y) else { continue };
            let skin = (part.dress)(&local);
            height += local.base + local.rise + skin.relief;
            seen = seen.or(Some((index, skin)));
            if !part.over {
                break;
            }
        }
        match seen {
            Some((index, skin)) => Hit {
                part: Some(index),
                height: height.max(0.0),
                skin,
            },
            None => Hit {
                part: None,
                height: 0.0,
                skin: Skin::plain([0.0; 3]),
            },
        }
    }

    /// Adds a part in front of the others.
    pub fn add(&mut self, shape: Shape, outline: f64, dress: impl Fn(&Local) -> Skin + Send + Sync + 'static) {
        self.parts.push(Part {
            shape,
            over: false,
            outline,
            dress: Box::new(dress),
        });
    }

    /// Adds a part that lies on what is there already.
    pub fn lay(&mut self, shape: Shape, outline: f64, dress: impl Fn(&Local) -> Skin + Send + Sync + 'static) {
        self.parts.push(Part {
            shape,
            over: true,
            outline,
            dress: Box::new(dress),
        });
    }
}
