//! Both picture protocols and the chat, spoken to a real server on the loopback address that misbehaves on demand.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on stops and says where")]

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use gear_graph::testing::InMemory;
use gear_graph::{Context, Resources};
use gear_image::SrgbImage;
use gear_service::testing::{Received, Reply, Server, Studio};
use gear_service::{Asked, Edited, Editor, Endpoint, Kind, Policy, Service, Services};
use serde_json::{Value, json};

type Handler = dyn Fn(&Received) -> Reply + Send + Sync;

const KEY: &str = "sk-very-secret-key";

fn picture() -> SrgbImage {
    SrgbImage::from_fn(48, 40, |x, y| {
        let (dx, dy) = (x as f32 - 20.0, y as f32 - 22.0);
        let inside = dx * dx + dy * dy < 150.0;
        if inside { [0.7, 0.2, 0.1] } else { [0.9, 0.88, 0.8] }
    })
}

fn grey(mut picture: SrgbImage) -> SrgbImage {
    for pixel in picture.data_mut() {
        *pixel = [pixel.iter().sum::<f32>() / 3.0; 3];
    }
    picture
}

fn quick() -> Policy {
    Policy {
        timeout: Duration::from_millis(800),
        pause: Duration::from_millis(5),
        ..Policy::default()
    }
}

fn lent(server: &Server, kind: Kind) -> Context {
    let endpoint = Endpoint::new(&server.url(), "painter", Some(KEY.to_owned())).unwrap();
    Context::detached().with_resources(Resources::default().with(Services::default().with(kind, endpoint)))
}

fn workflow() -> Value {
    json!({
        "1": {"class_type": "LoadImage", "inputs": {"image": "{{image}}"}},
        "2": {"class_type": "CLIPTextEncode", "inputs": {"text": "{{prompt}}"}},
        "3": {"class_type": "KSampler", "inputs": {"seed": "{{seed}}"}},
    })
}

fn asked(picture: &SrgbImage) -> Asked<'_> {
    Asked {
        picture,
        edges: None,
        inside: None,
        prompt: "a marble sculpture",
        seed: 3,
        agreement: 0.3,
        name: "front",
    }
}

fn edit_in(ctx: &Context, service: &Service) -> Result<Edited, String> {
    let interrupted = || ctx.is_cancelled();
    let workflow = workflow();
    let editor = Editor::open(service, Some(&workflow), quick(), ctx, &interrupted).map_err(|e| e.to_string())?;
    editor.edit(&asked(&picture())).map_err(|e| e.to_string())
}

fn images(handler: impl Fn(&Received) -> Reply + Send + Sync + 'static) -> (Server, Result<Edited, String>) {
    let server = Server::start(handler);
    let edited = edit_in(&lent(&server, Kind::Images), &Service::images());
    (server, edited)
}

/// What the error says; it never says the key.
fn says(edited: &Result<Edited, String>) -> &str {
    let error = edited.as_ref().expect_err("the edit failed");
    assert!(!error.contains(KEY), "{error}");
    error
}

#[test]
fn an_edit_comes_back_with_the_model_that_made_it() {
    let studio = Studio::new(grey);
    let (server, edited) = images(move |asked| studio.answer(asked));
    let edited = edited.unwrap();
    assert_eq!(
        (edited.picture.size(), edited.model.as_deref()),
        ((48, 40), Some("painter-2026"))
    );
    assert!(edited.agreement > 0.8);
    let asked = &server.received()[0];
    assert_eq!(asked.header("authorization"), Some(&*format!("Bearer {KEY}")));
    assert_eq!(asked.field("prompt").unwrap(), b"a marble sculpture");
    assert_eq!(asked.field("model").unwrap(), b"painter");
    assert_eq!(asked.field("seed"), None, "not every service knows it");
}

