//! A painted ewer: a body of revolution with a handle, a spout and a lid, on a carved stand.

use crate::palette::{Palette, mix, scale};
use crate::random::smoothstep;
use crate::shape::{Ellipsoid, Ends, Local, Shape, Tube, knot};
use crate::stage::{Skin, Stage};
use crate::textile::{blossom, fret, scallops, unrolled};

/// Builds the vessel. Silhouettes are at height 0, the belly's front at about 0.21.
pub fn stage(_seed: u64) -> Stage {
    let mut stage = Stage {
        aspect: 0.8,
        parts: Vec::new(),
        whole_canvas: false,
    };
    handle_and_spout(&mut stage);
    stand(&mut stage);
    body(&mut stage);
    lid(&mut stage);
    stage
}

fn glaze(l: &Local) -> Skin {
    let p = Palette::court();
    let (u, v) = unrolled(l);
    let wave = scallops(u, v, 0.020);
    Skin::plain(if wave > 0.78 { p.azurite } else { p.white })
}

fn handle_and_spout(stage: &mut Stage) {
    let handle = [
        knot(0.050, -0.235, 0.014, 0.016, 0.02),
        knot(0.150, -0.265, 0.015, 0.018, 0.02),
        knot(0.238, -0.190, 0.015, 0.018, 0.02),
        knot(0.246, -0.060, 0.015, 0.018, 0.02),
        knot(0.185, 0.040, 0.017, 0.018, 0.02),
    ];
    stage.add(Shape::Tube(Tube::new(&handle, Ends::Round)), 1.1, glaze);
    let spout = [
        knot(-0.150, 0.085, 0.045, 0.040, 0.02),
        knot(-0.225, 0.020, 0.030, 0.032, 0.02),
        knot(-0.252, -0.090, 0.018, 0.020, 0.02),
        knot(-0.290, -0.178, 0.014, 0.016, 0.02),
    ];
    stage.add(Shape::Tube(Tube::new(&spout, Ends::Cut(0.4))), 1.1, |l| {
        let p = Palette::court();
        let (u, v) = unrolled(l);
        let lip = l.s > 0.95;
        let wave = scallops(u, v, 0.024);
        Skin::plain(if lip {
            p.gold
        } else if wave > 0.78 {
            p.azurite
        } else {
            p.white
        })
    });
}

fn stand(stage: &mut Stage) {
    for x in [-0.130, 0.0, 0.130] {
        let foot = [
            knot(x, 0.355, 0.026, 0.03, 0.05),
            knot(x * 1.12, 0.440, 0.018, 0.024, 0.05),
        ];
        stage.add(Shape::Tube(Tube::new(&foot, Ends::Cut(0.3))), 1.0, |_| {
            Skin::plain(Palette::court().lac)
        });
    }
    let board = [
        knot(-0.185, 0.362, 0.030, 0.075, 0.0),
        knot(0.0, 0.364, 0.032, 0.13, 0.0),
        knot(0.185, 0.362, 0.030, 0.075, 0.0),
    ];
    stage.add(Shape::Tube(Tube::new(&board, Ends::Round)), 1.1, |l| {
        let p = Palette::court();
        let t = 0.5 * (l.e + 1.0);
        let lit = fret(l.s * l.length, (t - 0.2) / 0.6, 0.036) && (0.2..0.8).contains(&t);
        Skin {
            albedo: if lit { p.gold } else { p.lac },
            relief: if lit { 0.004 } else { 0.0 },
            ink: 0.0,
        }
    });
}

