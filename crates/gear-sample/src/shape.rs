//! The two shapes that figures are built from, with coordinates of their own for cloth and pattern.
//!
//! Positions are (x, y) in world units with y **down** (the picture's longer side is 1, the centre 0), heights in
//! the same unit towards the viewer. A [`Tube`] is a generalised cylinder around a smooth spine: at arc length
//! share s and signed offset e (a share of its half width) the surface stands `z(s) + depth(s)·√(1 − e²)` high.
//! An [`Ellipsoid`] is one, turned in the picture plane.

/// Where a point lies on a shape.
#[derive(Clone, Copy, Debug)]
pub struct Local {
    /// World position, y down.
    pub x: f64,
    /// World position, y down.
    pub y: f64,
    /// Along: arc length share of a tube, or the polar angle of an ellipsoid in turns.
    pub s: f64,
    /// Across: −1 at one rim of the silhouette, 1 at the other (ellipsoid: radius share, from 0).
    pub e: f64,
    /// Half width here, world units.
    pub width: f64,
    /// Spine length (ellipsoid: mean radius), world units.
    pub length: f64,
    /// Height of the bare shape over its base, world units.
    pub rise: f64,
    /// Base height of the shape, world units.
    pub base: f64,
}

/// A knot of a tube's spine.
#[derive(Clone, Copy, Debug)]
pub struct Knot {
    /// World position, y down.
    pub x: f64,
    /// World position, y down.
    pub y: f64,
    /// Half width.
    pub width: f64,
    /// Depth of the section, towards the viewer.
    pub depth: f64,
    /// Height of the section's rims.
    pub z: f64,
}

/// Shorthand for a [`Knot`].
pub fn knot(x: f64, y: f64, width: f64, depth: f64, z: f64) -> Knot {
    Knot { x, y, width, depth, z }
}

/// How a tube ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ends {
    /// Cut straight at both ends; the far end bulges by this share of its half width (a hem seen from above).
    Cut(f64),
    /// Closed by half ellipsoids.
    Round,
}

/// A generalised cylinder.
#[derive(Clone, Debug)]
pub struct Tube {
    points: Vec<Knot>,
    along: Vec<f64>,
    ends: Ends,
    bounds: [f64; 4],
}

impl Tube {
    /// A tube through `knots` (Catmull–Rom, at least two).
    pub fn new(knots: &[Knot], ends: Ends) -> Self {
        const PIECES: usize = 10;
        let n = knots.len();
        let mut points = Vec::with_capacity((n - 1) * PIECES + 1);
        for i in 0..n - 1 {
            let around = [
                knots[i.saturating_sub(1)],
                knots[i],
                knots[i + 1],
                knots[(i + 2).min(n - 1)],
            ];
            for piece in 0..PIECES {
                points.push(catmull_rom(&around, piece as f64 / PIECES as f64));
            }
        }
        points.push(knots[n - 1]);
        let mut along = vec![0.0];
        for pair in points.windows(2) {
            let step = distance(pair[0].x - pair[1].x, pair[0].y - pair[1].y);
            along.push(along[along.len() - 1] + step.max(1e-9));
        }
        let reach = points.iter().fold(0.0f64, |r, k| r.max(k.width)) * 1.6;
        let bounds = points.iter().fold([f64::MAX, f64::MAX, f64::MIN, f64::MIN], |b, k| {
            [
                b[0].min(k.x - reach),
                b[1].min(k.y - reach),
                b[2].max(k.x + reach),
                b[3].max(k.y + reach),
            ]
        });
        Self {
            points,
            along,
            ends,
            bounds,
        }
    }

    fn local(&self, x: f64, y: f64) -> Option<Local> {
        let [x0, y0, x1, y1] = self.bounds;
        if x < x0 || x > x1 || y < y0 || y > y1 {
            return None;
        }
        let mut best = (f64::MAX, 0, 0.0);
        for (i, pair) in self.points.windows(2).enumerate() {
            let (dx, dy) = (pair[1].x - pair[0].x, pair[1].y - pair[0].y);
            let t = (((x - pair[0].x) * dx + (y - pair[0].y) * dy) / (dx * dx + dy * dy).max(1e-18)).clamp(0.0, 1.0);
            let (ox, oy) = (x - pair[0].x - t * dx, y - pair[0].y - t * dy);
            let squared = ox * ox + oy * oy;
            if squared < best.0 {
                best = (squared, i, t);
            }
        }
        let (_, i, t) = best;
        let (a, b) = (self.points[i], self.points[i + 1]);
        let k = blend(&a, &b, t);
        let segment = self.along[i + 1] - self.along[i];
        let (tx, ty) = ((b.x - a.x) / segment, (b.y - a.y) / segment);
        let (ox, oy) = (x - k.x, y - k.y);
        let over = ox * tx + oy * ty;
        let across = (tx * oy - ty * ox) / k.width.max(1e-9);
        let length = self.along[self.along.len() - 1];
        let at_end = (i == 0 && t == 0.0) || (i + 2 == self.points.len() && t == 1.0);
        let mut round = across * across;
        if at_end {
            match self.ends {
                Ends::Round => round += (over / k.width.max(1e-9)) * (over / k.width.max(1e-9)),
                Ends::Cut(bulge) => {
                    let allowed = if i == 0 {
                        1e-9
                    } else {
                        bulge * k.width * (1.0 - round).max(0.0).sqrt() + 1e-9
                    };
                    if over.abs() > allowed {
                        return None;
                    }
                }
            }
        }
        (round < 1.0).then(|| Local {
            x,
            y,
            s: (self.along[i] + t * segment + if at_end { over } else { 0.0 }) / length,
            e: across,
            width: k.width,
            length,
            rise: k.depth * (1.0 - round).sqrt(),
            base: k.z,
        })
    }
}

