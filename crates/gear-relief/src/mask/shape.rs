//! What a mask may look like: holes, crumbs, a smooth boundary.

use gear_image::Mask;
use gear_image::filter::{Beyond, Components, Connectivity, components, dilate, gaussian, open};

use super::frame::Window;

/// Fills enclosed patches of ground that are smaller than `share` of the raster, or that `keep` does not take for
/// ground. `keep` is asked with the pixels of each larger one.
pub fn fill_holes(mask: &mut Mask, share: f64, keep: impl Fn(&[usize]) -> bool) {
    let outside = Mask::from_vec(mask.width(), mask.height(), mask.data().iter().map(|m| !m).collect());
    let parts = components(&outside, Connectivity::Four);
    let (w, h) = mask.size();
    let mut at_rim = vec![false; parts.sizes.len() + 1];
    for y in 0..h {
        for x in 0..w {
            if x == 0 || y == 0 || x + 1 == w || y + 1 == h {
                at_rim[parts.labels[y * w + x] as usize] = true;
            }
        }
    }
    let mut pixels = vec![Vec::new(); parts.sizes.len() + 1];
    for (p, label) in parts.labels.iter().enumerate() {
        if *label > 0 && !at_rim[*label as usize] {
            pixels[*label as usize].push(p);
        }
    }
    for hole in pixels.iter().filter(|p| !p.is_empty()) {
        if (hole.len() as f64) < share * mask.len() as f64 || !keep(hole) {
            for p in hole {
                mask.data_mut()[*p] = true;
            }
        }
    }
}

/// How much smaller than the body a part may be that lies close to it: an axe, a bud, the foot of a throne.
const COMPANION: f64 = 0.003;
/// How close, as a share of the raster's longer side.
const CLOSE: f64 = 0.012;

/// A part whose contact with the rim is longer than this share of its own extent (√area) is a ledge.
const LEDGE: f64 = 0.6;

/// Drops what is no part of the figure: parts below `share` of the body (unless they lie close to it), and parts that
/// lie along the window's rim: spandrels, friezes and ledges are the
/// picture's frame. The body is the largest part that is free of the rim. Returns what lay along the rim.
pub fn drop_crumbs(mask: &mut Mask, share: f64, window: &Window) -> Mask {
    let mut ledges = Mask::filled(mask.width(), mask.height(), false);
    let parts = components(mask, Connectivity::Eight);
    let touch = rim_contact(mask, window, &parts.labels, parts.sizes.len());
    let Some(body) = body(&parts, &touch) else {
        return ledges;
    };
    let of_body = Mask::from_vec(
        mask.width(),
        mask.height(),
        parts.labels.iter().map(|l| *l == body).collect(),
    );
    let reach = ((CLOSE * mask.longer_side() as f64).round() as usize).max(1);
    let mut close = vec![false; parts.sizes.len() + 1];
    for (label, near) in parts.labels.iter().zip(dilate(&of_body, reach).data()) {
        close[*label as usize] |= *near;
    }
    let size = |label: u32| parts.sizes[label as usize - 1] as f64;
    let ledge = |label: u32| label != body && touch[label as usize] as f64 > LEDGE * size(label).sqrt();
    let good = |label: u32| {
        let least = if close[label as usize] {
            share.min(COMPANION)
        } else {
            share
        };
        label == body || (size(label) >= least * size(body) && !ledge(label))
    };
    for (p, label) in parts.labels.iter().enumerate().filter(|(_, l)| **l > 0) {
        mask.data_mut()[p] = good(*label);
        ledges.data_mut()[p] = ledge(*label);
    }
    ledges
}

/// The largest part that does not lie along the rim; else the largest.
fn body(parts: &Components, touch: &[usize]) -> Option<u32> {
    let mut best: Option<usize> = None;
    for (i, &size) in parts.sizes.iter().enumerate() {
        let free = (touch[i + 1] as f64) < 0.8 * (size as f64).sqrt();
        if free && best.is_none_or(|b| size > parts.sizes[b]) {
            best = Some(i);
        }
    }
    best.map(|i| i as u32 + 1).or_else(|| parts.largest())
}

fn rim_contact(mask: &Mask, window: &Window, labels: &[u32], count: usize) -> Vec<usize> {
    let w = mask.width();
    let mut touch = vec![0; count + 1];
    for p in window.rim_of(w, 1).iter().flatten() {
        touch[labels[*p] as usize] += 1;
    }
    touch
}

/// Drops spurs thinner than `2 · steps` and smooths the boundary over `sigma` pixels.
pub fn smooth(mask: &Mask, steps: usize, sigma: f64) -> Mask {
    let opened = if steps > 0 {
        open(mask, steps, Beyond::Inside)
    } else {
        mask.clone()
    };
    let soft = gaussian(&opened.to_field(), sigma);
    Mask::from_vec(
        mask.width(),
        mask.height(),
        soft.data().iter().map(|v| *v > 0.5).collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring() -> Mask {
        Mask::from_fn(40, 40, |x, y| {
            let r = (x as i32 - 20).pow(2) + (y as i32 - 20).pow(2);
            (36..196).contains(&r)
        })
    }

    #[test]
    fn a_small_hole_is_filled_and_a_large_one_only_if_it_is_no_ground() {
        let mut mask = ring();
        fill_holes(&mut mask, 0.5, |_| true);
        assert!(mask.at(20, 20));
        let mut mask = ring();
        fill_holes(&mut mask, 0.01, |_| true);
        assert!(!mask.at(20, 20));
        fill_holes(&mut mask, 0.01, |_| false);
        assert!(mask.at(20, 20));
    }

    #[test]
    fn crumbs_and_ledges_go_and_the_body_stays() {
        let mut mask = ring();
        for x in 0..40 {
            mask.set(x, 0, true);
            mask.set(x, 1, true);
        }
        mask.set(2, 36, true);
        drop_crumbs(
            &mut mask,
            0.05,
            &Window {
                x0: 0,
                y0: 0,
                x1: 40,
                y1: 40,
            },
        );
        assert_eq!(mask, ring());
    }
}
