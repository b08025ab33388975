//! What a network says about a picture, as PNG files, and what went into the library and came out, as .npy files for
//! `compare.py`: `cargo run -p gear-onnx --example answer -- MODEL.onnx PICTURE OUT [SIZE]`.
//!
//! The declaration lies beside the model. Channels beside the colours are made of the picture's light: where it is bright
//! is the mask, and its blurred height the base. Prints seconds: reading the network with the first run, and the least of
//! five runs after it.

use std::path::Path;
use std::time::Instant;

use gear_graph::{Context, FileSource, Loader};
use gear_image::edges::soft_edges;
use gear_image::{Field, Image, SrgbImage, colour, filter, io, stats};
use gear_onnx::{Channel, Given, ModelFile, Provider, answer};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, picture, out] = [0, 1, 2].map(|i| arguments.get(i).expect("MODEL.onnx PICTURE OUT [SIZE]"));
    let size = arguments.get(3).map_or(Ok(768), |size| size.parse())?;
    std::fs::create_dir_all(out)?;
    let out = Path::new(out);
    let ctx = Context::detached();
    let model = ModelFile::default().load(&FileSource::path(model), &ctx)?;
    let options = io::Options {
        size,
        ..io::Options::default()
    };
    let picture = io::read_image(Path::new(picture), &options)?.image;
    let (width, height) = picture.size();
    let made = planes(&picture.rgb);
    let planes = made.each_ref().map(|(channel, plane)| (*channel, plane));
    let given = Given {
        rgb: &picture.rgb,
        planes: &planes,
    };
    let timed = || -> Result<_, gear_onnx::OnnxError> {
        let start = Instant::now();
        let fields = answer(&model, Provider::Cpu, given, &ctx)?;
        Ok((fields, start.elapsed().as_secs_f64()))
    };
    let (fields, first) = timed()?;
    let mut least = f64::INFINITY;
    for _ in 0..5 {
        least = least.min(timed()?.1);
    }
    println!("{width}x{height}: first {first:.3} s, then {least:.3} s");
    let encoded: Vec<f32> = picture.rgb.data().as_flattened().to_vec();
    write_npy(&out.join("picture.npy"), &[height, width, 3], &encoded)?;
    for (channel, plane) in &made {
        let file = out.join(format!("{}.npy", channel.name()));
        write_npy(&file, &[height, width], plane.data())?;
    }
    for (i, field) in fields.iter().enumerate() {
        write_npy(&out.join(format!("answer{i}.npy")), &[height, width], field.data())?;
        let (low, high) = stats::range(field.data()).unwrap_or((0.0, 1.0));
        let (low, span) = if low >= 0.0 && high <= 1.0 {
            (0.0, 1.0)
        } else {
            (low, (high - low).max(1e-9))
        };
        let grey = field.data().iter().map(|x| [(x - low) / span; 3]).collect();
        let image = Image::opaque(SrgbImage::from_vec(width, height, grey));
        io::write_png(&out.join(format!("answer{i}.png")), &image)?;
    }
    Ok(())
}

/// What a network may take beside the colours, with samples that differ from place to place.
fn planes(rgb: &SrgbImage) -> [(Channel, Field); 5] {
    let light = colour::light(rgb);
    let luminance = light.luminance();
    let middle = stats::median(luminance.data()).unwrap_or(0.0);
    let of = |field: &Field, f: &dyn Fn(f32) -> f32| {
        let data = field.data().iter().map(|&x| f(x)).collect();
        Field::from_vec(field.width(), field.height(), data)
    };
    let height = filter::gaussian(&luminance, 8.0);
    let (across, down) = filter::gradient(&height);
    [
        (Channel::Mask, of(&luminance, &|x| f32::from(u8::from(x > middle)))),
        (Channel::Edges, soft_edges(&light, 1.0, 0.98)),
        (Channel::BaseNormalX, of(&across, &|x| -8.0 * x)),
        (Channel::BaseNormalY, of(&down, &|x| -8.0 * x)),
        (Channel::BaseHeight, height),
    ]
}

/// A numpy file of 32-bit floats (format 1.0).
fn write_npy(path: &Path, shape: &[usize], data: &[f32]) -> std::io::Result<()> {
    let shape: Vec<String> = shape.iter().map(ToString::to_string).collect();
    let mut header = format!(
        "{{'descr': '<f4', 'fortran_order': False, 'shape': ({},), }}",
        shape.join(", ")
    );
    while (header.len() + 11) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data.iter().flat_map(|x| x.to_le_bytes()));
    std::fs::write(path, bytes)
}
