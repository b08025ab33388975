//! Gaussian mixture colour models.
//!
//! Fitted with hard assignments: start with one cluster, split the widest along its principal axis until there
//! are enough (Orchard and Bouman, 1991), then a few rounds of assigning each colour to its likeliest
//! component and fitting the components anew. No random start: the same colours give the same model.
//! Every covariance gets the variance of the finest visible difference added, so that flat paint does
//! not become a spike that nothing else can match.

use super::features::Feature;

/// Variance added to every axis.
const FLOOR: f64 = 1.5e-4;
/// Rounds of refitting.
const ROUNDS: usize = 4;

#[derive(Clone, Debug)]
struct Component {
    mean: [f64; 3],
    /// Inverse covariance: xx, xy, xz, yy, yz, zz.
    inverse: [f64; 6],
    /// ln(weight) − ½ ln det(2π covariance).
    constant: f64,
}

/// A mixture of Gaussians over features.
#[derive(Clone, Debug)]
pub struct Mixture {
    components: Vec<Component>,
}

#[derive(Clone, Default)]
struct Moments {
    count: f64,
    sum: [f64; 3],
    squares: [f64; 6],
}

impl Moments {
    fn add(&mut self, c: Feature) {
        let [x, y, z] = c.map(f64::from);
        self.count += 1.0;
        for (s, v) in self.sum.iter_mut().zip([x, y, z]) {
            *s += v;
        }
        for (s, v) in self.squares.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
            *s += v;
        }
    }

    fn mean(&self) -> [f64; 3] {
        self.sum.map(|s| s / self.count.max(1.0))
    }

    fn covariance(&self) -> [f64; 6] {
        let n = self.count.max(1.0);
        let [x, y, z] = self.mean();
        let products = [x * x, x * y, x * z, y * y, y * z, z * z];
        let mut c: [f64; 6] = std::array::from_fn(|k| self.squares[k] / n - products[k]);
        for k in [0, 3, 5] {
            c[k] = c[k].max(0.0) + FLOOR;
        }
        c
    }
}

impl Mixture {
    /// Fits at most `components` Gaussians; `None` when there are no colours.
    pub fn fit(colours: &[Feature], components: usize) -> Option<Self> {
        if colours.is_empty() {
            return None;
        }
        let mut label = vec![0u8; colours.len()];
        let mut moments = gather(colours, &label, 1);
        while moments.len() < components.clamp(1, 16) {
            // the cluster that spreads most, by total squared deviation along its principal axis
            let spread = |m: &Moments| principal(&m.covariance()).0 * m.count;
            let widest = (0..moments.len()).fold(0, |a, b| {
                if spread(&moments[b]) > spread(&moments[a]) {
                    b
                } else {
                    a
                }
            });
            let (_, axis) = principal(&moments[widest].covariance());
            let mean = moments[widest].mean();
            let fresh = moments.len() as u8;
            for (l, c) in label.iter_mut().zip(colours) {
                let along = (0..3).map(|k| (f64::from(c[k]) - mean[k]) * axis[k]).sum::<f64>();
                if usize::from(*l) == widest && along > 0.0 {
                    *l = fresh;
                }
            }
            moments = gather(colours, &label, moments.len() + 1);
            if moments[usize::from(fresh)].count == 0.0 {
                moments.pop();
                break;
            }
        }
        let mut mixture = Self::from_moments(&moments, colours.len());
        for _ in 0..ROUNDS {
            for (l, c) in label.iter_mut().zip(colours) {
                *l = mixture.likeliest(*c) as u8;
            }
            mixture = Self::from_moments(&gather(colours, &label, mixture.components.len()), colours.len());
        }
        Some(mixture)
    }

    fn from_moments(moments: &[Moments], total: usize) -> Self {
        let component = |m: &Moments| {
            let (inverse, det) = invert(&m.covariance());
            let weight = m.count / total as f64;
            let constant = libm::log(weight) - 0.5 * libm::log(det) - 1.5 * libm::log(std::f64::consts::TAU);
            Component {
                mean: m.mean(),
                inverse,
                constant,
            }
        };
        Self {
            components: moments.iter().filter(|m| m.count > 0.0).map(component).collect(),
        }
    }

