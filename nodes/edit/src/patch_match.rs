//! PatchMatch (Barnes et al. 2009): for every pixel to fill, a place of the painting whose low-pass colour is alike,
//! and neighbouring places for neighbouring pixels.
//!
//! The field of places starts at random. Each round proposes to a pixel the places of its neighbours at 8, 4, 2 and
//! 1 pixels, shifted along (a proposal that keeps a neighbour's run costs 0.9 of its distance, which is what makes
//! patches), then random places in windows that halve around its own. Every sweep reads the field of the sweep before
//! and writes a new one, and random numbers are hashes of seed, pixel and round: the result does not depend on
//! the order of pixels, nor on the number of threads. The long jumps make up for the reach that sequential scans have.

use gear_image::filter::{self, Beyond};
use gear_image::{Mask, SrgbImage};
use rayon::prelude::*;

use crate::random;

/// Distances at which neighbours propose, pixels.
const REACH: [isize; 4] = [8, 4, 2, 1];
/// A neighbour's continued place counts as this share of its distance.
const COHERENCE: f32 = 0.9;

/// A place of the painting and how unlike it is.
#[derive(Clone, Copy)]
struct Match {
    x: u32,
    y: u32,
    cost: f32,
}

/// The painting as a source of detail.
pub(crate) struct Exemplar {
    /// Low-pass colour.
    low: SrgbImage,
    /// What the low-pass left out.
    detail: SrgbImage,
    /// Centres whose whole patch lies inside the mask.
    core: Mask,
    places: Vec<(u32, u32)>,
    half: isize,
}

impl Exemplar {
    /// A source of patches (2 `half` + 1)² pixels large from the mask's inside.
    pub fn new(painting: &SrgbImage, low: SrgbImage, mask: &Mask, half: usize) -> Self {
        // City-block steps: 2 (half + 1) of them hold the square patch's corners.
        let core = filter::erode(mask, 2 * (half + 1), Beyond::Outside);
        let detail = painting.data().iter().zip(low.data());
        let detail = detail.map(|(p, l)| std::array::from_fn(|c| p[c] - l[c])).collect();
        let (width, height) = painting.size();
        let at = |i: usize| ((i % width) as u32, (i / width) as u32);
        Self {
            places: (0..width * height).filter(|&i| core.data()[i]).map(at).collect(),
            detail: SrgbImage::from_vec(width, height, detail),
            low,
            core,
            half: half as isize,
        }
    }

    fn cost(&self, x: isize, y: isize, wanted: [f32; 3]) -> f32 {
        let inside = x >= 0 && y >= 0 && (x as usize) < self.core.width() && (y as usize) < self.core.height();
        if !inside || !self.core.at(x as usize, y as usize) {
            return f32::INFINITY;
        }
        let low = self.low.at(x as usize, y as usize);
        let d = [low[0] - wanted[0], low[1] - wanted[1], low[2] - wanted[2]];
        d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    }

    /// Detail for the pixels of `todo`, whose low-pass colour is `guide`; zero elsewhere, and everywhere when the
    /// painting has no room for a patch. Places are looked for in `rounds` of propagation and search.
    pub fn detail(&self, guide: &SrgbImage, todo: &Mask, rounds: u32, seed: u64) -> SrgbImage {
        let (width, height) = todo.size();
        if self.places.is_empty() {
            return SrgbImage::filled(width, height, [0.0; 3]);
        }
        let mut field = self.start(guide, todo, seed);
        for round in 0..u64::from(rounds) {
            for reach in REACH {
                field = self.propagated(&field, guide, todo, reach);
            }
            self.search(&mut field, guide, todo, seed, round);
        }
        self.vote(&field, todo)
    }

    fn start(&self, guide: &SrgbImage, todo: &Mask, seed: u64) -> Vec<Match> {
        let place = |i: usize| {
            let (x, y) = self.places[random::below(random::bits(seed, i as u64, u64::MAX), self.places.len())];
            let cost = self.cost(x as isize, y as isize, guide.data()[i]);
            Match { x, y, cost }
        };
        let none = Match {
            x: 0,
            y: 0,
            cost: f32::INFINITY,
        };
        let place = |i: usize| if todo.data()[i] { place(i) } else { none };
        (0..todo.len()).into_par_iter().map(place).collect()
    }

    fn propagated(&self, field: &[Match], guide: &SrgbImage, todo: &Mask, reach: isize) -> Vec<Match> {
        let (width, height) = (todo.width() as isize, todo.height() as isize);
        let better = |i: usize| {
            let mut best = field[i];
            if !todo.data()[i] {
                return best;
            }
            let (x, y) = (i as isize % width, i as isize / width);
            for (dx, dy) in [(reach, 0), (-reach, 0), (0, reach), (0, -reach)] {
                let (nx, ny) = (x - dx, y - dy);
                if nx < 0 || ny < 0 || nx >= width || ny >= height || !todo.at(nx as usize, ny as usize) {
                    continue;
                }
                let theirs = field[(ny * width + nx) as usize];
                let (px, py) = (theirs.x as isize + dx, theirs.y as isize + dy);
                let cost = COHERENCE * self.cost(px, py, guide.data()[i]);
                if cost < best.cost {
                    best = Match {
                        x: px as u32,
                        y: py as u32,
                        cost,
                    };
                }
            }
            best
        };
        (0..field.len()).into_par_iter().map(better).collect()
    }

