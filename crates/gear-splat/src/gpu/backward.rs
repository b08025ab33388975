//! Stages 5 and 6: derivatives by the pixels become derivatives by the scene.

use glam::{Vec3, Vec4};

use super::device::Kernel;
use super::{Frame, GpuError, SUMS, view};
use crate::Scene;
use crate::render::{PixelGradients, Rendering, SceneGradients, Wanted};

const BLEND_BACKWARD: Kernel = Kernel {
    constants: &["SHAPE", "SURFACE"],
    ..Kernel::new(
        module!("common.wgsl", "tiles.wgsl", "surface.wgsl", "blend_backward.wgsl"),
        "blend_backward",
    )
};
const PROJECT_BACKWARD: Kernel = Kernel {
    constants: &["SHAPE", "SURFACE"],
    ..Kernel::new(
        module!(
            "common.wgsl",
            "footprint.wgsl",
            "plane.wgsl",
            "sh.wgsl",
            "raw_color.wgsl",
            "project_backward.wgsl"
        ),
        "project_backward",
    )
};

/// Gaussians a workgroup of the chain rule handles.
const BLOCK: usize = 64;
/// Numbers of `by_shape` a Gaussian.
const SHAPE_WORDS: usize = 11;

impl Frame {
    /// Derivatives of a loss by the scene, from its derivatives by the pixels of `rendering`, which must be what
    /// [`Frame::draw`] gave.
    ///
    /// # Panics
    /// When a picture that has gradients was not drawn, or a gradient has not one entry a pixel: a caller's bug.
    pub fn backward(
        &self,
        scene: &Scene,
        rendering: &Rendering,
        pixels: &PixelGradients,
        wanted: Wanted,
    ) -> Result<SceneGradients, GpuError> {
        let gpu = &self.gpu;
        let shape = wanted.moves_shapes();
        let surface = shape && (!pixels.depth.is_empty() || !pixels.normal.is_empty());
        let switches = u32::from(shape) | u32::from(surface) << 1;
        let mut planes = self.loss(rendering, pixels);
        if surface {
            let sums = self.blend(SUMS)?;
            self.add_surface_loss(&mut planes, rendering, pixels, &sums);
        }
        let loss = gpu.upload(&planes)?;
        // The same numbers as in `stride` of blend_backward.wgsl.
        let sums = gpu.buffer(
            self.pairs
                * if surface {
                    17
                } else if shape {
                    9
                } else {
                    3
                },
        )?;
        let stride = view::color_words(scene.sh_degree);
        let by_shape = gpu.buffer(if shape { self.count * SHAPE_WORDS } else { 1 })?;
        let by_harmonics = gpu.buffer(self.count * stride)?;

        let mut recording = gpu.record();
        let buffers = [
            (0, &self.view),
            (1, &self.splats),
            (2, &self.colors),
            (3, &self.surfaces),
            (4, &self.owners),
            (5, &self.slots),
            (6, &self.ranges),
            (7, &loss),
            (8, &sums),
        ];
        let tiles = if self.pairs > 0 { self.tiles() } else { 0 };
        recording.run(
            Kernel {
                switches,
                ..BLEND_BACKWARD
            },
            tiles,
            &buffers,
        );
        let buffers = [
            (0, &self.view),
            (1, &self.gaussians),
            (2, &self.harmonics),
            (3, &self.order),
            (4, &self.offsets),
            (5, &sums),
            (6, &by_shape),
            (7, &by_harmonics),
        ];
        recording.run(
            Kernel {
                switches,
                ..PROJECT_BACKWARD
            },
            self.count.div_ceil(BLOCK),
            &buffers,
        );
        recording.submit();
        let read = gpu.read::<f32>(&[(&by_harmonics, 0), (&by_shape, 0)])?;
        let colors = read[0].chunks_exact(stride).take(self.count);
        let shapes = read[1]
            .chunks_exact(SHAPE_WORDS)
            .take(if shape { self.count } else { 0 });
        Ok(gradients(colors, shapes, wanted))
    }

