//! Calm edges: as few bends as the boxes allow, and those rounded.
//!
//! The layout gives an edge waypoints in every layer that it crosses. Most of them are not needed: from every kept point
//! the edge goes straight to the furthest waypoint that can be seen from there past all other boxes.

use std::fmt::Write;

use super::layers::BOX;

/// What an edge keeps clear of a box, beside it and above or below it.
const CLEARANCE: (f64, f64) = (6.0, 3.0);
/// How early a bend begins.
const RADIUS: f64 = 18.0;

type Point = (f64, f64);

/// The points of an edge that are needed for it to pass the boxes with these centres.
pub fn straighten(points: &[Point], boxes: &[Point]) -> Vec<Point> {
    let mut kept: Vec<Point> = points.first().copied().into_iter().collect();
    let mut at = 0;
    while at + 1 < points.len() {
        let seen = |&to: &usize| !boxes.iter().any(|&center| hits(points[at], points[to], center));
        at = (at + 2..points.len()).rev().find(seen).unwrap_or(at + 1);
        kept.push(points[at]);
    }
    kept
}

/// Whether the segment comes too near to the box: the slabs of both axes overlap on it.
fn hits(from: Point, to: Point, center: Point) -> bool {
    let slab = |from: f64, to: f64, center: f64, half: f64| {
        let (low, high) = (center - half - from, center + half - from);
        let along = to - from;
        if along == 0.0 {
            if low < 0.0 && high > 0.0 {
                (f64::NEG_INFINITY, f64::INFINITY)
            } else {
                (1.0, 0.0)
            }
        } else {
            ((low / along).min(high / along), (low / along).max(high / along))
        }
    };
    let across = slab(from.0, to.0, center.0, BOX.0 / 2.0 + CLEARANCE.0);
    let down = slab(from.1, to.1, center.1, BOX.1 / 2.0 + CLEARANCE.1);
    across.0.max(down.0).max(0.0) < across.1.min(down.1).min(1.0)
}

/// Straight lines with rounded bends, as the path of an SVG element.
pub fn path(points: &[Point]) -> String {
    let mut path = String::new();
    let Some((&(x, y), rest)) = points.split_first() else {
        return path;
    };
    let _ = write!(path, "M{x:.1} {y:.1}");
    for triple in points.windows(3) {
        let (before, bend, after) = (triple[0], triple[1], triple[2]);
        let (a, b) = (towards(bend, before), towards(bend, after));
        let _ = write!(
            path,
            "L{:.1} {:.1}Q{:.1} {:.1} {:.1} {:.1}",
            a.0, a.1, bend.0, bend.1, b.0, b.1
        );
    }
    if let Some((x, y)) = rest.last() {
        let _ = write!(path, "L{x:.1} {y:.1}");
    }
    path
}

/// The point on the way where a bend ends: its radius away, at most half of the way.
fn towards(bend: Point, other: Point) -> Point {
    let (dx, dy) = (other.0 - bend.0, other.1 - bend.1);
    let length = (dx * dx + dy * dy).sqrt();
    let share = if length > 0.0 { (RADIUS / length).min(0.5) } else { 0.0 };
    (bend.0 + dx * share, bend.1 + dy * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_with_nothing_in_its_way_is_straight() {
        let points = [(0.0, 0.0), (30.0, 60.0), (-20.0, 120.0), (0.0, 200.0)];
        assert_eq!(straighten(&points, &[(300.0, 100.0)]), [points[0], points[3]]);
        assert_eq!(path(&[points[0], points[3]]), "M0.0 0.0L0.0 200.0");
    }

    #[test]
    fn an_edge_goes_around_a_box() {
        let points = [(0.0, 0.0), (150.0, 100.0), (0.0, 200.0)];
        let kept = straighten(&points, &[(0.0, 100.0)]);
        assert_eq!(kept, points);
        assert!(path(&kept).contains('Q'));
        assert!(hits(points[0], points[2], (0.0, 100.0)) && !hits(points[0], points[1], (0.0, 100.0)));
    }

    #[test]
    fn an_edge_without_points_is_no_path() {
        assert_eq!(path(&straighten(&[], &[])), "");
    }
}
