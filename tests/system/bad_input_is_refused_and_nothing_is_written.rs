//! What cannot be read or does not exist is refused: exit 2, one message that names it, nothing written.

use std::path::Path;

use gear_tests::{Desk, Done};

use crate::SMALL;

/// Runs the small graph on a file, and asserts that it is refused without a trace.
#[track_caller]
fn refused(desk: &Desk, input: &Path) -> Done {
    desk.file("graph.yaml", SMALL);
    let given = format!("painting={}", input.display());
    let done = desk
        .gear(&["run", "graph.yaml", "--input", &given, "--out", "out"])
        .exits(2);
    assert_eq!(desk.listing("out"), Vec::<String>::new());
    assert_eq!(done.stdout, "");
    assert_eq!(done.stderr.matches("error:").count(), 1, "one message: {}", done.stderr);
    let name = input.file_name().unwrap().to_str().unwrap();
    done.says(name)
}

fn png(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let picture = image::RgbImage::from_fn(width, height, |x, y| image::Rgb([(x * 7) as u8, (y * 5) as u8, 90]));
    picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// A PNG whose head says `width` × `height` and whose pixels are missing.
fn png_head(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = png(2, 2);
    bytes[16..20].copy_from_slice(&width.to_be_bytes());
    bytes[20..24].copy_from_slice(&height.to_be_bytes());
    let checksum = crc32(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&checksum.to_be_bytes());
    bytes
}

fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = !0u32;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 {
                (crc >> 1) ^ 0xEDB8_8320
            } else {
                crc >> 1
            };
        }
    }
    !crc
}

#[test]
fn a_missing_file() {
    let desk = Desk::new();
    refused(&desk, &desk.path("nowhere.png")).says("no such file");
}

#[test]
fn an_empty_file() {
    let desk = Desk::new();
    refused(&desk, &desk.file("empty.png", "")).says("empty");
}

#[test]
fn a_truncated_file() {
    let desk = Desk::new();
    let whole = png(200, 100);
    refused(&desk, &desk.file("cut.png", &whole[..whole.len() / 2]));
}

#[test]
fn a_picture_without_pixels() {
    let desk = Desk::new();
    refused(&desk, &desk.file("flat.png", png_head(0, 40)));
}

#[test]
fn a_text_called_png() {
    let desk = Desk::new();
    refused(&desk, &desk.file("words.png", "a painting of a court lady, on silk\n"));
}

#[test]
fn a_folder() {
    let desk = Desk::new();
    std::fs::create_dir(desk.path("folder")).unwrap();
    refused(&desk, &desk.path("folder")).says("folder");
}

#[cfg(unix)]
#[test]
fn a_device_without_end() {
    refused(&Desk::new(), Path::new("/dev/zero")).says("no regular file");
}

#[test]
fn a_decompression_bomb() {
    let desk = Desk::new();
    refused(&desk, &desk.file("bomb.png", png_head(2_000_000, 2_000_000)));
}

#[test]
fn a_set_that_fits_nothing() {
    let desk = Desk::new();
    desk.file("graph.yaml", SMALL);
    desk.file("picture.png", png(8, 8));
    for (set, answer) in [
        ("edgse.method=canny", "edges"),
        ("ratio.radios=0.1", "radius"),
        ("ratio.radius=wide", "radius"),
        ("ratio.radius=-1", "radius"),
        ("ratio.radius=.nan", "radius"),
        ("ratio", "NODE.PARAM=VALUE"),
    ] {
        let arguments = ["run", "graph.yaml", "--input", "painting=picture.png", "--set", set];
        desk.gear(&arguments)
            .exits(2)
            .says(set.split('=').next().unwrap())
            .says(answer);
        assert_eq!(desk.listing("out"), Vec::<String>::new());
    }
}

