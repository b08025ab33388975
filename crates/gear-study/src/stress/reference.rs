//! Slow, obvious f64 versions of what some nodes compute, to tell how far they are off.
//!
//! Each is written from the equation, in f64, without tricks, and shares no code with the node. They are found by the
//! names of the node type and the output; a node that is not here has no reference and is only looked at for range and
//! finiteness.
//!
//! | output | definition |
//! |---|---|
//! | `LogRatio.ratio` | log(L + ε) − mean log(L + ε), L of sanitised linear light |
//! | `LogRatio.smooth` | mean of that over the window, pixel by pixel |
//! | `Pyramid.ratio` | normalised convolution down and up (see the crate of the node) |
//! | `AdaptiveGain.alpha`, `.ratio` | clip(base · target/(σ + 10⁻⁶)); α R_ms + (1 − α) R_smooth |
//! | `RenderViews.views` | the rasteriser of `gear_splat::reference`: every pixel looks at every Gaussian |

use gear_graph::{AnyValue, Number, ParamValues, Slot};
use gear_image::{Field, Image};
use gear_splat::{RenderOptions, Scene, Views, reference};

use crate::planes::Plane;

/// More work than this (pixels times Gaussians, pixels times window) is not done.
const MOST_WORK: usize = 100_000_000;

/// What a node was given and what it gave.
pub struct Given<'t> {
    /// Its type.
    pub node: &'t str,
    /// Its parameters, defaults filled in.
    pub params: &'t ParamValues,
    /// Its input ports and what was there.
    pub inputs: &'t [(&'static str, Slot)],
    /// Its outputs.
    pub outputs: &'t [(&'static str, AnyValue)],
}

/// What an output should have been: planes of it, by name. `None` where there is no reference for it.
pub fn reference(given: &Given<'_>, output: &str) -> Option<Vec<Plane>> {
    let value = |numbers: Vec<f64>| {
        Some(vec![Plane {
            name: "value".to_owned(),
            numbers,
        }])
    };
    match (given.node, output) {
        ("LogRatio", "ratio") => value(given.log_ratio()?.0),
        ("LogRatio", "smooth") => {
            let (ratio, width, height) = given.log_ratio()?;
            let share = given.params.get("radius")?.as_f64()?;
            let longer = width.max(height) as f64;
            let radius = if share == 0.0 {
                0
            } else {
                (share * longer).round().max(1.0) as usize
            };
            value(box_mean(&ratio, width, height, radius)?)
        }
        ("Pyramid", "ratio") => value(given.pyramid()?),
        ("AdaptiveGain", "alpha") => value(vec![given.alpha()?]),
        ("AdaptiveGain", "ratio") => {
            let (alpha, smooth) = (given.alpha()?, given.input::<Field>("smooth")?);
            let multiscale = given.input::<Field>("multiscale")?;
            let pairs = multiscale.data().iter().zip(smooth.data());
            value(
                pairs
                    .map(|(&m, &s)| alpha * finite(m) + (1.0 - alpha) * finite(s))
                    .collect(),
            )
        }
        ("RenderViews", "views") => given.views(),
        _ => None,
    }
}

/// The largest difference of two lists of planes, as a share of the largest number of the first, or of 1. Planes of the
/// reference that the value does not have count as infinitely far.
pub fn error(reference: &[Plane], found: &[Plane]) -> f64 {
    let mut worst: f64 = 0.0;
    for plane in reference {
        let scale = plane
            .numbers
            .iter()
            .filter(|x| x.is_finite())
            .fold(1.0, |a: f64, x| a.max(x.abs()));
        let other = found.iter().find(|other| other.name == plane.name);
        let Some(other) = other.filter(|other| other.numbers.len() == plane.numbers.len()) else {
            return f64::INFINITY;
        };
        for (a, b) in plane.numbers.iter().zip(&other.numbers) {
            let off = (a - b).abs() / scale;
            let alike = a == b || (a.is_nan() && b.is_nan());
            worst = worst.max(if alike {
                0.0
            } else if off.is_nan() {
                f64::INFINITY
            } else {
                off
            });
        }
    }
    worst
}

/// NaN as 0 and the rest within ±10³⁰: how the nodes of illumination take a damaged ratio.
fn finite(x: f32) -> f64 {
    if x.is_nan() {
        0.0
    } else {
        f64::from(x).clamp(-1e30, 1e30)
    }
}

/// The sRGB transfer function (IEC 61966-2-1), then light that is finite and not negative.
fn light(encoded: f32) -> f64 {
    let c = f64::from(encoded);
    let linear = if c <= 0.04045 {
        c / 12.92
    } else {
        libm::pow((c + 0.055) / 1.055, 2.4)
    };
    if linear > 0.0 { linear.min(1e30) } else { 0.0 }
}

