//! Carved reliefs: medallions and steles that stand off the ground, and friezes that fill the canvas.
//!
//! A slab of stone carries a carving, which is either a set of bumps of which the highest wins ([`Carving`]), a height
//! function, or a whole figure of the figures' family pressed flat ([`pressed`]). Stone is painted, as it once was, or
//! bare.

use std::f64::consts::{PI, TAU};

use crate::palette::{Palette, mix, scale};
use crate::random::{fractal, noise, smoothstep};
use crate::shape::{Local, Shape};
use crate::stage::{Colour, Skin, Stage};
use crate::textile::scallops;

use super::dice::Dice;
use super::figures;

/// Builds relief `number`.
pub fn stage(number: u64, seed: u64) -> Stage {
    let dice = Dice::of("relief", number);
    let stone = Stone::drawn(dice);
    match number % 4 {
        1 => medallion(dice, stone),
        2 => stele(dice, stone, number, seed),
        3 => frieze(dice, stone),
        _ => tablet(dice, stone),
    }
}

#[derive(Clone, Copy)]
struct Stone {
    bare: Colour,
    field: Colour,
    raised: Colour,
    accent: Colour,
    seed: u64,
}

impl Stone {
    fn drawn(dice: Dice) -> Self {
        let p = Palette::court();
        let bare = dice.pick(
            "stone",
            &[
                mix(p.silk, p.white, 0.5),
                mix(p.silk, p.indigo, 0.25),
                mix(p.ochre, p.white, 0.35),
                mix(p.lac, p.ochre, 0.5),
            ],
        );
        let painted = dice.chance("painted", 0.55);
        let or_bare = |colour: Colour| if painted { mix(bare, colour, 0.8) } else { bare };
        Self {
            bare,
            field: or_bare(dice.pick("field", &[p.azurite, p.lac, p.malachite, p.celadon])),
            raised: or_bare(dice.pick("raised", &[p.white, p.gold, p.peony, p.ochre])),
            accent: or_bare(dice.pick("accent", &[p.gold, p.cinnabar, p.celadon])),
            seed: dice.seed("stone"),
        }
    }

    /// Weathering: tone at a place.
    fn worn(&self, colour: Colour, x: f64, y: f64) -> Colour {
        let age = fractal(self.seed, 6.0 * x, 6.0 * y, 4);
        let chipped = smoothstep(0.25, 0.5, fractal(self.seed + 3, 11.0 * x, 11.0 * y, 4));
        scale(mix(colour, self.bare, 0.6 * chipped), 1.0 + 0.14 * age)
    }

    /// Roughness of the chisel.
    fn rough(&self, x: f64, y: f64) -> f64 {
        0.0012 * noise(self.seed + 5, 70.0 * x, 70.0 * y) + 0.0010 * fractal(self.seed + 6, 24.0 * x, 24.0 * y, 3)
    }
}

fn at(x: f64, y: f64, e: f64, rise: f64) -> Local {
    Local {
        x,
        y,
        s: 0.0,
        e,
        width: 1.0,
        length: 1.0,
        rise,
        base: 0.0,
    }
}

/// A slab: `inside(x, y)` is the distance to its rim, positive inside; the rim is rounded and framed.
fn slab(
    stage: &mut Stage,
    stone: Stone,
    thick: f64,
    frame: f64,
    inside: impl Fn(f64, f64) -> f64 + Send + Sync + 'static,
) {
    stage.add(
        Shape::Free(Box::new(move |x, y| {
            let d = inside(x, y);
            (d > 0.0).then(|| {
                let edge = (d / 0.02).min(1.0);
                at(x, y, d, thick * (1.0 - (1.0 - edge) * (1.0 - edge)).max(0.0).sqrt())
            })
        })),
        1.2,
        move |l| {
            let d = l.e;
            let raised = smoothstep(frame + 0.008, frame, d);
            let groove = smoothstep(0.006, 0.0, (d - 0.5 * frame).abs());
            Skin {
                albedo: stone.worn(if d < frame { stone.accent } else { stone.field }, l.x, l.y),
                relief: 0.016 * raised - 0.004 * groove * raised + stone.rough(l.x, l.y),
                ink: 0.0,
            }
        },
    );
}