#[test]
fn an_output_folder_that_cannot_be_written() {
    let desk = Desk::new();
    desk.file("graph.yaml", SMALL);
    desk.file("picture.png", png(8, 8));
    desk.file("file", "in the way");
    for out in ["file", "file/below"] {
        let arguments = ["run", "graph.yaml", "--input", "painting=picture.png", "--out", out];
        desk.gear(&arguments).exits(2).says("--out").says("file");
    }
    assert_eq!(std::fs::read(desk.path("file")).unwrap(), b"in the way");
}

#[test]
fn inputs_and_outputs_that_the_graph_has_not() {
    let desk = Desk::new();
    desk.file("graph.yaml", SMALL);
    desk.file("picture.png", png(8, 8));
    let run = |more: &[&str]| desk.gear(&[&["run", "graph.yaml"], more].concat()).exits(2);
    run(&[]).says("painting");
    run(&["--input", "painting=picture.png", "--input", "paintings=picture.png"]).says("painting");
    run(&["--input", "painting"]).says("NAME=PATH");
    run(&["--input", "painting=sample:cat"]).says("court-lady");
    run(&["--input", "painting=picture.png", "--output", "edge"]).says("edges");
    run(&["--input", "painting=picture.png", "--fresh", "edge"]).says("edges");
    assert_eq!(desk.listing("out"), Vec::<String>::new());
}

#[test]
fn a_graph_with_mistakes_is_refused_with_all_of_them() {
    let desk = Desk::new();
    let broken = SMALL
        .replace("node: LogRatio", "node: LogRatoi")
        .replace("edges: edges.edges\n", "edges: edges.egdes\n");
    desk.file("graph.yaml", broken);
    let done = desk
        .gear(&["check", "graph.yaml"])
        .exits(2)
        .says("LogRatio")
        .says("graph.yaml");
    assert!(
        done.stderr.contains("edges.egdes") || done.stderr.contains("egdes"),
        "{}",
        done.stderr
    );
    desk.gear(&["run", "nowhere.yaml"]).exits(2).says("nowhere.yaml");
    desk.gear(&["run", "@gaer"]).exits(2).says("@gear");
}

#[test]
fn an_input_that_a_result_would_replace() {
    let desk = Desk::new();
    std::fs::create_dir(desk.path("mine")).unwrap();
    let mine = desk.file("mine/grounded.png", png(40, 30));
    let before = std::fs::read(&mine).unwrap();
    let run = ["run", "@gear", "--input", "painting=mine/grounded.png", "--out", "mine"];
    desk.gear(&run)
        .exits(2)
        .says("`grounded.png` in it is read by this run");
    assert_eq!(std::fs::read(&mine).unwrap(), before);
}

/// Only a part of the graph reads the bad file: the rest is finished and written, and the exit code is 2 all the same.
#[test]
fn a_bad_file_costs_only_what_depends_on_it() {
    let desk = Desk::new();
    let two = SMALL
        .replace("nodes:\n", "  other: {type: Image, with: {size: 64}}\nnodes:\n")
        .replace(
            "enhance: {node: Enhance, in: {image: painting}}",
            "enhance: {node: Enhance, in: {image: other}}",
        );
    desk.file("graph.yaml", two);
    desk.file("good.png", png(40, 30));
    desk.file("cut.png", &png(200, 100)[..400]);
    let run = |painting: &str, other: &str, more: &[&str]| {
        let (painting, other) = (format!("painting={painting}"), format!("other={other}"));
        let given = ["run", "graph.yaml", "--input", &painting, "--input", &other];
        desk.gear(&[&given, more].concat())
    };
    run("cut.png", "good.png", &[]).exits(2).says("cut.png").says("error");
    assert_eq!(desk.listing("out"), ["enhanced.png", "report.html", "run.json"]);
    assert_eq!(desk.record("out").with_status("failed"), ["painting"]);
    // Nothing is left of what was asked for: nothing is written.
    run("cut.png", "good.png", &["--output", "edges", "--out", "none"]).exits(2);
    run("cut.png", "cut.png", &["--out", "none"]).exits(2);
    assert!(!desk.path("none").exists());
    // Mended, the same folder is completed.
    run("good.png", "good.png", &[]).exits(0);
    assert_eq!(desk.record("out").outputs().len(), 3);
}

