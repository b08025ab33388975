//! More Gaussians, fewer Gaussians, firmer ones.

use super::*;

#[test]
fn densification_adds_gaussians_where_detail_is_missing_and_lowers_the_loss() {
    // Surfels three times as large as pixels.
    let mut coarse = dome(16);
    coarse.canonical_camera = Some(Camera::front(48, 48));
    let views = targets(&coarse, &[-30.0, 0.0, 30.0]);
    let plain = RefineOptions {
        iterations: 60,
        ..short()
    };
    let dense = RefineOptions {
        densify: Some(Densify {
            every: 10,
            until: 0.7,
            share: 0.1,
            most: 250,
        }),
        ..plain.clone()
    };
    let (few, many) = (run(&coarse, &views, &plain), run(&coarse, &views, &dense));
    assert!(many.born > 20 && many.scene.len() <= 250, "{} more", many.born);
    assert_eq!(many.scene.len(), coarse.len() + many.born);
    assert_eq!(many.scene.count_invalid(), 0);
    let least = |refined: &Refined| refined.curve.iter().map(|p| p.loss).fold(f64::INFINITY, f64::min);
    assert!(least(&many) < least(&few), "{} {}", least(&many), least(&few));
}

#[test]
fn a_firmer_generation_moves_less() {
    let scene = dome(24);
    let views = targets(&scene, &[0.0]);
    let moved = |first: f64| {
        let mut options = short();
        options.generations.first = first;
        options.anchor = 1e4;
        let refined = run(&scene, &views, &options).scene;
        let pairs = refined.sh_dc.as_flattened().iter().zip(scene.sh_dc.as_flattened());
        pairs.map(|(a, b)| f64::from((a - b).abs())).sum::<f64>()
    };
    let (loose, firm) = (moved(0.1), moved(10.0));
    assert!(firm < 0.5 * loose, "{firm} {loose}");
}

#[test]
fn what_no_view_sees_is_left_out_and_no_pixel_notices() {
    let front = dome(32);
    let mut whole = front.clone();
    // A wall behind everything that a front view can see.
    for i in 0..front.len() {
        whole.push(Gaussian {
            center: front.centers[i] * Vec3::new(0.5, 0.5, 0.0) - Vec3::Z * 0.2,
            scales: Vec3::splat(0.01),
            rotation: Quat::IDENTITY,
            opacity: 0.9,
            color: [0.1, 0.9, 0.1],
        });
    }
    let views = targets(&whole, &[0.0]);
    let options = RefineOptions {
        iterations: 0,
        color_iterations: 0,
        prune: Prune {
            opacity: 0.0,
            unseen: true,
        },
        ..RefineOptions::default()
    };
    let refined = run(&whole, &views, &options);
    assert!(refined.pruned > front.len() / 2, "{}", refined.pruned);
    assert_eq!(refined.scene.len() + refined.pruned, whole.len());
    let camera = whole.canonical_camera.unwrap();
    let draw = |scene: &Scene| crate::render(scene, &camera, &options.render, DRAWN).rgb.unwrap();
    for (a, b) in draw(&whole).data().iter().zip(draw(&refined.scene).data()) {
        assert!(
            a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1.01 / 255.0),
            "{a:?} {b:?}"
        );
    }
    let faint = RefineOptions {
        prune: Prune {
            opacity: 0.95,
            unseen: false,
        },
        ..options
    };
    assert_eq!(run(&whole, &views, &faint).pruned, front.len());
}
