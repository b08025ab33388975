//! The shipped graphs with services run from the painting to the measured scene, against a server on the loopback
//! address that speaks both protocols.

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
