//! Vessels and solids: turned and lobed bodies with painted or moulded ornament, bowls of fruit, and plain solids
//! with edges.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::court_lady::{ball, tube};
use crate::palette::{Palette, mix, scale};
use crate::random::{fractal, smoothstep};
use crate::shape::{Ends, Knot, Local, Shape, knot};
use crate::stage::{Colour, Skin, Stage};
use crate::textile::{blossom, fret, scallops, unrolled};

use super::cloth::Cloth;
use super::dice::Dice;

/// Builds vessel `number`.
pub fn stage(number: u64) -> Stage {
    let dice = Dice::of("vessel", number);
    let mut stage = Stage {
        aspect: dice.between("aspect", 0.78, 1.0),
        parts: Vec::new(),
        whole_canvas: false,
    };
    match number % 6 {
        1 => vase(&mut stage, dice, 0.0),
        2 => gourd(&mut stage, dice),
        3 => fruit(&mut stage, dice),
        4 => solids(&mut stage, dice),
        5 => censer(&mut stage, dice),
        _ => vase(&mut stage, dice, dice.between("lobes", 7.0, 12.0).round()),
    }
    stage
}

/// Angle round the axis at a point of a turned body, from −π/2 to π/2.
fn turn(l: &Local) -> f64 {
    libm::asin(l.e.clamp(-1.0, 1.0))
}

fn glazes() -> [Colour; 6] {
    let p = Palette::court();
    [
        p.white,
        p.celadon,
        mix(p.celadon, p.malachite, 0.4),
        p.ochre,
        mix(p.lac, p.cinnabar, 0.5),
        mix(p.white, p.silk, 0.6),
    ]
}

/// Ornament of a turned body: bands along it, a frieze of its own kind in each field, lobes round it.
fn turned(dice: Dice, lobes: f64) -> impl Fn(&Local) -> Skin + Send + Sync + 'static {
    let p = Palette::court();
    let glaze = dice.pick("glaze", &glazes());
    let dark = dice.pick("dark", &[p.azurite, p.indigo, p.lac, scale(p.malachite, 0.7)]);
    let accent = dice.pick("accent", &[p.gold, p.cinnabar, p.peony]);
    let fields = dice.pick("fields", &[3usize, 4, 5]);
    let cloth = Cloth::drawn(dice.each("glaze", 0));
    // fields of unequal height; the widest one lies about the belly
    let mut ends = vec![0.04];
    let weights: Vec<f64> = (0..fields)
        .map(|k| dice.each("field", k).between("height", 0.5, 1.6))
        .collect();
    let total: f64 = weights.iter().sum();
    for w in &weights {
        ends.push(ends[ends.len() - 1] + 0.92 * w / total);
    }
    let kinds: Vec<u32> = (0..fields)
        .map(|k| dice.each("field", k).pick("kind", &[0, 0, 1, 2, 3, 4, 5]))
        .collect();
    let moulded = dice.between("moulded", 0.004, 0.009);
    move |l| {
        let p = Palette::court();
        let angle = turn(l);
        let (u, v) = unrolled(l);
        let field = ends.windows(2).position(|w| (w[0]..w[1]).contains(&l.s));
        let facing = (1.0 - l.e * l.e).max(0.0).sqrt();
        // lobes fade out towards mouth and foot
        let lobe = if lobes > 0.0 {
            let arch = libm::sin(PI * (lobes * angle / PI + 0.5 - (lobes * angle / PI + 0.5).floor()));
            0.16 * l.width * arch * facing * smoothstep(0.05, 0.35, l.s) * smoothstep(0.98, 0.75, l.s)
        } else {
            0.0
        };
        let Some(field) = field else {
            return Skin {
                albedo: accent,
                relief: lobe + 0.002,
                ink: 0.0,
            };
        };
        let (from, to) = (ends[field], ends[field + 1]);
        let t = (l.s - from) / (to - from);
        let rule = 0.010 / ((to - from) * l.length);
        if t < rule || t > 1.0 - rule {
            return Skin {
                albedo: accent,
                relief: lobe + 0.003,
                ink: 0.0,
            };
        }
        let mut skin = Skin::plain(glaze);
        skin.relief = lobe;
        match kinds[field] {
            1 => {
                if fret(angle * 0.2, t, 0.050) {
                    skin.albedo = dark;
                }
            }
            2 => {
                // upright petals, moulded
                let x = angle * 2.6;
                let across = (x - x.floor() - 0.5).abs() * 2.0;
                let rim = (1.0 - t * t).max(0.0).sqrt();
                let inside = smoothstep(0.0, 0.3, rim - across);
                skin.albedo = mix(dark, mix(glaze, accent, 0.4 * t), inside);
                skin.relief += 1.3 * moulded * inside;
                skin.ink = 0.7 * smoothstep(0.30, 0.06, (inside - 0.4).abs());
            }
            3 => {
                let d = scallops(u, v, 0.040);
                if d > 0.82 || (0.40..0.54).contains(&d) {
                    skin.albedo = dark;
                }
                skin.relief += 0.6 * moulded * (1.0 - d * d);
            }
            4 => {
                // blossoms in high relief
                let pitch = 0.105;
                let x = (angle * 0.19 / pitch + 0.5 * field as f64).rem_euclid(1.0) - 0.5;
                let y = (t - 0.5) * (to - from) * l.length;
                let r = (0.42 * (to - from) * l.length).min(0.042);
                if let Some(c) = blossom(x * pitch, y, r, 2.5, accent, dark) {
                    let d = ((x * pitch) * (x * pitch) + y * y).sqrt() / r;
                    skin.albedo = c;
                    skin.relief += 1.6 * moulded * (1.0 - d * d).max(0.0).sqrt();
                }
            }
            5 => skin.albedo = cloth.at_place(u, v),
            _ => {
                // thrown: faint rings of the potter's fingers
                skin.albedo = mix(glaze, dark, 0.12 * smoothstep(0.3, 1.0, t));
                skin.relief += 0.0014 * libm::sin(TAU * v / 0.030);
            }
        }
        if glaze[0] < p.ochre[0] {
            skin.ink *= 0.6;
        }
        skin
    }
}

