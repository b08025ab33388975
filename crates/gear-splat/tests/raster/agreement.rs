//! Pictures of the fast rasteriser and of the reference are the same.
//!
//! Tolerance. Both leave a Gaussian out of a pixel where α < 1/255 and stop where T < 1e-4. In f32 a pixel
//! whose α lies within rounding of 1/255 may be decided the other way, which changes it by at most 1/255 of the
//! colour range: that bound holds for every pixel. Such pixels are rare (the rounding of α is about 1e-6 of it), all
//! others agree to f32 rounding of up to a few hundred blended terms, 2e-5.

use gear_splat::reference::{self, Reference};
use gear_splat::{Camera, Outputs, RenderOptions, Rendering, Scene, ScreenFilter, render};

use crate::scenes::{cameras, cloud};

const ROUNDING: f64 = 2e-5;
const DECISION: f64 = 1.0 / 255.0 + 1e-4;

pub fn assert_agrees(scene: &Scene, camera: &Camera, options: &RenderOptions) -> Reference {
    let fast = render(scene, camera, options, Outputs::ALL);
    let slow = reference::render(scene, camera, options);
    compare_colors(&fast, &slow);
    compare_surfaces(&fast, &slow);
    #[cfg(feature = "gpu")]
    crate::gpu::assert_agrees(scene, camera, options, &slow);
    slow
}

pub fn compare_colors(fast: &Rendering, slow: &Reference) {
    let (rgb, alpha) = (fast.rgb.as_ref().unwrap(), fast.alpha.as_ref().unwrap());
    let mut decided_otherwise = 0;
    for i in 0..rgb.len() {
        let mut worst = (f64::from(alpha.data()[i]) - slow.alpha[i]).abs();
        for c in 0..3 {
            worst = worst.max((f64::from(rgb.data()[i][c]) - slow.rgb[i][c]).abs());
        }
        assert!(worst.is_finite(), "pixel {i} is not finite");
        assert!(worst <= 1.3 * DECISION, "pixel {i} is off by {worst:e}");
        decided_otherwise += usize::from(worst > ROUNDING);
    }
    assert!(
        decided_otherwise * 200 <= rgb.len(),
        "{decided_otherwise} of {} pixels",
        rgb.len()
    );
}

pub fn compare_surfaces(fast: &Rendering, slow: &Reference) {
    let depth = fast.depth.as_ref().unwrap().data();
    let median = fast.median_depth.as_ref().unwrap().data();
    let normal = fast.normal.as_ref().unwrap();
    let mut off = 0;
    for i in 0..depth.len() {
        // Where almost nothing is seen one flipped decision moves the mean arbitrarily; the median flips where the
        // transmittance passes ½ by a rounding.
        if slow.alpha[i] < 0.02 {
            continue;
        }
        let scale = slow.depth[i].abs().max(1.0);
        let nan_alike = median[i].is_nan() == slow.median_depth[i].is_nan();
        let median_off = (f64::from(median[i]) - slow.median_depth[i]).abs() > 1e-4 * scale;
        let depth_off = (f64::from(depth[i]) - slow.depth[i]).abs() > 1e-4 * scale;
        let normal_off = (0..3).any(|c| (f64::from(normal[i][c]) - slow.normal[i][c]).abs() > 2e-3);
        off += usize::from(!nan_alike || median_off || depth_off || normal_off);
    }
    assert!(off * 100 <= depth.len(), "{off} of {} pixels", depth.len());
}

#[test]
fn random_scenes_agree_with_the_reference() {
    for camera in cameras(75, 50) {
        for (seed, count, low, high) in [(1, 300, 0.004, 0.05), (2, 40, 0.02, 0.4), (3, 1500, 0.001, 0.02)] {
            let scene = cloud(count, seed, low, high, 0);
            let slow = assert_agrees(&scene, &camera, &RenderOptions::default());
            let covered = slow.alpha.iter().filter(|&&a| a > 0.1).count();
            assert!(covered > 500, "the scene must be in the picture: {covered}");
        }
    }
}

#[test]
fn the_anti_aliased_mode_and_other_backgrounds_agree() {
    let options = RenderOptions {
        background: [0.1, 0.5, 0.9],
        filter: ScreenFilter::AntiAlias(0.1),
        ..RenderOptions::default()
    };
    for camera in cameras(40, 60) {
        assert_agrees(&cloud(400, 4, 0.002, 0.05, 0), &camera, &options);
    }
}

#[test]
fn view_dependent_colours_agree() {
    for camera in cameras(40, 40) {
        for degree in 1..=3 {
            assert_agrees(&cloud(200, 5, 0.01, 0.06, degree), &camera, &RenderOptions::default());
        }
    }
}

#[test]
fn what_is_not_wanted_is_absent_and_what_is_wanted_does_not_depend_on_it() {
    let scene = cloud(200, 6, 0.01, 0.06, 0);
    let [camera, _] = cameras(40, 40);
    let all = render(&scene, &camera, &RenderOptions::default(), Outputs::ALL);
    for bits in 0..32u8 {
        let outputs = Outputs {
            rgb: bits & 1 != 0,
            alpha: bits & 2 != 0,
            depth: bits & 4 != 0,
            median_depth: bits & 8 != 0,
            normal: bits & 16 != 0,
        };
        let some = render(&scene, &camera, &RenderOptions::default(), outputs);
        let same = |a: &[f32], b: &[f32]| a.iter().map(|x| x.to_bits()).eq(b.iter().map(|x| x.to_bits()));
        assert_eq!(some.rgb, outputs.rgb.then(|| all.rgb.clone().unwrap()));
        assert_eq!(some.alpha, outputs.alpha.then(|| all.alpha.clone().unwrap()));
        assert_eq!(some.normal, outputs.normal.then(|| all.normal.clone().unwrap()));
        for (wanted, a, b) in [
            (outputs.depth, &some.depth, &all.depth),
            (outputs.median_depth, &some.median_depth, &all.median_depth),
        ] {
            assert_eq!(a.is_some(), wanted);
            assert!(!wanted || same(a.as_ref().unwrap().data(), b.as_ref().unwrap().data()));
        }
    }
}
