//! A graph as SVG: layers from top to bottom, coloured by what became of each node.

mod layers;
mod straight;

use std::fmt::Write;

use layers::{Layout, layout};

/// A graph to draw.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawing {
    /// Inputs, nodes and outputs.
    pub shapes: Vec<Shape>,
    /// (from, to) as indices into `shapes`; several edges between two shapes are drawn as one.
    pub edges: Vec<(usize, usize)>,
}

/// One box of the drawing.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// The name in the graph, such as `gain`.
    pub id: String,
    /// The node type, such as `AdaptiveGain`; `input` or `output` for the graph's ends.
    pub kind: String,
    /// What became of it.
    pub standing: Standing,
    /// Shown on hovering and read by screen readers: seconds, or the reason for being left out.
    pub note: String,
}

/// What became of a node in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// An input or output of the graph.
    End,
    /// It ran.
    Ran,
    /// Its results were in the store.
    Hit,
    /// Nobody needed it.
    LeftOut,
    /// It failed.
    Failed,
    /// It needed something that failed.
    Skipped,
}

impl Standing {
    /// The CSS class and the word shown to people.
    pub fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::End => ("end", "given"),
            Self::Ran => ("ran", "ran"),
            Self::Hit => ("hit", "from the store"),
            Self::LeftOut => ("left-out", "left out"),
            Self::Failed => ("failed", "failed"),
            Self::Skipped => ("skipped", "skipped"),
        }
    }
}

impl Drawing {
    /// The drawing as an SVG element that scales with the page; colours come from the page's style sheet.
    pub fn svg(&self) -> String {
        let Layout {
            places,
            routes,
            width,
            height,
        } = layout(self.shapes.len(), &self.edges);
        let mut svg = format!(
            "<svg class=\"graph\" viewBox=\"0 0 {width:.0} {height:.0}\" style=\"max-width:{width:.0}px\" role=\"img\" \
             aria-label=\"The graph: {} boxes, {} connections\">\n",
            self.shapes.len(),
            routes.len()
        );
        for route in &routes {
            let in_the_way: Vec<_> = (0..places.len())
                .filter(|&shape| shape != route.from && shape != route.to)
                .map(|shape| places[shape])
                .collect();
            let points = straight::straighten(&route.points, &in_the_way);
            let left_out = [route.from, route.to]
                .iter()
                .any(|&end| self.shapes[end].standing == Standing::LeftOut);
            let class = if left_out { "edge faint" } else { "edge" };
            let _ = writeln!(svg, "<path class=\"{class}\" d=\"{}\"/>", straight::path(&points));
        }
        for (shape, &(x, y)) in self.shapes.iter().zip(&places) {
            let (class, word) = shape.standing.words();
            let note = if shape.standing == Standing::End {
                shape.note.clone()
            } else if shape.note.is_empty() {
                word.to_owned()
            } else {
                format!("{word}: {}", shape.note)
            };
            let (left, top) = (x - layers::BOX.0 / 2.0, y - layers::BOX.1 / 2.0);
            let _ = writeln!(
                svg,
                "<g class=\"box {class}\"><title>{} ({}), {}</title>\
                 <rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{}\" height=\"{}\" rx=\"6\"/>\
                 <text class=\"id\" x=\"{x:.1}\" y=\"{:.1}\">{}</text>\
                 <text class=\"kind\" x=\"{x:.1}\" y=\"{:.1}\">{}</text></g>",
                escape(&shape.id),
                escape(&shape.kind),
                escape(&note),
                layers::BOX.0,
                layers::BOX.1,
                y - 2.0,
                escape(&shape.id),
                y + 13.0,
                escape(&shape.kind),
            );
        }
        svg.push_str("</svg>");
        svg
    }
}

/// Text as it may stand in XML.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(id: &str, standing: Standing) -> Shape {
        Shape {
            id: id.into(),
            kind: "Kind".into(),
            standing,
            note: String::new(),
        }
    }

    #[test]
    fn every_box_and_connection_is_drawn_once() {
        let drawing = Drawing {
            shapes: vec![
                shape("a", Standing::End),
                shape("b<c", Standing::Ran),
                shape("d", Standing::LeftOut),
            ],
            edges: vec![(0, 1), (0, 1), (1, 2), (0, 2)],
        };
        let svg = drawing.svg();
        assert_eq!(svg.matches("<rect").count(), 3);
        assert_eq!(svg.matches("<path").count(), 3, "parallel edges are drawn as one");
        assert_eq!(svg.matches("edge faint").count(), 2);
        assert!(svg.contains("b&lt;c") && !svg.contains("b<c"));
    }

    #[test]
    fn an_empty_graph_draws_nothing() {
        assert!(Drawing::default().svg().starts_with("<svg"));
    }
}
