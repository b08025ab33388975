//! The promises of every node.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Barrier};

use super::subject::{Bits, Subject};
use crate::{Context, NodeError, Progress, Slot, Want};

/// Makes the inputs of a run, one slot a port, the same each time.
type Given<'a> = dyn Fn() -> Vec<Slot> + Sync + 'a;

impl Subject {
    /// All of the assertions below, on inputs that `inputs` makes anew for each run, one slot a port.
    ///
    /// A node that declares that it is not deterministic has promised none of them but that it runs.
    ///
    /// # Panics
    /// If the node breaks a promise, or fails.
    pub fn assert_pure(&self, inputs: &Given<'_>) {
        let first = self.once(inputs, &self.want(|_| true), 1);
        if self.spec.deterministic {
            self.same_bits(inputs, &first);
            self.thread_safe(inputs, &first);
            self.outputs_stand_alone(inputs, &first);
            self.stops_cleanly(inputs, &first);
        }
    }

    /// The same bits and notes on a second run and on 1, 2 and 8 threads.
    ///
    /// # Panics
    /// If they differ.
    pub fn assert_deterministic(&self, inputs: &Given<'_>) {
        self.same_bits(inputs, &self.once(inputs, &self.want(|_| true), 1));
    }

    /// The same bits when the node runs many times at once, as it does in a graph that has several of its kind.
    ///
    /// # Panics
    /// If they differ.
    pub fn assert_thread_safe(&self, inputs: &Given<'_>) {
        self.thread_safe(inputs, &self.once(inputs, &self.want(|_| true), 1));
    }

    fn once(&self, inputs: &Given<'_>, want: &Want, threads: usize) -> Bits {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a thread pool");
        pool.install(|| self.bits_of(inputs, want))
    }

    fn bits_of(&self, inputs: &Given<'_>, want: &Want) -> Bits {
        let ctx = Context::detached();
        let outputs = self.run(inputs(), want, &ctx);
        let outputs = outputs.unwrap_or_else(|error| panic!("{} failed: {error}", self.title));
        self.bits(&outputs, &ctx)
    }

    fn same_bits(&self, inputs: &Given<'_>, first: &Bits) {
        let all = self.want(|_| true);
        for threads in [1, 2, 8] {
            let other = self.once(inputs, &all, threads);
            assert_eq!(*first, other, "{} on {threads} threads gives other bits", self.title);
        }
    }

    fn thread_safe(&self, inputs: &Given<'_>, first: &Bits) {
        const AT_ONCE: usize = 4;
        let all = self.want(|_| true);
        let start = Barrier::new(AT_ONCE);
        std::thread::scope(|scope| {
            let runs: Vec<_> = (0..AT_ONCE)
                .map(|_| {
                    scope.spawn(|| {
                        start.wait();
                        self.bits_of(inputs, &all)
                    })
                })
                .collect();
            for run in runs {
                let other = run.join().unwrap_or_else(|cause| std::panic::resume_unwind(cause));
                assert_eq!(
                    *first, other,
                    "{} gives other bits beside others of its kind",
                    self.title
                );
            }
        });
    }

    fn outputs_stand_alone(&self, inputs: &Given<'_>, first: &Bits) {
        for (port, digest) in &first.outputs {
            let alone = self.once(inputs, &self.want(|name| name == *port), 2).outputs;
            let found = alone
                .iter()
                .find(|(name, _)| name == port)
                .and_then(|(_, digest)| *digest);
            assert_eq!(
                *digest, found,
                "output `{port}` of {} depends on what else is wanted",
                self.title
            );
        }
    }

    /// Interrupted before it starts, and when it first tells of progress: what it gives then is kept like any other
    /// result, so it must be none, or the same.
    fn stops_cleanly(&self, inputs: &Given<'_>, first: &Bits) {
        for at_once in [true, false] {
            let flag = Arc::new(AtomicBool::new(at_once));
            let raise = Arc::clone(&flag);
            let listener = move |_: Progress| raise.store(true, Ordering::Relaxed);
            let ctx = Context::new(flag, Some(Arc::new(listener)), 0);
            match self.run(inputs(), &self.want(|_| true), &ctx) {
                Err(NodeError::Cancelled) => {}
                Err(error) => panic!("{}, interrupted, failed: {error}", self.title),
                Ok(outputs) => assert_eq!(
                    *first,
                    self.bits(&outputs, &ctx),
                    "{}, interrupted, gives another result instead of none",
                    self.title
                ),
            }
        }
    }
}