/// One bump of a carving.
#[derive(Clone, Copy)]
struct Bump {
    center: [f64; 2],
    radii: [f64; 2],
    turn: f64,
    depth: f64,
    colour: Colour,
}

/// Bumps of which the highest wins, and lines where they meet.
struct Carving(Vec<Bump>);

impl Carving {
    /// (rise, index) of the highest, and how far under it the second is.
    fn highest(&self, x: f64, y: f64) -> Option<(f64, usize, f64)> {
        let (mut best, mut second) = ((0.0, usize::MAX), 0.0f64);
        for (i, b) in self.0.iter().enumerate() {
            let reach = b.radii[0].max(b.radii[1]);
            let (dx, dy) = (x - b.center[0], y - b.center[1]);
            if dx.abs() > reach || dy.abs() > reach {
                continue;
            }
            let (sin, cos) = (libm::sin(b.turn), libm::cos(b.turn));
            let (u, v) = ((cos * dx + sin * dy) / b.radii[0], (cos * dy - sin * dx) / b.radii[1]);
            let rise = b.depth * (1.0 - u * u - v * v).max(0.0).sqrt();
            if rise > best.0 {
                second = best.0;
                best = (rise, i);
            } else if rise > second {
                second = rise;
            }
        }
        (best.1 != usize::MAX).then_some((best.0, best.1, best.0 - second))
    }

    fn lay(self, stage: &mut Stage, stone: Stone) {
        let bumps = std::sync::Arc::new(self);
        let dressed = bumps.clone();
        stage.lay(
            Shape::Free(Box::new(move |x, y| {
                let (rise, index, apart) = bumps.highest(x, y)?;
                Some(Local {
                    s: index as f64,
                    ..at(x, y, apart, rise)
                })
            })),
            0.9,
            move |l| {
                let bump = dressed.0[(l.s as usize).min(dressed.0.len() - 1)];
                Skin {
                    albedo: stone.worn(bump.colour, l.x, l.y),
                    relief: stone.rough(l.x, l.y),
                    ink: 0.75 * smoothstep(0.0035, 0.0008, l.e),
                }
            },
        );
    }
}

/// A round medallion: a rosette in rings of petals within a rim of beads.
fn medallion(dice: Dice, stone: Stone) -> Stage {
    let mut stage = Stage {
        aspect: 1.0,
        parts: Vec::new(),
        whole_canvas: false,
    };
    let radius = dice.between("radius", 0.40, 0.45);
    slab(&mut stage, stone, 0.05, 0.065, move |x, y| {
        radius - (x * x + y * y).sqrt()
    });
    let mut carving = Carving(Vec::new());
    let count = dice.between("petals", 8.0, 13.0).round();
    let rings = dice.pick("rings", &[2usize, 3]);
    for ring in 0..rings {
        let share = 1.0 - ring as f64 / rings as f64;
        let reach = share * (radius - 0.09);
        let petals = (count * (0.55 + 0.45 * share)).round();
        for k in 0..petals as usize {
            let turn = TAU * (k as f64 + 0.5 * (ring % 2) as f64) / petals;
            let long = 0.5 * reach * 0.62;
            let middle = reach - long;
            carving.0.push(Bump {
                center: [middle * libm::cos(turn), middle * libm::sin(turn)],
                radii: [long, (PI * middle / petals * 1.05).max(0.02)],
                turn,
                depth: 0.034 + 0.014 * ring as f64,
                colour: if ring % 2 == 0 { stone.raised } else { stone.accent },
            });
        }
    }
    carving.0.push(Bump {
        center: [0.0; 2],
        radii: [0.075; 2],
        turn: 0.0,
        depth: 0.075,
        colour: stone.field,
    });
    let beads = dice.between("beads", 30.0, 42.0).round();
    for k in 0..beads as usize {
        let turn = TAU * k as f64 / beads;
        let r = radius - 0.034;
        carving.0.push(Bump {
            center: [r * libm::cos(turn), r * libm::sin(turn)],
            radii: [2.2 * r / beads; 2],
            turn: 0.0,
            depth: 0.020,
            colour: stone.raised,
        });
    }
    carving.lay(&mut stage, stone);
    stage
}

