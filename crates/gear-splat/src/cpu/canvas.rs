//! The pictures under construction, cut into what one task writes.
//!
//! Their memory is not filled before it is written: that is work for one thread while the others wait, and the pages of
//! large pictures are then touched by that thread alone. It is the one place of the rasteriser with `unsafe`, and the proof
//! needs this file only: the patches that [`paint`] hands out are disjoint parts of one picture; [`Patch::write`] takes a
//! patch by value, writes every entry of its rows and counts its pixels; and `paint` asserts that the counts add up to
//! the picture before it calls the entries written.
#![allow(
    unsafe_code,
    reason = "pictures are written where nothing was before: filling them first costs one thread's time; the proof is above"
)]

use std::mem::MaybeUninit;
use std::sync::atomic::{AtomicUsize, Ordering};

use gear_image::{Field, Rgb};
use rayon::prelude::*;

use super::bin::{Bins, Grid, TILE_HEIGHT, TILE_WIDTH};
use super::lanes::{Plane, STRIDE};
use crate::render::{Outputs, Rendering};

/// Has `stroke` write every patch of the wanted pictures, on all threads; each thread has buffers of its own.
pub(crate) fn paint<B>(
    bins: &Bins,
    outputs: Outputs,
    buffers: impl Fn() -> B + Sync + Send,
    stroke: impl Fn(&mut B, Patch) + Sync + Send,
) -> Rendering {
    let grid = &bins.grid;
    let mut canvas = Canvas::new(grid, outputs);
    canvas
        .bands(grid, outputs)
        .into_par_iter()
        .enumerate()
        .for_each(|(row, band)| {
            let patches = band.patches(bins, row).into_par_iter();
            patches.for_each_init(&buffers, &stroke);
        });
    canvas.finish(grid, outputs)
}

/// Pictures under construction: vectors of length 0 that have room for a picture, or none where it is not wanted.
struct Canvas {
    rgb: Vec<[f32; 3]>,
    alpha: Vec<f32>,
    depth: Vec<f32>,
    median: Vec<f32>,
    normal: Vec<[f32; 3]>,
    written: AtomicUsize,
}

/// The part of a picture's row that one task writes.
type Row<'a, T> = &'a mut [MaybeUninit<T>];

/// The part of the pictures that one row of tiles covers.
struct Band<'a> {
    rgb: Row<'a, [f32; 3]>,
    alpha: Row<'a, f32>,
    depth: Row<'a, f32>,
    median: Row<'a, f32>,
    normal: Row<'a, [f32; 3]>,
    written: &'a AtomicUsize,
}

/// The part of the pictures that one strip of a tile covers, row by row; planes that are not wanted have no rows.
pub(crate) struct Patch<'a> {
    /// The tile.
    pub tile: usize,
    /// Rows of the tile: the first, and the one after the last.
    pub rows: (usize, usize),
    rgb: Vec<Row<'a, [f32; 3]>>,
    alpha: Vec<Row<'a, f32>>,
    depth: Vec<Row<'a, f32>>,
    median: Vec<Row<'a, f32>>,
    normal: Vec<Row<'a, [f32; 3]>>,
    pixels: usize,
    written: &'a AtomicUsize,
}

/// A tile's finished planes, from which a patch takes its rows.
pub(crate) struct Finished<'a> {
    pub rgb: &'a [Plane; 3],
    pub alpha: &'a Plane,
    pub depth: &'a Plane,
    pub median: &'a Plane,
    pub normal: &'a [Plane; 3],
}

impl Canvas {
    fn new(grid: &Grid, outputs: Outputs) -> Self {
        let len = |wanted: bool| if wanted { grid.width * grid.height } else { 0 };
        Self {
            rgb: Vec::with_capacity(len(outputs.rgb)),
            alpha: Vec::with_capacity(len(outputs.alpha)),
            depth: Vec::with_capacity(len(outputs.depth)),
            median: Vec::with_capacity(len(outputs.median_depth)),
            normal: Vec::with_capacity(len(outputs.normal)),
            written: AtomicUsize::new(0),
        }
    }

