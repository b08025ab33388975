//! Does grounding help geometry? The benchmark of painted renderings, reconstructed from the painting as it is and from
//! every enhanced version of it, compared with the true surface.
//!
//!     cargo bench -p node-recompose --bench ground_truth -- [KEY=VALUE …]
//!
//! `side=192` and `scenes=8` (of each family) are the benchmark. `first=9` counts scenes from there: scenes that nothing
//! was fitted to. `families=figure,vessel` leaves the others out, `quick=1` the enhanced pictures and the found masks, and
//! `rows=FILE.csv` keeps every single figure.
//!
//! Scenes × conditions × lights, each with the true mask and with the mask that is found. The tables have means over
//! a family's scenes and paired differences with 95 % bootstrap intervals; scenes are what is drawn anew, as lights of
//! one scene are no independent cases.

mod interval;
mod variants;

use std::fmt::Write as _;

use gear_image::Field;
use gear_relief::truth::{SurfaceError, surface_error};
use gear_relief::{height::Relief, mask};
use gear_sample::{Background, Condition, Family, Options, Sample, paint};
use interval::{Interval, paired};
use rayon::prelude::*;
use variants::{Variant, reconstruct};

const CONDITIONS: [(&str, Condition); 3] = [
    ("photo", Condition::Photo),
    ("paint", Condition::Paint),
    ("flat", Condition::Flat),
];
/// From the upper left, and from the right.
const LIGHTS: [[f64; 3]; 2] = [[-0.5, 0.55, 0.67], [0.6, 0.3, 0.74]];

/// One reconstruction of one picture.
struct Row {
    family: Family,
    scene: String,
    condition: &'static str,
    light: usize,
    own_mask: bool,
    variant: Variant,
    error: SurfaceError,
    gain: f64,
    r2: f64,
    trust: f64,
}

/// What is measured, and which way is better.
struct Measure {
    name: &'static str,
    of: fn(&Row) -> f64,
    decimals: usize,
    more_is_better: bool,
}

const MEASURES: [Measure; 4] = [
    Measure {
        name: "depth",
        of: |r| r.error.depth.unwrap_or(1.0),
        decimals: 3,
        more_is_better: false,
    },
    Measure {
        name: "normals °",
        of: |r| r.error.normals_degrees.unwrap_or(90.0),
        decimals: 2,
        more_is_better: false,
    },
    Measure {
        name: "fitted °",
        of: |r| r.error.fitted_normals_degrees.unwrap_or(90.0),
        decimals: 2,
        more_is_better: false,
    },
    Measure {
        name: "detail",
        of: |r| r.error.detail.unwrap_or(0.0),
        decimals: 3,
        more_is_better: true,
    },
];

fn main() {
    let asked = Asked::read();
    let (side, scenes) = (asked.side, asked.scenes);
    let mut cases = Vec::new();
    for &family in &asked.families {
        for number in asked.first..asked.first + scenes {
            for (condition, shown) in CONDITIONS {
                for light in 0..LIGHTS.len() {
                    cases.push((family, format!("{}-{number}", family.name()), condition, shown, light));
                }
            }
        }
    }
    let rows: Vec<Row> = cases
        .into_par_iter()
        .flat_map_iter(|(family, scene, condition, shown, light)| {
            let options = Options {
                longer_side: side,
                background: Background::Textured,
                condition: shown,
                light: LIGHTS[light],
                seed: 1 + light as u64,
            };
            let sample = paint(&scene, &options).expect("scenes of the benchmark have names that exist");
            let quick = asked.quick;
            measured(&sample, quick)
                .into_iter()
                .map(move |(own_mask, variant, relief, error)| Row {
                    family,
                    scene: scene.clone(),
                    condition,
                    light,
                    own_mask,
                    variant,
                    error,
                    gain: relief.light.map_or(0.0, |l| f64::from(l.gain)),
                    r2: relief.light.map_or(0.0, |l| f64::from(l.r2)),
                    trust: relief.light.map_or(0.0, |l| f64::from(l.trust)),
                })
        })
        .collect();
    if let Some(path) = &asked.rows {
        std::fs::write(path, csv(&rows)).expect("the rows can be written");
    }
    let last = asked.first + scenes - 1;
    println!(
        "scenes {} to {last} of a family, {} lights, {side} px\n",
        asked.first,
        LIGHTS.len()
    );
    print!("{}", bar(&rows));
    if !asked.quick {
        print!("{}", answer(&rows));
    }
}

/// What is to be measured.
struct Asked {
    side: usize,
    scenes: u64,
    first: u64,
    families: Vec<Family>,
    quick: bool,
    rows: Option<String>,
}