/// A turned body from its profile: widths at heights from the mouth down to the foot.
fn profile(points: &[[f64; 2]]) -> Shape {
    let knots: Vec<Knot> = points.iter().map(|&[y, w]| knot(0.0, y, w, 0.98 * w, 0.0)).collect();
    tube(&knots, Ends::Cut(0.10))
}

fn vase(stage: &mut Stage, dice: Dice, lobes: f64) {
    let (top, foot) = (dice.between("top", -0.43, -0.36), dice.between("foot", 0.40, 0.44));
    let tall = foot - top;
    let belly = dice.between("belly", 0.19, 0.27);
    let at = dice.between("belly at", 0.42, 0.66);
    let neck = dice.between("neck", 0.055, 0.11);
    let neck_at = dice.between("neck at", 0.10, 0.22);
    let lip = neck + dice.between("lip", 0.012, 0.05);
    let base = dice.between("base", 0.085, 0.14);
    if dice.chance("handles", 0.55) {
        for side in [-1.0, 1.0] {
            let handle = [
                knot(side * 0.8 * neck, top + 0.07 * tall, 0.013, 0.015, 0.02),
                knot(side * (neck + 0.085), top + 0.10 * tall, 0.014, 0.017, 0.02),
                knot(side * (neck + 0.105), top + 0.22 * tall, 0.014, 0.017, 0.02),
                knot(side * 0.72 * belly, top + (at - 0.16) * tall, 0.017, 0.018, 0.02),
            ];
            let colour = dice.pick("handle", &glazes());
            stage.add(tube(&handle, Ends::Round), 1.1, move |_| Skin::plain(colour));
        }
    }
    let y = |t: f64| top + t * tall;
    let shape = profile(&[
        [y(0.0), lip],
        [y(0.5 * neck_at), 0.5 * (lip + neck)],
        [y(neck_at), neck],
        [y(0.5 * (neck_at + at)), 0.35 * neck + 0.62 * belly],
        [y(at), belly],
        [y(at + 0.40 * (1.0 - at)), 0.62 * belly + 0.38 * base],
        [y(at + 0.75 * (1.0 - at)), 0.15 * belly + 0.85 * base],
        [y(1.0), base + 0.008],
    ]);
    stage.add(shape, 1.2, turned(dice, lobes));
    mouth(stage, [0.0, y(0.0)], lip);
}

