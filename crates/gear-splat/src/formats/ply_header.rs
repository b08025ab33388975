//! PLY as a container: a text header that lists elements and their scalar properties, then one row an item, in ASCII
//! or binary of either byte order (G. Turk, "The PLY Polygon File Format", 1994).

use crate::Camera;

use super::{Format, FormatError};

/// Starts the comment line that holds the canonical camera.
pub(super) const CAMERA: &str = "gear canonical_camera ";
/// A header longer than this is none.
const HEADER_MAX: usize = 1 << 20;

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Encoding {
    Ascii,
    Little,
    Big,
}

/// Scalar types of PLY.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Reads from the start of `bytes`, which holds at least [`Scalar::size`]. f64 holds each of the types exactly.
    fn read(self, bytes: &[u8], big: bool) -> f64 {
        let take = |size: usize| {
            let mut word = [0u8; 8];
            for (i, byte) in bytes[..size].iter().enumerate() {
                word[if big { size - 1 - i } else { i }] = *byte;
            }
            u64::from_le_bytes(word)
        };
        match self {
            Self::I8 => f64::from(bytes[0] as i8),
            Self::U8 => f64::from(bytes[0]),
            Self::I16 => f64::from(take(2) as u16 as i16),
            Self::U16 => f64::from(take(2) as u16),
            Self::I32 => f64::from(take(4) as u32 as i32),
            Self::U32 => f64::from(take(4) as u32),
            Self::F32 => f64::from(f32::from_bits(take(4) as u32)),
            Self::F64 => f64::from_bits(take(8)),
        }
    }
}

/// One element: so many rows of these properties.
#[derive(Debug)]
pub(super) struct Element {
    pub name: String,
    pub count: u64,
    pub properties: Vec<(String, Scalar)>,
    /// A property is a list: rows have no fixed length.
    pub lists: bool,
}

impl Element {
    /// The column of a property.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.properties.iter().position(|p| p.0 == name)
    }

    /// Names of the properties, for messages.
    pub fn listed(&self) -> String {
        let names: Vec<&str> = self.properties.iter().map(|p| p.0.as_str()).take(20).collect();
        if names.is_empty() {
            "none".into()
        } else {
            names.join(" ")
        }
    }

    fn row_bytes(&self) -> usize {
        self.properties.iter().map(|p| p.1.size()).sum()
    }
}

/// What a header says.
#[derive(Debug)]
pub(super) struct Header {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
    pub camera: Option<Camera>,
    /// Where the data start.
    pub body: usize,
}

impl Header {
    /// The element of this name.
    pub fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|e| e.name == name)
    }
}

pub(super) fn error(cause: impl Into<String>) -> FormatError {
    FormatError::Header {
        format: Format::Ply,
        cause: cause.into(),
    }
}

/// Rows of lists have no fixed length, and nothing of a Gaussian is one.
pub(super) fn list_in(element: &str) -> FormatError {
    error(format!(
        "a list property in the element `{element}`; a Gaussian scene has none"
    ))
}

/// Whether these bytes begin a PLY file.
pub(super) fn begins(bytes: &[u8]) -> bool {
    bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r\n")
}

/// Reads the header.
pub(super) fn parse(bytes: &[u8]) -> Result<Header, FormatError> {
    let mut at = 0;
    let mut line = || -> Result<(&str, usize), FormatError> {
        let rest = &bytes[at..bytes.len().min(at.max(HEADER_MAX))];
        let end = rest
            .iter()
            .position(|&b| b == b'\n')
            .ok_or_else(|| error("the header has no `end_header` line"))?;
        at += end + 1;
        let text = std::str::from_utf8(&rest[..end]).map_err(|_| error("the header is not text"))?;
        Ok((text.trim_end_matches('\r'), at))
    };
    if !begins(bytes) {
        return Err(error("it does not start with the line `ply`"));
    }
    line()?;
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut camera = None;
    loop {
        let (text, body) = line()?;
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        match words.as_slice() {
            ["end_header"] => {
                return Ok(Header {
                    encoding: encoding.ok_or_else(|| error("no `format` line"))?,
                    elements,
                    camera,
                    body,
                });
            }
            ["format", name, ..] => encoding = Some(encoding_named(name)?),
            ["comment", ..] => {
                if let Some(found) = camera_of(text)? {
                    camera = Some(found);
                }
            }
            ["element", name, n] => {
                let count = n.parse().map_err(|_| error(format!("{name} count `{n}`")))?;
                if elements.iter().any(|e| e.name == *name) {
                    return Err(error(format!("two `element {name}` lines")));
                }
                elements.push(Element {
                    name: (*name).into(),
                    count,
                    properties: Vec::new(),
                    lists: false,
                });
            }
            ["property", "list", ..] => {
                let element = elements.last_mut().ok_or_else(|| error("a property of no element"))?;
                element.lists = true;
            }
            ["property", kind, name] => {
                let scalar = Scalar::named(kind).ok_or_else(|| error(format!("property type `{kind}`")))?;
                let element = elements.last_mut().ok_or_else(|| error("a property of no element"))?;
                if element.find(name).is_some() {
                    return Err(error(format!("property `{name}` twice")));
                }
                element.properties.push(((*name).into(), scalar));
            }
            ["obj_info", ..] | [] => {}
            _ => return Err(error(format!("header line `{text}`"))),
        }
    }
}

