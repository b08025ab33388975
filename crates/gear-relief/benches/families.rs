//! Truth error of the height estimate by object, manner and variant:
//! `cargo bench -p gear-relief --bench families`.

#[path = "../tests/families/shapes.rs"]
mod shapes;

use gear_relief::base::inflated;
use gear_relief::height::{HeightSettings, estimate};
use gear_relief::light::Calibration;
use shapes::{FLAT, Manner, PAINT, PHOTO, Score, albedo, objects, paint, score};

fn variant(name: &str) -> HeightSettings {
    let mut settings = HeightSettings::default();
    match name {
        "base" => settings.detail.iterations = 0,
        "painted" => settings.calibration = Calibration::PAINTED,
        _ => {}
    }
    settings
}

fn main() {
    let variants = ["base", "natural", "painted"];
    let lights: [[f32; 3]; 2] = [PHOTO.light, [0.6, -0.3, 0.74]];
    println!(
        "{:8}{:8}{:10}{:>8}{:>8}{:>8}{:>9}{:>9}{:>9}",
        "manner", "object", "variant", "depth", "normal", "detail", "Δdepth", "Δnormal", "Δdetail"
    );
    for manner in [PHOTO, PAINT, FLAT] {
        let mut worst = vec![(f64::MIN, f64::MIN, f64::MAX); variants.len()];
        let mut total = vec![(Score::default(), Score::default()); variants.len()];
        let objects = objects();
        for object in &objects {
            let alone = score(&inflated(&object.mask, &HeightSettings::default().base), object);
            let mut sums = vec![(Score::default(), 0.0, 0.0); variants.len()];
            let mut n = 0.0;
            for kind in std::env::var("ALB")
                .unwrap_or("plain,stripes,patches".into())
                .split(',')
            {
                let albedo = albedo(kind);
                for (seed, light) in lights.iter().enumerate() {
                    let picture = paint(
                        object,
                        &albedo,
                        Manner {
                            light: *light,
                            seed: seed as u64,
                            ..manner
                        },
                    );
                    n += 1.0;
                    for (v, (sum, trust, gain)) in variants.iter().zip(&mut sums) {
                        let relief = estimate(&picture, &object.mask, &variant(v));
                        let s = score(&relief.height, object);
                        *trust += relief.light.map_or(0.0, |l| f64::from(l.trust));
                        *gain += relief.light.map_or(0.0, |l| f64::from(l.gain));
                        sum.depth += s.depth;
                        sum.normal += s.normal;
                        sum.detail += s.detail;
                    }
                }
            }
            for (v, name) in variants.iter().enumerate() {
                let (s, trust, gain) = &sums[v];
                let s = Score {
                    depth: s.depth / n,
                    normal: s.normal / n,
                    detail: s.detail / n,
                };
                let d = (s.depth - alone.depth, s.normal - alone.normal, s.detail - alone.detail);
                worst[v] = (worst[v].0.max(d.0), worst[v].1.max(d.1), worst[v].2.min(d.2));
                let t = &mut total[v];
                for (sum, s) in [(&mut t.0, s), (&mut t.1, alone)] {
                    sum.depth += s.depth;
                    sum.normal += s.normal;
                    sum.detail += s.detail;
                }
                println!(
                    "{:8}{:8}{name:10}{:8.3}{:8.2}{:8.3}{:+9.4}{:+9.2}{:+9.3}  trust {:.2} gain {:.2}",
                    manner.name,
                    object.name,
                    s.depth,
                    s.normal,
                    s.detail,
                    d.0,
                    d.1,
                    d.2,
                    trust / n,
                    gain / n
                );
            }
        }
        let n = objects.len() as f64;
        for (v, name) in variants.iter().enumerate() {
            let (s, a) = &total[v];
            println!(
                "== {:8}{name:10}{:8.3}{:8.2}{:8.3} (alone {:.3} {:.2} {:.3})  worst {:+.4} {:+.2} {:+.3}",
                manner.name,
                s.depth / n,
                s.normal / n,
                s.detail / n,
                a.depth / n,
                a.normal / n,
                a.detail / n,
                worst[v].0,
                worst[v].1,
                worst[v].2
            );
        }
    }
}
