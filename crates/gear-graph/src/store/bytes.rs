//! Frames and what stands in them, as bytes.
//!
//! A log is a sequence of frames: `magic (4) · length of the payload (4) · payload · first 8 bytes of the payload's
//! BLAKE3`. Numbers are little endian. A reader that meets bytes that do not verify looks for the next magic.

use super::record::Content;
use crate::Digest;

const MAGIC: [u8; 4] = *b"gAc\x01";
/// Bytes of a frame beside its payload.
pub(super) const FRAME: usize = MAGIC.len() + 4 + 8;

/// Appends a frame around what `payload` writes.
pub(super) fn write_frame(out: &mut Vec<u8>, payload: impl FnOnce(&mut Writer<'_>)) {
    out.extend(MAGIC);
    let frame = out.len();
    out.extend([0; 4]);
    let start = out.len();
    payload(&mut Writer(out));
    let check = Digest::of(&out[start..]);
    let len = (out.len() - start) as u32;
    out[frame..start].copy_from_slice(&len.to_le_bytes());
    out.extend(&check.0[..8]);
}

/// The payloads of all frames in a log that verify, and the number of bytes that belong to none.
pub(super) fn frames(log: &[u8]) -> (Vec<std::ops::Range<usize>>, usize) {
    let (mut found, mut damaged, mut at) = (Vec::new(), 0, 0);
    while at < log.len() {
        match frame(&log[at..]) {
            Some(len) => {
                found.push(at + 8..at + 8 + len);
                at += FRAME + len;
            }
            None => {
                let next = log[at + 1..]
                    .windows(MAGIC.len())
                    .position(|window| window == MAGIC)
                    .map_or(log.len(), |offset| at + 1 + offset);
                damaged += next - at;
                at = next;
            }
        }
    }
    (found, damaged)
}

/// The length of the payload, if the log begins with a frame that verifies.
fn frame(log: &[u8]) -> Option<usize> {
    let rest = log.strip_prefix(&MAGIC)?;
    let len = u32::from_le_bytes(*rest.first_chunk()?) as usize;
    let payload = rest.get(4..4usize.checked_add(len)?)?;
    let check = rest.get(4 + len..12 + len)?;
    (Digest::of(payload).0[..8] == *check).then_some(len)
}

pub(super) struct Writer<'a>(&'a mut Vec<u8>);

impl Writer<'_> {
    pub fn byte(&mut self, byte: u8) -> &mut Self {
        self.0.push(byte);
        self
    }

    pub fn u32(&mut self, n: u32) -> &mut Self {
        self.0.extend(n.to_le_bytes());
        self
    }

    pub fn u64(&mut self, n: u64) -> &mut Self {
        self.0.extend(n.to_le_bytes());
        self
    }

    pub fn digest(&mut self, digest: &Digest) -> &mut Self {
        self.0.extend(digest.0);
        self
    }

    pub fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.u32(bytes.len() as u32);
        self.0.extend(bytes);
        self
    }

    pub fn text(&mut self, text: &str) -> &mut Self {
        self.bytes(text.as_bytes())
    }

    pub fn texts(&mut self, texts: &[String]) -> &mut Self {
        self.u32(texts.len() as u32);
        for text in texts {
            self.text(text);
        }
        self
    }

    pub fn content(&mut self, content: Option<&Content>) -> &mut Self {
        match content {
            None => self.byte(0),
            Some(Content::Inline(bytes)) => self.byte(1).bytes(bytes),
            Some(Content::File {
                checksum,
                bytes,
                extension,
            }) => self.byte(2).digest(checksum).u64(*bytes).text(extension),
        }
    }
}

pub(super) struct Reader<'a>(pub &'a [u8]);

impl<'a> Reader<'a> {
    pub fn take(&mut self, len: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(len)?;
        self.0 = rest;
        Some(taken)
    }

    pub fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|bytes| bytes[0])
    }

    pub fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(*self.take(4)?.first_chunk()?))
    }

    pub fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(*self.take(8)?.first_chunk()?))
    }

    pub fn digest(&mut self) -> Option<Digest> {
        Some(Digest(*self.take(32)?.first_chunk()?))
    }

    pub fn bytes(&mut self) -> Option<&'a [u8]> {
        let len = self.u32()? as usize;
        self.take(len)
    }

    pub fn text(&mut self) -> Option<String> {
        String::from_utf8(self.bytes()?.to_vec()).ok()
    }

    pub fn texts(&mut self) -> Option<Vec<String>> {
        (0..self.u32()?).map(|_| self.text()).collect()
    }

    /// The outer `None` means that the bytes are no content.
    #[expect(clippy::option_option, reason = "a record may say that nothing was kept")]
    pub fn content(&mut self) -> Option<Option<Content>> {
        Some(match self.byte()? {
            0 => None,
            1 => Some(Content::Inline(self.bytes()?.to_vec())),
            2 => Some(Content::File {
                checksum: self.digest()?,
                bytes: self.u64()?,
                extension: self.text()?,
            }),
            _ => return None,
        })
    }
}