#[test]
fn a_workflow_is_uploaded_queued_polled_and_fetched() {
    let studio = Studio::new(grey);
    let polls = AtomicUsize::new(0);
    let server = Server::start(move |asked| {
        if asked.path.starts_with("/history/") && polls.fetch_add(1, Ordering::SeqCst) < 2 {
            return Reply::json(200, "{}");
        }
        studio.answer(asked)
    });
    let service = Service::ComfyUi {
        poll: 0.01,
        patience: 5.0,
    };
    let edited = edit_in(&lent(&server, Kind::ComfyUi), &service).unwrap();
    assert_eq!(edited.picture.size(), (48, 40));
    let paths: Vec<String> = server
        .received()
        .iter()
        .map(|r| r.path.split(['?']).next().unwrap().to_owned())
        .collect();
    assert_eq!(paths.iter().filter(|path| path.starts_with("/history/")).count(), 3);
    assert_eq!((paths[0].as_str(), paths[1].as_str()), ("/upload/image", "/prompt"));
    let queued: Value = serde_json::from_slice(&server.received()[1].body).unwrap();
    assert_eq!(queued["prompt"]["2"]["inputs"]["text"], "a marble sculpture");
    assert_eq!(queued["prompt"]["3"]["inputs"]["seed"], 3);
}

#[test]
fn a_job_that_fails_or_never_ends_is_an_error() {
    let service = Service::ComfyUi {
        poll: 0.01,
        patience: 1.0,
    };
    for (history, expected) in [
        ("{}", "no picture after 1 s"),
        (
            r#"{"ID": {"status": {"status_str": "error", "messages": ["out of memory"]}}}"#,
            "out of memory",
        ),
        (
            r#"{"ID": {"outputs": {}, "status": {"completed": true}}}"#,
            "a job without a picture",
        ),
    ] {
        let studio = Studio::new(grey);
        let server = Server::start(move |asked| match asked.path.strip_prefix("/history/") {
            Some(id) => Reply::json(200, &history.replace("ID", id)),
            None => studio.answer(asked),
        });
        let edited = edit_in(&lent(&server, Kind::ComfyUi), &service);
        assert!(says(&edited).contains(expected), "{edited:?}");
    }
}

