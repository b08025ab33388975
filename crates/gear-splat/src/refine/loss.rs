//! The data term of one target: weighted L1 and structural similarity, with its gradient.
//!
//! Only the rectangle of pixels with a weight is looked at, with room for the windows around them: there every window
//! is whole, so that cutting changes nothing.

use rayon::prelude::*;

use super::RefineError;
use super::ssim::{self, Fixed, Window};
use crate::render::PixelGradients;
use crate::{Camera, Rendering, View, Views};

/// One view to be matched.
pub(super) struct Target {
    /// Index among the views.
    pub view: usize,
    pub camera: Camera,
    /// Whether the camera stands where the scene's canonical one does.
    pub is_canonical: bool,
    /// Factor of this view in the sum; the mean over views is 1.
    pub share: f64,
    /// The rectangle: left, top, width, height.
    rect: [usize; 4],
    /// Weights of the rectangle's pixels over N.
    weights: Vec<f32>,
    /// Target colours, by channel, and their blurred maps.
    channels: [Fixed; 3],
    window: Window,
    ssim: f32,
}

impl Target {
    /// The views that have a pixel with a weight. A view without weights is trusted where it is covered, or everywhere
    /// when it carries no coverage either.
    pub fn all(views: &Views, ssim: f32, canonical: Option<&Camera>) -> Result<Vec<Self>, RefineError> {
        let mut all_weights = Vec::new();
        let mut most = 0.0f64;
        for view in &views.views {
            let size = (view.camera.width as usize, view.camera.height as usize);
            let problem = |problem: String| RefineError::View {
                view: view.name.clone(),
                problem,
            };
            if !view.camera.is_valid() || view.rgb.size() != size {
                let (w, h) = view.rgb.size();
                return Err(problem(format!(
                    "{w}x{h} pixels do not fit its camera of {}x{}",
                    size.0, size.1
                )));
            }
            let source = view.weight.as_ref().or(view.alpha.as_ref());
            if source.is_some_and(|s| s.size() != size) {
                return Err(problem("its weights have another size than its colours".into()));
            }
            let colors = view.rgb.data();
            let weights: Vec<f32> = (0..colors.len())
                .map(|i| {
                    let weight = source.map_or(1.0, |s| s.data()[i]);
                    // NaN weights and colours count as not trusted.
                    let usable = weight > 0.0 && colors[i].iter().all(|c| c.is_finite());
                    if usable { weight.min(1.0) } else { 0.0 }
                })
                .collect();
            most = most.max(weights.iter().map(|&w| f64::from(w)).sum());
            all_weights.push(weights);
        }
        let mut targets: Vec<Self> = views
            .views
            .iter()
            .zip(all_weights)
            .enumerate()
            .filter_map(|(index, (view, weights))| Self::new(index, view, &weights, most, ssim))
            .collect();
        let count = targets.len();
        let same = |a: &Camera, b: &Camera| a.rotation == b.rotation && a.translation == b.translation;
        if let Some(front) = targets
            .iter()
            .position(|t| canonical.is_some_and(|c| same(c, &t.camera)))
        {
            targets[front].is_canonical = true;
            if count > 1 {
                for (k, target) in targets.iter_mut().enumerate() {
                    let peers = if k == front { 1 } else { count - 1 };
                    target.share = 0.5 * count as f64 / peers as f64;
                }
            }
        }
        Ok(targets)
    }

    fn new(index: usize, view: &View, weights: &[f32], most: f64, ssim: f32) -> Option<Self> {
        let rgb = &view.rgb;
        let (width, height) = rgb.size();
        let window = Window::for_size(width, height);
        let rect = weighted_rect(weights, width, height, window.radius())?;
        let scale = 1.0 / most as f32;
        let weights = cut(rect, width, |i| weights[i] * scale);
        let channels = [0, 1, 2].map(|c| {
            let plane = cut(rect, width, |i| {
                let x = rgb.data()[i][c];
                if x.is_finite() { x } else { 0.0 }
            });
            Fixed::new(plane, rect[2], &window)
        });
        Some(Self {
            view: index,
            camera: view.camera,
            is_canonical: false,
            share: 1.0,
            rect,
            weights,
            channels,
            window,
            ssim,
        })
    }

    fn drawn(&self, rendering: &Rendering, channel: usize) -> Vec<f32> {
        let rgb = rendering.rgb.as_ref().expect("refinement draws colour");
        cut(self.rect, rgb.width(), |i| rgb.data()[i][channel])
    }

