//! The scheduler: carries jobs to threads and results back to the [`Machine`].
//!
//! # How it works
//!
//! One coordinator (the calling thread) owns all state; threads of one pool do the work, and there is no lock between
//! them. The coordinator lets the machine decide all that can be decided, starts jobs while threads are free, and
//! waits for one to come back:
//!
//! ```text
//! loop: settle the agenda → start jobs while fewer than N are out → wait for one → tell the machine
//! ```
//!
//! Jobs that somebody waits for go first (decisions, values from the store), then nodes, those with the longest way
//! to the end first, then writing to the store; but when much waits to be written, writing goes first, so that what
//! waits cannot fill the memory. Encoding and writing thus overlap with other nodes' work.
//!
//! The pool has N threads, and nodes use the same pool inside (rayon), so N is the number of threads in all. At most N
//! jobs are out at a time; a thread that waits within a node may take up another job meanwhile, so at most N jobs
//! are ever on one stack.
//!
//! # What must stay true
//!
//! * The coordinator never blocks but on the channel, and never for longer than a tick: it then looks at the
//!   interruption flag and at the memory.
//! * Every job sends exactly one answer, also when it panics (`jobs` catches panics of nodes, loaders, encoders).
//! * When no job is out and the machine has none to give, everything is settled: each requested slot is done, failed,
//!   or waits for one that failed.
//! * An interruption starts nothing new but writing what is computed already, and gives up waiting after a grace.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use super::inputs::Given;
use super::jobs::{Back, Job};
use super::machine::{Happened, Machine};
use super::observe::Event;
use super::outcome::{self, Outcome};
use super::{Run, keys, memory};
use crate::{Context, Progress};

const TICK: Duration = Duration::from_millis(20);
/// How long an interrupted run waits for its nodes to notice.
const GRACE: Duration = Duration::from_millis(700);
/// Bytes of values that may wait to be written before writing goes first.
const KEEP_FIRST: usize = 256 << 20;
/// Bytes of records that are gathered before they are appended to the log, and how long they may wait.
const FLUSH_BYTES: usize = 1 << 18;
const FLUSH_AFTER: Duration = Duration::from_millis(200);

/// A job that is out.
struct Out {
    number: u64,
    /// Highest memory of the process since it started.
    peak: u64,
    bytes: usize,
}

struct Scheduler<'r> {
    machine: Machine<'r>,
    run: &'r Run<'r>,
    pool: rayon::ThreadPool,
    sender: Sender<(u64, Back)>,
    out: Vec<Out>,
    number: u64,
    flushed: Instant,
    memory: memory::Sampler,
}

pub(super) fn run<'g>(run: &Run<'g>, given: Vec<Given>) -> Outcome<'g> {
    let started = Instant::now();
    let span = tracing::info_span!("run", graph = run.graph.name());
    let _entered = span.enter();
    let (sender, receiver) = channel();
    let mut scheduler = Scheduler {
        machine: Machine::new(run, given),
        run,
        pool: pool(run.jobs),
        sender,
        out: Vec::new(),
        number: 0,
        flushed: Instant::now(),
        memory: memory::Sampler::new(),
    };
    scheduler.tell(&Event::Started {
        sites: run.graph.sites(),
    });
    scheduler.machine.start();
    let interrupted = scheduler.work(&receiver);
    if let Some(store) = &run.store {
        store.flush();
        if let Err(error) = store.tidy() {
            let warning = format!("the store {} cannot be kept small ({error})", store.path().display());
            scheduler.machine.warnings.push(warning);
        }
        scheduler.machine.warnings.extend(store.warnings());
    }
    scheduler.tell_happened();
    for warning in &scheduler.machine.warnings {
        scheduler.tell(&Event::Warning { message: warning });
        tracing::warn!("{warning}");
    }
    outcome::finish(run, scheduler.machine, started.elapsed(), interrupted)
}

fn pool(jobs: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new()
        .num_threads(jobs)
        .stack_size(16 << 20)
        .thread_name(|i| format!("gear-{i}"))
        .build()
        // Without threads nothing can be computed at all; the message of the operating system says why.
        .unwrap_or_else(|error| panic!("cannot start {jobs} threads: {error}"))
}