fn body(stage: &mut Stage) {
    let profile = [
        knot(0.0, -0.255, 0.068, 0.068, 0.0),
        knot(0.0, -0.225, 0.054, 0.054, 0.0),
        knot(0.0, -0.170, 0.056, 0.056, 0.0),
        knot(0.0, -0.110, 0.118, 0.115, 0.0),
        knot(0.0, -0.030, 0.186, 0.182, 0.0),
        knot(0.0, 0.060, 0.208, 0.205, 0.0),
        knot(0.0, 0.165, 0.186, 0.182, 0.0),
        knot(0.0, 0.255, 0.128, 0.126, 0.0),
        knot(0.0, 0.305, 0.096, 0.095, 0.0),
        knot(0.0, 0.345, 0.104, 0.103, 0.0),
    ];
    stage.add(Shape::Tube(Tube::new(&profile, Ends::Cut(0.10))), 1.2, |l| {
        let p = Palette::court();
        let (u, v) = unrolled(l);
        let s = l.s;
        let band = |a: f64, b: f64| (a..b).contains(&s);
        let turn = libm::asin(l.e.clamp(-1.0, 1.0));
        if band(0.03, 0.05)
            || band(0.175, 0.19)
            || band(0.865, 0.88)
            || band(0.325, 0.332)
            || band(0.402, 0.409)
            || band(0.70, 0.707)
        {
            return Skin {
                albedo: p.gold,
                relief: 0.003,
                ink: 0.0,
            };
        }
        if s < 0.175 {
            // upright leaves on the neck
            let x = turn * 3.2;
            let leaf = (x - x.floor() - 0.5).abs() * 2.0;
            let tall = (s - 0.05) / 0.125;
            return Skin::plain(if leaf < 0.85 * tall { p.azurite } else { p.white });
        }
        if band(0.332, 0.402) {
            let lit = fret(turn * 0.2, (s - 0.332) / 0.07, 0.046);
            return Skin::plain(if lit { p.white } else { p.azurite });
        }
        if s > 0.707 && s < 0.865 {
            // lotus petals, raised
            let x = turn * 2.6;
            let across = (x - x.floor() - 0.5).abs() * 2.0;
            let tall = (0.865 - s) / 0.158;
            let rim = (1.0 - tall * tall).max(0.0).sqrt();
            let inside = smoothstep(0.0, 0.25, rim - across);
            let vein = smoothstep(0.10, 0.03, (across - 0.5 * rim).abs());
            let petal = mix(p.white, p.peony, smoothstep(0.1, 0.9, tall));
            let albedo = if inside > 0.45 {
                mix(petal, p.cinnabar, 0.5 * vein)
            } else {
                p.azurite
            };
            return Skin {
                albedo,
                relief: 0.007 * inside,
                ink: 0.8 * smoothstep(0.30, 0.06, (inside - 0.4).abs()),
            };
        }
        if band(0.409, 0.70) {
            return peonies(turn, s, l);
        }
        if s < 0.332 {
            let wave = scallops(u, v, 0.034);
            return Skin::plain(if wave > 0.8 || (0.35..0.5).contains(&wave) {
                p.azurite
            } else {
                p.white
            });
        }
        Skin::plain(p.azurite)
    });
}

/// The main frieze: peonies among leaves on a winding stem; blossoms stand out a little.
fn peonies(turn: f64, s: f64, l: &Local) -> Skin {
    let p = Palette::court();
    let x = turn * 0.205;
    let y = (s - 0.5545) * l.length;
    let wave = 0.030 * libm::sin(x * 26.0);
    let stem = smoothstep(0.006, 0.003, (y - wave).abs());
    for k in -2..=2i32 {
        let cx = f64::from(k) * 0.121 + 0.0604;
        let cy = if k.rem_euclid(2) == 0 { 0.020 } else { -0.020 };
        for (radius, petals, a, b) in [(0.026, 2.5, p.peony, p.cinnabar), (0.047, 4.0, p.cinnabar, p.lac)] {
            if let Some(c) = blossom(x - cx, y - cy, radius, petals, a, b) {
                let r = ((x - cx) * (x - cx) + (y - cy) * (y - cy)).sqrt();
                return Skin {
                    albedo: c,
                    relief: 0.007 * smoothstep(0.047, 0.02, r),
                    ink: 0.0,
                };
            }
        }
        for (dx, dy, tilt) in [
            (0.060, 0.012, 0.6),
            (0.052, -0.034, -0.5),
            (-0.052, 0.040, 2.4),
            (-0.058, -0.026, 0.9),
        ] {
            let (lx, ly) = (x - cx - dx, y - cy - dy);
            let (sin, cos) = (libm::sin(tilt), libm::cos(tilt));
            let (a, b) = ((cos * lx + sin * ly) / 0.028, (cos * ly - sin * lx) / 0.0115);
            let lens = b.abs() - (1.0 - a * a);
            if a.abs() < 1.0 && lens < 0.0 {
                let vein = smoothstep(0.14, 0.05, b.abs());
                return Skin {
                    albedo: mix(p.malachite, scale(p.malachite, 0.4), vein),
                    relief: 0.003,
                    ink: 0.0,
                };
            }
        }
    }
    Skin::plain(mix(p.white, p.malachite, stem))
}

fn lid(stage: &mut Stage) {
    let dome = Ellipsoid {
        center: [0.0, -0.262],
        radii: [0.070, 0.050],
        turn: 0.0,
        depth: 0.070,
        z: 0.0,
    };
    stage.add(Shape::Ellipsoid(dome), 1.0, |l| {
        let p = Palette::court();
        let band = l.y > -0.1;
        let rays = libm::sin(12.0 * libm::asin(l.x.clamp(-1.0, 1.0)));
        Skin {
            albedo: if band {
                p.gold
            } else if rays > 0.2 {
                p.azurite
            } else {
                p.white
            },
            relief: 0.002 * rays,
            ink: 0.0,
        }
    });
    let knob = Ellipsoid {
        center: [0.0, -0.330],
        radii: [0.022, 0.026],
        turn: 0.0,
        depth: 0.024,
        z: 0.01,
    };
    stage.add(Shape::Ellipsoid(knob), 0.9, |l| {
        let p = Palette::court();
        Skin::plain(mix(p.cinnabar, p.gold, smoothstep(0.2, -0.6, l.y)))
    });
}
