//! The promises of the whole system, one a module. They run the binary as a user types it.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on stops and says where")]

#[path = "system/a_full_disk_leaves_no_half_file.rs"]
mod a_full_disk_leaves_no_half_file;
#[path = "system/a_key_never_shows.rs"]
mod a_key_never_shows;
#[path = "system/a_network_is_its_content.rs"]
mod a_network_is_its_content;
#[path = "system/a_new_node_compiles_and_is_known.rs"]
mod a_new_node_compiles_and_is_known;
#[path = "system/a_node_that_fails_costs_only_what_depends_on_it.rs"]
mod a_node_that_fails_costs_only_what_depends_on_it;
#[path = "system/a_pinned_output_changes_only_with_a_version.rs"]
mod a_pinned_output_changes_only_with_a_version;
#[path = "system/a_plugin_brings_nodes.rs"]
mod a_plugin_brings_nodes;
#[path = "system/a_scene_is_converted_and_rendered.rs"]
mod a_scene_is_converted_and_rendered;
#[path = "system/an_elision_changes_no_bit.rs"]
mod an_elision_changes_no_bit;
#[path = "system/an_interrupted_run_resumes.rs"]
mod an_interrupted_run_resumes;
#[path = "system/bad_input_is_refused_and_nothing_is_written.rs"]
mod bad_input_is_refused_and_nothing_is_written;
#[path = "system/every_node_bears_extreme_input.rs"]
mod every_node_bears_extreme_input;
#[path = "system/every_node_bears_the_catalogue.rs"]
mod every_node_bears_the_catalogue;
#[path = "system/every_shipped_graph_runs.rs"]
mod every_shipped_graph_runs;
#[path = "system/experiments_run_from_the_command_line.rs"]
mod experiments_run_from_the_command_line;
#[path = "system/odd_input_runs_with_a_note.rs"]
mod odd_input_runs_with_a_note;
#[path = "system/only_what_changed_runs.rs"]
mod only_what_changed_runs;
#[path = "system/people_judge_without_knowing_the_method.rs"]
mod people_judge_without_knowing_the_method;
#[path = "system/pinned_pipelines_stay_within_their_tolerance.rs"]
mod pinned_pipelines_stay_within_their_tolerance;
#[path = "system/same_bits_on_any_thread_count.rs"]
mod same_bits_on_any_thread_count;
#[path = "system/same_bits_without_cpu_features.rs"]
mod same_bits_without_cpu_features;
#[path = "system/services_stand_behind_the_same_ports.rs"]
mod services_stand_behind_the_same_ports;
#[path = "system/several_processes_share_a_store.rs"]
mod several_processes_share_a_store;
#[path = "system/the_commands_answer.rs"]
mod the_commands_answer;
#[path = "system/the_device_is_chosen.rs"]
mod the_device_is_chosen;
#[path = "system/the_samples_pass_the_gates.rs"]
mod the_samples_pass_the_gates;
#[path = "system/the_store_is_looked_after.rs"]
mod the_store_is_looked_after;

/// A graph that is done in a moment, for promises that do not depend on what is computed.
const SMALL: &str = "\
gear: 1
inputs:
  painting: {type: Image, with: {size: 64}}
nodes:
  edges:   {node: EdgeDetect, in: {image: painting}}
  ratio:   {node: LogRatio, in: {image: painting}}
  pyramid: {node: Pyramid, in: {ratio: ratio.ratio, edges: edges.edges}}
  enhance: {node: Enhance, in: {image: painting}}
outputs:
  edges: edges.edges
  ratio: pyramid.ratio
  enhanced: enhance.image
";

/// What a run put into its folder, by name: everything but the record and the page, which hold times.
fn outputs_in(out: &std::path::Path) -> std::collections::BTreeMap<std::path::PathBuf, Vec<u8>> {
    let mut found = std::collections::BTreeMap::new();
    let mut folders = vec![out.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if !path.ends_with("run.json") && !path.ends_with("report.html") {
                let bytes = std::fs::read(&path).unwrap();
                found.insert(path.strip_prefix(out).unwrap().to_path_buf(), bytes);
            }
        }
    }
    found
}

/// The main job at a size at which it takes seconds.
const MAIN: &[&str] = &[
    "run",
    "@gear",
    "--input",
    "painting=sample:vessel",
    "--set",
    "painting.size=64",
    "--set",
    "refine.color_iterations=6",
    "--set",
    "refine.iterations=14",
    "--set",
    "orbit.orbit=6",
    "--set",
    "orbit.size=48",
];
