//! The picture of a case, small, to be looked at.

use gear_image::io::{Options, read_image};
use gear_report::picture::Pixels;
use gear_sample::{MAX_SIDE, MIN_SIDE, Request};

use crate::study::Source;

/// The picture of a source, its longer side at most `size` pixels, or why there is none.
pub fn painting(source: &Source, size: usize) -> Result<Pixels, String> {
    let image = match source {
        Source::Sample(sample) => {
            let request = Request::parse(sample, size.clamp(MIN_SIDE, MAX_SIDE)).map_err(|e| e.to_string())?;
            let painted = gear_sample::paint(&request.name, &request.options);
            painted.map_err(|e| e.to_string())?.painting
        }
        Source::File(path) => {
            let options = Options {
                size: size.max(1),
                ..Options::default()
            };
            read_image(path, &options).map_err(|e| e.to_string())?.image
        }
    };
    Ok(Pixels::of_image(&image).at_most(size))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_painted_with_their_options_and_files_are_read() {
        let sample = |text: &str| painting(&Source::Sample(text.into()), 48).unwrap();
        let plain = sample("vessel");
        let (width, height) = plain.size();
        assert_eq!(width.max(height), 48);
        assert_ne!(
            plain.png().unwrap().bytes,
            sample("vessel,seed=2,condition=flat").png().unwrap().bytes
        );

        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.png");
        std::fs::write(&file, plain.png().unwrap().bytes).unwrap();
        assert_eq!(painting(&Source::File(file), 24).unwrap().size().0.max(height / 2), 24);
        assert!(painting(&Source::File(folder.path().join("none.png")), 24).is_err());
        assert!(painting(&Source::Sample("no such".into()), 24).is_err());
    }
}
