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
//! * The coordinator never blocks but on the channel, and what it must not sleep through comes by that channel: an
//!   interruption rings ([`super::Cancel`]). It wakes by itself only while records wait to be written, or where an
//!   interruption is a bare flag. So a run that lasts an hour costs what one of a second costs.
//! * The store's folder may be locked for long by another process that collects garbage. Records then wait in memory;
//!   only the end of a run waits for the folder, and not once it is interrupted.
//! * Every job sends exactly one answer, also when it panics (`jobs` catches panics of nodes, loaders, encoders).
//! * When no job is out and the machine has none to give, everything is settled: each requested slot is done, failed,
//!   or waits for one that failed.
//! * When no job is out, one is started whatever the limit says: a run with a limit ends whenever it would end
//!   without one.
//! * An interruption starts nothing new but writing what is computed already, and gives up waiting after a grace.

use std::io;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use super::inputs::{Given, RunMistake};
use super::jobs::{Back, Job, StoreCost};
use super::machine::{Happened, Machine};
use super::observe::Event;
use super::outcome::{self, Outcome};
use super::threads::Threads;
use super::{Run, keys, memory};
use crate::store::UnfinishedAction;
use crate::{Context, Progress, Store};

/// How often a flag is looked at that nobody rings for.
const TICK: Duration = Duration::from_millis(50);
/// How long an interrupted run waits for its nodes to notice.
const GRACE: Duration = Duration::from_millis(700);
/// How long it then waits for the store's folder, which another process may have locked.
const LAST_RECORDS: Duration = Duration::from_millis(200);
/// Bytes of values that may wait to be written before writing goes first.
const KEEP_FIRST: usize = 256 << 20;
/// Bytes of records that are gathered before they are appended to the log, and how long they may wait.
const FLUSH_BYTES: usize = 1 << 18;
const FLUSH_AFTER: Duration = Duration::from_millis(200);
/// How often a node that takes long may keep its unfinished state. A state of tens of megabytes is encoded, hashed and
/// written by the thread that works on it; at one every five seconds it cost the main job more than a second.
const KEEP_UNFINISHED_EVERY: Duration = Duration::from_secs(20);

/// What the coordinator wakes for.
enum Message {
    /// A job has come back.
    Back(u64, Back),
    /// The run is interrupted.
    Interrupted,
}

/// A job that is out.
struct Out {
    number: u64,
    /// Bytes that wait to be written and no longer do once it is back.
    bytes: usize,
    /// Bytes that it is estimated to need.
    memory: u64,
}

struct Scheduler<'r> {
    machine: Machine<'r>,
    run: &'r Run<'r>,
    pool: rayon::ThreadPool,
    /// How many threads the pool has.
    threads: usize,
    sender: Sender<Message>,
    /// Whether an interruption rings.
    rings: bool,
    out: Vec<Out>,
    number: u64,
    flushed: Instant,
    memory: Arc<memory::Watch>,
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
    /// Threads that could be started.
    pub threads: usize,
}

const NODE: usize = 0;
const LOAD: usize = 1;

pub(super) fn run<'g>(run: &Run<'g>, given: Vec<Given>, started: Instant) -> Result<Outcome<'g>, RunMistake> {
    let span = tracing::info_span!("run", graph = run.graph.name());
    let _entered = span.enter();
    let (pool, too_few) = pool(run.jobs)?;
    let (sender, receiver) = channel();
    let bell = {
        let sender = sender.clone();
        // Nobody listens any more only when the run is over.
        run.cancel.on_raise(move || drop(sender.send(Message::Interrupted)))
    };
    let threads = pool.current_num_threads();
    let mut scheduler = Scheduler {
        machine: Machine::new(run, given),
        run,
        pool,
        threads,
        sender,
        rings: bell.is_some(),
        out: Vec::new(),
        number: 0,
        flushed: Instant::now(),
        memory: Arc::new(memory::Watch::new()),
        parked: [None, None],
        spent: Spent {
            started: Some(started),
            inputs: started.elapsed().as_secs_f64(),
            worked: memory::thread_seconds(),
            threads,
            ..Spent::default()
        },
    };
    scheduler.machine.warnings.extend(too_few);
    scheduler.tell(&Event::Started {
        sites: run.graph.sites(),
    });
    scheduler.machine.start();
    let interrupted = scheduler.work(&receiver);
    if let Some(store) = &run.store {
        scheduler.end_of_store(store);
    }
    scheduler.tell_happened();
    for warning in &scheduler.machine.warnings {
        scheduler.tell(&Event::Warning { message: warning });
        tracing::warn!("{warning}");
    }
    Ok(outcome::finish(run, scheduler.machine, &scheduler.spent, interrupted))
}

/// A pool of so many threads, or of as many as can be started, with a warning.
fn pool(jobs: usize) -> Result<(rayon::ThreadPool, Option<String>), RunMistake> {
    let none = |error: io::Error| RunMistake::NoThread {
        cause: error.to_string(),
    };
    let threads = Threads::start(jobs, "gear", Some(16 << 20)).map_err(none)?;
    let too_few = threads.refused().map(|refused| {
        let count = threads.count();
        format!("of {jobs} threads only {count} are used, as the system does not start as many ({refused})")
    });
    Ok((threads.into_pool().map_err(none)?, too_few))
}

