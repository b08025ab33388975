//! Why a picture file cannot be used.

/// A file and what is wrong with it.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {problem}")]
pub struct ReadError {
    /// The file as the user named it.
    pub file: String,
    /// What is wrong.
    #[source]
    pub problem: Problem,
}

/// What is wrong with a picture file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// No such file.
    #[error("no such file; check the path")]
    Missing,
    /// A folder was given.
    #[error("is a folder; give one picture file")]
    Folder,
    /// The file system refused.
    #[error("cannot be read: {0}")]
    Unreadable(std::io::Error),
    /// No bytes.
    #[error("the file is empty; expected a PNG, JPEG, TIFF, WebP or EXR picture")]
    Empty,
    /// Not a picture, whatever its name.
    #[error("not a picture: its content looks like {looks_like}; expected PNG, JPEG, TIFF, WebP or EXR")]
    NotAPicture {
        /// What the first bytes look like.
        looks_like: &'static str,
    },
    /// A picture format that is not read.
    #[error("{format} pictures are not supported; convert it to PNG, JPEG, TIFF, WebP or EXR")]
    Unsupported {
        /// The format.
        format: &'static str,
    },
    /// A kind of samples within a supported format that is not read.
    #[error("{found} is not supported; save it as 8-bit, 16-bit or float RGB or grey")]
    UnsupportedSamples {
        /// The kind.
        found: String,
    },
    /// Ink, not light.
    #[error("the picture is CMYK, which needs its printer's profile to be shown; convert it to RGB (sRGB)")]
    Cmyk,
    /// The colour profile cannot be used.
    #[error("its ICC profile cannot be used ({cause}); convert the picture to sRGB")]
    Profile {
        /// Why.
        cause: String,
    },
    /// No pixels.
    #[error("the picture is {width}x{height}: it has no pixels")]
    ZeroSize {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// Too many pixels.
    #[error("the picture is {width}x{height}; at most {side} pixels a side and {megapixels} megapixels are read")]
    TooLarge {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
        /// The limit on a side.
        side: usize,
        /// The limit on all pixels, in millions.
        megapixels: usize,
    },
    /// Too many bytes at once.
    #[error(
        "decoding the {width}x{height} picture needs {needs_mib} MiB at once, more than the {limit_mib} MiB allowed; \
         save it as a striped TIFF or a PNG that is not interlaced, or shrink it"
    )]
    TooMuchMemory {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
        /// Bytes of decoded samples, in MiB.
        needs_mib: usize,
        /// The limit, in MiB.
        limit_mib: usize,
    },
    /// The file ends early.
    #[error("the {format} file is cut off: it ends before its last pixel; get a complete copy")]
    Truncated {
        /// The format.
        format: &'static str,
    },
    /// The file contradicts itself.
    #[error("the {format} file is damaged: {cause}")]
    Damaged {
        /// The format.
        format: &'static str,
        /// What the decoder found.
        cause: String,
    },
}

impl From<std::io::Error> for Problem {
    fn from(error: std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::NotFound => Self::Missing,
            _ => Self::Unreadable(error),
        }
    }
}

impl Problem {
    /// A decoder's complaint: cut off when the bytes ran out, else damaged.
    pub(super) fn decoder(format: &'static str, cause: impl std::fmt::Display) -> Self {
        let cause = cause.to_string();
        let text = cause.to_ascii_lowercase();
        let ran_out = [
            "unexpected end",
            "unexpectedeof",
            "unexpected eof",
            "eof",
            "end of file",
            "fill whole buffer",
            "no more bytes",
            "insufficient",
            "exhausted",
            "premature",
        ];
        if ran_out.iter().any(|words| text.contains(words)) {
            Self::Truncated { format }
        } else {
            Self::Damaged { format, cause }
        }
    }
}
