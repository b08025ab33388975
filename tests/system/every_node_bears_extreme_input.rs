//! Every registered node type, with its default parameters and with each method of each of its choices, gives an answer
//! or an error on every two of the extreme cases that the types of its inputs declare: no panic, no hang, no NaN where
//! the type forbids it, the same on one thread and on many. A node that is registered is tested here, whatever its
//! author has tested.

use std::panic::catch_unwind;

use gear_graph::testing;
use serde_json::json;

/// Parameters of nodes that take long with their defaults.
fn quick(node: &str) -> serde_json::Value {
    match node {
        "CompareTruth" => json!({"yaws": [30.0], "size": 24}),
        "Metrics" => json!({"ddi_yaws": [30.0], "ddi_size": 32, "view_yaws": [0.0, 45.0]}),
        "Refine" => json!({"iterations": 8, "color_iterations": 4}),
        "RenderViews" => json!({"size": 32}),
        _ => json!({}),
    }
}

#[test]
fn every_registered_node_answers_or_fails_with_an_error() {
    let registry = gear_cli::registry();
    let complaint = |node| {
        let cause = catch_unwind(|| testing::assert_type(node, &quick(node.spec.name))).err()?;
        Some(cause.downcast_ref::<String>().cloned().unwrap_or_default())
    };
    let complaints: Vec<_> = registry.nodes().filter_map(complaint).collect();
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn every_type_of_value_declares_extremes() {
    for value in gear_cli::registry().values() {
        assert!(value.extremes().len() >= 4, "{} declares too few extremes", value.name);
    }
}
