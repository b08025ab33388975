//! EXIF orientation, applied to the working picture.

use image::metadata::Orientation;

use crate::{Field, Image, Rgb};

/// The picture upright.
pub(super) fn upright(image: Image, orientation: Orientation) -> Image {
    if orientation == Orientation::NoTransforms {
        return image;
    }
    let (w, h) = image.size();
    // For each upright pixel, where it is in the file.
    let (width, height, from): (usize, usize, Box<dyn Fn(usize, usize) -> (usize, usize)>) = match orientation {
        Orientation::NoTransforms => (w, h, Box::new(|x, y| (x, y))),
        Orientation::FlipHorizontal => (w, h, Box::new(move |x, y| (w - 1 - x, y))),
        Orientation::Rotate180 => (w, h, Box::new(move |x, y| (w - 1 - x, h - 1 - y))),
        Orientation::FlipVertical => (w, h, Box::new(move |x, y| (x, h - 1 - y))),
        Orientation::Rotate90FlipH => (h, w, Box::new(|x, y| (y, x))),
        Orientation::Rotate90 => (h, w, Box::new(move |x, y| (y, h - 1 - x))),
        Orientation::Rotate270FlipH => (h, w, Box::new(move |x, y| (w - 1 - y, h - 1 - x))),
        Orientation::Rotate270 => (h, w, Box::new(move |x, y| (w - 1 - y, x))),
    };
    let rgb = Rgb::from_fn(width, height, |x, y| {
        let (x, y) = from(x, y);
        image.rgb.at(x, y)
    });
    let alpha = image.alpha.map(|alpha| {
        Field::from_fn(width, height, |x, y| {
            let (x, y) = from(x, y);
            alpha.at(x, y)
        })
    });
    Image { rgb, alpha }
}
