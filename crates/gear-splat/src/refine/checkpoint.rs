//! Unfinished refinements, to go on from.
//!
//! At every look at all views, and when Adam's steps are broken off, the state of a run can be kept: everything that
//! later steps depend on, so that a run that goes on from it ends with the same bits as one that was never interrupted.
//! What follows from the scene, the targets and the options is not in it; a state must be given back to the same ones.
//! Numbers are little-endian, lists are preceded by their length.

use super::anchored::{Anchored, Group};
use super::density::Strain;
use super::{Point, Run, Status};
use crate::Scene;

/// Changes with what is written.
const FORMAT: u64 = 0x6765_6172_7266_0001;

/// Where the state of a run is kept.
pub trait Checkpoints {
    /// The state that was kept last, if there is one.
    fn last(&mut self) -> Option<Vec<u8>>;

    /// Is called at every look. `state` makes the state; whoever does not want it now does not ask for it.
    fn keep(&mut self, state: &dyn Fn() -> Vec<u8>);

    /// Is called when the observer broke off, after which there is no other occasion.
    fn keep_last(&mut self, state: &dyn Fn() -> Vec<u8>) {
        self.keep(state);
    }
}

/// Keeps nothing.
impl Checkpoints for () {
    fn last(&mut self) -> Option<Vec<u8>> {
        None
    }

    fn keep(&mut self, _state: &dyn Fn() -> Vec<u8>) {}
}

impl Run<'_> {
    /// The state between two steps.
    pub(super) fn state(&self) -> Vec<u8> {
        let mut out = Writer(Vec::new());
        out.u64(FORMAT);
        for count in [
            self.targets.len(),
            self.phase,
            self.step,
            self.done,
            self.skipped,
            self.born,
        ] {
            out.u64(count as u64);
        }
        out.u64(u64::from(self.status == Status::Converged));
        out.u64(u64::from(self.corner.to_bits()));
        out.u64(self.curve.len() as u64);
        for point in &self.curve {
            out.u64(point.iteration as u64);
            [point.loss, point.data, point.anchor]
                .into_iter()
                .for_each(|x| out.f64(x));
        }
        self.fidelity.iter().for_each(|view| out.f64(view.before));
        out.f64(self.best.0);
        out.u64(self.best.1 as u64);
        out.scene(&self.best.2);
        out.anchored(&self.anchored);
        out.f32s(&self.strain.sums);
        out.f32s(bytemuck::cast_slice(&self.strain.slopes));
        out.u64(self.strain.seen.len() as u64);
        self.strain.seen.iter().for_each(|seen| out.u64(u64::from(*seen)));
        out.0
    }

    /// Takes up a state. `None`, and the run as it was, if the bytes are not one of this problem.
    pub(super) fn restore(&mut self, bytes: &[u8]) -> Option<()> {
        let mut from = Reader(bytes);
        if from.u64()? != FORMAT || from.usize()? != self.targets.len() {
            return None;
        }
        let [phase, step, done, skipped, born] = [(); 5].map(|()| from.usize());
        let converged = from.u64()? == 1;
        let corner = f32::from_bits(from.u64()? as u32);
        let mut curve = Vec::new();
        for _ in 0..from.usize()? {
            curve.push(Point {
                iteration: from.usize()?,
                loss: from.f64()?,
                data: from.f64()?,
                anchor: from.f64()?,
            });
        }
        let mut before = Vec::new();
        for _ in &self.fidelity {
            before.push(from.f64()?);
        }
        let (least, best_iteration) = (from.f64()?, from.usize()?);
        let best = from.scene(&self.anchored.scene)?;
        let mut anchored = self.anchored.clone();
        from.anchored(&mut anchored)?;
        let mut strain = Strain {
            sums: from.f32s()?,
            slopes: from.f32s()?.chunks_exact(3).map(glam::Vec3::from_slice).collect(),
            seen: Vec::new(),
        };
        for _ in 0..from.usize()? {
            strain.seen.push(from.u64()? as u32);
        }
        if !from.0.is_empty() || curve.is_empty() {
            return None;
        }
        (self.phase, self.step, self.done) = (phase?, step?, done?);
        (self.skipped, self.born, self.corner) = (skipped?, born?, corner);
        self.fidelity
            .iter_mut()
            .zip(before)
            .for_each(|(view, before)| view.before = before);
        self.best = (least, best_iteration, best);
        self.status = if converged { Status::Converged } else { Status::Finished };
        (self.curve, self.anchored, self.strain) = (curve, anchored, strain);
        Some(())
    }
}