#[test]
fn what_passes_is_waited_for() {
    for (status, retry_after) in [
        (429, Some("0.02")),
        (500, None),
        (503, Some("0")),
        (503, Some("Sun, 06 Nov 1994 08:49:37 GMT")),
        (408, None),
    ] {
        let (studio, tries) = (Studio::new(grey), AtomicUsize::new(0));
        let (server, edited) = images(move |asked| {
            if tries.fetch_add(1, Ordering::SeqCst) < 2 {
                let reply = Reply::json(status, r#"{"error": {"message": "busy"}}"#);
                return retry_after.map_or(reply.clone(), |value| reply.with("Retry-After", value));
            }
            studio.answer(asked)
        });
        assert!(edited.is_ok(), "{status}: {edited:?}");
        assert_eq!(server.received().len(), 3);
    }
}

#[test]
fn what_does_not_pass_is_told_at_once() {
    for status in [400, 401, 403, 404, 422] {
        let echo = format!(r#"{{"error": {{"message": "the key {KEY} is no good"}}}}"#);
        let (server, edited) = images(move |_| Reply::json(status, &echo));
        let error = says(&edited).to_owned();
        assert!(
            error.contains(&status.to_string()) && error.contains("the key [key] is no good"),
            "{error}"
        );
        assert_eq!(server.received().len(), 1);
    }
}

#[test]
fn a_server_that_stays_busy_is_given_up() {
    let (server, edited) = images(|_| Reply::json(500, ""));
    assert!(says(&edited).contains("answered 500"), "{edited:?}");
    assert_eq!(server.received().len(), 4);
    let (server, edited) = images(|_| Reply::json(429, "").with("Retry-After", "86400"));
    assert!(says(&edited).contains("answered 429"), "{edited:?}");
    assert_eq!(server.received().len(), 1, "nobody waits a day");
    let (server, edited) = images(|_| {
        Reply::json(503, "")
            .with("Date", "Sun, 06 Nov 1994 08:49:37 GMT")
            .with("Retry-After", "Mon, 07 Nov 1994 08:49:37 GMT")
    });
    assert!(says(&edited).contains("answered 503"), "{edited:?}");
    assert_eq!(server.received().len(), 1, "nor until tomorrow");
}

#[test]
fn a_connection_that_is_cut_or_slow_is_tried_again() {
    for slow in [false, true] {
        let (studio, tries) = (Studio::new(grey), AtomicUsize::new(0));
        let (server, edited) = images(move |asked| {
            let reply = studio.answer(asked);
            match (tries.fetch_add(1, Ordering::SeqCst), slow) {
                (0, true) => reply.after(Duration::from_secs(2)),
                (0, false) => reply.cut_after(100),
                _ => reply,
            }
        });
        assert!(edited.is_ok(), "{edited:?}");
        assert_eq!(server.received().len(), 2);
    }
}

#[test]
fn an_answer_that_is_no_picture_of_ours_is_refused() {
    let coded = |bytes: &[u8]| {
        use base64::Engine;
        let coded = base64::engine::general_purpose::STANDARD.encode(bytes);
        json!({"data": [{"b64_json": coded}]}).to_string()
    };
    let blank = Studio::new(|picture| SrgbImage::filled(picture.width(), picture.height(), [0.5; 3]));
    let mirrored = Studio::new(|picture| {
        SrgbImage::from_fn(picture.width(), picture.height(), |x, y| {
            if (x / 4 + y / 4) % 2 == 0 { [0.1; 3] } else { [0.9; 3] }
        })
    });
    // A header that claims 100,000² pixels, and nothing behind it.
    let bomb = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\x01\x86\xa0\0\x01\x86\xa0\x08\x02\0\0\0";
    let wide = Studio::new(|_| SrgbImage::filled(400, 100, [0.5; 3]));
    let cases: Vec<(Box<Handler>, &str)> = vec![
        (
            Box::new(|_| Reply::new(200, "text/html", "<html>login</html>")),
            "`text/html` that is no JSON",
        ),
        (Box::new(|_| Reply::json(200, "{}")), "JSON without a picture"),
        (
            Box::new(|_| Reply::json(200, r#"{"data": [{"b64_json": "***"}]}"#)),
            "no base64",
        ),
        (
            Box::new(move |_| Reply::json(200, &coded(b"GIF89a"))),
            "no usable picture",
        ),
        (Box::new(move |_| Reply::json(200, &coded(bomb))), "no usable picture"),
        (Box::new(move |asked| blank.answer(asked)), "lost the picture's layout"),
        (
            Box::new(move |asked| mirrored.answer(asked)),
            "lost the picture's layout",
        ),
        (Box::new(move |asked| wide.answer(asked)), "proportions differ"),
        (
            Box::new(|_| Reply::json(200, r#"{"data": [{"url": "https://elsewhere.example/a.png"}]}"#)),
            "a link to another host",
        ),
        (Box::new(|_| Reply::json(200, "").with("X", "y")), "no JSON"),
    ];
    for (handler, expected) in cases {
        let (_server, edited) = images(handler);
        assert!(says(&edited).contains(expected), "{expected}: {edited:?}");
    }
}

#[test]
fn a_key_that_the_answer_repeats_is_not_kept() {
    let studio = Studio::new(grey);
    let (_server, edited) = images(move |asked| {
        let reply = studio.answer(asked);
        reply.map_body(|body| {
            let text = String::from_utf8(body).unwrap();
            assert!(text.contains("painter-2026"));
            text.replace("painter-2026", KEY).into_bytes()
        })
    });
    assert_eq!(edited.unwrap().model.as_deref(), Some("[key]"));
}

#[test]
fn a_huge_answer_is_not_read() {
    let server = Server::start(|_| Reply::json(200, &" ".repeat(300_000)));
    let ctx = lent(&server, Kind::Images);
    let interrupted = || false;
    let policy = Policy {
        largest: 100_000,
        ..quick()
    };
    let editor = Editor::open(&Service::images(), None, policy, &ctx, &interrupted).unwrap();
    let error = editor.edit(&asked(&picture())).unwrap_err().to_string();
    assert!(error.contains("more than 100000 bytes"), "{error}");
}

#[test]
fn a_redirect_to_another_host_takes_no_key_along() {
    let other = Arc::new(Server::start(|_| Reply::json(200, "{}")));
    let target = format!("{}/images/edits", other.url());
    let (_server, edited) = images(move |_| Reply::json(307, "").with("Location", &target));
    assert!(says(&edited).contains("sends us on to 127.0.0.1"), "{edited:?}");
    assert!(other.received().is_empty());
}

/// A server with a certificate that it signed itself; what was sent to it after a handshake, if there was one.
fn self_signed() -> (String, std::thread::JoinHandle<Vec<u8>>) {
    use std::io::Read;
    let certificate = include_bytes!("self_signed/certificate.der").to_vec().into();
    let key = rustls::pki_types::PrivatePkcs8KeyDer::from(include_bytes!("self_signed/key.der").to_vec());
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = rustls::ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_no_client_auth()
        .with_single_cert(vec![certificate], key.into())
        .unwrap();
    let config = Arc::new(config);
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("https://{}", listener.local_addr().unwrap());
    let heard = std::thread::spawn(move || {
        let (stream, _) = listener.accept().unwrap();
        let connection = rustls::ServerConnection::new(config).unwrap();
        let mut said = Vec::new();
        let _ = rustls::StreamOwned::new(connection, stream).read_to_end(&mut said);
        said
    });
    (url, heard)
}

#[test]
fn a_certificate_that_nobody_vouches_for_is_refused_and_hears_nothing() {
    let (url, heard) = self_signed();
    let endpoint = Endpoint::new(&url, "painter", Some(KEY.to_owned())).unwrap();
    let resources = Resources::default().with(Services::default().with(Kind::Images, endpoint));
    let edited = edit_in(&Context::detached().with_resources(resources), &Service::images());
    assert!(says(&edited).contains("UnknownIssuer"), "{edited:?}");
    assert_eq!(heard.join().unwrap(), b"");
}

#[test]
fn nobody_there_is_told_with_the_address() {
    let url = Server::start(|_| Reply::json(200, "")).url();
    let endpoint = Endpoint::new(&url, "painter", None).unwrap();
    let ctx =
        Context::detached().with_resources(Resources::default().with(Services::default().with(Kind::Images, endpoint)));
    // The server is gone; its port may take a moment to close.
    std::thread::sleep(Duration::from_millis(100));
    let edited = edit_in(&ctx, &Service::images());
    let error = says(&edited);
    assert!(error.contains("did not answer") && error.contains(&url), "{error}");
}

#[test]
fn without_an_address_one_learns_which_variable_to_set() {
    let services = Services::from_env(&|_| None);
    let ctx = Context::detached().with_resources(Resources::default().with(services));
    let edited = edit_in(&ctx, &Service::images());
    assert!(says(&edited).contains("GEAR_IMAGES_URL is not set"), "{edited:?}");
}

#[test]
fn an_interruption_ends_the_waiting() {
    let flag = Arc::new(std::sync::atomic::AtomicBool::new(false));
    let raise = Arc::clone(&flag);
    let server = Server::start(move |_| {
        raise.store(true, Ordering::SeqCst);
        Reply::json(503, "").with("Retry-After", "30")
    });
    let endpoint = Endpoint::new(&server.url(), "painter", None).unwrap();
    let ctx = Context::new(flag, None, 0)
        .with_resources(Resources::default().with(Services::default().with(Kind::Images, endpoint)));
    let started = Instant::now();
    let edited = edit_in(&ctx, &Service::images());
    assert_eq!(says(&edited), "interrupted");
    assert!(
        started.elapsed() < Duration::from_secs(20),
        "it did not wait for the server's time"
    );
}

#[test]
fn a_server_that_takes_its_time_holds_up_no_interruption() {
    let flag = Arc::new(std::sync::atomic::AtomicBool::new(false));
    let raise = Arc::clone(&flag);
    let server = Server::start(move |_| {
        raise.store(true, Ordering::SeqCst);
        Reply::json(200, "{}").after(Duration::from_secs(30))
    });
    let endpoint = Endpoint::new(&server.url(), "painter", None).unwrap();
    let ctx = Context::new(flag, None, 0)
        .with_resources(Resources::default().with(Services::default().with(Kind::Images, endpoint)));
    let interrupted = || ctx.is_cancelled();
    let patient = Policy {
        timeout: Duration::from_secs(60),
        ..quick()
    };
    let editor = Editor::open(&Service::images(), None, patient, &ctx, &interrupted).unwrap();
    let started = Instant::now();
    let picture = picture();
    let error = editor.edit(&asked(&picture)).unwrap_err().to_string();
    assert_eq!(error, "interrupted");
    assert!(started.elapsed() < Duration::from_secs(10), "{:?}", started.elapsed());
}

#[test]
fn an_answer_that_was_paid_for_is_remembered() {
    let studio = Studio::new(grey);
    let server = Server::start(move |asked| studio.answer(asked));
    let ctx = lent(&server, Kind::Images).with_unfinished(Arc::new(InMemory::default()), Duration::ZERO);
    let first = edit_in(&ctx, &Service::images()).unwrap();
    let second = edit_in(&ctx, &Service::images()).unwrap();
    assert_eq!((first.remembered, second.remembered), (false, true));
    assert_eq!((second.picture, second.model), (first.picture, first.model));
    assert_eq!(server.received().len(), 1);
}
