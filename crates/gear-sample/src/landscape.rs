//! Blue-and-green mountains in mist: layers of ridges, each nearer than the one above it, a lake, pines and a
//! pavilion. The whole canvas is the subject: a relief.

use crate::palette::{Palette, mix, scale};
use crate::random::{fractal, noise, smoothstep, uniform};
use crate::shape::{Local, Shape};
use crate::stage::{Colour, Skin, Stage};

/// One range of mountains.
#[derive(Clone, Copy)]
pub(crate) struct Range {
    /// Height of the ridge line's middle, y down.
    pub level: f64,
    /// Height of the peaks over it.
    pub peak: f64,
    /// Peaks across the canvas.
    pub count: f64,
    /// Height of the layer's foot over the ground plane.
    pub base: f64,
    /// How far the slope comes forward from its ridge.
    pub slope: f64,
    /// How much mist lies over it, 0 to 1.
    pub mist: f64,
    /// Colours from the heights down to the feet.
    pub manner: Manner,
    /// Seed of its peaks and rocks.
    pub seed: u64,
}

/// Colours of mountains.
#[derive(Clone, Copy)]
pub(crate) struct Manner {
    /// The peaks.
    pub heights: Colour,
    /// The slopes.
    pub slopes: Colour,
    /// The feet.
    pub feet: Colour,
}

impl Manner {
    /// Azurite on the heights, malachite below, ochre at the feet.
    pub fn blue_and_green() -> Self {
        let p = Palette::court();
        Self {
            heights: scale(p.azurite, 1.25),
            slopes: scale(p.malachite, 1.1),
            feet: p.ochre,
        }
    }
}

/// Where the water is.
#[derive(Clone, Copy)]
pub(crate) struct Lake {
    /// Height of the shore line, y down.
    pub shore: f64,
    /// Height of the water over the ground plane.
    pub base: f64,
}

const LAKE: Lake = Lake {
    shore: 0.178,
    base: 0.120,
};

/// Builds the landscape.
pub fn stage(seed: u64) -> Stage {
    let mut stage = Stage {
        aspect: 1.4,
        parts: Vec::new(),
        whole_canvas: true,
    };
    sky(&mut stage, seed, [0.235, -0.245]);
    let manner = Manner::blue_and_green();
    let ranges = [
        Range {
            level: -0.12,
            peak: 0.12,
            count: 2.6,
            base: 0.030,
            slope: 0.030,
            mist: 0.75,
            manner,
            seed: seed + 1,
        },
        Range {
            level: -0.02,
            peak: 0.24,
            count: 1.7,
            base: 0.060,
            slope: 0.060,
            mist: 0.28,
            manner,
            seed: seed + 12,
        },
        Range {
            level: 0.10,
            peak: 0.13,
            count: 2.9,
            base: 0.105,
            slope: 0.050,
            mist: 0.10,
            manner,
            seed: seed + 3,
        },
    ];
    for range in ranges {
        add_range(&mut stage, range);
    }
    water(&mut stage, seed, LAKE);
    let near = Range {
        level: 0.300,
        peak: 0.085,
        count: 2.2,
        base: 0.165,
        slope: 0.040,
        mist: 0.0,
        manner,
        seed: seed + 24,
    };
    add_range(&mut stage, near);
    pavilion(&mut stage, 0.115, 0.205, 0.185);
    for (k, (x, size)) in [
        (-0.34, 1.25),
        (-0.27, 0.95),
        (-0.405, 0.85),
        (0.34, 1.15),
        (0.405, 0.9),
        (0.27, 0.7),
    ]
    .into_iter()
    .enumerate()
    {
        pine(&mut stage, x, size, near, seed + 200 + k as u64);
    }
    stage
}

pub(crate) fn free(form: impl Fn(f64, f64) -> Option<Local> + Send + Sync + 'static) -> Shape {
    Shape::Free(Box::new(form))
}