fn box_mean(values: &[f64], width: usize, height: usize, radius: usize) -> Option<Vec<f64>> {
    let (rx, ry) = (radius.min(width), radius.min(height));
    let work = values.len().saturating_mul((2 * rx + 1) * (2 * ry + 1));
    if work > MOST_WORK {
        return None;
    }
    let mut out = Vec::with_capacity(values.len());
    for y in 0..height {
        for x in 0..width {
            let (mut sum, mut count) = (0.0, 0.0);
            for j in y.saturating_sub(ry)..(y + ry + 1).min(height) {
                for i in x.saturating_sub(rx)..(x + rx + 1).min(width) {
                    sum += values[j * width + i];
                    count += 1.0;
                }
            }
            out.push(sum / count);
        }
    }
    Some(out)
}

/// A level of the pyramid: the ratio, the summed weights and how many pixels a cell covers.
struct Level {
    width: usize,
    height: usize,
    ratio: Vec<f64>,
    weight: Vec<f64>,
    pixels: Vec<f64>,
}

impl Level {
    fn halved(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let (mut ratio, mut weight, mut pixels) = (Vec::new(), Vec::new(), Vec::new());
        for y in 0..height {
            for x in 0..width {
                let (mut wr, mut w, mut n) = (0.0, 0.0, 0.0);
                for j in 2 * y..(2 * y + 2).min(self.height) {
                    for i in 2 * x..(2 * x + 2).min(self.width) {
                        let at = j * self.width + i;
                        wr += self.weight[at] * self.ratio[at];
                        w += self.weight[at];
                        n += self.pixels[at];
                    }
                }
                ratio.push(wr / w);
                weight.push(w);
                pixels.push(n);
            }
        }
        Self {
            width,
            height,
            ratio,
            weight,
            pixels,
        }
    }

    fn share(&self, at: usize) -> f64 {
        self.weight[at] / self.pixels[at]
    }
}

/// Where a fine sample lies between coarse ones: two of them and the weight of the second.
fn between(fine: usize, coarse: usize) -> (usize, usize, f64) {
    let at = ((fine as f64 - 0.5) / 2.0).clamp(0.0, (coarse - 1) as f64);
    let low = at.floor() as usize;
    (low, (low + 1).min(coarse - 1), at - low as f64)
}