/// A figure pressed to a share of its depth.
fn pressed(stage: &mut Stage, figure: Stage, stone: Stone, at_place: [f64; 2], size: f64, depth: f64, paint: f64) {
    let figure = std::sync::Arc::new(figure);
    let dressed = figure.clone();
    let into = move |x: f64, y: f64| ((x - at_place[0]) / size, (y - at_place[1]) / size);
    stage.lay(
        Shape::Free(Box::new(move |x, y| {
            let (u, v) = into(x, y);
            let hit = figure.trace(u, v);
            hit.part.map(|part| Local {
                s: part as f64,
                ..at(x, y, 0.0, 0.008 + depth * size * hit.height)
            })
        })),
        1.0,
        move |l| {
            let (u, v) = into(l.x, l.y);
            let hit = dressed.trace(u, v);
            Skin {
                albedo: stone.worn(mix(stone.raised, hit.skin.albedo, paint), l.x, l.y),
                relief: stone.rough(l.x, l.y),
                ink: hit.skin.ink,
            }
        },
    );
}

/// An arched stele with a figure in its niche.
fn stele(dice: Dice, stone: Stone, number: u64, seed: u64) -> Stage {
    let mut stage = Stage {
        aspect: 0.72,
        parts: Vec::new(),
        whole_canvas: false,
    };
    let half = dice.between("half", 0.27, 0.30);
    let spring = -0.46 + half;
    slab(&mut stage, stone, 0.055, 0.034, move |x, y| {
        if y < spring {
            half - (x * x + (y - spring) * (y - spring)).sqrt()
        } else {
            (half - x.abs()).min(0.46 - y)
        }
    });
    // rays or leaves about the head
    let mut carving = Carving(Vec::new());
    let rays = dice.between("rays", 15.0, 23.0).round();
    for k in 0..rays as usize {
        let turn = PI + PI * (k as f64 + 0.5) / rays;
        let r = 0.66 * half;
        carving.0.push(Bump {
            center: [r * libm::cos(turn), spring + 0.02 + r * libm::sin(turn)],
            radii: [0.22 * half, 0.75 * PI * r / rays],
            turn,
            depth: 0.018,
            colour: stone.accent,
        });
    }
    carving.lay(&mut stage, stone);
    let paint = if dice.chance("painted figure", 0.5) { 0.75 } else { 0.0 };
    let figure = figures::stage(number + 100, seed);
    pressed(&mut stage, figure, stone, [0.0, 0.045], 0.80, 0.55, paint);
    stage
}

/// A frieze over the whole canvas: figures side by side under a row of ornaments.
fn frieze(dice: Dice, stone: Stone) -> Stage {
    let mut stage = Stage {
        aspect: 1.35,
        parts: Vec::new(),
        whole_canvas: true,
    };
    slab(&mut stage, stone, 0.05, 0.0, |_, _| 1.0);
    let mut carving = Carving(Vec::new());
    let half = 0.5 / 1.35;
    let count = dice.between("ornaments", 11.0, 16.0).round();
    let petal = dice.chance("petals", 0.5);
    for row in [-1.0, 1.0] {
        for k in 0..count as usize {
            let x = -0.5 + (k as f64 + 0.5) / count;
            carving.0.push(Bump {
                center: [x, row * (half - 0.040)],
                radii: if petal {
                    [0.47 / count, 0.036]
                } else {
                    [0.36 / count; 2]
                },
                turn: 0.0,
                depth: 0.024,
                colour: if k % 2 == 0 { stone.raised } else { stone.accent },
            });
        }
    }
    carving.lay(&mut stage, stone);
    let paint = if dice.chance("painted figures", 0.5) { 0.8 } else { 0.0 };
    for k in 0..3usize {
        let dice = dice.each("figure", k);
        let figure = figures::stage(200 + (dice.unit("which") * 60.0) as u64, dice.seed("folds") % 1000);
        let x = 0.315 * (k as f64 - 1.0);
        pressed(
            &mut stage,
            figure,
            stone,
            [x, 0.006],
            0.62,
            dice.between("depth", 0.5, 0.75),
            paint,
        );
    }
    stage
}

