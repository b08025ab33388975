//! Layers: in a whole canvas, what is drawn lower stands before what is drawn above it.
//!
//! The elevation cue: across a contour the surface rises towards the lower side, as where a hill stands before the hills
//! behind it. The rise at a pixel is asked for as a slope downwards,
//!
//! ```text
//! v = step · E · cos²φ,    −Δd + d/ℓ² = −∂v/∂y,
//! ```
//!
//! with E the contour in [0, 1] and φ its angle with the horizon (an upright contour says nothing of above and below), and
//! the surface whose slopes come nearest to that is `d`; ℓ keeps a staircase of contours from climbing on and on. E is as wide
//! as it is long-sighted, a share of the longer side, so that the height of a step is one too.
//!
//! On the benchmark's layered landscapes this takes the depth error from .386 to .338, the normals from 24.1° to 23.7°, and
//! the correlation of detail from .06 to .12 (painted; photographed and flat ones gain alike).

use gear_image::edges::soft_edges;
use gear_image::filter::{gaussian, gaussian_rgb, gradient};
use gear_image::solve::{Coefficients, GridSystem, SolveOptions};
use gear_image::{Field, LinearImage, Mask};

use crate::fields::{map, zip};

/// How contours become steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerSettings {
    /// Slope that a full contour asks for, height a pixel. 0: contours do nothing.
    pub step: f32,
    /// ℓ, over which a step fades, as a share of the longer side.
    pub length: f32,
}

impl Default for LayerSettings {
    fn default() -> Self {
        Self { step: 0.5, length: 0.4 }
    }
}

/// Blur under which contours are looked for, as a share of the longer side.
const CONTOUR_SIGMA: f32 = 0.0104;
/// Share of the pixels that are less than a full contour.
const CONTOUR_QUANTILE: f64 = 0.95;

/// Mean cos²φ of the contours below which a canvas has no layers, and above which it has.
const LEVEL: [f32; 2] = [0.55, 0.65];

/// The layers of a canvas in pixels, to be added to a height. `None` when nothing is asked for.
pub fn layers(image: &LinearImage, settings: &LayerSettings) -> Option<Field> {
    let (width, height) = image.size();
    if settings.step == 0.0 || height < 2 || width == 0 {
        return None;
    }
    let side = image.longer_side() as f32;
    let slope = slopes(image, settings.step, f64::from(CONTOUR_SIGMA * side));
    let mut source = vec![0.0; width * height];
    for (p, pair) in (0..width * (height - 1)).map(|p| (p, [p, p + width])) {
        let [above, below] = pair.map(|q| f64::from(slope.data()[q]));
        let rise = 0.5 * (above + below);
        source[p] -= rise;
        source[p + width] += rise;
    }
    let length = (settings.length * side).max(1.0);
    let absorption = Field::filled(width, height, 1.0 / (length * length));
    let canvas = Mask::filled(width, height, true);
    let coefficients = Coefficients {
        absorption: Some(&absorption),
        ..Default::default()
    };
    let solution = GridSystem::new(&canvas, &coefficients).solve(&source, None, SolveOptions::default());
    Some(solution.to_field(width, height))
}

/// The slope that contours ask for, height a pixel downwards.
fn slopes(image: &LinearImage, step: f32, sigma: f64) -> Field {
    let contours = soft_edges(image, sigma, CONTOUR_QUANTILE);
    let smooth = gaussian_rgb(image, 2.0 * sigma);
    let lightness = map(&smooth.luminance(), |y| libm::cbrtf(y.max(0.0)));
    let (gx, gy) = gradient(&lightness);
    let mean_square = |g: &Field| gaussian(&map(g, |g| g * g), 2.0 * sigma);
    let (across, down) = (mean_square(&gx), mean_square(&gy));
    let level = zip(&down, &across, |down, across| down / (down + across).max(1e-12));
    let rise = zip(&contours, &level, |contour, level| contour * level);
    let sum = |field: &Field| field.data().iter().map(|&x| f64::from(x)).sum::<f64>();
    let share = (sum(&rise) / sum(&contours).max(1e-12)) as f32;
    let due = ((share - LEVEL[0]) / (LEVEL[1] - LEVEL[0])).clamp(0.0, 1.0);
    map(&rise, |rise| step * due * rise)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gear_image::Rgb;

    /// A dark hill before a bright sky, the picture's side `side`.
    fn hill(side: usize) -> LinearImage {
        Rgb::from_fn(
            side,
            side,
            |_, y| if 2 * y < side { [0.8; 3] } else { [0.2, 0.25, 0.2] },
        )
    }

    fn rise(field: &Field) -> f32 {
        let (w, h) = field.size();
        (field.at(w / 2, h * 3 / 4) - field.at(w / 2, h / 4)) / w as f32
    }

    #[test]
    fn what_is_lower_comes_nearer_whatever_its_tone_and_at_any_size() {
        let small = layers(&hill(96), &LayerSettings::default()).unwrap();
        assert!(rise(&small) > 0.005, "{}", rise(&small));
        let night = Rgb::from_fn(96, 96, |x, y| hill(96).at(x, 95 - y));
        let of_night = rise(&layers(&night, &LayerSettings::default()).unwrap());
        assert!((of_night / rise(&small) - 1.0).abs() < 0.1, "{of_night}");
        let large = rise(&layers(&hill(288), &LayerSettings::default()).unwrap());
        assert!(
            (large / rise(&small) - 1.0).abs() < 0.25,
            "{large} and {}",
            rise(&small)
        );
    }

    #[test]
    fn an_upright_contour_and_an_empty_canvas_say_nothing() {
        let wall = Rgb::from_fn(96, 96, |x, _| if x < 48 { [0.8; 3] } else { [0.2; 3] });
        let beside = layers(&wall, &LayerSettings::default()).unwrap();
        assert!(beside.data().iter().all(|d| d.abs() < 0.01));
        let empty = layers(&Rgb::filled(40, 30, [0.5; 3]), &LayerSettings::default()).unwrap();
        assert!(empty.data().iter().all(|&d| d == 0.0));
    }

    #[test]
    fn figures_in_one_plane_have_no_layers() {
        let discs = Rgb::from_fn(96, 96, |x, y| {
            let from = |cx: usize, cy: usize| x.abs_diff(cx).pow(2) + y.abs_diff(cy).pow(2);
            let inside = from(24, 30) < 150 || from(70, 34) < 120 || from(48, 70) < 180;
            if inside { [0.7, 0.6, 0.5] } else { [0.2; 3] }
        });
        let found = layers(&discs, &LayerSettings::default()).unwrap();
        assert!(found.data().iter().all(|&d| d == 0.0));
    }

    #[test]
    fn no_step_is_no_layer_and_slivers_do_no_harm() {
        let none = LayerSettings {
            step: 0.0,
            ..LayerSettings::default()
        };
        assert!(layers(&hill(40), &none).is_none());
        for (w, h) in [(1, 1), (1, 40), (40, 1), (2, 2)] {
            let sliver = Rgb::from_fn(w, h, |x, y| [(x + y) as f32 * 0.01; 3]);
            let found = layers(&sliver, &LayerSettings::default());
            assert!(found.is_none_or(|d| d.data().iter().all(|d| d.is_finite())));
        }
    }
}
