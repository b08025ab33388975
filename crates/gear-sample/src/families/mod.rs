//! The benchmark: four families of scenes whose parameters are drawn from the scene's number.
//!
//! Any number from 1 makes a scene; [`BENCHMARK_SCENES`] of each family are the benchmark. Kinds within a family take
//! turns, so that few scenes show many of them.

mod cloth;
mod dice;
mod figures;
mod landscapes;
mod reliefs;
mod vessels;

use crate::stage::Stage;

/// Scenes of each family that make up the benchmark, numbered from 1.
pub const BENCHMARK_SCENES: u64 = 8;

/// Largest number of a scene.
const MAX_NUMBER: u64 = 1_000_000;

/// A kind of subject.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Family {
    /// Figures with drapery: standing, seated on a throne, dancing.
    Figures,
    /// Vessels and solids: turned, lobed and faceted bodies, fruit.
    Vessels,
    /// Carved panels, medallions and steles, and friezes that fill the canvas.
    Reliefs,
    /// Layers of hills, water, trees and houses over the whole canvas.
    Landscapes,
}

impl Family {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Figures, Self::Vessels, Self::Reliefs, Self::Landscapes];

    /// The name before the number of a scene.
    pub fn name(self) -> &'static str {
        match self {
            Self::Figures => "figure",
            Self::Vessels => "vessel",
            Self::Reliefs => "relief",
            Self::Landscapes => "landscape",
        }
    }

    /// What is shown, for people.
    pub fn about(self) -> &'static str {
        match self {
            Self::Figures => "figures with drapery: standing, enthroned, dancing",
            Self::Vessels => "vessels and solids: turned, lobed, faceted, fruit",
            Self::Reliefs => "carved medallions and steles, and friezes over the whole canvas",
            Self::Landscapes => "layered landscapes over the whole canvas: hills, water, trees, houses",
        }
    }

    /// Names of its scenes in the benchmark.
    pub fn scenes(self) -> impl Iterator<Item = String> {
        (1..=BENCHMARK_SCENES).map(move |number| format!("{}-{number}", self.name()))
    }

    /// The family of a scene's name, and its number.
    pub fn of(name: &str) -> Option<(Self, u64)> {
        let (family, number) = name.rsplit_once('-')?;
        let family = Self::ALL.into_iter().find(|f| f.name() == family)?;
        let number = number.parse().ok().filter(|n| (1..=MAX_NUMBER).contains(n))?;
        // one name a scene: no leading zero, no plus
        (name == format!("{}-{number}", family.name())).then_some((family, number))
    }

    pub(crate) fn stage(self, number: u64, seed: u64) -> Stage {
        match self {
            Self::Figures => figures::stage(number, seed),
            Self::Vessels => vessels::stage(number),
            Self::Reliefs => reliefs::stage(number, seed),
            Self::Landscapes => landscapes::stage(number, seed),
        }
    }
}

/// Names of all scenes of the benchmark, family by family.
pub fn benchmark() -> Vec<String> {
    Family::ALL.into_iter().flat_map(Family::scenes).collect()
}
