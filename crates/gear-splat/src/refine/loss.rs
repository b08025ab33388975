//! The data term of one target: weighted L1 and structural similarity, with its gradient.
//!
//! Only the rectangle of pixels with a weight is looked at, with room for the windows around them: there every window
//! is whole, so that cutting changes nothing. An orthographic camera is cut to it too, and draws nothing else; a
//! pinhole's is not, since the field of view decides how a Gaussian beyond its edge is projected.

use rayon::prelude::*;

use super::RefineError;
use super::ssim::{self, Compared, Fixed, Scratch, Window, pitch};
use crate::cpu::SimdLevel;
use crate::cpu::simd::simd_kernels;
use crate::render::PixelGradients;
use crate::{Camera, Projection, Rendering, View, Views};

/// One view to be matched.
pub(super) struct Target {
    /// Index among the views.
    pub view: usize,
    /// The camera that draws what is compared.
    pub camera: Camera,
    /// Whether the camera stands where the scene's canonical one does.
    pub is_canonical: bool,
    /// Factor of this view in the sum; the mean over views is 1.
    pub share: f64,
    /// The rectangle in that camera's pictures: left, top, width, height.
    rect: [usize; 4],
    /// Weights of the rectangle's pixels over N, at their pitch.
    weights: Vec<f32>,
    /// Target colours, by channel, and their blurred maps.
    channels: [Fixed; 3],
    window: Window,
    /// λ_s.
    pub ssim: f32,
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
        let weights = plane(rect, width, |i| weights[i] * scale);
        let channels = [0, 1, 2].map(|c| {
            let y = plane(rect, width, |i| {
                let x = rgb.data()[i][c];
                if x.is_finite() { x } else { 0.0 }
            });
            Fixed::new(y, rect[2], &window)
        });
        let (camera, rect) = cut_camera(view.camera, rect);
        Some(Self {
            view: index,
            camera,
            is_canonical: false,
            share: 1.0,
            rect,
            weights,
            channels,
            window,
            ssim,
        })
    }

    pub fn compared<'a>(&'a self, rendering: &'a Rendering) -> Compared<'a> {
        let rgb = rendering.rgb.as_ref().expect("refinement draws colour");
        Compared {
            rgb: rgb.data(),
            columns: rgb.width(),
            rect: self.rect,
            fixed: &self.channels,
            weights: &self.weights,
            window: self.window,
        }
    }

    /// The data term.
    pub fn loss(&self, rendering: &Rendering) -> f64 {
        let compared = self.compared(rendering);
        let rows: Vec<f64> = (0..self.rect[3])
            .into_par_iter()
            .with_min_len(32)
            .map(|y| compared.absolute(y))
            .collect();
        let mut total = (1.0 - f64::from(self.ssim)) * rows.iter().sum::<f64>();
        if self.ssim > 0.0 {
            total += f64::from(self.ssim) * ssim::dissimilarity(&compared);
        }
        total / 3.0
    }

    /// Writes `scale` times the gradient of the data term by the pixels of the rendering to `out`.
    pub fn gradient(&self, rendering: &Rendering, scale: f32, scratch: &mut Scratch, out: &mut PixelGradients) {
        let compared = self.compared(rendering);
        let share = (1.0 - self.ssim) * scale / 3.0;
        let level = SimdLevel::current();
        let absolute = |y: usize, row: &mut [[f32; 3]]| sign_row(level, &compared, y, share, row);
        self.write_gradient(&compared, self.ssim * scale / 3.0, scratch, out, absolute);
    }

    /// Writes what `absolute` makes of each row of the rectangle, and `similar` times the gradient of Σ w (1 − S).
    pub fn write_gradient(
        &self,
        compared: &Compared,
        similar: f32,
        scratch: &mut Scratch,
        out: &mut PixelGradients,
        absolute: impl Fn(usize, &mut [[f32; 3]]) + Sync,
    ) {
        let pixels = self.camera.width as usize * self.camera.height as usize;
        let [_, _, width, height] = self.rect;
        if width * height != pixels {
            // What lies beside the rectangle has no gradient.
            out.rgb.clear();
        }
        out.rgb.resize(pixels, [0.0; 3]);
        ssim::gradient(compared, -similar, scratch, &mut out.rgb, absolute);
    }

    /// Peak signal-to-noise ratio over pixels with at least half of the largest weight, colours held to [0, 1].
    pub fn psnr(&self, rendering: &Rendering) -> f64 {
        let compared = self.compared(rendering);
        let least = 0.5 * self.weights.iter().fold(0.0f32, |a, &b| a.max(b));
        let rows: Vec<[f64; 2]> = (0..self.rect[3])
            .into_par_iter()
            .with_min_len(32)
            .map(|y| compared.square(y, least))
            .collect();
        let (square, count) = rows.iter().fold((0.0, 0.0), |(a, b), [x, y]| (a + x, b + y));
        -10.0 * libm::log10((square / f64::max(count, 1.0)).max(1e-12))
    }
}

