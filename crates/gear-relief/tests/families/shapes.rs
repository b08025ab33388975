//! Objects with known height, their paintings, and how far an estimate is from the truth.

use gear_image::filter::gaussian;
use gear_image::{Field, LinearImage, Mask, Rgb, math};
use gear_relief::fields::{depth_inside, dot, eroded, normals, weighted_gaussian};

/// Side of the pictures, pixels.
pub const SIDE: usize = 192;

/// A height field in pixels and its silhouette.
pub struct Object {
    pub name: &'static str,
    pub height: Field,
    pub mask: Mask,
}

type Ellipsoid = (f32, f32, f32, f32, f32);

fn cap(x: f32, y: f32, (cx, cy, a, b, depth): Ellipsoid) -> f32 {
    let (u, v) = ((x - cx) / a, (y - cy) / b);
    depth * (1.0 - u * u - v * v).max(0.0).sqrt()
}

fn field(f: impl Fn(f32, f32) -> f32) -> Field {
    Field::from_fn(SIDE, SIDE, |x, y| f(x as f32, y as f32))
}

fn inside(f: impl Fn(f32, f32) -> bool) -> Mask {
    Mask::from_fn(SIDE, SIDE, |x, y| f(x as f32, y as f32))
}

fn object(name: &'static str, mask: Mask, height: Field) -> Object {
    let kept = height
        .data()
        .iter()
        .zip(mask.data())
        .map(|(&h, &m)| if m { h } else { 0.0 })
        .collect();
    Object {
        name,
        height: Field::from_vec(SIDE, SIDE, kept),
        mask,
    }
}

/// Sphere, torus, bust, vase, folded cloth, relief panel.
pub fn objects() -> Vec<Object> {
    let sphere = (96.0, 96.0, 70.0, 70.0, 70.0);
    let tube = |x: f32, y: f32| {
        let r = ((x - 96.0) * (x - 96.0) + (y - 96.0) * (y - 96.0)).sqrt() - 50.0;
        28.0 * 28.0 - r * r
    };
    let parts: [Ellipsoid; 4] = [
        (96.0, 70.0, 34.0, 42.0, 36.0),
        (96.0, 30.0, 20.0, 16.0, 18.0),
        (96.0, 120.0, 16.0, 30.0, 20.0),
        (96.0, 178.0, 74.0, 52.0, 40.0),
    ];
    let bust = |x: f32, y: f32| {
        let body = parts.iter().map(|&part| cap(x, y, part)).fold(0.0, f32::max);
        let eyes = cap(x, y, (82.0, 62.0, 7.0, 5.0, 5.0)) + cap(x, y, (110.0, 62.0, 7.0, 5.0, 5.0));
        if body > 0.0 {
            body + cap(x, y, (96.0, 76.0, 7.0, 15.0, 12.0)) - eyes
        } else {
            0.0
        }
    };
    let radius = |y: f32| {
        let s = math::sin((y - 30.0) / 132.0 * std::f32::consts::PI * 1.35 + 0.2);
        30.0 + 26.0 * s * s
    };
    let cloth = (96.0, 96.0, 76.0, 84.0, 45.0);
    let folds = |x: f32, y: f32| {
        let body = cap(x, y, cloth);
        body + 6.0 * math::sin((x + 12.0 * math::sin(y / 30.0)) / 5.5) * (body / 30.0).min(1.0)
    };
    let panel = |x: f32, y: f32| (x - 96.0).abs() < 80.0 && (y - 96.0).abs() < 80.0;
    let carving: [Ellipsoid; 3] = [
        (70.0, 80.0, 34.0, 34.0, 14.0),
        (124.0, 70.0, 22.0, 36.0, 12.0),
        (100.0, 134.0, 46.0, 22.0, 14.0),
    ];
    let relief = |x: f32, y: f32| {
        let carved = carving.iter().map(|&part| 5.0 + cap(x, y, part)).fold(5.0, f32::max);
        if panel(x, y) { carved } else { 0.0 }
    };
    vec![
        object(
            "sphere",
            inside(|x, y| cap(x, y, sphere) > 0.0),
            field(|x, y| cap(x, y, sphere)),
        ),
        object(
            "torus",
            inside(|x, y| tube(x, y) > 0.0),
            field(|x, y| tube(x, y).max(0.0).sqrt()),
        ),
        object(
            "bust",
            inside(|x, y| parts.iter().any(|&part| cap(x, y, part) > 0.0)),
            gaussian(&field(bust), 1.0),
        ),
        object(
            "vase",
            inside(|x, y| (x - 96.0).abs() < radius(y) && y > 24.0 && y < 172.0),
            field(|x, y| (radius(y) * radius(y) - (x - 96.0) * (x - 96.0)).max(0.0).sqrt()),
        ),
        object("folds", inside(|x, y| cap(x, y, cloth) > 0.0), field(folds)),
        object("relief", inside(panel), gaussian(&field(relief), 0.8)),
    ]
}

