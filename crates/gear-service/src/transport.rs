//! One request and its answer: limits, repetition, and what is refused.
//!
//! A request is repeated when its failure may pass: nobody answered, the connection broke, 408, 425, 429, or a 5xx that
//! speaks of the moment. The pause doubles from try to try and is cut by a random share, so that many runs that were
//! refused together do not come back together; a server that says `Retry-After`, as seconds or as a date, is believed up to a
//! minute.

use std::hash::{BuildHasher, RandomState};
use std::sync::Arc;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, SystemTime};

use gear_graph::Params;
use ureq::http::Method;

use crate::pace::{self, Pace};
use crate::{Endpoint, ServiceError, retry_after};

/// What a run allows a service.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Policy {
    /// The longest that one try may take, answer included.
    pub timeout: Duration,
    /// How often a request is tried, at least 1.
    pub tries: u32,
    /// The pause before the second try; it doubles from try to try.
    pub pause: Duration,
    /// Requests that are out at a time.
    pub at_a_time: usize,
    /// Most bytes of an answer.
    pub largest: u64,
}

impl Default for Policy {
    fn default() -> Self {
        Self {
            timeout: Duration::from_secs(180),
            tries: 4,
            pause: Duration::from_millis(500),
            at_a_time: 2,
            largest: 64 << 20,
        }
    }
}

/// How patient a node is with its service; every node that asks one has these parameters.
#[derive(Clone, Debug, PartialEq, Params)]
pub struct Patience {
    /// The longest that one request may take.
    #[param(default = 180.0, range = 0.1..=3600.0, unit = "s")]
    pub timeout: f64,
    /// How often a request is tried.
    #[param(default = 4, range = 1..=20)]
    pub tries: u32,
}

impl Patience {
    /// What it allows.
    pub fn policy(&self) -> Policy {
        Policy {
            timeout: Duration::from_secs_f64(self.timeout),
            tries: self.tries,
            ..Policy::default()
        }
    }
}

/// The longest `Retry-After` that is waited for.
const LONGEST_HOLD: Duration = Duration::from_secs(60);
/// How much of what a server says is shown.
const SHOWN: usize = 300;
/// Redirects on one host that are followed.
const REDIRECTS: usize = 3;

/// The way to a service.
pub struct Transport<'a> {
    endpoint: Endpoint,
    policy: Policy,
    pace: Pace,
    agent: ureq::Agent,
    interrupted: &'a (dyn Fn() -> bool + Sync),
}

/// What is asked.
pub(crate) struct Request<'r> {
    pub method: Method,
    /// A path below the service's, or a whole address on its host.
    pub address: String,
    pub body: &'r [u8],
    pub content_type: &'r str,
}

impl Request<'_> {
    pub fn get(address: impl Into<String>) -> Self {
        Self {
            method: Method::GET,
            address: address.into(),
            body: &[],
            content_type: "",
        }
    }
}

/// What came back with a status of success.
pub(crate) struct Answer {
    pub content_type: String,
    pub body: Vec<u8>,
}

/// How one try ended.
enum Try {
    Answered(Answer),
    MovedTo(String),
    /// It may go better later, not before the pause if there is one.
    Later(ServiceError, Option<Duration>),
    Never(ServiceError),
}

impl<'a> Transport<'a> {
    /// The way to `endpoint`. Waiting ends when `interrupted` says so.
    pub fn new(endpoint: &Endpoint, policy: Policy, interrupted: &'a (dyn Fn() -> bool + Sync)) -> Self {
        let config = ureq::Agent::config_builder()
            .http_status_as_error(false)
            .max_redirects(0)
            .max_redirects_will_error(false)
            .timeout_global(Some(policy.timeout))
            .timeout_connect(Some(policy.timeout.min(Duration::from_secs(20))))
            .user_agent(concat!("gear/", env!("CARGO_PKG_VERSION")))
            .build();
        Self {
            endpoint: endpoint.clone(),
            policy,
            pace: Pace::new(policy.at_a_time),
            agent: config.into(),
            interrupted,
        }
    }

    /// The service.
    pub fn endpoint(&self) -> &Endpoint {
        &self.endpoint
    }

