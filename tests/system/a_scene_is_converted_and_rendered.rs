//! `gear convert` and `gear render`: scenes in, scenes and pictures out, and what is lost is told.

use std::collections::BTreeMap;
use std::process::Command;

use gear_splat::formats::{self, Format, planes_exr};
use gear_splat::{Camera, Gaussian, Scene};
use gear_tests::{Desk, json};
use glam::{Mat3, Quat, Vec3};

/// A red ball of surfels before a blue one, 40 × 30 pixels in its own camera.
fn scene(sh_degree: u8) -> Scene {
    let mut scene = Scene {
        sh_degree,
        canonical_camera: Some(Camera::front(40, 30)),
        ..Scene::default()
    };
    for i in 0..300 {
        let z = 1.0 - (2.0 * i as f32 + 1.0) / 300.0;
        let (sin, cos) = libm::sincosf(2.399_963 * i as f32);
        let out = Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
        scene.push(Gaussian {
            center: 0.3 * out,
            scales: Vec3::new(0.03, 0.03, 0.004),
            rotation: Quat::from_rotation_arc(Vec3::Z, out),
            opacity: 0.95,
            color: if z > 0.0 { [0.9, 0.2, 0.1] } else { [0.1, 0.2, 0.9] },
        });
    }
    for (i, x) in scene.sh_rest.iter_mut().enumerate() {
        *x = 0.01 * ((i % 5) as f32 - 2.0);
    }
    scene
}

fn desk_with_scene(sh_degree: u8) -> Desk {
    let desk = Desk::new();
    desk.file(
        "scene.ply",
        formats::write(&scene(sh_degree), Format::Ply).unwrap().bytes,
    );
    desk
}

fn picture(desk: &Desk, name: &str) -> image::RgbImage {
    image::open(desk.path(name)).unwrap().to_rgb8()
}

/// Mean difference of two pictures, of 255.
fn difference(a: &image::RgbImage, b: &image::RgbImage) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let pairs = a.as_raw().iter().zip(b.as_raw());
    let sum: f64 = pairs.map(|(a, b)| f64::from(a.abs_diff(*b))).sum();
    sum / a.as_raw().len() as f64
}

#[test]
fn a_converted_scene_looks_as_it_did() {
    let desk = desk_with_scene(1);
    desk.gear(&["render", "scene.ply", "--out", "before"]).exits(0);
    for name in ["scene.spz", "scene.splat", "again.ply"] {
        let done = desk.gear(&["convert", "scene.ply", name]).exits(0);
        assert_eq!(done.stdout.trim(), name);
        let out = format!("after-{name}");
        desk.gear(&["render", name, "--camera", "before/cameras.json", "--out", &out])
            .exits(0);
        let off = difference(
            &picture(&desk, "before/view.png"),
            &picture(&desk, &format!("{out}/view.png")),
        );
        assert!(off < 1.0, "{name}: {off}");
    }
    let exact = formats::open(&desk.path("again.ply")).unwrap();
    assert_eq!((exact.scene, exact.format), (scene(1), Format::Ply));
    // A name that lies does not matter.
    std::fs::rename(desk.path("scene.spz"), desk.path("lie.ply")).unwrap();
    desk.gear(&["convert", "lie.ply", "back.splat"])
        .exits(0)
        .says("SPZ, 300 Gaussians");
}

#[test]
fn what_a_format_cannot_hold_is_told() {
    let desk = desk_with_scene(2);
    desk.gear(&["convert", "scene.ply", "scene.splat"])
        .exits(0)
        .says("SH degree 2 becomes 0")
        .says("canonical camera is not kept")
        .says("rotations to 1°");
    let kept = desk.gear(&["convert", "scene.ply", "scene.glb"]).exits(0);
    assert!(!kept.stderr.contains("note:"), "{kept:?}");
    let mut odd = scene(0);
    odd.centers[3].x = f32::NAN;
    desk.file("odd.ply", formats::write(&odd, Format::Ply).unwrap().bytes);
    desk.gear(&["convert", "odd.ply", "odd.spz"])
        .exits(0)
        .says("1 Gaussians are not finite");
    assert_eq!(formats::open(&desk.path("odd.spz")).unwrap().scene.len(), 299);
}

