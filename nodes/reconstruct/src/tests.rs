use super::*;
use gear_graph::{Value, testing};
use gear_image::LinearImage;
use glam::Vec3;

const SIDE: usize = 72;

/// A lit ball on paper, cut by no frame.
fn ball() -> (Image, Mask) {
    let (c, radius) = (35.5f32, 26.0f32);
    let offset = |x: usize, y: usize| ((x as f32 - c) / radius, (y as f32 - c) / radius);
    let light: LinearImage = Rgb::from_fn(SIDE, SIDE, |x, y| {
        let (u, v) = offset(x, y);
        let z2 = 1.0 - u * u - v * v;
        if z2 <= 0.0 {
            return [0.7, 0.66, 0.5];
        }
        let shade = 0.25 + 0.75 * (-0.5 * u - 0.5 * v + 0.7 * z2.sqrt()).max(0.0);
        [0.8 * shade, 0.4 * shade, 0.3 * shade]
    });
    let mask = Mask::from_fn(SIDE, SIDE, |x, y| {
        let (u, v) = offset(x, y);
        u * u + v * v < 1.0
    });
    (Image::opaque(light.to_srgb()), mask)
}

fn inputs(image: &Image, mask: &Mask) -> In {
    In {
        image: Arc::new(image.clone()),
        mask: Arc::new(mask.clone()),
        model: None,
    }
}

fn run(node: &Reconstruct, image: &Image, mask: &Mask) -> Out {
    testing::run(node, inputs(image, mask)).unwrap()
}

fn pinhole() -> Reconstruct {
    Reconstruct {
        camera: View::Pinhole { fov: 50.0 },
        ..Reconstruct::default()
    }
}

#[test]
fn the_depth_of_a_ball_is_a_hemisphere() {
    let (image, mask) = ball();
    let depth = run(&Reconstruct::default(), &image, &mask).depth.unwrap();
    let center = depth.at(35, 35);
    for (x, y) in [(48, 35), (35, 20), (24, 44)] {
        let r2 = (x as f32 - 35.5) * (x as f32 - 35.5) + (y as f32 - 35.5) * (y as f32 - 35.5);
        let expected = ((26.0f32 * 26.0 - r2).sqrt() - 26.0) / SIDE as f32;
        assert!((depth.at(x, y) - center - expected).abs() < 0.03, "({x}, {y})");
    }
    assert!(depth.at(0, 0).is_nan());
}

#[test]
fn front_surfels_project_to_the_pixels_they_came_from() {
    let (image, mask) = ball();
    for node in [Reconstruct::default(), pinhole()] {
        let node = Reconstruct {
            plane_tolerance: 0.0,
            ..node
        };
        let out = run(&node, &image, &mask);
        let camera = out.scene.canonical_camera.unwrap();
        let depth = out.depth.unwrap();
        for &center in out.scene.centers.iter().take(mask.count()) {
            let seen = camera.project(center).unwrap();
            let (x, y) = (seen.pixel[0].round(), seen.pixel[1].round());
            assert!((seen.pixel[0] - x).abs() < 2e-3 && (seen.pixel[1] - y).abs() < 2e-3);
            assert!((depth.at(x as usize, y as usize) - center.z).abs() < 1e-5);
        }
    }
}

#[test]
fn the_scene_is_closed_valid_and_centred() {
    let (image, mask) = ball();
    for node in [Reconstruct::default(), pinhole()] {
        let out = run(&node, &image, &mask);
        assert_eq!(out.scene.count_invalid(), 0);
        out.scene.validate().unwrap();
        // Normals of a closed surface balance: Σ area · n ≈ 0.
        let (mut sum, mut area) = (Vec3::ZERO, 0.0);
        for i in 0..out.scene.len() {
            let s = out.scene.scales(i);
            sum += out.scene.normal(i) * s.x * s.y;
            area += s.x * s.y;
        }
        assert!(sum.length() < 0.12 * area, "{sum} of {area}");
        let (low, high) = out
            .scene
            .centers
            .iter()
            .fold((f32::MAX, f32::MIN), |(l, h), c| (l.min(c.z), h.max(c.z)));
        assert!((low + high).abs() < 0.02);
    }
}