    fn likeliest(&self, colour: Feature) -> usize {
        let mut best = (0, f64::MIN);
        for (k, component) in self.components.iter().enumerate() {
            let l = component.log_density(colour);
            if l > best.1 {
                best = (k, l);
            }
        }
        best.0
    }

    /// Logarithm of the density of the likeliest component, weight included.
    pub fn log_density(&self, colour: Feature) -> f64 {
        self.components
            .iter()
            .map(|c| c.log_density(colour))
            .fold(f64::MIN, f64::max)
    }
}

impl Component {
    fn log_density(&self, colour: Feature) -> f64 {
        let [x, y, z]: [f64; 3] = std::array::from_fn(|k| f64::from(colour[k]) - self.mean[k]);
        let [xx, xy, xz, yy, yz, zz] = self.inverse;
        let q = x * (xx * x + 2.0 * (xy * y + xz * z)) + y * (yy * y + 2.0 * yz * z) + zz * z * z;
        self.constant - 0.5 * q
    }
}

fn gather(colours: &[Feature], label: &[u8], count: usize) -> Vec<Moments> {
    let mut moments = vec![Moments::default(); count];
    for (c, l) in colours.iter().zip(label) {
        moments[usize::from(*l)].add(*c);
    }
    moments
}

/// Largest eigenvalue and its axis, by power iteration.
fn principal(c: &[f64; 6]) -> (f64, [f64; 3]) {
    let [xx, xy, xz, yy, yz, zz] = *c;
    let mut axis = [1.0, 0.83, 0.61];
    let mut value = 0.0;
    for _ in 0..24 {
        let [x, y, z] = axis;
        let next = [
            xx * x + xy * y + xz * z,
            xy * x + yy * y + yz * z,
            xz * x + yz * y + zz * z,
        ];
        value = next.iter().map(|v| v * v).sum::<f64>().sqrt();
        if value <= 0.0 {
            return (0.0, axis);
        }
        axis = next.map(|v| v / value);
    }
    (value, axis)
}

/// Inverse and determinant of a positive definite symmetric matrix.
fn invert(c: &[f64; 6]) -> ([f64; 6], f64) {
    let [xx, xy, xz, yy, yz, zz] = *c;
    let (a, b, d) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let det = (xx * a + xy * b + xz * d).max(1e-18);
    let inverse = [a, b, d, xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy].map(|v| v / det);
    (inverse, det)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_of_two_clusters_is_likelier_under_its_own_model() {
        let cluster = |at: f32| (0..200).map(move |i| [at + 0.01 * (i % 7) as f32, 0.002 * (i % 5) as f32, 0.0]);
        let near: Vec<Feature> = cluster(0.2).collect();
        let far: Vec<Feature> = cluster(0.6).collect();
        let (a, b) = (Mixture::fit(&near, 3).unwrap(), Mixture::fit(&far, 3).unwrap());
        assert!(near.iter().all(|c| a.log_density(*c) > b.log_density(*c)));
        assert!(far.iter().all(|c| b.log_density(*c) > a.log_density(*c)));
    }

    #[test]
    fn a_single_colour_makes_a_finite_model() {
        let model = Mixture::fit(&[[0.3, 0.0, 0.1]; 9], 5).unwrap();
        assert!(model.log_density([0.3, 0.0, 0.1]).is_finite());
        assert!(model.log_density([0.9, 0.2, 0.1]).is_finite());
        assert!(Mixture::fit(&[], 5).is_none());
    }

    #[test]
    fn the_inverse_undoes_the_matrix() {
        let c = [2.0, 0.3, -0.2, 1.5, 0.1, 0.7];
        let (i, _) = invert(&c);
        assert!((c[0] * i[0] + c[1] * i[1] + c[2] * i[2] - 1.0).abs() < 1e-12);
        assert!((c[0] * i[1] + c[1] * i[3] + c[2] * i[4]).abs() < 1e-12);
    }
}