#[test]
fn what_no_view_sees_is_pruned() {
    let desk = Desk::new();
    let shell = scene(0);
    let mut filled = shell.clone();
    for i in 0..40 {
        filled.push(Gaussian {
            center: Vec3::splat(1e-3 * i as f32),
            scales: Vec3::splat(0.02),
            rotation: Quat::IDENTITY,
            opacity: 0.9,
            color: [0.0, 1.0, 0.0],
        });
    }
    // Closed: no light passes between the surfels.
    filled.log_scales[..300]
        .iter_mut()
        .for_each(|s| *s += Vec3::new(1.0, 1.0, 0.0));
    desk.file("filled.ply", formats::write(&filled, Format::Ply).unwrap().bytes);
    desk.gear(&["convert", "--prune", "30", "filled.ply", "outside.ply"])
        .exits(0)
        .says("30 views from all around do not need");
    let outside = formats::open(&desk.path("outside.ply")).unwrap().scene;
    assert!(outside.len() <= 300 && outside.len() > 150, "{}", outside.len());
    for name in ["filled.ply", "outside.ply"] {
        desk.gear(&["render", name, "--orbit", "5", "--out", name.trim_end_matches(".ply")])
            .exits(0);
    }
    let shown = |folder: &str| picture(&desk, &format!("{folder}/yaw+72.png"));
    assert!(difference(&shown("filled"), &shown("outside")) < 0.5);
    desk.gear(&["convert", "--prune", "0", "filled.ply", "no.ply"])
        .exits(2)
        .says("1..=1000");
}

#[test]
fn a_scene_upside_down_is_turned_over() {
    let desk = desk_with_scene(0);
    let upside_down = Scene {
        canonical_camera: None,
        ..scene(0).turned_over()
    };
    desk.file("down.ply", formats::write(&upside_down, Format::Ply).unwrap().bytes);
    desk.gear(&["convert", "--y-down", "down.ply", "up.ply"]).exits(0);
    let up = formats::open(&desk.path("up.ply")).unwrap().scene;
    assert_eq!(up.centers, scene(0).centers);
}

#[test]
fn what_cannot_be_converted_is_named_and_nothing_is_written() {
    let desk = desk_with_scene(0);
    let bytes = std::fs::read(desk.path("scene.ply")).unwrap();
    desk.file("cut.ply", &bytes[..bytes.len() / 2]);
    desk.file("picture.png", b"\x89PNG\r\n\x1a\n");
    desk.file("empty.spz", b"");
    desk.file(
        "nothing.ply",
        formats::write(&Scene::default(), Format::Ply).unwrap().bytes,
    );
    let before = desk.listing(".");
    for (arguments, part) in [
        (["cut.ply", "out.spz"], "truncated"),
        (["picture.png", "out.spz"], "PNG picture"),
        (["empty.spz", "out.ply"], "empty"),
        (["gone.ply", "out.ply"], "gone.ply: cannot be read"),
        ([".", "out.ply"], "is a folder"),
        (["scene.ply", "out.obj"], "expected .ply, .spz, .splat or .glb"),
        (["scene.ply", "out.compressed.ply"], "read, not written"),
        (["nothing.ply", "out.glb"], "no valid Gaussian"),
        (["scene.ply", "./scene.ply"], "is the input"),
    ] {
        desk.gear(&["convert", arguments[0], arguments[1]]).exits(2).says(part);
    }
    desk.gear(&["convert", "scene.ply", "no/such/folder/out.spz"])
        .exits(1)
        .says("cannot be written");
    assert_eq!(desk.listing("."), before);
    assert_eq!(std::fs::read(desk.path("scene.ply")).unwrap(), bytes);
}

