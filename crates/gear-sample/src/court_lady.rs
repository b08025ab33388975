//! A court lady with a round fan, after the manner of Tang painters: high bun with a peony, long skirt under a
//! high sash, an open robe with wide sleeves, a shawl.

use crate::palette::{Palette, mix, scale};
use crate::random::smoothstep;
use crate::shape::{Ellipsoid, Ends, Knot, Local, Shape, Tube, knot};
use crate::stage::{Colour, Skin, Stage};
use crate::textile::{Pleats, blossom, fret, roundels, sprinkled, unrolled};

/// Width of a drawn fold line, world units.
const FOLD_LINE: f64 = 0.0016;

fn tube(knots: &[Knot], ends: Ends) -> Shape {
    Shape::Tube(Tube::new(knots, ends))
}

fn ball(center: [f64; 2], radii: [f64; 2], turn: f64, depth: f64, z: f64) -> Shape {
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
    shawl_behind(&mut stage);
    shoes(&mut stage);
    back_hair(&mut stage);
    skirt(&mut stage, seed);
    robe_panels(&mut stage, seed);
    bodice(&mut stage, seed);
    head(&mut stage);
    hair(&mut stage);
    sash(&mut stage, seed);
    sleeves(&mut stage, seed);
    fan(&mut stage);
    shawl_before(&mut stage);
    stage
}

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