impl Scheduler<'_> {
    /// Works until everything is settled; whether it was interrupted.
    fn work(&mut self, receiver: &Receiver<Message>) -> bool {
        let mut deadline = None;
        loop {
            if deadline.is_none() && self.run.cancel.is_raised() {
                deadline = Some(Instant::now() + GRACE);
            }
            if deadline.is_none() {
                self.machine.settle_agenda();
            }
            self.tell_happened();
            if !self.machine.dropped.is_empty() {
                let dropped = std::mem::take(&mut self.machine.dropped);
                self.pool.spawn(|| drop(dropped));
            }
            while self.out.len() < self.threads {
                match self.next(deadline.is_some()) {
                    Some(job) => self.start(job),
                    None => break,
                }
            }
            if self.out.is_empty() {
                return deadline.is_some();
            }
            let waits = Instant::now();
            let message = match self.patience(deadline) {
                None => receiver.recv().map_err(|_| RecvTimeoutError::Disconnected),
                Some(patience) => receiver.recv_timeout(patience),
            };
            self.spent.waiting += waits.elapsed().as_secs_f64();
            match message {
                Ok(message) => {
                    self.hear(message);
                    while let Ok(message) = receiver.try_recv() {
                        self.hear(message);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                // This scheduler holds a sender itself.
                Err(RecvTimeoutError::Disconnected) => return deadline.is_some(),
            }
            if deadline.is_some_and(|deadline| Instant::now() > deadline) {
                return true;
            }
            if let Some(store) = &self.run.store
                && (store.pending_bytes() > FLUSH_BYTES || self.flushed.elapsed() > FLUSH_AFTER)
            {
                store.try_flush();
                self.flushed = Instant::now();
            }
        }
    }

    /// How long to sleep when nobody rings; `None` for as long as it takes.
    fn patience(&self, deadline: Option<Instant>) -> Option<Duration> {
        let records = self.run.store.as_ref().is_some_and(|store| store.pending_bytes() > 0);
        let flush = records.then(|| FLUSH_AFTER.saturating_sub(self.flushed.elapsed()));
        let grace = deadline.map(|deadline| deadline.saturating_duration_since(Instant::now()));
        let look = (!self.rings).then_some(TICK);
        let soonest = flush.into_iter().chain(grace).chain(look).min();
        // A moment later than needed rather than a moment too early, and then again.
        soonest.map(|patience| patience + Duration::from_millis(1))
    }

    fn hear(&mut self, message: Message) {
        match message {
            Message::Back(number, back) => self.back(number, back),
            // The loop looks at the flag.
            Message::Interrupted => {}
        }
    }

    /// Writes the last records, and what the store does at the end of a run.
    fn end_of_store(&mut self, store: &Store) {
        let cancel = self.run.cancel.clone();
        let interrupted = Instant::now();
        let stop = || cancel.is_raised() && interrupted.elapsed() > LAST_RECORDS;
        if !store.flush_unless(&stop) {
            let folder = store.path().display();
            let warning =
                format!("another process is at work on the store {folder}; the last results of this run are not kept");
            self.machine.warnings.push(warning);
        } else if !cancel.is_raised()
            && let Err(error) = store.tidy()
        {
            let warning = format!("the store {} cannot be tidied up ({error})", store.path().display());
            self.machine.warnings.push(warning);
        }
        self.machine.warnings.extend(store.warnings());
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
            bytes,
            memory: job.memory(),
        });
        if !running.is_empty() {
            self.memory.begin(number);
        }
        self.spent.estimated = self.spent.estimated.max(self.in_use());
        let (store, sender) = (self.run.store.clone(), self.sender.clone());
        self.pool.spawn_fifo(move || {
            let back = span.in_scope(|| job.execute(&ctx, store.as_deref()));
            // Nobody listens any more only when the run was given up.
            let _ = sender.send(Message::Back(number, back));
        });
    }

    fn context(&self, running: &[u32]) -> Context {
        let graph = self.run.graph;
        let cancelled = Arc::clone(self.run.cancel.flag());
        let Some(slot) = running.first() else {
            return Context::new(cancelled, None, 0);
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
        let memory = Arc::clone(&self.memory);
        let ctx = Context::new(cancelled, listener, seed)
            .with_resources(self.run.resources.clone())
            .with_pulse(Arc::new(move || memory.pulse()));
        match (&self.run.store, self.machine.unfinished_key(*slot)) {
            (Some(store), Some(key)) => {
                let place = UnfinishedAction::new(Arc::clone(store), &key);
                ctx.with_unfinished(Arc::new(place), KEEP_UNFINISHED_EVERY)
            }
            _ => ctx,
        }
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
                let peak = self.memory.end(number);
                self.machine.ran(&slots, result, seconds, peak, notes);
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
