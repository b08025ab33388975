//! Against a server on the loopback address.

use std::sync::atomic::AtomicBool;
use std::time::Duration;

use gear_graph::testing::InMemory;
use gear_service::testing::{Reply, Server, Studio};
use gear_service::{Endpoint, Kind};
use gear_splat::Camera;
use glam::Vec3;

use super::*;

fn scene() -> Scene {
    Scene {
        canonical_camera: Some(Camera::front(48, 48)),
        ..Scene::default()
    }
}

fn view(name: &str, camera: Camera) -> View {
    View {
        rgb: SrgbImage::from_fn(48, 48, |x, y| {
            if x.abs_diff(24) + y.abs_diff(24) < 14 {
                [0.2, 0.4, 0.6]
            } else {
                [1.0; 3]
            }
        }),
        alpha: Some(Field::from_fn(48, 48, |x, y| {
            f32::from(u8::from(x.abs_diff(24) + y.abs_diff(24) < 14))
        })),
        camera,
        name: name.to_owned(),
        depth: None,
        normal: None,
        weight: None,
    }
}

fn inputs() -> In {
    let front = Camera::front(48, 48);
    let turned = |degrees: f32| front.orbit(Vec3::ZERO, degrees, 0.0);
    let picture = SrgbImage::filled(48, 48, [0.9, 0.1, 0.1]);
    In {
        views: Arc::new(Views {
            views: vec![
                view("front", front),
                view("left", turned(-40.0)),
                view("right", turned(40.0)),
            ],
        }),
        scene: Arc::new(scene()),
        painting: Arc::new(Image {
            rgb: picture,
            alpha: None,
        }),
        mask: Arc::new(Mask::filled(48, 48, true)),
        prompt: None,
        workflow: None,
    }
}

fn lent(server: &Server) -> Resources {
    let endpoint = Endpoint::new(&server.url(), "painter", None).unwrap();
    Resources::default().with(Services::default().with(Kind::Images, endpoint))
}

fn warm(mut picture: SrgbImage) -> SrgbImage {
    picture.data_mut().iter_mut().for_each(|pixel| pixel[2] *= 0.5);
    picture
}

#[test]
fn views_are_edited_and_the_painter_s_own_is_the_painting() {
    let studio = Studio::new(warm);
    let server = Server::start(move |asked| studio.answer(asked));
    let ctx = Context::detached().with_resources(lent(&server));
    let out = EditService::default().run(inputs(), &Want::all::<Out>(), &ctx).unwrap();
    assert_eq!(server.received().len(), 2, "the front is not sent");
    let targets = &out.targets.views;
    assert_eq!(targets[0].rgb.at(3, 3), [0.9, 0.1, 0.1]);
    assert!((targets[1].rgb.at(24, 24)[2] - 0.3).abs() < 0.01);
    assert_eq!(
        targets[1].rgb.at(1, 1),
        [1.0; 3],
        "white where nothing is, whatever the service painted there"
    );
    let weight = |i: usize, at| targets[i].weight.as_ref().unwrap().at(at, at);
    assert_eq!((weight(0, 24), weight(1, 24), weight(1, 1)), (1.0, 0.5, 1.0));
}

#[test]
fn answers_of_an_interrupted_run_are_not_asked_for_again() {
    let studio = Studio::new(warm);
    let broken = Arc::new(AtomicBool::new(true));
    let breaks = Arc::clone(&broken);
    let asked_for = AtomicUsize::new(0);
    let server = Server::start(move |asked| {
        if breaks.load(Ordering::Relaxed) && asked_for.fetch_add(1, Ordering::Relaxed) == 1 {
            return Reply::json(400, r#"{"error": {"message": "no credit"}}"#);
        }
        studio.answer(asked)
    });
    let ctx = Context::detached()
        .with_resources(lent(&server))
        .with_unfinished(Arc::new(InMemory::default()), Duration::ZERO);
    let node = EditService {
        at_a_time: 1,
        ..EditService::default()
    };
    let error = node.run(inputs(), &Want::all::<Out>(), &ctx).err().unwrap();
    let chain = error.chain().join(": ");
    assert!(
        chain.contains("view `right` was not edited") && chain.contains("no credit"),
        "{chain}"
    );
    broken.store(false, Ordering::Relaxed);
    assert!(node.run(inputs(), &Want::all::<Out>(), &ctx).is_ok());
    assert_eq!(server.received().len(), 3, "left, right in vain, right again");
}

#[test]
fn views_without_coverage_are_refused() {
    let mut inputs = inputs();
    Arc::make_mut(&mut inputs.views).views[1].alpha = None;
    let error = EditService::default().run(inputs, &Want::all::<Out>(), &Context::detached());
    assert!(error.err().unwrap().to_string().contains("`left` has no coverage"));
}
