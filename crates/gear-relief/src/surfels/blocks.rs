//! The quad-tree of square blocks: what each block could be replaced by, and which blocks to take.

use gear_image::{Field, Mask, SrgbImage};
use rayon::prelude::*;

use crate::fields::depth_inside;

/// A square of pixels as one plane and one colour.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    /// Centre in pixel coordinates.
    pub center: [f32; 2],
    /// Side in pixels.
    pub size: usize,
    /// Height at the centre in pixels, and its slopes to the right and down.
    pub plane: [f32; 3],
    /// Mean encoded colour.
    pub colour: [f32; 3],
    /// Largest deviation from the plane, pixels; infinite when the block may not be taken at all.
    bend: f32,
    /// Deviation from the mean colour, rms over pixels and channels.
    spread: f32,
}

/// What a block may differ by.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolerance {
    pub plane: f32,
    pub colour: f32,
    /// Largest block, a power of two.
    pub largest: usize,
}

impl Tolerance {
    fn takes(&self, block: &Block) -> bool {
        block.bend < f32::MAX
            && (block.size == 1
                || block.size <= self.largest && block.bend <= self.plane && block.spread <= self.colour)
    }
}

/// All blocks of all sizes of a raster, 1 px first. Rows of blocks cover the raster; those that stick out are barred.
pub(super) struct Blocks {
    levels: Vec<Level>,
}

struct Level {
    columns: usize,
    rows: usize,
    blocks: Vec<Block>,
}

const SIZES: usize = 5;

impl Blocks {
    pub fn measure(height: &Field, colours: &SrgbImage, mask: &Mask) -> Self {
        let (w, h) = mask.size();
        let rim = depth_inside(mask);
        let levels = (0..SIZES)
            .map(|k| {
                let size = 1usize << k;
                let (columns, rows) = (w.div_ceil(size), h.div_ceil(size));
                let blocks = (0..columns * rows)
                    .into_par_iter()
                    .map(|i| {
                        measure_block(
                            height,
                            colours,
                            mask,
                            &rim,
                            (i % columns) * size,
                            (i / columns) * size,
                            size,
                        )
                    })
                    .collect();
                Level { columns, rows, blocks }
            })
            .collect();
        Self { levels }
    }

    /// The largest blocks within tolerance, in the order of a depth-first walk.
    pub fn choose(&self, tolerance: &Tolerance) -> Vec<Block> {
        let mut chosen = Vec::new();
        self.walk(tolerance, |block| chosen.push(*block));
        chosen
    }

    pub fn count(&self, tolerance: &Tolerance) -> usize {
        let mut count = 0;
        self.walk(tolerance, |_| count += 1);
        count
    }

    fn walk(&self, tolerance: &Tolerance, mut visit: impl FnMut(&Block)) {
        let top = self.levels.len() - 1;
        let mut stack = Vec::new();
        for row in 0..self.levels[top].rows {
            for column in 0..self.levels[top].columns {
                stack.push((top, column, row));
                while let Some((k, column, row)) = stack.pop() {
                    let level = &self.levels[k];
                    if column >= level.columns || row >= level.rows {
                        continue;
                    }
                    let block = &level.blocks[row * level.columns + column];
                    if tolerance.takes(block) {
                        visit(block);
                    } else if k > 0 {
                        for (dx, dy) in [(1, 1), (0, 1), (1, 0), (0, 0)] {
                            stack.push((k - 1, 2 * column + dx, 2 * row + dy));
                        }
                    }
                }
            }
        }
    }
}

fn measure_block(
    height: &Field,
    colours: &SrgbImage,
    mask: &Mask,
    rim: &[u32],
    x0: usize,
    y0: usize,
    size: usize,
) -> Block {
    let (w, h) = mask.size();
    let middle = 0.5 * (size as f32 - 1.0);
    let mut block = Block {
        center: [x0 as f32 + middle, y0 as f32 + middle],
        size,
        plane: [0.0; 3],
        colour: [0.0; 3],
        bend: f32::INFINITY,
        spread: f32::INFINITY,
    };
    if x0 + size > w || y0 + size > h {
        return block;
    }
    let pixels = || (y0..y0 + size).flat_map(|y| (x0..x0 + size).map(move |x| (x, y)));
    if !pixels().all(|(x, y)| mask.at(x, y)) {
        return block;
    }
    if size == 1 {
        block.plane = pixel_plane(height, mask, x0, y0);
        block.colour = colours.at(x0, y0);
        (block.bend, block.spread) = (0.0, 0.0);
        return block;
    }
    // Distance to the outside, and to the frame, of the nearest pixel of the block.
    let to_frame = x0.min(y0).min(w - x0 - size).min(h - y0 - size) + 1;
    let to_rim = pixels().map(|(x, y)| rim[y * w + x] as usize).min().unwrap_or(0);
    if to_frame.min(to_rim) < size {
        return block;
    }
    let n = (size * size) as f32;
    let (mut mean, mut p, mut q, mut moment) = (0.0f32, 0.0f32, 0.0f32, 0.0f32);
    let mut colour = [0.0f32; 3];
    for (x, y) in pixels() {
        let (u, v) = (x as f32 - block.center[0], y as f32 - block.center[1]);
        let z = height.at(x, y);
        mean += z;
        p += u * z;
        q += v * z;
        moment += u * u;
        for (sum, c) in colour.iter_mut().zip(colours.at(x, y)) {
            *sum += c;
        }
    }
    block.plane = [mean / n, p / moment, q / moment];
    block.colour = colour.map(|c| c / n);
    let (mut bend, mut square) = (0.0f32, 0.0f32);
    for (x, y) in pixels() {
        let (u, v) = (x as f32 - block.center[0], y as f32 - block.center[1]);
        let [z, p, q] = block.plane;
        bend = bend.max((height.at(x, y) - z - p * u - q * v).abs());
        for (mean, c) in block.colour.iter().zip(colours.at(x, y)) {
            square += (c - mean) * (c - mean);
        }
    }
    (block.bend, block.spread) = (bend, (square / (3.0 * n)).sqrt());
    block
}

/// Height and slopes at one pixel, from neighbours inside the mask only: the fall at the rim is the walls'.
fn pixel_plane(height: &Field, mask: &Mask, x: usize, y: usize) -> [f32; 3] {
    let (w, h) = mask.size();
    let own = height.at(x, y);
    let at = |dx: isize, dy: isize| {
        let (x, y) = (x as isize + dx, y as isize + dy);
        let within = x >= 0 && y >= 0 && x < w as isize && y < h as isize;
        (within && mask.at(x as usize, y as usize)).then(|| height.at(x as usize, y as usize))
    };
    let slope = |before: Option<f32>, after: Option<f32>| match (before, after) {
        (Some(a), Some(b)) => 0.5 * (b - a),
        (Some(a), None) => own - a,
        (None, Some(b)) => b - own,
        (None, None) => 0.0,
    };
    [own, slope(at(-1, 0), at(1, 0)), slope(at(0, -1), at(0, 1))]
}
