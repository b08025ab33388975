//! A server on the loopback address that speaks the protocols and misbehaves on demand.
//!
//! ```
//! use gear_service::testing::{Reply, Server};
//! let server = Server::start(|asked| Reply::json(200, &format!("{{\"path\": \"{}\"}}", asked.path)));
//! assert!(server.url().starts_with("http://127.0.0.1:"));
//! ```

mod studio;

use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

pub use studio::Studio;

/// A request as it arrived.
#[derive(Clone, Debug, Default)]
pub struct Received {
    /// `GET` or `POST`.
    pub method: String,
    /// The path with its query.
    pub path: String,
    /// Names in lower case.
    pub headers: Vec<(String, String)>,
    /// The body.
    pub body: Vec<u8>,
}

impl Received {
    /// A header.
    pub fn header(&self, name: &str) -> Option<&str> {
        let found = self.headers.iter().find(|(n, _)| n == name);
        found.map(|(_, value)| value.as_str())
    }

    /// A field of a `multipart/form-data` body.
    pub fn field(&self, name: &str) -> Option<Vec<u8>> {
        let boundary = self.header("content-type")?.split("boundary=").nth(1)?.trim();
        let mark = format!("--{boundary}");
        let head = format!("name=\"{name}\"");
        let mut rest = &self.body[..];
        while let Some(at) = position(rest, mark.as_bytes()) {
            rest = &rest[at + mark.len()..];
            let end = position(rest, format!("\r\n{mark}").as_bytes())?;
            let part = &rest[..end];
            let split = position(part, b"\r\n\r\n")?;
            if String::from_utf8_lossy(&part[..split]).contains(&head) {
                return Some(part[split + 4..].to_vec());
            }
        }
        None
    }
}

fn position(bytes: &[u8], what: &[u8]) -> Option<usize> {
    bytes.windows(what.len()).position(|window| window == what)
}

/// What the server answers.
#[derive(Clone, Debug)]
pub struct Reply {
    status: u16,
    headers: Vec<(String, String)>,
    body: Vec<u8>,
    delay: Duration,
    /// The connection is cut after so many bytes of the body.
    cut: Option<usize>,
}

impl Reply {
    /// An answer of any kind.
    pub fn new(status: u16, content_type: &str, body: impl Into<Vec<u8>>) -> Self {
        Self {
            status,
            headers: vec![("Content-Type".to_owned(), content_type.to_owned())],
            body: body.into(),
            delay: Duration::ZERO,
            cut: None,
        }
    }

    /// A JSON answer.
    pub fn json(status: u16, text: &str) -> Self {
        Self::new(status, "application/json", text.as_bytes())
    }

    /// With a header.
    pub fn with(mut self, name: &str, value: &str) -> Self {
        self.headers.push((name.to_owned(), value.to_owned()));
        self
    }

    /// With another body, made of its own.
    pub fn map_body(mut self, change: impl FnOnce(Vec<u8>) -> Vec<u8>) -> Self {
        self.body = change(self.body);
        self
    }

    /// After a while.
    pub fn after(mut self, delay: Duration) -> Self {
        self.delay = delay;
        self
    }

    /// With the connection cut after so many bytes of the body.
    pub fn cut_after(mut self, bytes: usize) -> Self {
        self.cut = Some(bytes);
        self
    }
}

type Handler = dyn Fn(&Received) -> Reply + Send + Sync;

/// A server that lives as long as this value.
pub struct Server {
    address: std::net::SocketAddr,
    stop: Arc<AtomicBool>,
    received: Arc<Mutex<Vec<Received>>>,
}

impl Server {
    /// Starts a server.
    ///
    /// # Panics
    /// If the loopback address has no port left.
    pub fn start(handler: impl Fn(&Received) -> Reply + Send + Sync + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port on the loopback address");
        let address = listener.local_addr().expect("a bound listener has an address");
        let (stop, received) = (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::new(Vec::new())));
        let (stopped, kept, handler) = (Arc::clone(&stop), Arc::clone(&received), Arc::new(handler));
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                if stopped.load(Ordering::Relaxed) {
                    break;
                }
                let Ok(stream) = stream else { continue };
                let (kept, handler) = (Arc::clone(&kept), Arc::clone(&handler));
                std::thread::spawn(move || serve(stream, &kept, &*handler));
            }
        });
        Self {
            address,
            stop,
            received,
        }
    }

    /// Its address, without a slash at the end.
    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// What it was asked so far.
    pub fn received(&self) -> Vec<Received> {
        self.received.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // Wakes the listener.
        let _ = TcpStream::connect(self.address);
    }
}

/// Serves one connection; an error ends it, which is what a client sees of a server that dies.
fn serve(stream: TcpStream, kept: &Mutex<Vec<Received>>, handler: &Handler) {
    let _ = stream.set_read_timeout(Some(Duration::from_secs(10)));
    let Ok(writer) = stream.try_clone() else { return };
    let mut reader = BufReader::new(stream);
    let mut writer = writer;
    while let Some(received) = read(&mut reader) {
        kept.lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(received.clone());
        let reply = handler(&received);
        std::thread::sleep(reply.delay);
        let mut head = format!(
            "HTTP/1.1 {} Answer\r\nContent-Length: {}\r\n",
            reply.status,
            reply.body.len()
        );
        for (name, value) in &reply.headers {
            head.push_str(&format!("{name}: {value}\r\n"));
        }
        head.push_str("\r\n");
        let body = &reply.body[..reply.cut.unwrap_or(reply.body.len()).min(reply.body.len())];
        if writer
            .write_all(head.as_bytes())
            .and_then(|()| writer.write_all(body))
            .is_err()
            || reply.cut.is_some()
        {
            return;
        }
    }
}

fn read(reader: &mut impl BufRead) -> Option<Received> {
    let mut line = String::new();
    reader.read_line(&mut line).ok()?;
    let mut words = line.split_whitespace();
    let mut received = Received {
        method: words.next()?.to_owned(),
        path: words.next()?.to_owned(),
        ..Received::default()
    };
    loop {
        let mut line = String::new();
        reader.read_line(&mut line).ok()?;
        let line = line.trim_end();
        let Some((name, value)) = line.split_once(':') else {
            break;
        };
        received.headers.push((name.to_lowercase(), value.trim().to_owned()));
    }
    if received.header("expect").is_some() {
        return None; // nobody here says “continue”
    }
    let length = received
        .header("content-length")
        .and_then(|n| n.parse().ok())
        .unwrap_or(0);
    received.body = vec![0; length];
    reader.read_exact(&mut received.body).ok()?;
    Some(received)
}
