//! What people and programs read: results on standard output, everything else on standard error.

use std::io::{ErrorKind, IsTerminal, Write, stderr, stdout};
use std::sync::{Mutex, PoisonError};

use crate::error::CliError;

/// The two streams.
pub struct Console {
    colour: bool,
    lost: Mutex<Option<std::io::Error>>,
}

impl Console {
    /// The streams of the process. Colours only on a terminal, and not where `NO_COLOR` is set.
    pub fn new() -> Self {
        let wanted = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
        Self {
            colour: wanted && stderr().is_terminal(),
            lost: Mutex::default(),
        }
    }

    /// Whether people look at standard error.
    pub fn interactive(&self) -> bool {
        stderr().is_terminal()
    }

    /// Whether standard error takes colours.
    pub fn colour(&self) -> bool {
        self.colour
    }

    /// A result. What cannot be written is told at the end, by [`Console::complete`].
    pub fn result(&self, text: &str) {
        let mut out = stdout().lock();
        self.keep(writeln!(out, "{text}").and_then(|()| out.flush()));
    }

    /// Remembers the first failure to write to standard output. A reader that has gone (`gear nodes | head -1`) is
    /// none: it has all it wanted.
    pub fn keep(&self, written: std::io::Result<()>) {
        if let Err(error) = written
            && error.kind() != ErrorKind::BrokenPipe
        {
            self.lost
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .get_or_insert(error);
        }
    }

    /// Whether every result reached standard output.
    pub fn complete(&self) -> Result<(), CliError> {
        match self.lost.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(cause) => Err(CliError::StandardOutput { cause }),
            None => Ok(()),
        }
    }

    /// A remark.
    pub fn remark(&self, text: &str) {
        // When standard error is gone, nobody is there to be told.
        let _ = writeln!(stderr().lock(), "{text}");
    }

    /// Something worth knowing.
    pub fn note(&self, text: &str) {
        self.remark(&format!("note: {text}"));
    }

    /// Something odd.
    pub fn warning(&self, text: &str) {
        self.remark(&format!("{}: {text}", self.painted("warning", 33)));
    }

    /// What went wrong.
    pub fn error(&self, error: &CliError) {
        match error {
            // Rendered like a compiler's messages, with their own heads.
            CliError::Graph(mistakes) => self.remark(mistakes.render(self.colour).trim_end()),
            other => self.failure(&other.to_string()),
        }
    }

    /// What went wrong, in words.
    pub fn failure(&self, text: &str) {
        for line in text.lines().filter(|line| !line.starts_with(' ')).take(1) {
            self.remark(&format!("{}: {line}", self.painted("error", 31)));
        }
        for line in text.lines().skip(1) {
            self.remark(line);
        }
    }

    fn painted(&self, word: &str, code: u8) -> String {
        if self.colour {
            format!("\x1b[1;{code}m{word}\x1b[0m")
        } else {
            word.to_owned()
        }
    }
}