impl Scheduler<'_> {
    /// Works until everything is settled; whether it was interrupted.
    fn work(&mut self, receiver: &Receiver<(u64, Back)>) -> bool {
        let mut deadline = None;
        loop {
            if deadline.is_none() && self.run.cancel.load(Ordering::Relaxed) {
                deadline = Some(Instant::now() + GRACE);
            }
            if deadline.is_none() {
                self.machine.settle_agenda();
            }
            self.tell_happened();
            while self.out.len() < self.run.jobs {
                match self.next(deadline.is_some()) {
                    Some(job) => self.start(job),
                    None => break,
                }
            }
            if self.out.is_empty() {
                return deadline.is_some();
            }
            match receiver.recv_timeout(TICK) {
                Ok((number, back)) => {
                    self.sample();
                    self.back(number, back);
                    while let Ok((number, back)) = receiver.try_recv() {
                        self.back(number, back);
                    }
                }
                Err(RecvTimeoutError::Timeout) => self.sample(),
                // This scheduler holds a sender itself.
                Err(RecvTimeoutError::Disconnected) => return deadline.is_some(),
            }
            if deadline.is_some_and(|deadline| Instant::now() > deadline) {
                return true;
            }
            if let Some(store) = &self.run.store
                && (store.pending_bytes() > FLUSH_BYTES || self.flushed.elapsed() > FLUSH_AFTER)
            {
                store.flush();
                self.flushed = Instant::now();
            }
        }
    }

    fn next(&mut self, interrupted: bool) -> Option<Job> {
        let stopped = interrupted || (self.run.fail_fast && !self.machine.failures.is_empty());
        let keep_first = self.machine.keep_bytes > KEEP_FIRST;
        if !stopped && !keep_first {
            if let Some(job) = self.machine.urgent.pop() {
                return Some(job);
            }
            if let Some(job) = self.machine.next_run() {
                return Some(job);
            }
        }
        let job = self.machine.keep.pop_front();
        // More than that waits, but it is all being written: then others may go on.
        if job.is_none() && keep_first && !stopped {
            return self.machine.urgent.pop().or_else(|| self.machine.next_run());
        }
        job
    }

    fn start(&mut self, job: Job) {
        self.number += 1;
        let number = self.number;
        let running = match &job {
            Job::Run { slots, .. } => slots.clone(),
            Job::LoadInput { slot, .. } => vec![*slot],
            _ => Vec::new(),
        };
        let bytes = match &job {
            Job::Keep { value, .. } => value.size_bytes(),
            _ => 0,
        };
        let ctx = self.context(&running);
        let span = match running.first() {
            Some(slot) => {
                let graph = self.run.graph;
                let site = graph.site_of[*slot as usize];
                let id = graph.site_name(site);
                let type_name = graph
                    .node_at(site)
                    .map_or(graph.slot_type(*slot).name, |node| node.spec.name);
                let outputs: Vec<&str> = running.iter().map(|slot| graph.port_name(*slot)).collect();
                self.tell(&Event::Running {
                    node: id,
                    type_name,
                    outputs: &outputs,
                });
                tracing::info_span!("node", id, r#type = type_name)
            }
            None => tracing::debug_span!("store"),
        };
        self.out.push(Out {
            number,
            peak: self.memory.resident(),
            bytes,
        });
        let (store, sender) = (self.run.store.clone(), self.sender.clone());
        self.pool.spawn_fifo(move || {
            let back = span.in_scope(|| job.execute(&ctx, store.as_deref()));
            // Nobody listens any more only when the run was given up.
            let _ = sender.send((number, back));
        });
    }

    fn context(&self, running: &[u32]) -> Context {
        let graph = self.run.graph;
        let Some(slot) = running.first() else {
            return Context::new(Arc::clone(&self.run.cancel), None, 0);
        };
        let site = graph.site_of[*slot as usize];
        let seed = graph.node_at(site).map_or(0, keys::seed);
        let listener = self.run.observer.clone().map(|observer| {
            let name = graph.site_name(site).to_string();
            Arc::new(move |progress: Progress| {
                observer.event(&Event::Progress {
                    node: &name,
                    progress: &progress,
                });
            }) as Arc<dyn Fn(Progress) + Send + Sync>
        });
        Context::new(Arc::clone(&self.run.cancel), listener, seed)
    }

    fn back(&mut self, number: u64, back: Back) {
        let Some(place) = self.out.iter().position(|out| out.number == number) else {
            return;
        };
        let out = self.out.swap_remove(place);
        match back {
            Back::Ran {
                slots,
                result,
                seconds,
                notes,
            } => {
                if result.is_ok()
                    && let Some(slot) = slots.first()
                {
                    let node = self.run.graph.site_name(self.run.graph.site_of[*slot as usize]);
                    self.tell(&Event::Ran { node, seconds });
                    for (slot, computed) in slots.iter().zip(result.iter().flatten()) {
                        self.tell(&Event::Value {
                            node,
                            output: self.run.graph.port_name(*slot),
                            digest: &computed.digest,
                            value: &computed.value,
                        });
                    }
                }
                self.machine.ran(&slots, result, seconds, out.peak, notes);
            }
            Back::Decided { slot, result } => self.machine.decided(slot, result),
            Back::Loaded { slot, value } => self.machine.loaded(slot, value),
            Back::Kept { done } => {
                self.machine.keep_bytes = self.machine.keep_bytes.saturating_sub(out.bytes);
                self.machine.kept(*done);
            }
        }
    }

    /// Takes the memory of the process now as part of the peak of everything that runs.
    fn sample(&mut self) {
        let now = self.memory.resident();
        for out in &mut self.out {
            out.peak = out.peak.max(now);
        }
    }

    fn tell(&self, event: &Event<'_>) {
        if let Some(observer) = &self.run.observer {
            observer.event(event);
        }
    }

    fn tell_happened(&mut self) {
        let graph = self.run.graph;
        for happened in std::mem::take(&mut self.machine.happened) {
            match happened {
                Happened::Hit(slot) => {
                    let node = graph.site_name(graph.site_of[slot as usize]);
                    let digest = self.machine.slots[slot as usize].digest;
                    tracing::debug!(node, output = graph.port_name(slot), ?digest, "hit");
                    self.tell(&Event::Hit {
                        node,
                        output: graph.port_name(slot),
                        digest: &digest,
                    });
                }
                Happened::Failed(i) => {
                    let failure = &self.machine.failures[i];
                    tracing::error!(node = failure.node, cause = failure.chain.join(": "), "failed");
                    self.tell(&Event::Failed { failure });
                }
                Happened::Skipped { site, by } => self.tell(&Event::Skipped {
                    node: graph.site_name(site),
                    because_of: graph.site_name(by),
                }),
                Happened::Note { site, note } => self.tell(&Event::Note {
                    node: graph.site_name(site),
                    note: &note,
                }),
            }
        }
    }
}
