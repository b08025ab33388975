//! What a file claims to unpack to, read from its header before anything is unpacked: a compressed file of a megabyte
//! may hold a thousand.

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use exr::meta::MetaData;

/// Bytes that the file's samples take in memory, by its header. Of formats that do not compress it is the file's length.
pub(crate) fn unpacked_bytes(extension: &str, bytes: &[u8]) -> Result<u64, String> {
    match extension {
        "exr" => exr_bytes(bytes),
        "png" => png_bytes(bytes),
        _ => Ok(bytes.len() as u64),
    }
}

fn exr_bytes(bytes: &[u8]) -> Result<u64, String> {
    let read = || MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|error| error.to_string());
    // The reader of foreign headers must return, whatever they hold.
    let meta =
        catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| Err("the header contradicts itself".to_owned()))?;
    let mut samples = 0u64;
    for header in &meta.headers {
        let area = (header.layer_size.x() as u64).saturating_mul(header.layer_size.y() as u64);
        samples = samples.saturating_add(area.saturating_mul(header.channels.list.len() as u64));
    }
    Ok(samples.saturating_mul(4))
}

/// W3C PNG, section 11.2.1: IHDR is the first chunk, and begins with width and height; at most 8 bytes a pixel.
fn png_bytes(bytes: &[u8]) -> Result<u64, String> {
    let side = |at: usize| {
        let bytes = bytes.get(at..at + 4)?;
        Some(u64::from(u32::from_be_bytes(bytes.try_into().ok()?)))
    };
    match (bytes.starts_with(b"\x89PNG\r\n\x1a\n"), side(16), side(20)) {
        (true, Some(width), Some(height)) => Ok(width.saturating_mul(height).saturating_mul(8)),
        _ => Err("expected a PNG file, found something else".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use gear_graph::Value;
    use gear_image::{Field, Image, Mask, Rgb};

    use super::*;

    #[test]
    fn a_header_tells_what_a_file_holds() {
        let field = Field::filled(7, 5, 1.0).encode().unwrap();
        assert_eq!(unpacked_bytes("exr", &field), Ok(7 * 5 * 4));
        let image = Image::opaque(Rgb::filled(7, 5, [0.5; 3])).encode().unwrap();
        assert_eq!(unpacked_bytes("exr", &image), Ok(7 * 5 * 12));
        let mask = Mask::filled(300, 2, true).encode().unwrap();
        assert_eq!(unpacked_bytes("png", &mask), Ok(300 * 2 * 8));
        assert_eq!(unpacked_bytes("ply", b"ply\n"), Ok(4));
    }

    #[test]
    fn a_header_that_lies_is_an_error_or_a_large_number() {
        let mut mask = Mask::filled(3, 2, true).encode().unwrap();
        mask[16..24].fill(0xff);
        assert!(unpacked_bytes("png", &mask).unwrap() > 1 << 60);
        assert!(unpacked_bytes("png", b"GIF89a").is_err());
        assert!(unpacked_bytes("exr", b"GIF89a").is_err());
        let exr = Field::filled(7, 5, 1.0).encode().unwrap();
        for at in 0..exr.len().min(400) {
            let mut damaged = exr.clone();
            damaged[at] = 0xff;
            let _ = unpacked_bytes("exr", &damaged);
            let _ = unpacked_bytes("exr", &exr[..at]);
        }
    }
}
