//! A service's key is in no file, no line and no log that a run leaves; and what a service does wrong costs its node only.

use std::path::Path;
use std::process::Command;

use gear_service::testing::{Reply, Server, Studio};
use gear_tests::{Desk, Done};

const KEY: &str = "sk-never-to-be-seen-0123456789";

/// The service makes `stone`; `edges` has nothing to do with it.
const GRAPH: &str = "\
gear: 1
inputs:
  painting: {type: Image, with: {size: 64}}
nodes:
  edges: {node: EdgeDetect, in: {image: painting}}
  words: {node: Prompt, in: {image: painting}, with: {purpose: sculpture}}
  stone: {node: TranslateService, in: {image: painting, edges: edges.edges, prompt: words.prompt}, with: {agreement: -1, tries: 2}}
outputs:
  edges: edges.edges
  stone: stone.image
  asked: stone.report
";

const RUN: &[&str] = &["run", "stone.yaml", "--input", "painting=sample:vessel"];

fn with_service(desk: &Desk, server: &Server, arguments: &[&str]) -> Done {
    let mut command: Command = desk.command(arguments);
    command
        .env("GEAR_IMAGES_URL", server.url())
        .env("GEAR_IMAGES_MODEL", "sculptor")
        .env("GEAR_IMAGES_KEY", KEY)
        .env("GEAR_LOG", "trace");
    command.output().unwrap().into()
}

fn desk() -> Desk {
    let desk = Desk::new();
    desk.file("stone.yaml", GRAPH);
    desk
}

/// Files below a folder that hold the key.
fn that_hold_the_key(root: &Path) -> Vec<std::path::PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if String::from_utf8_lossy(&std::fs::read(&path).unwrap()).contains(KEY) {
                found.push(path);
            }
        }
    }
    found
}

fn grey(mut picture: gear_image::SrgbImage) -> gear_image::SrgbImage {
    picture.data_mut().iter_mut().for_each(|pixel| *pixel = [pixel[1]; 3]);
    picture
}

#[test]
fn in_nothing_that_a_run_leaves() {
    let desk = desk();
    let studio = Studio::new(grey);
    let server = Server::start(move |asked| studio.answer(asked));
    let done = with_service(&desk, &server, RUN).exits(0);
    assert!(
        server.received()[0]
            .header("authorization")
            .is_some_and(|sent| sent.contains(KEY)),
        "it was used"
    );
    let asked = gear_tests::json(&desk.path("out/asked.json"));
    assert_eq!(
        (&asked["asked"], &asked["answered"]),
        (&"service:sculptor".into(), &"sculptor-2026".into())
    );
    assert!(asked["prompt"].as_str().unwrap().contains("marble"));

    // A run that is refused says what the service said: without the key that it repeats.
    let echo = format!(r#"{{"error": {{"message": "Incorrect API key provided: {KEY}"}}}}"#);
    let rude = Server::start(move |_| Reply::json(401, &echo));
    let refused = with_service(&desk, &rude, &[RUN, &["--fresh", "stone", "--out", "refused"]].concat())
        .exits(1)
        .says("Incorrect API key provided: [key]");
    assert!(
        desk.listing("refused").iter().any(|file| file.starts_with("edges.")),
        "the rest is finished"
    );

    for text in [done.stdout, done.stderr, refused.stdout, refused.stderr] {
        assert!(!text.contains(KEY));
    }
    assert_eq!(that_hold_the_key(&desk.path("")), Vec::<std::path::PathBuf>::new());
}

#[test]
fn an_answer_is_kept_until_it_is_asked_for_afresh() {
    let desk = desk();
    let studio = Studio::new(grey);
    let server = Server::start(move |asked| studio.answer(asked));
    for (arguments, asked) in [
        (RUN.to_vec(), 1),
        (RUN.to_vec(), 1),
        ([RUN, &["--fresh", "stone"]].concat(), 2),
    ] {
        with_service(&desk, &server, &arguments).exits(0);
        assert_eq!(server.received().len(), asked);
    }
}

#[test]
fn without_a_service_the_node_says_what_to_set() {
    let desk = desk();
    desk.gear(RUN).exits(1).says("GEAR_IMAGES_URL is not set");
}
