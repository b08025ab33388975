use std::io::Cursor;

use image::{ExtendedColorType, ImageEncoder};

use super::*;
use crate::filter::resize_image;
use crate::{Field, Rgb, exr_file};

fn picture(width: usize, height: usize) -> Image {
    let code = |v: usize| (v % 256) as f32 / 255.0;
    Image::opaque(Rgb::from_fn(width, height, |x, y| {
        [code(x * 5), code(y * 7), code(x * y + 40)]
    }))
}

fn codes(image: &Image) -> Vec<u8> {
    image
        .rgb
        .data()
        .as_flattened()
        .iter()
        .map(|x| (x * 255.0).round() as u8)
        .collect()
}

fn tiff(image: &Image) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let (w, h) = image.size();
    image::codecs::tiff::TiffEncoder::new(&mut bytes)
        .write_image(&codes(image), w as u32, h as u32, ExtendedColorType::Rgb8)
        .unwrap();
    bytes.into_inner()
}

fn webp(image: &Image) -> Vec<u8> {
    let mut bytes = Vec::new();
    let (w, h) = image.size();
    image::codecs::webp::WebPEncoder::new_lossless(&mut bytes)
        .write_image(&codes(image), w as u32, h as u32, ExtendedColorType::Rgb8)
        .unwrap();
    bytes
}

fn jpeg(image: &Image) -> Vec<u8> {
    let mut bytes = Vec::new();
    let (w, h) = image.size();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 95)
        .write_image(&codes(image), w as u32, h as u32, ExtendedColorType::Rgb8)
        .unwrap();
    bytes
}

fn exr(image: &Image) -> Vec<u8> {
    let light = image.rgb.to_linear();
    let plane = |c: usize| light.data().iter().map(|p| p[c]).collect::<Vec<_>>();
    let (w, h) = image.size();
    exr_file::write(w, h, vec![("R", plane(0)), ("G", plane(1)), ("B", plane(2))], "linear").unwrap()
}

fn read(bytes: &[u8], size: usize) -> Result<Loaded, Problem> {
    decode_image(
        &mut Cursor::new(bytes),
        None,
        &Options {
            size,
            ..Options::default()
        },
    )
}

#[test]
fn lossless_formats_give_back_every_code() {
    let image = picture(37, 21);
    for bytes in [png_bytes(&image).unwrap(), tiff(&image), webp(&image)] {
        let loaded = read(&bytes, 768).unwrap();
        assert_eq!(loaded.image, image);
        assert_eq!((loaded.original, loaded.notes.len()), ((37, 21), 0));
    }
    let loaded = read(&exr(&image), 768).unwrap();
    let error = |(a, b): (&[f32; 3], &[f32; 3])| (a[0] - b[0]).abs().max((a[1] - b[1]).abs()).max((a[2] - b[2]).abs());
    assert!(
        loaded
            .image
            .rgb
            .data()
            .iter()
            .zip(image.rgb.data())
            .map(error)
            .all(|e| e < 1e-6)
    );
    let smooth = Image::opaque(Rgb::from_fn(64, 48, |x, y| [x as f32 / 63.0, y as f32 / 47.0, 0.5]));
    let loaded = read(&jpeg(&smooth), 768).unwrap();
    assert!(
        loaded
            .image
            .rgb
            .data()
            .iter()
            .zip(smooth.rgb.data())
            .map(error)
            .all(|e| e < 0.04)
    );
}

#[test]
fn sixteen_bits_and_alpha_are_kept() {
    let samples: Vec<u16> = (0..12 * 9).flat_map(|i| [i * 601, 65535 - i * 3, 7, i * 500]).collect();
    let bytes: Vec<u8> = samples.iter().flat_map(|s| s.to_ne_bytes()).collect();
    let mut png = Vec::new();
    image::codecs::png::PngEncoder::new(&mut png)
        .write_image(&bytes, 12, 9, ExtendedColorType::Rgba16)
        .unwrap();
    let image = read(&png, 768).unwrap().image;
    let alpha = image.alpha.unwrap();
    for (i, (pixel, a)) in image.rgb.data().iter().zip(alpha.data()).enumerate() {
        let expected: Vec<f32> = samples[4 * i..4 * i + 4]
            .iter()
            .map(|&s| f32::from(s) / 65535.0)
            .collect();
        assert_eq!([pixel[0], pixel[1], pixel[2], *a], expected[..]);
    }
}

#[test]
fn a_large_picture_streams_down_to_the_area_average() {
    let image = picture(301, 203);
    let expected = resize_image(&image, 100, 67);
    for bytes in [png_bytes(&image).unwrap(), tiff(&image), webp(&image), exr(&image)] {
        let small = read(&bytes, 100).unwrap().image;
        assert_eq!(small.size(), (100, 67));
        let pairs = small
            .rgb
            .data()
            .as_flattened()
            .iter()
            .zip(expected.rgb.data().as_flattened());
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 2e-5));
    }
}

