//! Records of the log of actions.

use super::bytes::{Reader, write_frame};
use crate::Digest;

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
        write_frame(out, |w| match self {
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
        });
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

#[cfg(test)]
mod tests {
    use super::super::bytes::frames;
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
