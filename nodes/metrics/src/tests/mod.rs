//! The node as a whole: the sanity table of shapes, invariances, its report.

mod shapes;

use std::collections::BTreeMap;

use gear_graph::testing;
use gear_image::SrgbImage;
use proptest::prelude::*;

use self::shapes::SIDE;
use super::*;

const TABLE: &str = include_str!("../../../../tests/oracles/metrics_shapes.json");

fn measured(scene: &Scene) -> (vend::Vend, Vec<f64>) {
    let surfels = Surfels::of(scene);
    let deviations = vend::principal_deviations(&surfels);
    let maps = views::depth_maps(scene, &Metrics::default().ddi_yaws, SIDE as u32);
    let mut ddi: Vec<f64> = maps.iter().map(|map| ddi::ddi(map, deviations)).collect();
    ddi.push(mean(&ddi).unwrap());
    (vend::vend(&surfels, vend::CELLS), ddi)
}

fn scene(name: &str) -> Scene {
    let bust = || shapes::bust().scene(0.6);
    match name {
        "empty" => Scene::default(),
        "one point" => bust().filtered(|i| i == 0),
        "line" => {
            let mut scene = bust();
            for c in &mut scene.centers {
                (c.y, c.z) = (0.0, 0.0);
            }
            scene
        }
        "plane" => shapes::plane(),
        "slab" => shapes::slab().scene(1.0),
        "shallow relief" => shapes::panel().map(|h, _, _| 0.5 * h).scene(0.2),
        "relief" => shapes::panel().scene(0.6),
        "flat bust" => shapes::bust().map(|h, _, _| 0.2 * h).scene(0.6),
        "bust" => bust(),
        "bust with detail" => shapes::bust()
            .map(|h, x, y| {
                h + if h > 4.0 {
                    1.5 * libm::sin(x / 2.0) * libm::sin(y / 2.3)
                } else {
                    0.0
                }
            })
            .scene(0.6),
        "folds" => shapes::folds().scene(0.6),
        "folds smoothed" => shapes::folds().smoothed(5.0).scene(0.6),
        "sphere" => shapes::sphere().scene(1.0),
        "torus" => shapes::torus().scene(1.0),
        "bust scaled and moved" => {
            let mut scene = bust();
            for (c, s) in scene.centers.iter_mut().zip(&mut scene.log_scales) {
                *c = *c * 1e4 + glam::Vec3::splat(5e3);
                *s += glam::Vec3::splat(libm::log(1e4) as f32);
            }
            scene
        }
        "half the points" => {
            // Fronts and backs alternate: every second pair.
            let mut scene = bust().filtered(|i| i / 2 % 2 == 0);
            for s in &mut scene.log_scales {
                *s += glam::Vec3::splat(0.5 * std::f32::consts::LN_2);
            }
            scene
        }
        "noise" => shapes::noise(),
        other => panic!("no shape {other}"),
    }
}

/// VEND is the prototype's but for the last lattice cell. DDI looks at our own rendering: rays meet surfels where the
/// prototype's point sprites make stairs, so it is pinned apart: smooth shapes score lower than there.
#[test]
fn every_shape_scores_as_its_character_says() {
    let table: Value = serde_json::from_str(TABLE).unwrap();
    let vend_tolerance = table["tolerance"]["vend"].as_f64().unwrap();
    let ddi_tolerance = table["tolerance"]["ddi"].as_f64().unwrap();
    let mut wrong = Vec::new();
    let mut averages = BTreeMap::new();
    for row in table["shapes"].as_array().unwrap() {
        let name = row["shape"].as_str().unwrap();
        let (vend, ddi) = measured(&scene(name));
        let average = ddi[ddi.len() - 1];
        averages.insert(name, average);
        let [want_vend, theirs, ours] = ["vend", "ddi_prototype", "ddi"].map(|k| row[k].as_f64().unwrap());
        println!(
            "{name}: VEND {:.2} ({want_vend}), DDI {average:.2} ({ours}; prototype {theirs})",
            vend.vend
        );
        if (vend.vend - want_vend).abs() > vend_tolerance || (average - ours).abs() > ddi_tolerance {
            wrong.push(name);
        }
    }
    assert!(wrong.is_empty(), "off: {wrong:?}");
    // Whatever the renderer, detail orders shapes as one would.
    let rising = |names: &[&str]| names.windows(2).all(|n| averages[n[0]] < averages[n[1]]);
    assert!(rising(&["flat bust", "bust", "bust with detail", "noise"]));
    assert!(rising(&["plane", "slab", "shallow relief", "relief"]));
    assert!(rising(&["folds smoothed", "folds"]));
}