/// A square tablet of scrolling clouds or of waves, over the whole canvas or framed.
fn tablet(dice: Dice, stone: Stone) -> Stage {
    let framed = dice.chance("framed", 0.5);
    let mut stage = Stage {
        aspect: 1.0,
        parts: Vec::new(),
        whole_canvas: !framed,
    };
    if framed {
        slab(&mut stage, stone, 0.05, 0.04, |x: f64, y: f64| {
            // rounded corners
            let (u, v) = ((x.abs() - 0.36).max(0.0), (y.abs() - 0.36).max(0.0));
            0.08 - (u * u + v * v).sqrt()
        });
    } else {
        slab(&mut stage, stone, 0.05, 0.0, |_, _| 1.0);
    }
    let side = if framed { 0.375 } else { 0.6 };
    let waves = dice.chance("waves", 0.4);
    let scrolls: Vec<[f64; 5]> = (0..9)
        .map(|k| {
            let dice = dice.each("scroll", k);
            let (i, j) = ((k % 3) as f64 - 1.0, (k / 3) as f64 - 1.0);
            [
                0.27 * i + dice.between("x", -0.04, 0.04),
                0.27 * j + dice.between("y", -0.04, 0.04),
                dice.between("size", 0.13, 0.185),
                dice.pick("hand", &[-1.0, 1.0]),
                dice.unit("phase"),
            ]
        })
        .collect();
    let height = move |x: f64, y: f64| -> f64 {
        if waves {
            let d = scallops(x + 0.02 * libm::sin(9.0 * y), y, 0.17);
            let crest = libm::cos(3.0 * TAU * d);
            return 0.014 + 0.020 * (1.0 - d) + 0.007 * crest;
        }
        let mut best = 0.0f64;
        for &[cx, cy, size, handed, phase] in &scrolls {
            let (u, v) = (x - cx, y - cy);
            let r = (u * u + v * v).sqrt() / size;
            if r < 1.0 {
                let arm = 2.6 * r.sqrt() + handed * libm::atan2(v, u) / TAU + phase;
                let ridge = libm::sin(PI * (arm - arm.floor()));
                best = best.max(0.040 * ridge * (1.0 - r * r).sqrt() + 0.010 * (1.0 - r));
            }
        }
        best
    };
    let carved = std::sync::Arc::new(height);
    let dressed = carved.clone();
    stage.lay(
        Shape::Free(Box::new(move |x, y| {
            if x.abs() > side || y.abs() > side {
                return None;
            }
            let fade = smoothstep(side, side - 0.02, x.abs().max(y.abs()));
            let rise = carved(x, y) * if side < 0.5 { fade } else { 1.0 };
            (rise > 1e-4).then(|| at(x, y, 0.0, rise))
        })),
        0.0,
        move |l| {
            let h = dressed(l.x, l.y);
            Skin {
                albedo: stone.worn(mix(stone.field, stone.raised, smoothstep(0.006, 0.022, h)), l.x, l.y),
                relief: stone.rough(l.x, l.y),
                ink: 0.35 * smoothstep(0.008, 0.002, h),
            }
        },
    );
    stage
}
