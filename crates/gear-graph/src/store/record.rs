//! Records of the log, as bytes.
//!
//! `magic (4) · length of the payload (4) · payload · first 8 bytes of the payload's BLAKE3`. Numbers are little
//! endian. A reader that meets bytes that do not verify looks for the next magic.

use crate::Digest;

const MAGIC: [u8; 4] = *b"gAc\x01";
const FRAME: usize = MAGIC.len() + 4 + 8;

/// Where the bytes of a value are.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Content {
    /// In the record.
    Inline(Vec<u8>),
    /// In a file.
    File {
        /// BLAKE3 of the bytes; the file's name.
        checksum: Digest,
        /// Number of bytes.
        bytes: u64,
        /// The file's extension.
        extension: String,
    },
}

/// An action was done.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Done {
    pub key: Digest,
    /// Digest of the value.
    pub value: Digest,
    /// Its encoding, if it was kept.
    pub content: Option<Content>,
    /// What the action was, for people: `ratio: LogRatio.ratio`.
    pub label: String,
    /// Type of the value.
    pub type_name: String,
    /// Its size in memory.
    pub size: u64,
    /// Seconds that it took to compute.
    pub seconds: f64,
    /// Peak memory of the process while it was computed, in bytes.
    pub peak: u64,
    /// When, in seconds since 1970. No part of any key.
    pub made: u64,
    /// Why ports that were not demanded are not needed.
    pub reason: String,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// An action asked for ports.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Need {
    pub key: Digest,
    pub ports: Vec<String>,
    pub reason: String,
}

/// One record.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Record {
    Done(Done),
    Need(Need),
    Blob { key: Digest, content: Content },
}

impl Record {
    pub fn key(&self) -> &Digest {
        match self {
            Self::Done(done) => &done.key,
            Self::Need(need) => &need.key,
            Self::Blob { key, .. } => key,
        }
    }

    /// Appends the framed bytes.
    pub fn write(&self, out: &mut Vec<u8>) {
        out.extend(MAGIC);
        let frame = out.len();
        out.extend([0; 4]);
        let start = out.len();
        let mut w = Writer(out);
        match self {
            Self::Done(done) => {
                w.byte(1).digest(&done.key).digest(&done.value);
                w.content(done.content.as_ref());
                w.text(&done.label).text(&done.type_name).u64(done.size);
                w.u64(done.seconds.to_bits())
                    .u64(done.peak)
                    .u64(done.made)
                    .text(&done.reason);
                w.texts(&done.notes);
            }
            Self::Need(need) => {
                w.byte(2).digest(&need.key).texts(&need.ports).text(&need.reason);
            }
            Self::Blob { key, content } => {
                w.byte(3).digest(key).content(Some(content));
            }
        }
        let check = Digest::of(&out[start..]);
        let len = (out.len() - start) as u32;
        out[frame..start].copy_from_slice(&len.to_le_bytes());
        out.extend(&check.0[..8]);
    }

    /// Reads the payload of a frame that verified.
    pub fn read(payload: &[u8]) -> Option<Self> {
        let mut r = Reader(payload);
        Some(match r.byte()? {
            1 => Self::Done(Done {
                key: r.digest()?,
                value: r.digest()?,
                content: r.content()?,
                label: r.text()?,
                type_name: r.text()?,
                size: r.u64()?,
                seconds: f64::from_bits(r.u64()?),
                peak: r.u64()?,
                made: r.u64()?,
                reason: r.text()?,
                notes: r.texts()?,
            }),
            2 => Self::Need(Need {
                key: r.digest()?,
                ports: r.texts()?,
                reason: r.text()?,
            }),
            3 => Self::Blob {
                key: r.digest()?,
                content: r.content()??,
            },
            _ => return None,
        })
    }
}

/// The payloads of all frames in a log that verify, and the number of bytes that belong to none.
pub(crate) fn frames(log: &[u8]) -> (Vec<std::ops::Range<usize>>, usize) {
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

struct Writer<'a>(&'a mut Vec<u8>);

