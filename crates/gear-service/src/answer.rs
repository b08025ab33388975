//! From the bytes of an answer to a picture like the one that was sent: its size, its colour space, its layout.

use gear_image::io::{self, Limits, Options};
use gear_image::{Field, Image, SrgbImage, colour, edges, filter};

use crate::ServiceError;

/// What a picture from a service may ask for. Services give a few megapixels.
const LIMITS: Limits = Limits {
    side: 16_384,
    pixels: 64 << 20,
    bytes: 512 << 20,
};

/// The picture in an answer at the size of the one that was sent, in sRGB. `host` names the service in errors.
pub fn restored(bytes: &[u8], size: (usize, usize), host: &str) -> Result<SrgbImage, ServiceError> {
    let unexpected = |found: String| ServiceError::Unexpected {
        host: host.to_owned(),
        found,
        expected: "a PNG, JPEG or WebP picture".to_owned(),
    };
    let options = Options {
        size: LIMITS.side,
        limits: LIMITS,
    };
    let loaded = io::decode_image(&mut std::io::Cursor::new(bytes), None, &options)
        .map_err(|problem| unexpected(format!("{} bytes that are no usable picture ({problem})", bytes.len())))?;
    let Image { rgb, .. } = loaded.image;
    let (width, height) = rgb.size();
    if width == 0 || height == 0 {
        return Err(unexpected("an empty picture".to_owned()));
    }
    // A service may crop or pad to the sizes it knows; such an answer does not lie on the view.
    let (was, is) = (size.0 as f64 / size.1 as f64, width as f64 / height as f64);
    if (was / is).max(is / was) > 1.03 {
        return Err(unexpected(format!(
            "a picture of {width}×{height} pixels for one of {}×{}, whose proportions differ",
            size.0, size.1
        )));
    }
    Ok(filter::resize_rgb(&rgb, size.0, size.1))
}

/// How far the contours of two pictures of one size agree, −1 to 1: the correlation of their soft edge maps, blurred by a
/// hundredth of the longer side so that an outline may lie a little beside the other. 1 for equal pictures, about 0 for
/// pictures that have nothing to do with each other. 1 where the first has no contours
/// that could be lost, 0 where the second has lost them all.
pub fn agreement(sent: &SrgbImage, answered: &SrgbImage) -> f64 {
    let (a, b) = (contours(sent), contours(answered));
    let mean = |field: &Field| gear_image::stats::mean(field.data());
    let (mean_a, mean_b) = (mean(&a), mean(&b));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (a, b) in a.data().iter().zip(b.data()) {
        let (a, b) = (f64::from(*a) - mean_a, f64::from(*b) - mean_b);
        ab += a * b;
        aa += a * a;
        bb += b * b;
    }
    if aa <= 1e-12 {
        return 1.0;
    }
    if bb <= 1e-12 {
        return 0.0;
    }
    ab / (aa.sqrt() * bb.sqrt())
}

fn contours(picture: &SrgbImage) -> Field {
    let longer = picture.longer_side() as f64;
    let soft = edges::soft_edges(&colour::light(picture), (longer / 512.0).max(0.6), 0.98);
    filter::gaussian(&soft, (longer / 100.0).max(0.6))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disc(x0: f32, y0: f32, tone: f32) -> SrgbImage {
        SrgbImage::from_fn(96, 96, |x, y| {
            let (dx, dy) = (x as f32 - x0, y as f32 - y0);
            let inside = dx * dx + dy * dy < 500.0;
            if inside {
                [tone, tone * 0.5, 0.2]
            } else {
                [0.9, 0.85, 0.8]
            }
        })
    }

    #[test]
    fn equal_layouts_agree_and_others_do_not() {
        let sent = disc(40.0, 50.0, 0.5);
        assert!((agreement(&sent, &sent) - 1.0).abs() < 1e-9);
        assert!(agreement(&sent, &disc(41.0, 50.0, 0.2)) > 0.8);
        assert!(agreement(&sent, &disc(70.0, 20.0, 0.5)) < 0.3);
        let blank = SrgbImage::filled(96, 96, [0.3; 3]);
        assert_eq!((agreement(&sent, &blank), agreement(&blank, &sent)), (0.0, 1.0));
    }

    #[test]
    fn an_answer_of_another_size_is_brought_to_the_view() {
        let image = |w, h| Image {
            rgb: SrgbImage::from_fn(w, h, |x, _| [x as f32 / w as f32; 3]),
            alpha: None,
        };
        let png = io::png_bytes(&image(128, 64)).unwrap();
        assert_eq!(restored(&png, (64, 32), "https://a").unwrap().size(), (64, 32));
        let error = restored(&png, (64, 64), "https://a").unwrap_err().to_string();
        assert!(error.contains("128×64") && error.contains("proportions"), "{error}");
        let error = restored(b"<html>", (64, 64), "https://a").unwrap_err().to_string();
        assert!(error.contains("no usable picture"), "{error}");
    }
}
