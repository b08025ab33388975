//! OpenEXR: the first flat layer, R G B or Y, and A. Alpha is multiplied in, as the format has it.

use super::rows::{Layout, Rows, Samples, check_memory, check_size};
use super::{Options, Problem, Source};
use crate::exr_file;

pub(super) fn decode(source: &mut dyn Source, options: &Options) -> Result<Rows, Problem> {
    let end = source.seek(std::io::SeekFrom::End(0))?;
    source.rewind()?;
    check_memory(0, 0, end, &options.limits)?;
    let mut bytes = Vec::new();
    source.read_to_end(&mut bytes)?;
    let failed = |cause: String| Problem::decoder("EXR", cause);
    let (width, height, channels) = exr_file::size(&bytes).map_err(failed)?;
    check_size(width, height, &options.limits)?;
    check_memory(
        width,
        height,
        (width * height) as u64 * channels as u64 * 4,
        &options.limits,
    )?;
    let mut file = exr_file::decode(&bytes, usize::MAX).map_err(failed)?;
    drop(bytes);
    let alpha = file.take("A");
    let colours = match (file.take("R"), file.take("G"), file.take("B"), file.take("Y")) {
        (Some(r), Some(g), Some(b), _) => vec![r, g, b],
        (_, _, _, Some(y)) => vec![y],
        _ => {
            let names: Vec<_> = file.planes.iter().map(|(name, _)| name.as_str()).collect();
            let found = format!(
                "an EXR layer of channels {}, without R, G and B or Y,",
                names.join(", ")
            );
            return Err(Problem::UnsupportedSamples { found });
        }
    };
    let layout = Layout {
        colour: colours.len() == 3,
        alpha: alpha.is_some(),
    };
    let mut rows = Rows::new((width, height), layout, None, options)?;
    let mut row = Vec::with_capacity(width * layout.samples());
    for y in 0..height {
        row.clear();
        for i in y * width..(y + 1) * width {
            let a = alpha.as_ref().map(|alpha| alpha[i]);
            let scale = match a {
                Some(a) if a > 0.0 && a.is_finite() => 1.0 / a,
                _ => 1.0,
            };
            row.extend(colours.iter().map(|plane| plane[i] * scale));
            row.extend(a);
        }
        rows.push(Samples::F32(&row));
    }
    Ok(rows)
}