    /// `loss` in blend_backward.wgsl. The pictures lie on the host because the loss was computed there.
    fn loss(&self, rendering: &Rendering, pixels: &PixelGradients) -> Vec<f32> {
        let count = self.size[0] * self.size[1];
        pixels.check(count);
        let rgb = rendering.rgb.as_ref().map_or(&[][..], |p| p.data());
        let alpha = rendering.alpha.as_ref().map_or(&[][..], |p| p.data());
        assert!(pixels.rgb.is_empty() || rgb.len() == count, "colour was drawn");
        assert!(pixels.alpha.is_empty() || alpha.len() == count, "coverage was drawn");
        let mut planes = vec![0.0; 5 * count.max(1)];
        for i in 0..count {
            let g = pixels.rgb.get(i).copied().unwrap_or_default();
            let by_alpha = pixels.alpha.get(i).copied().unwrap_or_default();
            let (mut ground, mut shown) = (0.0, 0.0);
            for c in 0..3 {
                planes[c * count + i] = g[c];
                ground += g[c] * self.background[c];
                shown += g[c] * (rgb.get(i).map_or(0.0, |p| p[c]) - self.background[c]);
            }
            planes[3 * count + i] = by_alpha - ground;
            planes[4 * count + i] = shown + by_alpha * alpha.get(i).copied().unwrap_or_default();
        }
        planes
    }

    /// The planes for depth and normals, from the plane Σ w and the plane |Σ w n|.
    fn add_surface_loss(&self, planes: &mut Vec<f32>, rendering: &Rendering, pixels: &PixelGradients, sums: &[f32]) {
        let count = self.size[0] * self.size[1];
        planes.resize(10 * count.max(1), 0.0);
        let depth = rendering.depth.as_ref().map_or(&[][..], |p| p.data());
        let normal = rendering.normal.as_deref().unwrap_or_default();
        assert!(pixels.depth.is_empty() || depth.len() == count, "depth was drawn");
        assert!(pixels.normal.is_empty() || normal.len() == count, "normals were drawn");
        for i in 0..count {
            let (weight, length) = (sums[i], sums[count + i]);
            if let Some(&g) = pixels.depth.get(i).filter(|_| weight > 0.0) {
                planes[5 * count + i] = g / weight;
                planes[6 * count + i] = depth[i];
            }
            if let Some(g) = pixels.normal.get(i).filter(|_| length > 0.0) {
                let n = normal[i];
                let along = g[0] * n[0] + g[1] * n[1] + g[2] * n[2];
                for c in 0..3 {
                    planes[(7 + c) * count + i] = (g[c] - n[c] * along) / length;
                }
            }
        }
    }
}

fn gradients<'a>(
    colors: impl Iterator<Item = &'a [f32]> + Clone,
    shapes: impl Iterator<Item = &'a [f32]> + Clone,
    wanted: Wanted,
) -> SceneGradients {
    let vec3 = |s: &[f32], at: usize| Vec3::new(s[at], s[at + 1], s[at + 2]);
    let mut out = SceneGradients::default();
    if wanted.centers {
        out.centers = shapes.clone().map(|s| vec3(s, 0)).collect();
    }
    if wanted.log_scales {
        out.log_scales = shapes.clone().map(|s| vec3(s, 3)).collect();
    }
    if wanted.rotations {
        out.rotations = shapes.clone().map(|s| Vec4::new(s[6], s[7], s[8], s[9])).collect();
    }
    if wanted.opacity_logits {
        out.opacity_logits = shapes.map(|s| s[10]).collect();
    }
    if wanted.colors {
        out.sh_dc = colors.clone().map(|h| [h[0], h[1], h[2]]).collect();
        out.sh_rest = colors.flat_map(|h| &h[3..]).copied().collect();
    }
    out
}
