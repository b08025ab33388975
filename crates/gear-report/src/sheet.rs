//! Contact sheets: pictures of any sizes in a grid on the page's ground.

use crate::picture::{PAPER, Picture, PictureError, Pixels};

/// Space between pictures, and around all of them, in pixels.
const GAP: usize = 6;

/// Rows of pictures, each centred in a square cell of `cell` pixels; a larger one is shrunk to it. `None` leaves a cell
/// empty. A sheet without any cell is an error.
pub fn contact_sheet(rows: Vec<Vec<Option<Pixels>>>, cell: usize) -> Result<Picture, PictureError> {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let (width, height) = match columns {
        0 => (0, 0),
        _ => (columns * (cell + GAP) + GAP, rows.len() * (cell + GAP) + GAP),
    };
    let mut sheet = Pixels::filled(width, height, PAPER);
    for (r, row) in rows.into_iter().enumerate() {
        for (c, pixels) in row.into_iter().enumerate() {
            if let Some(pixels) = pixels {
                let pixels = pixels.at_most(cell);
                let (w, h) = pixels.size();
                let left = GAP + c * (cell + GAP) + (cell - w) / 2;
                let top = GAP + r * (cell + GAP) + (cell - h) / 2;
                sheet.paste(&pixels, left, top);
            }
        }
    }
    sheet.jpeg()
}

#[cfg(test)]
mod tests {
    use gear_image::SrgbImage;

    use super::*;

    fn plain(width: usize, height: usize, colour: [f32; 3]) -> Option<Pixels> {
        Some(Pixels::of_rgb(&SrgbImage::filled(width, height, colour)))
    }

    #[test]
    fn every_picture_stands_in_its_cell() {
        let rows = vec![
            vec![plain(40, 20, [1.0, 0.0, 0.0]), None],
            vec![plain(10, 10, [0.0, 0.0, 1.0])],
        ];
        let sheet = contact_sheet(rows, 20).unwrap();
        assert_eq!((sheet.width, sheet.height), (58, 58));
        let back = image::load_from_memory(&sheet.bytes).unwrap().to_rgb8();
        let near = |x, y, expected: [u8; 3]| {
            let found = back.get_pixel(x, y).0;
            assert!(
                found.iter().zip(expected).all(|(a, b)| a.abs_diff(b) < 40),
                "{found:?} at {x},{y}"
            );
        };
        near(16, 16, [255, 0, 0]);
        near(16, 42, [0, 0, 255]);
        near(42, 16, PAPER);
        near(3, 56, PAPER);
    }

    #[test]
    fn a_sheet_of_nothing_is_an_error() {
        assert!(contact_sheet(Vec::new(), 20).is_err());
        assert!(contact_sheet(vec![Vec::new()], 20).is_err());
    }
}