/// The dark inside of a mouth, seen a little from above.
fn mouth(stage: &mut Stage, at: [f64; 2], radius: f64) {
    stage.add(ball(at, [radius, 0.20 * radius], 0.0, 0.004, 0.5 * radius), 1.0, |l| {
        let p = Palette::court();
        Skin::plain(if l.e > 0.8 {
            mix(p.white, p.gold, 0.5)
        } else {
            scale(p.ink, 1.6)
        })
    });
}

fn gourd(stage: &mut Stage, dice: Dice) {
    let (upper, lower) = (dice.between("upper", 0.105, 0.145), dice.between("lower", 0.19, 0.235));
    let waist = dice.between("waist", 0.050, 0.085);
    let lobes = if dice.chance("lobed", 0.5) {
        dice.between("lobes", 6.0, 10.0).round()
    } else {
        0.0
    };
    let shape = profile(&[
        [-0.43, 0.034],
        [-0.38, 0.030],
        [-0.32, 0.75 * upper],
        [-0.24, upper],
        [-0.15, 0.85 * upper],
        [-0.085, waist],
        [-0.01, 0.72 * lower],
        [0.12, lower],
        [0.27, 0.95 * lower],
        [0.39, 0.62 * lower],
        [0.425, 0.58 * lower],
    ]);
    stage.add(shape, 1.2, turned(dice, lobes));
    let ribbon = dice.pick(
        "ribbon",
        &[
            Palette::court().cinnabar,
            Palette::court().gold,
            Palette::court().azurite,
        ],
    );
    let tie = [
        knot(-waist - 0.012, -0.085, 0.016, 0.012, 0.2 * waist),
        knot(0.0, -0.072, 0.018, 0.014, waist),
        knot(waist + 0.012, -0.085, 0.016, 0.012, 0.2 * waist),
    ];
    stage.add(tube(&tie, Ends::Round), 1.0, move |l| Skin {
        albedo: ribbon,
        relief: 0.002 * libm::sin(60.0 * l.s),
        ink: 0.0,
    });
    mouth(stage, [0.0, -0.43], 0.034);
}

/// A bowl with peaches, a melon and leaves.
fn fruit(stage: &mut Stage, dice: Dice) {
    let wide = dice.between("wide", 0.26, 0.32);
    let rim = dice.between("rim", 0.02, 0.08);
    stage.aspect = 1.0;
    // what lies behind, then before
    for (row, count, y, size) in [(0usize, 3usize, rim - 0.155, 0.125), (1, 4, rim - 0.060, 0.098)] {
        for k in 0..count {
            let dice = dice.each("fruit", 10 * row + k);
            let x = wide * 0.62 * (2.0 * k as f64 / (count - 1) as f64 - 1.0) + dice.between("x", -0.015, 0.015);
            let r = size * dice.between("size", 0.85, 1.12);
            let center = [x, y + dice.between("y", -0.02, 0.02) + 0.3 * x * x];
            fruit_piece(stage, dice, center, r, 0.010 + 0.055 * row as f64);
        }
    }
    for k in 0..dice.pick("leaves", &[2usize, 3]) {
        let dice = dice.each("leaf", k);
        let angle = dice.between("turn", -2.8, -0.3);
        let at = [dice.between("x", -0.16, 0.16), rim - dice.between("y", 0.14, 0.24)];
        stage.add(ball(at, [0.075, 0.026], angle, 0.012, 0.115), 0.8, |l| {
            let p = Palette::court();
            let vein = smoothstep(0.16, 0.05, l.y.abs());
            Skin {
                albedo: mix(scale(p.malachite, 0.8), p.celadon, vein),
                relief: -0.006 * vein,
                ink: 0.0,
            }
        });
    }
    let deep = dice.between("deep", 0.20, 0.27);
    let shape = profile(&[
        [rim, wide],
        [rim + 0.30 * deep, 0.93 * wide],
        [rim + 0.65 * deep, 0.72 * wide],
        [rim + 0.90 * deep, 0.42 * wide],
        [rim + deep, 0.30 * wide],
        [rim + deep + 0.050, 0.34 * wide],
    ]);
    let lobes = if dice.chance("lobed", 0.5) { 9.0 } else { 0.0 };
    stage.add(shape, 1.2, turned(dice, lobes));
}

