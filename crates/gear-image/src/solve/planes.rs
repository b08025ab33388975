//! Red-black storage: the two colours of the checkerboard as separate planes.

use crate::Mask;

/// The shape of both planes of a level.
///
/// Pixel (x, y) has colour `(x + y) & 1` and lies at row `y`, column `x / 2`. Widths and heights are rounded up to
/// even, so both planes have the same shape; cells that only pad have no link and stay zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    /// Real width in pixels.
    pub width: usize,
    /// Real height in pixels.
    pub height: usize,
    /// Columns of a plane.
    pub columns: usize,
    /// Rows of a plane, even.
    pub rows: usize,
}

impl Layout {
    pub fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            columns: width.div_ceil(2),
            rows: height.div_ceil(2) * 2,
        }
    }

    pub fn len(&self) -> usize {
        self.columns * self.rows
    }

    /// (colour, index) of a pixel.
    #[inline]
    pub fn place(&self, x: usize, y: usize) -> (usize, usize) {
        ((x + y) & 1, y * self.columns + x / 2)
    }

    /// Rows a thread takes at once: a fixed amount of work, whatever the number of threads.
    pub fn band_rows(&self) -> usize {
        (16_384 / self.columns.max(1)).max(1)
    }
}

/// One value a pixel, in two planes: `[red, black]`.
#[derive(Clone, Debug)]
pub(super) struct Planes<T> {
    pub layout: Layout,
    pub colours: [Vec<T>; 2],
}

impl<T: Copy + Default> Planes<T> {
    pub fn zeros(layout: Layout) -> Self {
        Self {
            layout,
            colours: [vec![T::default(); layout.len()], vec![T::default(); layout.len()]],
        }
    }

    #[inline]
    pub fn at(&self, x: usize, y: usize) -> T {
        let (colour, index) = self.layout.place(x, y);
        self.colours[colour][index]
    }

    #[inline]
    pub fn set(&mut self, x: usize, y: usize, value: T) {
        let (colour, index) = self.layout.place(x, y);
        self.colours[colour][index] = value;
    }

    /// From row-major values; zero outside the mask.
    pub fn gather(layout: Layout, values: &[T], mask: &Mask) -> Self {
        let mut out = Self::zeros(layout);
        for y in 0..layout.height {
            for (x, &inside) in mask.row(y).iter().enumerate() {
                if inside {
                    out.set(x, y, values[y * layout.width + x]);
                }
            }
        }
        out
    }

    /// To row-major values.
    pub fn scatter(&self, width: usize, height: usize) -> Vec<T> {
        let mut out = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                out.push(self.at(x, y));
            }
        }
        out
    }
}
