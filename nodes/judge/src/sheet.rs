//! What the model sees: the painting, and a strip of views for each method, as PNG.

use std::sync::Arc;

use gear_graph::NodeError;
use gear_image::{Image, SrgbImage, colour, filter, io};
use gear_splat::Views;

/// White between two views, in pixels.
const GAP: usize = 8;

/// The pictures of one judgement, PNG.
pub struct Sheets {
    pub painting: Vec<u8>,
    /// One a method, in the order of the wires.
    pub methods: Vec<Vec<u8>>,
}

/// Pictures of the painting and of each method's views, `shown` of them, each `size` pixels on its longer side.
pub fn of_methods(painting: &Image, views: &[Arc<Views>], size: usize, shown: usize) -> Result<Sheets, NodeError> {
    if painting.rgb.is_empty() {
        return Err(NodeError::input("painting", "it has no pixels; expected a picture"));
    }
    let methods = views.iter().enumerate().map(|(i, views)| {
        let pictures: Vec<SrgbImage> = spread(views.views.len(), shown)
            .into_iter()
            .map(|k| fitted(&views.views[k].rgb, size))
            .filter(|picture| !picture.is_empty())
            .collect();
        if pictures.is_empty() {
            let problem = format!("method {} has no view with pixels; expected rendered views", i + 1);
            return Err(NodeError::input("views", problem));
        }
        png(strip(&pictures))
    });
    Ok(Sheets {
        painting: png(fitted(&painting.rgb, 2 * size))?,
        methods: methods.collect::<Result<_, _>>()?,
    })
}

/// `shown` of `count` places, first and last among them.
fn spread(count: usize, shown: usize) -> Vec<usize> {
    if count <= shown {
        return (0..count).collect();
    }
    if shown == 1 {
        return vec![count / 2];
    }
    (0..shown).map(|i| i * (count - 1) / (shown - 1)).collect()
}

fn fitted(picture: &SrgbImage, size: usize) -> SrgbImage {
    let (width, height) = picture.size();
    if width == 0 || height == 0 {
        return SrgbImage::filled(0, 0, [1.0; 3]);
    }
    let (w, h) = filter::fit_longer_side(width, height, size);
    let mut fitted = filter::resize_rgb(picture, w, h);
    for pixel in fitted.data_mut() {
        *pixel = pixel.map(colour::sanitise_sample);
    }
    fitted
}

fn strip(pictures: &[SrgbImage]) -> SrgbImage {
    let height = pictures.iter().map(SrgbImage::height).max().unwrap_or(1);
    let width: usize = pictures.iter().map(|picture| picture.width() + GAP).sum::<usize>() - GAP;
    let mut strip = SrgbImage::filled(width, height, [1.0; 3]);
    let mut left = 0;
    for picture in pictures {
        for y in 0..picture.height() {
            for x in 0..picture.width() {
                strip.data_mut()[y * width + left + x] = picture.at(x, y);
            }
        }
        left += picture.width() + GAP;
    }
    strip
}

fn png(rgb: SrgbImage) -> Result<Vec<u8>, NodeError> {
    io::png_bytes(&Image { rgb, alpha: None }).map_err(NodeError::new)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_are_spread_over_all() {
        assert_eq!(spread(7, 3), [0, 3, 6]);
        assert_eq!(spread(3, 5), [0, 1, 2]);
        assert_eq!(spread(7, 1), [3]);
        assert!(spread(0, 4).is_empty());
    }

    #[test]
    fn a_strip_holds_its_pictures_side_by_side() {
        let strip = strip(&[SrgbImage::filled(4, 3, [0.1; 3]), SrgbImage::filled(2, 5, [0.7; 3])]);
        assert_eq!(strip.size(), (4 + GAP + 2, 5));
        assert_eq!(
            (strip.at(0, 0)[0], strip.at(0, 4)[0], strip.at(4 + GAP, 4)[0]),
            (0.1, 1.0, 0.7)
        );
    }
}
