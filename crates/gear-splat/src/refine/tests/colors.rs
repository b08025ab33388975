//! Colours alone: Adam and conjugate gradients.

use super::*;

#[test]
fn colours_alone_leave_the_geometry_to_the_bit() {
    let scene = dome(24);
    let options = RefineOptions {
        iterations: 0,
        color_iterations: 20,
        ..RefineOptions::default()
    };
    let refined = run(&scene, &targets(&scene, &[0.0, 30.0]), &options);
    assert_eq!(refined.scene.centers, scene.centers);
    assert_eq!(refined.scene.log_scales, scene.log_scales);
    assert_eq!(refined.scene.rotations, scene.rotations);
    assert_ne!(refined.scene.sh_dc, scene.sh_dc);
}

#[test]
fn adam_comes_close_to_the_colours_that_conjugate_gradients_find() {
    let scene = dome(32);
    let views = targets(&scene, &[-40.0, 0.0, 40.0]);
    let least = |color_solver: ColorSolver, color_iterations: usize| {
        let options = RefineOptions {
            color_solver,
            color_iterations,
            iterations: 0,
            tolerance: 0.0,
            ..RefineOptions::default()
        };
        let refined = run(&scene, &views, &options);
        refined.curve.iter().map(|p| p.loss).fold(f64::INFINITY, f64::min)
    };
    let minimum = least(ColorSolver::ConjugateGradients, 150);
    // It is one: twice as many steps change nothing.
    let longer = least(ColorSolver::ConjugateGradients, 300);
    assert!(longer > 0.998 * minimum, "{longer} after {minimum}");
    // The default number of steps only prepares for those in which everything moves; from grey it ends a third above.
    for (steps, above) in [(30, 1.4), (300, 1.05)] {
        let adam = least(ColorSolver::Adam, steps);
        assert!(adam >= 0.999 * minimum, "{adam} is below the minimum {minimum}");
        assert!(
            adam < above * minimum,
            "Adam's {steps} steps: {adam}, minimum {minimum}"
        );
    }
}

#[test]
fn conjugate_gradients_leave_the_shapes_and_hold_colours_between_black_and_white() {
    let scene = dome(24);
    let options = RefineOptions {
        color_solver: ColorSolver::ConjugateGradients,
        color_iterations: 60,
        iterations: 0,
        ..RefineOptions::default()
    };
    let refined = run(&scene, &targets(&scene, &[0.0, 30.0]), &options);
    assert_eq!(refined.scene.centers, scene.centers);
    assert_eq!(refined.scene.log_scales, scene.log_scales);
    assert!(refined.curve.windows(2).all(|pair| pair[1].loss < pair[0].loss));
    for i in 0..scene.len() {
        assert!(refined.scene.color(i).iter().all(|c| (-1e-6..=1.0 + 1e-6).contains(c)));
    }
}

#[test]
fn a_last_phase_solves_the_colours_of_the_shapes_that_were_found() {
    let scene = dome(24);
    let views = targets(&scene, &[-30.0, 0.0, 30.0]);
    let options = RefineOptions {
        tolerance: 0.0,
        ..short()
    };
    let without = run(&scene, &views, &options);
    let polished = run(
        &scene,
        &views,
        &RefineOptions {
            final_color_iterations: 40,
            ..options
        },
    );
    // Both are the same until then: shapes to the bit, and the loss falls on from there.
    assert_eq!(polished.curve[..without.curve.len()], without.curve[..]);
    assert_eq!(polished.scene.centers, without.scene.centers);
    assert_eq!(polished.scene.log_scales, without.scene.log_scales);
    let last = |refined: &Refined| refined.curve.last().unwrap().loss;
    assert!(last(&polished) < last(&without));
}
