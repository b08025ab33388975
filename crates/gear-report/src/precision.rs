//! Work–precision diagrams: error against cost, both logarithmic, as SVG that stands alone.

mod labels;

use std::fmt::Write;

use labels::Labels;

/// A diagram.
#[derive(Clone, Debug, Default)]
pub struct Diagram {
    /// What is drawn.
    pub title: String,
    /// The abscissa with its unit, such as `seconds`.
    pub cost: String,
    /// The ordinate with its unit, such as `rms of R_ms`; what follows `, against ` stands under the title.
    pub error: String,
    /// The points.
    pub points: Vec<Point>,
}

/// A setting that was measured.
#[derive(Clone, Debug)]
pub struct Point {
    /// Its name, such as `K = 4`.
    pub label: String,
    /// Its cost, above 0.
    pub cost: f64,
    /// Its error, not below 0; 0 is drawn on the lower rim.
    pub error: f64,
    /// Points of one family are joined by a line, in their order.
    pub family: String,
    /// Whether no other point is better in both.
    pub front: bool,
    /// Whether this is what is shipped.
    pub default: bool,
}

const SIZE: (f64, f64) = (720.0, 440.0);
/// Left, top, right, bottom.
const MARGIN: (f64, f64, f64, f64) = (78.0, 44.0, 24.0, 56.0);
/// Colours of families: told apart also by those who do not see red and green (Okabe and Ito).
const COLOURS: [&str; 7] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#2a2824",
];

/// Styles of the file itself: it is shown where no style sheet is.
const STYLE: &str = "text{font-family:system-ui,-apple-system,'Segoe UI',Roboto,sans-serif;font-size:12px;fill:#55504a}\
.t{font-size:14px;fill:#2a2824;font-weight:600}.m{text-anchor:middle}.e{text-anchor:end}.g{stroke:#e2dccf;fill:none}\
.f{fill:none;stroke:#2a2824;stroke-width:1;stroke-dasharray:5 4}.l{fill:none;stroke-width:1.6;opacity:.55}.n{font-size:11px}";

