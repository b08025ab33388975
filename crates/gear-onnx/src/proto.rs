//! The few bits of protobuf that this crate needs itself: to walk over a model's fields, and to write some.
//!
//! ONNX files are protobuf messages (onnx.proto3, IR version 3 and later; field numbers below are its). The library
//! reads the network; here only the declaration that a file may carry is found, and tensors that lie in other files.

/// The key under which a model carries its declaration (`metadata_props` of `ModelProto`).
pub const METADATA_KEY: &str = "gear";

/// The bytes are no protobuf message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("it is no protobuf message, or was cut off")]
pub struct NoMessage;

/// What a field holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wire<'a> {
    /// A whole number.
    Varint(u64),
    /// A message, a text or packed numbers.
    Bytes(&'a [u8]),
    /// A number of four or eight bytes.
    Fixed,
}

/// A field of a message: its number, what it holds, and all of its bytes.
#[derive(Clone, Copy, Debug)]
pub struct Field<'a> {
    /// Its number.
    pub number: u64,
    /// What it holds.
    pub wire: Wire<'a>,
    /// Its bytes, with the tag.
    pub raw: &'a [u8],
}

/// The fields of a message. Ends after the first that cannot be read.
pub fn fields(message: &[u8]) -> impl Iterator<Item = Result<Field<'_>, NoMessage>> {
    let mut rest = message;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let field = take_field(rest);
        rest = match field {
            Some(field) => &rest[field.raw.len()..],
            None => &[],
        };
        Some(field.ok_or(NoMessage))
    })
}

fn take_field(bytes: &[u8]) -> Option<Field<'_>> {
    let mut rest = bytes;
    let tag = take_varint(&mut rest)?;
    let wire = match tag & 7 {
        0 => Wire::Varint(take_varint(&mut rest)?),
        1 => take(&mut rest, 8).map(|_| Wire::Fixed)?,
        2 => {
            let len = usize::try_from(take_varint(&mut rest)?).ok()?;
            Wire::Bytes(take(&mut rest, len)?)
        }
        5 => take(&mut rest, 4).map(|_| Wire::Fixed)?,
        _ => return None,
    };
    Some(Field {
        number: tag >> 3,
        wire,
        raw: &bytes[..bytes.len() - rest.len()],
    })
}

fn take<'a>(rest: &mut &'a [u8], len: usize) -> Option<&'a [u8]> {
    let (taken, left) = rest.split_at_checked(len)?;
    *rest = left;
    Some(taken)
}

