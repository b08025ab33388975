//! The process of a plugin: started, greeted, asked, and ended.
//!
//! Three threads serve a worker, so that nobody who waits for it can be held up by it: one writes what it is told, one
//! reads its messages, one reads its standard error. Whoever asks it something waits at a channel, looks twenty times a
//! second whether the run was interrupted, and gives up at a deadline. The channel is short: a worker that floods it is
//! held up itself.
//!
//! A worker is the leader of a process group of its own. When it has to end, the group is killed, so that what it has
//! started ends with it; an interrupt typed at the terminal does not reach it, since gear tells it to stop.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use gear_graph::Context;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::lines::{self, Incoming, Message, for_people};
use crate::manifest::ALWAYS_PASSED;
use crate::scratch::Scratch;
use crate::{Failure, Manifest, NodeDescription};

/// The version of the protocol.
pub const PROTOCOL: u64 = 1;

/// How often a waiting thread looks around.
const TICK: Duration = Duration::from_millis(50);

/// How long a worker may take to end when it is told to.
const FAREWELL: Duration = Duration::from_secs(2);

/// Lines of standard error that are kept for the message of a failure.
const TAIL: usize = 12;

/// Messages that may wait to be read.
const WAITING: usize = 64;

/// JSON-RPC's code of a request that was cancelled, as the Language Server Protocol has it.
const CANCELLED: i64 = -32800;

/// What a worker says of itself in the handshake.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Hello {
    /// The version of the protocol that it speaks.
    pub protocol: u64,
    /// The plugin's name.
    pub name: String,
    /// Its nodes.
    pub nodes: Vec<NodeDescription>,
    /// What its results depend on besides its sources: versions of libraries, digests of weights.
    #[serde(default)]
    pub states: serde_json::Map<String, Value>,
}

/// A running worker.
pub(crate) struct Worker {
    child: Child,
    /// Closed (by dropping it) so that the worker's input ends.
    to: Option<Sender<Vec<u8>>>,
    from: Receiver<Incoming>,
    tail: Arc<Mutex<VecDeque<String>>>,
    next_id: u64,
    manifest: Manifest,
    pub scratch: Scratch,
    ended: bool,
}

impl Worker {
    /// Starts the program, with nothing of the environment but what the manifest names.
    pub fn start(folder: &Path, manifest: &Manifest) -> Result<Self, Failure> {
        let program = manifest.program(folder);
        let failed = |cause: String| Failure::Start {
            program: program.display().to_string(),
            cause,
        };
        let scratch = Scratch::new().map_err(|error| failed(format!("no folder for its files: {error}")))?;
        let mut command = Command::new(&program);
        command
            .args(&manifest.command[1..])
            .current_dir(folder)
            .env_clear()
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let passed = manifest.environment.pass.iter().map(String::as_str);
        for name in ALWAYS_PASSED.iter().copied().chain(passed) {
            if let Some(value) = std::env::var_os(name) {
                command.env(name, value);
            }
        }
        for name in ["TMPDIR", "TMP", "TEMP"] {
            command.env(name, scratch.path());
        }
        command.env("GEAR_PLUGIN", PROTOCOL.to_string());
        command.envs(&manifest.environment.set);
        #[cfg(unix)]
        {
            use std::os::unix::process::CommandExt;
            command.process_group(0);
        }
        let mut child = command.spawn().map_err(|error| failed(error.to_string()))?;
        let (stdin, stdout, stderr) = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let tail = Arc::default();
        let (to, outgoing) = channel();
        let (incoming, from) = sync_channel(WAITING);
        if let (Some(stdin), Some(stdout), Some(stderr)) = (stdin, stdout, stderr) {
            write_on_a_thread(stdin, outgoing);
            read_on_a_thread(stdout, incoming);
            listen_on_a_thread(stderr, manifest.name.clone(), Arc::clone(&tail));
        }
        tracing::info!(plugin = manifest.name, program = %program.display(), pid = child.id(), "worker started");
        Ok(Self {
            child,
            to: Some(to),
            from,
            tail,
            next_id: 1,
            manifest: manifest.clone(),
            scratch,
            ended: false,
        })
    }