pub(crate) fn local(x: f64, y: f64, base: f64, rise: f64) -> Local {
    Local {
        x,
        y,
        s: 0.0,
        e: 0.0,
        width: 1.0,
        length: 1.0,
        rise,
        base,
    }
}

/// Silk, with the sun at a place.
pub(crate) fn sky(stage: &mut Stage, seed: u64, at: [f64; 2]) {
    stage.add(free(|x, y| Some(local(x, y, 0.0, 0.0))), 0.0, move |l| {
        let p = Palette::court();
        let warm = mix(p.silk, scale(p.gold, 0.95), 0.35 * smoothstep(-0.36, -0.10, l.y));
        let age = fractal(seed + 61, 3.0 * l.x, 3.0 * l.y, 4);
        let mut albedo: Colour = scale(warm, 1.0 + 0.10 * age);
        let (dx, dy) = (l.x - at[0], l.y - at[1]);
        let sun = (dx * dx + dy * dy).sqrt();
        albedo = mix(albedo, p.cinnabar, 0.9 * smoothstep(0.037, 0.034, sun));
        Skin::plain(albedo)
    });
}

/// The ridge line: peaks of uneven height with crags.
pub(crate) fn ridge(range: &Range, x: f64) -> f64 {
    let t = (x + 0.5) * range.count;
    let mut top = 0.0f64;
    let cell = t.floor() as i64;
    for k in cell - 1..=cell + 1 {
        let middle = k as f64 + 0.25 + 0.5 * uniform(range.seed, k, 0);
        let tall = 0.45 + 0.55 * uniform(range.seed, k, 1);
        let wide = 0.55 + 0.35 * uniform(range.seed, k, 2);
        let d = (t - middle) / wide;
        let bump = 1.0 / (1.0 + 2.4 * d * d + 3.0 * d * d * d * d);
        top = top.max(tall * bump);
    }
    let crags = 0.10 * fractal(range.seed + 5, 14.0 * x, 0.5, 4) + 0.03 * fractal(range.seed + 6, 50.0 * x, 0.5, 3);
    range.level - range.peak * (top + crags * (0.4 + top))
}

/// Buttresses and gullies that run down from the ridge, about [−1, 1], and how much of a gully a place is.
fn rock(range: &Range, x: f64, down: f64) -> (f64, f64) {
    let drift = 0.035 * fractal(range.seed + 7, 6.0 * x, 9.0 * down, 3);
    let u = (x + drift) * (16.0 + 10.0 * range.count) * 0.6;
    let arch = |t: f64| 2.0 * libm::sin(std::f64::consts::PI * (t - t.floor())) - 1.0;
    let major = arch(u + 0.8 * noise(range.seed + 8, u, 3.0 * down));
    let minor = arch(2.7 * u + 1.2 * noise(range.seed + 9, 2.0 * u, 9.0 * down) + 6.0 * down);
    let rough = fractal(range.seed + 10, 40.0 * x, 40.0 * down, 3);
    let gully = smoothstep(-0.55, -0.98, major);
    (0.62 * major + 0.26 * minor + 0.22 * rough, gully)
}