impl Writer<'_> {
    fn byte(&mut self, byte: u8) -> &mut Self {
        self.0.push(byte);
        self
    }

    fn u32(&mut self, n: u32) -> &mut Self {
        self.0.extend(n.to_le_bytes());
        self
    }

    fn u64(&mut self, n: u64) -> &mut Self {
        self.0.extend(n.to_le_bytes());
        self
    }

    fn digest(&mut self, digest: &Digest) -> &mut Self {
        self.0.extend(digest.0);
        self
    }

    fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.u32(bytes.len() as u32);
        self.0.extend(bytes);
        self
    }

    fn text(&mut self, text: &str) -> &mut Self {
        self.bytes(text.as_bytes())
    }

    fn texts(&mut self, texts: &[String]) -> &mut Self {
        self.u32(texts.len() as u32);
        for text in texts {
            self.text(text);
        }
        self
    }

    fn content(&mut self, content: Option<&Content>) -> &mut Self {
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

struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, len: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(len)?;
        self.0 = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|bytes| bytes[0])
    }

    fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(*self.take(4)?.first_chunk()?))
    }

    fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(*self.take(8)?.first_chunk()?))
    }

    fn digest(&mut self) -> Option<Digest> {
        Some(Digest(*self.take(32)?.first_chunk()?))
    }

    fn bytes(&mut self) -> Option<&'a [u8]> {
        let len = self.u32()? as usize;
        self.take(len)
    }

    fn text(&mut self) -> Option<String> {
        String::from_utf8(self.bytes()?.to_vec()).ok()
    }

    fn texts(&mut self) -> Option<Vec<String>> {
        (0..self.u32()?).map(|_| self.text()).collect()
    }

    /// The outer `None` means that the bytes are no content.
    #[expect(clippy::option_option, reason = "a record may say that nothing was kept")]
    fn content(&mut self) -> Option<Option<Content>> {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn samples() -> Vec<Record> {
        let key = Digest::of(b"key");
        vec![
            Record::Done(Done {
                key,
                value: Digest::of(b"value"),
                content: Some(Content::Inline(vec![1, 2, 3])),
                label: "ratio: LogRatio.ratio".into(),
                type_name: "Field".into(),
                size: 12,
                seconds: 0.25,
                peak: 99,
                made: 7,
                reason: "beta = 0".into(),
                notes: vec!["one".into(), "two".into()],
            }),
            Record::Done(Done::default()),
            Record::Need(Need {
                key,
                ports: vec!["ratio".into()],
                reason: "beta = 0.5".into(),
            }),
            Record::Blob {
                key,
                content: Content::File {
                    checksum: Digest::of(b"bytes"),
                    bytes: 5,
                    extension: "png".into(),
                },
            },
        ]
    }

    fn log(records: &[Record]) -> Vec<u8> {
        let mut log = Vec::new();
        for record in records {
            record.write(&mut log);
        }
        log
    }

    fn read(log: &[u8]) -> Vec<Record> {
        frames(log)
            .0
            .into_iter()
            .filter_map(|range| Record::read(&log[range]))
            .collect()
    }

    #[test]
    fn records_read_back_as_written() {
        assert_eq!(read(&log(&samples())), samples());
    }

    #[test]
    fn a_flipped_bit_costs_one_record_at_most() {
        let (log, whole) = (log(&samples()), samples());
        for byte in 0..log.len() {
            let mut bad = log.clone();
            bad[byte] ^= 0x10;
            let found = read(&bad);
            assert!(found.len() >= whole.len() - 1, "byte {byte}");
            assert!(found.iter().all(|record| whole.contains(record)), "byte {byte}");
        }
    }

    #[test]
    fn a_torn_tail_costs_the_last_record_and_what_follows_is_read() {
        let (log, whole) = (log(&samples()), samples());
        for cut in 0..log.len() {
            let mut torn = log[..cut].to_vec();
            torn.extend(self::log(&whole[2..3]));
            assert_eq!(read(&torn).last(), Some(&whole[2]), "cut at {cut}");
        }
    }
}
