//! Novel views of a scene beside those of the true surface.

use gear_image::{Field, Mask, fidelity};
use gear_splat::{Camera, Outputs, RenderOptions, Rendering, Scene, orbit, render};

/// How one view compares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewError {
    /// Yaw from the canonical camera, degrees.
    pub yaw: f64,
    /// Peak signal-to-noise ratio where either scene is seen, dB; `None` when nothing is.
    pub psnr_db: Option<f64>,
    /// Structural similarity there.
    pub ssim: Option<f64>,
}

/// Renders both scenes from cameras around the true one and compares colours over the pixels that either covers. The
/// scene is brought to the truth's mean distance first, which a painting does not tell; its scale is left, as it is part
/// of what a viewer sees. `longer_side` is that of the canonical frame; 0 keeps the true scene's.
pub fn novel_views(scene: &Scene, truth: &Scene, yaws: &[f64], longer_side: u32) -> Vec<ViewError> {
    TrueViews::of(truth, yaws, longer_side).compare(scene)
}

/// Views of a true scene, rendered once, for many scenes to be compared with.
pub struct TrueViews {
    front: Camera,
    depth: Option<Field>,
    views: Vec<(f64, Camera, Rendering)>,
}

impl TrueViews {
    /// Renders the true scene; see [`novel_views`].
    pub fn of(truth: &Scene, yaws: &[f64], longer_side: u32) -> Self {
        let front = orbit::cameras(truth, &[0.0], longer_side).swap_remove(0);
        let cameras = orbit::cameras(truth, yaws, longer_side);
        let seen = yaws.iter().zip(cameras);
        Self {
            front,
            depth: depth(truth, &front),
            views: seen
                .map(|(&yaw, camera)| (yaw, camera, picture(truth, &camera)))
                .collect(),
        }
    }

    /// Compares a scene.
    pub fn compare(&self, scene: &Scene) -> Vec<ViewError> {
        let offset = depth(scene, &self.front)
            .zip(self.depth.as_ref())
            .and_then(|(ours, truth)| mean_difference(&ours, truth))
            .unwrap_or(0.0);
        let away = self.front.forward() * offset;
        let mut scene = scene.clone();
        for center in &mut scene.centers {
            *center -= away;
        }
        let error = |(yaw, camera, truth): &(f64, Camera, Rendering)| {
            let shown = picture(&scene, camera);
            let (psnr_db, ssim) = match (&shown.rgb, &truth.rgb) {
                (Some(ours), Some(theirs)) => {
                    let either = either(&shown, truth, ours.size());
                    (
                        fidelity::psnr(ours, theirs, &either),
                        fidelity::ssim(ours, theirs, &either),
                    )
                }
                _ => (None, None),
            };
            ViewError {
                yaw: *yaw,
                psnr_db,
                ssim,
            }
        };
        self.views.iter().map(error).collect()
    }
}

fn picture(scene: &Scene, camera: &Camera) -> Rendering {
    render(scene, camera, &RenderOptions::default(), Outputs::RGBA)
}

fn depth(scene: &Scene, camera: &Camera) -> Option<Field> {
    let outputs = Outputs {
        depth: true,
        ..Outputs::default()
    };
    render(scene, camera, &RenderOptions::default(), outputs).depth
}

/// Mean of `a − b` over the pixels where both have depth.
fn mean_difference(a: &Field, b: &Field) -> Option<f32> {
    let (mut sum, mut count) = (0.0f64, 0usize);
    for (a, b) in a.data().iter().zip(b.data()) {
        if a.is_finite() && b.is_finite() {
            sum += f64::from(a - b);
            count += 1;
        }
    }
    (count > 0).then(|| (sum / count as f64) as f32)
}

/// What at least one of two pictures of one size covers.
fn either(a: &Rendering, b: &Rendering, (width, height): (usize, usize)) -> Mask {
    let covers = |picture: &Rendering, p: usize| picture.alpha.as_ref().is_some_and(|alpha| alpha.data()[p] > 0.5);
    let data = (0..width * height).map(|p| covers(a, p) || covers(b, p)).collect();
    Mask::from_vec(width, height, data)
}

#[cfg(test)]
mod tests {
    use gear_sample::{Options, paint};

    use super::*;

    #[test]
    fn the_true_scene_is_alike_from_all_sides_however_far_away_and_a_board_only_from_the_front() {
        let options = Options {
            longer_side: 64,
            ..Options::default()
        };
        let truth = paint("vessel", &options).unwrap().scene(1);
        let mut moved = truth.clone();
        for center in &mut moved.centers {
            center.z += 0.25;
        }
        for error in novel_views(&moved, &truth, &[-40.0, 0.0, 40.0], 0) {
            assert!(error.psnr_db.unwrap() > 45.0 && error.ssim.unwrap() > 0.99, "{error:?}");
        }
        let mut board = truth.clone();
        for center in &mut board.centers {
            center.z *= 0.02;
        }
        let [front, side] = novel_views(&board, &truth, &[0.0, 60.0], 0)[..] else {
            panic!("two yaws, two views")
        };
        assert!(
            side.psnr_db.unwrap() + 3.0 < front.psnr_db.unwrap(),
            "{front:?} {side:?}"
        );
    }
}
