//! Studies of a small graph.

use std::sync::Arc;

use gear_graph::{Cancel, Library, Mistakes, Run, Store};

use super::paper::{Verdict, compare};
use super::*;
use crate::testing::{ANSWER, Notes, registry};

const STUDY: &str = "\
study: 1
title: Units
graph: '@answer'
cases: {samples: {names: [one, two, three], seed: [1, 2]}}
set: {scaled.factor: 2.5}
variants:
  fine: {set: {rounded.unit: 0.5}, paper: {value: 2}}
  coarse: {label: whole, set: {rounded.unit: 2}, paper: {value: 1}}
measures:
  value: {at: rounded, better: more}
  sign: sign
groups: motif
paper: {source: nowhere, others: {guess: {value: 9}}}
";

fn library() -> Library {
    Library::holding([("answer", ANSWER.replace("FACTOR", "2"))])
}

fn read(text: &str) -> Result<Study, Mistakes> {
    Study::read("units.yaml", text, &library(), &registry(), &Notes)
}

fn with_host<T>(store: &std::path::Path, work: impl FnOnce(&Host<'_>) -> T) -> T {
    fn as_it_is(run: Run<'_>) -> Run<'_> {
        run.jobs(1)
    }
    let host = Host {
        samples: &Notes,
        store: Arc::new(Store::open(store)),
        lend: &as_it_is,
        cancel: Cancel::new(),
    };
    let worked = work(&host);
    host.store.flush();
    worked
}

#[test]
fn shared_nodes_run_once_and_a_second_study_runs_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let study = read(STUDY).unwrap();
    let forecast = with_host(folder.path(), |host| study.forecast(host));
    // Per case: scaled is shared, rounded and sign are each variant's own.
    assert_eq!((forecast.pairs, forecast.needed, forecast.stored), (12, 36, 0));
    assert_eq!((forecast.runs, forecast.may_run), (30, 0));
    assert_eq!(forecast.by_variant, [18, 12]);
    assert!(
        forecast
            .to_string()
            .contains("30 node executions instead of 36: 6 are shared"),
        "{forecast}"
    );

    let first = with_host(folder.path(), |host| study.run(host, &mut |_| {}));
    let executions = first.executions();
    assert_eq!(executions.needed, 36);
    // Signs of equal numbers are found by their values, which no forecast knows.
    assert!(executions.ran <= 30 && first.repeated == 0, "{executions:?}");
    let again = with_host(folder.path(), |host| {
        assert_eq!(study.forecast(host).runs, 0);
        study.run(host, &mut |_| {})
    });
    assert_eq!((again.executions().ran, again.executions().needed), (0, 36));
    for measure in 0..2 {
        for variant in 0..2 {
            assert_eq!(
                first.values(&study, variant, measure),
                again.values(&study, variant, measure)
            );
        }
    }
    // 2.5 · 1.1 = 2.75, to the nearest half and to the nearest two.
    assert_eq!(first.values(&study, 0, 0)[0], Some(3.0));
    assert_eq!(first.values(&study, 1, 0)[0], Some(2.0));
}

#[test]
fn a_failing_case_is_a_row_and_not_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let study = read(&STUDY.replace("[one, two, three]", "[one, none, three]")).unwrap();
    let results = with_host(folder.path(), |host| study.run(host, &mut |_| {}));
    assert_eq!(results.rows.len(), 12);
    let failed: Vec<_> = results.rows.iter().filter(|row| row.failure.is_some()).collect();
    assert_eq!(failed.len(), 4);
    assert!(failed[0].failure.as_ref().unwrap().contains("the note has no x"));
    assert_eq!(results.paired(&study, 0, 1, 0).unwrap().count, 4);
    let document = report::document(&study, &results, &[], "").markdown();
    assert!(
        document.contains("## What failed") && document.contains("none-1 · fine: node `scaled`"),
        "{document}"
    );
    let csv = results.rows_csv(&study);
    assert_eq!(csv.lines().count(), 13);
    assert!(
        csv.starts_with("case,picture,motif,seed,variant,value,sign,seconds,nodes_ran,nodes_stored,failure\n"),
        "{csv}"
    );
}

#[test]
fn an_interrupted_study_ends_early_and_goes_on_later() {
    let folder = tempfile::tempdir().unwrap();
    let study = read(STUDY).unwrap();
    let results = with_host(folder.path(), |host| {
        let cancel = host.cancel.clone();
        let mut rows = 0;
        study.run(host, &mut |step| {
            if let Step::Done { .. } = step {
                rows += 1;
                if rows == 5 {
                    cancel.raise();
                }
            }
        })
    });
    assert!(results.interrupted && results.rows.len() == 5, "{}", results.rows.len());
    let done = results.executions().ran;
    let rest = with_host(folder.path(), |host| study.run(host, &mut |_| {}));
    assert!(!rest.interrupted);
    assert!(rest.executions().ran + done <= 30);
}