#[test]
fn an_orbit_is_rendered_with_depth_and_normals() {
    let desk = desk_with_scene(0);
    desk.gear(&[
        "render",
        "scene.ply",
        "--orbit",
        "4",
        "--size",
        "64x48",
        "--depth",
        "--normal",
        "--out",
        "p",
    ])
    .exits(0);
    let mut expected = vec!["cameras.json".to_owned()];
    for yaw in ["+0", "+90", "+180", "+270"] {
        for kind in ["png", "depth.exr", "normal.exr"] {
            expected.push(format!("yaw{yaw}.{kind}"));
        }
    }
    expected.sort();
    assert_eq!(desk.listing("p"), expected);
    let middle = |name: &str| picture(&desk, name).get_pixel(32, 24).0;
    let (front, back) = (middle("p/yaw+0.png"), middle("p/yaw+180.png"));
    assert!(front[0] > front[2] + 80 && back[2] > back[0] + 80, "{front:?} {back:?}");
    assert_eq!(picture(&desk, "p/yaw+90.png").dimensions(), (64, 48));

    let again = desk.gear(&["render", "scene.ply", "--camera", "p/cameras.json", "--out", "again"]);
    assert_eq!(again.exits(0).stdout.lines().count(), 5);
    for name in ["yaw+0.png", "yaw+270.png"] {
        let bytes = |folder: &str| std::fs::read(desk.path(folder).join(name)).unwrap();
        assert_eq!(bytes("p"), bytes("again"), "{name}");
    }
    let camera: Camera = serde_json::from_value(json(&desk.path("p/cameras.json"))[0].clone()).unwrap();
    let view = gear_splat::render(&scene(0), &camera, &Default::default(), gear_splat::Outputs::ALL);
    let depth = planes_exr::depth(&view.surface_depth().unwrap()).unwrap();
    assert_eq!(std::fs::read(desk.path("p/yaw+0.depth.exr")).unwrap(), depth);
}

#[test]
fn a_scene_without_a_camera_is_seen_from_the_front_whatever_its_size() {
    let desk = Desk::new();
    for unit in [1e-4f32, 1.0, 1e4] {
        let mut scene = Scene {
            canonical_camera: None,
            ..scene(0)
        };
        scene.centers.iter_mut().for_each(|c| *c = (*c + Vec3::ONE) * unit);
        scene.log_scales.iter_mut().for_each(|s| *s += libm::logf(unit));
        desk.file("scene.ply", formats::write(&scene, Format::Ply).unwrap().bytes);
        desk.gear(&["render", "scene.ply", "--size", "50", "--out", "p"])
            .exits(0);
        let seen = picture(&desk, "p/view.png");
        let middle = seen.get_pixel(25, 25).0;
        assert!(
            seen.dimensions() == (50, 50) && middle[0] > middle[2] + 80,
            "{unit}: {middle:?}"
        );
    }
}

