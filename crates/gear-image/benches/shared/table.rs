//! A table that `gear curve` draws, as it is written by programs that measure kernels: a part of several of them.
#![allow(dead_code, reason = "each uses some of it")]

use std::time::Instant;

/// The columns, as `gear_study::curve::table` reads them.
const HEAD: &str = "label,family,seconds,operations,error,default";

/// The table of one curve.
pub struct Table {
    remarks: String,
    points: String,
}

impl Table {
    /// `norm` says what the error is, `machine` where seconds were measured.
    pub fn new(title: &str, norm: &str, machine: &str) -> Self {
        Self {
            remarks: format!("# title: {title}\n# norm: {norm}\n# machine: {machine}\n"),
            points: String::new(),
        }
    }

    /// Operations are the cost, and these are they.
    pub fn counting(mut self, operations: &str) -> Self {
        self.remarks.push_str(&format!("# operations: {operations}\n"));
        self
    }

    /// A decision record says why the default is off the front.
    pub fn decided(mut self, record: &str) -> Self {
        self.remarks.push_str(&format!("# decision: {record}\n"));
        self
    }

    /// Adds a point.
    pub fn add(&mut self, label: &str, family: &str, seconds: f64, operations: Option<u64>, error: f64, default: bool) {
        let operations = operations.map(|o| o.to_string()).unwrap_or_default();
        let default = if default { "yes" } else { "" };
        let number = |x: f64| if x == 0.0 { "0".to_owned() } else { format!("{x:.3e}") };
        let (seconds, error) = (number(seconds), number(error));
        let line = format!("{label},{family},{seconds},{operations},{error},{default}\n");
        self.points.push_str(&line);
    }

    /// Prints the table, and writes `NAME.csv` into the folder that the program was given.
    pub fn write(self, name: &str) -> std::io::Result<()> {
        let text = format!("{}{HEAD}\n{}", self.remarks, self.points);
        println!("{text}");
        let given = std::env::args().skip(1).find(|a| !a.starts_with('-'));
        let folder = std::path::PathBuf::from(given.unwrap_or_else(|| ".".to_owned()));
        std::fs::create_dir_all(&folder)?;
        std::fs::write(folder.join(format!("{name}.csv")), text)
    }
}

/// The machine, and whose seconds are told.
pub fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let clock = match processor_seconds() {
        Some(_) => "processor seconds of all threads",
        None => "seconds on the clock",
    };
    format!("{cores} threads, {}, {clock}", std::env::consts::ARCH)
}

/// Seconds of a call, and its result: the median of three times `calls` calls, after a first one. Seconds are those of the
/// processor, of all threads together, where the system tells them (Linux): on a busy machine the clock says more about the
/// others. Its counters tick every few milliseconds, so that short work needs many calls.
pub fn timed<T>(calls: usize, mut work: impl FnMut() -> T) -> (f64, T) {
    let mut result = work();
    let mut seconds: Vec<f64> = (0..3)
        .map(|_| {
            let (spent, ()) = once(|| {
                for _ in 0..calls {
                    result = work();
                }
            });
            spent / calls as f64
        })
        .collect();
    seconds.sort_by(f64::total_cmp);
    (seconds[1], result)
}

/// Seconds of one call, and its result.
pub fn once<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let (begun, before) = (Instant::now(), processor_seconds());
    let result = work();
    let spent = match (before, processor_seconds()) {
        (Some(before), Some(after)) => after - before,
        _ => begun.elapsed().as_secs_f64(),
    };
    (spent, result)
}

/// Seconds that all threads of this process have run so far.
fn processor_seconds() -> Option<f64> {
    let mut nanoseconds = 0u64;
    for task in std::fs::read_dir("/proc/self/task").ok()? {
        let text = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        nanoseconds += text.split_whitespace().next()?.parse::<u64>().ok()?;
    }
    Some(nanoseconds as f64 * 1e-9)
}