#[test]
fn the_budget_bounds_the_number_of_gaussians() {
    let (image, mask) = ball();
    let count = |max_gaussians| {
        let out = run(
            &Reconstruct {
                max_gaussians,
                ..Reconstruct::default()
            },
            &image,
            &mask,
        );
        out.scene.len()
    };
    let free = count(1_000_000);
    let bound = count(free - 60);
    assert!(bound <= free - 60 && bound > free / 2, "{bound} of {free}");
}

#[test]
fn a_full_or_an_empty_mask_is_a_relief() {
    let (image, _) = ball();
    for full in [true, false] {
        let out = run(&Reconstruct::default(), &image, &Mask::filled(SIDE, SIDE, full));
        assert_eq!(out.report.unwrap().0["mode"], "relief");
        assert!(out.depth.unwrap().data().iter().all(|d| d.is_finite()));
        assert!(!out.scene.is_empty());
    }
}

#[test]
fn extremes_give_valid_scenes() {
    for (w, h) in [(1, 1), (1, 50), (50, 1), (2, 2), (13, 40)] {
        for value in [0.0, 1.0, f32::NAN, f32::INFINITY] {
            for inside in [0, 1, 2] {
                let image = Image::opaque(Rgb::filled(w, h, [value; 3]));
                let mask = Mask::from_fn(w, h, |x, _| inside == 2 || inside == 1 && x == w / 2);
                for node in [Reconstruct::default(), pinhole()] {
                    let out = run(&node, &image, &mask);
                    assert_eq!(out.scene.count_invalid(), 0, "{value} at {w}x{h}, {inside}");
                    assert!(
                        out.normals
                            .unwrap()
                            .rgb
                            .data()
                            .as_flattened()
                            .iter()
                            .all(|c| c.is_finite())
                    );
                }
            }
        }
    }
    let nothing = Image::opaque(Rgb::filled(0, 0, [0.0; 3]));
    assert!(testing::run(&Reconstruct::default(), inputs(&nothing, &Mask::filled(0, 0, true))).is_err());
}

#[test]
fn a_picture_without_shading_gets_no_detail_solve() {
    let (_, mask) = ball();
    let flat = Image::opaque(Rgb::filled(SIDE, SIDE, [0.5; 3]));
    let shaded = run(&Reconstruct::default(), &flat, &mask);
    let inflated = run(
        &Reconstruct {
            method: Method::Inflation,
            ..Reconstruct::default()
        },
        &flat,
        &mask,
    );
    assert_eq!(shaded.report.unwrap().0["detail"], false);
    assert_eq!(shaded.scene.digest(), inflated.scene.digest());
}

#[test]
fn an_answer_or_an_error_on_every_extreme_input() {
    testing::assert_extremes(&Reconstruct::default());
}

#[test]
fn results_do_not_depend_on_threads_or_on_what_is_wanted() {
    let (image, mask) = ball();
    testing::assert_pure(&Reconstruct::default(), || inputs(&image, &mask));
}

#[test]
fn summaries_on_a_ball_are_pinned() {
    let (image, mask) = ball();
    let out = run(&Reconstruct::default(), &image, &mask);
    insta::assert_json_snapshot!("scene", out.scene.summary());
    insta::assert_json_snapshot!("depth", out.depth.unwrap().summary());
    insta::assert_json_snapshot!("normals", out.normals.unwrap().summary());
    insta::assert_json_snapshot!("report", out.report.unwrap().summary());
}

mod network {
    //! Networks that the tests make, and gear's own prior.

    use super::*;
    use gear_onnx::testing::{Net, can_run, model, prior, with};

    const INVERSE: &str = "network: 1\nanswer: {depth: {of: inverse}}\n";
    const METRIC: &str = "network: 1\nanswer: {depth: {of: metric}}\n";

    fn node() -> Reconstruct {
        let params = serde_json::json!({"method": {"depth-network": {"iterations": 0}}});
        testing::read(&params).unwrap()
    }

    fn asked(node: &Reconstruct, model: &Model, image: &Image, mask: &Mask) -> Out {
        let inputs = In {
            model: Some(Lazy::given(model.clone())),
            ..inputs(image, mask)
        };
        testing::run(node, inputs).unwrap()
    }

