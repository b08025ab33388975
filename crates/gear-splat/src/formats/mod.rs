//! Files of Gaussian scenes, a module each; views as layered OpenEXR, planes of one view as plain OpenEXR.
//!
//! | module | format | | kept |
//! |---|---|---|---|
//! | [`ply`] | 3DGS PLY, `.ply` | read, write | everything, bit for bit |
//! | [`compressed_ply`] | PlayCanvas compressed PLY, `.compressed.ply` | read | |
//! | [`spz`] | Niantic SPZ 2 and 3, `.spz` | read, write 3 | rounded to bytes; no camera |
//! | [`splat`] | antimatter15's `.splat` | read, write | centres and scales in f32, the rest in bytes; SH degree 0; no camera |
//! | [`gltf`] | glTF 2.0 with `KHR_gaussian_splatting`, `.glb` | write | everything in f32 |
//!
//! A file is read as what its bytes are, whatever its name ([`Format::detect`]); it is written as what its name says
//! ([`Format::of_path`]). Counts in headers are believed only as far as the file's length backs them, before any memory
//! is taken. Coordinates are taken as they are: no format but glTF and SPZ says which way is up. [`read`] and [`write()`] leave
//! out SH bands that are zero in every Gaussian: they show nowhere, and a third-degree scene is four times as large.

pub mod compressed_ply;
mod error;
pub mod gltf;
mod loss;
pub mod planes_exr;
pub mod ply;
mod ply_header;
pub mod splat;
pub mod spz;
pub mod views_exr;

use std::fmt;
use std::path::Path;

use crate::Scene;

pub use error::FormatError;
pub use loss::Loss;

/// A file with more Gaussians is taken for damaged: as f32 they would fill over 3 GB even without higher SH.
pub const MOST_GAUSSIANS: u64 = 1 << 26;

/// A longer file is not read.
pub const MOST_BYTES: u64 = 1 << 34;

/// A format of scene files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// 3DGS PLY.
    Ply,
    /// PlayCanvas compressed PLY.
    CompressedPly,
    /// Niantic SPZ.
    Spz,
    /// Records of 32 bytes.
    Splat,
    /// glTF 2.0 with `KHR_gaussian_splatting`, binary.
    Glb,
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ply => "PLY",
            Self::CompressedPly => "compressed PLY",
            Self::Spz => "SPZ",
            Self::Splat => ".splat",
            Self::Glb => "glTF",
        })
    }
}

impl Format {
    /// Extensions of the formats that [`write()`] writes.
    pub const WRITTEN: &str = ".ply, .spz, .splat or .glb";

    /// The format that a file name asks for.
    pub fn of_path(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?.to_ascii_lowercase();
        let extensions = [
            (".compressed.ply", Self::CompressedPly),
            (".ply", Self::Ply),
            (".spz", Self::Spz),
            (".splat", Self::Splat),
            (".glb", Self::Glb),
        ];
        let found = extensions
            .into_iter()
            .find(|(extension, _)| name.ends_with(extension))?;
        Some(found.1)
    }

    /// The format that a file's bytes are in.
    pub fn detect(bytes: &[u8]) -> Result<Self, FormatError> {
        if bytes.is_empty() {
            return Err(FormatError::Empty);
        }
        if ply_header::begins(bytes) {
            let header = ply_header::parse(bytes)?;
            return Ok(if compressed_ply::is_one(&header) {
                Self::CompressedPly
            } else {
                Self::Ply
            });
        }
        if spz::begins(bytes) {
            return Ok(Self::Spz);
        }
        if bytes.starts_with(b"glTF") {
            return Ok(Self::Glb);
        }
        if let Some((found, help)) = foreign(bytes) {
            return Err(FormatError::Foreign { found, help });
        }
        if splat::is_plausible(bytes) {
            return Ok(Self::Splat);
        }
        Err(FormatError::Unknown { found: opening(bytes) })
    }
}