impl Diagram {
    /// The diagram as an SVG file; `None` when nothing can be drawn on logarithmic axes.
    pub fn svg(&self) -> Option<String> {
        let drawable = |point: &&Point| {
            point.cost > 0.0 && point.cost.is_finite() && point.error >= 0.0 && point.error.is_finite()
        };
        let points: Vec<&Point> = self.points.iter().filter(drawable).collect();
        let positive = points.iter().map(|p| p.error).filter(|e| *e > 0.0);
        let least = positive.clone().fold(f64::INFINITY, f64::min);
        if points.is_empty() {
            return None;
        }
        let exact = points.iter().any(|p| p.error == 0.0);
        // What has no error at all stands a decade below the rest.
        let rim = if least.is_finite() { least / 10.0 } else { 1e-16 };
        let height = |error: f64| if error > 0.0 { error } else { rim };
        let x = Axis::over(points.iter().map(|p| p.cost), MARGIN.0, SIZE.0 - MARGIN.2);
        let y = Axis::over(points.iter().map(|p| height(p.error)), SIZE.1 - MARGIN.3, MARGIN.1);
        let place = |p: &Point| (x.place(p.cost), y.place(height(p.error)));

        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">\
             <style>{STYLE}</style><rect width=\"100%\" height=\"100%\" fill=\"#fffdf8\"/>\n",
            SIZE.0,
            SIZE.1,
            escaped(&self.title),
        );
        let _ = writeln!(
            svg,
            "<text class=\"t\" x=\"{}\" y=\"24\">{}</text>",
            MARGIN.0,
            escaped(&self.title)
        );
        let (what, against) = self.error.split_once(", against ").unwrap_or((&self.error, ""));
        if !against.is_empty() {
            let _ = writeln!(
                svg,
                "<text class=\"n\" x=\"{}\" y=\"38\">error against {}</text>",
                MARGIN.0,
                escaped(against)
            );
        }
        let bottom = SIZE.1 - MARGIN.3;
        for tick in y.ticks() {
            let at = y.place(tick);
            let words = if exact && tick <= rim * 1.0001 {
                "0".to_owned()
            } else {
                short(tick)
            };
            let _ = writeln!(
                svg,
                "<path class=\"g\" d=\"M{} {at:.1}H{}\"/><text class=\"e\" x=\"{}\" y=\"{:.1}\">{words}</text>",
                MARGIN.0,
                SIZE.0 - MARGIN.2,
                MARGIN.0 - 8.0,
                at + 4.0,
            );
        }
        for tick in x.ticks() {
            let at = x.place(tick);
            let _ = writeln!(
                svg,
                "<path class=\"g\" d=\"M{at:.1} {}V{bottom}\"/><text class=\"m\" x=\"{at:.1}\" y=\"{}\">{}</text>",
                MARGIN.1,
                bottom + 18.0,
                short(tick)
            );
        }
        let middle = ((MARGIN.0 + SIZE.0 - MARGIN.2) / 2.0, (MARGIN.1 + bottom) / 2.0);
        let _ = writeln!(
            svg,
            "<text class=\"m\" x=\"{:.0}\" y=\"{:.0}\">{}</text>\
             <text class=\"m\" x=\"16\" y=\"{:.0}\" transform=\"rotate(-90 16 {:.0})\">{}</text>",
            middle.0,
            SIZE.1 - 12.0,
            escaped(&self.cost),
            middle.1,
            middle.1,
            escaped(what),
        );
        self.draw_points(&mut svg, &points, place);
        svg.push_str("</svg>\n");
        Some(svg)
    }

    fn draw_points(&self, svg: &mut String, points: &[&Point], place: impl Fn(&Point) -> (f64, f64)) {
        let mut families: Vec<&str> = Vec::new();
        for point in points {
            if !families.contains(&point.family.as_str()) {
                families.push(&point.family);
            }
        }
        let colour = |family: &str| {
            let at = families.iter().position(|f| *f == family).unwrap_or(0);
            COLOURS[at % COLOURS.len()]
        };
        let line = |svg: &mut String, class: &str, style: &str, points: &mut dyn Iterator<Item = &&Point>| {
            let joined: Vec<_> = points
                .map(|p| place(p))
                .map(|(x, y)| format!("{x:.1},{y:.1}"))
                .collect();
            if joined.len() > 1 {
                let _ = writeln!(
                    svg,
                    "<polyline class=\"{class}\"{style} points=\"{}\"/>",
                    joined.join(" ")
                );
            }
        };
        for family in &families {
            let style = format!(" stroke=\"{}\"", colour(family));
            line(svg, "l", &style, &mut points.iter().filter(|p| p.family == *family));
        }
        let mut front: Vec<&&Point> = points.iter().filter(|p| p.front).collect();
        front.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        line(svg, "f", "", &mut front.into_iter());
        for point in points {
            let ((x, y), colour) = (place(point), colour(&point.family));
            let shape = if point.default {
                format!(
                    "<path d=\"M{:.1} {y:.1}l7 -9 7 9 -7 9z\" fill=\"#fffdf8\" stroke=\"{colour}\" stroke-width=\"2.5\"/>",
                    x - 7.0
                )
            } else {
                let fill = if point.front { colour } else { "#fffdf8" };
                format!(
                    "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{fill}\" stroke=\"{colour}\" stroke-width=\"1.5\"/>"
                )
            };
            let _ = writeln!(
                svg,
                "<g>{shape}<title>{}: {} / {}</title></g>",
                escaped(&point.label),
                short(point.cost),
                short(point.error),
            );
        }
        let mut labels = Labels::new((MARGIN.0, MARGIN.1, SIZE.0, SIZE.1 - MARGIN.3));
        if families.len() > 1 {
            for (i, family) in families.iter().enumerate() {
                let y = MARGIN.1 + 12.0 + 16.0 * i as f64;
                let _ = writeln!(
                    svg,
                    "<circle cx=\"{x}\" cy=\"{:.1}\" r=\"4\" fill=\"{}\"/><text class=\"e\" x=\"{:.1}\" y=\"{y}\">{}</text>",
                    y - 4.0,
                    colour(family),
                    SIZE.0 - MARGIN.2 - 14.0,
                    escaped(family),
                    x = SIZE.0 - MARGIN.2 - 6.0,
                );
                let width = 6.6 * family.chars().count() as f64 + 30.0;
                labels.keep_free((SIZE.0 - MARGIN.2 - width, y - 14.0, SIZE.0, y + 4.0));
            }
        }
        // What matters most takes its place first.
        let mut labelled = points.to_vec();
        labelled.sort_by_key(|point| (!point.default, !point.front));
        for point in labelled {
            let words = point.words();
            if let Some(at) = labels.place(&words, place(point)) {
                let _ = writeln!(
                    svg,
                    "<text class=\"n{}\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                    if at.end { " e" } else { "" },
                    at.x,
                    at.y,
                    escaped(&words),
                );
            }
        }
    }
}

impl Point {
    /// Its label without what its family says already, and whether it is the default.
    fn words(&self) -> String {
        let parts = self.label.split("; ").filter(|part| *part != self.family);
        let words = match parts.collect::<Vec<_>>().join("; ") {
            nothing if nothing.is_empty() => self.label.clone(),
            words => words,
        };
        match self.default && !words.contains("(shipped)") {
            true => format!("{words} (default)"),
            false => words,
        }
    }
}

/// A logarithmic map from values to SVG units, with some air at both ends.
struct Axis {
    logs: (f64, f64),
    units: (f64, f64),
}

/// Pixels of a drawing are no hashed result; a table of powers still keeps the same picture on every machine.
fn log10(x: f64) -> f64 {
    libm::log10(x)
}

