//! The shipped graphs with services run from the painting to the measured scene, and the study with a judge to its table,
//! against a server on the loopback address that speaks all three protocols.

use gear_service::testing::{Server, Studio};
use gear_tests::{Desk, Done};

/// A workflow that the server understands: it edits what is loaded.
const WORKFLOW: &str = r#"{
  "1": {"class_type": "LoadImage", "inputs": {"image": "{{image}}"}},
  "2": {"class_type": "CLIPTextEncode", "inputs": {"text": "{{prompt}}"}}
}"#;

fn run(desk: &Desk, server: &Server, more: &[&str]) -> Done {
    let sets = [
        "painting.size=64",
        "orbit.orbit=4",
        "orbit.size=48",
        "refine.color_iterations=3",
        "refine.iterations=6",
        "views.yaws=[0, 40]",
        "translate.agreement=-1",
        "edit.agreement=-1",
    ];
    let mut command = desk.command(&["run", "--input", "painting=sample:court-lady", "--quiet"]);
    command.args(more).args(sets.iter().flat_map(|set| ["--set", set]));
    command
        .env("GEAR_IMAGES_URL", server.url())
        .env("GEAR_IMAGES_MODEL", "painter");
    command.env("GEAR_COMFYUI_URL", server.url());
    command.output().unwrap().into()
}

#[test]
fn both_protocols_lead_from_the_painting_to_the_scene() {
    let desk = Desk::new();
    desk.file("workflow.json", WORKFLOW);
    let studio = Studio::new(|mut picture| {
        picture.data_mut().iter_mut().for_each(|pixel| pixel[0] *= 0.9);
        picture
    });
    let server = Server::start(move |asked| studio.answer(asked));
    let workflows = ["--input", "sculptor=workflow.json", "--input", "painter=workflow.json"];
    run(&desk, &server, &["@services/images", "--out", "images"]).exits(0);
    run(
        &desk,
        &server,
        &[&["@services/comfyui", "--out", "comfyui"][..], &workflows].concat(),
    )
    .exits(0);
    for (out, answered) in [("images", "painter-2026".into()), ("comfyui", serde_json::Value::Null)] {
        let metrics = gear_tests::json(&desk.path(out).join("metrics.json"));
        assert!(
            metrics["vend"].as_f64().is_some_and(|vend| vend > 0.0),
            "{out}: {metrics}"
        );
        let edited = gear_tests::json(&desk.path(out).join("edited_by.json"));
        let views = edited["views"].as_array().unwrap();
        assert!(views.iter().any(|view| view["answered"] == answered), "{out}: {edited}");
        assert!(
            views.iter().any(|view| view["answered"] == "the painting itself"),
            "{out}: {edited}"
        );
        assert!(
            edited["prompt"].as_str().unwrap().contains("palette"),
            "{out}: {edited}"
        );
    }
}

#[test]
fn a_study_asks_the_judge_once_a_picture_and_has_a_row_for_every_method() {
    let desk = Desk::new();
    let studio = Studio::new(|picture| picture);
    let server = Server::start(move |asked| studio.answer(asked));
    desk.gear(&["graphs", "copy", "studies/table-2"]).exits(0);
    let study = std::fs::read_to_string(desk.path("studies/table-2.yaml")).unwrap();
    let small = "{painting.size: 64, refine.color_iterations: 3, refine.iterations: 6, views.yaws: [0, 40], \
                 restored.yaws: [0, 40], plain_views.yaws: [0, 40], judge.votes: 3, judge.size: 32}";
    let few = study
        .replace("{painting.size: 256}", small)
        .replace("[court-lady, vessel, landscape-relief]", "[court-lady, vessel]");
    desk.file("table-2.yaml", few);
    let run = |name: &str| -> Done {
        let mut command = desk.command(&["study", "table-2.yaml", "--out", name]);
        command
            .env("GEAR_CHAT_URL", server.url())
            .env("GEAR_CHAT_MODEL", "judge");
        let done = Done::from(command.output().unwrap());
        done.exits(0)
    };
    run("first");
    assert_eq!(server.received().len(), 6, "three votes for each of two pictures");
    let table = std::fs::read_to_string(desk.path("first/study.md")).unwrap();
    let rows: Vec<_> = table.lines().filter(|line| line.contains('|')).take(7).collect();
    for (row, expected) in rows.iter().zip([
        "TF ↑",
        "---",
        "SplatterImage",
        "LGM",
        "the reconstructor alone",
        "without",
        "with",
    ]) {
        assert!(row.contains(expected), "{table}");
    }
    assert!(
        rows[6].contains("8.71") && rows[6].contains(" ± "),
        "ours beside the published: {table}"
    );
    run("again");
    assert_eq!(server.received().len(), 6, "what was judged is kept");
}
