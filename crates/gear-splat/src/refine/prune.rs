//! Leaves out what does not show.
//!
//! A Gaussian may be left out where it is fainter than wanted, or where no target's view sees it. Left out alone, one that
//! adds wᵢ = T α to a pixel changes that pixel by at most wᵢ of the colour range; but many overlap, so that each being
//! faint is not enough. The test is therefore by pixel: all that is left out may add up to no more than 1/255 anywhere.
//!
//! Nothing but the rasteriser is needed. The picture of a scene whose candidates are white and whose others are black,
//! over black, is the sum of the candidates' weights; the gradient by colours for a gradient of one at some pixels is what
//! each Gaussian adds to these pixels. Candidates are the Gaussians that add less to the brightest view than a pixel may
//! change. While some pixel is above the bound, those that add to such pixels are no candidates any more.

use super::{DRAWN, Run};
use crate::device::{DeviceError, Frame};
use crate::render::{ALPHA_MIN, PixelGradients, Wanted};
use crate::sh::{self, Y0};
use crate::{RenderOptions, Rendering, Scene};

/// What is left out of the result.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Prune {
    /// Gaussians with less opacity.
    pub opacity: f64,
    /// What no target's view sees. The back of an object that is looked at from the front is lost.
    pub unseen: bool,
}

impl Run<'_> {
    /// Leaves out of the best scene what `options.prune` says; returns how many.
    pub(super) fn prune(&mut self) -> Result<usize, DeviceError> {
        let Prune { opacity, unseen } = self.options.prune;
        if opacity <= 0.0 && !unseen {
            return Ok(0);
        }
        let scene = &self.best.2;
        let mut keep: Vec<bool> = (0..scene.len())
            .map(|i| f64::from(scene.opacity(i)) >= opacity)
            .collect();
        if unseen {
            let kept = scene.filtered(|i| keep[i]);
            let mut seen = self.seen(&kept)?.into_iter();
            for keep in keep.iter_mut().filter(|keep| **keep) {
                *keep = seen.next().unwrap_or(true);
            }
        }
        let before = scene.len();
        self.best.2 = scene.filtered(|i| keep[i]);
        Ok(before - self.best.2.len())
    }

    /// Which Gaussians must stay, so that no pixel of any target's view changes by more than 1/255.
    fn seen(&self, scene: &Scene) -> Result<Vec<bool>, DeviceError> {
        let options = RenderOptions {
            background: [0.0; 3],
            ..self.options.render
        };
        let mut probe = scene.clone();
        probe.sh_degree = 0;
        probe.sh_rest.clear();
        let mut frames = Vec::new();
        for target in &self.targets {
            frames.push(self.device.frame(&probe, &target.camera, &options, DRAWN)?);
        }
        let mut shown = vec![0.0f32; probe.len()];
        for frame in &mut frames {
            let added = added(frame, &mut probe, |_| true)?;
            shown
                .iter_mut()
                .zip(added)
                .for_each(|(shown, added)| *shown = shown.max(added));
        }
        let mut seen: Vec<bool> = shown.iter().map(|&shown| shown >= ALPHA_MIN).collect();
        for frame in &mut frames {
            loop {
                let sums = draw(frame, &mut probe, &seen)?;
                let above = |i: usize| sums[i][0] >= ALPHA_MIN;
                if !(0..sums.len()).any(above) {
                    break;
                }
                let added = added(frame, &mut probe, above)?;
                let mut fewer = false;
                for (seen, added) in seen.iter_mut().zip(added) {
                    fewer |= !*seen && added > 0.0;
                    *seen |= added > 0.0;
                }
                if !fewer {
                    break;
                }
            }
        }
        Ok(seen)
    }
}

/// The picture in which what is not `seen` is white and the rest black.
fn draw(frame: &mut Frame, probe: &mut Scene, seen: &[bool]) -> Result<Vec<[f32; 3]>, DeviceError> {
    for (color, seen) in probe.sh_dc.iter_mut().zip(seen) {
        *color = [sh::dc_from_color(if *seen { 0.0 } else { 1.0 }); 3];
    }
    frame.recolor(probe);
    Ok(picture(&frame.draw(probe)?).to_vec())
}

/// What each Gaussian adds to the pixels for which `counts` holds.
fn added(frame: &mut Frame, probe: &mut Scene, counts: impl Fn(usize) -> bool) -> Result<Vec<f32>, DeviceError> {
    probe.sh_dc.fill([0.0; 3]);
    frame.recolor(probe);
    let drawn = frame.draw(probe)?;
    let ones = (0..picture(&drawn).len()).map(|i| if counts(i) { [1.0, 0.0, 0.0] } else { [0.0; 3] });
    let gradient = PixelGradients {
        rgb: ones.collect(),
        ..PixelGradients::default()
    };
    let by = frame.backward(probe, &drawn, &gradient, Wanted::COLORS)?;
    Ok(by.sh_dc.iter().map(|by| by[0] / Y0).collect())
}

fn picture(rendering: &Rendering) -> &[[f32; 3]] {
    rendering.rgb.as_ref().expect("colour was asked for").data()
}