#[test]
fn transparency_survives_a_png_file() {
    let alpha = Field::from_fn(20, 10, |x, _| (x * 13) as f32 / 255.0);
    let image = Image {
        alpha: Some(alpha),
        ..picture(20, 10)
    };
    assert_eq!(read(&png_bytes(&image).unwrap(), 768).unwrap().image, image);
}

/// A JPEG with an EXIF block that holds nothing but its orientation.
fn turned_jpeg(image: &Image, orientation: u8) -> Vec<u8> {
    let plain = jpeg(image);
    let mut exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0".to_vec();
    exif.extend([orientation, 0, 0, 0, 0, 0, 0]);
    let mut out = plain[..2].to_vec();
    out.extend([0xff, 0xe1]);
    out.extend(((exif.len() + 2) as u16).to_be_bytes());
    out.extend(&exif);
    out.extend(&plain[2..]);
    out
}

#[test]
fn every_exif_orientation_comes_out_upright() {
    // Bright in the file's top left quarter only.
    let image = Image::opaque(Rgb::from_fn(64, 32, |x, y| {
        [if x < 32 && y < 16 { 1.0 } else { 0.0 }; 3]
    }));
    // Where EXIF says that the file's top left corner belongs: (right, bottom), and whether sides are swapped.
    let expected = [
        (1, false, false, false),
        (2, true, false, false),
        (3, true, true, false),
        (4, false, true, false),
        (5, false, false, true),
        (6, true, false, true),
        (7, true, true, true),
        (8, false, true, true),
    ];
    for (code, right, bottom, swapped) in expected {
        let upright = read(&turned_jpeg(&image, code), 768).unwrap().image;
        let (w, h) = upright.size();
        assert_eq!((w, h), if swapped { (32, 64) } else { (64, 32) }, "orientation {code}");
        let x = if right { w - 4 } else { 3 };
        let y = if bottom { h - 4 } else { 3 };
        assert!(upright.rgb.at(x, y)[0] > 0.9, "orientation {code}");
        assert!(upright.rgb.at(w - 1 - x, h - 1 - y)[0] < 0.1, "orientation {code}");
    }
}

fn png_with_profile(icc: Vec<u8>) -> Vec<u8> {
    let mut png = Vec::new();
    let mut encoder = image::codecs::png::PngEncoder::new(&mut png);
    encoder.set_icc_profile(icc).unwrap();
    encoder
        .write_image(&[128, 128, 128, 100, 150, 100], 2, 1, ExtendedColorType::Rgb8)
        .unwrap();
    png
}

#[test]
fn profiles_are_taken_to_srgb() {
    let srgb = read(
        &png_with_profile(moxcms::ColorProfile::new_srgb().encode().unwrap()),
        768,
    )
    .unwrap();
    assert_eq!(srgb.image.rgb.at(1, 0), [100.0 / 255.0, 150.0 / 255.0, 100.0 / 255.0]);
    let p3 = read(
        &png_with_profile(moxcms::ColorProfile::new_display_p3().encode().unwrap()),
        768,
    )
    .unwrap();
    let [grey, green] = [p3.image.rgb.at(0, 0), p3.image.rgb.at(1, 0)];
    assert!(
        grey.iter().all(|&c| (c - 128.0 / 255.0).abs() < 0.003),
        "neutral stays neutral: {grey:?}"
    );
    // Display P3 (100, 150, 100) in sRGB, by the two published matrices.
    for (found, expected) in green.iter().zip([83.5f32, 151.7, 94.6]) {
        assert!((found * 255.0 - expected).abs() < 1.2, "{:?}", green.map(|c| c * 255.0));
    }
    assert!(matches!(
        read(&png_with_profile(b"no profile at all".to_vec()), 768),
        Err(Problem::Profile { .. })
    ));
}

#[test]
fn cmyk_is_refused_in_words() {
    let mut bytes = Cursor::new(Vec::new());
    ::tiff::encoder::TiffEncoder::new(&mut bytes)
        .unwrap()
        .write_image::<::tiff::encoder::colortype::CMYK8>(2, 2, &[0; 16])
        .unwrap();
    assert!(matches!(read(&bytes.into_inner(), 768), Err(Problem::Cmyk)));
    let mut jpeg = jpeg(&picture(16, 16));
    let frame = jpeg.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap();
    jpeg[frame + 9] = 4;
    let problem = read(&jpeg, 768).unwrap_err();
    assert!(matches!(problem, Problem::Cmyk));
    assert!(problem.to_string().contains("sRGB"));
}