/// Files that people hand in by mistake, by how they begin.
fn foreign(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    let picture = "make a scene of it with `gear run @gear --input painting=FILE`";
    let kinds: [(&[u8], &str, &str); 8] = [
        (
            b"PK\x03\x04",
            "a zip archive (a .sog scene is one)",
            "unpack it, or convert a .sog to .ply with SplatTransform",
        ),
        (b"\x89PNG", "a PNG picture", picture),
        (b"\xff\xd8\xff", "a JPEG picture", picture),
        (b"II*\0", "a TIFF picture", picture),
        (b"MM\0*", "a TIFF picture", picture),
        (b"\x76\x2f\x31\x01", "an OpenEXR picture", picture),
        (b"\x28\xb5\x2f\xfd", "a Zstandard file", "unpack it first"),
        (b"%PDF", "a PDF document", "take the picture out of it"),
    ];
    let (_, found, help) = kinds.into_iter().find(|(magic, ..)| bytes.starts_with(magic))?;
    Some((found, help))
}

/// The first bytes, as people can compare them with something.
fn opening(bytes: &[u8]) -> String {
    let first = &bytes[..bytes.len().min(16)];
    if first.iter().all(|b| b.is_ascii_graphic() || *b == b' ') {
        format!("`{}`", String::from_utf8_lossy(first))
    } else {
        let hex: Vec<String> = first.iter().map(|b| format!("{b:02x}")).collect();
        format!("the bytes {}", hex.join(" "))
    }
}

/// A scene that was read.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// What the file was.
    pub format: Format,
    /// What a user should know: parts of the file that were not taken over.
    pub notes: Vec<String>,
}

/// Reads a file in any of the formats.
pub fn open(path: &Path) -> Result<Loaded, FormatError> {
    let meta = std::fs::metadata(path)?;
    if meta.is_dir() {
        return Err(FormatError::Folder);
    }
    if meta.len() > MOST_BYTES {
        return Err(FormatError::TooLarge {
            found: meta.len(),
            most: MOST_BYTES,
        });
    }
    read(&std::fs::read(path)?)
}

/// Reads a scene in any of the formats.
pub fn read(bytes: &[u8]) -> Result<Loaded, FormatError> {
    let format = Format::detect(bytes)?;
    let mut notes = Vec::new();
    let scene = match format {
        Format::Ply => ply::read(bytes)?,
        Format::CompressedPly => compressed_ply::read(bytes)?,
        Format::Splat => splat::read(bytes)?,
        Format::Spz => {
            let (scene, told) = spz::read(bytes)?;
            notes = told;
            scene
        }
        Format::Glb => return Err(FormatError::WriteOnly { format }),
    };
    let scene = scene.with_least_sh_degree();
    Ok(Loaded { scene, format, notes })
}

/// A scene as a file.
#[derive(Clone, Debug)]
pub struct Written {
    /// The file.
    pub bytes: Vec<u8>,
    /// What of the scene is not in it.
    pub losses: Vec<Loss>,
}

/// Writes a scene.
pub fn write(scene: &Scene, format: Format) -> Result<Written, FormatError> {
    scene.validate()?;
    let smaller = (scene.least_sh_degree() < scene.sh_degree).then(|| scene.clone().with_least_sh_degree());
    let scene = smaller.as_ref().unwrap_or(scene);
    match format {
        Format::Ply => ply::write(scene).map(|bytes| Written {
            bytes,
            losses: Vec::new(),
        }),
        Format::Spz => spz::write(scene),
        Format::Splat => splat::write(scene),
        Format::Glb => gltf::write(scene),
        Format::CompressedPly => Err(FormatError::ReadOnly {
            format,
            help: ".ply, which loses nothing, or .spz, which is smaller",
        }),
    }
}

/// Refuses counts that no scene has.
fn check_count(found: u64, format: Format) -> Result<(), FormatError> {
    if found <= MOST_GAUSSIANS {
        Ok(())
    } else {
        Err(FormatError::TooMany {
            format,
            found,
            most: MOST_GAUSSIANS,
        })
    }
}

#[cfg(test)]
mod tests;
