//! VEND, volumetric extent and normal diversity: 100 √(V · D).
//!
//! The paper names the metric and its purpose but gives no formula; this definition is ours, and its numbers
//! do not compare with the paper's.
//!
//! * V = √(σ₂ σ₃)/σ₁, with σ₁ ≥ σ₂ ≥ σ₃ the roots of the eigenvalues of the centres' covariance, weighted by opaque
//!   area: 0 for a line or a plane, 1 for a body that extends equally in all directions.
//! * D = entropy of the normals, weighted by opaque area, over n = 128 equal-area cells of the sphere (a Fibonacci
//!   lattice), divided by ln n: 0 for one direction, 1 for all.
//!
//! Both lie in [0, 1] and do not change with scale, position, or sampling density.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use crate::surfels::Surfels;

/// Equal-area cells of the sphere of normals, unless another number is asked for.
pub const CELLS: usize = 128;
/// Surfels a chunk: fixed, so that sums have one shape on any number of threads.
const CHUNK: usize = 4096;

/// VEND and its two factors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vend {
    /// 100 √(V · D), in 0..=100.
    pub vend: f64,
    /// Volumetric extent V, in 0..=1.
    pub extent: f64,
    /// Normal diversity D, in 0..=1.
    pub diversity: f64,
}

/// VEND of surfels, their normals counted over `cells`, at least two; 0 without any opaque area.
pub fn vend(surfels: &Surfels, cells: usize) -> Vend {
    let extent = extent(surfels);
    let diversity = diversity(surfels, cells.max(2));
    Vend {
        vend: 100.0 * (extent.clamp(0.0, 1.0) * diversity.clamp(0.0, 1.0)).sqrt(),
        extent,
        diversity,
    }
}

/// The area-weighted standard deviations of the centres along their principal axes, largest first.
/// Zeros for fewer than four surfels or no opaque area.
pub fn principal_deviations(surfels: &Surfels) -> [f64; 3] {
    let total = surfels.total();
    if surfels.centers.len() < 4 || total <= 0.0 {
        return [0.0; 3];
    }
    let weighted = || surfels.centers.iter().zip(&surfels.weights);
    let mean = weighted().fold(DVec3::ZERO, |sum, (c, &w)| sum + *c * w) / total;
    let mut covariance = [[0.0; 3]; 3];
    for (centre, w) in weighted() {
        let d = (*centre - mean).to_array();
        for i in 0..3 {
            for j in 0..3 {
                covariance[i][j] += w * d[i] * d[j] / total;
            }
        }
    }
    let mut deviations = eigenvalues(covariance).map(|e| e.max(0.0).sqrt());
    deviations.sort_by(|a, b| b.total_cmp(a));
    deviations
}

fn extent(surfels: &Surfels) -> f64 {
    let [widest, middle, thinnest] = principal_deviations(surfels);
    if widest > 0.0 {
        (middle * thinnest).sqrt() / widest
    } else {
        0.0
    }
}

/// Eigenvalues of a symmetric 3 × 3 matrix by cyclic Jacobi rotations; exact zeros stay exact.
fn eigenvalues(mut a: [[f64; 3]; 3]) -> [f64; 3] {
    for _ in 0..24 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            for k in 0..3 {
                let (x, y) = (a[k][p], a[k][q]);
                (a[k][p], a[k][q]) = (c * x - s * y, s * x + c * y);
            }
            for k in 0..3 {
                let (x, y) = (a[p][k], a[q][k]);
                (a[p][k], a[q][k]) = (c * x - s * y, s * x + c * y);
            }
        }
    }
    [a[0][0], a[1][1], a[2][2]]
}

/// Directions of a Fibonacci lattice: cells of equal area.
fn directions(count: usize) -> Vec<DVec3> {
    let direction = |i: usize| {
        let i = i as f64 + 0.5;
        let z = 1.0 - 2.0 * i / count as f64;
        let turn = PI * (1.0 + 5f64.sqrt()) * i;
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * libm::cos(turn), r * libm::sin(turn), z)
    };
    (0..count).map(direction).collect()
}