fn inputs(scene: Scene) -> In {
    let painting = SrgbImage::from_fn(SIDE, SIDE, |x, y| {
        let v = 0.4 + 0.2 * (((x * 31 + y * 17) % 23) as f32 / 23.0);
        [v, 0.9 * v, 0.8 * v]
    });
    let mask = Mask::from_vec(SIDE, SIDE, shapes::bust().mask);
    In {
        scene: Arc::new(scene),
        grounded: Arc::new(Image::opaque(painting.clone())),
        painting: Arc::new(Image::opaque(painting)),
        mask: Arc::new(mask),
    }
}

fn report(node: &Metrics, inputs: In) -> Value {
    testing::run(node, inputs).unwrap().report.0.clone()
}

fn quick() -> Metrics {
    Metrics {
        normal_cells: vend::CELLS,
        view_yaws: vec![0.0, 45.0],
        ddi_yaws: vec![30.0],
        ddi_size: 96,
        view_size: 0,
    }
}

#[test]
fn the_report_of_a_bust_is_pinned() {
    let mut report = report(&quick(), inputs(scene("bust")));
    round(&mut report);
    insta::assert_json_snapshot!(report);
}

/// Three digits: the figures are deterministic, but a reader wants to see them.
fn round(value: &mut Value) {
    match value {
        Value::Object(fields) => fields.values_mut().for_each(round),
        Value::Number(n) if n.is_f64() => {
            *value = json!((n.as_f64().unwrap() * 1e3).round() / 1e3);
        }
        _ => {}
    }
}

#[test]
fn an_empty_scene_has_no_extent_and_no_naturalness() {
    let report = report(&quick(), inputs(Scene::default()));
    assert_eq!(report["vend"], 0.0);
    assert_eq!(report["ddi"]["average"], 0.0);
    assert_eq!(report["niqe"]["views_average"], Value::Null);
    assert_eq!(report["front"]["psnr_db"], Value::Null, "no canonical camera");
}

#[test]
fn invalid_gaussians_are_dropped_and_counted() {
    let clean = scene("flat bust");
    let mut spoilt = clean.clone();
    for i in 0..5 {
        let mut gaussian = clean.filtered(|k| k == i);
        gaussian.centers[0].x = [f32::NAN, f32::INFINITY][i % 2];
        spoilt.centers.extend(gaussian.centers);
        spoilt.log_scales.extend(gaussian.log_scales);
        spoilt.rotations.extend(gaussian.rotations);
        spoilt.opacity_logits.extend(gaussian.opacity_logits);
        spoilt.sh_dc.extend(gaussian.sh_dc);
    }
    let (mut a, b) = (report(&quick(), inputs(clean)), report(&quick(), inputs(spoilt)));
    a["dropped"] = json!(5);
    assert_eq!(a, b);
}

#[test]
fn a_mask_of_another_size_is_refused() {
    let mut inputs = inputs(scene("one point"));
    inputs.mask = Arc::new(Mask::filled(3, 4, true));
    let error = testing::run(&quick(), inputs).err().unwrap().to_string();
    assert!(error.contains("mask") && error.contains("3×4"), "{error}");
}

#[test]
fn an_answer_or_an_error_on_every_extreme_input() {
    testing::assert_extremes(&Metrics {
        ddi_size: 32,
        ..quick()
    });
}

#[test]
fn same_bits_on_any_thread_count() {
    testing::assert_pure(&quick(), || inputs(scene("flat bust")));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    #[test]
    fn vend_does_not_change_with_scale_place_or_turn(scale in 0.01..100.0f32, x in -3.0..3.0f32, angle in -180.0..180.0f64) {
        let before = shapes::panel().scene(0.6).filtered(|i| i % 8 == 0);
        let extent = |scene: &Scene| vend::vend(&Surfels::of(scene), vend::CELLS).extent;
        let (sin, cos) = (libm::sin(angle.to_radians() / 2.0) as f32, libm::cos(angle.to_radians() / 2.0) as f32);
        let turn = glam::Quat::from_xyzw(0.6 * sin, 0.8 * sin, 0.0, cos);
        let mut after = before.clone();
        for i in 0..after.len() {
            after.centers[i] = turn * (after.centers[i] * scale) + glam::Vec3::splat(x * scale);
            after.log_scales[i] += glam::Vec3::splat(libm::log(f64::from(scale)) as f32);
            after.rotations[i] = turn * after.rotations[i];
        }
        prop_assert!((extent(&before) - extent(&after)).abs() < 1e-5);
    }
}
