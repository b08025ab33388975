//! A court lady with a round fan, after the manner of Tang painters: high bun with a peony, long skirt under a
//! high sash, an open robe with wide sleeves, a shawl.
//!
//! One file a part of the figure; what they share is here.

mod fan;
mod head;
mod robe;
mod shawl;
mod skirt;

pub(crate) use fan::hand;
pub(crate) use head::face;

use crate::random::smoothstep;
use crate::shape::{Ellipsoid, Ends, Knot, Shape, Tube};
use crate::stage::Stage;

/// Width of a drawn fold line, world units.
const FOLD_LINE: f64 = 0.0016;

/// A tube.
pub(crate) fn tube(knots: &[Knot], ends: Ends) -> Shape {
    Shape::Tube(Tube::new(knots, ends))
}

/// An ellipsoid, turned in the picture plane.
pub(crate) fn ball(center: [f64; 2], radii: [f64; 2], turn: f64, depth: f64, z: f64) -> Shape {
    Shape::Ellipsoid(Ellipsoid {
        center,
        radii,
        turn,
        depth,
        z,
    })
}

/// Builds the figure. Heights: the body's silhouette is at 0, its front about 0.12.
pub fn stage(seed: u64) -> Stage {
    let mut stage = Stage {
        aspect: 0.75,
        parts: Vec::new(),
        whole_canvas: false,
    };
    shawl::behind(&mut stage);
    skirt::shoes(&mut stage);
    head::back_hair(&mut stage);
    skirt::skirt(&mut stage, seed);
    robe::panels(&mut stage, seed);
    robe::bodice(&mut stage, seed);
    head::head(&mut stage);
    head::hair(&mut stage);
    skirt::sash(&mut stage, seed);
    robe::sleeves(&mut stage, seed);
    fan::fan(&mut stage);
    shawl::before(&mut stage);
    stage
}

/// A short brush stroke in face coordinates: ink of a bent, tapering line around (0, 0).
fn stroke(x: f64, y: f64, reach: f64, bend: f64, width: f64) -> f64 {
    let t = x / reach;
    if t.abs() >= 1.0 {
        return 0.0;
    }
    let w = width * (1.0 - 0.75 * t * t);
    smoothstep(w, 0.45 * w, (y - bend * t * t).abs())
}
