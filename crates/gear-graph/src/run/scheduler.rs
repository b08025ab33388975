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
//! With a memory limit, a node or a value from the store is held back (`parked`) while the values in memory, those
//! that wait to be written and the estimates of the jobs that are out would exceed it. Only the most urgent of each
//! kind is looked at: what is large must not be overtaken for ever by what is small.
//!
//! # What must stay true
//!
//! * The coordinator never blocks but on the channel, and never for longer than a tick: it then looks at the
//!   interruption flag and at the memory.
//! * Every job sends exactly one answer, also when it panics (`jobs` catches panics of nodes, loaders, encoders).
//! * When no job is out and the machine has none to give, everything is settled: each requested slot is done, failed,
//!   or waits for one that failed.
//! * When no job is out, one is started whatever the limit says: a run with a limit ends whenever it would end
//!   without one.
//! * An interruption starts nothing new but writing what is computed already, and gives up waiting after a grace.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use super::inputs::Given;
use super::jobs::{Back, Job, StoreCost};
use super::machine::{Happened, Machine};
use super::observe::Event;
use super::outcome::{self, Outcome};
use super::{Run, keys, memory};
use crate::{Context, Progress};

const TICK: Duration = Duration::from_millis(50);
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
    /// Bytes that wait to be written and no longer do once it is back.
    bytes: usize,
    /// Bytes that it is estimated to need.
    memory: u64,
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
    /// Jobs that are held back by the memory limit: a node, a value from the store.
    parked: [Option<Job>; 2],
    spent: Spent,
}

/// Where the time went, and what memory was planned with.
#[derive(Default)]
pub(super) struct Spent {
    /// When the run was asked for.
    pub started: Option<Instant>,
    /// Seconds that taking the digests of the inputs' files took.
    pub inputs: f64,
    /// Seconds that the coordinator waited for jobs.
    pub waiting: f64,
    /// What its thread had worked before, where the platform counts that.
    pub worked: Option<f64>,
    pub store: StoreCost,
    /// Highest estimate of the memory in use.
    pub estimated: u64,
    /// How many starts were held back.
    pub held_back: usize,
}

const NODE: usize = 0;
const LOAD: usize = 1;

pub(super) fn run<'g>(run: &Run<'g>, given: Vec<Given>, started: Instant) -> Outcome<'g> {
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
        parked: [None, None],
        spent: Spent {
            started: Some(started),
            inputs: started.elapsed().as_secs_f64(),
            worked: memory::thread_seconds(),
            ..Spent::default()
        },
    };
    scheduler.tell(&Event::Started {
        sites: run.graph.sites(),
    });
    scheduler.machine.start();
    let interrupted = scheduler.work(&receiver);
    if let Some(store) = &run.store {
        store.flush();
        if let Err(error) = store.tidy() {
            let warning = format!("the store {} cannot be tidied up ({error})", store.path().display());
            scheduler.machine.warnings.push(warning);
        }
        scheduler.machine.warnings.extend(store.warnings());
    }
    scheduler.tell_happened();
    for warning in &scheduler.machine.warnings {
        scheduler.tell(&Event::Warning { message: warning });
        tracing::warn!("{warning}");
    }
    outcome::finish(run, scheduler.machine, &scheduler.spent, interrupted)
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
            let waits = Instant::now();
            let answer = receiver.recv_timeout(TICK);
            self.spent.waiting += waits.elapsed().as_secs_f64();
            match answer {
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
        if !stopped
            && !keep_first
            && let Some(job) = self.next_work()
        {
            return Some(job);
        }
        let job = self.machine.keep.pop_front();
        if job.is_some() || stopped {
            return job;
        }
        // More than that waits, but it is all being written: then others may go on.
        if keep_first && let Some(job) = self.next_work() {
            return Some(job);
        }
        if self.out.is_empty() {
            return self.next_whatever_the_limit();
        }
        None
    }

    /// The most urgent decision, value or node that fits into the memory.
    fn next_work(&mut self) -> Option<Job> {
        let urgent = self.parked[LOAD].take().or_else(|| self.machine.urgent.pop());
        if let Some(job) = self.fitting(urgent, LOAD) {
            return Some(job);
        }
        let node = self.parked[NODE].take().or_else(|| self.machine.next_run());
        self.fitting(node, NODE)
    }

    /// The job if it fits; else it is parked.
    fn fitting(&mut self, job: Option<Job>, kind: usize) -> Option<Job> {
        let (job, limit) = (job?, self.run.memory.unwrap_or(u64::MAX));
        if self.in_use().saturating_add(job.memory()) <= limit || job.memory() == 0 {
            return Some(job);
        }
        self.spent.held_back += 1;
        self.parked[kind] = Some(job);
        None
    }

    /// Nothing is out, so nothing will be freed by waiting: a node, which may free its inputs, or a value.
    fn next_whatever_the_limit(&mut self) -> Option<Job> {
        let job = self.parked[NODE].take().or_else(|| self.parked[LOAD].take())?;
        self.spent.held_back = self.spent.held_back.saturating_sub(1);
        if let (Job::Run { slots, .. }, Some(limit)) = (&job, self.run.memory)
            && let Some(slot) = slots.first()
        {
            let mib = |bytes: u64| bytes.div_ceil(1 << 20);
            let note = format!(
                "is estimated to need {} MiB beside {} MiB that are held, which is above the limit of {} MiB; it ran \
                 because nothing else did",
                mib(job.memory()),
                mib(self.in_use()),
                mib(limit)
            );
            self.machine.note(self.run.graph.site_of[*slot as usize], &[note]);
        }
        Some(job)
    }

    /// Bytes that are in use by estimate. A value that is held and waits to be written counts twice.
    fn in_use(&self) -> u64 {
        let out = self.out.iter().map(|out| out.memory).fold(0, u64::saturating_add);
        (self.machine.held_bytes + self.machine.keep_bytes as u64).saturating_add(out)
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
            memory: job.memory(),
        });
        self.spent.estimated = self.spent.estimated.max(self.in_use());
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
        Context::new(Arc::clone(&self.run.cancel), listener, seed).with_resources(self.run.resources.clone())
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
                cost,
                notes,
            } => {
                self.spent.store += cost;
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
            Back::Loaded { slot, value, cost } => {
                self.spent.store += cost;
                self.machine.loaded(slot, value);
            }
            Back::Kept { done, cost } => {
                self.spent.store += cost;
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