    /// Brightness is a hemisphere over the mask of the ball, a little of it at the rim.
    fn painted_depth(of: impl Fn(f32) -> f32) -> (Image, Mask) {
        let (_, mask) = ball();
        let image = Image::opaque(Rgb::from_fn(SIDE, SIDE, |x, y| {
            let (u, v) = ((x as f32 - 35.5) / 26.0, (y as f32 - 35.5) / 26.0);
            [of((1.0 - u * u - v * v).max(0.0).sqrt()); 3]
        }));
        (image, mask)
    }

    fn assert_hemisphere(out: Out, slack: f32) {
        let depth = out.depth.unwrap();
        for (x, y) in [(48, 35), (35, 20), (24, 44)] {
            let r2 = (x as f32 - 35.5) * (x as f32 - 35.5) + (y as f32 - 35.5) * (y as f32 - 35.5);
            let expected = ((26.0f32 * 26.0 - r2).sqrt() - 26.0) / SIDE as f32;
            let found = depth.at(x, y) - depth.at(35, 35);
            assert!(
                (found - expected).abs() < slack,
                "({x}, {y}): {found}, expected {expected}"
            );
        }
        assert!(depth.at(0, 0).is_nan());
    }

    #[test]
    fn inverse_depth_is_lifted_to_the_same_closed_surface() {
        if !can_run() {
            return;
        }
        let (image, mask) = painted_depth(|z| 0.2 + 0.6 * z);
        let out = asked(&node(), &with(&Net::Mean, INVERSE), &image, &mask);
        let behind = out.scene.rotations.iter().filter(|r| (**r * Vec3::Z).z < -0.2).count();
        assert!(behind > 50, "it has a back: {behind}");
        assert_hemisphere(out, 0.04);
    }

    #[test]
    fn distances_are_lifted_by_the_field_of_view() {
        if !can_run() {
            return;
        }
        // The camera is half the side over tan 20° from the plane of the median; in a unit of 200 px.
        let focal = 36.0 / libm::tan(20f64.to_radians()) as f32;
        let (image, mask) = painted_depth(|z| (focal + 17.0 - 26.0 * z) / 200.0);
        let out = asked(&node(), &with(&Net::Mean, METRIC), &image, &mask);
        assert_hemisphere(out, 0.05);
    }

    #[test]
    fn normals_and_height_are_integrated_and_detail_comes_on_top() {
        if !can_run() {
            return;
        }
        let (image, mask) = ball();
        // Upright normals with a height that follows the brightness: nearly a slab.
        let slab = asked(&node(), &model(&Net::Surface), &image, &mask).depth.unwrap();
        let body = run(&Reconstruct::default(), &image, &mask).depth.unwrap();
        let rise = |depth: &Field| depth.at(35, 35) - depth.at(14, 35);
        assert!(rise(&slab) < 0.5 * rise(&body), "{} {}", rise(&slab), rise(&body));
        let with_detail: Reconstruct = testing::read(&serde_json::json!({"method": "depth-network"})).unwrap();
        let out = asked(&with_detail, &model(&Net::Surface), &image, &mask);
        assert!(out.report.unwrap().summary().contains_key("trust"));
    }

    #[test]
    fn a_network_that_says_nothing_leaves_the_silhouette_s_body() {
        if !can_run() {
            return;
        }
        let (_, mask) = ball();
        let flat = Image::opaque(Rgb::filled(SIDE, SIDE, [0.4; 3]));
        let inflation = Reconstruct {
            method: Method::Inflation,
            ..Reconstruct::default()
        };
        let expected = run(&inflation, &flat, &mask).depth.unwrap();
        let found = asked(&node(), &with(&Net::Mean, INVERSE), &flat, &mask).depth.unwrap();
        assert_eq!(found.digest(), expected.digest());
    }

    #[test]
    fn pure_on_a_network_and_sound_on_every_extreme() {
        if can_run() {
            let (image, mask) = painted_depth(|z| z);
            testing::assert_pure(&node(), || In {
                model: Some(Lazy::given(with(&Net::Mean, INVERSE))),
                ..inputs(&image, &mask)
            });
        }
        let error = testing::run(&node(), inputs(&ball().0, &ball().1)).err().unwrap();
        assert!(error.to_string().contains("--input NAME=FILE"), "{error}");
        testing::assert_extremes(&node());
    }

    #[test]
    fn the_prior_makes_a_ball_of_a_ball() {
        if !can_run() {
            return;
        }
        let (image, mask) = ball();
        assert_hemisphere(asked(&node(), &prior(), &image, &mask), 0.08);
    }
}
