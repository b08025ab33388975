//! Which Gaussians a set of views does not need.
//!
//! A Gaussian shows in a pixel with the weight w = T α. Dropping the Gaussians P, from the back to the front, changes the
//! pixel each time by w times a difference of colours: those in front of it are still there, and what is behind moves up
//! by w. So the pixel changes by at most Σ_{P} w of the colour range, and the test is on that sum at every pixel of every
//! view. A bound on each w alone would not do: a thousand faint Gaussians in one pixel are not faint.
//!
//! The set is found from above. It begins with all whose largest weight in any view is within the tolerance. Where a
//! pixel's sum is too large, those in it that weigh more than a limit stay, and the limit is halved until no pixel is
//! left. What weighs nothing anywhere is dropped whatever the others do: with tolerance 0 the pictures of these views keep
//! their bits.

use crate::cpu::Frame;
use crate::{Camera, Outputs, RenderOptions, Scene};

/// Marks the Gaussians that `cameras` do not need: without all of them no pixel of these views changes its colour or its
/// coverage by more than `tolerance` of its range, and what the blend's end at T < 1e-4 leaves open, 3e-4. Invalid
/// Gaussians show nowhere and are marked. Without a camera nothing is.
///
/// `tolerance` is held within [0, 1]; 1/255 is what the cut of the blend itself amounts to.
///
/// # Panics
/// When the scene is ragged ([`Scene::validate`]): a caller's bug.
pub fn unseen(scene: &Scene, cameras: &[Camera], options: &RenderOptions, tolerance: f32) -> Vec<bool> {
    if cameras.is_empty() {
        return vec![false; scene.len()];
    }
    let tolerance = tolerance.clamp(0.0, 1.0);
    let largest = |of: &dyn Fn(&Frame) -> Vec<f32>| {
        let mut all = vec![0.0f32; scene.len()];
        for camera in cameras {
            let found = of(&Frame::new(scene, camera, options, Outputs::default()));
            all.iter_mut().zip(found).for_each(|(all, found)| *all = all.max(found));
        }
        all
    };
    let weights = largest(&Frame::largest_weights);
    let mut dropped: Vec<bool> = weights.iter().map(|&w| w <= tolerance).collect();
    let mut most = tolerance;
    loop {
        let faint = |i: usize, dropped: &[bool]| dropped[i] && weights[i] > 0.0;
        if !(0..scene.len()).any(|i| faint(i, &dropped)) {
            return dropped;
        }
        let sums = largest(&|frame| frame.largest_sums(&dropped));
        let crowded: Vec<usize> = (0..scene.len())
            .filter(|&i| faint(i, &dropped) && sums[i] > tolerance)
            .collect();
        let Some(heaviest) = crowded.iter().map(|&i| weights[i]).reduce(f32::max) else {
            return dropped;
        };
        // At least the heaviest one stays, so that this ends.
        while most >= heaviest {
            most *= 0.5;
        }
        crowded
            .iter()
            .filter(|&&i| weights[i] > most)
            .for_each(|&i| dropped[i] = false);
    }
}