#[test]
fn files_of_the_user_s_own_are_not_replaced() {
    let desk = Desk::new();
    desk.file("graph.yaml", SMALL);
    desk.file("picture.png", png(40, 30));
    std::fs::create_dir(desk.path("mine")).unwrap();
    let run = |more: &[&str]| {
        let run = ["run", "graph.yaml", "--input", "painting=picture.png", "--out", "mine"];
        desk.gear(&[&run, more].concat())
    };
    for name in ["enhanced.png", "run.json", "report.html"] {
        let mine = desk.file(&format!("mine/{name}"), "mine");
        run(&[]).exits(2).says(name).says("--force");
        assert_eq!(desk.listing("mine"), [name], "nothing was written");
        assert_eq!(std::fs::read(&mine).unwrap(), b"mine");
        std::fs::remove_file(mine).unwrap();
    }
    // What is in nobody's way stays; what a run wrote is replaced by the next.
    desk.file("mine/notes.txt", "mine");
    run(&[]).exits(0);
    run(&["--set", "painting.size=48"]).exits(0);
    assert!(desk.listing("mine").contains(&"notes.txt".to_owned()));
    desk.file("mine/run.json", "{}");
    run(&[]).exits(2).says("no earlier run");
    run(&["--force"]).exits(0);
    run(&[]).exits(0);
}

/// The names of views are known only when they are there.
#[test]
fn a_view_that_stands_where_no_run_wrote_it() {
    let desk = Desk::new();
    std::fs::create_dir_all(desk.path("out/views")).unwrap();
    let run = [crate::MAIN, &["--output", "views"]].concat();
    desk.gear(&run).exits(0);
    let views = desk.listing("out/views");
    std::fs::remove_dir_all(desk.path("out")).unwrap();
    std::fs::create_dir_all(desk.path("out/views")).unwrap();
    let mine = desk.file(&format!("out/views/{}", views[0]), "mine");
    desk.gear(&run).exits(2).says(&views[0]).says("--force");
    assert_eq!(std::fs::read(mine).unwrap(), b"mine");
    assert_eq!(desk.listing("out").len(), 1, "nothing was written");
    desk.gear(&[&run[..], &["--force"]].concat()).exits(0);
}

/// Names in file systems are bytes, and results go where they were asked to go.
#[cfg(target_os = "linux")]
#[test]
fn names_that_are_no_text() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

    let desk = Desk::new();
    desk.file("graph.yaml", SMALL);
    let odd = |name: &[u8]| OsStr::from_bytes(name).to_owned();
    std::fs::write(desk.path("").join(odd(b"p\xff.png")), png(40, 30)).unwrap();
    let run = |arguments: &[&OsStr]| -> Done { desk.command(&[]).args(arguments).output().unwrap().into() };
    let plain = OsStr::new;
    let (input, out, store) = (odd(b"painting=p\xff.png"), odd(b"o\xff"), odd(b"s\xff"));
    let arguments = [
        plain("run"),
        plain("graph.yaml"),
        plain("--input"),
        &input,
        plain("--out"),
        &out,
        plain("--store"),
        &store,
    ];
    run(&arguments).exits(0);
    assert!(desk.path("").join(&out).join("run.json").exists());
    run(&[&[plain("plan")], &arguments[1..4], &arguments[6..]].concat()).exits(0);
    run(&[plain("cache"), plain("stat"), plain("--store"), &store]).exits(0);
    // A graph is named in texts: refused, in words.
    let graph = run(&[plain("check"), &odd(b"g\xff.yaml")]).exits(2);
    assert!(!graph.stderr.contains("panicked"), "{graph:?}");
    let set = run(&[plain("run"), plain("graph.yaml"), plain("--set"), &odd(b"a.b=\xff")]).exits(2);
    assert!(!set.stderr.contains("panicked"), "{set:?}");
}
