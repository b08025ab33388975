//! Face and hair: the high bun with its peony, comb and pin.

use crate::palette::{Palette, mix, scale};
use crate::random::smoothstep;
use crate::shape::{Ends, Local, knot};
use crate::stage::{Colour, Skin, Stage};
use crate::textile::blossom;

use super::{ball, stroke, tube};

pub fn back_hair(stage: &mut Stage) {
    stage.add(ball([0.0, -0.3185], [0.064, 0.062], 0.0, 0.03, 0.0), 1.0, |_| {
        Skin::plain(scale(Palette::court().ink, 1.3))
    });
}

pub fn head(stage: &mut Stage) {
    stage.add(ball([0.0, -0.322], [0.052, 0.062], 0.0, 0.062, 0.046), 0.9, face);
}

/// The face on an ellipsoid, in shares of its half axes.
pub(crate) fn face(l: &Local) -> Skin {
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

pub fn hair(stage: &mut Stage) {
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