#[test]
fn what_cannot_be_rendered_is_named() {
    let desk = desk_with_scene(0);
    desk.file("camera.json", r#"{"width": 3}"#);
    for (arguments, part) in [
        (
            &["scene.ply", "--camera", "camera.json"][..],
            "--camera camera.json: camera 1: missing field",
        ),
        (&["scene.ply", "--camera", "gone.json"], "cannot be read"),
        (
            &["scene.ply", "--camera", "camera.json", "--orbit", "2"],
            "cannot be used with",
        ),
        (&["scene.ply", "--size", "0x4"], "expected sides"),
        (&["scene.ply", "--size", "wide"], "WIDTHxHEIGHT"),
        (&["scene.ply", "--orbit", "0"], "1..=720"),
        (&["camera.json"], "no Gaussian scene"),
        (&["scene.ply", "--out", "scene.ply"], "is a file, not a folder"),
    ] {
        desk.gear(&[&["render"], arguments].concat()).exits(2).says(part);
    }
    desk.file(
        "nothing.ply",
        formats::write(&Scene::default(), Format::Ply).unwrap().bytes,
    );
    desk.gear(&["render", "nothing.ply", "--size", "8"])
        .exits(0)
        .says("white");
    assert_eq!(picture(&desk, "pictures/view.png").get_pixel(3, 3).0, [255; 3]);
}

#[test]
fn a_graph_takes_a_scene_in_any_format() {
    let desk = desk_with_scene(0);
    desk.gear(&["convert", "scene.ply", "scene.spz"]).exits(0);
    desk.file(
        "graph.yaml",
        "gear: 1\ninputs: {scene: Scene}\nnodes:\n  views: {node: RenderViews, in: {scene: scene}, with: {yaws: [0], size: 24}}\n\
         outputs: {views: views.views}\n",
    );
    for name in ["scene.ply", "scene.spz"] {
        let given = format!("scene={name}");
        desk.gear(&[
            "run",
            "graph.yaml",
            "--input",
            &given,
            "--out",
            name.trim_start_matches("scene."),
        ])
        .exits(0);
    }
    assert!(desk.path("spz/views/yaw+0.png").exists() && desk.path("ply/views/yaw+0.png").exists());
    desk.file("no.spz", b"nothing");
    desk.gear(&["run", "graph.yaml", "--input", "scene=no.spz"])
        .exits(2)
        .says("no Gaussian scene");
}

/// `GEAR_SPLAT_TRANSFORM='npx --yes @playcanvas/splat-transform@2.7.1'`, or any other command that starts it.
#[test]
fn another_reader_finds_in_our_files_what_we_wrote() {
    let Some(command) = std::env::var_os("GEAR_SPLAT_TRANSFORM") else {
        println!("skipped: GEAR_SPLAT_TRANSFORM names no splat-transform");
        return;
    };
    let command = command.into_string().unwrap();
    let mut words = command.split_whitespace();
    let program = words.next().unwrap();
    let words: Vec<&str> = words.collect();
    let desk = desk_with_scene(3);
    for name in ["ours.spz", "ours.splat", "ours.glb"] {
        desk.gear(&["convert", "scene.ply", name]).exits(0);
    }
    let transform = |arguments: &[&str]| {
        let done = Command::new(program)
            .args(&words)
            .args(["--quiet", "--overwrite"])
            .args(arguments)
            .current_dir(desk.path("."))
            .output()
            .unwrap();
        assert!(done.status.success(), "{arguments:?}: {done:?}");
    };
    // What it reads of ours and writes again, and how far a centre, a log scale and a colour may be off then. It takes y
    // to point down in PLY and .splat and up in SPZ, as the format says, so it turns scenes over between these.
    for (from, to, turned, center, scale, color) in [
        ("scene.ply", "theirs.ply", false, 1e-6, 1e-6, 1e-6),
        ("scene.ply", "theirs.compressed.ply", false, 1e-3, 0.01, 0.005),
        ("scene.ply", "theirs.spz", true, 2e-4, 0.04, 0.004),
        ("ours.spz", "of-spz.ply", true, 1e-6, 0.04, 0.004),
        ("ours.splat", "of-splat.ply", false, 1e-6, 1e-4, 0.005),
    ] {
        let ours = if turned { scene(3).turned_over() } else { scene(3) };
        let version: &[&str] = if to.ends_with(".spz") {
            &["--spz-version", "3"]
        } else {
            &[]
        };
        transform(&[version, &[from, to]].concat());
        let theirs = formats::open(&desk.path(to)).unwrap().scene;
        assert_eq!(theirs.len(), 300, "{to}");
        // They reorder compressed files along a curve; each Gaussian of ours has its like.
        for i in 0..theirs.len() {
            let near = |&j: &usize| (ours.centers[j] - theirs.centers[i]).length();
            let j = (0..300).min_by(|a, b| near(a).total_cmp(&near(b))).unwrap();
            assert!(near(&j) < center * 2.0, "{to} {i}: {}", near(&j));
            let off = (ours.log_scales[j] - theirs.log_scales[i]).abs().max_element();
            assert!(off < scale, "{to} {i}: {off}");
            assert!(
                (0..3).all(|c| (ours.color(j)[c] - theirs.color(i)[c]).abs() < color),
                "{to} {i}"
            );
            assert!((ours.opacity(j) - theirs.opacity(i)).abs() < 0.005, "{to} {i}");
            if theirs.sh_degree > 0 {
                let pairs = ours.sh_rest_of(j).iter().zip(theirs.sh_rest_of(i));
                let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                assert!(theirs.sh_degree == 3 && worst < 10.0 * color, "{to} {i}: {worst}");
            }
            // A half turn about an own axis gives the same Gaussian.
            let [a, b] = [ours.rotations[j], theirs.rotations[i]].map(|q| Mat3::from_quat(q.normalize()));
            for axis in 0..3 {
                let along = a.col(axis).dot(b.col(axis)).abs();
                assert!(along > 0.999, "{to} {i}: axis {axis} {along}");
            }
        }
    }

    // It writes glTF and does not read it: what both make of the same scene has to be the same. It turns PLY by half a turn
    // about z on the way to glTF, where y points up.
    transform(&["scene.ply", "--rotate", "0,0,180", "theirs.glb"]);
    let [ours, theirs] = ["ours.glb", "theirs.glb"].map(|name| splats(&std::fs::read(desk.path(name)).unwrap()));
    for (property, value) in ours.0.as_object().unwrap() {
        assert_eq!(
            value, &theirs.0[property],
            "{property}; what is not given has a default"
        );
    }
    assert!(
        ours.1.len() == 20 && ours.1.keys().eq(theirs.1.keys()),
        "{:?}",
        theirs.1.keys()
    );
    for (name, values) in &ours.1 {
        assert_eq!(values.len(), theirs.1[name].len(), "{name}");
        let width = values.len() / 300;
        for (a, b) in values.chunks_exact(width).zip(theirs.1[name].chunks_exact(width)) {
            let off = |sign: f32| a.iter().zip(b).map(|(a, b)| (a - sign * b).abs()).fold(0.0, f32::max);
            // q and −q are the same rotation.
            let off = if name.ends_with("ROTATION") {
                off(1.0).min(off(-1.0))
            } else {
                off(1.0)
            };
            assert!(off < 1e-5, "{name}: {a:?} and {b:?}");
        }
    }
}

/// The extension's object and the attributes of f32 in a GLB file of splats.
fn splats(glb: &[u8]) -> (serde_json::Value, BTreeMap<String, Vec<f32>>) {
    let word = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
    let end = 20 + word(12);
    let document: serde_json::Value = serde_json::from_slice(&glb[20..end]).unwrap();
    let primitive = &document["meshes"][0]["primitives"][0];
    let mut attributes = BTreeMap::new();
    for (name, index) in primitive["attributes"].as_object().unwrap() {
        let accessor = &document["accessors"][index.as_u64().unwrap() as usize];
        if accessor["componentType"] != 5126 {
            continue;
        }
        let view = &document["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let offset = |value: &serde_json::Value| value["byteOffset"].as_u64().unwrap_or(0) as usize;
        let from = end + 8 + offset(view) + offset(accessor);
        let width = match accessor["type"].as_str().unwrap() {
            "SCALAR" => 1,
            "VEC3" => 3,
            _ => 4,
        };
        let count = width * accessor["count"].as_u64().unwrap() as usize;
        let floats = glb[from..from + 4 * count].chunks_exact(4);
        let values = floats.map(|x| f32::from_le_bytes(x.try_into().unwrap())).collect();
        attributes.insert(name.clone(), values);
    }
    (primitive["extensions"]["KHR_gaussian_splatting"].clone(), attributes)
}
