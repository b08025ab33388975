//! The Pareto front of cost and error.

use super::table::{Curve, Point};

/// How far a default may be from the front: a tenth in cost or error.
pub const SLACK: f64 = 1.1;

/// Whether no other point is as good in both and better in one.
pub fn on_front(curve: &Curve, point: &Point) -> bool {
    let (cost, error) = (curve.cost(point), point.error);
    !curve.points.iter().any(|other| {
        let (c, e) = (curve.cost(other), other.error);
        c <= cost && e <= error && (c < cost || e < error)
    })
}

/// What is better than the default by more than a tenth: cheaper at no more error, or more exact at no more cost. `Err`
/// if no point is marked as the default, or its numbers are not finite.
pub fn better_than_default(curve: &Curve) -> Result<Vec<&Point>, String> {
    let default = curve.points.iter().find(|point| point.default);
    let default = default.ok_or_else(|| "no point is marked as the default".to_owned())?;
    let (cost, error) = (curve.cost(default), default.error);
    if !(cost.is_finite() && cost > 0.0 && error.is_finite() && error >= 0.0) {
        return Err(format!(
            "the default `{}` has cost {cost} and error {error}",
            default.label
        ));
    }
    let better = |other: &&Point| {
        let (c, e) = (curve.cost(other), other.error);
        (c * SLACK < cost && e <= error) || (e * SLACK < error && c <= cost)
    };
    Ok(curve.points.iter().filter(better).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(points: &[(f64, f64)], default: usize) -> Curve {
        let points = points.iter().enumerate().map(|(i, (seconds, error))| Point {
            label: i.to_string(),
            seconds: *seconds,
            error: *error,
            default: i == default,
            ..Point::default()
        });
        Curve {
            points: points.collect(),
            ..Curve::default()
        }
    }

    #[test]
    fn the_front_is_what_nothing_dominates() {
        let curve = curve(&[(1.0, 1.0), (2.0, 0.5), (3.0, 0.6), (2.0, 0.7)], 0);
        let front: Vec<bool> = curve.points.iter().map(|p| on_front(&curve, p)).collect();
        assert_eq!(front, [true, true, false, false]);
    }

    #[test]
    fn a_default_within_a_tenth_of_the_front_passes_and_one_beyond_does_not() {
        let better = |cost| {
            better_than_default(&curve(&[(1.0, 0.5), (cost, 0.5)], 1))
                .unwrap()
                .len()
        };
        assert_eq!((better(1.05), better(1.2)), (0, 1));
        let better = |error| {
            better_than_default(&curve(&[(1.0, 0.5), (1.0, error)], 1))
                .unwrap()
                .len()
        };
        assert_eq!((better(0.54), better(0.6)), (0, 1));
        assert!(better_than_default(&curve(&[(1.0, 0.5)], 7)).is_err());
        // The exact default of a cheap kernel is on the front.
        assert!(
            better_than_default(&curve(&[(1.0, 0.5), (2.0, 0.0)], 1))
                .unwrap()
                .is_empty()
        );
    }

    #[test]
    fn counts_of_operations_take_the_place_of_seconds() {
        let mut curve = curve(&[(1.0, 0.5), (5.0, 0.5)], 1);
        assert_eq!(better_than_default(&curve).unwrap().len(), 1);
        curve.operations = Some("iterations".into());
        for point in &mut curve.points {
            point.operations = Some(10.0);
        }
        assert!(better_than_default(&curve).unwrap().is_empty());
    }
}