    /// The data term.
    pub fn loss(&self, rendering: &Rendering) -> f64 {
        let channel = |c: usize| {
            let x = self.drawn(rendering, c);
            let mut absolute = 0.0f64;
            let mut trust = 0.0f64;
            for ((x, y), w) in x.iter().zip(&self.channels[c].y).zip(&self.weights) {
                absolute += f64::from(*w) * f64::from((x - y).abs());
                trust += f64::from(*w);
            }
            let mut total = (1.0 - f64::from(self.ssim)) * absolute;
            if self.ssim > 0.0 {
                let similar = ssim::weighted_sum(&x, &self.channels[c], &self.weights, self.rect[2], &self.window);
                total += f64::from(self.ssim) * (trust - similar);
            }
            total / 3.0
        };
        channel(0) + channel(1) + channel(2)
    }

    /// `scale` times the gradient of the data term by the pixels of the rendering.
    pub fn gradient(&self, rendering: &Rendering, scale: f32) -> PixelGradients {
        let [left, top, width, _] = self.rect;
        let planes: Vec<Vec<f32>> = (0..3)
            .map(|c| {
                let x = self.drawn(rendering, c);
                let mut gradient = if self.ssim > 0.0 {
                    let v: Vec<f32> = self.weights.iter().map(|w| -self.ssim * scale / 3.0 * w).collect();
                    ssim::gradient(&x, &self.channels[c], &v, width, &self.window)
                } else {
                    vec![0.0; x.len()]
                };
                let share = (1.0 - self.ssim) * scale / 3.0;
                for i in 0..x.len() {
                    let d = x[i] - self.channels[c].y[i];
                    let sign = if d > 0.0 {
                        1.0
                    } else if d < 0.0 {
                        -1.0
                    } else {
                        0.0
                    };
                    gradient[i] += share * self.weights[i] * sign;
                }
                gradient
            })
            .collect();
        let size = self.camera.width as usize;
        let mut rgb = vec![[0.0; 3]; size * self.camera.height as usize];
        for (y, row) in rgb.chunks_exact_mut(size).skip(top).take(self.rect[3]).enumerate() {
            for (x, pixel) in row[left..left + width].iter_mut().enumerate() {
                *pixel = [0, 1, 2].map(|c| planes[c][y * width + x]);
            }
        }
        PixelGradients {
            rgb,
            ..PixelGradients::default()
        }
    }

    /// Peak signal-to-noise ratio over pixels with at least half of the largest weight, colours held to [0, 1].
    pub fn psnr(&self, rendering: &Rendering) -> f64 {
        let most = self.weights.iter().fold(0.0f32, |a, &b| a.max(b));
        let (mut square, mut count) = (0.0f64, 0.0f64);
        for c in 0..3 {
            let x = self.drawn(rendering, c);
            for ((x, y), w) in x.iter().zip(&self.channels[c].y).zip(&self.weights) {
                if *w >= 0.5 * most {
                    let d = f64::from(x.clamp(0.0, 1.0) - y);
                    square += d * d;
                    count += 1.0;
                }
            }
        }
        -10.0 * libm::log10((square / count.max(1.0)).max(1e-12))
    }
}

/// The pixels of a rectangle, row by row.
fn cut(rect: [usize; 4], width: usize, value: impl Fn(usize) -> f32 + Sync) -> Vec<f32> {
    let [left, top, columns, rows] = rect;
    let mut out = vec![0.0; columns * rows];
    out.par_chunks_mut(columns)
        .with_min_len(32)
        .enumerate()
        .for_each(|(y, row)| {
            for (x, out) in row.iter_mut().enumerate() {
                *out = value((top + y) * width + left + x);
            }
        });
    out
}

/// The rectangle of the pixels with a weight, `margin` wider on each side; `None` when there is none.
fn weighted_rect(weights: &[f32], width: usize, height: usize, margin: usize) -> Option<[usize; 4]> {
    let (mut left, mut right, mut top, mut bottom) = (width, 0, height, 0);
    for (y, row) in weights.chunks_exact(width).enumerate() {
        let Some(first) = row.iter().position(|&w| w > 0.0) else {
            continue;
        };
        let last = row.iter().rposition(|&w| w > 0.0).unwrap_or(first);
        left = left.min(first);
        right = right.max(last + 1);
        top = top.min(y);
        bottom = y + 1;
    }
    if left >= right {
        return None;
    }
    let (left, top) = (left.saturating_sub(margin), top.saturating_sub(margin));
    let (right, bottom) = ((right + margin).min(width), (bottom + margin).min(height));
    Some([left, top, right - left, bottom - top])
}