fn take_varint(rest: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let byte = take(rest, 1)?[0];
        value |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

/// Appends a field that holds a whole number.
pub fn put_varint(out: &mut Vec<u8>, number: u64, value: u64) {
    raw_varint(out, number << 3);
    raw_varint(out, value);
}

/// Appends a field that holds bytes: a message, a text.
pub fn put_bytes(out: &mut Vec<u8>, number: u64, bytes: &[u8]) {
    raw_varint(out, number << 3 | 2);
    raw_varint(out, bytes.len() as u64);
    out.extend_from_slice(bytes);
}

fn raw_varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// `ModelProto.metadata_props`.
const METADATA: u64 = 14;

/// A model apart from its declaration, and the declaration, if it carries one (the last, if it carries several).
pub fn take_declaration(model: &[u8]) -> Result<(Vec<u8>, Option<String>), NoMessage> {
    let (mut bare, mut found) = (Vec::with_capacity(model.len()), None);
    for field in fields(model) {
        let field = field?;
        match field.wire {
            Wire::Bytes(entry) if field.number == METADATA && text(entry, 1)?.as_deref() == Some(METADATA_KEY) => {
                found = text(entry, 2)?;
            }
            _ => bare.extend_from_slice(field.raw),
        }
    }
    Ok((bare, found))
}

/// A model that carries its declaration: a repeated field may stand anywhere, so it is appended.
pub fn with_declaration(model: &[u8], declaration: &str) -> Vec<u8> {
    let mut entry = Vec::new();
    put_bytes(&mut entry, 1, METADATA_KEY.as_bytes());
    put_bytes(&mut entry, 2, declaration.as_bytes());
    let mut out = model.to_vec();
    put_bytes(&mut out, METADATA, &entry);
    out
}

fn text(message: &[u8], number: u64) -> Result<Option<String>, NoMessage> {
    let mut found = None;
    for field in fields(message) {
        if let Field {
            number: n,
            wire: Wire::Bytes(bytes),
            ..
        } = field?
            && n == number
        {
            found = Some(String::from_utf8_lossy(bytes).into_owned());
        }
    }
    Ok(found)
}

/// Messages of a model, as far as tensors may lie in them.
#[derive(Clone, Copy)]
enum Kind {
    Model,
    Graph,
    Function,
    Node,
    Attribute,
    Tensor,
    SparseTensor,
    TrainingInfo,
}

impl Kind {
    /// What a field of a message of this kind is.
    fn of_field(self, number: u64) -> Option<Self> {
        Some(match (self, number) {
            (Self::Model, 7) | (Self::Attribute, 6 | 11) | (Self::TrainingInfo, 1 | 2) => Self::Graph,
            (Self::Model, 20) => Self::TrainingInfo,
            (Self::Model, 25) => Self::Function,
            (Self::Graph, 1) | (Self::Function, 7) => Self::Node,
            (Self::Node, 5) | (Self::Function, 11) => Self::Attribute,
            (Self::Graph, 5) | (Self::Attribute, 5 | 10) | (Self::SparseTensor, 1 | 2) => Self::Tensor,
            (Self::Graph, 15) | (Self::Attribute, 22 | 23) => Self::SparseTensor,
            _ => return None,
        })
    }
}

/// Whether a tensor of the model lies in another file (`external_data`, `data_location`). Such a model is not one file,
/// and what it reads is not what was hashed.
pub fn reads_other_files(model: &[u8]) -> Result<bool, NoMessage> {
    let mut open = vec![(Kind::Model, model)];
    while let Some((kind, message)) = open.pop() {
        for field in fields(message) {
            let field = field?;
            match (kind, field.number, field.wire) {
                (Kind::Tensor, 13, _) => return Ok(true),
                (Kind::Tensor, 14, Wire::Varint(location)) if location != 0 => return Ok(true),
                (_, number, Wire::Bytes(bytes)) => open.extend(kind.of_field(number).map(|kind| (kind, bytes))),
                _ => {}
            }
        }
    }
    Ok(false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_declaration_is_carried_and_taken_out_without_a_trace() {
        let mut model = Vec::new();
        put_varint(&mut model, 1, 8);
        put_bytes(&mut model, 7, b"");
        let carrying = with_declaration(&with_declaration(&model, "first"), "network: 1");
        let (bare, found) = take_declaration(&carrying).unwrap();
        assert_eq!((bare, found.as_deref()), (model.clone(), Some("network: 1")));
        assert_eq!(take_declaration(&model).unwrap(), (model, None));
    }

    #[test]
    fn a_tensor_in_another_file_is_found_however_deep() {
        let mut tensor = Vec::new();
        put_varint(&mut tensor, 14, 1);
        let wrap = |number, inner: &[u8]| {
            let mut out = Vec::new();
            put_bytes(&mut out, number, inner);
            out
        };
        let in_graph = wrap(7, &wrap(5, &tensor));
        let in_branch = wrap(7, &wrap(1, &wrap(5, &wrap(6, &wrap(5, &tensor)))));
        let in_function = wrap(25, &wrap(7, &wrap(5, &wrap(5, &tensor))));
        for model in [in_graph, in_branch, in_function] {
            assert_eq!(reads_other_files(&model), Ok(true));
        }
        assert_eq!(reads_other_files(&wrap(7, &wrap(5, &wrap(8, b"weight")))), Ok(false));
    }

    #[test]
    fn no_bytes_are_a_panic() {
        for bytes in [
            &b"\xff"[..],
            b"\x0a\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01",
            b"\x0a\x05ab",
            b"\x03",
            b"\x09abc",
        ] {
            assert_eq!(take_declaration(bytes), Err(NoMessage));
            assert_eq!(reads_other_files(bytes), Err(NoMessage));
        }
    }
}
