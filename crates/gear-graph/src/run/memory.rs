//! Memory of the process and time of a thread, as the operating system counts them.

use std::fs::File;
use std::io::{Read, Seek};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// How old a measurement may be when a job begins or ends: asking the system costs more than a small node does.
const FRESH: Duration = Duration::from_millis(5);
/// The same while a node runs.
const PULSE: Duration = Duration::from_millis(50);

/// Watches the memory of the process for everything that runs.
///
/// Nobody waits in order to look: the coordinator looks when a job begins or ends, and the nodes' own threads when
/// they report progress or ask whether they are interrupted. What all of them miss, the system has not: if its mark of
/// the most that the process ever held rose while a job ran, that was its peak.
pub(super) struct Watch {
    born: Instant,
    /// Reads the system's mark.
    mark: fn() -> Option<u64>,
    /// When the memory was last looked at, in microseconds since `born`.
    looked: AtomicU64,
    state: Mutex<State>,
}

struct State {
    /// Held open: opening costs as much as reading.
    resident: Option<File>,
    bytes: u64,
    /// The system's mark, when it was last read.
    mark: u64,
    running: Vec<Running>,
}

struct Running {
    number: u64,
    began: Instant,
    peak: u64,
    /// The system's mark when it began.
    mark: u64,
}

impl Watch {
    pub fn new() -> Self {
        Self::by(peak_memory)
    }

    fn by(mark: fn() -> Option<u64>) -> Self {
        let mut state = State {
            resident: File::open("/proc/self/statm").ok(),
            bytes: 0,
            mark: mark().unwrap_or(0),
            running: Vec::new(),
        };
        state.look();
        Self {
            born: Instant::now(),
            mark,
            looked: AtomicU64::new(0),
            state: Mutex::new(state),
        }
    }

    /// A job begins.
    pub fn begin(&self, number: u64) {
        self.look(FRESH);
        let mut state = self.state();
        let running = Running {
            number,
            began: Instant::now(),
            peak: state.bytes,
            mark: state.mark,
        };
        state.running.push(running);
    }

    /// A job has ended: the most that the process held meanwhile, in bytes; 0 where the platform does not say.
    pub fn end(&self, number: u64) -> u64 {
        self.look(FRESH);
        let mut state = self.state();
        let Some(place) = state.running.iter().position(|running| running.number == number) else {
            return 0;
        };
        let running = state.running.swap_remove(place);
        if running.began.elapsed() < FRESH {
            return running.peak;
        }
        state.mark = (self.mark)().unwrap_or(0).max(state.mark);
        if state.mark > running.mark {
            state.mark.max(running.peak)
        } else {
            running.peak
        }
    }

    /// A node is alive, on a thread of its own.
    pub fn pulse(&self) {
        self.look(PULSE);
    }

    /// Looks, unless somebody did a moment ago.
    fn look(&self, fresh: Duration) {
        let now = self.born.elapsed().as_micros() as u64;
        let looked = self.looked.load(Ordering::Relaxed);
        if now.saturating_sub(looked) < fresh.as_micros() as u64 {
            return;
        }
        let won = self
            .looked
            .compare_exchange(looked, now, Ordering::Relaxed, Ordering::Relaxed);
        if won.is_ok() {
            self.state().look();
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn look(&mut self) {
        self.bytes = self.resident.as_mut().and_then(resident).unwrap_or(0);
        for running in &mut self.running {
            running.peak = running.peak.max(self.bytes);
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peak_that_nobody_looked_at_is_the_job_s_all_the_same() {
        const MIB: u64 = 1 << 20;
        static MARK: AtomicU64 = AtomicU64::new(1 << 60);
        let watch = Watch::by(|| Some(MARK.load(Ordering::Relaxed)));
        watch.begin(1);
        watch.begin(2);
        std::thread::sleep(2 * FRESH);
        // While both run, the mark rises: it is the peak of both.
        MARK.fetch_add(MIB, Ordering::Relaxed);
        assert_eq!(watch.end(1), (1 << 60) + MIB);
        watch.begin(3);
        std::thread::sleep(2 * FRESH);
        assert_eq!(watch.end(2), (1 << 60) + MIB);
        // It did not rise any more: what was seen counts.
        assert!(watch.end(3) < 1 << 60);
        assert_eq!(watch.end(3), 0, "it has ended");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_memory_of_the_process_is_known() {
        let watch = Watch::new();
        watch.begin(1);
        let peak = watch.end(1);
        assert!(peak > 0 && peak <= peak_memory().unwrap_or(0));
    }
}
