//! Networks that are made here, run by the real library; each test says that it skips where there is none.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use gear_graph::{Context, Resources};
use gear_image::{Field, SrgbImage};
use gear_onnx::testing::{Net, can_run, model, with};
use gear_onnx::{Channel, Given, LibraryFile, Model, OnnxError, Provider, answer, library, realm};

fn picture() -> SrgbImage {
    SrgbImage::from_fn(40, 24, |x, y| {
        [x as f32 / 39.0, y as f32 / 23.0, if x > 20 { 1.0 } else { 0.0 }]
    })
}

fn ask(model: &Model) -> Result<Vec<Field>, OnnxError> {
    let rgb = picture();
    answer(
        model,
        Provider::Cpu,
        Given { rgb: &rgb, planes: &[] },
        &Context::detached(),
    )
}

fn told(model: &Model) -> String {
    let message = ask(model).expect_err("it is refused").to_string();
    assert!(!message.contains('\n'), "{message}");
    message
}

#[test]
fn what_goes_in_comes_out() {
    if !can_run() {
        return;
    }
    let negative = ask(&model(&Net::Negative)).unwrap();
    for (c, field) in negative.iter().enumerate() {
        for (sample, colour) in field.data().iter().zip(picture().data()) {
            assert!((sample - (1.0 - colour[c])).abs() < 1e-6);
        }
    }
    let mean = ask(&model(&Net::Mean)).unwrap();
    assert!((mean[0].at(39, 23) - 1.0).abs() < 1e-6 && mean[0].at(0, 0).abs() < 1e-6);
}

#[test]
fn contours_are_the_laplacian() {
    if !can_run() {
        return;
    }
    let edges = ask(&model(&Net::Edges)).unwrap();
    assert!(
        edges[0].at(20, 12) > 0.3 && edges[0].at(21, 12) > 0.3,
        "the step of blue"
    );
    assert!(edges[0].at(10, 12) < 1e-5, "a ramp has none");
}

#[test]
fn layout_size_and_colours_are_the_declaration_s() {
    if !can_run() {
        return;
    }
    let bgr = "network: 1\nchannels: [blue, green, red]\nwhite: 255\n\
               answer: {picture: {white: 255, channels: [blue, green, red]}}\n";
    let reds = ask(&with(&Net::Negative, bgr)).unwrap();
    // 1 − 255·c, over 255.
    assert!((reds[0].at(0, 0) - 1.0 / 255.0).abs() < 1e-6 && reds[0].at(39, 0) == 0.0);
    let fixed = "network: 1\nsize: {fixed: {width: 64, height: 64}}\nanswer: saliency\n";
    let mean = ask(&with(&Net::Mean, fixed)).unwrap();
    assert_eq!(mean[0].size(), (40, 24));
    let padded = "network: 1\nsize: {any: {multiple: 32}}\nanswer: saliency\n";
    let padded = ask(&with(&Net::Mean, padded)).unwrap();
    let plain = ask(&model(&Net::Mean)).unwrap();
    assert_eq!(padded[0].data(), plain[0].data());
}

#[test]
fn planes_beside_the_picture_reach_the_network() {
    if !can_run() {
        return;
    }
    let yaml = "network: 1\nchannels: [mask, edges]\nanswer: saliency\n";
    let two = with(&Net::MeanOf(2), yaml);
    let rgb = picture();
    let (mask, edges) = (Field::filled(40, 24, 1.0), Field::filled(40, 24, 0.5));
    let planes = [(Channel::Mask, &mask), (Channel::Edges, &edges)];
    let given = Given {
        rgb: &rgb,
        planes: &planes,
    };
    let mean = answer(&two, Provider::Cpu, given, &Context::detached()).unwrap();
    assert!(mean[0].data().iter().all(|x| (x - 0.75).abs() < 1e-6));
}

#[test]
fn a_surface_has_unit_normals_and_heights_in_pixels_of_the_picture() {
    if !can_run() {
        return;
    }
    let surface = ask(&model(&Net::Surface)).unwrap();
    assert_eq!((surface[0].at(5, 5), surface[2].at(5, 5)), (0.0, 1.0));
    assert!((surface[3].at(39, 23) - surface[3].at(0, 0) - 32.0).abs() < 1e-4);
    let half = "network: 1\nanswer: {surface: {height: 32, half_size: true}}\n";
    let rgb = SrgbImage::from_fn(80, 48, |x, _| [x as f32 / 79.0; 3]);
    let given = Given { rgb: &rgb, planes: &[] };
    let both = answer(&with(&Net::Surface, half), Provider::Cpu, given, &Context::detached()).unwrap();
    // At half size a height of 1 stands for twice as many of the picture's pixels.
    let span = both[3].at(79, 20) - both[3].at(0, 20);
    assert!((span - 0.5 * (32.0 + 64.0)).abs() < 2.0, "{span}");
}

