//! From a stage to a painting and its truth.
//!
//! The picture is made on a grid twice as fine and averaged down in linear light. The order is a court
//! painter's: flat colour; a wash that darkens towards the lines; a weak, softly posterised modelling; lines
//! whose width swells along them; then what time and material did: the grain of the brush and the weave.
//!
//! ```text
//! picture = (albedo · shade · wash, then ink over it) · grain
//! ```
//!
//! Truth is sampled at the pixel centres of the picture itself, from the same stage.

use gear_image::{Field, Image, LinearImage, Mask, SrgbImage};
use rayon::prelude::*;

use crate::palette::{Palette, encode, mix, scale};
use crate::random::{fractal, noise, smoothstep};
use crate::stage::{Colour, Hit, Stage};
use crate::{Background, Condition, Options, Sample, ground};

/// Samples a pixel side.
const FINE: usize = 2;
/// Width of a full outline, world units (1.9 px at 768).
const LINE: f64 = 0.0025;

struct Grid {
    width: usize,
    height: usize,
    step: f64,
    /// The stage is shown this much smaller: in a mount it has to leave room.
    shrink: f64,
}

impl Grid {
    fn new(width: usize, height: usize, fine: usize, shrink: f64) -> Self {
        let step = 1.0 / (width.max(height) * fine) as f64;
        Self {
            width: width * fine,
            height: height * fine,
            step,
            shrink,
        }
    }

    fn position(&self, index: usize) -> (f64, f64) {
        let (i, j) = (index % self.width, index / self.width);
        let x = (i as f64 - 0.5 * (self.width as f64 - 1.0)) * self.step;
        let y = (j as f64 - 0.5 * (self.height as f64 - 1.0)) * self.step;
        (x, y)
    }

    fn trace(&self, stage: &Stage) -> Vec<Hit> {
        (0..self.width * self.height)
            .into_par_iter()
            .map(|index| {
                let (x, y) = self.position(index);
                let mut hit = stage.trace(x / self.shrink, y / self.shrink);
                hit.height *= self.shrink;
                hit
            })
            .collect()
    }

    /// Unit normals (y up); differences are taken inside one part wherever a neighbour belongs to it.
    fn normals(&self, hits: &[Hit]) -> Vec<[f32; 3]> {
        (0..hits.len())
            .into_par_iter()
            .map(|index| {
                let (i, j) = (index % self.width, index / self.width);
                let p = self.slope(hits, index, i > 0, i + 1 < self.width, 1);
                let q = self.slope(hits, index, j > 0, j + 1 < self.height, self.width);
                let norm = (p * p + q * q + 1.0).sqrt();
                [(-p / norm) as f32, (q / norm) as f32, (1.0 / norm) as f32]
            })
            .collect()
    }

    fn slope(&self, hits: &[Hit], index: usize, before: bool, after: bool, stride: usize) -> f64 {
        let here = &hits[index];
        let same = |other: &Hit| other.part == here.part;
        let back = before.then(|| &hits[index - stride]).filter(|h| same(h));
        let fore = after.then(|| &hits[index + stride]).filter(|h| same(h));
        let rise = match (back, fore) {
            (Some(a), Some(b)) => 0.5 * (b.height - a.height),
            (Some(a), None) => here.height - a.height,
            (None, Some(b)) => b.height - here.height,
            (None, None) => 0.0,
        };
        rise / self.step
    }
}

/// Paints `stage`.
pub fn paint(name: &str, stage: &Stage, options: &Options) -> Sample {
    let (width, height) = canvas(stage.aspect, options.longer_side);
    let shrink = if options.background == Background::Bordered && !stage.whole_canvas {
        0.86
    } else {
        1.0
    };
    let truth = Grid::new(width, height, 1, shrink);
    let hits = truth.trace(stage);
    let inside = |hit: &Hit| stage.whole_canvas || hit.part.is_some();
    let mask = Mask::from_vec(width, height, hits.iter().map(inside).collect());
    let world = |hit: &Hit| if inside(hit) { hit.height as f32 } else { 0.0 };
    let height_field = Field::from_vec(width, height, hits.iter().map(world).collect());
    let mut normals = truth.normals(&hits);
    for (normal, hit) in normals.iter_mut().zip(&hits) {
        if !inside(hit) {
            *normal = [0.0; 3];
        }
    }
    let parts = hits.iter().map(|h| h.part.map_or(0, |p| p as u16 + 1)).collect();

    let fine = Grid::new(width, height, FINE, shrink);
    let layers = Layers::new(stage, &fine, options);
    Sample {
        name: name.to_owned(),
        painting: Image::opaque(layers.picture(&fine, true, true)),
        unlined: layers.picture(&fine, true, false),
        albedo: LinearImage::from_vec(width, height, average(&fine, &layers.albedo)),
        mask,
        height: height_field,
        normals,
        parts,
    }
}