/// Uniform numbers in [0, 1) by position.
fn uniform(index: u64, seed: u64) -> f32 {
    let mut z = index.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ seed.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
}

/// What the surface is painted with, linear light.
pub fn albedo(kind: &str) -> LinearImage {
    let seeds: Vec<([f32; 2], [f32; 3])> = (0..14)
        .map(|i| {
            let u = |k: u64| uniform(i * 8 + k, 3);
            (
                [u(0) * SIDE as f32, u(1) * SIDE as f32],
                [2, 3, 4].map(|k| 0.08 + 0.72 * u(k)),
            )
        })
        .collect();
    Rgb::from_fn(SIDE, SIDE, |x, y| match kind {
        "stripes" => {
            let s = ((y as f32 + 8.0 * math::sin(x as f32 / 25.0)) / 18.0).floor() as i32;
            [[0.60, 0.12, 0.10], [0.75, 0.62, 0.35], [0.12, 0.22, 0.42]][s.rem_euclid(3) as usize]
        }
        "patches" => {
            let distance = |p: &[f32; 2]| (p[0] - x as f32) * (p[0] - x as f32) + (p[1] - y as f32) * (p[1] - y as f32);
            seeds
                .iter()
                .min_by(|a, b| distance(&a.0).total_cmp(&distance(&b.0)))
                .map_or([0.5; 3], |s| s.1)
        }
        _ => [0.55, 0.33, 0.22],
    })
}

/// How it is painted.
#[derive(Clone, Copy)]
#[allow(dead_code, reason = "the table prints the name, the gate does not")]
pub struct Manner {
    pub name: &'static str,
    /// Share of the true shading's contrast.
    pub contrast: f32,
    /// Number of flat tones; 0 is continuous.
    pub tones: u32,
    /// Strength of the drawn outline.
    pub outline: f32,
    /// Strength of the brush texture.
    pub brush: f32,
    /// Towards the light, image space, not normalised.
    pub light: [f32; 3],
    pub seed: u64,
}

pub const PHOTO: Manner = Manner {
    name: "photo",
    contrast: 1.0,
    tones: 0,
    outline: 0.0,
    brush: 0.0,
    light: [-0.5, -0.55, 0.67],
    seed: 0,
};
pub const PAINT: Manner = Manner {
    name: "paint",
    contrast: 0.35,
    tones: 4,
    outline: 0.8,
    brush: 0.03,
    ..PHOTO
};
pub const FLAT: Manner = Manner {
    name: "flat",
    contrast: 0.12,
    tones: 3,
    ..PAINT
};

/// Paints an object, linear light.
pub fn paint(object: &Object, albedo: &LinearImage, manner: Manner) -> LinearImage {
    let l = manner.light;
    let length = dot(l, l).sqrt();
    let l = l.map(|v| v / length);
    let mut shade: Vec<f32> = normals(&object.height)
        .iter()
        .map(|&n| {
            0.75 * (1.0 - manner.contrast) * f32::from(manner.contrast < 1.0)
                + manner.contrast * (0.25 + 0.75 * dot(n, l).max(0.0))
        })
        .collect();
    if manner.tones > 0 {
        let of_mask = || {
            shade
                .iter()
                .zip(object.mask.data())
                .filter_map(|(&s, &m)| m.then_some(s))
        };
        let (low, high) = (
            of_mask().fold(f32::MAX, f32::min),
            of_mask().fold(f32::MIN, f32::max) + 1e-9,
        );
        let tones = manner.tones as f32;
        for s in &mut shade {
            *s = low + (((*s - low) / (high - low) * tones).floor() + 0.5) / tones * (high - low);
        }
    }
    let rim = depth_inside(&object.mask);
    let jump = |x: usize, y: usize| {
        let (mut low, mut high) = (f32::MAX, f32::MIN);
        for j in -1..=1 {
            for i in -1..=1 {
                let h = object.height.at_clamped(x as isize + i, y as isize + j);
                (low, high) = (low.min(h), high.max(h));
            }
        }
        high - low
    };
    let ink = Field::from_fn(SIDE, SIDE, |x, y| {
        let d = rim[y * SIDE + x];
        f32::from(d == 1 || d > 0 && jump(x, y) > 9.0)
    });
    let ink = gaussian(&ink, 0.7);
    let grain = Field::from_fn(SIDE, SIDE, |x, y| {
        let index = (y * SIDE + x) as u64;
        (0..4).map(|k| uniform(index * 4 + k, manner.seed + 11)).sum::<f32>() - 2.0
    });
    // Brush strokes lie across: long in x, short in y.
    let (wide, narrow) = (gaussian(&grain, 4.0), gaussian(&grain, 1.0));
    let texture = Field::from_fn(SIDE, SIDE, |x, y| {
        (0..9)
            .map(|i| narrow.at_clamped(x as isize + i * 2 - 8, y as isize))
            .sum::<f32>()
            / 9.0
            + 0.3 * wide.at(x, y)
    });
    let deviation = (texture.data().iter().map(|t| t * t).sum::<f32>() / texture.len() as f32).sqrt();
    Rgb::from_fn(SIDE, SIDE, |x, y| {
        let p = y * SIDE + x;
        let colour = if object.mask.data()[p] {
            albedo.data()[p].map(|a| a * shade[p])
        } else {
            [0.72, 0.66, 0.52]
        };
        let painted =
            (1.0 - manner.outline * ink.data()[p].min(1.0)) * (1.0 + manner.brush * texture.data()[p] / deviation);
        colour.map(|c| (c * painted).clamp(0.0, 1.0))
    })
}