#[test]
fn a_file_that_is_cut_off_is_refused_in_every_format() {
    let image = picture(90, 70);
    for bytes in [
        png_bytes(&image).unwrap(),
        jpeg(&image),
        tiff(&image),
        webp(&image),
        exr(&image),
    ] {
        for share in [0.3, 0.7, 0.95] {
            let cut = &bytes[..(bytes.len() as f64 * share) as usize];
            let problem = read(cut, 768).unwrap_err();
            let named = matches!(problem, Problem::Truncated { .. } | Problem::Damaged { .. });
            assert!(named, "{problem} ({share})");
        }
    }
}

#[test]
fn what_is_no_picture_is_named_for_what_it_is() {
    let refused = |bytes: &[u8]| read(bytes, 768).unwrap_err().to_string();
    assert!(refused(b"").contains("empty"));
    assert!(refused(b"a note to self, saved as painting.png").contains("looks like text"));
    assert!(refused(b"<!DOCTYPE html><title>404</title>").contains("a web page"));
    assert!(refused(b"%PDF-1.7 ...").contains("a PDF document"));
    assert!(refused(b"GIF89a....").contains("GIF pictures are not supported"));
    assert!(refused(&[0, 1, 2, 3, 250, 251]).contains("unknown binary data"));
    let missing = read_image(Path::new("no/such/painting.png"), &Options::default()).unwrap_err();
    assert!(matches!(missing.problem, Problem::Missing));
    assert!(missing.to_string().starts_with("no/such/painting.png: no such file"));
}

/// A PNG that claims a size, with a right checksum, and holds nothing.
fn hollow_png(width: u32, height: u32) -> Vec<u8> {
    let mut header = b"IHDR".to_vec();
    header.extend(width.to_be_bytes());
    header.extend(height.to_be_bytes());
    header.extend([8, 2, 0, 0, 0]);
    let crc = header.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| {
            if crc & 1 == 1 {
                (crc >> 1) ^ 0xedb8_8320
            } else {
                crc >> 1
            }
        })
    });
    let mut bytes = b"\x89PNG\r\n\x1a\n\0\0\0\x0d".to_vec();
    bytes.extend(header);
    bytes.extend((!crc).to_be_bytes());
    bytes
}

#[test]
fn sizes_of_nothing_and_of_everything_are_refused_before_memory_is_taken() {
    assert!(matches!(read(&hollow_png(0, 5), 768), Err(Problem::ZeroSize { .. })));
    assert!(matches!(
        read(&hollow_png(200_000, 2), 768),
        Err(Problem::TooLarge { .. })
    ));
    assert!(matches!(
        read(&hollow_png(90_000, 90_000), 768),
        Err(Problem::TooLarge { .. })
    ));
    assert!(matches!(
        read(&hollow_png(20_000, 10_000), 768),
        Err(Problem::Truncated { .. })
    ));
    let limits = Limits {
        bytes: 1000,
        ..Limits::default()
    };
    let small = |bytes: &[u8]| decode_image(&mut Cursor::new(bytes), None, &Options { size: 768, limits });
    assert!(matches!(
        small(&webp(&picture(64, 64))),
        Err(Problem::TooMuchMemory { .. })
    ));
    assert!(matches!(
        small(&exr(&picture(64, 64))),
        Err(Problem::TooMuchMemory { .. })
    ));
}

#[test]
fn bad_exr_pixels_are_replaced_and_counted() {
    let mut red = vec![0.5f32; 12];
    (red[0], red[1], red[2], red[3]) = (f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.25);
    let grey = vec![0.5f32; 12];
    let bytes = exr_file::write(4, 3, vec![("R", red), ("G", grey.clone()), ("B", grey)], "linear").unwrap();
    let loaded = read(&bytes, 768).unwrap();
    assert_eq!(loaded.notes.len(), 3);
    assert!(
        loaded.notes[0].starts_with("1 pixel has NaN samples"),
        "{:?}",
        loaded.notes
    );
    assert!(loaded.notes[1].starts_with("2 pixels have infinite"));
    assert!(loaded.notes[2].starts_with("1 pixel has negative"));
    assert!(
        loaded
            .image
            .rgb
            .data()
            .as_flattened()
            .iter()
            .all(|x| x.is_finite() && *x >= 0.0)
    );
    assert_eq!([0, 2, 3].map(|x| loaded.image.rgb.at(x, 0)[0]), [0.0; 3]);
}

#[test]
fn a_misleading_name_is_noted_and_the_content_read() {
    let bytes = jpeg(&picture(16, 16));
    let loaded = decode_image(&mut Cursor::new(&bytes), Some("png".into()), &Options::default()).unwrap();
    assert_eq!(
        loaded.notes,
        ["the file is called .png but holds a JPEG picture; read as such"]
    );
    assert!(read(&bytes, 768).unwrap().notes.is_empty());
}