/// The scene without what [`unseen`] marks, and how many those were.
///
/// # Panics
/// As [`unseen`].
pub fn pruned(scene: &Scene, cameras: &[Camera], options: &RenderOptions, tolerance: f32) -> (Scene, usize) {
    let unseen = unseen(scene, cameras, options, tolerance);
    let kept = scene.filtered(|i| !unseen[i]);
    let dropped = scene.len() - kept.len();
    (kept, dropped)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Gaussian, render};
    use glam::{Quat, Vec3};

    fn ball(center: Vec3, size: f32, opacity: f32, color: [f32; 3]) -> Gaussian {
        Gaussian {
            center,
            scales: Vec3::splat(size),
            rotation: Quat::IDENTITY,
            opacity,
            color,
        }
    }

    /// A closed shell of opaque balls with others inside, and one far aside.
    fn shell() -> (Scene, usize) {
        let mut scene = Scene::default();
        for i in 0..400 {
            let z = 1.0 - (2.0 * i as f32 + 1.0) / 400.0;
            let (sin, cos) = libm::sincosf(2.399_963 * i as f32);
            let r = (1.0 - z * z).sqrt();
            let at = Vec3::new(r * cos, r * sin, z) * 0.3;
            scene.push(ball(at, 0.08, 0.99, [0.5 + at.x, 0.5 + at.y, 0.5]));
        }
        let outer = scene.len();
        for i in 0..50 {
            scene.push(ball(Vec3::splat(1e-3 * i as f32), 0.02, 0.9, [1.0, 0.0, 0.0]));
        }
        scene.push(ball(Vec3::X * 1e4, 0.1, 0.9, [0.0; 3]));
        scene.push(ball(Vec3::NAN, 0.1, 0.9, [0.0; 3]));
        (scene, outer)
    }

    fn around(side: u32) -> Vec<Camera> {
        let front = Camera::front(side, side);
        let views = (0..8).flat_map(|i| [-40.0, 40.0].map(|pitch| (45.0 * i as f32, pitch)));
        views.map(|(yaw, pitch)| front.orbit(Vec3::ZERO, yaw, pitch)).collect()
    }

    /// The largest change of a colour or a coverage.
    fn change(a: &Scene, b: &Scene, cameras: &[Camera]) -> f32 {
        let mut worst = 0.0f32;
        for camera in cameras {
            let [a, b] = [a, b].map(|scene| render(scene, camera, &RenderOptions::default(), Outputs::RGBA));
            let (a_rgb, b_rgb) = (a.rgb.unwrap(), b.rgb.unwrap());
            let colors = a_rgb.data().iter().flatten().zip(b_rgb.data().iter().flatten());
            let (a, b) = (a.alpha.unwrap(), b.alpha.unwrap());
            let all = colors.chain(a.data().iter().zip(b.data()));
            worst = all.map(|(a, b)| (a - b).abs()).fold(worst, f32::max);
        }
        worst
    }

    #[test]
    fn what_no_view_sees_goes_and_the_pictures_keep_their_bits() {
        let (scene, outer) = shell();
        let cameras = around(60);
        let (kept, dropped) = pruned(&scene, &cameras, &RenderOptions::default(), 0.0);
        assert!(dropped >= 52, "what is inside, aside and invalid: {dropped}");
        assert!(kept.len() <= outer && kept.len() > outer / 2, "{}", kept.len());
        for camera in &cameras {
            let [a, b] = [&scene, &kept].map(|scene| render(scene, camera, &RenderOptions::default(), Outputs::RGBA));
            assert_eq!(a, b);
        }
    }

    /// Each is far below the tolerance, all of them are not: a rule that looks at one at a time drops them all.
    #[test]
    fn many_faint_ones_in_a_pixel_are_not_faint() {
        let mut scene = Scene::default();
        for i in 0..3000 {
            scene.push(ball(Vec3::Z * 1e-4 * i as f32, 0.2, 0.012, [0.1, 0.5, 0.9]));
        }
        // From the front and from the back: what lies deep within is seen by neither.
        let front = Camera::front(24, 24);
        let cameras = [front, front.orbit(Vec3::ZERO, 180.0, 0.0)];
        for tolerance in [1.0 / 255.0, 0.05] {
            let (kept, dropped) = pruned(&scene, &cameras, &RenderOptions::default(), tolerance);
            assert!(
                !kept.is_empty() && dropped > 0,
                "{tolerance}: {dropped} of {}",
                scene.len()
            );
            let worst = change(&scene, &kept, &cameras);
            assert!(worst <= tolerance + 3e-4, "{worst} with tolerance {tolerance}");
        }
        let one_at_a_time = scene.filtered(|i| i % 1000 == 0);
        assert!(
            change(&scene, &one_at_a_time, &cameras) > 0.1,
            "the scene must be able to fail"
        );
    }

    #[test]
    fn a_larger_tolerance_drops_more_and_is_kept_to() {
        let mut scene = shell().0;
        for i in 0..300 {
            let (sin, cos) = libm::sincosf(0.7 * i as f32);
            let at = Vec3::new(0.4 * cos, 0.4 * sin, 0.002 * i as f32 - 0.3);
            scene.push(ball(at, 0.01, 0.005 + 0.0002 * i as f32, [0.0, 1.0, 0.0]));
        }
        let cameras = around(48);
        let mut before = 0;
        // Not 1/255: what is seen at all and not behind others weighs more.
        for tolerance in [0.0, 0.02, 0.1] {
            let (kept, dropped) = pruned(&scene, &cameras, &RenderOptions::default(), tolerance);
            assert!(dropped > before, "{tolerance}: {dropped}");
            assert!(change(&scene, &kept, &cameras) <= tolerance + 3e-4);
            before = dropped;
        }
    }

    #[test]
    fn without_a_view_or_a_gaussian_nothing_happens() {
        let (scene, _) = shell();
        assert!(
            unseen(&scene, &[], &RenderOptions::default(), 0.5)
                .iter()
                .all(|dropped| !dropped)
        );
        assert!(unseen(&Scene::default(), &around(8), &RenderOptions::default(), 0.5).is_empty());
    }
}
