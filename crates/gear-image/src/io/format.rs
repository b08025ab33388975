//! What a file is, by its first bytes.

use super::Problem;

/// The formats that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Png,
    Jpeg,
    Tiff,
    WebP,
    Exr,
}

impl Format {
    pub fn name(self) -> &'static str {
        match self {
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
            Self::Tiff => "TIFF",
            Self::WebP => "WebP",
            Self::Exr => "EXR",
        }
    }

    /// Whether an extension (lower case) is usual for the format.
    pub fn is_called(self, extension: &str) -> bool {
        match self {
            Self::Png => extension == "png",
            Self::Jpeg => ["jpg", "jpeg", "jpe", "jfif"].contains(&extension),
            Self::Tiff => ["tif", "tiff"].contains(&extension),
            Self::WebP => extension == "webp",
            Self::Exr => extension == "exr",
        }
    }
}

/// The format of a file from its first bytes (64 are enough).
pub(super) fn detect(head: &[u8]) -> Result<Format, Problem> {
    let starts = |magic: &[u8]| head.starts_with(magic);
    let at = |offset: usize, magic: &[u8]| head.get(offset..).is_some_and(|rest| rest.starts_with(magic));
    let unsupported = |format| Err(Problem::Unsupported { format });
    let not = |looks_like| Err(Problem::NotAPicture { looks_like });
    match () {
        () if head.is_empty() => Err(Problem::Empty),
        () if starts(b"\x89PNG\r\n\x1a\n") => Ok(Format::Png),
        () if starts(&[0xff, 0xd8, 0xff]) => Ok(Format::Jpeg),
        () if starts(b"II*\0") || starts(b"MM\0*") || starts(b"II+\0") || starts(b"MM\0+") => Ok(Format::Tiff),
        () if starts(b"RIFF") && at(8, b"WEBP") => Ok(Format::WebP),
        () if starts(&[0x76, 0x2f, 0x31, 0x01]) => Ok(Format::Exr),
        () if starts(b"GIF8") => unsupported("GIF"),
        () if starts(b"BM") && head.get(6..10) == Some(&[0; 4]) => unsupported("BMP"),
        () if starts(b"8BPS") => unsupported("Photoshop"),
        () if at(4, b"ftyphei") || at(4, b"ftypmif1") => unsupported("HEIC"),
        () if at(4, b"ftypavif") => unsupported("AVIF"),
        () if starts(&[0xff, 0x0a]) || at(4, b"JXL ") => unsupported("JPEG XL"),
        () if at(4, b"jP  ") || starts(&[0xff, 0x4f, 0xff, 0x51]) => unsupported("JPEG 2000"),
        () if starts(b"#?RADIANCE") => unsupported("Radiance HDR"),
        () if starts(b"%PDF") => not("a PDF document"),
        () if starts(b"PK\x03\x04") => not("a ZIP archive"),
        () if starts(b"<svg") || starts(b"<?xml") => not("SVG or XML text"),
        () if starts(b"<!DOCTYPE") || starts(b"<html") => not("a web page"),
        () if is_text(head) => not("text"),
        () => not("unknown binary data"),
    }
}

fn is_text(head: &[u8]) -> bool {
    let valid = match std::str::from_utf8(head) {
        Ok(_) => true,
        Err(error) => error.error_len().is_none(), // cut within a character
    };
    valid && head.iter().all(|&b| b >= 32 || [b'\n', b'\r', b'\t'].contains(&b))
}
