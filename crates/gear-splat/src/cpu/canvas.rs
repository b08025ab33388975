//! The pictures under construction, cut into what one task writes.

use gear_image::{Field, Rgb};

use super::bin::{Bins, Grid, TILE_HEIGHT, TILE_WIDTH};
use crate::render::{Outputs, Rendering};

/// Pictures under construction; planes that are not wanted are empty.
pub(crate) struct Canvas {
    rgb: Vec<[f32; 3]>,
    alpha: Vec<f32>,
    depth: Vec<f32>,
    median: Vec<f32>,
    normal: Vec<[f32; 3]>,
}

/// The part of a [`Canvas`] that one row of tiles covers.
pub(crate) struct Band<'a> {
    rgb: &'a mut [[f32; 3]],
    alpha: &'a mut [f32],
    depth: &'a mut [f32],
    median: &'a mut [f32],
    normal: &'a mut [[f32; 3]],
}

/// The part of a [`Canvas`] that one strip of a tile covers, row by row; planes that are not wanted have no rows.
pub(crate) struct Patch<'a> {
    /// The tile.
    pub tile: usize,
    /// Rows of the tile: the first, and the one after the last.
    pub rows: (usize, usize),
    pub rgb: Vec<&'a mut [[f32; 3]]>,
    pub alpha: Vec<&'a mut [f32]>,
    pub depth: Vec<&'a mut [f32]>,
    pub median: Vec<&'a mut [f32]>,
    pub normal: Vec<&'a mut [[f32; 3]]>,
}

impl Canvas {
    pub fn new(grid: &Grid, outputs: Outputs) -> Self {
        let len = |wanted: bool| if wanted { grid.width * grid.height } else { 0 };
        Self {
            rgb: vec![[0.0; 3]; len(outputs.rgb)],
            alpha: vec![0.0; len(outputs.alpha)],
            depth: vec![0.0; len(outputs.depth)],
            median: vec![0.0; len(outputs.median_depth)],
            normal: vec![[0.0; 3]; len(outputs.normal)],
        }
    }

    /// The rows of tiles.
    pub fn bands(&mut self, grid: &Grid) -> Vec<Band<'_>> {
        let len = grid.width * TILE_HEIGHT;
        let mut rgb = self.rgb.chunks_mut(len);
        let mut alpha = self.alpha.chunks_mut(len);
        let mut depth = self.depth.chunks_mut(len);
        let mut median = self.median.chunks_mut(len);
        let mut normal = self.normal.chunks_mut(len);
        (0..grid.rows)
            .map(|_| Band {
                rgb: rgb.next().unwrap_or_default(),
                alpha: alpha.next().unwrap_or_default(),
                depth: depth.next().unwrap_or_default(),
                median: median.next().unwrap_or_default(),
                normal: normal.next().unwrap_or_default(),
            })
            .collect()
    }

    pub fn finish(self, grid: &Grid, outputs: Outputs) -> Rendering {
        let field = |wanted: bool, data| wanted.then(|| Field::from_vec(grid.width, grid.height, data));
        Rendering {
            rgb: outputs.rgb.then(|| Rgb::from_vec(grid.width, grid.height, self.rgb)),
            alpha: field(outputs.alpha, self.alpha),
            depth: field(outputs.depth, self.depth),
            median_depth: field(outputs.median_depth, self.median),
            normal: outputs.normal.then_some(self.normal),
        }
    }
}

impl<'a> Band<'a> {
    /// The strips of the tiles of row `row`, in order.
    pub fn patches(self, bins: &Bins, row: usize) -> Vec<Patch<'a>> {
        let grid = &bins.grid;
        let mut rgb = by_column(self.rgb, grid).into_iter();
        let mut alpha = by_column(self.alpha, grid).into_iter();
        let mut depth = by_column(self.depth, grid).into_iter();
        let mut median = by_column(self.median, grid).into_iter();
        let mut normal = by_column(self.normal, grid).into_iter();
        let mut patches = Vec::with_capacity(grid.columns);
        for column in 0..grid.columns {
            let tile = row * grid.columns + column;
            let mut rgb = rgb.next().unwrap_or_default();
            let mut alpha = alpha.next().unwrap_or_default();
            let mut depth = depth.next().unwrap_or_default();
            let mut median = median.next().unwrap_or_default();
            let mut normal = normal.next().unwrap_or_default();
            for rows in bins.strips(tile) {
                let count = rows.1 - rows.0;
                patches.push(Patch {
                    tile,
                    rows,
                    rgb: take(&mut rgb, count),
                    alpha: take(&mut alpha, count),
                    depth: take(&mut depth, count),
                    median: take(&mut median, count),
                    normal: take(&mut normal, count),
                });
            }
        }
        patches
    }
}

/// The first `count` rows, or what there is of them.
fn take<T>(rows: &mut Vec<T>, count: usize) -> Vec<T> {
    let count = count.min(rows.len());
    rows.drain(..count).collect()
}

/// The rows of a band's tiles, by tile.
fn by_column<'a, T>(band: &'a mut [T], grid: &Grid) -> Vec<Vec<&'a mut [T]>> {
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
