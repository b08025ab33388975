//! Layered landscapes over the whole canvas: ranges, each nearer than the one above it, lakes, trees and houses.
//!
//! The layers are those of [`crate::landscape`]; their number, levels, colours and mist are drawn. Every third picture
//! is of rolling hills with round trees, every third of the sea.

use std::f64::consts::{PI, TAU};

use crate::landscape::{Lake, Manner, Range, add_range, free, local, pavilion, pine, ridge, sky, water};
use crate::palette::{Palette, mix, scale};
use crate::random::{fractal, noise, smoothstep};
use crate::stage::{Skin, Stage};

use super::dice::Dice;

/// Builds landscape `number`; `seed` moves rocks, mist and ripples.
pub fn stage(number: u64, seed: u64) -> Stage {
    let dice = Dice::of("landscape", number);
    let mut stage = Stage {
        aspect: dice.pick("aspect", &[1.4, 1.25, 1.0, 0.72]),
        parts: Vec::new(),
        whole_canvas: true,
    };
    let half = 0.5 / stage.aspect.max(1.0);
    let wide = 0.5 * stage.aspect.min(1.0);
    let sun = [
        dice.between("sun x", -0.8, 0.8) * wide,
        -half * dice.between("sun y", 0.55, 0.8),
    ];
    sky(&mut stage, seed, sun);
    match number % 3 {
        1 => mountains(&mut stage, dice, seed, half, wide),
        2 => hills(&mut stage, dice, seed, half, wide),
        _ => sea(&mut stage, dice, seed, half, wide),
    }
    stage
}

fn manner(dice: Dice) -> Manner {
    let p = Palette::court();
    let autumn = Manner {
        heights: scale(p.indigo, 2.2),
        slopes: mix(p.lac, p.ochre, 0.5),
        feet: p.gold,
    };
    let ink = Manner {
        heights: scale(p.ink, 4.5),
        slopes: mix(scale(p.ink, 5.5), p.silk, 0.25),
        feet: mix(p.silk, p.ink, 0.2),
    };
    let spring = Manner {
        heights: p.malachite,
        slopes: mix(p.celadon, p.malachite, 0.4),
        feet: mix(p.peony, p.silk, 0.5),
    };
    dice.pick("manner", &[Manner::blue_and_green(), autumn, ink, spring])
}

/// Ranges from the horizon down; the last is the near shore. Heights rise towards the viewer.
fn ranges(dice: Dice, seed: u64, half: f64, count: usize) -> Vec<Range> {
    let manner = manner(dice);
    let top = -half * dice.between("horizon", 0.05, 0.35);
    (0..count)
        .map(|k| {
            let dice = dice.each("range", k);
            let t = k as f64 / (count - 1).max(1) as f64;
            Range {
                level: top + (0.78 * half - top) * t + dice.between("level", -0.02, 0.02),
                peak: dice.between("peak", 0.10, 0.26) * (1.0 - 0.55 * t),
                count: dice.between("peaks", 1.6, 3.2),
                base: 0.025 + 0.150 * t,
                slope: dice.between("slope", 0.030, 0.060),
                mist: (0.8 - 0.9 * t).max(0.0) * dice.between("mist", 0.6, 1.1).min(1.0),
                manner,
                seed: dice.seed("rocks").wrapping_add(seed),
            }
        })
        .collect()
}

fn mountains(stage: &mut Stage, dice: Dice, seed: u64, half: f64, wide: f64) {
    let ranges = ranges(dice, seed, half, dice.pick("ranges", &[3usize, 4, 5]));
    let lake = dice.chance("lake", 0.6);
    let near = ranges[ranges.len() - 1];
    for range in &ranges[..ranges.len() - 1] {
        add_range(stage, *range);
    }
    if lake {
        let shore = near.level - dice.between("shore", 0.09, 0.13);
        water(
            stage,
            dice.seed("water").wrapping_add(seed),
            Lake {
                shore,
                base: 0.75 * near.base,
            },
        );
    }
    add_range(stage, near);
    if dice.chance("house", 0.7) {
        let x = wide * dice.between("house x", -0.5, 0.5);
        pavilion(stage, x, ridge(&near, x) - 0.045, near.base + 0.02);
    }
    for k in 0..dice.pick("pines", &[3usize, 5, 7]) {
        let dice = dice.each("pine", k);
        let side = if k % 2 == 0 { 1.0 } else { -1.0 };
        let x = side * wide * dice.between("x", 0.35, 0.95);
        pine(stage, x, dice.between("size", 0.7, 1.35), near, dice.seed("needles"));
    }
}