/// A range in front of what is there.
pub(crate) fn add_range(stage: &mut Stage, range: Range) {
    let shape = free(move |x, y| {
        let down = y - ridge(&range, x);
        (down > 0.0).then(|| Local {
            s: down,
            ..local(x, y, range.base, range.slope * smoothstep(0.0, 0.16, down))
        })
    });
    stage.add(shape, if range.mist > 0.5 { 0.5 } else { 0.95 }, move |l| {
        let p = Palette::court();
        let down = l.s;
        let (rock, gully) = rock(&range, l.x, down);
        let crown = smoothstep(0.0, 0.03, down);
        let mottle = 0.05 * fractal(range.seed + 11, 12.0 * l.x, 12.0 * l.y, 3);
        let t = down / (range.peak * 0.9 + 0.03) + mottle;
        let mut albedo = mix(range.manner.heights, range.manner.slopes, smoothstep(0.12, 0.55, t));
        albedo = mix(albedo, range.manner.feet, 0.85 * smoothstep(0.60, 1.15, t));
        albedo = mix(albedo, scale(albedo, 1.35), 0.5 * smoothstep(0.1, 0.9, rock));
        // mist gathers at the feet
        let drift = 0.06 * fractal(range.seed + 13, 5.0 * l.x, 14.0 * l.y, 4);
        let low = smoothstep(0.55, 1.25, t + 2.0 * drift);
        let veil = (range.mist * (0.55 + 0.45 * low) + 0.72 * low * (range.mist > 0.0) as u8 as f64).min(0.97);
        albedo = mix(albedo, mix(p.silk, p.white, 0.45), veil);
        let moss_at = uniform(
            range.seed + 15,
            (l.x * 190.0).floor() as i64,
            (l.y * 190.0).floor() as i64,
        );
        let cell = |v: f64| (v * 190.0 - (v * 190.0).floor() - 0.5) * 2.0;
        let round = (cell(l.x) * cell(l.x) + cell(l.y) * cell(l.y)).sqrt();
        let moss = if moss_at > 0.93 && down < 0.05 && down > 0.008 {
            smoothstep(0.95, 0.55, round)
        } else {
            0.0
        };
        let texture = 0.62
            * gully
            * smoothstep(0.008, 0.035, down)
            * (0.55 + 0.45 * noise(range.seed + 14, 40.0 * l.x, 90.0 * l.y));
        let amplitude = 0.24 * range.slope * (1.0 - 0.75 * low) + 0.004;
        Skin {
            albedo,
            relief: amplitude * rock * crown,
            ink: texture.max(0.75 * moss) * (1.0 - veil),
        }
    });
}

/// A lake.
pub(crate) fn water(stage: &mut Stage, seed: u64, lake: Lake) {
    let shore = move |x: f64| lake.shore + 0.022 * fractal(seed + 71, 3.5 * x, 0.0, 3);
    stage.add(
        free(move |x, y| (y > shore(x)).then(|| local(x, y, lake.base, 0.02 * (y - (lake.shore - 0.008))))),
        0.35,
        move |l| {
            let p = Palette::court();
            let away = l.y - shore(l.x);
            let base = mix(mix(p.silk, p.white, 0.3), p.azurite, 0.50 * smoothstep(0.0, 0.13, away));
            let phase =
                210.0 * l.y + 3.0 * libm::sin(22.0 * l.x + 60.0 * l.y) + 2.0 * noise(seed + 72, 9.0 * l.x, 30.0 * l.y);
            let ripple = libm::sin(phase);
            let broken = smoothstep(0.0, 0.5, noise(seed + 73, 14.0 * l.x, 60.0 * l.y));
            Skin {
                albedo: base,
                relief: 0.0012 * ripple,
                ink: 0.32 * smoothstep(0.86, 0.98, ripple) * broken,
            }
        },
    );
}

