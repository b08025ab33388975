//! Files that go to the worker and come back.
//!
//! A worker has one folder, made for it alone and removed with it. A run has a folder in that: inputs are written into
//! `in`, under another name first and then renamed, so that no half file ever stands under its own; the worker writes
//! into `out` and answers with names. A name is a plain file name. It is opened without following links, and what was
//! opened must be the regular file, with no other name elsewhere, that stood there a moment ago and lies in the folder:
//! a worker that names `../../secret`, or makes a link of that name, gets an error and not the file.

use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::{Component, Path, PathBuf};

use gear_graph::{AnyValue, ValueType};

use crate::claims;

/// The folder of a worker.
pub(crate) struct Scratch {
    /// Without links on the way.
    root: PathBuf,
    runs: u64,
    _folder: tempfile::TempDir,
}

/// The folder of a run; removed when it is dropped.
pub(crate) struct RunFolder {
    root: PathBuf,
    /// Relative to the worker's folder.
    name: String,
}

impl Scratch {
    pub fn new() -> std::io::Result<Self> {
        let folder = tempfile::Builder::new().prefix("gear-plugin-").tempdir()?;
        Ok(Self {
            root: folder.path().canonicalize()?,
            runs: 0,
            _folder: folder,
        })
    }

    pub fn path(&self) -> &Path {
        &self.root
    }

    /// A folder for the next run.
    pub fn run(&mut self) -> std::io::Result<RunFolder> {
        self.runs += 1;
        let name = format!("run-{}", self.runs);
        for side in ["in", "out"] {
            fs::create_dir_all(self.root.join(&name).join(side))?;
        }
        Ok(RunFolder {
            root: self.root.clone(),
            name,
        })
    }
}

impl Drop for RunFolder {
    fn drop(&mut self) {
        // What cannot be removed now goes with the worker's folder.
        let _ = fs::remove_dir_all(self.root.join(&self.name));
    }
}

impl RunFolder {
    /// Where the worker writes, relative to its folder.
    pub fn out(&self) -> String {
        format!("{}/out", self.name)
    }

    /// Writes a value for the worker; its path relative to the worker's folder.
    pub fn give(&self, name: &str, value: &AnyValue) -> Result<String, String> {
        let bytes = value.encode().map_err(|error| error.to_string())?;
        let folder = self.root.join(&self.name).join("in");
        let file = format!("{name}.{}", value.value_type().extension);
        let write = || -> std::io::Result<()> {
            let mut temporary = tempfile::NamedTempFile::new_in(&folder)?;
            temporary.write_all(&bytes)?;
            temporary.persist(folder.join(&file)).map_err(|error| error.error)?;
            Ok(())
        };
        write().map_err(|error| error.to_string())?;
        Ok(format!("{}/in/{file}", self.name))
    }

    /// Reads a value that the worker says it has written under this name.
    pub fn take(&self, name: &str, value_type: &ValueType, most: u64) -> Result<AnyValue, String> {
        let bytes = self.read(name, most)?;
        let unpacked = claims::unpacked_bytes(value_type.extension, &bytes)
            .map_err(|cause| format!("`{name}` is not a {} file: {cause}", value_type.extension))?;
        if unpacked > most {
            return Err(format!(
                "`{name}` claims to hold {unpacked} bytes; `limits` in plugin.yaml allows {most}"
            ));
        }
        let value = value_type
            .decode(&bytes)
            .map_err(|error| format!("`{name}`: {error}"))?;
        match value.flaw() {
            Some(flaw) => Err(format!("`{name}` {flaw}")),
            None => Ok(value),
        }
    }

    fn read(&self, name: &str, most: u64) -> Result<Vec<u8>, String> {
        let plain = Path::new(name).components().collect::<Vec<_>>();
        // A backslash or a colon is a separator elsewhere.
        if !matches!(plain.as_slice(), [Component::Normal(_)]) || name.contains(['/', '\\', ':', '\0']) {
            return Err(format!(
                "expected a plain file name, found `{}`",
                crate::lines::for_people(name)
            ));
        }
        let folder = self.root.join(&self.name).join("out");
        if folder.canonicalize().ok().as_deref() != Some(&*folder) {
            return Err("the folder of outputs is not where it was made".to_owned());
        }
        let path = folder.join(name);
        let told = |error: std::io::Error| format!("`{name}` cannot be read: {error}");
        let before = fs::symlink_metadata(&path).map_err(told)?;
        if !before.is_file() {
            return Err(format!("`{name}` is not a regular file"));
        }
        if before.len() > most {
            return Err(format!(
                "`{name}` is {} bytes long; `limits` in plugin.yaml allows {most}",
                before.len()
            ));
        }
        let file = open(&path).map_err(told)?;
        if !the_same(&before, &file.metadata().map_err(told)?) {
            return Err(format!(
                "`{name}` changed while it was opened, or has another name elsewhere"
            ));
        }
        let mut bytes = Vec::new();
        file.take(most + 1).read_to_end(&mut bytes).map_err(told)?;
        if bytes.len() as u64 > most {
            return Err(format!("`{name}` grew beyond {most} bytes while it was read"));
        }
        Ok(bytes)
    }
}