    /// Waits, and stops when the run is interrupted.
    pub(crate) fn sleep(&self, pause: Duration) -> Result<(), ServiceError> {
        pace::sleep(pause, &|| (self.interrupted)())
    }

    pub(crate) fn unexpected(&self, found: impl Into<String>, expected: impl Into<String>) -> ServiceError {
        ServiceError::Unexpected {
            host: self.endpoint.host().to_owned(),
            found: self.endpoint.redact(&found.into()),
            expected: expected.into(),
        }
    }

    /// Asks until there is an answer or no more sense in asking.
    pub(crate) fn send(&self, request: &Request<'_>) -> Result<Answer, ServiceError> {
        let mut address = if request.address.contains("://") {
            request.address.clone()
        } else {
            self.endpoint.join(&request.address)
        };
        let exchange = Arc::new(Exchange {
            endpoint: self.endpoint.clone(),
            policy: self.policy,
            agent: self.agent.clone(),
            method: request.method.clone(),
            body: request.body.to_vec(),
            content_type: request.content_type.to_owned(),
        });
        let mut redirects = 0;
        let mut tried = 0;
        loop {
            tried += 1;
            let outcome = {
                let _turn = self.pace.turn(&|| (self.interrupted)())?;
                self.once(&exchange, &address)?
            };
            let (error, after) = match outcome {
                Try::Answered(answer) => return Ok(answer),
                Try::MovedTo(target) => {
                    redirects += 1;
                    let same = self.endpoint.owns(&target) && request.method == Method::GET;
                    if !same || redirects > REDIRECTS {
                        return Err(ServiceError::Redirect {
                            host: self.endpoint.host().to_owned(),
                            target: host_of(&target),
                        });
                    }
                    address = self.endpoint.absolute(&target);
                    tried -= 1;
                    continue;
                }
                Try::Never(error) => return Err(error),
                Try::Later(error, after) => (error, after),
            };
            if tried >= self.policy.tries.max(1) {
                return Err(error);
            }
            let pause = match after {
                Some(pause) if pause > LONGEST_HOLD => return Err(error),
                Some(pause) => {
                    self.pace.hold(pause);
                    pause
                }
                None => jittered(self.policy.pause.saturating_mul(1 << (tried - 1).min(6))),
            };
            tracing::info!(host = self.endpoint.host(), %error, ?pause, "the service is asked again");
            self.sleep(pause)?;
        }
    }

    /// One try on a thread of its own, so that an interruption need not wait for the server.
    fn once(&self, exchange: &Arc<Exchange>, address: &str) -> Result<Try, ServiceError> {
        let (exchange, address) = (Arc::clone(exchange), address.to_owned());
        let (tell, told) = mpsc::channel();
        std::thread::spawn(move || {
            // Nobody listens after an interruption.
            let _ = tell.send(exchange.once(&address));
        });
        loop {
            match told.recv_timeout(pace::LOOK) {
                Ok(outcome) => return Ok(outcome),
                Err(RecvTimeoutError::Timeout) if (self.interrupted)() => return Err(ServiceError::Interrupted),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(self.unexpected("an answer that cannot be read", "one as HTTP has it"));
                }
            }
        }
    }
}

/// All that one try needs, for as long as it takes.
struct Exchange {
    endpoint: Endpoint,
    policy: Policy,
    agent: ureq::Agent,
    method: Method,
    body: Vec<u8>,
    content_type: String,
}