#[test]
fn tables_stand_beside_the_published_numbers_and_say_what_agrees() {
    let folder = tempfile::tempdir().unwrap();
    let study = read(STUDY).unwrap();
    let results = with_host(folder.path(), |host| study.run(host, &mut |_| {}));
    let pairs = compare(&study, &results);
    assert_eq!(pairs.len(), 1);
    assert_eq!((pairs[0].larger, pairs[0].smaller), (0, 1));
    let paired = results.paired(&study, 0, 1, 0).unwrap();
    assert_eq!(pairs[0].difference, paired.mean);
    let expected = match paired.interval.unwrap() {
        i if i.low > 0.0 => Verdict::Agrees,
        i if i.high < 0.0 => Verdict::Disagrees,
        _ => Verdict::Open,
    };
    assert_eq!(pairs[0].verdict, expected);
    let text = report::document(&study, &results, &[], "made by a test").markdown();
    for says in [
        "# Units",
        "not comparable with ours",
        "value ↑",
        "published",
        "guess",
        "whole",
        "## By motif",
        "## Differences to fine",
        "What agrees in order",
        "fine > whole",
        "no output twice",
        "made by a test",
    ] {
        assert!(text.contains(says), "{says} in {text}");
    }
    let summary = results.summary_csv(&study);
    // Two variants, two measures, all cases and three motifs.
    assert_eq!(summary.lines().count(), 1 + 2 * 2 * 4, "{summary}");
    let files = report::files(&study, &results, "").unwrap();
    let names: Vec<_> = files.iter().map(|file| file.name.as_str()).collect();
    assert_eq!(
        names,
        ["rows.csv", "summary.csv", "study.md", "study.html", "study.json"]
    );
    let json: serde_json::Value = serde_json::from_slice(&files[4].bytes).unwrap();
    assert_eq!(json["rows"].as_array().unwrap().len(), 12);
    assert_eq!(json["rows"][0]["measures"]["value"], 3.0);
}

#[test]
fn every_mistake_is_told_at_once_where_the_study_says_it() {
    let text = STUDY
        .replace("rounded.unit: 0.5", "rounded.unti: 0.5")
        .replace("rounded.unit: 2}", "rounded.unit: -2}")
        .replace("names: [one, two, three]", "names: [one, tow, three]")
        .replace("groups: motif", "groups: motive")
        .replace("title:", "titel:");
    let mistakes = read(&text).err().unwrap();
    let told = mistakes.render(false);
    for says in [
        "did you mean `unit`?",
        "there is no note tow",
        "did you mean `title`?",
        "range",
        "no case has the field `motive`",
    ] {
        assert!(told.contains(says), "{says} in {told}");
    }
    let lines: Vec<_> = mistakes
        .problems()
        .iter()
        .map(|problem| mistakes.position(problem.labels[0].0))
        .collect();
    assert!(lines.iter().all(|(file, ..)| *file == "units.yaml"), "{lines:?}");
    // The misspelt parameter is shown on its own line, under its own name.
    let place = lines.iter().find(|(_, line, _)| *line == 7).unwrap();
    assert_eq!(
        place.2,
        STUDY.lines().nth(6).unwrap().find("unit").unwrap() + 1,
        "{told}"
    );
}

#[test]
fn variants_can_swap_nodes_and_graphs() {
    let text = STUDY.replace(
        "variants:\n",
        "variants:\n  bare: {nodes: {rounded: null, sign: {in: {number: scaled.number}}}, outputs: {rounded: scaled.number}}\n",
    );
    let text = text.replace("fine: {set: {rounded.unit: 0.5}", "fine: {graph: '@answer'");
    let study = read(&text).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let results = with_host(folder.path(), |host| study.run(host, &mut |_| {}));
    assert_eq!(results.values(&study, 0, 0)[0], Some(2.75));
    assert_eq!(results.values(&study, 1, 0)[0], Some(3.0));
    assert!(results.rows.iter().all(|row| row.failure.is_none()));
    let misspelt = text.replace(
        "sign: {in: {number: scaled.number}}",
        "sign: {in: {number: sacled.number}}",
    );
    let mistakes = read(&misspelt).err().unwrap();
    let told = mistakes.render(false);
    assert!(told.contains("sacled") && told.contains("units.yaml:7"), "{told}");
}
