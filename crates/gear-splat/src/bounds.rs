//! Axis-aligned boxes.

use glam::Vec3;

/// An axis-aligned box, world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Largest coordinates.
    pub max: Vec3,
}

impl Bounds {
    /// Middle of the box.
    pub fn center(&self) -> Vec3 {
        // Halves first: the sum of two large coordinates may overflow.
        self.min * 0.5 + self.max * 0.5
    }

    /// Side lengths.
    pub fn size(&self) -> Vec3 {
        self.max - self.min
    }

    /// Length of the longest side.
    pub fn longest_side(&self) -> f32 {
        self.size().max_element()
    }

    /// The smallest box that holds both.
    pub fn union(&self, other: &Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// The eight corners.
    pub fn corners(&self) -> [Vec3; 8] {
        std::array::from_fn(|i| {
            let pick = |bit: usize, low: f32, high: f32| if i & bit == 0 { low } else { high };
            Vec3::new(
                pick(1, self.min.x, self.max.x),
                pick(2, self.min.y, self.max.y),
                pick(4, self.min.z, self.max.z),
            )
        })
    }
}