fn diversity(surfels: &Surfels, count: usize) -> f64 {
    let directions = directions(count);
    let nearest = |n: &DVec3| {
        let mut best = (0, f64::NEG_INFINITY);
        for (i, d) in directions.iter().enumerate() {
            let dot = n.dot(*d);
            if dot > best.1 {
                best = (i, dot);
            }
        }
        best.0
    };
    let partial: Vec<Vec<f64>> = surfels
        .normals
        .par_chunks(CHUNK)
        .zip(surfels.weights.par_chunks(CHUNK))
        .map(|(normals, weights)| {
            let mut cells = vec![0.0; count];
            for (n, w) in normals.iter().zip(weights) {
                cells[nearest(n)] += w;
            }
            cells
        })
        .collect();
    let mut cells = vec![0.0; count];
    for part in &partial {
        for (cell, w) in cells.iter_mut().zip(part) {
            *cell += w;
        }
    }
    let total = cells.iter().fold(0.0, |sum, w| sum + w);
    if total <= 0.0 {
        return 0.0;
    }
    let entropy = cells.iter().filter(|&&w| w > 0.0).fold(0.0, |sum, w| {
        let p = w / total;
        sum - p * libm::log(p)
    });
    // One cell gives −0 and round-off may pass 1 by a bit.
    (entropy / libm::log(count as f64)).clamp(0.0, 1.0) + 0.0
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const ORACLE: &str = include_str!("../../../tests/oracles/vend.json");

    /// The oracle's surfels: 4000 on a Fibonacci sphere, changed.
    fn cloud(case: &str) -> Surfels {
        let mut surfels = Surfels::default();
        for i in 0..4000 {
            let i = f64::from(i) + 0.5;
            let z = 1.0 - 2.0 * i / 4000.0;
            let turn = PI * (1.0 + 5f64.sqrt()) * i;
            let r = (1.0 - z * z).sqrt();
            let p = DVec3::new(r * libm::cos(turn), r * libm::sin(turn), z);
            if case == "half" && z <= 0.0 {
                continue;
            }
            let axes = if case == "ellipsoid" {
                DVec3::new(1.0, 0.6, 0.3)
            } else {
                DVec3::ONE
            };
            let (opacity, scale) = match case {
                "weighted" => (if p.x > 0.0 { 0.99 } else { 0.1 }, if p.y > 0.0 { 2.0 } else { 1.0 }),
                _ => (0.99, 1.0),
            };
            surfels.centers.push(p * axes);
            surfels.normals.push((p / axes).normalize());
            surfels.weights.push(opacity * (0.02 * scale) * (0.02 * scale));
        }
        surfels
    }

    #[test]
    fn vend_and_its_factors_are_the_prototypes() {
        let oracle: serde_json::Value = serde_json::from_str(ORACLE).unwrap();
        let tolerance = &oracle["tolerance"];
        for case in oracle["cases"].as_array().unwrap() {
            let name = case["case"].as_str().unwrap();
            let ours = vend(&cloud(name), CELLS);
            for (key, ours, tolerance) in [
                ("vend", ours.vend, &tolerance["vend"]),
                ("extent", ours.extent, &tolerance["factors"]),
                ("diversity", ours.diversity, &tolerance["factors"]),
            ] {
                let theirs = case[key].as_f64().unwrap();
                assert!(
                    (ours - theirs).abs() < tolerance.as_f64().unwrap(),
                    "{name} {key}: {ours}, {theirs}"
                );
            }
        }
    }

    #[test]
    fn eigenvalues_of_a_known_matrix() {
        let mut e = eigenvalues([[2.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 5.0]]);
        e.sort_by(f64::total_cmp);
        for (got, want) in e.iter().zip([1.0, 3.0, 5.0]) {
            assert!((got - want).abs() < 1e-14);
        }
    }

    proptest! {
        #[test]
        fn eigenvalues_keep_trace_determinant_and_norm(v in prop::array::uniform6(-10.0..10.0f64)) {
            let [a, b, c, d, e, f] = v;
            let m = [[a, b, c], [b, d, e], [c, e, f]];
            let l = eigenvalues(m);
            let trace = a + d + f;
            let norm = m.iter().flatten().fold(0.0, |s, x| s + x * x);
            let det = a * (d * f - e * e) - b * (b * f - e * c) + c * (b * e - d * c);
            prop_assert!((l[0] + l[1] + l[2] - trace).abs() < 1e-10);
            prop_assert!((l[0] * l[0] + l[1] * l[1] + l[2] * l[2] - norm).abs() < 1e-8);
            prop_assert!((l[0] * l[1] * l[2] - det).abs() < 1e-8);
        }

        #[test]
        fn both_factors_stay_in_the_unit_interval(
            points in prop::collection::vec((prop::array::uniform3(-1.0..1.0f64), prop::array::uniform3(-1.0..1.0f64), 0.0..1.0f64), 0..40)
        ) {
            let surfels = Surfels {
                centers: points.iter().map(|p| DVec3::from_array(p.0)).collect(),
                normals: points.iter().map(|p| DVec3::from_array(p.1).normalize_or(DVec3::Z)).collect(),
                weights: points.iter().map(|p| p.2).collect(),
            };
            let v = vend(&surfels, CELLS);
            prop_assert!((0.0..=1.0).contains(&v.extent));
            prop_assert!((0.0..=1.0).contains(&v.diversity));
            prop_assert!((0.0..=100.0).contains(&v.vend));
        }
    }
}