/// An ellipsoid, turned in the picture plane.
#[derive(Clone, Copy, Debug)]
pub struct Ellipsoid {
    /// Centre, world units, y down.
    pub center: [f64; 2],
    /// Half axes in the plane.
    pub radii: [f64; 2],
    /// Turn of the first axis from x, radians, clockwise as seen.
    pub turn: f64,
    /// Depth towards the viewer.
    pub depth: f64,
    /// Height of the rim.
    pub z: f64,
}

impl Ellipsoid {
    fn local(&self, x: f64, y: f64) -> Option<Local> {
        let (sin, cos) = (libm::sin(self.turn), libm::cos(self.turn));
        let (dx, dy) = (x - self.center[0], y - self.center[1]);
        let a = (cos * dx + sin * dy) / self.radii[0];
        let b = (cos * dy - sin * dx) / self.radii[1];
        let round = a * a + b * b;
        (round < 1.0).then(|| Local {
            x: a,
            y: b,
            s: libm::atan2(b, a) / std::f64::consts::TAU,
            e: round.sqrt(),
            width: 0.5 * (self.radii[0] + self.radii[1]),
            length: 0.5 * (self.radii[0] + self.radii[1]),
            rise: self.depth * (1.0 - round).sqrt(),
            base: self.z,
        })
    }
}

/// A free silhouette: what lies at (x, y), or nothing.
pub type FreeForm = Box<dyn Fn(f64, f64) -> Option<Local> + Send + Sync>;

/// A silhouette with a height.
pub enum Shape {
    /// A generalised cylinder.
    Tube(Tube),
    /// An ellipsoid.
    Ellipsoid(Ellipsoid),
    /// Any other, such as a mountain ridge.
    Free(FreeForm),
}

impl Shape {
    /// Where (x, y) lies on the shape; `None` outside its silhouette. For an ellipsoid the local `x`, `y` are
    /// shares of its half axes.
    pub fn local(&self, x: f64, y: f64) -> Option<Local> {
        match self {
            Self::Tube(tube) => tube.local(x, y),
            Self::Ellipsoid(ellipsoid) => ellipsoid.local(x, y),
            Self::Free(form) => form(x, y),
        }
    }
}

fn catmull_rom(k: &[Knot; 4], t: f64) -> Knot {
    let f = |get: fn(&Knot) -> f64| {
        let [a, b, c, d] = [get(&k[0]), get(&k[1]), get(&k[2]), get(&k[3])];
        0.5 * (2.0 * b + t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a))))
    };
    Knot {
        x: f(|k| k.x),
        y: f(|k| k.y),
        width: f(|k| k.width).max(1e-6),
        depth: f(|k| k.depth),
        z: f(|k| k.z),
    }
}

fn blend(a: &Knot, b: &Knot, t: f64) -> Knot {
    let mix = |p: f64, q: f64| p + t * (q - p);
    Knot {
        x: mix(a.x, b.x),
        y: mix(a.y, b.y),
        width: mix(a.width, b.width),
        depth: mix(a.depth, b.depth),
        z: mix(a.z, b.z),
    }
}

fn distance(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_tube_is_a_cylinder() {
        let tube = Shape::Tube(Tube::new(
            &[knot(0.0, -0.3, 0.1, 0.1, 0.0), knot(0.0, 0.3, 0.1, 0.1, 0.0)],
            Ends::Cut(0.0),
        ));
        for i in -9..=9 {
            let x = i as f64 * 0.01;
            let local = tube.local(x, 0.05).expect("inside");
            assert!((local.rise - (0.01 - x * x).sqrt()).abs() < 1e-9);
        }
        assert!(tube.local(0.101, 0.0).is_none());
        assert!(tube.local(0.0, 0.301).is_none());
    }

    #[test]
    fn an_ellipsoid_stands_highest_in_its_middle() {
        let shape = Shape::Ellipsoid(Ellipsoid {
            center: [0.1, 0.0],
            radii: [0.2, 0.1],
            turn: 0.5,
            depth: 0.3,
            z: 0.1,
        });
        let top = shape.local(0.1, 0.0).expect("inside");
        assert!((top.rise - 0.3).abs() < 1e-12 && top.e < 1e-12);
        assert!(shape.local(0.31, 0.0).is_none());
    }
}