    /// The rows of tiles.
    fn bands(&mut self, grid: &Grid, outputs: Outputs) -> Vec<Band<'_>> {
        /// A band's part of what is wanted, and nothing of the rest.
        fn cut<'a, T>(plane: &'a mut Vec<T>, grid: &Grid, wanted: bool) -> impl Iterator<Item = Row<'a, T>> {
            let pixels = if wanted { grid.width * grid.height } else { 0 };
            plane.spare_capacity_mut()[..pixels].chunks_mut(grid.width * TILE_HEIGHT)
        }
        let mut rgb = cut(&mut self.rgb, grid, outputs.rgb);
        let mut alpha = cut(&mut self.alpha, grid, outputs.alpha);
        let mut depth = cut(&mut self.depth, grid, outputs.depth);
        let mut median = cut(&mut self.median, grid, outputs.median_depth);
        let mut normal = cut(&mut self.normal, grid, outputs.normal);
        (0..grid.rows)
            .map(|_| Band {
                rgb: rgb.next().unwrap_or_default(),
                alpha: alpha.next().unwrap_or_default(),
                depth: depth.next().unwrap_or_default(),
                median: median.next().unwrap_or_default(),
                normal: normal.next().unwrap_or_default(),
                written: &self.written,
            })
            .collect()
    }

    /// The pictures, once every patch is written.
    fn finish(mut self, grid: &Grid, outputs: Outputs) -> Rendering {
        let pixels = grid.width * grid.height;
        assert_eq!(*self.written.get_mut(), pixels, "every patch is written once");
        /// # Safety
        /// The first `pixels` entries must have been written.
        unsafe fn whole<T>(mut plane: Vec<T>, wanted: bool, pixels: usize) -> Option<Vec<T>> {
            // SAFETY: the caller says so; the room for them was taken in `Canvas::new`.
            wanted.then(|| unsafe {
                plane.set_len(pixels);
                plane
            })
        }
        let field = |data| Field::from_vec(grid.width, grid.height, data);
        // SAFETY: patches are disjoint parts of the first `pixels` entries of every wanted plane, made once, each counts its
        // pixels once and only after it wrote all of them in every wanted plane, and the sum of the counts is `pixels`.
        unsafe {
            Rendering {
                rgb: whole(self.rgb, outputs.rgb, pixels).map(|data| Rgb::from_vec(grid.width, grid.height, data)),
                alpha: whole(self.alpha, outputs.alpha, pixels).map(field),
                depth: whole(self.depth, outputs.depth, pixels).map(field),
                median_depth: whole(self.median, outputs.median_depth, pixels).map(field),
                normal: whole(self.normal, outputs.normal, pixels),
            }
        }
    }
}

impl<'a> Band<'a> {
    /// The strips of the tiles of row `row`, in order.
    fn patches(self, bins: &Bins, row: usize) -> Vec<Patch<'a>> {
        let grid = &bins.grid;
        let mut rgb = by_column(self.rgb, grid).into_iter();
        let mut alpha = by_column(self.alpha, grid).into_iter();
        let mut depth = by_column(self.depth, grid).into_iter();
        let mut median = by_column(self.median, grid).into_iter();
        let mut normal = by_column(self.normal, grid).into_iter();
        let mut patches = Vec::with_capacity(grid.columns);
        for column in 0..grid.columns {
            let tile = row * grid.columns + column;
            let width = TILE_WIDTH.min(grid.width - column * TILE_WIDTH);
            let mut rgb = rgb.next().unwrap_or_default();
            let mut alpha = alpha.next().unwrap_or_default();
            let mut depth = depth.next().unwrap_or_default();
            let mut median = median.next().unwrap_or_default();
            let mut normal = normal.next().unwrap_or_default();
            let mut left = TILE_HEIGHT.min(grid.height - row * TILE_HEIGHT);
            for rows in bins.strips(tile) {
                let count = left.min(rows.1 - rows.0);
                left -= count;
                patches.push(Patch {
                    tile,
                    rows,
                    rgb: take(&mut rgb, count),
                    alpha: take(&mut alpha, count),
                    depth: take(&mut depth, count),
                    median: take(&mut median, count),
                    normal: take(&mut normal, count),
                    pixels: count * width,
                    written: self.written,
                });
            }
        }
        patches
    }
}

impl Patch<'_> {
    /// Writes all of it.
    pub fn write(self, from: &Finished) {
        let first = self.rows.0;
        for (rows, planes) in [(self.rgb, from.rgb), (self.normal, from.normal)] {
            for (y, row) in rows.into_iter().enumerate() {
                let at = (first + y) * STRIDE;
                let [a, b, c] = planes.each_ref().map(|plane| &plane[at..at + row.len()]);
                for (((out, &a), &b), &c) in row.iter_mut().zip(a).zip(b).zip(c) {
                    out.write([a, b, c]);
                }
            }
        }
        for (rows, plane) in [
            (self.alpha, from.alpha),
            (self.depth, from.depth),
            (self.median, from.median),
        ] {
            for (y, row) in rows.into_iter().enumerate() {
                let at = (first + y) * STRIDE;
                let plane = &plane[at..at + row.len()];
                for (out, &x) in row.iter_mut().zip(plane) {
                    out.write(x);
                }
            }
        }
        self.written.fetch_add(self.pixels, Ordering::Relaxed);
    }
}

/// The first `count` rows, or what there is of them.
fn take<T>(rows: &mut Vec<T>, count: usize) -> Vec<T> {
    let count = count.min(rows.len());
    rows.drain(..count).collect()
}

/// The rows of a band's tiles, by tile.
fn by_column<'a, T>(band: Row<'a, T>, grid: &Grid) -> Vec<Vec<Row<'a, T>>> {
    let mut columns = Vec::new();
    if band.is_empty() {
        return columns;
    }
    columns.resize_with(grid.columns, || Vec::with_capacity(TILE_HEIGHT));
    for row in band.chunks_mut(grid.width) {
        for (column, part) in row.chunks_mut(TILE_WIDTH).enumerate() {
            columns[column].push(part);
        }
    }
    columns
}
