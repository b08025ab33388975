//! Progress. On a terminal, bars: one for the run, one for every node at work with its own progress and remark. In a
//! file or a pipe, one line a node that is done.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use gear_graph::Event;
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::console::Console;

/// What is shown while a run goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Show {
    /// Bars, on a terminal.
    Bars,
    /// A line a node, in a log.
    Lines,
    /// Nothing.
    Nothing,
}

/// The progress of a run.
pub struct Progress {
    bars: MultiProgress,
    whole: ProgressBar,
    nodes: Mutex<BTreeMap<String, ProgressBar>>,
    /// Whether bars move by themselves.
    ticks: bool,
    lines: Option<Mutex<BTreeSet<String>>>,
}

impl Progress {
    /// Shows it on standard error.
    pub fn new(show: Show) -> Self {
        let target = if show == Show::Bars {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        };
        let bars = MultiProgress::with_draw_target(target);
        let whole = bars.add(ProgressBar::new(0));
        whole.set_style(style("{bar:24.green/dim} {pos}/{len} nodes  {elapsed}"));
        Self {
            bars,
            whole,
            nodes: Mutex::default(),
            // Every bar that ticks has a thread, and where none can be started it would panic.
            ticks: show == Show::Bars && std::thread::Builder::new().spawn(|| ()).is_ok(),
            lines: (show == Show::Lines).then(Mutex::default),
        }
    }

    /// Shows what happens.
    pub fn event(&self, event: &Event<'_>) {
        if let Some(told) = &self.lines {
            let mut told = told.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(line) = line(event, &mut told) {
                Console::new().remark(&line);
            }
        }
        match event {
            Event::Started { sites } => self.whole.set_length(*sites as u64),
            Event::Running { node, type_name, .. } => {
                let bar = self.bars.add(ProgressBar::new(1000));
                bar.set_style(style("{bar:24.cyan/dim} {prefix}  {wide_msg}"));
                bar.set_prefix(format!("{node} ({type_name})"));
                if self.ticks {
                    bar.enable_steady_tick(Duration::from_millis(200));
                }
                self.nodes().insert((*node).to_owned(), bar);
            }
            Event::Progress { node, progress } => {
                if let Some(bar) = self.nodes().get(*node) {
                    bar.set_position((progress.fraction * 1000.0) as u64);
                    if !progress.message.is_empty() {
                        bar.set_message(progress.message.clone());
                    }
                }
            }
            Event::Ran { node, .. } => {
                self.close(node);
                self.whole.inc(1);
            }
            Event::Failed { failure } => self.close(&failure.node),
            _ => {}
        }
    }

    /// Writes between the bars.
    pub fn between(&self, write: impl FnOnce()) {
        self.bars.suspend(write);
    }

    /// Takes the bars away.
    pub fn finish(&self) {
        for bar in self.nodes().values() {
            bar.finish_and_clear();
        }
        self.whole.finish_and_clear();
    }

    fn close(&self, node: &str) {
        if let Some(bar) = self.nodes().remove(node) {
            bar.finish_and_clear();
            self.bars.remove(&bar);
        }
    }

    fn nodes(&self) -> std::sync::MutexGuard<'_, BTreeMap<String, ProgressBar>> {
        self.nodes.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The line that tells of a node that is done; one of what is stored, however many outputs that are.
fn line(event: &Event<'_>, told: &mut BTreeSet<String>) -> Option<String> {
    let (node, what) = match event {
        Event::Ran { node, seconds } => {
            // An output that was asked for later is computed by itself.
            let again = if told.insert((*node).to_owned()) {
                ""
            } else {
                " for another output"
            };
            (*node, format!("{seconds:.2} s{again}"))
        }
        Event::Hit { node, .. } if told.insert((*node).to_owned()) => (*node, "stored".to_owned()),
        Event::Failed { failure } => (failure.node.as_str(), "failed".to_owned()),
        Event::Skipped { node, because_of } => (*node, format!("skipped, because `{because_of}` failed")),
        _ => return None,
    };
    Some(format!("{node}: {what}"))
}

fn style(template: &str) -> ProgressStyle {
    // The templates are the two above; a mistake in them would be seen at once, and then the plain bar serves.
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_has_one_line_however_many_outputs_it_has() {
        let mut told = BTreeSet::new();
        let digest = gear_graph::Digest::of(b"value");
        let hit = |output| Event::Hit {
            node: "edges",
            output,
            digest: &digest,
        };
        assert_eq!(line(&hit("a"), &mut told).as_deref(), Some("edges: stored"));
        assert_eq!(line(&hit("b"), &mut told), None);
        let ran = Event::Ran {
            node: "ratio",
            seconds: 0.125,
        };
        assert_eq!(line(&ran, &mut told).as_deref(), Some("ratio: 0.12 s"));
        assert_eq!(
            line(&ran, &mut told).as_deref(),
            Some("ratio: 0.12 s for another output")
        );
    }
}
