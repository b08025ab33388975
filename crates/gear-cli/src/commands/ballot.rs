//! `gear ballot`: a page on which people judge, and the count of what they said.

use std::path::{Path, PathBuf};

use clap::Args;
use gear_study::ballot::{self, About, Answers, BallotError, Collected, Given, Key};

use crate::args::TextFormat;
use crate::console::Console;
use crate::error::{CliError, Exit};

/// `gear ballot`.
#[derive(Debug, Args)]
pub struct BallotArgs {
    /// What is compared: the output folder of a study; or METHOD=DIR for each method, where DIR is a run's folder or holds
    /// runs that are named like their cases; or a manifest. With --tally: the files of answers
    #[arg(required = true, value_name = "STUDY|METHOD=DIR|MANIFEST|ANSWERS")]
    pub given: Vec<String>,
    /// Count answers instead
    #[arg(long, requires = "key")]
    pub tally: bool,
    /// The key: written beside the page, or read by --tally [default: the page's name with .key.json]
    #[arg(long, value_name = "FILE")]
    pub key: Option<PathBuf>,
    /// The page
    #[arg(long, value_name = "FILE", default_value = "ballot.html", conflicts_with = "tally")]
    pub out: PathBuf,
    /// The heading of the page
    #[arg(long, default_value = "Which reconstruction do you prefer?")]
    pub title: String,
    /// Seed of tokens and orders
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Different orders in the page; participants fall on one by their name
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub sheets: u16,
    /// At most so many views of each turn
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u16).range(1..=360))]
    pub frames: u16,
    /// Longer side of the pictures, in pixels
    #[arg(long, value_name = "PX", default_value_t = 320, value_parser = clap::value_parser!(u16).range(16..=2048))]
    pub size: u16,
    /// Traditions and paintings of the cases of METHOD=DIR: CSV with the columns case, tradition, painting
    #[arg(long, value_name = "FILE")]
    pub about: Option<PathBuf>,
    /// Only this case; several times for several
    #[arg(long, value_name = "NAME")]
    pub case: Vec<String>,
    /// Only this method, a variant of the study; several times for several
    #[arg(long, value_name = "NAME")]
    pub method: Vec<String>,
    /// How --tally tells its count
    #[arg(long, value_enum, default_value_t = TextFormat::Text)]
    pub format: TextFormat,
}

pub fn ballot(args: &BallotArgs, console: &Console) -> Result<Exit, CliError> {
    if args.tally {
        count(args, console)
    } else {
        make(args, console)
    }
}

fn make(args: &BallotArgs, console: &Console) -> Result<Exit, CliError> {
    let given = Given {
        size: usize::from(args.size),
        frames: usize::from(args.frames),
        cases: args.case.clone(),
        methods: args.method.clone(),
    };
    let Collected { methods, cases, notes } = collect(args, &given)?;
    for note in &notes {
        console.warning(note);
    }
    let (key, sheets) = ballot::draw(&cases, &methods, args.seed, usize::from(args.sheets));
    let page = ballot::page(&args.title, &cases, &key, &sheets)?;
    let beside = args.key.clone().unwrap_or_else(|| args.out.with_extension("key.json"));
    let text = serde_json::to_string_pretty(&key).map_err(|e| BallotError::Nothing(e.to_string()))?;
    spare_another_key(&beside, &key)?;
    write(&args.out, page.as_bytes())?;
    write(&beside, (text + "\n").as_bytes())?;
    for case in cases.iter().filter(|case| case.painting.is_none()) {
        console.note(&format!(
            "`{}` has no painting to show; give it with --about",
            case.name
        ));
    }
    console.result(&args.out.display().to_string());
    console.result(&beside.display().to_string());
    console.remark(&format!(
        "{} cases, {} methods, {:.1} MiB; give people {} and keep {}",
        cases.len(),
        methods.len(),
        page.len() as f64 / f64::from(1 << 20),
        args.out.display(),
        beside.display()
    ));
    Ok(Exit::Done)
}

/// Refuses to replace what the answers to another ballot are counted with.
fn spare_another_key(file: &Path, key: &Key) -> Result<(), BallotError> {
    let refuse = |found: String| {
        Err(BallotError::File {
            file: file.to_path_buf(),
            cause: format!("{found}; choose another --out (or --key), or remove the file first"),
        })
    };
    if !file.exists() {
        return Ok(());
    }
    match read::<Key>(file) {
        Ok(found) if found.ballot == key.ballot => Ok(()),
        Ok(found) => refuse(format!(
            "this is the key of another ballot, {} instead of {}, and without it nobody can count the answers to that one",
            found.ballot, key.ballot
        )),
        Err(_) => refuse("there is a file already, and it is no key of a ballot".to_owned()),
    }
}

fn collect(args: &BallotArgs, given: &Given) -> Result<Collected, BallotError> {
    if let [single] = args.given.as_slice()
        && !single.contains('=')
    {
        let path = Path::new(single);
        return match path.file_name().is_some_and(|name| name == ballot::STUDY) {
            true => ballot::from_study(path, given),
            false if path.is_dir() => ballot::from_study(&path.join(ballot::STUDY), given),
            false => ballot::from_manifest(path, given),
        };
    }
    let mut folders = Vec::new();
    for text in &args.given {
        let (method, folder) = text.split_once('=').ok_or_else(|| {
            BallotError::Nothing(format!(
                "{text}: expected METHOD=DIR, such as `gear=out/gear`, or the folder of one study alone"
            ))
        })?;
        folders.push((method.to_owned(), PathBuf::from(folder)));
    }
    let about = args.about.as_deref().map(About::read).transpose()?.unwrap_or_default();
    ballot::from_folders(&folders, &about, given)
}

fn count(args: &BallotArgs, console: &Console) -> Result<Exit, CliError> {
    let key: Key = read(args.key.as_deref().unwrap_or(Path::new("")))?;
    let files: Vec<(PathBuf, Answers)> = args
        .given
        .iter()
        .map(|file| Ok((PathBuf::from(file), read(Path::new(file))?)))
        .collect::<Result<_, BallotError>>()?;
    let tally = ballot::tally(&key, &files)?;
    match args.format {
        TextFormat::Text => console.result(tally.text().trim_end()),
        TextFormat::Json => {
            let text = serde_json::to_string_pretty(&tally).map_err(|e| BallotError::Nothing(e.to_string()))?;
            console.result(&text);
        }
    }
    Ok(Exit::Done)
}

fn write(file: &Path, bytes: &[u8]) -> Result<(), CliError> {
    gear_image::io::write_atomically(file, bytes).map_err(|cause| CliError::Write {
        file: file.to_path_buf(),
        cause: std::io::Error::other(cause.to_string()),
    })
}

fn read<T: serde::de::DeserializeOwned>(file: &Path) -> Result<T, BallotError> {
    let bad = |cause: String| BallotError::File {
        file: file.to_path_buf(),
        cause,
    };
    let bytes = std::fs::read(file).map_err(|e| bad(e.to_string()))?;
    serde_json::from_slice(&bytes).map_err(|e| bad(e.to_string()))
}