/// Rolling hills: smooth domes with terraces or furrows, round trees on them.
fn hills(stage: &mut Stage, dice: Dice, seed: u64, half: f64, wide: f64) {
    let far = ranges(dice, seed, half, 3);
    add_range(stage, far[0]);
    let manner = manner(dice);
    let p = Palette::court();
    let rows = dice.pick("rows", &[3usize, 4, 5]);
    for row in 0..rows {
        let dice = dice.each("row", row);
        let t = row as f64 / (rows - 1) as f64;
        let level = -0.25 * half + 0.95 * half * t;
        let base = 0.04 + 0.14 * t;
        let hills: Vec<[f64; 3]> = (0..3)
            .map(|k| {
                let dice = dice.each("hill", k);
                [
                    wide * (0.9 * (k as f64 - 1.0) + dice.between("x", -0.3, 0.3)),
                    dice.between("wide", 0.16, 0.30),
                    dice.between("tall", 0.07, 0.14) * (1.0 - 0.3 * t),
                ]
            })
            .collect();
        // the height of the skyline, and of the dome below it
        let crest = move |x: f64| {
            hills.iter().fold(0.0f64, |top, &[cx, w, tall]| {
                let d = (x - cx) / w;
                top.max(tall / (1.0 + d * d * (1.0 + 0.8 * d * d)))
            })
        };
        let seed = dice.seed("ground").wrapping_add(seed);
        let skyline = move |x: f64| level - crest(x) - 0.004 * fractal(seed, 20.0 * x, 0.5, 3);
        let top = skyline.clone();
        let furrows = dice.pick("furrows", &[0.0, 9.0, 14.0]);
        let field = dice.pick(
            "field",
            &[
                manner.slopes,
                manner.feet,
                p.celadon,
                p.ochre,
                mix(p.malachite, p.gold, 0.4),
            ],
        );
        let mist = 0.45 * (1.0 - t);
        stage.add(
            free(move |x, y| {
                let down = y - top(x);
                (down > 0.0).then(|| {
                    let round = (down / 0.20).min(1.0);
                    crate::shape::Local {
                        s: down,
                        ..local(x, y, base, 0.055 * (1.0 - (1.0 - round) * (1.0 - round)).sqrt())
                    }
                })
            }),
            0.9,
            move |l| {
                let p = Palette::court();
                let down = l.s;
                let bumps = 0.0030 * fractal(seed + 1, 16.0 * l.x, 16.0 * l.y, 3);
                let phase =
                    furrows * (down / 0.10 + 0.8 * libm::sin(5.0 * l.x) + 0.3 * noise(seed + 2, 4.0 * l.x, 4.0 * l.y));
                let furrow = if furrows > 0.0 { libm::sin(phase) } else { 0.0 };
                let patch = smoothstep(-0.1, 0.3, fractal(seed + 3, 3.0 * l.x, 6.0 * l.y, 3));
                let mut albedo = mix(field, manner.slopes, 0.5 * patch);
                albedo = mix(albedo, scale(albedo, 0.6), 0.6 * smoothstep(0.2, 0.9, furrow));
                albedo = mix(
                    albedo,
                    mix(p.silk, p.white, 0.45),
                    mist * smoothstep(0.02, 0.18, down).max(0.4),
                );
                Skin {
                    albedo,
                    relief: (bumps + 0.0024 * furrow) * smoothstep(0.0, 0.03, down),
                    ink: 0.4 * smoothstep(0.93, 0.99, furrow) * smoothstep(0.02, 0.05, down) * (1.0 - mist),
                }
            },
        );
        for k in 0..dice.pick("trees", &[2usize, 3, 4]) {
            let dice = dice.each("tree", k);
            let x = wide * dice.between("x", -0.95, 0.95);
            tree(
                stage,
                dice,
                [x, skyline(x) + dice.between("below", 0.01, 0.05)],
                base + 0.05,
                0.6 + 0.6 * t,
            );
        }
    }
}

