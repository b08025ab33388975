//! The shawl: its ends hang behind the figure, its upper part lies over the shoulders.

use crate::palette::Palette;
use crate::shape::{Ends, Local, knot};
use crate::stage::{Skin, Stage};
use crate::textile::{Pleats, sprinkled, unrolled};

use super::{FOLD_LINE, tube};

fn shawl_colour(local: &Local) -> Skin {
    let p = Palette::court();
    let (u, v) = unrolled(local);
    let flower = sprinkled(u, v, 0.024, 0.72, 71, [p.cinnabar, p.white]);
    let edge = local.e.abs() > 0.82;
    let albedo = if edge { p.cinnabar } else { flower.unwrap_or(p.gold) };
    let pleats = Pleats {
        count: 4.0,
        height: 0.16,
        from: [-0.4, 0.0],
        sweep: 1.5,
        seed: 72,
    };
    let (relief, ink) = pleats.at(local, 0.8 * FOLD_LINE);
    Skin {
        albedo,
        relief,
        ink: 0.7 * ink,
    }
}

pub fn behind(stage: &mut Stage) {
    let left = [
        knot(-0.115, -0.185, 0.020, 0.010, 0.0),
        knot(-0.236, -0.058, 0.024, 0.014, 0.0),
        knot(-0.262, 0.11, 0.026, 0.014, 0.0),
        knot(-0.222, 0.26, 0.027, 0.014, 0.0),
        knot(-0.262, 0.400, 0.032, 0.014, 0.0),
    ];
    stage.add(tube(&left, Ends::Cut(0.3)), 1.0, shawl_colour);
    let right = [
        knot(0.115, -0.185, 0.020, 0.010, 0.0),
        knot(0.236, -0.050, 0.024, 0.014, 0.0),
        knot(0.252, 0.12, 0.026, 0.014, 0.0),
        knot(0.272, 0.28, 0.027, 0.014, 0.0),
        knot(0.236, 0.385, 0.032, 0.014, 0.0),
    ];
    stage.add(tube(&right, Ends::Cut(0.3)), 1.0, shawl_colour);
}

pub fn before(stage: &mut Stage) {
    for side in [-1.0, 1.0] {
        let over = [
            knot(side * 0.062, -0.236, 0.014, 0.008, 0.003),
            knot(side * 0.104, -0.196, 0.018, 0.008, 0.003),
            knot(side * 0.156, -0.140, 0.020, 0.008, 0.003),
            knot(side * 0.214, -0.082, 0.022, 0.008, 0.003),
        ];
        stage.lay(tube(&over, Ends::Cut(0.0)), 0.9, shawl_colour);
    }
}
