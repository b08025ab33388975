//! The list of node types and loaders that `gear` knows. To add a node: its crate in `Cargo.toml`, its line here.

use gear_graph::Registry;

/// The nodes, value types and loaders of the `gear` binary.
pub fn registry() -> Registry {
    let mut registry = Registry::new();
    gear_image::register(&mut registry);
    gear_splat::register(&mut registry);
    gear_onnx::register(&mut registry);

    node_edge_detect::register(&mut registry);
    node_foreground::register(&mut registry);
    node_translate::register(&mut registry);
    node_log_ratio::register(&mut registry);
    node_pyramid::register(&mut registry);
    node_adaptive_gain::register(&mut registry);
    node_recompose::register(&mut registry);
    node_enhance::register(&mut registry);
    node_reconstruct::register(&mut registry);
    node_render_views::register(&mut registry);
    node_edit::register(&mut registry);
    node_refine::register(&mut registry);
    node_metrics::register(&mut registry);
    node_compare_truth::register(&mut registry);

    registry.loader::<gear_graph::ReportFile>();
    node_prompt::register(&mut registry);
    node_translate_service::register(&mut registry);
    node_edit_service::register(&mut registry);
    node_judge::register(&mut registry);

    registry
}
