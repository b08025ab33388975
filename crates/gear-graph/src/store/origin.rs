//! Where results came from: the run that computed a value, and the parts of its key.
//!
//! Nothing here decides anything. `gear why` reads it, runs only write it, into a log of its own, so that the log that
//! every run reads stays small. What is lost of it costs an explanation, never a result.

use super::bytes::{Reader, Writer, write_frame};
use crate::{Digest, Hasher};

/// Digests at one port are kept one by one up to so many; beyond, as one digest of all.
const FEW: usize = 16;

/// The first byte of an origin, another than of any record of actions: the two logs cannot be taken for each other.
const KIND: u8 = 4;

/// A value was computed.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Origin {
    /// The key of the action.
    pub key: Digest,
    /// Identifies the run.
    pub run: u64,
    /// When, in seconds since 1970.
    pub made: u64,
    /// Seconds that it took.
    pub seconds: f64,
    /// The graph, as it was named.
    pub graph: String,
    /// The node's id or the input's name.
    pub site: String,
    /// The output; the input's name for an input.
    pub output: String,
    /// What the key was made of.
    pub parts: Parts,
}

/// What the key of an action is made of.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Parts {
    /// Whether it is a file being loaded.
    pub input: bool,
    /// The node's type; the value's type for an input.
    pub type_name: String,
    pub version: u32,
    pub numerics: Vec<(String, u32)>,
    pub realm: String,
    /// Whether elisions were off and this counts for the node.
    pub no_elision: bool,
    /// Parameters, as JSON.
    pub params: String,
    /// The ports that were demanded, with the digests of their values; for an input its file.
    pub ports: Vec<PortPart>,
}

/// What was at a port.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct PortPart {
    pub port: String,
    /// Where the first value came from: `node.port`, an input's name, or a file.
    pub source: String,
    /// How many values.
    pub count: u32,
    /// Their digests, or one digest of all if they are many.
    pub digests: Vec<Digest>,
}

impl PortPart {
    pub fn new(port: &str, source: String, digests: Vec<Digest>) -> Self {
        Self {
            port: port.to_string(),
            source,
            count: digests.len() as u32,
            digests: if digests.len() <= FEW {
                digests
            } else {
                let mut all = Hasher::new("many");
                for digest in &digests {
                    all.digest(digest);
                }
                vec![all.finish()]
            },
        }
    }
}

impl Origin {
    /// Appends the framed bytes.
    pub fn write(&self, out: &mut Vec<u8>) {
        write_frame(out, |w| {
            w.byte(KIND).digest(&self.key).u64(self.run).u64(self.made);
            w.u64(self.seconds.to_bits());
            w.text(&self.graph).text(&self.site).text(&self.output);
            self.parts.write(w);
        });
    }

    /// Reads the payload of a frame that verified.
    pub fn read(payload: &[u8]) -> Option<Self> {
        let mut r = Reader(payload);
        if r.byte()? != KIND {
            return None;
        }
        Some(Self {
            key: r.digest()?,
            run: r.u64()?,
            made: r.u64()?,
            seconds: f64::from_bits(r.u64()?),
            graph: r.text()?,
            site: r.text()?,
            output: r.text()?,
            parts: Parts::read(&mut r)?,
        })
    }
}

impl Parts {
    fn write(&self, w: &mut Writer<'_>) {
        w.byte(u8::from(self.input) | u8::from(self.no_elision) << 1);
        w.text(&self.type_name).u32(self.version);
        w.u32(self.numerics.len() as u32);
        for (name, version) in &self.numerics {
            w.text(name).u32(*version);
        }
        w.text(&self.realm).text(&self.params);
        w.u32(self.ports.len() as u32);
        for port in &self.ports {
            w.text(&port.port).text(&port.source).u32(port.count);
            w.u32(port.digests.len() as u32);
            for digest in &port.digests {
                w.digest(digest);
            }
        }
    }

    fn read(r: &mut Reader<'_>) -> Option<Self> {
        let flags = r.byte()?;
        Some(Self {
            input: flags & 1 != 0,
            no_elision: flags & 2 != 0,
            type_name: r.text()?,
            version: r.u32()?,
            numerics: (0..r.u32()?)
                .map(|_| Some((r.text()?, r.u32()?)))
                .collect::<Option<_>>()?,
            realm: r.text()?,
            params: r.text()?,
            ports: (0..r.u32()?)
                .map(|_| {
                    Some(PortPart {
                        port: r.text()?,
                        source: r.text()?,
                        count: r.u32()?,
                        digests: (0..r.u32()?).map(|_| r.digest()).collect::<Option<_>>()?,
                    })
                })
                .collect::<Option<_>>()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::bytes::frames;
    use super::*;

    #[test]
    fn an_origin_reads_back_as_written() {
        let origin = Origin {
            key: Digest::of(b"key"),
            run: 7,
            made: 1_700_000_000,
            seconds: 0.5,
            graph: "@gear".into(),
            site: "ratio".into(),
            output: "smooth".into(),
            parts: Parts {
                input: false,
                type_name: "LogRatio".into(),
                version: 3,
                numerics: vec![("gear-image".into(), 2)],
                realm: "cpu".into(),
                no_elision: true,
                params: r#"{"radius":0.03}"#.into(),
                ports: vec![PortPart::new("image", "translate.image".into(), vec![Digest::of(b"a")])],
            },
        };
        let mut log = Vec::new();
        origin.write(&mut log);
        Origin::default().write(&mut log);
        let (found, damaged) = frames(&log);
        let read: Vec<_> = found
            .into_iter()
            .filter_map(|frame| Origin::read(&log[frame]))
            .collect();
        assert_eq!((read, damaged), (vec![origin, Origin::default()], 0));
    }

    #[test]
    fn many_values_at_a_port_take_the_room_of_one_and_still_tell_a_change() {
        let part = |last: &[u8]| {
            let mut digests: Vec<_> = (0..1000u32).map(|i| Digest::of(&i.to_le_bytes())).collect();
            digests.push(Digest::of(last));
            PortPart::new("of", "a.b".into(), digests)
        };
        assert_eq!((part(b"x").digests.len(), part(b"x").count), (1, 1001));
        assert_eq!(part(b"x"), part(b"x"));
        assert_ne!(part(b"x"), part(b"y"));
    }
}