struct Writer(Vec<u8>);

impl Writer {
    fn u64(&mut self, x: u64) {
        self.0.extend_from_slice(&x.to_le_bytes());
    }

    fn f64(&mut self, x: f64) {
        self.u64(x.to_bits());
    }

    fn f32s(&mut self, values: &[f32]) {
        self.u64(values.len() as u64);
        self.0.reserve(4 * values.len());
        values.iter().for_each(|x| self.0.extend_from_slice(&x.to_le_bytes()));
    }

    fn scene(&mut self, scene: &Scene) {
        Group::ALL.into_iter().for_each(|group| self.f32s(group.of(scene)));
    }

    fn anchored(&mut self, anchored: &Anchored) {
        self.scene(&anchored.scene);
        self.scene(&anchored.anchor);
        self.f32s(&anchored.ceilings);
        self.f32s(&anchored.firmness);
        for moments in &anchored.moments {
            self.u64(moments.steps as u64);
            self.f32s(&moments.first);
            self.f32s(&moments.second);
        }
    }
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn u64(&mut self) -> Option<u64> {
        let (head, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(u64::from_le_bytes(*head))
    }

    fn usize(&mut self) -> Option<usize> {
        usize::try_from(self.u64()?).ok()
    }

    fn f64(&mut self) -> Option<f64> {
        self.u64().map(f64::from_bits)
    }

    fn f32s(&mut self) -> Option<Vec<f32>> {
        let bytes = self.usize()?.checked_mul(4)?;
        let (head, rest) = self.0.split_at_checked(bytes)?;
        self.0 = rest;
        let numbers = head.chunks_exact(4);
        Some(numbers.map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
    }

    /// A scene with the camera and the SH degree of another.
    fn scene(&mut self, like: &Scene) -> Option<Scene> {
        let three = |values: Vec<f32>| values.chunks_exact(3).map(glam::Vec3::from_slice).collect();
        let scene = Scene {
            centers: three(self.f32s()?),
            log_scales: three(self.f32s()?),
            rotations: self.f32s()?.chunks_exact(4).map(glam::Quat::from_slice).collect(),
            opacity_logits: self.f32s()?,
            sh_dc: self.f32s()?.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
            sh_rest: self.f32s()?,
            ..*like
        };
        scene.validate().is_ok().then_some(scene)
    }

    fn anchored(&mut self, anchored: &mut Anchored) -> Option<()> {
        anchored.scene = self.scene(&anchored.scene)?;
        anchored.anchor = self.scene(&anchored.scene)?;
        anchored.ceilings = self.f32s()?;
        anchored.firmness = self.f32s()?;
        for moments in &mut anchored.moments {
            moments.steps = self.usize()?;
            moments.first = self.f32s()?;
            moments.second = self.f32s()?;
        }
        let n = anchored.scene.len();
        let fits = anchored.anchor.len() == n && anchored.ceilings.len() == n;
        let moments = Group::ALL.into_iter().zip(&anchored.moments).all(|(group, moments)| {
            let len = group.of(&anchored.scene).len();
            moments.first.len() == moments.second.len() && [0, len].contains(&moments.first.len())
        });
        (fits && moments && [0, n].contains(&anchored.firmness.len())).then_some(())
    }
}