/// A round tree: a stem and a few balls of leaves.
fn tree(stage: &mut Stage, dice: Dice, foot: [f64; 2], base: f64, size: f64) {
    let p = Palette::court();
    let tall = size * dice.between("tall", 0.06, 0.10);
    let [x0, y0] = foot;
    stage.add(
        free(move |x, y| {
            let t = (y0 - y) / tall;
            let e = (x - x0) / (0.006 * size);
            ((0.0..1.0).contains(&t) && e.abs() < 1.0).then(|| local(x, y, base, 0.006 * (1.0 - e * e).sqrt()))
        }),
        0.5,
        |_| Skin::plain(scale(Palette::court().ochre, 0.5)),
    );
    let leaf = dice.pick(
        "leaf",
        &[p.malachite, mix(p.malachite, p.ochre, 0.5), p.cinnabar, p.peony, p.gold],
    );
    for k in 0..dice.pick("balls", &[3usize, 4, 5]) {
        let dice = dice.each("ball", k);
        let r = size * dice.between("r", 0.022, 0.036);
        let (cx, cy) = (
            x0 + size * dice.between("x", -0.034, 0.034),
            y0 - tall - size * dice.between("y", -0.012, 0.036),
        );
        let seed = dice.seed("leaves");
        stage.add(
            free(move |x, y| {
                let (u, v) = ((x - cx) / r, (y - cy) / (0.85 * r));
                let lobes = 1.0 + 0.14 * noise(seed, 5.0 * u, 5.0 * v);
                let round = 1.0 - (u * u + v * v) / (lobes * lobes);
                (round > 0.0).then(|| local(u, v, base + 0.006, 0.9 * r * round.sqrt()))
            }),
            0.6,
            move |l| {
                let tuft = noise(seed + 1, 7.0 * l.x, 7.0 * l.y);
                Skin {
                    albedo: mix(scale(leaf, 0.55), leaf, smoothstep(0.7, -0.7, l.y + 0.4 * tuft)),
                    relief: 0.0015 * tuft,
                    ink: 0.4 * smoothstep(0.55, 0.8, tuft),
                }
            },
        );
    }
}