/// A small pavilion on the near shore: a tiled roof over posts.
pub(crate) fn pavilion(stage: &mut Stage, x0: f64, y0: f64, base: f64) {
    let at = move |x: f64, y: f64| (x - x0, y - y0);
    stage.add(
        free(move |x, y| {
            let (u, v) = at(x, y);
            (u.abs() < 0.036 && (0.018..0.078).contains(&v))
                .then(|| local(u, v, base, 0.016 * (1.0 - (u / 0.036) * (u / 0.036)).max(0.0).sqrt()))
        }),
        0.6,
        |l| {
            let p = Palette::court();
            let post = (l.x / 0.0235 + 0.5).rem_euclid(1.0);
            let rail = (0.052..0.058).contains(&l.y) || l.y > 0.072;
            Skin::plain(if !(0.16..=0.84).contains(&post) || rail {
                p.cinnabar
            } else {
                mix(p.white, p.silk, 0.4)
            })
        },
    );
    for (lift, reach) in [(0.0, 0.062), (-0.026, 0.038)] {
        stage.add(
            free(move |x, y| {
                let (u, v) = at(x, y - lift);
                let t = u.abs() / reach;
                if t >= 1.0 {
                    return None;
                }
                // eaves curve up at their ends
                let (top, foot) = (-0.020 + 0.034 * t.sqrt(), 0.022 - 0.012 * t * t * t);
                (v > top && v < foot)
                    .then(|| local(u, v, base + 0.015, 0.022 * ((v - top) / (foot - top + 1e-9)).sqrt()))
            }),
            0.8,
            |l| {
                let p = Palette::court();
                let tile = (l.x / 0.0065).rem_euclid(1.0);
                let eave = l.y > 0.013;
                let albedo = if eave { p.gold } else { mix(p.indigo, p.azurite, 0.6) };
                Skin {
                    albedo,
                    relief: 0.0012 * libm::sin(tile * std::f64::consts::TAU),
                    ink: if tile < 0.2 { 0.5 } else { 0.0 },
                }
            },
        );
    }
}

/// A pine: a bent trunk and flat clouds of needles.
pub(crate) fn pine(stage: &mut Stage, x0: f64, size: f64, near: Range, seed: u64) {
    let base = near.base + 0.035;
    let foot = ridge(&near, x0) + 0.02;
    let tall = 0.150 * size;
    let bend = move |t: f64| x0 + 0.020 * size * libm::sin(4.0 * t + 6.0 * uniform(seed, 0, 0)) * t;
    stage.add(
        free(move |x, y| {
            let t = (foot - y) / tall;
            if !(0.0..1.0).contains(&t) {
                return None;
            }
            let width = 0.0065 * size * (1.1 - t);
            let e = (x - bend(t)) / width;
            (e.abs() < 1.0).then(|| local(x, y, base, 0.010 * (1.0 - e * e).sqrt()))
        }),
        0.5,
        move |l| {
            let p = Palette::court();
            Skin {
                albedo: scale(p.ochre, 0.5),
                relief: 0.0,
                ink: 0.5 * smoothstep(0.3, 0.7, noise(seed, 300.0 * l.x, 120.0 * l.y)),
            }
        },
    );
    for k in 0..7i64 {
        let t = 0.34 + 0.11 * k as f64;
        let side = if k % 2 == 0 { 1.0 } else { -1.0 };
        let reach = (0.050 - 0.0055 * k as f64) * size;
        let (cx, cy) = (
            bend(t) + side * reach * (0.55 - 0.05 * k as f64).max(0.0),
            foot - t * tall,
        );
        stage.add(
            free(move |x, y| {
                let (u, v) = ((x - cx) / reach, (y - cy) / (0.36 * reach));
                if u.abs() > 1.2 || v.abs() > 1.2 {
                    return None;
                }
                let lobes = 1.0 + 0.16 * noise(seed + 3 + k as u64, 5.0 * u, 5.0 * v);
                let r = u * u + if v > 0.0 { 3.0 * v * v } else { v * v };
                let round = 1.0 - r / (lobes * lobes);
                (round > 0.0).then(|| local(u, v, base + 0.005, 0.020 * size * round.sqrt()))
            }),
            0.55,
            move |l| {
                let p = Palette::court();
                let needle =
                    libm::sin(16.0 * libm::atan2(l.y + 1.3, l.x) + 3.0 * noise(seed + 5, 4.0 * l.x, 4.0 * l.y));
                let albedo = mix(
                    scale(p.malachite, 0.55),
                    scale(p.malachite, 1.0),
                    smoothstep(0.6, -0.8, l.y),
                );
                Skin {
                    albedo,
                    relief: 0.0012 * needle,
                    ink: 0.55 * smoothstep(0.45, 0.95, needle),
                }
            },
        );
    }
}