#[test]
fn an_answer_that_is_not_what_was_declared_is_an_error() {
    if !can_run() {
        return;
    }
    assert!(told(&model(&Net::NotFinite)).contains("not finite"));
    assert!(told(&model(&Net::Integers)).contains("32-bit floats"));
    assert!(told(&with(&Net::Negative, "network: 1\nanswer: edges\n")).contains("1 channel of"));
    assert!(told(&with(&Net::Mean, "network: 1\nchannels: [red]\nanswer: edges\n")).contains("takes 3 channels"));
    assert!(told(&with(&Net::Mean, "network: 1\ninput: image\nanswer: edges\n")).contains("no input `image`, but x"));
    assert!(told(&with(&Net::Mean, "network: 1\noutput: z\nanswer: edges\n")).contains("no output `z`, but y"));
    let nothing = Model::new("d", &[0x08, 0x08], Some(Net::Edges.declaration())).unwrap();
    assert!(told(&nothing).contains("cannot read the network"));
}

#[test]
fn an_answer_that_is_too_large_is_not_taken() {
    if !can_run() {
        return;
    }
    let message = told(&model(&Net::Huge));
    assert!(
        message.contains("too large") || message.contains("at most"),
        "{message}"
    );
}

#[test]
fn a_provider_that_the_library_has_not_is_an_error_and_not_the_cpu() {
    if !can_run() {
        return;
    }
    let rgb = picture();
    let given = Given { rgb: &rgb, planes: &[] };
    // No build of the library is for Apple's devices and for DirectML.
    let absent = if cfg!(target_os = "macos") {
        Provider::Directml
    } else {
        Provider::Coreml
    };
    let error = answer(&model(&Net::Mean), absent, given, &Context::detached()).unwrap_err();
    assert!(matches!(error, OnnxError::NoProvider { .. }), "{error}");
}

#[test]
fn an_interrupted_network_stops() {
    if !can_run() {
        return;
    }
    let stop = Arc::new(AtomicBool::new(false));
    let ctx = Context::new(Arc::clone(&stop), None, 0);
    let running = std::thread::spawn(move || {
        let rgb = picture();
        answer(
            &model(&Net::Endless),
            Provider::Cpu,
            Given { rgb: &rgb, planes: &[] },
            &ctx,
        )
    });
    std::thread::sleep(Duration::from_millis(300));
    assert!(!running.is_finished(), "it runs without end");
    stop.store(true, Ordering::Relaxed);
    assert!(matches!(running.join().unwrap(), Err(OnnxError::Cancelled)));
}

#[test]
fn one_session_serves_all_threads_with_the_same_bits() {
    if !can_run() {
        return;
    }
    let edges = model(&Net::Edges);
    let first = ask(&edges).unwrap();
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..4).map(|_| scope.spawn(|| ask(&edges).unwrap())).collect();
        for thread in threads {
            assert_eq!(thread.join().unwrap()[0].data(), first[0].data());
        }
    });
}

#[test]
fn the_realm_is_version_and_provider() {
    let realm_of = realm(&Resources::default(), Provider::Cpu);
    if !can_run() {
        assert_eq!(realm_of, "ort:missing:cpu");
        return;
    }
    let library = library::open(&Resources::default()).unwrap();
    assert_eq!(realm_of, format!("ort:{}:cpu", library.version()));
    assert!(library.version().starts_with("1."), "{}", library.version());
    let other = Resources::default().with(LibraryFile("/nowhere/libonnxruntime.so".into()));
    assert!(matches!(library::open(&other), Err(OnnxError::OtherLibrary { .. })));
}

#[test]
fn without_the_library_a_network_is_an_error_that_says_how_to_get_it() {
    // What is named and is not there; unless another test of this process has loaded one before.
    let named = Resources::default().with(LibraryFile("/nowhere/libonnxruntime.so".into()));
    let ctx = Context::detached().with_resources(named);
    let rgb = picture();
    let error = answer(
        &model(&Net::Mean),
        Provider::Cpu,
        Given { rgb: &rgb, planes: &[] },
        &ctx,
    )
    .unwrap_err();
    match error {
        OnnxError::BadLibrary { .. } => assert!(error.to_string().contains("pip install onnxruntime"), "{error}"),
        OnnxError::OtherLibrary { .. } => {}
        error => panic!("{error}"),
    }
}