    /// Greets it.
    pub fn greet(&mut self) -> Result<Hello, Failure> {
        let params = json!({
            "protocol": PROTOCOL,
            "gear": env!("CARGO_PKG_VERSION"),
            "scratch": self.scratch.path(),
        });
        let patience = self.manifest.timeouts.start();
        let answer = self.ask("initialize", params, patience, "during the handshake", None)?;
        let hello: Hello = serde_json::from_value(answer)
            .map_err(|error| self.broken(format!("its answer to the handshake: {error}")))?;
        if hello.protocol != PROTOCOL {
            return Err(self.broken(format!(
                "it speaks version {} of the protocol; this gear speaks {PROTOCOL}",
                hello.protocol
            )));
        }
        if hello.name != self.manifest.name {
            return Err(self.broken(format!(
                "it calls itself `{}`; plugin.yaml calls it `{}`",
                for_people(&hello.name),
                self.manifest.name
            )));
        }
        Ok(hello)
    }

    /// Asks it something, and waits for the answer. After a failure other than an answer that is an error, or an
    /// interruption that it has heard, the worker is ended.
    pub fn ask(
        &mut self,
        method: &str,
        params: Value,
        patience: Duration,
        when: &'static str,
        ctx: Option<&Context>,
    ) -> Result<Value, Failure> {
        let id = self.next_id;
        self.next_id += 1;
        self.say(&json!({"jsonrpc": "2.0", "id": id, "method": method, "params": params}));
        let mut deadline = Instant::now() + patience;
        let mut told_to_stop = false;
        loop {
            match self.from.recv_timeout(TICK) {
                Ok(Incoming::Message(message)) => {
                    if let Some(answer) = self.hear(*message, id, ctx)? {
                        return match answer {
                            // A result that came too late for an interrupted run is nobody's any more.
                            Ok(_) if told_to_stop => Err(Failure::Cancelled),
                            Ok(result) => Ok(result),
                            Err(Failure::Remote { code: CANCELLED, .. }) if told_to_stop => Err(Failure::Cancelled),
                            Err(failure) => Err(failure),
                        };
                    }
                }
                Ok(Incoming::Garbage(cause)) => return Err(self.broken(cause)),
                Ok(Incoming::Closed) | Err(RecvTimeoutError::Disconnected) => return Err(self.died(when)),
                Err(RecvTimeoutError::Timeout) => {}
            }
            if !told_to_stop && ctx.is_some_and(Context::is_cancelled) {
                told_to_stop = true;
                self.say(&json!({"jsonrpc": "2.0", "method": "cancel", "params": {"id": id}}));
                deadline = Instant::now() + self.manifest.timeouts.cancel();
            }
            if Instant::now() > deadline {
                self.end();
                return Err(if told_to_stop {
                    Failure::Cancelled
                } else {
                    Failure::TimedOut {
                        when,
                        seconds: patience.as_secs_f64(),
                        tail: self.said(),
                    }
                });
            }
        }
    }

    /// Takes a message: the answer to request `id`, or what the worker tells on the way.
    fn hear(
        &mut self,
        message: Message,
        id: u64,
        ctx: Option<&Context>,
    ) -> Result<Option<Result<Value, Failure>>, Failure> {
        match (message.method.as_deref(), message.id, message.result, message.error) {
            (Some("progress"), None, None, None) => {
                let fraction = message.params["fraction"].as_f64().unwrap_or(0.0);
                let remark = message.params["message"].as_str().unwrap_or_default();
                if let Some(ctx) = ctx
                    && fraction.is_finite()
                {
                    ctx.progress_with(fraction, for_people(remark));
                }
                Ok(None)
            }
            (Some("log"), None, None, None) => {
                let text = for_people(message.params["message"].as_str().unwrap_or_default());
                log(&self.manifest.name, message.params["level"].as_str(), &text);
                Ok(None)
            }
            (None, Some(answered), Some(result), None) if answered == id => Ok(Some(Ok(result))),
            (None, Some(answered), None, Some(error)) if answered == id => {
                let message = match for_people(&error.message) {
                    text if text.trim().is_empty() => "the worker gives no reason".to_owned(),
                    text => text,
                };
                let code = error.code;
                Ok(Some(Err(Failure::Remote { code, message })))
            }
            (method, id, ..) => Err(self.broken(format!(
                "expected progress, log, or the answer that was asked for, found {} {}",
                method.map_or("an answer".to_owned(), |method| format!("`{}`", for_people(method))),
                id.map_or("without an id".to_owned(), |id| format!("with the id {id}")),
            ))),
        }
    }

    /// Whether it still runs.
    pub fn alive(&mut self) -> bool {
        !self.ended && matches!(self.child.try_wait(), Ok(None))
    }