#[cfg(unix)]
fn open(path: &Path) -> std::io::Result<File> {
    use std::os::unix::fs::OpenOptionsExt;
    // Links are not followed, and a pipe that nobody writes to does not hold us up.
    let flags = libc::O_NOFOLLOW | libc::O_NONBLOCK | libc::O_CLOEXEC;
    fs::OpenOptions::new().read(true).custom_flags(flags).open(path)
}

#[cfg(not(unix))]
fn open(path: &Path) -> std::io::Result<File> {
    File::open(path)
}

#[cfg(unix)]
fn the_same(before: &fs::Metadata, opened: &fs::Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    opened.is_file() && opened.nlink() == 1 && (before.dev(), before.ino()) == (opened.dev(), opened.ino())
}

#[cfg(not(unix))]
fn the_same(_: &fs::Metadata, opened: &fs::Metadata) -> bool {
    opened.is_file()
}

#[cfg(test)]
mod tests {
    use gear_graph::Number;

    use super::*;

    fn number() -> ValueType {
        ValueType::of::<Number>()
    }

    fn run() -> (Scratch, RunFolder, PathBuf) {
        let mut scratch = Scratch::new().unwrap();
        let run = scratch.run().unwrap();
        let out = scratch.path().join(run.out());
        (scratch, run, out)
    }

    #[test]
    fn values_go_there_and_back() {
        let (scratch, run, out) = run();
        let given = run.give("amount", &AnyValue::new(Number(4.5))).unwrap();
        fs::copy(scratch.path().join(&given), out.join("sum.json")).unwrap();
        let back = run.take("sum.json", &number(), 1000).unwrap();
        assert_eq!(back.expect::<Number>().unwrap().0, 4.5);
        assert_eq!(
            fs::read_dir(scratch.path().join("run-1/in")).unwrap().count(),
            1,
            "no temporary file stays"
        );
        let folder = scratch.path().join("run-1");
        drop(run);
        assert!(!folder.exists());
    }

    #[test]
    fn only_plain_names_are_taken() {
        let (_scratch, run, _) = run();
        for name in [
            "../in/x.json",
            "/etc/hostname",
            "a/b",
            "..",
            ".",
            "",
            "a\\b",
            "C:x",
            "a\0b",
        ] {
            let told = run.take(name, &number(), 1000).unwrap_err();
            assert!(told.contains("plain file name"), "{name}: {told}");
        }
        assert!(
            run.take("none.json", &number(), 1000)
                .unwrap_err()
                .contains("cannot be read")
        );
    }

    #[test]
    fn what_is_too_large_is_not_read() {
        let (_scratch, run, out) = run();
        File::create(out.join("huge.json")).unwrap().set_len(1 << 40).unwrap();
        let told = run.take("huge.json", &number(), 1 << 20).unwrap_err();
        assert!(told.contains("limits"), "{told}");
    }

    #[test]
    fn what_unpacks_to_too_much_is_not_unpacked() {
        let (_scratch, run, out) = run();
        let mut mask = gear_graph::Value::encode(&gear_image::Mask::filled(3, 2, true)).unwrap();
        mask[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
        fs::write(out.join("mask.png"), mask).unwrap();
        let told = run
            .take("mask.png", &ValueType::of::<gear_image::Mask>(), 1 << 20)
            .unwrap_err();
        assert!(told.contains("claims to hold"), "{told}");
    }

    #[test]
    fn what_is_not_sound_is_not_taken() {
        let (_scratch, run, out) = run();
        let image = gear_image::Image::opaque(gear_image::Rgb::filled(2, 2, [f32::NAN; 3]));
        fs::write(out.join("image.exr"), gear_graph::Value::encode(&image).unwrap()).unwrap();
        let told = run
            .take("image.exr", &ValueType::of::<gear_image::Image>(), 1 << 20)
            .unwrap_err();
        assert!(told.contains("not finite"), "{told}");
    }

    #[cfg(unix)]
    #[test]
    fn links_and_pipes_lead_nowhere() {
        use std::os::unix::fs::symlink;
        let (scratch, run, out) = run();
        let secret = scratch.path().join("secret.json");
        fs::write(&secret, "4").unwrap();
        symlink(&secret, out.join("link.json")).unwrap();
        assert!(
            run.take("link.json", &number(), 1000)
                .unwrap_err()
                .contains("regular file")
        );
        fs::hard_link(&secret, out.join("hard.json")).unwrap();
        assert!(
            run.take("hard.json", &number(), 1000)
                .unwrap_err()
                .contains("another name")
        );
        fs::create_dir(out.join("dir.json")).unwrap();
        assert!(
            run.take("dir.json", &number(), 1000)
                .unwrap_err()
                .contains("regular file")
        );
        let made = std::process::Command::new("mkfifo").arg(out.join("pipe.json")).status();
        if made.is_ok_and(|status| status.success()) {
            assert!(
                run.take("pipe.json", &number(), 1000)
                    .unwrap_err()
                    .contains("regular file")
            );
        }
        fs::remove_dir_all(&out).unwrap();
        symlink(scratch.path(), &out).unwrap();
        assert!(
            run.take("secret.json", &number(), 1000)
                .unwrap_err()
                .contains("not where it was made")
        );
    }
}
