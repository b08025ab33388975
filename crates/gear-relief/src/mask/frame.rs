//! Frames, mounts and margins: the window in which the picture itself lies.
//!
//! A frame is made of straight lines that run along a whole side; hardly any contour of a picture does. For each line
//! parallel to a side, the median over its length of the colour difference across it is large only for such
//! a line. The innermost one within a quarter of the picture bounds the window on that side; a window needs
//! lines on at least three sides.

use super::features::{Features, squared_distance};

/// A rectangle of pixels: `x0 ≤ x < x1`, `y0 ≤ y < y1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Left column.
    pub x0: usize,
    /// Upper row.
    pub y0: usize,
    /// Column after the last.
    pub x1: usize,
    /// Row after the last.
    pub y1: usize,
}

impl Window {
    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.x1 - self.x0
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.y1 - self.y0
    }

    /// Number of pixels.
    pub fn area(&self) -> usize {
        self.width() * self.height()
    }

    /// Is (x, y) within?
    pub fn contains(&self, x: usize, y: usize) -> bool {
        x >= self.x0 && x < self.x1 && y >= self.y0 && y < self.y1
    }
}

/// Depth to which lines are looked for, as a share of the side that they cut off.
const REACH: f64 = 0.22;
/// Least median difference of colour across a line of a frame.
const STEP: f32 = 0.045;

/// The window inside the frame, and true when a frame was found.
pub fn window(features: &Features) -> (Window, bool) {
    let (w, h) = (features.width, features.height);
    let whole = Window {
        x0: 0,
        y0: 0,
        x1: w,
        y1: h,
    };
    if w < 32 || h < 32 {
        return (whole, false);
    }
    let mut found = whole;
    // lines are judged over the part of them that the other sides' frames leave: twice, so that all four know
    for _ in 0..2 {
        let deep = |n: usize| (REACH * n as f64) as usize;
        let last = |far: usize, along: (usize, usize), cross: &dyn Fn(usize, usize) -> (usize, usize)| {
            (2..far).rev().find(|&t| is_line(features, along, |s| cross(t, s)))
        };
        let (xs, ys) = ((found.x0, found.x1), (found.y0, found.y1));
        let left = last(deep(w), ys, &|t, s| (s * w + t - 2, s * w + t + 1));
        let right = last(deep(w), ys, &|t, s| (s * w + w - 1 - (t - 2), s * w + w - 1 - (t + 1)));
        let top = last(deep(h), xs, &|t, s| ((t - 2) * w + s, (t + 1) * w + s));
        let bottom = last(deep(h), xs, &|t, s| {
            ((h - 1 - (t - 2)) * w + s, (h - 1 - (t + 1)) * w + s)
        });
        let sides = [left, right, top, bottom].iter().flatten().count();
        if sides < 3 {
            return (whole, false);
        }
        let inner = |t: Option<usize>| t.map_or(0, |t| t + 3);
        found = Window {
            x0: inner(left),
            y0: inner(top),
            x1: w - inner(right),
            y1: h - inner(bottom),
        };
    }
    (found, true)
}

/// Do the colours on the two sides of a line differ along most of it?
fn is_line(features: &Features, along: (usize, usize), pair: impl Fn(usize) -> (usize, usize)) -> bool {
    let mut steps: Vec<f32> = (along.0..along.1)
        .map(|s| {
            let (a, b) = pair(s);
            squared_distance(features.data[a], features.data[b])
        })
        .collect();
    // four fifths of the line must show it: a shoreline or a floor is broken by what stands before it
    gear_image::stats::quantile_in_place(&mut steps, 0.2).is_some_and(|q| q > STEP * STEP)
}

impl Window {
    /// Pixels of the four sides of the rim, `band` deep: top, bottom, left, right, as indices into a raster
    /// `raster_width` wide; corners belong to two sides.
    pub fn rim_of(&self, raster_width: usize, band: usize) -> [Vec<usize>; 4] {
        let collect = |xs: std::ops::Range<usize>, ys: std::ops::Range<usize>| -> Vec<usize> {
            ys.flat_map(|y| xs.clone().map(move |x| y * raster_width + x)).collect()
        };
        let (bx, by) = (band.min(self.width()), band.min(self.height()));
        [
            collect(self.x0..self.x1, self.y0..self.y0 + by),
            collect(self.x0..self.x1, self.y1 - by..self.y1),
            collect(self.x0..self.x0 + bx, self.y0..self.y1),
            collect(self.x1 - bx..self.x1, self.y0..self.y1),
        ]
    }
}