    fn say(&self, message: &Value) {
        let mut line = message.to_string().into_bytes();
        line.push(b'\n');
        if let Some(to) = &self.to {
            // A worker that is gone is noticed where its answer is waited for.
            let _ = to.send(line);
        }
    }

    fn broken(&mut self, cause: String) -> Failure {
        self.end();
        Failure::Protocol {
            cause,
            tail: self.said(),
        }
    }

    fn died(&mut self, when: &'static str) -> Failure {
        // Its output is closed: it is about to end, or has no business going on.
        let deadline = Instant::now() + FAREWELL;
        let mut status = None;
        while status.is_none() && Instant::now() < deadline {
            status = self.child.try_wait().ok().flatten();
            if status.is_none() {
                std::thread::sleep(Duration::from_millis(5));
            }
        }
        let how = status.map_or("with its output closed".to_owned(), how_it_ended);
        self.end();
        Failure::Died {
            when,
            how,
            tail: self.said(),
        }
    }

    /// The last lines of its standard error.
    fn said(&self) -> Vec<String> {
        // The thread that reads them may be a moment behind.
        std::thread::sleep(TICK);
        let tail = self.tail.lock().unwrap_or_else(PoisonError::into_inner);
        tail.iter().cloned().collect()
    }

    /// Kills it and what it has started.
    fn end(&mut self) {
        self.to = None;
        if self.ended {
            return;
        }
        self.ended = true;
        // Before it is waited for: as long as it was not, its number is nobody else's.
        kill_group(self.child.id());
        let _ = self.child.kill();
        let _ = self.child.wait();
        tracing::info!(plugin = self.manifest.name, "worker ended");
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        if self.alive() {
            self.say(&json!({"jsonrpc": "2.0", "id": self.next_id, "method": "shutdown"}));
            self.to = None;
            let deadline = Instant::now() + FAREWELL;
            while self.alive() && Instant::now() < deadline {
                std::thread::sleep(Duration::from_millis(5));
            }
        }
        self.end();
    }
}

#[cfg(unix)]
fn kill_group(leader: u32) {
    if let Ok(leader) = i32::try_from(leader) {
        let _ = nix::sys::signal::killpg(nix::unistd::Pid::from_raw(leader), nix::sys::signal::Signal::SIGKILL);
    }
}

#[cfg(not(unix))]
fn kill_group(_: u32) {}

fn how_it_ended(status: ExitStatus) -> String {
    #[cfg(unix)]
    {
        use std::os::unix::process::ExitStatusExt;
        if let Some(signal) = status.signal() {
            return format!("by signal {signal}");
        }
    }
    match status.code() {
        Some(code) => format!("with exit code {code}"),
        None => "without an exit code".to_owned(),
    }
}

fn write_on_a_thread(mut stdin: ChildStdin, lines: Receiver<Vec<u8>>) {
    std::thread::spawn(move || {
        for line in lines {
            if stdin.write_all(&line).and_then(|()| stdin.flush()).is_err() {
                return;
            }
        }
    });
}

fn read_on_a_thread(stdout: impl Read + Send + 'static, to: SyncSender<Incoming>) {
    std::thread::spawn(move || {
        let mut reader = BufReader::new(stdout);
        loop {
            let incoming = lines::next(&mut reader);
            let last = !matches!(incoming, Incoming::Message(_));
            if to.send(incoming).is_err() || last {
                return;
            }
        }
    });
}

fn listen_on_a_thread(stderr: impl Read + Send + 'static, plugin: String, tail: Arc<Mutex<VecDeque<String>>>) {
    const LONGEST_LINE: u64 = 1 << 14;
    std::thread::spawn(move || {
        let mut reader = BufReader::new(stderr);
        loop {
            let mut line = Vec::new();
            match reader.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line) {
                Ok(0) | Err(_) => return,
                Ok(_) => {}
            }
            let text = for_people(&String::from_utf8_lossy(&line));
            if text.is_empty() {
                continue;
            }
            tracing::debug!(plugin, "{text}");
            let mut tail = tail.lock().unwrap_or_else(PoisonError::into_inner);
            if tail.len() == TAIL {
                tail.pop_front();
            }
            tail.push_back(text);
        }
    });
}

fn log(plugin: &str, level: Option<&str>, text: &str) {
    match level {
        Some("error") => tracing::error!(plugin, "{text}"),
        Some("warning" | "warn") => tracing::warn!(plugin, "{text}"),
        Some("debug") => tracing::debug!(plugin, "{text}"),
        _ => tracing::info!(plugin, "{text}"),
    }
}
