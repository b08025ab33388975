//! Curves as SVG.

use std::fmt::Write;

/// A curve to draw: how a quantity fell or rose step by step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// What the abscissa counts, such as `iteration`.
    pub step: String,
    /// What is drawn, such as `loss`.
    pub quantity: String,
    /// (step, value); non-finite values are left out.
    pub points: Vec<(f64, f64)>,
}

/// Width and height of the drawing, in SVG user units.
const SIZE: (f64, f64) = (720.0, 260.0);
/// Left, top, right and bottom margins for the labels.
const MARGIN: (f64, f64, f64, f64) = (64.0, 14.0, 16.0, 42.0);

impl Curve {
    /// The curve as an SVG element, or `None` when fewer than two finite points are left.
    pub fn svg(&self) -> Option<String> {
        let points: Vec<(f64, f64)> = self
            .points
            .iter()
            .copied()
            .filter(|(x, y)| x.is_finite() && y.is_finite())
            .collect();
        if points.len() < 2 {
            return None;
        }
        let x = Axis::over(points.iter().map(|p| p.0), MARGIN.0, SIZE.0 - MARGIN.2);
        let y = Axis::over(points.iter().map(|p| p.1), SIZE.1 - MARGIN.3, MARGIN.1);

        let mut svg = format!(
            "<svg class=\"plot\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{} over {}, from {} to {}\">\n",
            SIZE.0,
            SIZE.1,
            self.quantity,
            self.step,
            short(points[0].1),
            short(points[points.len() - 1].1),
        );
        let bottom = SIZE.1 - MARGIN.3;
        for tick in y.ticks() {
            let at = y.place(tick);
            let _ = writeln!(
                svg,
                "<path class=\"grid\" d=\"M{} {at:.1}H{}\"/><text class=\"y\" x=\"{}\" y=\"{:.1}\">{}</text>",
                MARGIN.0,
                SIZE.0 - MARGIN.2,
                MARGIN.0 - 8.0,
                at + 4.0,
                short(tick),
            );
        }
        for tick in x.ticks() {
            let at = x.place(tick);
            let _ = writeln!(
                svg,
                "<text class=\"x\" x=\"{at:.1}\" y=\"{}\">{}</text>",
                bottom + 18.0,
                short(tick)
            );
        }
        let _ = writeln!(
            svg,
            "<text class=\"x\" x=\"{}\" y=\"{}\">{}</text>",
            (MARGIN.0 + SIZE.0 - MARGIN.2) / 2.0,
            SIZE.1 - 6.0,
            self.step,
        );
        let middle = (MARGIN.1 + bottom) / 2.0;
        let _ = writeln!(
            svg,
            "<text class=\"x\" x=\"14\" y=\"{middle}\" transform=\"rotate(-90 14 {middle})\">{}</text>",
            self.quantity,
        );
        svg.push_str("<polyline points=\"");
        for &(at, value) in &points {
            let _ = write!(svg, "{:.1},{:.1} ", x.place(at), y.place(value));
        }
        svg.push_str("\"/></svg>");
        Some(svg)
    }
}

/// A linear map from values to SVG units.
struct Axis {
    values: (f64, f64),
    units: (f64, f64),
}

impl Axis {
    /// Maps the range of `values` to `from..to`.
    fn over(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        });
        let high = if high > low { high } else { low + 1.0 };
        Self {
            values: (low, high),
            units: (from, to),
        }
    }

    fn place(&self, value: f64) -> f64 {
        let share = (value - self.values.0) / (self.values.1 - self.values.0);
        self.units.0 + share * (self.units.1 - self.units.0)
    }

    /// Four to ten round values (1, 2 or 5 times a power of ten apart) within the range.
    fn ticks(&self) -> Vec<f64> {
        let (low, high) = self.values;
        let span = high - low;
        let mut step = 1.0;
        while step > span {
            step /= 10.0;
        }
        while step * 10.0 <= span {
            step *= 10.0;
        }
        let step = [0.2, 0.5, 1.0]
            .map(|part| step * part)
            .into_iter()
            .rfind(|step| span / step >= 4.0)
            .unwrap_or(step / 10.0);
        let first = (low / step).ceil();
        (0..12)
            .map(|i| (first + f64::from(i)) * step)
            .take_while(|tick| *tick <= high)
            .collect()
    }
}

/// A number with at most four significant digits and no trailing zeros.
fn short(value: f64) -> String {
    let digits = match value.abs() {
        a if a >= 100.0 => 0,
        a if a >= 1.0 => 2,
        _ => 4,
    };
    let text = format!("{value:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_is_an_svg_that_scales() {
        let curve = Curve {
            step: "iteration".into(),
            quantity: "loss".into(),
            points: (0..50).map(|i| (f64::from(i), 1.0 / f64::from(i + 1))).collect(),
        };
        let svg = curve.svg().unwrap();
        assert!(svg.contains("viewBox") && !svg.contains(" width="), "{}", &svg[..80]);
        assert!(svg.contains("loss over iteration, from 1 to 0.02"));
        assert_eq!(svg.matches("polyline").count(), 1);
        assert!(
            svg.contains(">loss</text>") && svg.contains(">iteration</text>"),
            "both axes are named"
        );
    }

    #[test]
    fn too_few_finite_points_are_no_curve() {
        let points = vec![(0.0, 1.0), (1.0, f64::NAN), (2.0, f64::INFINITY)];
        assert_eq!(
            Curve {
                points,
                ..Curve::default()
            }
            .svg(),
            None
        );
    }

    #[test]
    fn a_constant_is_drawn() {
        let points = vec![(0.0, 0.5), (1.0, 0.5)];
        assert!(
            Curve {
                points,
                ..Curve::default()
            }
            .svg()
            .is_some()
        );
    }

    #[test]
    fn ticks_are_round_and_inside() {
        for (low, high) in [(0.0, 1.0), (0.013, 0.0147), (0.0, 299.0), (-3.0, 17.0), (5e-7, 6e-7)] {
            let ticks = Axis::over([low, high].into_iter(), 0.0, 1.0).ticks();
            assert!((3..=11).contains(&ticks.len()), "{low}..{high}: {ticks:?}");
            assert!(ticks.iter().all(|t| (low..=high * 1.000_001).contains(t)), "{ticks:?}");
        }
    }
}