impl Asked {
    fn read() -> Self {
        let mut asked = Self {
            side: 192,
            scenes: gear_sample::BENCHMARK_SCENES,
            first: 1,
            families: Family::ALL.to_vec(),
            quick: false,
            rows: None,
        };
        let number = |value: &str| -> u64 { value.parse().expect("a number") };
        for argument in std::env::args().skip(1).filter(|a| !a.starts_with("--")) {
            let (key, value) = argument.split_once('=').expect("KEY=VALUE");
            match key {
                "side" => asked.side = number(value) as usize,
                "scenes" => asked.scenes = number(value).max(1),
                "first" => asked.first = number(value).max(1),
                "families" => asked.families.retain(|f| value.split(',').any(|name| name == f.name())),
                "quick" => asked.quick = number(value) > 0,
                "rows" => asked.rows = Some(value.to_owned()),
                _ => panic!("{key} is none of side, scenes, first, families, quick, rows"),
            }
        }
        asked
    }
}

/// All variants on both masks.
fn measured(sample: &Sample, quick: bool) -> Vec<(bool, Variant, Relief, SurfaceError)> {
    let truth = true_depth(sample);
    let found = || mask::automatic(&sample.painting.rgb, &mask::Settings::default()).mask;
    let mut out = Vec::new();
    for own_mask in [false, true] {
        if own_mask && quick {
            continue;
        }
        let mask = if own_mask { &found() } else { &sample.mask };
        for (variant, relief) in reconstruct(sample, mask, own_mask || quick) {
            let side = relief.mask.longer_side() as f32;
            let inside = relief.height.data().iter().zip(relief.mask.data());
            let depth = inside.map(|(&h, &m)| if m { h / side } else { f32::NAN }).collect();
            let depth = Field::from_vec(relief.height.width(), relief.height.height(), depth);
            let error = surface_error(&depth, &truth);
            out.push((own_mask, variant, relief, error));
        }
    }
    out
}

fn true_depth(sample: &Sample) -> Field {
    let inside = sample.height.data().iter().zip(sample.mask.data());
    let data = inside.map(|(&h, &m)| if m { h } else { f32::NAN }).collect();
    Field::from_vec(sample.height.width(), sample.height.height(), data)
}

/// The families that were measured.
fn families(rows: &[Row]) -> impl Iterator<Item = Family> {
    Family::ALL.into_iter().filter(|f| rows.iter().any(|r| r.family == *f))
}

/// Means over the lights of each scene, in the scenes' order.
fn by_scene(rows: &[Row], keep: impl Fn(&Row) -> bool, of: fn(&Row) -> f64) -> Vec<f64> {
    let mut scenes: Vec<(&str, f64, f64)> = Vec::new();
    for row in rows.iter().filter(|r| keep(r)) {
        match scenes.iter_mut().find(|s| s.0 == row.scene) {
            Some(scene) => (scene.1, scene.2) = (scene.1 + of(row), scene.2 + 1.0),
            None => scenes.push((&row.scene, of(row), 1.0)),
        }
    }
    scenes.iter().map(|(_, sum, n)| sum / n).collect()
}

fn compared(rows: &[Row], keep: impl Fn(&Row) -> bool, a: Variant, b: Variant, measure: &Measure) -> Interval {
    let of = |variant| by_scene(rows, |r| keep(r) && r.variant == variant, measure.of);
    paired(&of(a), &of(b))
}

fn cell(interval: &Interval, measure: &Measure) -> String {
    let d = measure.decimals;
    let sign = match interval.sign() {
        0 => "·",
        s if (s > 0) == measure.more_is_better => "**better**",
        _ => "worse",
    };
    format!(
        "{:+.d$} [{:+.d$}, {:+.d$}] {sign}",
        interval.mean, interval.low, interval.high
    )
}

