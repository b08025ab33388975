//! Runs that are broken off, and go on.

use super::*;

#[test]
fn an_observer_can_break_off() {
    let scene = dome(8);
    let views = targets(&scene, &[0.0]);
    let mut calls = 0;
    let stopped = refine(&scene, &views, &RefineOptions::default(), &mut |_| {
        calls += 1;
        if calls == 3 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    assert_eq!((stopped.unwrap_err(), calls), (RefineError::Interrupted, 3));
}

/// A place for states that keeps them all.
#[derive(Default)]
struct Kept {
    last: Option<Vec<u8>>,
    states: Vec<Vec<u8>>,
}

impl Checkpoints for Kept {
    fn last(&mut self) -> Option<Vec<u8>> {
        self.last.clone()
    }

    fn keep(&mut self, state: &dyn Fn() -> Vec<u8>) {
        self.states.push(state());
    }
}

#[test]
fn a_run_that_goes_on_from_a_state_ends_with_the_same_bits() {
    let scene = dome(24);
    let views = targets(&scene, &[-30.0, 0.0, 30.0]);
    let dense = RefineOptions {
        densify: Some(Densify {
            every: 6,
            share: 0.05,
            ..Densify::default()
        }),
        ..short()
    };
    let solved = RefineOptions {
        color_solver: ColorSolver::ConjugateGradients,
        color_iterations: 20,
        ..short()
    };
    let polished = RefineOptions {
        final_color_iterations: 20,
        ..short()
    };
    for options in [short(), dense, solved, polished] {
        let run = |kept: &mut Kept, calls: &mut usize| {
            let device = Device::cpu();
            let mut count = |_| {
                *calls += 1;
                ControlFlow::Continue(())
            };
            refine_resuming(&device, &scene, &views, &options, kept, &mut count).unwrap()
        };
        let (mut kept, mut steps) = (Kept::default(), 0);
        let whole = run(&mut kept, &mut steps);
        assert!(kept.states.len() > 2);
        for state in kept.states {
            let mut from = Kept {
                last: Some(state),
                ..Kept::default()
            };
            let mut fewer = 0;
            let resumed = run(&mut from, &mut fewer);
            assert!(fewer < steps);
            assert_eq!(resumed.scene, whole.scene);
            assert_eq!(
                (resumed.curve, resumed.fidelity),
                (whole.curve.clone(), whole.fidelity.clone())
            );
            assert_eq!(
                (resumed.best_iteration, resumed.born),
                (whole.best_iteration, whole.born)
            );
        }
    }
}

#[test]
fn a_run_that_is_broken_off_between_two_looks_loses_no_step() {
    let scene = dome(24);
    let views = targets(&scene, &[-30.0, 0.0, 30.0]);
    let device = Device::cpu();
    let options = short();
    let run = |kept: &mut Kept, most: usize| {
        let mut calls = 0;
        let mut count = |_| {
            calls += 1;
            if calls == most {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        let result = refine_resuming(&device, &scene, &views, &options, kept, &mut count);
        (result, calls)
    };
    let (whole, steps) = run(&mut Kept::default(), usize::MAX);
    let whole = whole.unwrap();
    for at in [3, steps / 2 + 1] {
        let mut kept = Kept::default();
        assert_eq!(run(&mut kept, at).0.unwrap_err(), RefineError::Interrupted);
        kept.last = kept.states.pop();
        let (resumed, rest) = run(&mut kept, usize::MAX);
        assert_eq!(resumed.unwrap().scene, whole.scene, "broken off at step {at}");
        assert!(rest <= steps - at + 1, "{rest} steps of {steps} after {at}");
    }
}

#[test]
fn bytes_that_are_no_state_begin_anew() {
    let scene = dome(16);
    let views = targets(&scene, &[0.0]);
    let mut kept = Kept::default();
    let device = Device::cpu();
    let go = &mut |_| ControlFlow::Continue(());
    let whole = refine_resuming(&device, &scene, &views, &short(), &mut kept, go).unwrap();
    let state = kept.states.pop().unwrap();
    for cut in [0, 7, 100, state.len() / 2, state.len() - 1] {
        let mut from = Kept {
            last: Some(state[..cut].to_vec()),
            ..Kept::default()
        };
        let anew = refine_resuming(&device, &scene, &views, &short(), &mut from, go).unwrap();
        assert_eq!(anew.scene, whole.scene, "{cut}");
    }
}