impl Given<'_> {
    fn input<T: gear_graph::Value>(&self, port: &str) -> Option<std::sync::Arc<T>> {
        self.inputs.iter().find(|(name, _)| *name == port)?.1.first()?.get()
    }

    fn log_ratio(&self) -> Option<(Vec<f64>, usize, usize)> {
        let image = self.input::<Image>("image")?;
        if self.params.get("scale")?.as_str()? != "display" {
            return None;
        }
        let epsilon = self.params.get("epsilon")?.as_f64()?;
        let luminance = |c: &[f32; 3]| 0.2126 * light(c[0]) + 0.7152 * light(c[1]) + 0.0722 * light(c[2]);
        let logs: Vec<f64> = image
            .rgb
            .data()
            .iter()
            .map(|c| libm::log(luminance(c) + epsilon))
            .collect();
        let mean = logs.iter().sum::<f64>() / logs.len().max(1) as f64;
        let (width, height) = image.size();
        Some((logs.into_iter().map(|log| log - mean).collect(), width, height))
    }

    fn pyramid(&self) -> Option<Vec<f64>> {
        let (ratio, edges) = (self.input::<Field>("ratio")?, self.input::<Field>("edges")?);
        if edges.size() != ratio.size() || self.params.get("levels")?.as_str()? != "auto" {
            return None;
        }
        let (kappa, tau) = (self.params.get("kappa")?.as_f64()?, self.params.get("tau")?.as_f64()?);
        let (width, height) = ratio.size();
        let side = width.min(height);
        let most = if side < 8 {
            1
        } else {
            (1 + (side / 8).ilog2() as usize).min(7)
        };
        let edge = |e: f32| if e > 0.0 { f64::from(e).min(1.0) } else { 0.0 };
        let mut levels = vec![Level {
            width,
            height,
            ratio: ratio.data().iter().map(|&r| finite(r)).collect(),
            weight: edges.data().iter().map(|&e| 1.0 / (1.0 + kappa * edge(e))).collect(),
            pixels: vec![1.0; ratio.len()],
        }];
        while levels.len() < most {
            levels.push(levels.last()?.halved());
        }
        let mut coarse = levels.pop()?;
        while let Some(mut fine) = levels.pop() {
            for y in 0..fine.height {
                let (y0, y1, fy) = between(y, coarse.height);
                for x in 0..fine.width {
                    let (x0, x1, fx) = between(x, coarse.width);
                    let (mut vm, mut v) = (0.0, 0.0);
                    for (j, wy) in [(y0, 1.0 - fy), (y1, fy)] {
                        for (i, wx) in [(x0, 1.0 - fx), (x1, fx)] {
                            let at = j * coarse.width + i;
                            vm += wy * wx * coarse.share(at) * coarse.ratio[at];
                            v += wy * wx * coarse.share(at);
                        }
                    }
                    let at = y * fine.width + x;
                    let t = 1.0 - (1.0 - tau) * fine.share(at);
                    fine.ratio[at] = (1.0 - t) * vm / v + t * fine.ratio[at];
                }
            }
            coarse = fine;
        }
        Some(coarse.ratio)
    }

    fn alpha(&self) -> Option<f64> {
        let adaptive = self.params.get("mode")?.get("adaptive")?;
        let number = |name: &str| adaptive.get(name).and_then(serde_json::Value::as_f64);
        let multiscale = self.input::<Field>("multiscale")?;
        // A spread of numbers that are none is none; the node then takes the least α.
        if multiscale.data().iter().any(|x| !x.is_finite()) {
            return self
                .outputs
                .iter()
                .find(|(name, _)| *name == "alpha")?
                .1
                .get::<Number>()
                .map(|n| n.0);
        }
        let count = multiscale.len().max(1) as f64;
        let mean = multiscale.data().iter().map(|&x| f64::from(x)).sum::<f64>() / count;
        let squares = multiscale
            .data()
            .iter()
            .map(|&x| (f64::from(x) - mean) * (f64::from(x) - mean));
        let deviation = (squares.sum::<f64>() / count).sqrt();
        let alpha = number("base")? * number("target")? / (deviation + 1e-6);
        Some(alpha.clamp(number("min")?, number("max")?))
    }

    fn views(&self) -> Option<Vec<Plane>> {
        let scene = self.input::<Scene>("scene")?;
        let views = self
            .outputs
            .iter()
            .find(|(name, _)| *name == "views")?
            .1
            .get::<Views>()?;
        let pixels: usize = views.views.iter().map(|view| view.rgb.len()).sum();
        if pixels.saturating_mul(scene.len()) > MOST_WORK {
            return None;
        }
        let mut planes = Vec::new();
        for view in &views.views {
            let slow = reference::render(&scene, &view.camera, &RenderOptions::default());
            let colours = slow.rgb.as_flattened().iter().map(|c| c.clamp(0.0, 1.0));
            planes.push(Plane {
                name: format!("{}.rgb", view.name),
                numbers: colours.collect(),
            });
            if view.alpha.is_some() {
                planes.push(Plane {
                    name: format!("{}.alpha", view.name),
                    numbers: slow.alpha,
                });
            }
        }
        Some(planes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(name: &str, numbers: &[f64]) -> Plane {
        Plane {
            name: name.into(),
            numbers: numbers.to_vec(),
        }
    }

    #[test]
    fn an_error_is_a_share_of_the_largest_number_or_of_one() {
        let small = plane("a", &[0.5, 0.25]);
        assert_eq!(error(std::slice::from_ref(&small), &[plane("a", &[0.5, 0.75])]), 0.5);
        assert_eq!(error(&[plane("a", &[100.0, 0.0])], &[plane("a", &[100.0, 1.0])]), 0.01);
        let nan = plane("a", &[f64::NAN, f64::INFINITY]);
        assert_eq!(error(std::slice::from_ref(&nan), std::slice::from_ref(&nan)), 0.0);
        assert_eq!(error(std::slice::from_ref(&small), &[nan]), f64::INFINITY);
        assert_eq!(
            error(std::slice::from_ref(&small), &[plane("b", &[0.5, 0.25])]),
            f64::INFINITY
        );
        assert_eq!(error(&[small], &[plane("a", &[0.5])]), f64::INFINITY);
    }

    #[test]
    fn the_window_is_cut_by_the_rim() {
        let ramp: Vec<f64> = (0..6).map(f64::from).collect();
        assert_eq!(box_mean(&ramp, 6, 1, 1).unwrap(), [0.5, 1.0, 2.0, 3.0, 4.0, 4.5]);
        assert_eq!(box_mean(&ramp, 3, 2, 50).unwrap(), [2.5; 6]);
    }

    #[test]
    fn a_fine_sample_lies_between_the_nearest_coarse_ones() {
        assert_eq!(between(0, 4), (0, 1, 0.0));
        assert_eq!(between(1, 4), (0, 1, 0.25));
        assert_eq!(between(2, 4), (0, 1, 0.75));
        assert_eq!(between(7, 4), (3, 3, 0.0));
    }
}