impl Axis {
    fn over(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let (low, high) = values
            .map(log10)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                (low.min(v), high.max(v))
            });
        let air = (0.06 * (high - low)).max(0.15);
        Self {
            logs: (low - air, high + air),
            units: (from, to),
        }
    }

    fn place(&self, value: f64) -> f64 {
        let share = (log10(value) - self.logs.0) / (self.logs.1 - self.logs.0);
        self.units.0 + share * (self.units.1 - self.units.0)
    }

    /// Powers of ten, thinned out over many decades; over few, also 2 and 5 times them.
    fn ticks(&self) -> Vec<f64> {
        let (low, high) = (self.logs.0.floor() as i32, self.logs.1.ceil() as i32);
        let every = ((high - low) / 8 + 1) as usize;
        let parts: &[f64] = if self.logs.1 - self.logs.0 < 2.5 {
            &[1.0, 2.0, 5.0]
        } else {
            &[1.0]
        };
        let powers = (low..=high).step_by(every);
        let ticks = powers.flat_map(|power| parts.iter().map(move |part| part * libm::pow(10.0, f64::from(power))));
        ticks
            .filter(|tick| (self.logs.0..=self.logs.1).contains(&log10(*tick)))
            .collect()
    }
}

/// Three significant digits; powers where they are shorter.
fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let size = value.abs();
    if (0.001..10_000.0).contains(&size) {
        let digits = (2 - log10(size).floor() as i32).max(0) as usize;
        let text = format!("{value:.digits$}");
        match text.contains('.') {
            true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
            false => text,
        }
    } else {
        let text = format!("{value:.2e}");
        let (number, power) = text.split_once('e').unwrap_or((&text, "0"));
        let number = number.trim_end_matches('0').trim_end_matches('.');
        format!("{number}e{power}")
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(label: &str, cost: f64, error: f64) -> Point {
        Point {
            label: label.into(),
            cost,
            error,
            family: "f64".into(),
            front: true,
            default: label == "two",
        }
    }

    #[test]
    fn a_diagram_is_a_file_that_stands_alone() {
        let diagram = Diagram {
            title: "K < 7".into(),
            cost: "seconds".into(),
            error: "rms".into(),
            points: vec![
                point("one", 1e-3, 0.5),
                point("two", 1e-2, 1e-4),
                point("ref", 0.2, 0.0),
            ],
        };
        let svg = diagram.svg().unwrap();
        assert!(svg.starts_with("<svg xmlns") && svg.trim_end().ends_with("</svg>"));
        assert!(svg.contains("K &lt; 7") && svg.contains("two (default)"));
        assert_eq!(svg.matches("<circle").count(), 2, "the default has a shape of its own");
        assert!(svg.contains(">0</text>"), "an exact result is shown");
        assert_eq!(svg.matches("polyline").count(), 2, "the family and the front");
    }

    #[test]
    fn a_label_says_what_neither_the_family_nor_the_title_does() {
        let mut point = point("rotations = 5; rounds = 2", 1.0, 1.0);
        point.family = "rounds = 2".into();
        assert_eq!(point.words(), "rotations = 5");
        point.default = true;
        assert_eq!(point.words(), "rotations = 5 (default)");
        point.label = "rounds = 2".into();
        assert_eq!(point.words(), "rounds = 2 (default)");
        let diagram = Diagram {
            error: "rms of views, against steps = 1500".into(),
            points: vec![point],
            ..Diagram::default()
        };
        let svg = diagram.svg().unwrap();
        assert!(svg.contains(">rms of views<") && svg.contains(">error against steps = 1500<"));
    }

    #[test]
    fn more_is_to_the_right_and_up() {
        let x = Axis::over([1e-3, 10.0].into_iter(), 0.0, 100.0);
        assert!(x.place(1e-3) > 0.0 && x.place(10.0) < 100.0 && x.place(0.1) < x.place(1.0));
        let ticks = x.ticks();
        assert!(
            ticks.len() >= 4 && ticks.windows(2).all(|pair| pair[0] < pair[1]),
            "{ticks:?}"
        );
        let few = Axis::over([3.0, 8.0].into_iter(), 0.0, 100.0).ticks();
        assert!(few.len() >= 2, "{few:?}");
    }

    #[test]
    fn nothing_to_draw_is_no_diagram() {
        let diagram = Diagram {
            points: vec![point("zero", 0.0, 1.0), point("lost", 1.0, f64::NAN)],
            ..Diagram::default()
        };
        assert!(diagram.svg().is_none());
    }

    #[test]
    fn numbers_are_short() {
        let told: Vec<_> = [1.0, 0.05, 123.0, 1e-7, 2.5e-4, 20_000.0, 0.0].map(short).into();
        assert_eq!(told, ["1", "0.05", "123", "1e-7", "2.5e-4", "2e4", "0"]);
    }
}