fn canvas(aspect: f64, longer_side: usize) -> (usize, usize) {
    let shorter = |share: f64| ((longer_side as f64 * share).round() as usize).max(1);
    if aspect >= 1.0 {
        (longer_side, shorter(1.0 / aspect))
    } else {
        (shorter(aspect), longer_side)
    }
}

struct Layers {
    palette: &'static Palette,
    /// Reflectance, ground included.
    albedo: Vec<[f32; 3]>,
    /// Modelling, 1 where there is none.
    shade: Vec<f32>,
    /// Darkening towards lines.
    wash: Vec<f32>,
    /// Lines, 0 to 1.
    ink: Vec<f32>,
    /// Brush grain and weave, about 1.
    grain: Vec<f32>,
}

impl Layers {
    fn new(stage: &Stage, grid: &Grid, options: &Options) -> Self {
        let palette = Palette::court();
        let hits = grid.trace(stage);
        let half = [
            0.5 * grid.width as f64 * grid.step,
            0.5 * grid.height as f64 * grid.step,
        ];
        let albedo = (0..hits.len())
            .into_par_iter()
            .map(|index| {
                let (x, y) = grid.position(index);
                let colour = match hits[index].part {
                    Some(_) => hits[index].skin.albedo,
                    None => ground::colour(options.background, palette, x, y, half, options.seed),
                };
                colour.map(|c| c as f32)
            })
            .collect();
        let normals = grid.normals(&hits);
        let shade = modelling(&hits, &normals, options);
        let painted = options.condition != Condition::Photo;
        let ink = if painted {
            lines(stage, grid, &hits, options.seed)
        } else {
            vec![0.0; hits.len()]
        };
        let wash = wash(grid, &hits, &ink);
        let grain = grain(grid, &hits, options);
        Self {
            palette,
            albedo,
            shade,
            wash,
            ink,
            grain,
        }
    }

    fn picture(&self, grid: &Grid, shaded: bool, lined: bool) -> SrgbImage {
        let linear: Vec<[f32; 3]> = (0..self.albedo.len())
            .into_par_iter()
            .map(|i| {
                let mut colour: Colour = self.albedo[i].map(f64::from);
                if shaded {
                    colour = scale(colour, f64::from(self.shade[i] * self.wash[i]));
                }
                if lined {
                    colour = mix(colour, self.palette.ink, 0.86 * f64::from(self.ink[i]));
                }
                scale(colour, f64::from(self.grain[i])).map(|c| c as f32)
            })
            .collect();
        let small = average(grid, &linear);
        let encoded = small
            .iter()
            .map(|c| c.map(|v| encode(f64::from(v)).clamp(0.0, 1.0) as f32))
            .collect();
        SrgbImage::from_vec(grid.width / FINE, grid.height / FINE, encoded)
    }
}

/// Lambert shading: full for a photograph; weak and softly stepped for a painting.
fn modelling(hits: &[Hit], normals: &[[f32; 3]], options: &Options) -> Vec<f32> {
    let l = options.light;
    let norm = (l[0] * l[0] + l[1] * l[1] + l[2] * l[2]).sqrt().max(1e-9);
    let light = l.map(|c| c / norm);
    (0..hits.len())
        .into_par_iter()
        .map(|i| {
            if hits[i].part.is_none() {
                return 1.0;
            }
            let n = normals[i].map(f64::from);
            let lambert = (n[0] * light[0] + n[1] * light[1] + n[2] * light[2]).max(0.0);
            let shade = match options.condition {
                Condition::Photo => 0.22 + 0.9 * lambert,
                Condition::Paint => 0.80 + 0.26 * steps(lambert, 4.0),
                Condition::Flat => 1.0,
            };
            shade as f32
        })
        .collect()
}

/// Soft posterisation: `tones` plateaus with rounded risers.
fn steps(value: f64, tones: f64) -> f64 {
    let t = value * tones;
    let stair = (t.floor() + smoothstep(0.25, 0.75, t - t.floor())) / tones;
    0.35 * value + 0.65 * stair
}