fn shawl_behind(stage: &mut Stage) {
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

fn shoes(stage: &mut Stage) {
    for side in [-1.0, 1.0] {
        let shoe = ball([side * 0.062, 0.435], [0.048, 0.024], side * 0.12, 0.05, 0.03);
        stage.add(shoe, 1.0, move |l| {
            let p = Palette::court();
            let sole = l.y > 0.45;
            let toe = blossom(l.x - 0.1 * side, l.y + 0.1, 0.36, 2.5, p.gold, p.white);
            Skin::plain(if sole { p.white } else { toe.unwrap_or(p.lac) })
        });
    }
}

fn back_hair(stage: &mut Stage) {
    stage.add(ball([0.0, -0.3185], [0.064, 0.062], 0.0, 0.03, 0.0), 1.0, |_| {
        Skin::plain(scale(Palette::court().ink, 1.3))
    });
}

fn skirt(stage: &mut Stage, seed: u64) {
    let knots = [
        knot(0.000, -0.150, 0.092, 0.062, 0.0),
        knot(0.004, -0.02, 0.104, 0.075, 0.0),
        knot(0.008, 0.14, 0.136, 0.092, 0.0),
        knot(0.002, 0.30, 0.168, 0.105, 0.0),
        knot(-0.006, 0.420, 0.196, 0.115, 0.0),
    ];
    let pleats = Pleats {
        count: 13.0,
        height: 0.085,
        from: [0.05, 0.55],
        sweep: 1.2,
        seed: seed + 101,
    };
    stage.add(tube(&knots, Ends::Cut(0.10)), 1.15, move |l| {
        let p = Palette::court();
        let (u, v) = unrolled(l);
        let (relief, ink) = pleats.at(l, FOLD_LINE);
        // hem: a gold rule, a blue band with blossoms, a gold fret
        // the hem hangs in an arc, and the bands follow it
        let rise = (1.0 - l.s) * l.length + 0.10 * l.width * (1.0 - l.e * l.e).max(0.0).sqrt();
        let albedo = if rise < 0.004 {
            p.gold
        } else if rise < 0.056 {
            let middle = rise - 0.030;
            let cell = 0.040;
            let x = (u / cell - (u / cell).floor() - 0.5) * cell;
            blossom(x, middle, 0.016, 2.5, p.white, p.cinnabar).unwrap_or(p.azurite)
        } else if rise < 0.060 {
            p.white
        } else if rise < 0.078 {
            if fret(u, (rise - 0.060) / 0.018, 0.022) {
                p.gold
            } else {
                p.lac
            }
        } else {
            roundels(u, v + 0.02, 0.074, [p.gold, p.lac, p.peony]).unwrap_or(p.cinnabar)
        };
        Skin { albedo, relief, ink }
    });
}

fn robe_cloth(l: &Local, pleats: &Pleats) -> Skin {
    let p = Palette::court();
    let (u, v) = unrolled(l);
    let (relief, ink) = pleats.at(l, FOLD_LINE);
    let cloth = sprinkled(u, v, 0.030, 0.62, 81, [p.white, p.gold]).unwrap_or(p.malachite);
    Skin {
        albedo: cloth,
        relief,
        ink,
    }
}

fn robe_panels(stage: &mut Stage, seed: u64) {
    for side in [-1.0, 1.0] {
        let knots = [
            knot(side * 0.072, -0.205, 0.046, 0.040, 0.030),
            knot(side * 0.098, -0.05, 0.044, 0.036, 0.034),
            knot(side * 0.138, 0.12, 0.050, 0.038, 0.032),
            knot(side * 0.176, 0.28, 0.058, 0.042, 0.026),
            knot(side * 0.190, 0.372, 0.066, 0.044, 0.020),
        ];
        let pleats = Pleats {
            count: 5.0,
            height: 0.16,
            from: [0.1, 0.5],
            sweep: side * 0.9,
            seed: seed + 111 + (side > 0.0) as u64,
        };
        stage.add(tube(&knots, Ends::Cut(0.25)), 1.1, move |l| {
            let p = Palette::court();
            let mut skin = robe_cloth(l, &pleats);
            let (u, _) = unrolled(l);
            let inner = side * l.e;
            let rise = (1.0 - l.s) * l.length;
            if inner < -0.72 || rise < 0.026 {
                let t = if inner < -0.72 {
                    (inner + 1.0) / 0.28
                } else {
                    rise / 0.026
                };
                let along = if inner < -0.72 { l.s * l.length } else { u };
                skin.albedo = if fret(along, t.clamp(0.0, 1.0), 0.024) {
                    p.gold
                } else {
                    p.indigo
                };
            }
            skin
        });
    }
}

fn bodice(stage: &mut Stage, seed: u64) {
    let shoulders = [
        knot(-0.112, -0.176, 0.040, 0.046, 0.006),
        knot(-0.070, -0.212, 0.044, 0.058, 0.010),
        knot(0.0, -0.215, 0.058, 0.070, 0.012),
        knot(0.070, -0.212, 0.044, 0.058, 0.010),
        knot(0.112, -0.176, 0.040, 0.046, 0.006),
    ];
    let calm = Pleats {
        count: 4.0,
        height: 0.05,
        from: [0.0, 0.3],
        sweep: 0.4,
        seed: seed + 121,
    };
    stage.add(tube(&shoulders, Ends::Round), 1.0, move |l| robe_cloth(l, &calm));
    let torso = [
        knot(0.0, -0.225, 0.080, 0.066, 0.012),
        knot(0.0, -0.135, 0.094, 0.068, 0.012),
    ];
    stage.add(tube(&torso, Ends::Cut(0.0)), 0.0, move |l| robe_cloth(l, &calm));
    // neck and the powdered chest between the collars
    let chest = [
        knot(0.0, -0.29, 0.026, 0.028, 0.040),
        knot(0.0, -0.235, 0.028, 0.030, 0.055),
        knot(0.0, -0.160, 0.050, 0.022, 0.070),
    ];
    stage.add(tube(&chest, Ends::Cut(0.1)), 0.8, |l| {
        let p = Palette::court();
        let necklace = (l.s - 0.55 - 0.07 * (1.0 - l.e * l.e)).abs() * l.length;
        let beads = necklace < 0.0035;
        Skin {
            albedo: if beads { p.gold } else { p.skin },
            relief: if beads { 0.002 } else { 0.0 },
            ink: 0.0,
        }
    });
    for side in [1.0, -1.0] {
        let collar = [
            knot(side * 0.030, -0.258, 0.013, 0.008, 0.002),
            knot(side * 0.048, -0.212, 0.015, 0.009, 0.003),
            knot(side * 0.024, -0.150, 0.016, 0.009, 0.003),
            knot(-side * 0.004, -0.118, 0.016, 0.008, 0.003),
        ];
        stage.lay(tube(&collar, Ends::Cut(0.0)), 0.9, move |l| {
            let p = Palette::court();
            let (u, _) = unrolled(l);
            let edge = side * l.e > 0.45;
            let cell = 0.018;
            let v = l.s * l.length;
            let dot = blossom(
                u,
                (v / cell - (v / cell).floor() - 0.5) * cell,
                0.0075,
                2.5,
                p.peony,
                p.cinnabar,
            );
            Skin::plain(if edge { p.gold } else { dot.unwrap_or(p.indigo) })
        });
    }
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

fn head(stage: &mut Stage) {
    stage.add(ball([0.0, -0.322], [0.052, 0.062], 0.0, 0.062, 0.046), 0.9, |l| {
        let p = Palette::court();
        let (x, y) = (l.x, l.y);
        let side = x.abs();
        let nose = smoothstep(0.16, 0.0, (x * x + 0.35 * (y - 0.10) * (y - 0.10)).sqrt()) * smoothstep(0.42, 0.26, y);
        let socket = smoothstep(
            0.30,
            0.0,
            ((side - 0.40) * (side - 0.40) + 2.5 * (y + 0.04) * (y + 0.04)).sqrt(),
        );
        let chin = smoothstep(0.25, 0.0, (x * x + (y - 0.78) * (y - 0.78)).sqrt());
        let cheek = smoothstep(
            0.42,
            0.05,
            ((side - 0.52) * (side - 0.52) + (y - 0.32) * (y - 0.32)).sqrt(),
        );
        let mouth_lobe = |cx: f64, cy: f64, r: f64| ((x - cx) * (x - cx) + 2.2 * (y - cy) * (y - cy)).sqrt() / r;
        let lips = mouth_lobe(-0.065, 0.485, 0.095)
            .min(mouth_lobe(0.065, 0.485, 0.095))
            .min(mouth_lobe(0.0, 0.545, 0.10));
        let mut albedo: Colour = mix(p.skin, p.rouge, 0.55 * cheek);
        albedo = mix(albedo, p.cinnabar, 0.92 * smoothstep(1.05, 0.85, lips));
        // the flower mark between the brows
        if let Some(mark) = blossom(x, y + 0.42, 0.10, 2.0, p.cinnabar, p.gold) {
            albedo = mark;
        }
        let brow = stroke(side - 0.42, y + 0.34 - 0.25 * (side - 0.42), 0.20, 0.05, 0.075);
        let lid = stroke(side - 0.40, y + 0.075 + 0.10 * (side - 0.40), 0.23, 0.10, 0.050);
        let under = 0.45 * stroke(side - 0.40, y - 0.005 + 0.10 * (side - 0.40), 0.18, -0.045, 0.026);
        let iris = smoothstep(
            0.075,
            0.05,
            ((side - 0.40) * (side - 0.40) + (y + 0.035) * (y + 0.035)).sqrt(),
        );
        let wing = 0.55 * stroke(side - 0.10, y - 0.285, 0.055, -0.03, 0.030);
        let bridge = 0.40 * stroke(y - 0.06, x - 0.085, 0.24, 0.02, 0.020);
        let parting = 0.7 * stroke(x, y - 0.505, 0.15, -0.02, 0.020);
        let double_chin = 0.35 * stroke(x, y - 0.80, 0.26, -0.05, 0.022);
        let ink = brow
            .max(lid)
            .max(under)
            .max(iris)
            .max(wing)
            .max(bridge)
            .max(parting)
            .max(double_chin);
        let relief = 0.012 * nose - 0.006 * socket + 0.004 * chin + 0.003 * smoothstep(1.4, 0.5, lips);
        Skin { albedo, relief, ink }
    });
}

fn strand(l: &Local, count: f64, strength: f64) -> Skin {
    let p = Palette::court();
    let wave = libm::sin(count * (libm::atan2(l.y + 1.6, l.x)) * 3.0 + 2.0 * l.e);
    let sheen = smoothstep(0.55, 1.0, wave) * strength;
    Skin {
        albedo: mix(scale(p.ink, 1.25), scale(p.indigo, 2.2), sheen),
        relief: 0.0012 * wave,
        ink: 0.0,
    }
}

fn hair(stage: &mut Stage) {
    // two wings that frame the face and a cap over the brow
    for side in [-1.0, 1.0] {
        let wing = [
            knot(side * 0.004, -0.386, 0.016, 0.020, 0.085),
            knot(side * 0.034, -0.374, 0.019, 0.024, 0.075),
            knot(side * 0.054, -0.338, 0.016, 0.022, 0.056),
            knot(side * 0.058, -0.296, 0.010, 0.016, 0.046),
        ];
        stage.add(tube(&wing, Ends::Round), 0.5, |l| {
            let wave = libm::sin(7.0 * l.e);
            let p = Palette::court();
            let sheen = smoothstep(0.6, 1.0, wave) * 0.5;
            Skin {
                albedo: mix(scale(p.ink, 1.25), scale(p.indigo, 2.2), sheen),
                relief: 0.001 * wave,
                ink: 0.0,
            }
        });
    }
    stage.add(ball([0.014, -0.424], [0.044, 0.036], -0.25, 0.045, 0.048), 0.5, |l| {
        strand(l, 6.0, 0.6)
    });
    stage.add(ball([0.028, -0.4415], [0.024, 0.020], -0.3, 0.030, 0.075), 0.5, |l| {
        strand(l, 5.0, 0.6)
    });
    // comb with teeth of gold
    stage.add(ball([0.0, -0.396], [0.030, 0.010], 0.0, 0.014, 0.092), 0.7, |l| {
        let p = Palette::court();
        let tooth = (l.x * 9.0 - (l.x * 9.0).floor()) > 0.5;
        Skin::plain(if l.y < -0.1 || tooth { p.gold } else { p.lac })
    });
    // a peony on the left, petals round a heart
    for ring in 0..2 {
        let (count, reach, size) = if ring == 0 {
            (8, 0.0200, 0.0145)
        } else {
            (5, 0.0095, 0.0110)
        };
        for k in 0..count {
            let turn = std::f64::consts::TAU * (k as f64 + 0.5 * f64::from(ring)) / f64::from(count);
            let center = [-0.041 + reach * libm::cos(turn), -0.409 + reach * libm::sin(turn)];
            let petal = ball(
                center,
                [size, 0.72 * size],
                turn,
                0.010,
                0.082 + 0.006 * f64::from(ring),
            );
            stage.add(petal, 0.45, |l| {
                let p = Palette::court();
                Skin::plain(mix(p.white, p.peony, smoothstep(0.9, -0.6, l.x)))
            });
        }
    }
    stage.add(ball([-0.041, -0.409], [0.0065, 0.0065], 0.0, 0.008, 0.098), 0.4, |_| {
        Skin::plain(Palette::court().gold)
    });
    // a hair pin with drops
    let pin = [
        knot(0.046, -0.398, 0.0028, 0.004, 0.07),
        knot(0.086, -0.412, 0.0028, 0.004, 0.06),
    ];
    stage.add(tube(&pin, Ends::Round), 0.4, |_| Skin::plain(Palette::court().gold));
    for (k, y) in [-0.400, -0.388, -0.376].into_iter().enumerate() {
        let drop = ball([0.086, y], [0.0046, 0.0056], 0.0, 0.005, 0.06);
        stage.add(drop, 0.4, move |_| {
            let p = Palette::court();
            Skin::plain(if k == 1 { p.cinnabar } else { p.gold })
        });
    }
    // ear drops
    for side in [-1.0, 1.0] {
        let drop = ball([side * 0.056, -0.272], [0.005, 0.008], 0.0, 0.006, 0.05);
        stage.add(drop, 0.4, |_| Skin::plain(Palette::court().celadon));
    }
}

fn sash(stage: &mut Stage, seed: u64) {
    let band = [
        knot(-0.098, -0.124, 0.022, 0.006, 0.002),
        knot(0.0, -0.112, 0.025, 0.010, 0.003),
        knot(0.098, -0.124, 0.022, 0.006, 0.002),
    ];
    stage.lay(tube(&band, Ends::Cut(0.0)), 0.9, |l| {
        let p = Palette::court();
        let rim = l.e.abs();
        let u = l.s * l.length;
        let cell = 0.030;
        let x = (u / cell - (u / cell).floor() - 0.5) * cell;
        let flower = blossom(x, l.e * l.width, 0.013, 2.5, p.gold, p.cinnabar);
        Skin::plain(if rim > 0.78 {
            p.gold
        } else {
            flower.unwrap_or(p.azurite)
        })
    });
    let ribbons: [[(f64, f64); 5]; 2] = [
        [
            (-0.006, -0.10),
            (-0.016, 0.02),
            (-0.004, 0.12),
            (-0.024, 0.22),
            (-0.014, 0.315),
        ],
        [
            (0.012, -0.10),
            (0.022, 0.01),
            (0.016, 0.10),
            (0.034, 0.19),
            (0.024, 0.265),
        ],
    ];
    for (k, path) in ribbons.iter().enumerate() {
        let knots: Vec<Knot> = path.iter().map(|&(x, y)| knot(x, y, 0.0125, 0.006, 0.003)).collect();
        let pleats = Pleats {
            count: 2.0,
            height: 0.2,
            from: [-0.4, 0.1],
            sweep: 1.0,
            seed: seed + 131 + k as u64,
        };
        stage.lay(tube(&knots, Ends::Cut(0.5)), 0.9, move |l| {
            let p = Palette::court();
            let (relief, ink) = pleats.at(l, 0.7 * FOLD_LINE);
            let tip = l.s > 0.93;
            let base = if k == 0 { p.celadon } else { p.white };
            Skin {
                albedo: if tip || l.e.abs() > 0.8 { p.gold } else { base },
                relief,
                ink,
            }
        });
    }
}

fn sleeves(stage: &mut Stage, seed: u64) {
    // the hanging mouths of the wide sleeves, then the arms before them
    for side in [-1.0, 1.0] {
        let low = if side < 0.0 { 0.0 } else { -0.012 };
        let hanging = [
            knot(side * 0.118, -0.045 + low, 0.050, 0.038, 0.062),
            knot(side * 0.120, 0.055 + low, 0.062, 0.040, 0.074),
            knot(side * 0.108, 0.165 + low, 0.072, 0.042, 0.084),
        ];
        let drop = Pleats {
            count: 6.0,
            height: 0.13,
            from: [0.0, 0.35],
            sweep: -side * 1.3,
            seed: seed + 141 + (side > 0.0) as u64,
        };
        stage.add(tube(&hanging, Ends::Cut(0.35)), 1.1, move |l| {
            let p = Palette::court();
            let mut skin = robe_cloth(l, &drop);
            let rise = (1.05 - l.s) * l.length + 0.02 * (1.0 - l.e * l.e).max(0.0).sqrt();
            if rise < 0.044 {
                let (u, _) = unrolled(l);
                let cell = 0.030;
                let x = (u / cell - (u / cell).floor() - 0.5) * cell;
                skin.albedo = blossom(x, rise - 0.022, 0.012, 2.5, p.peony, p.gold).unwrap_or(p.indigo);
                if !(0.006..0.040).contains(&rise) {
                    skin.albedo = p.gold;
                }
            }
            skin
        });
        let arm = if side < 0.0 {
            vec![
                knot(-0.108, -0.178, 0.040, 0.044, 0.020),
                knot(-0.150, -0.085, 0.046, 0.046, 0.040),
                knot(-0.128, -0.010, 0.044, 0.044, 0.080),
                knot(-0.066, 0.004, 0.036, 0.036, 0.104),
            ]
        } else {
            vec![
                knot(0.108, -0.178, 0.040, 0.044, 0.020),
                knot(0.152, -0.090, 0.046, 0.046, 0.040),
                knot(0.136, -0.030, 0.044, 0.044, 0.080),
                knot(0.098, -0.062, 0.036, 0.034, 0.106),
            ]
        };
        let wrap = Pleats {
            count: 5.0,
            height: 0.12,
            from: [0.0, 0.5],
            sweep: side * 3.0,
            seed: seed + 151 + (side > 0.0) as u64,
        };
        stage.add(tube(&arm, Ends::Cut(0.25)), 1.05, move |l| {
            let p = Palette::court();
            let mut skin = robe_cloth(l, &wrap);
            if l.s > 0.90 {
                skin.albedo = if l.s > 0.97 || l.s < 0.915 { p.gold } else { p.indigo };
            }
            skin
        });
    }
    hand(stage, [-0.030, 0.002], 0.10, 0.118);
}

/// A hand: a palm and four fingers that point along `turn`.
fn hand(stage: &mut Stage, at: [f64; 2], turn: f64, z: f64) {
    let (sin, cos) = (libm::sin(turn), libm::cos(turn));
    let skin = |_: &Local| Skin::plain(Palette::court().skin);
    stage.add(ball(at, [0.024, 0.0155], turn, 0.016, z), 0.6, skin);
    for k in 0..4 {
        let off = 0.0072 * (f64::from(k) - 1.5);
        let along = 0.024 - 0.0022 * (f64::from(k) - 1.2) * (f64::from(k) - 1.2);
        let center = [at[0] + cos * along - sin * off, at[1] + sin * along + cos * off];
        stage.add(
            ball(
                center,
                [0.017, 0.0046],
                turn + 0.10 * (f64::from(k) - 1.5),
                0.006,
                z + 0.006,
            ),
            0.45,
            skin,
        );
    }
}

fn fan(stage: &mut Stage) {
    let handle = [
        knot(0.062, -0.020, 0.0038, 0.005, 0.128),
        knot(0.108, -0.200, 0.0038, 0.005, 0.128),
    ];
    stage.add(tube(&handle, Ends::Round), 0.5, |_| Skin::plain(Palette::court().lac));
    stage.add(ball([0.130, -0.268], [0.072, 0.078], 0.2, 0.012, 0.126), 0.9, |l| {
        let p = Palette::court();
        let r = l.e;
        if r > 0.93 {
            return Skin {
                albedo: p.lac,
                relief: 0.002,
                ink: 0.0,
            };
        }
        // a branch of plum blossom on white silk
        let (x, y) = (l.x, l.y);
        let branch = stroke(x + 0.05, y - 0.25 + 0.55 * x, 0.80, -0.22, 0.050);
        let twig = stroke(y + 0.12, x - 0.18 - 0.3 * y, 0.38, 0.10, 0.030);
        let mut albedo = mix(p.white, p.silk, 0.25 * smoothstep(0.2, 1.0, r));
        for (fx, fy, size) in [
            (-0.45, 0.42, 0.17),
            (-0.12, 0.20, 0.20),
            (0.22, -0.34, 0.18),
            (0.36, 0.02, 0.21),
            (0.05, -0.10, 0.15),
            (0.52, -0.32, 0.13),
        ] {
            if let Some(c) = blossom(x - fx, y - fy, size, 2.5, p.cinnabar, p.gold) {
                albedo = c;
                return Skin::plain(mix(albedo, p.peony, 0.35));
            }
        }
        Skin {
            albedo,
            relief: 0.0,
            ink: 0.85 * branch.max(twig),
        }
    });
    hand(stage, [0.078, -0.075], -1.15, 0.132);
}

fn shawl_before(stage: &mut Stage) {
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