/// Rows of waves before far islands.
fn sea(stage: &mut Stage, dice: Dice, seed: u64, half: f64, wide: f64) {
    let p = Palette::court();
    let mut far = ranges(dice, seed, half, 3);
    far[1].level = far[0].level + 0.05;
    add_range(stage, far[0]);
    add_range(stage, far[1]);
    let rows = dice.pick("rows", &[5usize, 6, 7]);
    let deep = dice.pick(
        "deep",
        &[p.azurite, scale(p.indigo, 1.7), mix(p.azurite, p.malachite, 0.5)],
    );
    let horizon = far[1].level + 0.02;
    for row in 0..rows {
        let dice = dice.each("wave", row);
        let t = row as f64 / (rows - 1) as f64;
        let level = horizon + (0.9 * half - horizon) * t * (0.55 + 0.45 * t);
        let (tall, long) = (0.012 + 0.065 * t * dice.between("tall", 0.7, 1.2), 0.10 + 0.20 * t);
        let shift = dice.unit("shift");
        let base = 0.05 + 0.13 * t;
        let steep = dice.between("steep", 0.12, 0.32);
        let seed = dice.seed("foam").wrapping_add(seed);
        // a crest that leans: a sine of a bent phase
        let surface = move |x: f64| {
            let phase = x / long + shift + 0.15 * noise(seed, 3.0 * x, 0.5);
            let lean = phase + steep * libm::sin(TAU * phase) / PI;
            level - tall * (0.5 + 0.5 * libm::cos(TAU * lean)) * (0.75 + 0.25 * noise(seed + 1, 1.5 * phase, 7.0))
        };
        let boat = (row + 2 == rows && dice.chance("boat", 0.7)).then(|| wide * dice.between("boat x", -0.4, 0.4));
        stage.add(
            free(move |x, y| {
                let down = y - surface(x);
                (down > 0.0).then(|| {
                    let round = (down / (1.6 * tall + 0.02)).min(1.0);
                    crate::shape::Local {
                        s: down,
                        length: tall,
                        ..local(
                            x,
                            y,
                            base,
                            (0.8 * tall + 0.006) * (1.0 - (1.0 - round) * (1.0 - round)).sqrt(),
                        )
                    }
                })
            }),
            0.9,
            move |l| {
                let p = Palette::court();
                let down = l.s / (l.length + 0.01);
                let phase = 5.0 * down + 0.6 * libm::sin(30.0 * l.x) + 0.5 * noise(seed + 2, 14.0 * l.x, 20.0 * l.y);
                let line = libm::sin(TAU * phase / 2.0);
                let foam = smoothstep(0.30, 0.05, down + 0.22 * noise(seed + 3, 60.0 * l.x, 60.0 * l.y));
                let body = mix(mix(deep, p.white, 0.35 * (1.0 - t)), deep, smoothstep(0.2, 1.2, down));
                let striped = mix(body, mix(deep, p.white, 0.6), 0.7 * smoothstep(0.6, 0.95, line));
                Skin {
                    albedo: mix(striped, p.white, foam),
                    relief: (0.05 * l.length * line + 0.05 * l.length * foam) * smoothstep(0.0, 0.2, down),
                    ink: 0.0,
                }
            },
        );
        if let Some(x) = boat {
            ship(stage, [x, level - 0.35 * tall], base + 0.03);
        }
    }
}

/// A small boat with a sail.
fn ship(stage: &mut Stage, at: [f64; 2], base: f64) {
    let [x0, y0] = at;
    stage.add(
        free(move |x, y| {
            let (u, v) = ((x - x0 - 0.01) / 0.042, (y - y0 + 0.135) / 0.120);
            if !(0.0..1.0).contains(&v) {
                return None;
            }
            let belly = u - 0.25 * libm::sin(PI * v);
            (belly.abs() < 1.0).then(|| {
                local(
                    u,
                    v,
                    base,
                    0.030 * (1.0 - belly * belly).sqrt() * libm::sin(PI * (0.15 + 0.7 * v)),
                )
            })
        }),
        0.8,
        |l| {
            let p = Palette::court();
            let batten = libm::sin(TAU * 5.0 * l.y);
            Skin {
                albedo: if batten > 0.9 {
                    p.ochre
                } else {
                    mix(p.white, p.silk, 0.5)
                },
                relief: 0.0012 * batten,
                ink: 0.4 * smoothstep(0.9, 1.0, batten),
            }
        },
    );
    stage.add(
        free(move |x, y| {
            let (u, v) = ((x - x0) / 0.080, (y - y0) / 0.030);
            let top = 0.55 * u * u - 0.6;
            let t = (v - top) / (1.0 - u * u + 1e-9);
            (u.abs() < 1.0 && (0.0..1.0).contains(&t))
                .then(|| local(u, v, base + 0.01, 0.024 * (1.0 - u * u).sqrt() * (1.0 - 0.6 * t)))
        }),
        0.9,
        |l| {
            let p = Palette::court();
            Skin::plain(if l.y < 0.55 * l.x * l.x - 0.3 {
                p.cinnabar
            } else {
                scale(p.ochre, 0.7)
            })
        },
    );
}