/// The embedded reconstruction (lines and shading) beside plain inflation, with true and with found masks.
fn bar(rows: &[Row]) -> String {
    let mut out = String::from("## The embedded reconstruction beside plain inflation of the silhouette\n\n");
    for (own_mask, title) in [(false, "true masks"), (true, "masks that are found")] {
        if !rows.iter().any(|r| r.own_mask == own_mask) {
            continue;
        }
        let _ = writeln!(out, "### {title}\n");
        let _ = writeln!(
            out,
            "| family | condition | IoU | depth: silhouette | Δ | normals ° | Δ | detail | Δ | worst scene Δdepth, Δ° |"
        );
        let _ = writeln!(out, "|---|---|---|---|---|---|---|---|---|---|");
        for family in families(rows) {
            for (condition, _) in CONDITIONS {
                let keep = |r: &Row| r.family == family && r.condition == condition && r.own_mask == own_mask;
                let mean = |measure: &Measure| {
                    let values = by_scene(rows, |r| keep(r) && r.variant == Variant::Plain, measure.of);
                    values.iter().sum::<f64>() / values.len() as f64
                };
                let iou = by_scene(
                    rows,
                    |r| keep(r) && r.variant == Variant::Plain,
                    |r| r.error.silhouette.unwrap_or(0.0),
                );
                let _ = write!(
                    out,
                    "| {} | {condition} | {:.3} |",
                    family.name(),
                    iou.iter().sum::<f64>() / iou.len() as f64
                );
                for index in [0, 1, 3] {
                    let measure = &MEASURES[index];
                    let interval = compared(rows, keep, Variant::Raw, Variant::Plain, measure);
                    let _ = write!(
                        out,
                        " {:.*} | {} |",
                        measure.decimals,
                        mean(measure),
                        cell(&interval, measure)
                    );
                }
                let worst = |measure: &Measure| {
                    let of = |variant| by_scene(rows, |r| keep(r) && r.variant == variant, measure.of);
                    of(Variant::Raw)
                        .iter()
                        .zip(of(Variant::Plain))
                        .fold(f64::MIN, |w, (a, b)| w.max(a - b))
                };
                let _ = writeln!(out, " {:+.4}, {:+.2} |", worst(&MEASURES[0]), worst(&MEASURES[1]));
            }
        }
        out.push('\n');
    }
    out
}

/// Every version of the picture beside the picture as it is.
fn answer(rows: &[Row]) -> String {
    let mut out = String::new();
    let asked = [
        (Variant::Auto, "as shipped (`beta: auto`)"),
        (Variant::Grounded, "whatever the light (β = .5)"),
        (Variant::HistogramEqualization, "histogram equalization"),
        (Variant::Retinex, "retinex"),
    ];
    for (variant, title) in asked {
        let _ = writeln!(
            out,
            "## The picture, {title}, beside the picture as it is (true masks)\n"
        );
        let _ = write!(out, "| family | condition |");
        for measure in &MEASURES {
            let _ = write!(out, " Δ {} |", measure.name);
        }
        let _ = writeln!(out, "\n|---|---{}|", "|---".repeat(MEASURES.len()));
        for family in families(rows) {
            for (condition, _) in CONDITIONS {
                let keep = |r: &Row| r.family == family && r.condition == condition && !r.own_mask;
                let _ = write!(out, "| {} | {condition} |", family.name());
                for measure in &MEASURES {
                    let interval = compared(rows, keep, variant, Variant::Raw, measure);
                    let _ = write!(out, " {} |", cell(&interval, measure));
                }
                out.push('\n');
            }
        }
        out.push('\n');
    }
    let _ = writeln!(
        out,
        "## Means: depth, normals °, detail; gain and r² of the fitted light (true masks)\n"
    );
    let _ = write!(out, "| family | condition |");
    for variant in Variant::ALL {
        let _ = write!(out, " {} |", variant.name());
    }
    let _ = writeln!(out, "\n|---|---{}|", "|---".repeat(Variant::ALL.len()));
    for family in families(rows) {
        for (condition, _) in CONDITIONS {
            let _ = write!(out, "| {} | {condition} |", family.name());
            for variant in Variant::ALL {
                let keep =
                    |r: &Row| r.family == family && r.condition == condition && !r.own_mask && r.variant == variant;
                let mean = |of: fn(&Row) -> f64| {
                    let values = by_scene(rows, keep, of);
                    values.iter().sum::<f64>() / values.len() as f64
                };
                let [depth, normals, _, detail] = MEASURES.map(|m| mean(m.of));
                let _ = write!(out, " {depth:.3} {normals:.1} {detail:.3}");
                if variant.is_lit() {
                    let _ = write!(out, " ({:.2}, {:.2})", mean(|r| r.gain), mean(|r| r.r2));
                }
                let _ = write!(out, " |");
            }
            out.push('\n');
        }
    }
    out
}

fn csv(rows: &[Row]) -> String {
    let mut out = String::from(
        "family,scene,condition,light,mask,variant,depth,normals,fitted_normals,detail,iou,gain,r2,trust\n",
    );
    for r in rows {
        let number = |v: Option<f64>| v.map_or(String::new(), |v| format!("{v:.5}"));
        let e = &r.error;
        let _ = writeln!(
            out,
            "{},{},{},{},{},\"{}\",{},{},{},{},{},{:.4},{:.4},{:.4}",
            r.family.name(),
            r.scene,
            r.condition,
            r.light,
            if r.own_mask { "found" } else { "true" },
            r.variant.name(),
            number(e.depth),
            number(e.normals_degrees),
            number(e.fitted_normals_degrees),
            number(e.detail),
            number(e.silhouette),
            r.gain,
            r.r2,
            r.trust,
        );
    }
    out
}
