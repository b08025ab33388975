//! Progress bars: one for the run, one for every node at work with its own progress and remark. Nothing at all when
//! standard error is no terminal.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use gear_graph::Event;
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};

/// The bars of a run.
pub struct Progress {
    bars: MultiProgress,
    whole: ProgressBar,
    nodes: Mutex<BTreeMap<String, ProgressBar>>,
}

impl Progress {
    /// Bars on standard error, or none.
    pub fn new(interactive: bool) -> Self {
        let target = if interactive {
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
        }
    }

    /// Shows what happens.
    pub fn event(&self, event: &Event<'_>) {
        match event {
            Event::Started { sites } => self.whole.set_length(*sites as u64),
            Event::Running { node, type_name, .. } => {
                let bar = self.bars.add(ProgressBar::new(1000));
                bar.set_style(style("{bar:24.cyan/dim} {prefix}  {wide_msg}"));
                bar.set_prefix(format!("{node} ({type_name})"));
                bar.enable_steady_tick(Duration::from_millis(200));
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

fn style(template: &str) -> ProgressStyle {
    // The templates are the two above; a mistake in them would be seen at once, and then the plain bar serves.
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