/// An uncompressed grey TIFF in tiles of 16×16.
fn tiled_tiff(width: usize, height: usize, value: impl Fn(usize, usize) -> u8) -> Vec<u8> {
    let (across, down) = (width.div_ceil(16), height.div_ceil(16));
    let tiles = across * down;
    let entries = 10u16;
    let arrays = 8 + 2 + usize::from(entries) * 12 + 4;
    let data = arrays + tiles * 8;
    let mut out = b"II*\0\x08\0\0\0".to_vec();
    out.extend(entries.to_le_bytes());
    let mut entry = |tag: u16, kind: u16, count: usize, value: usize| {
        out.extend(tag.to_le_bytes());
        out.extend(kind.to_le_bytes());
        out.extend((count as u32).to_le_bytes());
        out.extend((value as u32).to_le_bytes());
    };
    entry(256, 3, 1, width);
    entry(257, 3, 1, height);
    entry(258, 3, 1, 8);
    entry(259, 3, 1, 1);
    entry(262, 3, 1, 1);
    entry(277, 3, 1, 1);
    entry(322, 3, 1, 16);
    entry(323, 3, 1, 16);
    entry(324, 4, tiles, arrays);
    entry(325, 4, tiles, arrays + tiles * 4);
    out.extend([0; 4]);
    out.extend((0..tiles).flat_map(|t| ((data + t * 256) as u32).to_le_bytes()));
    out.extend((0..tiles).flat_map(|_| 256u32.to_le_bytes()));
    for tile in 0..tiles {
        for i in 0..256 {
            let (x, y) = (tile % across * 16 + i % 16, tile / across * 16 + i / 16);
            out.push(if x < width && y < height { value(x, y) } else { 99 });
        }
    }
    out
}

#[test]
fn tiles_are_put_together() {
    let value = |x: usize, y: usize| ((x * 3 + y * 5) % 256) as u8;
    let image = read(&tiled_tiff(40, 37, value), 768).unwrap().image;
    assert_eq!(image.size(), (40, 37));
    for y in 0..37 {
        for x in 0..40 {
            assert_eq!(image.rgb.at(x, y), [f32::from(value(x, y)) / 255.0; 3], "({x}, {y})");
        }
    }
}

#[test]
fn masks_are_white_or_opaque_inside() {
    let inside = |x: usize, y: usize| x > 3 && y > 5;
    let white = Image::opaque(Rgb::from_fn(12, 9, |x, y| [if inside(x, y) { 0.9 } else { 0.1 }; 3]));
    let cover = Field::from_fn(12, 9, |x, y| if inside(x, y) { 1.0 } else { 0.0 });
    let cut_out = Image {
        rgb: Rgb::filled(12, 9, [0.8; 3]),
        alpha: Some(cover),
    };
    for image in [white, cut_out] {
        let bytes = png_bytes(&image).unwrap();
        let (mask, _) = decode_mask(&mut Cursor::new(&bytes), None, &Options::default()).unwrap();
        assert_eq!(mask, Mask::from_fn(12, 9, inside));
    }
}

#[test]
fn files_are_written_whole_or_not_at_all() {
    let folder = std::env::temp_dir().join(format!("gear-image-write-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("picture.png");
    write_png(&path, &picture(9, 7)).unwrap();
    write_mask_png(&folder.join("mask.png"), &Mask::filled(3, 3, true)).unwrap();
    assert_eq!(read_image(&path, &Options::default()).unwrap().image, picture(9, 7));
    assert_eq!(
        read_mask(&folder.join("mask.png"), &Options::default()).unwrap().0,
        Mask::filled(3, 3, true)
    );
    let blocked = folder.join("no folder").join("picture.png");
    assert!(
        write_png(&blocked, &picture(9, 7))
            .unwrap_err()
            .to_string()
            .contains("cannot be written")
    );
    assert_eq!(
        std::fs::read_dir(&folder).unwrap().count(),
        2,
        "no temporary file is left"
    );
    std::fs::remove_dir_all(&folder).unwrap();
}

#[cfg(feature = "graph")]
#[test]
fn the_loaders_leave_notes_and_name_the_cause() {
    use gear_graph::{Context, FileSource, Loader};
    let ctx = Context::detached();
    let bytes = png_bytes(&picture(40, 20)).unwrap();
    let image = ImageFile { size: 10 }
        .load(&FileSource::bytes("p", bytes), &ctx)
        .unwrap();
    assert_eq!(image.size(), (10, 5));
    let error = MaskFile::default()
        .load(&FileSource::bytes("m", *b"hello"), &ctx)
        .unwrap_err();
    assert!(error.to_string().contains("looks like text"));
}
