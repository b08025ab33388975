//! The page of a run.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use minijinja::syntax::SyntaxConfig;
use minijinja::{Environment, Value, context};

use crate::drawing::Drawing;
use crate::picture::Picture;
use crate::plot::Curve;

/// Above this many boxes a drawing says nothing; the page then leaves it out.
const MOST_BOXES: usize = 400;

/// What a page shows. Empty parts are left out of the page.
#[derive(Clone, Debug, Default)]
pub struct Page {
    /// The heading.
    pub title: String,
    /// One line under the heading.
    pub subtitle: String,
    /// Short facts beside the heading: (label, value), such as (Gaussians, 41,203).
    pub facts: Vec<(String, String)>,
    /// What went wrong, shown first.
    pub problems: Vec<String>,
    /// The graph with what became of its nodes.
    pub graph: Drawing,
    /// Nodes that were left out, with the reasons.
    pub left_out: Vec<Row>,
    /// The picture after every stage, in the order of the data.
    pub stages: Vec<Figure>,
    /// How sure the mask is, and what was measured to tell.
    pub mask: Vec<Measure>,
    /// Views seen from the same camera, one [`Comparison`] a camera.
    pub comparisons: Vec<Comparison>,
    /// Frames of a full turn, evenly spaced.
    pub orbit: Vec<Picture>,
    /// How the refinement went.
    pub curve: Curve,
    /// The measured numbers.
    pub measures: Vec<Measure>,
    /// Time and memory of each node.
    pub costs: Vec<Cost>,
    /// The last lines: versions, platform.
    pub colophon: String,
}

/// A picture with its words.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Where it comes from, such as `recompose.grounded`.
    pub source: String,
    /// What it is, in a sentence.
    pub caption: String,
    /// What the colours mean, from blue to red, where they are not the picture's own: the values at both ends.
    pub legend: Option<(String, String)>,
    /// The picture.
    pub picture: Picture,
}

/// The same camera, several scenes.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// The camera, such as `yaw +30°`.
    pub camera: String,
    /// What each picture shows, and the picture.
    pub pictures: Vec<(String, Picture)>,
}

/// A number with its meaning.
#[derive(Clone, Debug)]
pub struct Measure {
    /// The name, such as `VEND`.
    pub name: String,
    /// The value with its unit, or a word for "undefined".
    pub value: String,
    /// What the number says and which way is better.
    pub meaning: String,
}

/// A row of the table of costs.
#[derive(Clone, Debug)]
pub struct Cost {
    /// The node.
    pub node: String,
    /// What became of it.
    pub standing: crate::Standing,
    /// Wall-clock seconds of the run that made its results.
    pub seconds: Option<f64>,
    /// Peak memory in bytes while it ran.
    pub peak_bytes: Option<u64>,
    /// Bytes of its results.
    pub result_bytes: Option<u64>,
}

/// A name and a sentence.
#[derive(Clone, Debug)]
pub struct Row {
    /// The name.
    pub name: String,
    /// The sentence.
    pub text: String,
}

/// The page could not be rendered.
#[derive(Debug, thiserror::Error)]
#[error("the report page cannot be rendered: {0}")]
pub struct PageError(#[from] minijinja::Error);

/// A picture as the template sees it. The data URI is safe as it is: base64 needs no escaping.
fn embed(picture: &Picture) -> Value {
    let mime = picture.format.mime();
    let uri = format!("data:{mime};base64,{}", STANDARD.encode(&picture.bytes));
    context! {
        uri => Value::from_safe_string(uri),
        width => picture.width,
        height => picture.height,
    }
}

fn list(items: impl Iterator<Item = Value>) -> Value {
    items.collect()
}

fn seconds(seconds: Option<f64>) -> String {
    seconds.map_or_else(|| "–".to_owned(), |s| format!("{s:.2}"))
}

fn mebibytes(bytes: Option<u64>) -> String {
    bytes.map_or_else(|| "–".to_owned(), |b| format!("{:.1}", b as f64 / f64::from(1 << 20)))
}

impl Page {
    /// The whole page as one HTML file.
    pub fn render(&self) -> Result<String, PageError> {
        let mut environment = Environment::new();
        environment.set_syntax(SyntaxConfig::builder().trim_blocks(true).lstrip_blocks(true).build()?);
        environment.add_template("page.html", include_str!("page/page.html"))?;
        let graph = (1..=MOST_BOXES)
            .contains(&self.graph.shapes.len())
            .then(|| self.graph.svg());
        let facts = self
            .facts
            .iter()
            .map(|(name, value)| context! { name => name.as_str(), value => value.as_str() });
        let stages = self.stages.iter().map(|figure| {
            context! {
                source => figure.source.as_str(),
                caption => figure.caption.as_str(),
                legend => figure.legend.as_ref().map(|(low, high)| context! { low => low.as_str(), high => high.as_str() }),
                picture => embed(&figure.picture),
            }
        });
        let comparisons = self.comparisons.iter().map(|comparison| {
            let pictures = comparison.pictures.iter();
            let pictures =
                pictures.map(|(what, picture)| context! { what => what.as_str(), picture => embed(picture) });
            context! { camera => comparison.camera.as_str(), pictures => list(pictures) }
        });
        let measured = |measures: &[Measure]| {
            list(measures.iter().map(|measure| {
                context! {
                    name => measure.name.as_str(),
                    value => measure.value.as_str(),
                    meaning => measure.meaning.as_str(),
                }
            }))
        };
        let costs = self.costs.iter().map(|cost| {
            let (class, word) = cost.standing.words();
            context! {
                node => cost.node.as_str(),
                class => class,
                word => word,
                seconds => seconds(cost.seconds),
                peak => mebibytes(cost.peak_bytes),
                size => mebibytes(cost.result_bytes),
            }
        });
        let left_out = self.left_out.iter();
        let left_out = left_out.map(|row| context! { name => row.name.as_str(), text => row.text.as_str() });
        let html = environment.get_template("page.html")?.render(context! {
            title => self.title.as_str(),
            subtitle => self.subtitle.as_str(),
            facts => list(facts),
            problems => list(self.problems.iter().map(|problem| Value::from(problem.as_str()))),
            style => Value::from_safe_string(include_str!("page/style.css").to_owned()),
            script => Value::from_safe_string(include_str!("page/orbit.js").to_owned()),
            orbit => list(self.orbit.iter().map(embed)),
            comparisons => list(comparisons),
            stages => list(stages),
            graph => graph.map(Value::from_safe_string),
            left_out => list(left_out),
            curve => self.curve.svg().map(Value::from_safe_string),
            quantity => self.curve.quantity.as_str(),
            measures => measured(&self.measures),
            mask => measured(&self.mask),
            costs => list(costs),
            colophon => self.colophon.as_str(),
        })?;
        Ok(html)
    }
}

#[cfg(test)]
mod tests;