impl Compared<'_> {
    /// Σ w |x − y| of row `y`.
    fn absolute(&self, y: usize) -> f64 {
        let (row, weights) = (self.row(y), self.plane_row(self.weights, y));
        let mut total = 0.0;
        for (c, fixed) in self.fixed.iter().enumerate() {
            for ((x, y), w) in row.iter().zip(self.plane_row(&fixed.y, y)).zip(weights) {
                total += f64::from(*w) * f64::from((x[c] - y).abs());
            }
        }
        total
    }

    /// Σ (x − y)² of row `y`, and how many terms that is, where the weight is at least `least`.
    fn square(&self, y: usize, least: f32) -> [f64; 2] {
        let (row, weights) = (self.row(y), self.plane_row(self.weights, y));
        let (mut square, mut count) = (0.0, 0.0);
        for (c, fixed) in self.fixed.iter().enumerate() {
            for ((x, y), w) in row.iter().zip(self.plane_row(&fixed.y, y)).zip(weights) {
                if *w >= least {
                    let d = f64::from(x[c].clamp(0.0, 1.0) - y);
                    square += d * d;
                    count += 1.0;
                }
            }
        }
        [square, count]
    }
}

simd_kernels! {
    /// `share` · w · sign(x − y).
    fn sign_row(compared: &Compared, y: usize, share: f32, out: &mut [[f32; 3]]) {
        let (row, weights) = (compared.row(y), compared.plane_row(compared.weights, y));
        let targets = compared.fixed.each_ref().map(|fixed| compared.plane_row(&fixed.y, y));
        let len = out.len();
        let (row, weights, targets) = (&row[..len], &weights[..len], targets.map(|target| &target[..len]));
        for i in 0..len {
            let step = share * weights[i];
            for c in 0..3 {
                let d = row[i][c] - targets[c][i];
                let up = if d > 0.0 { step } else { 0.0 };
                out[i][c] = if d < 0.0 { -step } else { up };
            }
        }
    }
}

/// The camera that sees only a rectangle of another's picture, and where the rectangle lies in its own.
fn cut_camera(camera: Camera, rect: [usize; 4]) -> (Camera, [usize; 4]) {
    let [left, top, width, height] = rect;
    match camera.projection {
        Projection::Pinhole { .. } => (camera, rect),
        Projection::Orthographic { .. } => (
            Camera {
                principal: [camera.principal[0] - left as f32, camera.principal[1] - top as f32],
                width: width as u32,
                height: height as u32,
                ..camera
            },
            [0, 0, width, height],
        ),
    }
}

/// The pixels of a rectangle, row by row at their pitch.
fn plane(rect: [usize; 4], columns: usize, value: impl Fn(usize) -> f32 + Sync) -> Vec<f32> {
    let [left, top, width, height] = rect;
    let mut out = vec![0.0; pitch(width) * height];
    out.par_chunks_mut(pitch(width))
        .with_min_len(32)
        .enumerate()
        .for_each(|(y, row)| {
            for (x, out) in row[..width].iter_mut().enumerate() {
                *out = value((top + y) * columns + left + x);
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
