//! Gradients: central differences, one-sided at the rim (numpy's `gradient`), 0 along a side of one pixel.

use rayon::prelude::*;

use crate::Field;

/// ∂f/∂x, x to the right, per pixel.
pub fn gradient_x(f: &Field) -> Field {
    let (width, height) = f.size();
    let mut out = Field::filled(width, height, 0.0);
    if width < 2 || height == 0 {
        return out;
    }
    out.data_mut()
        .par_chunks_mut(width)
        .zip(f.data().par_chunks(width))
        .for_each(|(out, row)| {
            for x in 1..width - 1 {
                out[x] = 0.5 * (row[x + 1] - row[x - 1]);
            }
            out[0] = row[1] - row[0];
            out[width - 1] = row[width - 1] - row[width - 2];
        });
    out
}

/// ∂f/∂y, y down, per pixel.
pub fn gradient_y(f: &Field) -> Field {
    let (width, height) = f.size();
    let mut out = Field::filled(width, height, 0.0);
    if height < 2 || width == 0 {
        return out;
    }
    out.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        let (above, below) = (y.saturating_sub(1), (y + 1).min(height - 1));
        let scale = 1.0 / (below - above) as f32;
        for ((out, a), b) in out.iter_mut().zip(f.row(above)).zip(f.row(below)) {
            *out = scale * (b - a);
        }
    });
    out
}

/// (∂f/∂x, ∂f/∂y).
pub fn gradient(f: &Field) -> (Field, Field) {
    (gradient_x(f), gradient_y(f))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_has_its_slopes_everywhere() {
        let plane = Field::from_fn(7, 5, |x, y| 2.0 * x as f32 - 3.0 * y as f32);
        let (gx, gy) = gradient(&plane);
        assert!(gx.data().iter().all(|&g| g == 2.0) && gy.data().iter().all(|&g| g == -3.0));
    }

    #[test]
    fn a_side_of_one_pixel_has_no_slope() {
        let line = Field::from_fn(1, 4, |_, y| (y * y) as f32);
        assert_eq!(gradient_x(&line).data(), [0.0; 4]);
        assert_eq!(gradient_y(&line).data(), [1.0, 2.0, 4.0, 5.0]);
        assert_eq!(gradient(&Field::filled(1, 1, 3.0)).1.data(), [0.0]);
    }
}
