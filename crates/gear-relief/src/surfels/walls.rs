//! Walls: where front and back do not meet at the rim, upright pieces close the gap.

use gear_image::filter::{gaussian, gradient};
use gear_image::{Field, Mask, SrgbImage};

use super::Back;

/// An upright piece on a rim pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wall {
    pub pixel: [f32; 2],
    /// Height of its centre, pixels.
    pub height: f32,
    /// Length along the ray, pixels.
    pub extent: f32,
    /// Direction out of the mask in the picture, a unit vector.
    pub outward: [f32; 2],
    pub colour: [f32; 3],
}

/// Pieces are about this long, pixels, and there are at most [`MOST`] of them on a rim pixel: a straight wall
/// gains nothing from more.
const LENGTH: f32 = 4.0;
const MOST: f32 = 5.0;
const SHADE: f32 = 0.9;
/// How far the end pieces draw back from the edges, in pieces: tails must not stick out.
const INSET: f32 = 0.4;
/// σ of a piece along the ray, in its length.
pub(super) const ALONG: f32 = 0.4;

/// The pieces of all rim pixels whose gap is over a pixel.
pub(super) fn pieces(height: &Field, mask: &Mask, colours: &SrgbImage, back: Back) -> Vec<Wall> {
    let (w, h) = mask.size();
    // The frame is an end here: one pixel of outside around the picture.
    let padded = Field::from_fn(w + 2, h + 2, |x, y| {
        f32::from(x > 0 && y > 0 && x <= w && y <= h && mask.at(x - 1, y - 1))
    });
    let (gx, gy) = gradient(&gaussian(&padded, 1.5));
    let inside = |x: usize, y: usize| padded.at(x, y) > 0.5;
    let mut pieces = Vec::new();
    for y in 0..h {
        for x in 0..w {
            let (px, py) = (x + 1, y + 1);
            let interior = inside(px - 1, py) && inside(px + 1, py) && inside(px, py - 1) && inside(px, py + 1);
            if !mask.at(x, y) || interior {
                continue;
            }
            let top = height.at(x, y);
            let bottom = back.height(top, y as f32);
            let gap = top - bottom;
            if gap <= 1.0 {
                continue;
            }
            let (ox, oy) = (-gx.at(px, py), -gy.at(px, py));
            let length = (ox * ox + oy * oy).sqrt();
            let outward = if length > 1e-6 {
                [ox / length, oy / length]
            } else {
                [1.0, 0.0]
            };
            let count = (gap / LENGTH).ceil().clamp(1.0, MOST);
            for i in 0..count as usize {
                pieces.push(Wall {
                    pixel: [x as f32, y as f32],
                    height: bottom + gap * (0.5 + ((i as f32 + 0.5) / count - 0.5) * (1.0 - INSET / count)),
                    extent: gap / count,
                    outward,
                    colour: colours.at(x, y).map(|c| c * SHADE),
                });
            }
        }
    }
    pieces
}
