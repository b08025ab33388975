//! Against a server on the loopback address.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use gear_graph::testing::InMemory;
use gear_image::SrgbImage;
use gear_service::Endpoint;
use gear_service::testing::{Received, Reply, Server};
use gear_splat::{Camera, View};
use serde_json::{Value, json};

use super::*;

fn views(tone: f32) -> Arc<Views> {
    let view = |name: &str| View {
        rgb: SrgbImage::filled(20, 20, [tone; 3]),
        alpha: None,
        depth: None,
        normal: None,
        weight: None,
        camera: Camera::front(20, 20),
        name: name.to_owned(),
    };
    Arc::new(Views {
        views: vec![view("a"), view("b")],
    })
}

fn inputs(methods: usize) -> In {
    In {
        painting: Arc::new(Image {
            rgb: SrgbImage::filled(30, 40, [0.5; 3]),
            alpha: None,
        }),
        views: (0..methods).map(|i| views(0.2 + 0.3 * i as f32)).collect(),
    }
}

/// Scores each candidate by how bright its strip is: the pictures really arrive, in the order that the node drew.
fn by_brightness(asked: &Received) -> Reply {
    use base64::Engine;
    let body: Value = serde_json::from_slice(&asked.body).unwrap();
    let parts = body["messages"][1]["content"].as_array().unwrap();
    let pictures = parts.iter().filter_map(|part| part["image_url"]["url"].as_str());
    let mut answer = serde_json::Map::new();
    for (i, url) in pictures.skip(1).enumerate() {
        let coded = url.strip_prefix("data:image/png;base64,").unwrap();
        let png = base64::engine::general_purpose::STANDARD.decode(coded).unwrap();
        let loaded = gear_image::io::decode_image(&mut std::io::Cursor::new(png), None, &Default::default()).unwrap();
        let score = (f64::from(loaded.image.rgb.at(2, 2)[0]) * 10.0).round();
        answer.insert(
            tally::LETTERS[i].to_owned(),
            json!({"TF": score, "GA": score, "VC": score, "AC": score}),
        );
    }
    said(&Value::Object(answer).to_string())
}

fn said(text: &str) -> Reply {
    Reply::json(
        200,
        &json!({"model": "judge-1", "choices": [{"message": {"content": text}}]}).to_string(),
    )
}

fn ctx(server: &Server) -> Context {
    let endpoint = Endpoint::new(&server.url(), "judge", None).unwrap();
    Context::detached().with_resources(Resources::default().with(Services::default().with(Kind::Chat, endpoint)))
}

fn judge() -> Judge {
    Judge {
        methods: vec!["raw".into(), "he".into(), "ours".into()],
        size: 32,
        ..Judge::default()
    }
}

#[test]
fn methods_get_their_own_scores_whatever_the_order() {
    let server = Server::start(by_brightness);
    let out = judge().run(inputs(3), &Want::all::<Out>(), &ctx(&server)).unwrap();
    let report = &out.report.0;
    let scores: Vec<f64> = (0..3).map(|i| report["methods"][i]["mean"].as_f64().unwrap()).collect();
    assert_eq!(scores, [2.0, 5.0, 8.0]);
    assert_eq!(report["votes"].as_array().unwrap().len(), 6);
    assert_eq!(report["votes"][0]["answered"], "judge-1");
    let body = String::from_utf8(server.received()[0].body.clone()).unwrap();
    assert!(!body.contains("ours") && !body.contains("raw"), "the judge is blind");
    assert!(body.contains("\"temperature\":0.0"), "{body}");
    let free = Judge {
        temperature: OrAuto::Auto,
        votes: 1,
        ..judge()
    };
    assert!(free.run(inputs(3), &Want::all::<Out>(), &ctx(&server)).is_ok());
    let last = server.received().pop().unwrap();
    assert!(!String::from_utf8(last.body).unwrap().contains("temperature"));
}

#[test]
fn a_useless_answer_is_sent_back_and_given_up_in_the_end() {
    let tries = AtomicUsize::new(0);
    let server = Server::start(move |asked| match tries.fetch_add(1, Ordering::SeqCst) {
        0 => said("I like C."),
        _ => by_brightness(asked),
    });
    let one = Judge { votes: 1, ..judge() };
    assert!(one.run(inputs(3), &Want::all::<Out>(), &ctx(&server)).is_ok());
    let again = String::from_utf8(server.received()[1].body.clone()).unwrap();
    assert!(again.contains("I like C.") && again.contains("no JSON object"));

    let server = Server::start(|_| said("{}"));
    let error = one
        .run(inputs(3), &Want::all::<Out>(), &ctx(&server))
        .err()
        .unwrap()
        .to_string();
    assert!(error.contains("after 3 tries") && error.contains("`A`.`TF`"), "{error}");
}

#[test]
fn votes_of_an_interrupted_run_count() {
    let tries = AtomicUsize::new(0);
    let server = Server::start(move |asked| match tries.fetch_add(1, Ordering::SeqCst) {
        4 => Reply::json(401, "{}"),
        _ => by_brightness(asked),
    });
    let ctx = ctx(&server).with_unfinished(Arc::new(InMemory::default()), Duration::ZERO);
    assert!(judge().run(inputs(3), &Want::all::<Out>(), &ctx).is_err());
    assert!(judge().run(inputs(3), &Want::all::<Out>(), &ctx).is_ok());
    assert_eq!(server.received().len(), 4 + 1 + 2);
}

#[test]
fn names_and_wires_must_fit() {
    let run = |judge: Judge, methods| judge.run(inputs(methods), &Want::all::<Out>(), &Context::detached());
    assert!(
        run(judge(), 2)
            .err()
            .unwrap()
            .to_string()
            .contains("3 names for 2 wires")
    );
    assert!(
        run(Judge::default(), 1)
            .err()
            .unwrap()
            .to_string()
            .contains("found 1 methods")
    );
}