fn fruit_piece(stage: &mut Stage, dice: Dice, center: [f64; 2], r: f64, z: f64) {
    let p = Palette::court();
    let blush = dice.pick("blush", &[p.cinnabar, p.peony, p.lac, p.gold]);
    let skin = dice.pick("skin", &[p.gold, p.peony, mix(p.gold, p.malachite, 0.5), p.ochre]);
    let ribs = dice.pick("ribs", &[0.0, 0.0, 9.0, 12.0]);
    let tilt = dice.between("tilt", -0.6, 0.6);
    let seed = dice.seed("mottle");
    stage.add(ball(center, [r, 0.94 * r], tilt, 0.95 * r, z), 1.0, move |l| {
        let p = Palette::court();
        let mottle = fractal(seed, 3.0 * l.x, 3.0 * l.y, 3);
        let mut albedo = mix(skin, blush, smoothstep(-0.5, 0.9, 0.8 * l.y + 0.5 * mottle));
        // a peach has one seam, a melon many ribs; both meet at the stalk
        let stalk = ((l.x) * (l.x) + (l.y + 0.45) * (l.y + 0.45)).sqrt();
        let round = libm::atan2(l.x, l.y + 0.45);
        let relief = if ribs > 0.0 {
            let t = ribs * round / TAU;
            0.085 * r * libm::sin(PI * (t - t.floor())) * smoothstep(0.05, 0.5, stalk)
        } else {
            let seam = smoothstep(0.22, 0.0, (l.x + 0.12 * l.y).abs()) * smoothstep(-0.9, -0.2, l.y);
            -0.10 * r * seam
        };
        if ribs > 0.0 {
            albedo = mix(albedo, scale(p.malachite, 0.7), 0.35 * smoothstep(0.4, -0.4, mottle));
        }
        let dip = smoothstep(0.22, 0.0, stalk);
        if stalk < 0.07 {
            albedo = scale(p.ochre, 0.4);
        }
        Skin {
            albedo,
            relief: relief - 0.12 * r * dip,
            ink: 0.0,
        }
    });
}

