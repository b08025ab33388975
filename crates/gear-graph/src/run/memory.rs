//! Memory of the process and time of a thread, as the operating system counts them.

use std::fs::File;
use std::io::{Read, Seek};
use std::time::{Duration, Instant};

/// How old a measurement may be: asking the system costs more than a small node does.
const FRESH: Duration = Duration::from_millis(5);

/// Measures the memory of the process, not more often than is useful.
pub(super) struct Sampler {
    /// Held open: a run looks twenty times a second.
    source: Option<File>,
    at: Instant,
    bytes: u64,
}

impl Sampler {
    pub fn new() -> Self {
        let mut sampler = Self {
            source: File::open("/proc/self/statm").ok(),
            at: Instant::now(),
            bytes: 0,
        };
        sampler.look();
        sampler
    }

    /// Bytes resident now, or a moment ago; 0 where the platform does not say.
    pub fn resident(&mut self) -> u64 {
        if self.at.elapsed() > FRESH {
            self.look();
        }
        self.bytes
    }

    fn look(&mut self) {
        self.at = Instant::now();
        self.bytes = self.source.as_mut().and_then(resident).unwrap_or(0);
    }
}

/// Bytes resident now; `None` where the platform does not say.
fn resident(statm: &mut File) -> Option<u64> {
    let mut text = [0; 128];
    statm.rewind().ok()?;
    let length = statm.read(&mut text).ok()?;
    // Pages are 4 KiB on every Linux that this is measured on; /proc/self/status would say kB but costs more to read.
    let pages = std::str::from_utf8(&text[..length]).ok()?.split_whitespace().nth(1)?;
    Some(pages.parse::<u64>().ok()? * 4096)
}

/// Seconds that the calling thread was at work; `None` where the platform does not say.
pub(super) fn thread_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = stat.split_whitespace().next()?.parse().ok()?;
    Some(nanoseconds * 1e-9)
}

/// The most that the process ever held, in bytes; `None` where the platform does not say.
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes * 1024)
}
