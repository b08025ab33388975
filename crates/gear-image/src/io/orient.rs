//! EXIF orientation, applied to the working picture.

use image::metadata::Orientation;

use crate::{Field, Image, Rgb};

/// The picture upright.
pub(super) fn upright(image: Image, orientation: Orientation) -> Image {
    if orientation == Orientation::NoTransforms {
        return image;
    }
    let (w, h) = image.size();
    use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
    let swapped = matches!(orientation, Rotate90 | Rotate270 | Rotate90FlipH | Rotate270FlipH);
    let (width, height) = if swapped { (h, w) } else { (w, h) };
    // For each upright pixel, where it is in the file.
    let from = |x: usize, y: usize| match orientation {
        Orientation::NoTransforms => (x, y),
        Orientation::FlipHorizontal => (w - 1 - x, y),
        Orientation::Rotate180 => (w - 1 - x, h - 1 - y),
        Orientation::FlipVertical => (x, h - 1 - y),
        Rotate90FlipH => (y, x),
        Rotate90 => (y, h - 1 - x),
        Rotate270FlipH => (w - 1 - y, h - 1 - x),
        Rotate270 => (w - 1 - y, x),
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