/// Plain solids: a ball, a cone, a ring, a faceted stone, a cylinder, each of one or two colours.
fn solids(stage: &mut Stage, dice: Dice) {
    stage.aspect = 1.0;
    let p = Palette::court();
    let colours = [p.cinnabar, p.azurite, p.gold, p.white, p.malachite, p.peony, p.ochre];
    let colour = |what: &str| dice.pick(what, &colours);
    let flip = dice.pick("flip", &[-1.0, 1.0]);
    // a cylinder at the back, lying or standing
    let (a, b) = (colour("cylinder"), colour("cylinder band"));
    let w = dice.between("cylinder wide", 0.085, 0.115);
    let tall = [knot(flip * 0.17, -0.36, w, w, 0.0), knot(flip * 0.17, 0.22, w, w, 0.0)];
    stage.add(tube(&tall, Ends::Cut(0.16)), 1.1, move |l| {
        Skin::plain(if (0.46..0.62).contains(&l.s) { b } else { a })
    });
    stage.add(
        ball([flip * 0.17, -0.36], [w, 0.16 * w], 0.0, 0.004, 0.55 * w),
        0.9,
        move |_| Skin::plain(scale(a, 1.1)),
    );
    // a cone
    let (a, wide) = (colour("cone"), dice.between("cone wide", 0.13, 0.17));
    let cone = [
        knot(-flip * 0.17, -0.40, 0.004, 0.004, 0.02),
        knot(-flip * 0.17, -0.08, 0.5 * wide, 0.5 * wide, 0.02),
        knot(-flip * 0.17, 0.24, wide, wide, 0.02),
    ];
    stage.add(tube(&cone, Ends::Cut(0.16)), 1.1, move |_| Skin::plain(a));
    // a ring that leans on them
    let (a, b) = (colour("ring"), colour("ring stripe"));
    let (cx, cy) = (flip * 0.06, 0.05);
    let (big, small) = (
        dice.between("ring", 0.10, 0.125),
        dice.between("ring thick", 0.032, 0.044),
    );
    let beads = dice.pick("beads", &[0.0, 14.0, 20.0]);
    stage.add(
        Shape::Free(Box::new(move |x, y| {
            let (u, v) = (x - cx, y - cy);
            let r = (u * u + v * v).sqrt() - big;
            let round = 1.0 - r * r / (small * small);
            (round > 0.0).then(|| Local {
                x: u,
                y: v,
                s: libm::atan2(v, u) / TAU + 0.5,
                e: r / small,
                width: small,
                length: big * TAU,
                rise: small * round.sqrt(),
                base: 0.135,
            })
        })),
        1.1,
        move |l| {
            let t = 10.0 * l.s;
            Skin {
                albedo: if t - t.floor() < 0.3 { b } else { a },
                relief: 0.10 * l.width * libm::sin(beads * TAU * l.s) * (1.0 - l.e * l.e).max(0.0).sqrt(),
                ink: 0.0,
            }
        },
    );
    // a cut stone: an octagon with a table and eight facets
    let a = colour("stone");
    let (cx, cy, size) = (-flip * 0.21, 0.27, dice.between("stone", 0.115, 0.14));
    let twist = dice.between("twist", 0.0, 0.7);
    stage.add(
        Shape::Free(Box::new(move |x, y| {
            let (u, v) = ((x - cx) / size, (y - cy) / size);
            let mut far = 0.0f64;
            for k in 0..8 {
                let angle = twist + f64::from(k) * TAU / 8.0;
                far = far.max(u * libm::cos(angle) + v * libm::sin(angle));
            }
            (far < 1.0).then(|| Local {
                x: u,
                y: v,
                s: 0.0,
                e: far,
                width: size,
                length: size,
                rise: size * (1.25 * (1.0 - far)).min(0.75),
                base: 0.09,
            })
        })),
        1.1,
        move |_| Skin::plain(a),
    );
    // a ball in front
    let (a, b) = (colour("ball"), colour("ball stripe"));
    let r = dice.between("ball", 0.105, 0.135);
    let stripes = dice.chance("striped", 0.5);
    stage.add(ball([flip * 0.10, 0.43 - r], [r, r], 0.4, r, 0.115), 1.1, move |l| {
        Skin::plain(if stripes && l.y.abs() < 0.22 { b } else { a })
    });
}