/// How far an estimate is from the truth.
#[derive(Clone, Copy, Debug, Default)]
pub struct Score {
    /// Root mean square depth error after the best affine map, in units of the truth's deviation.
    pub depth: f64,
    /// Mean angle between normals two pixels inside, degrees.
    pub normal: f64,
    /// Correlation of the high-passed heights six pixels inside.
    pub detail: f64,
}

pub fn score(estimate: &Field, object: &Object) -> Score {
    let mask = &object.mask;
    let pairs: Vec<(f64, f64)> = (0..mask.len())
        .filter(|&p| mask.data()[p])
        .map(|p| (f64::from(estimate.data()[p]), f64::from(object.height.data()[p])))
        .collect();
    let (scale, error, deviation) = affine(&pairs);
    let stretched = Field::from_vec(
        SIDE,
        SIDE,
        estimate
            .data()
            .iter()
            .map(|h| h * if scale > 0.0 { scale.max(0.2) } else { 1.0 } as f32)
            .collect(),
    );
    let (ours, truth) = (normals(&stretched), normals(&object.height));
    let inner = eroded(mask, 2);
    let angles: Vec<f64> = (0..mask.len())
        .filter(|&p| inner.data()[p])
        .map(|p| libm::acos(f64::from(dot(ours[p], truth[p])).clamp(-1.0, 1.0)).to_degrees())
        .collect();
    let high = |h: &Field| {
        let low = weighted_gaussian(h, &mask.to_field(), 8.0);
        h.data()
            .iter()
            .zip(low.data())
            .map(|(h, l)| f64::from(h - l))
            .collect::<Vec<_>>()
    };
    let (ours, truth) = (high(estimate), high(&object.height));
    let core = eroded(mask, 6);
    let pairs: Vec<(f64, f64)> = (0..mask.len())
        .filter(|&p| core.data()[p])
        .map(|p| (ours[p], truth[p]))
        .collect();
    Score {
        depth: error / deviation,
        normal: angles.iter().sum::<f64>() / angles.len() as f64,
        detail: correlation(&pairs),
    }
}

/// (non-negative scale of the first onto the second, rms error after it, deviation of the second).
fn affine(pairs: &[(f64, f64)]) -> (f64, f64, f64) {
    let n = pairs.len() as f64;
    let (ma, mb) = (
        pairs.iter().map(|p| p.0).sum::<f64>() / n,
        pairs.iter().map(|p| p.1).sum::<f64>() / n,
    );
    let aa: f64 = pairs.iter().map(|p| (p.0 - ma) * (p.0 - ma)).sum();
    let ab: f64 = pairs.iter().map(|p| (p.0 - ma) * (p.1 - mb)).sum();
    let bb: f64 = pairs.iter().map(|p| (p.1 - mb) * (p.1 - mb)).sum();
    let scale = (ab / aa.max(1e-12)).max(0.0);
    let error: f64 = pairs
        .iter()
        .map(|p| (scale * (p.0 - ma) - (p.1 - mb)) * (scale * (p.0 - ma) - (p.1 - mb)))
        .sum();
    (scale, (error / n).sqrt(), (bb / n).sqrt())
}

fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let (ma, mb) = (
        pairs.iter().map(|p| p.0).sum::<f64>() / n,
        pairs.iter().map(|p| p.1).sum::<f64>() / n,
    );
    let aa: f64 = pairs.iter().map(|p| (p.0 - ma) * (p.0 - ma)).sum();
    let bb: f64 = pairs.iter().map(|p| (p.1 - mb) * (p.1 - mb)).sum();
    let ab: f64 = pairs.iter().map(|p| (p.0 - ma) * (p.1 - mb)).sum();
    if aa > 1e-12 && bb > 1e-12 {
        ab / (aa * bb).sqrt()
    } else {
        0.0
    }
}