/// Outlines where the part changes, and the lines that the parts' own dresses draw.
fn lines(stage: &Stage, grid: &Grid, hits: &[Hit], seed: u64) -> Vec<f32> {
    let (w, h) = (grid.width, grid.height);
    let unit = LINE.max(0.9 * FINE as f64 * grid.step);
    let reach = (1.2 * unit / grid.step).ceil() as isize + 1;
    let mut apart = vec![f32::MAX; hits.len()];
    for j in 0..h {
        for i in 0..w {
            let here = hits[j * w + i].part;
            let beyond = |part: Option<usize>| part.map_or(-1, |p| p as isize);
            let mut front = None;
            for (x, y) in [(i.wrapping_sub(1), j), (i + 1, j), (i, j.wrapping_sub(1)), (i, j + 1)] {
                if x < w && y < h && beyond(hits[y * w + x].part) < beyond(here) {
                    front = here;
                }
            }
            let weight = front.map_or(0.0, |p| stage.parts[p].outline);
            if weight <= 0.0 {
                continue;
            }
            for dy in -reach..=reach {
                for dx in -reach..=reach {
                    let (x, y) = (i as isize + dx, j as isize + dy);
                    if x >= 0 && y >= 0 && x < w as isize && y < h as isize {
                        let d = ((dx * dx + dy * dy) as f64).sqrt() * grid.step / weight;
                        let at = &mut apart[y as usize * w + x as usize];
                        *at = at.min(d as f32);
                    }
                }
            }
        }
    }
    (0..hits.len())
        .into_par_iter()
        .map(|index| {
            let (x, y) = grid.position(index);
            let swell = 0.5 + 0.2 * noise(seed + 5, 16.0 * x, 16.0 * y);
            let own = hits[index].skin.ink * (0.9 + 0.1 * noise(seed + 6, 60.0 * x, 60.0 * y));
            let width = unit * swell;
            let outline = smoothstep(
                width + 0.8 * grid.step,
                (width - 0.8 * grid.step).max(0.0),
                f64::from(apart[index]),
            );
            outline.max(own) as f32
        })
        .collect()
}

/// Colour washes deepen towards the lines (three box means of the ink inside the figure).
fn wash(grid: &Grid, hits: &[Hit], ink: &[f32]) -> Vec<f32> {
    let radius = ((0.007 / grid.step).round() as usize).max(1);
    let mut spread = ink.to_vec();
    for _ in 0..3 {
        box_mean(&mut spread, grid.width, grid.height, radius);
    }
    let deepen = |(s, h): (&f32, &Hit)| {
        if h.part.is_some() {
            1.0 - 0.42 * (2.6 * s).min(1.0)
        } else {
            1.0
        }
    };
    spread.iter().zip(hits).map(deepen).collect()
}

/// Brush grain that follows the picture's diagonal, the weave of the silk, and a little fading.
fn grain(grid: &Grid, hits: &[Hit], options: &Options) -> Vec<f32> {
    let seed = options.seed;
    let (brush, weave) = match options.condition {
        Condition::Photo => (0.01, 0.0),
        Condition::Paint => (0.075, 0.020),
        Condition::Flat => (0.0, 0.0),
    };
    (0..hits.len())
        .into_par_iter()
        .map(|index| {
            let (x, y) = grid.position(index);
            let part = hits[index].part.map_or(0, |p| p as u64 + 1);
            let lift = if hits[index].part.is_some() { 1.0 } else { 0.6 };
            let stroke = fractal(seed + 50 + part, 34.0 * (x + 0.3 * y), 150.0 * (y - 0.3 * x), 2);
            let worn = fractal(seed + 21, 6.0 * x, 6.0 * y, 4);
            let thread = noise(seed + 22, 340.0 * x, 30.0 * y) + noise(seed + 23, 30.0 * x, 340.0 * y);
            (1.0 + brush * lift * (0.6 * stroke + 0.7 * worn) + weave * thread) as f32
        })
        .collect()
}

fn box_mean(data: &mut [f32], w: usize, h: usize, radius: usize) {
    let line = |row: &[f32]| -> Vec<f32> {
        let mut sums = vec![0.0f64; row.len() + 1];
        for (i, v) in row.iter().enumerate() {
            sums[i + 1] = sums[i] + f64::from(*v);
        }
        (0..row.len())
            .map(|i| {
                let (a, b) = (i.saturating_sub(radius), (i + radius + 1).min(row.len()));
                ((sums[b] - sums[a]) / (b - a) as f64) as f32
            })
            .collect()
    };
    data.par_chunks_mut(w).for_each(|row| row.copy_from_slice(&line(row)));
    let columns: Vec<Vec<f32>> = (0..w)
        .into_par_iter()
        .map(|i| line(&(0..h).map(|j| data[j * w + i]).collect::<Vec<_>>()))
        .collect();
    data.par_chunks_mut(w).enumerate().for_each(|(j, row)| {
        for (i, v) in row.iter_mut().enumerate() {
            *v = columns[i][j];
        }
    });
}

/// Means over `FINE`×`FINE` cells.
fn average(grid: &Grid, data: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let (w, h) = (grid.width / FINE, grid.height / FINE);
    (0..w * h)
        .into_par_iter()
        .map(|index| {
            let (i, j) = (index % w * FINE, index / w * FINE);
            let mut sum = [0.0f32; 3];
            for dy in 0..FINE {
                for dx in 0..FINE {
                    let c = data[(j + dy) * grid.width + i + dx];
                    for k in 0..3 {
                        sum[k] += c[k];
                    }
                }
            }
            sum.map(|s| s / (FINE * FINE) as f32)
        })
        .collect()
}