fn encoding_named(name: &str) -> Result<Encoding, FormatError> {
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::Little),
        "binary_big_endian" => Ok(Encoding::Big),
        other => Err(error(format!(
            "format `{other}`; expected `ascii`, `binary_little_endian` or `binary_big_endian`"
        ))),
    }
}

/// The canonical camera, if this comment line holds it.
fn camera_of(line: &str) -> Result<Option<Camera>, FormatError> {
    let comment = line.trim_start().strip_prefix("comment").unwrap_or_default();
    let Some(json) = comment.trim_start().strip_prefix(CAMERA) else {
        return Ok(None);
    };
    let camera: Camera =
        serde_json::from_str(json).map_err(|e| error(format!("the comment with the canonical camera: {e}")))?;
    if camera.is_valid() {
        Ok(Some(camera))
    } else {
        Err(FormatError::Camera)
    }
}

/// The rows of the elements, in the order of the header.
pub(super) struct Body<'a> {
    format: Format,
    data: Data<'a>,
}

enum Data<'a> {
    Ascii(std::str::SplitAsciiWhitespace<'a>, usize),
    Binary { rest: &'a [u8], big: bool },
}

impl<'a> Body<'a> {
    /// The data after the header of `bytes`.
    pub fn new(bytes: &'a [u8], header: &Header, format: Format) -> Result<Self, FormatError> {
        let rest = &bytes[header.body..];
        let data = match header.encoding {
            Encoding::Ascii => {
                let text = std::str::from_utf8(rest).map_err(|_| FormatError::Data {
                    format,
                    cause: "the ASCII data are not text".into(),
                })?;
                Data::Ascii(text.split_ascii_whitespace(), rest.len())
            }
            encoding => Data::Binary {
                rest,
                big: encoding == Encoding::Big,
            },
        };
        Ok(Self { format, data })
    }

    /// How many rows of `element` the file holds, checked against what the header promises before anybody takes memory
    /// for them.
    pub fn count(&self, element: &Element, unit: &'static str) -> Result<usize, FormatError> {
        let width = element.properties.len();
        let held = match &self.data {
            // A number takes a character and a space; the last one needs no space.
            Data::Ascii(_, bytes) => bytes.saturating_add(1) / (2 * width).max(1),
            Data::Binary { rest, .. } => rest.len() / element.row_bytes().max(1),
        };
        usize::try_from(element.count)
            .ok()
            .filter(|&count| count <= held)
            .ok_or(FormatError::Truncated {
                format: self.format,
                promised: element.count,
                unit,
                room: held as u64,
            })
    }

    /// Hands every row of `element` to `take`.
    pub fn rows(
        &mut self,
        element: &Element,
        unit: &'static str,
        mut take: impl FnMut(&[f64]),
    ) -> Result<(), FormatError> {
        if element.lists && element.count > 0 {
            return Err(list_in(&element.name));
        }
        let count = self.count(element, unit)?;
        let mut row = vec![0.0; element.properties.len()];
        let format = self.format;
        match &mut self.data {
            Data::Ascii(numbers, _) => {
                for item in 0..count {
                    for (value, (name, _)) in row.iter_mut().zip(&element.properties) {
                        let data = |cause| FormatError::Data { format, cause };
                        let word = numbers
                            .next()
                            .ok_or_else(|| data(format!("the data end in {} {item}, before {name}", element.name)))?;
                        *value = word.parse().map_err(|_| {
                            data(format!(
                                "{} {item}: expected a number for {name}, found `{word}`",
                                element.name
                            ))
                        })?;
                    }
                    take(&row);
                }
            }
            Data::Binary { rest, big } => {
                let (mine, after) = rest.split_at(count * element.row_bytes());
                *rest = after;
                for item in mine.chunks_exact(element.row_bytes().max(1)) {
                    let mut at = 0;
                    for (value, (_, scalar)) in row.iter_mut().zip(&element.properties) {
                        *value = scalar.read(&item[at..], *big);
                        at += scalar.size();
                    }
                    take(&row);
                }
            }
        }
        Ok(())
    }
}
