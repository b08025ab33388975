use super::*;
use crate::Camera;
use crate::formats::tests::{angle, random};
use glam::Quat;

/// The two chunks of a GLB file, by glTF 2.0, section 4.4, and no code of the writer.
fn chunks(glb: &[u8]) -> (Value, Vec<u8>) {
    let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| glb[at + i])) as usize;
    assert_eq!((&glb[..4], word(4), word(8)), (&b"glTF"[..], 2, glb.len()));
    let text = word(12);
    assert_eq!(&glb[16..20], b"JSON");
    let binary = 20 + text;
    assert_eq!(&glb[binary + 4..binary + 8], b"BIN\0");
    assert!(text.is_multiple_of(4) && word(binary).is_multiple_of(4));
    assert_eq!(binary + 8 + word(binary), glb.len());
    let json = serde_json::from_slice(&glb[20..binary]).unwrap();
    (json, glb[binary + 8..].to_vec())
}

/// The bytes of an attribute, and its accessor.
fn attribute(json: &Value, binary: &[u8], name: &str) -> (Vec<u8>, Value) {
    let index = |value: &Value| value.as_u64().unwrap() as usize;
    let accessor = &json["accessors"][index(&json["meshes"][0]["primitives"][0]["attributes"][name])];
    let view = &json["bufferViews"][index(&accessor["bufferView"])];
    let (start, length) = (index(&view["byteOffset"]), index(&view["byteLength"]));
    assert!(start.is_multiple_of(4), "{name}");
    (binary[start..start + length].to_vec(), accessor.clone())
}

fn floats(json: &Value, binary: &[u8], name: &str, kind: &str) -> Vec<f32> {
    let (bytes, accessor) = attribute(json, binary, name);
    assert_eq!(
        (&accessor["type"], &accessor["componentType"]),
        (&json!(kind), &json!(5126)),
        "{name}"
    );
    let values: Vec<f32> = bytes
        .chunks_exact(4)
        .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        .collect();
    let width = [("SCALAR", 1), ("VEC3", 3), ("VEC4", 4)]
        .iter()
        .find(|w| w.0 == kind)
        .unwrap()
        .1;
    assert_eq!(accessor["count"], json!(values.len() / width), "{name}");
    values
}

#[test]
fn every_attribute_is_where_the_extension_wants_it() {
    let scene = random(50, 3);
    let written = write(&scene).unwrap();
    assert_eq!(written.losses, []);
    let (json, binary) = chunks(&written.bytes);
    assert_eq!(json["extensionsUsed"], json!(["KHR_gaussian_splatting"]));
    assert_eq!(json["buffers"], json!([{ "byteLength": binary.len() }]));
    let primitive = &json["meshes"][0]["primitives"][0];
    assert_eq!(primitive["mode"], json!(0));
    assert_eq!(
        primitive["extensions"],
        json!({ "KHR_gaussian_splatting": { "kernel": "ellipse", "colorSpace": "srgb_rec709_display" } })
    );

    let read = |name: &str, kind: &str| floats(&json, &binary, name, kind);
    let khr = |name: &str, kind: &str| read(&format!("KHR_gaussian_splatting:{name}"), kind);
    let centers = read("POSITION", "VEC3");
    let (scales, rotations) = (khr("SCALE", "VEC3"), khr("ROTATION", "VEC4"));
    let (opacities, dc) = (khr("OPACITY", "SCALAR"), khr("SH_DEGREE_0_COEF_0", "VEC3"));
    // The third coefficient of degree 2 (order 0) is the sixth above degree 0.
    let sh = khr("SH_DEGREE_2_COEF_2", "VEC3");
    khr("SH_DEGREE_1_COEF_0", "VEC3");
    khr("SH_DEGREE_3_COEF_6", "VEC3");
    for i in 0..scene.len() {
        assert_eq!(centers[3 * i..3 * i + 3], scene.centers[i].to_array());
        assert_eq!(dc[3 * i..3 * i + 3], scene.sh_dc[i]);
        assert!((opacities[i] - scene.opacity(i)).abs() < 1e-7);
        assert_eq!(scales[3 * i..3 * i + 3], scene.scales(i).to_array());
        let q = Quat::from_slice(&rotations[4 * i..]);
        assert!((q.length() - 1.0).abs() < 1e-6 && angle(q, scene.rotations[i]) < 0.1);
        let rest = scene.sh_rest_of(i);
        assert_eq!(sh[3 * i..3 * i + 3], [rest[5], rest[15 + 5], rest[30 + 5]]);
    }
    let (_, position) = attribute(&json, &binary, "POSITION");
    for (corner, pick) in [("min", f32::min as fn(f32, f32) -> f32), ("max", f32::max)] {
        let x = scene.centers.iter().map(|c| c.x).reduce(pick).unwrap();
        assert_eq!(position[corner][0].as_f64().unwrap() as f32, x);
    }
}

#[test]
fn viewers_without_the_extension_get_linear_colours() {
    let mut scene = Scene::default();
    scene.push(crate::Gaussian {
        center: Vec3::ZERO,
        scales: Vec3::ONE,
        rotation: Quat::IDENTITY,
        opacity: 0.25,
        color: [1.5, 0.5, 0.0],
    });
    let (json, binary) = chunks(&write(&scene).unwrap().bytes);
    let (bytes, accessor) = attribute(&json, &binary, "COLOR_0");
    assert_eq!(
        (&accessor["componentType"], &accessor["normalized"]),
        (&json!(5123), &json!(true))
    );
    let shares: Vec<f32> = bytes
        .chunks_exact(2)
        .map(|b| f32::from(u16::from_le_bytes([b[0], b[1]])) / 65535.0)
        .collect();
    // sRGB ½ is 0.2140 in linear light (IEC 61966-2-1).
    for (found, expected) in shares.iter().zip([1.0, 0.2140, 0.0, 0.25]) {
        assert!((found - expected).abs() < 1e-4, "{shares:?}");
    }
    assert!(
        json["meshes"][0]["primitives"][0]["attributes"]
            .get("KHR_gaussian_splatting:SH_DEGREE_1_COEF_0")
            .is_none()
    );
}

#[test]
fn the_canonical_camera_stands_in_the_extras() {
    let scene = random(1, 0);
    let (json, _) = chunks(&write(&scene).unwrap().bytes);
    let camera: Camera =
        serde_json::from_value(json["scenes"][0]["extras"]["gear"]["canonical_camera"].clone()).unwrap();
    assert_eq!(Some(camera), scene.canonical_camera);
    let bare = Scene {
        canonical_camera: None,
        ..scene
    };
    assert!(
        chunks(&write(&bare).unwrap().bytes).0["scenes"][0]
            .get("extras")
            .is_none()
    );
}

#[test]
fn a_scene_without_gaussians_is_refused() {
    let message = write(&Scene::default()).unwrap_err().to_string();
    assert!(message.contains("write .ply"), "{message}");
}
