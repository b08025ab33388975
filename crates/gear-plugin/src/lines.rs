//! Messages: one JSON value on a line, of bounded length.
//!
//! Everything that comes from a worker passes through here, so this is where its length is bounded and where characters
//! that would steer a terminal are taken out of what people will read.

use std::io::{BufRead, Read};

use serde::Deserialize;
use serde_json::Value;

/// A longer line is no message. The largest one is the handshake of a plugin with many nodes.
pub(crate) const LONGEST: usize = 4 << 20;

/// Of a text for people this many characters are kept.
const MOST_CHARACTERS: usize = 2000;

/// A message from a worker.
#[derive(Debug, Deserialize)]
pub(crate) struct Message {
    pub jsonrpc: String,
    #[serde(default)]
    pub id: Option<u64>,
    #[serde(default)]
    pub method: Option<String>,
    #[serde(default)]
    pub params: Value,
    #[serde(default, deserialize_with = "present")]
    pub result: Option<Value>,
    #[serde(default)]
    pub error: Option<RemoteError>,
}

/// The `error` of a response.
#[derive(Debug, Deserialize)]
pub(crate) struct RemoteError {
    pub code: i64,
    #[serde(default)]
    pub message: String,
}

/// `result: null` is a result.
fn present<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Option<Value>, D::Error> {
    Value::deserialize(deserializer).map(Some)
}

/// What came on a worker's standard output.
#[derive(Debug)]
pub(crate) enum Incoming {
    Message(Box<Message>),
    /// What is no message; why, with its beginning.
    Garbage(String),
    /// The end.
    Closed,
}

/// Reads the next message. Blank lines are passed over.
pub(crate) fn next(reader: &mut impl BufRead) -> Incoming {
    loop {
        let mut line = Vec::new();
        let end = reader.by_ref().take(LONGEST as u64 + 1).read_until(b'\n', &mut line);
        match end {
            Err(_) | Ok(0) => return Incoming::Closed,
            Ok(length) if length > LONGEST => {
                return Incoming::Garbage(format!(
                    "expected a message of at most {LONGEST} bytes, found a longer line"
                ));
            }
            Ok(_) if line.iter().all(u8::is_ascii_whitespace) => {}
            Ok(_) => return parse(&line),
        }
    }
}

fn parse(line: &[u8]) -> Incoming {
    match serde_json::from_slice::<Message>(line) {
        Ok(message) if message.jsonrpc == "2.0" => Incoming::Message(Box::new(message)),
        Ok(message) => Incoming::Garbage(format!("expected `\"jsonrpc\": \"2.0\"`, found {:?}", message.jsonrpc)),
        Err(error) => {
            let found: String = String::from_utf8_lossy(line).chars().take(100).collect();
            Incoming::Garbage(format!(
                "expected a JSON-RPC message on a line ({error}), found `{}`",
                for_people(&found)
            ))
        }
    }
}

/// The text without characters that would steer a terminal, and not too long.
pub(crate) fn for_people(text: &str) -> String {
    let mut out: String = text
        .trim_end()
        .chars()
        .map(|c| match c {
            '\n' | '\t' => c,
            c if c.is_control() => '\u{fffd}',
            // Marks that turn the direction of writing hide what a line says.
            '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => '\u{fffd}',
            c => c,
        })
        .take(MOST_CHARACTERS + 1)
        .collect();
    if out.chars().count() > MOST_CHARACTERS {
        out = out.chars().take(MOST_CHARACTERS).collect();
        out.push('…');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Incoming {
        next(&mut std::io::BufReader::new(bytes))
    }

    #[test]
    fn a_message_is_a_line() {
        let Incoming::Message(message) = read(b"\n  \n{\"jsonrpc\": \"2.0\", \"id\": 3, \"result\": null}\n") else {
            panic!("a message")
        };
        assert_eq!((message.id, message.result), (Some(3), Some(Value::Null)));
        assert!(matches!(read(b""), Incoming::Closed));
    }

    #[test]
    fn what_is_no_message_is_told_with_its_beginning() {
        let told = |bytes: &[u8]| match read(bytes) {
            Incoming::Garbage(told) => told,
            other => panic!("{other:?}"),
        };
        assert!(told(b"Loading weights...\n").contains("`Loading weights...`"));
        assert!(told(b"{\"jsonrpc\": \"1.0\"}\n").contains("1.0"));
        assert!(told(b"\xff\xfe\x1b[2J\n").contains('\u{fffd}'));
        assert!(told(&vec![b'x'; LONGEST + 10]).contains("longer line"));
        assert!(
            told(format!("{{\"jsonrpc\": \"2.0\", \"params\": {}", "[".repeat(100_000)).as_bytes())
                .contains("recursion"),
            "deep nesting is an error, no overflow"
        );
    }

    #[test]
    fn people_s_terminals_are_not_steered() {
        assert_eq!(for_people("a\x1b[31mb\u{202e}c\r\n"), "a\u{fffd}[31mb\u{fffd}c");
        assert_eq!(for_people(&"x".repeat(5000)).chars().count(), MOST_CHARACTERS + 1);
    }
}