/// A bronze censer on three legs, with a pierced lid and upright ears.
fn censer(stage: &mut Stage, dice: Dice) {
    let p = Palette::court();
    stage.aspect = 1.0;
    let bronze = dice.pick(
        "bronze",
        &[mix(p.malachite, p.ochre, 0.45), mix(p.ochre, p.ink, 0.35), p.gold],
    );
    let patina = dice.pick("patina", &[p.malachite, p.celadon, p.lac]);
    let seed = dice.seed("patina");
    let metal = move |l: &Local| -> Colour {
        let t = fractal(seed, 14.0 * l.s * l.length + 3.0 * l.e, 7.0 * l.e, 4);
        mix(bronze, patina, 0.65 * smoothstep(0.0, 0.6, t))
    };
    let wide = dice.between("wide", 0.23, 0.28);
    for x in [-0.62, 0.62, 0.0] {
        let z = if x == 0.0 { 0.12 } else { 0.02 };
        let leg = [
            knot(x * wide, 0.16, 0.062, 0.06, z),
            knot(x * 1.10 * wide, 0.30, 0.036, 0.040, z),
            knot(x * 1.02 * wide, 0.40, 0.030, 0.034, z),
            knot(x * 1.14 * wide, 0.445, 0.044, 0.040, z),
        ];
        stage.add(tube(&leg, Ends::Round), 1.1, move |l| Skin {
            albedo: metal(l),
            relief: 0.006 * libm::sin(26.0 * l.s).max(0.0),
            ink: 0.0,
        });
    }
    for side in [-1.0, 1.0] {
        let ear = [
            knot(side * 0.92 * wide, -0.055, 0.019, 0.024, 0.03),
            knot(side * 1.16 * wide, -0.13, 0.019, 0.024, 0.03),
            knot(side * 1.12 * wide, -0.225, 0.021, 0.026, 0.03),
        ];
        stage.add(tube(&ear, Ends::Round), 1.1, move |l| Skin::plain(metal(l)));
    }
    let knobs = dice.between("knobs", 7.0, 11.0).round();
    let mask = dice.chance("mask", 0.6);
    let body = profile(&[
        [-0.085, 0.95 * wide],
        [-0.055, 0.86 * wide],
        [0.02, 0.98 * wide],
        [0.12, wide],
        [0.21, 0.80 * wide],
        [0.265, 0.42 * wide],
    ]);
    stage.add(body, 1.2, move |l| {
        let angle = turn(l);
        let facing = (1.0 - l.e * l.e).max(0.0).sqrt();
        let (mut relief, mut ink) = (0.0, 0.0);
        if l.s < 0.12 || (0.30..0.34).contains(&l.s) {
            relief = 0.006;
        } else if (0.14..0.30).contains(&l.s) {
            let t = knobs * (angle + FRAC_PI_2) / PI;
            let (u, v) = (2.0 * (t - t.floor()) - 1.0, (l.s - 0.22) / 0.07);
            relief = 0.016 * (1.0 - u * u - v * v).max(0.0).sqrt() * facing;
        } else if mask && (0.36..0.88).contains(&l.s) {
            // the beast's mask: brows, eyes, a ridge for a nose
            let (u, v) = (angle.abs() / 0.75, (l.s - 0.60) / 0.24);
            let eye = (1.0 - 14.0 * (u - 0.42) * (u - 0.42) - 9.0 * (v + 0.1) * (v + 0.1))
                .max(0.0)
                .sqrt();
            let brow = smoothstep(0.17, 0.02, (v + 0.55 + 0.4 * (u - 0.4) * (u - 0.4)).abs()) * smoothstep(1.0, 0.8, u);
            let nose = smoothstep(0.17, 0.03, u) * smoothstep(1.0, 0.6, v.abs());
            let jaw = smoothstep(0.15, 0.02, (v - 0.62 - 0.2 * u).abs()) * smoothstep(0.9, 0.6, u);
            relief = 0.017 * eye.max(0.8 * brow).max(0.9 * nose).max(0.7 * jaw) * facing;
            ink = 0.5 * smoothstep(0.35, 0.1, (eye - 0.3).abs()) * f64::from(eye > 0.0);
        }
        Skin {
            albedo: metal(l),
            relief,
            ink,
        }
    });
    let lid_top = dice.between("lid", -0.30, -0.25);
    let lid = profile(&[
        [lid_top, 0.05],
        [0.5 * (lid_top - 0.09), 0.72 * wide],
        [-0.105, 0.90 * wide],
        [-0.085, 0.93 * wide],
    ]);
    let slots = dice.between("slots", 5.0, 8.0).round();
    stage.add(lid, 1.1, move |l| {
        let t = slots * (turn(l) + FRAC_PI_2) / PI;
        let u = (2.0 * (t - t.floor()) - 1.0).abs();
        let v = ((l.s - 0.55) / 0.25).abs();
        let slot = smoothstep(1.0, 0.7, (u * u / 0.3 + v * v).sqrt());
        Skin {
            albedo: mix(metal(l), scale(Palette::court().ink, 1.6), slot),
            relief: -0.008 * slot,
            ink: 0.0,
        }
    });
    // a lion would be much; a jewel it is
    stage.add(
        ball([0.0, lid_top - 0.045], [0.052, 0.060], 0.0, 0.052, 0.0),
        1.0,
        move |l| Skin {
            albedo: metal(l),
            relief: 0.004 * libm::sin(9.0 * libm::atan2(l.y + 1.1, l.x)),
            ink: 0.0,
        },
    );
}
