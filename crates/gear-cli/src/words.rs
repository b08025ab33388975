//! What the page says about the pictures and numbers of a run, in words for those who look at paintings.

/// What the picture of an output shows; for nodes that are not known here, what their author wrote.
pub fn caption(node_type: &str, port: &str, doc: &str) -> String {
    let known = match (node_type, port) {
        ("EdgeDetect", "edges") => "Contours; white where they are strong.",
        ("Foreground", "mask") => "The mask; white is the figure. All white: the whole canvas is the subject.",
        ("Translate", "image") => "The painting translated into a style that shows light and shape.",
        ("TranslateService", "image") => "The painting as a service translated it, to show light and shape.",
        ("LogRatio", "ratio") => "Its light: red is brighter than the mean, blue is darker.",
        ("LogRatio", "smooth") => "The same light, averaged over a window.",
        ("Pyramid", "ratio") => "The light gathered from coarse and fine scales, kept within contours.",
        ("AdaptiveGain", "ratio") => "The light at the strength at which the painting gets it.",
        ("Recompose", "grounded") => "The grounded image: the painting in that light. Shape is read from it.",
        ("Recompose", "albedo") => "The painting's colours without its light.",
        ("Recompose", "luminance") => "The light that the colours are seen in.",
        ("Enhance", "image") => "The painting with enhanced contrast.",
        ("Reconstruct", "depth") => "Depth of the front; light is near.",
        ("Reconstruct", "normals") => "Where the front looks: red is right, green is up, blue is towards us.",
        _ => return doc.trim().replace('`', ""),
    };
    known.to_owned()
}

/// How the mask came to be.
pub fn mode(mode: &str) -> &'static str {
    match mode {
        "figure" => "A figure was found before a ground.",
        "relief" => "The whole canvas is the subject: no figure could be told from a ground, or none was looked for.",
        "given" => "The mask that was given.",
        "box" => "The figure inside the box that was given.",
        _ => "",
    }
}

/// Where a figure stands in the report of `Foreground`, its name, and what it says.
pub const DOUBTS: &[(&str, &str, &str)] = &[
    (
        "/confidence",
        "confidence",
        "How far the mask can be trusted, 0 to 1. If it is low or the mask is wrong, give a box or a mask.",
    ),
    ("/share", "share", "Share of the canvas inside the mask."),
    (
        "/measured/rim",
        "rim",
        "Share of the rim that is not ground; a figure stands free of it.",
    ),
    (
        "/measured/main",
        "largest part",
        "Share of the figure in its largest part; 1 is one piece.",
    ),
    ("/measured/thick", "thick", "Share of the figure that is no thin line."),
    (
        "/measured/fill",
        "fill",
        "Share of the picture inside its frame that the figure fills.",
    ),
    (
        "/measured/boxy",
        "boxy",
        "Share of its own rectangle that the figure fills; near 1 it is a panel.",
    ),
    (
        "/measured/edges",
        "on edges",
        "Share of the boundary that lies on an edge of the picture.",
    ),
    (
        "/measured/explained",
        "ground at the rim",
        "Share of the rim that the ground's colours explain.",
    ),
    (
        "/measured/sides",
        "sides",
        "The same for the third best of the four sides alone.",
    ),
    (
        "/measured/told_apart",
        "told apart",
        "Share of the ground that its colours explain better than the figure's do.",
    ),
    (
        "/measured/busy",
        "busy ground",
        "Share of the ground next to an edge; a ground is plain.",
    ),
    (
        "/measured/spanned",
        "spanned",
        "Share of the left and right rim that the figure covers; a landscape runs from side to side.",
    ),
];

/// Where a measure stands in the report of `Metrics`, its name, its unit, and what it says.
pub const MEASURES: &[(&str, &str, &str, &str)] = &[
    (
        "/vend",
        "VEND",
        "",
        "How voluminous the shape is and in how many directions it looks, 0 to 100. Rewards roundness, not correctness.",
    ),
    (
        "/ddi/average",
        "DDI, average",
        "",
        "How much fine structure the depth maps hold, 0 to 100, mean over the yaws. Noise counts as structure.",
    ),
    (
        "/niqe/views_average",
        "NIQE, views",
        "",
        "How far the rendered views are from natural photographs; lower is closer.",
    ),
    (
        "/niqe/grounded",
        "NIQE, grounded image",
        "",
        "The same of the grounded image.",
    ),
    (
        "/front/psnr_db",
        "PSNR, front view",
        " dB",
        "How exactly the front view shows the painting, within the figure.",
    ),
    (
        "/front/ssim",
        "SSIM, front view",
        "",
        "The same as similarity of structure; 1 is equal.",
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_picture_of_a_shipped_node_has_a_caption_without_internals() {
        let registry = crate::registry();
        for node in registry.nodes() {
            for port in &node.spec.outputs {
                let shown = matches!(port.value_type.name, "Image" | "Mask" | "Field");
                let words = caption(node.spec.name, port.name, port.doc);
                assert!(
                    !shown || words != port.doc.trim(),
                    "{}.{} has no caption",
                    node.spec.name,
                    port.name
                );
                assert!(!words.contains(['`', '_']) || !shown, "{words}");
            }
        }
    }

    #[test]
    fn the_author_s_words_serve_for_other_nodes() {
        assert_eq!(
            caption("Weathering", "image", " The `aged` picture. "),
            "The aged picture."
        );
    }
}