impl Exchange {
    fn once(&self, address: &str) -> Try {
        let host = || self.endpoint.host().to_owned();
        let mut head = ureq::http::Request::builder().method(self.method.clone()).uri(address);
        if let Some(key) = self.endpoint.key() {
            head = head.header("Authorization", format!("Bearer {}", key.reveal()));
        }
        if !self.content_type.is_empty() {
            head = head.header("Content-Type", &self.content_type);
        }
        let sent = if self.method == Method::GET {
            head.body(()).map(|head| self.agent.run(head))
        } else {
            head.body(&self.body[..]).map(|head| self.agent.run(head))
        };
        let failed = |error: ureq::Error| {
            let final_word = untrusted(&error);
            let error = ServiceError::Unreachable {
                host: host(),
                cause: self.endpoint.redact(&error.to_string()),
                tries: match self.policy.tries {
                    0 | 1 => "tried once".to_owned(),
                    _ if final_word => "tried once".to_owned(),
                    n => format!("tried {n} times at most"),
                },
            };
            match final_word {
                true => Try::Never(error),
                false => Try::Later(error, None),
            }
        };
        let mut response = match sent {
            // What a header cannot hold is a mistake in the key or in the address.
            Err(_) => {
                return Try::Never(ServiceError::Unreachable {
                    host: host(),
                    cause: "the address or the key holds characters that HTTP does not allow".to_owned(),
                    tries: "not tried".to_owned(),
                });
            }
            Ok(Err(error)) => return failed(error),
            Ok(Ok(response)) => response,
        };
        let status = response.status();
        let header = |name: &str| {
            let value = response.headers().get(name)?.to_str().ok()?;
            Some(value.trim().to_owned())
        };
        let (content_type, location) = (header("content-type"), header("location"));
        let (again_after, date) = (header("retry-after"), header("date"));
        if status.is_redirection() {
            return Try::MovedTo(location.unwrap_or_default());
        }
        let limit = if status.is_success() {
            self.policy.largest
        } else {
            1 << 16
        };
        let body = response.body_mut().with_config().limit(limit).read_to_vec();
        let body = match body {
            Ok(body) => body,
            Err(ureq::Error::BodyExceedsLimit(_)) if status.is_success() => {
                return Try::Never(ServiceError::TooLarge { host: host(), limit });
            }
            Err(_) if !status.is_success() => Vec::new(),
            Err(error) => return failed(error),
        };
        if status.is_success() {
            return Try::Answered(Answer {
                content_type: self.endpoint.redact(&content_type.unwrap_or_default()),
                // What is said becomes part of results and reports.
                body: self.endpoint.redact_bytes(body),
            });
        }
        let error = ServiceError::Refused {
            host: host(),
            status: status.as_u16(),
            said: self.endpoint.redact(&said(&body)),
        };
        match status.as_u16() {
            408 | 425 | 429 | 500 | 502 | 503 | 504 | 529 => {
                let pause = again_after.and_then(|said| retry_after::pause(&said, date.as_deref(), SystemTime::now()));
                Try::Later(error, pause)
            }
            _ => Try::Never(error),
        }
    }
}

/// Whether the other side speaks no TLS, or has a certificate that nobody vouches for: no second try changes that.
fn untrusted(error: &ureq::Error) -> bool {
    match error {
        ureq::Error::Tls(_) | ureq::Error::Rustls(_) => true,
        ureq::Error::Io(error) => error.kind() == std::io::ErrorKind::InvalidData,
        _ => false,
    }
}

/// Between half of a pause and the whole.
fn jittered(pause: Duration) -> Duration {
    // Seeded by the system; nothing that is computed depends on it.
    let random = RandomState::new().hash_one(0u8) as f64 / u64::MAX as f64;
    pause.mul_f64(0.5 + 0.5 * random)
}

fn host_of(address: &str) -> String {
    let uri = address.parse::<ureq::http::Uri>().ok();
    let host = uri.as_ref().and_then(|uri| uri.host());
    host.map_or_else(|| "an address without a host".to_owned(), str::to_owned)
}

/// What a server said with a refusal: its message if it is JSON of the usual form, else the beginning of the text.
fn said(body: &[u8]) -> String {
    let json: Option<serde_json::Value> = serde_json::from_slice(body).ok();
    let message = json.as_ref().and_then(|json| {
        let error = json.get("error").unwrap_or(json);
        error.get("message").and_then(|m| m.as_str()).or_else(|| error.as_str())
    });
    let text = match message {
        Some(message) => message.to_owned(),
        None => String::from_utf8_lossy(body).into_owned(),
    };
    let text: String = text.chars().filter(|c| !c.is_control()).take(SHOWN).collect();
    if text.trim().is_empty() {
        String::new()
    } else {
        format!(": {}", text.trim())
    }
}
