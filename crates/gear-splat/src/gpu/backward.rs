//! Stages 5 and 6: derivatives by the pixels become derivatives by the scene.

use glam::{Vec3, Vec4};

use super::device::Kernel;
use super::{Frame, GpuError, view};
use crate::Scene;
use crate::render::{PixelGradients, Rendering, SceneGradients, Wanted};

const BLEND_BACKWARD: Kernel = Kernel {
    constants: &["SHAPE"],
    ..Kernel::new(
        module!("common.wgsl", "tiles.wgsl", "blend_backward.wgsl"),
        "blend_backward",
    )
};
const PROJECT_BACKWARD: Kernel = Kernel {
    constants: &["SHAPE"],
    ..Kernel::new(
        module!(
            "common.wgsl",
            "footprint.wgsl",
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
    /// [`Frame::draw`] gave. Derivatives by depth and normals are left to the CPU.
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
        if !pixels.depth.is_empty() || !pixels.normal.is_empty() {
            return Err(GpuError::Unsupported("derivatives by depth and normals"));
        }
        let shape = wanted.moves_shapes();
        let switches = shape.into();
        let loss = gpu.upload(&self.loss(rendering, pixels))?;
        let sums = gpu.buffer(self.pairs * if shape { 9 } else { 3 })?;
        let stride = view::color_words(scene.sh_degree);
        let by_shape = gpu.buffer(if shape { self.count * SHAPE_WORDS } else { 1 })?;
        let by_harmonics = gpu.buffer(self.count * stride)?;

        let mut recording = gpu.record();
        let buffers = [
            (0, &self.view),
            (1, &self.splats),
            (2, &self.colors),
            (3, &self.owners),
            (4, &self.slots),
            (5, &self.starts),
            (6, &self.walked),
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
        Ok(gradients(
            &read[0],
            stride,
            shape.then_some(&read[1][..]),
            self.count,
            wanted,
        ))
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
}

fn gradients(
    by_harmonics: &[f32],
    stride: usize,
    by_shape: Option<&[f32]>,
    count: usize,
    wanted: Wanted,
) -> SceneGradients {
    let taken = |wanted: bool| if wanted { count } else { 0 };
    let harmonics = || by_harmonics.chunks_exact(stride).take(taken(wanted.colors));
    let shapes = |wanted| {
        by_shape
            .unwrap_or_default()
            .chunks_exact(SHAPE_WORDS)
            .take(taken(wanted))
    };
    let vec3 = |s: &[f32], at: usize| Vec3::new(s[at], s[at + 1], s[at + 2]);
    SceneGradients {
        centers: shapes(wanted.centers).map(|s| vec3(s, 0)).collect(),
        log_scales: shapes(wanted.log_scales).map(|s| vec3(s, 3)).collect(),
        rotations: shapes(wanted.rotations)
            .map(|s| Vec4::new(s[6], s[7], s[8], s[9]))
            .collect(),
        opacity_logits: shapes(wanted.opacity_logits).map(|s| s[10]).collect(),
        sh_dc: harmonics().map(|h| [h[0], h[1], h[2]]).collect(),
        sh_rest: harmonics().flat_map(|h| &h[3..]).copied().collect(),
    }
}