    fn search(&self, field: &mut [Match], guide: &SrgbImage, todo: &Mask, seed: u64, round: u64) {
        let widest = self.core.width().max(self.core.height());
        field
            .par_iter_mut()
            .enumerate()
            .filter(|(i, _)| todo.data()[*i])
            .for_each(|(i, best)| {
                let mut window = widest;
                while window >= 1 {
                    let hash = random::bits(seed, i as u64, (round << 32) | window as u64);
                    let jump = |h: u64| random::below(h, 2 * window + 1) as isize - window as isize;
                    let (x, y) = (best.x as isize + jump(hash), best.y as isize + jump(hash << 32));
                    let cost = self.cost(x, y, guide.data()[i]);
                    if cost < best.cost {
                        *best = Match {
                            x: x as u32,
                            y: y as u32,
                            cost,
                        };
                    }
                    window /= 2;
                }
            });
    }

    /// The mean of what all patches that cover a pixel say of it, nearer centres counting more.
    fn vote(&self, field: &[Match], todo: &Mask) -> SrgbImage {
        let (width, height) = (todo.width() as isize, todo.height() as isize);
        let half = self.half;
        let voted = |i: usize| {
            if !todo.data()[i] {
                return [0.0; 3];
            }
            let (x, y) = (i as isize % width, i as isize / width);
            let (mut sum, mut total) = ([0.0f32; 3], 0.0f32);
            for dy in -half..=half {
                for dx in -half..=half {
                    let (nx, ny) = (x - dx, y - dy);
                    if nx < 0 || ny < 0 || nx >= width || ny >= height || !todo.at(nx as usize, ny as usize) {
                        continue;
                    }
                    let place = field[(ny * width + nx) as usize];
                    let near = 1.0 / (1 + dx * dx + dy * dy) as f32;
                    let weight = near * near;
                    // In range: the core keeps a whole patch inside the painting.
                    let detail = self
                        .detail
                        .at((place.x as isize + dx) as usize, (place.y as isize + dy) as usize);
                    for (s, d) in sum.iter_mut().zip(detail) {
                        *s += weight * d;
                    }
                    total += weight;
                }
            }
            sum.map(|s| s / total)
        };
        let data = (0..field.len()).into_par_iter().map(voted).collect();
        SrgbImage::from_vec(todo.width(), todo.height(), data)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stripes(width: usize, height: usize) -> SrgbImage {
        SrgbImage::from_fn(width, height, |x, y| {
            let ripple = if (x + y) % 4 < 2 { 0.05 } else { -0.05 };
            [
                x as f32 / width as f32 + ripple,
                0.5 + ripple,
                1.0 - x as f32 / width as f32,
            ]
        })
    }

    #[test]
    fn found_places_have_nearly_the_wanted_colour_and_lend_their_texture() {
        let painting = stripes(60, 50);
        let low = SrgbImage::from_fn(60, 50, |x, _| [x as f32 / 60.0, 0.5, 1.0 - x as f32 / 60.0]);
        let exemplar = Exemplar::new(&painting, low, &Mask::filled(60, 50, true), 3);
        let guide = SrgbImage::from_fn(40, 40, |x, _| {
            let v = 0.3 + x as f32 / 100.0;
            [v, 0.5, 1.0 - v]
        });
        let todo = Mask::filled(40, 40, true);
        let mut field = exemplar.start(&guide, &todo, 5);
        let before: f32 = field.iter().map(|m| m.cost).sum();
        for round in 0..4 {
            for reach in REACH {
                field = exemplar.propagated(&field, &guide, &todo, reach);
            }
            exemplar.search(&mut field, &guide, &todo, 5, round);
        }
        let after: f32 = field.iter().map(|m| m.cost).sum();
        assert!(after < 0.02 * before, "{before} → {after}");
        let detail = exemplar.detail(&guide, &todo, 4, 5);
        let energy = detail.data().iter().map(|d| d[1] * d[1]).sum::<f32>() / 1600.0;
        assert!(energy > 0.2 * 0.05 * 0.05, "texture is lost: {energy}");
    }

    #[test]
    fn a_painting_too_small_for_a_patch_lends_nothing() {
        let painting = stripes(5, 5);
        let exemplar = Exemplar::new(&painting, painting.clone(), &Mask::filled(5, 5, true), 3);
        let detail = exemplar.detail(&stripes(9, 9), &Mask::filled(9, 9, true), 4, 0);
        assert!(detail.data().iter().all(|d| *d == [0.0; 3]));
    }
}
