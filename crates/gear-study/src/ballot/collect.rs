//! Run folders and manifests → cases with pictures.
//!
//! A manifest is what a study writes when its results are to be judged:
//!
//! ```json
//! {"ballot": 1, "cases": [
//!   {"name": "court-lady", "tradition": "Court Ladies", "painting": "paintings/court-lady.jpg",
//!    "methods": {"gear": ["gear/orbit/yaw+0.png", "gear/orbit/yaw+30.png"], "raw": ["raw/orbit/yaw+0.png"]}}]}
//! ```
//!
//! Paths are relative to its folder. Without one, each method is given as a folder: of one run, or of runs that are named
//! like their cases. The frames of a run are its output `orbit`, else its largest list of views; the painting is the file or
//! sample that the run was given.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use gear_image::filter::{fit_longer_side, resize_rgb};
use gear_image::{Image, SrgbImage};
use gear_report::picture::Pixels;
use serde::Deserialize;
use serde_json::Value as Json;

use super::{BallotError, Case, VERSION};

/// How pictures are taken in.
#[derive(Clone, Copy, Debug)]
pub struct Given {
    /// Longer side of frames and paintings in the page.
    pub size: usize,
    /// At most so many frames of a turn, evenly chosen.
    pub frames: usize,
}

/// A manifest.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    ballot: u32,
    cases: Vec<ManifestCase>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ManifestCase {
    name: String,
    #[serde(default)]
    tradition: String,
    #[serde(default)]
    painting: Option<PathBuf>,
    methods: BTreeMap<String, Vec<PathBuf>>,
}

/// What is known of a case beside its runs: columns `case`, `tradition` and `painting` of a CSV file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct About {
    /// The tradition.
    pub tradition: String,
    /// The painting's file.
    pub painting: Option<PathBuf>,
}

impl About {
    /// Reads such a file; paintings are relative to its folder.
    pub fn read(file: &Path) -> Result<BTreeMap<String, Self>, BallotError> {
        let bad = |cause: String| BallotError::File {
            file: file.to_path_buf(),
            cause,
        };
        let text = std::fs::read_to_string(file).map_err(|e| bad(e.to_string()))?;
        let mut lines = text
            .lines()
            .map(cells)
            .filter(|cells| cells.iter().any(|cell| !cell.is_empty()));
        let heads = lines
            .next()
            .ok_or_else(|| bad("it is empty; expected the columns case, tradition, painting".into()))?;
        let column = |name: &str| heads.iter().position(|head| head == name);
        let case = column("case").ok_or_else(|| bad(format!("it has no column `case`, found {}", heads.join(", "))))?;
        let (tradition, painting) = (column("tradition"), column("painting"));
        let folder = file.parent().unwrap_or(Path::new(""));
        let about = |cells: Vec<String>| {
            let cell = |at: Option<usize>| at.and_then(|at| cells.get(at)).cloned().unwrap_or_default();
            let painting = Some(cell(painting)).filter(|p| !p.is_empty()).map(|p| folder.join(p));
            let about = Self {
                tradition: cell(tradition),
                painting,
            };
            (cell(Some(case)), about)
        };
        Ok(lines.map(about).collect())
    }
}

/// The cells of a line of CSV; commas within double quotes belong to the cell.
fn cells(line: &str) -> Vec<String> {
    let mut cells = vec![String::new()];
    let mut quoted = false;
    let mut chars = line.trim_end_matches('\r').chars().peekable();
    while let Some(c) = chars.next() {
        let last = cells.len() - 1;
        match c {
            '"' if quoted && chars.peek() == Some(&'"') => {
                chars.next();
                cells[last].push('"');
            }
            '"' => quoted = !quoted,
            ',' if !quoted => cells.push(String::new()),
            c => cells[last].push(c),
        }
    }
    cells.into_iter().map(|cell| cell.trim().to_owned()).collect()
}

/// The cases of a manifest, and its methods.
pub fn from_manifest(file: &Path, given: Given) -> Result<(Vec<String>, Vec<Case>), BallotError> {
    let bad = |cause: String| BallotError::File {
        file: file.to_path_buf(),
        cause,
    };
    let text = std::fs::read(file).map_err(|e| bad(e.to_string()))?;
    let manifest: Manifest = serde_json::from_slice(&text).map_err(|e| bad(e.to_string()))?;
    if manifest.ballot != VERSION {
        return Err(bad(format!("is of version {}, expected {VERSION}", manifest.ballot)));
    }
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut cases = Vec::new();
    for case in manifest.cases {
        let mut frames = BTreeMap::new();
        for (method, files) in case.methods {
            let files: Vec<_> = files.into_iter().map(|file| folder.join(file)).collect();
            frames.insert(method, turn(&files, given)?);
        }
        let painting = case.painting.map(|painting| jpeg(&folder.join(painting), given.size));
        cases.push(Case {
            name: case.name,
            tradition: case.tradition,
            painting: painting.transpose()?,
            frames,
        });
    }
    let methods = paired(&cases)?;
    Ok((methods, cases))
}

/// The cases of run folders, one folder a method.
pub fn from_folders(
    folders: &[(String, PathBuf)],
    about: &BTreeMap<String, About>,
    only: &[String],
    given: Given,
) -> Result<(Vec<String>, Vec<Case>), BallotError> {
    let mut cases: BTreeMap<String, Case> = BTreeMap::new();
    for (method, folder) in folders {
        let runs = runs(folder)?;
        for (name, run) in runs {
            if !only.is_empty() && !only.contains(&name) {
                continue;
            }
            let about = about.get(&name).cloned().unwrap_or_default();
            let record = record(&run)?;
            let frames = turn(&frames(&run, &record)?, given)?;
            if !cases.contains_key(&name) {
                let painting = match &about.painting {
                    Some(painting) => Some(jpeg(painting, given.size)?),
                    None => painting_of(&record, given.size),
                };
                let case = Case {
                    name: name.clone(),
                    tradition: about.tradition,
                    painting,
                    frames: BTreeMap::new(),
                };
                cases.insert(name.clone(), case);
            }
            if let Some(case) = cases.get_mut(&name) {
                case.frames.insert(method.clone(), frames);
            }
        }
    }
    let cases: Vec<Case> = cases.into_values().collect();
    let methods = paired(&cases)?;
    Ok((methods, cases))
}

/// The methods; each case must have all of them.
fn paired(cases: &[Case]) -> Result<Vec<String>, BallotError> {
    let mut methods: Vec<String> = cases.iter().flat_map(|case| case.frames.keys().cloned()).collect();
    methods.sort();
    methods.dedup();
    if methods.len() < 2 {
        return Err(BallotError::Nothing(format!(
            "a ballot compares two methods or more, found {}",
            if methods.is_empty() {
                "none".to_owned()
            } else {
                methods.join(", ")
            }
        )));
    }
    for case in cases {
        if let Some(method) = methods.iter().find(|method| !case.frames.contains_key(*method)) {
            return Err(BallotError::Unpaired {
                method: method.clone(),
                case: case.name.clone(),
                other: case.frames.keys().next().cloned().unwrap_or_default(),
            });
        }
    }
    Ok(methods)
}

/// The runs in a folder: itself, or its subfolders, by name.
fn runs(folder: &Path) -> Result<Vec<(String, PathBuf)>, BallotError> {
    let bad = |cause: String| BallotError::File {
        file: folder.to_path_buf(),
        cause,
    };
    if folder.join("run.json").is_file() {
        // A single run is one case, whatever its folder is called: it is the same for all methods.
        return Ok(vec![("case".to_owned(), folder.to_path_buf())]);
    }
    let entries = std::fs::read_dir(folder).map_err(|e| bad(e.to_string()))?;
    let mut runs: Vec<_> = entries
        .flatten()
        .map(|entry| (entry.file_name().to_string_lossy().into_owned(), entry.path()))
        .filter(|(_, path)| path.join("run.json").is_file())
        .collect();
    runs.sort();
    if runs.is_empty() {
        return Err(bad(
            "no run is in it: neither it nor a folder in it has a run.json".to_owned()
        ));
    }
    Ok(runs)
}

fn record(run: &Path) -> Result<Json, BallotError> {
    let file = run.join("run.json");
    let bad = |cause: String| BallotError::File {
        file: file.clone(),
        cause,
    };
    let text = std::fs::read(&file).map_err(|e| bad(e.to_string()))?;
    serde_json::from_slice(&text).map_err(|e| bad(e.to_string()))
}

/// The files of a run's turn, in the order of their angles.
fn frames(run: &Path, record: &Json) -> Result<Vec<PathBuf>, BallotError> {
    let names = |of: &Json| of.as_array().cloned().unwrap_or_default();
    let files: Vec<String> = names(&record["files"])
        .iter()
        .filter_map(|file| file.as_str().map(str::to_owned))
        .collect();
    let of = |output: &str| -> Vec<&String> {
        let below = format!("{output}/");
        files
            .iter()
            .filter(|file| file.starts_with(&below) && file.ends_with(".png"))
            .collect()
    };
    let views = names(&record["outputs"]);
    let views: Vec<_> = views.iter().filter(|output| output["type"] == "Views").collect();
    let views: Vec<&str> = views.iter().filter_map(|output| output["name"].as_str()).collect();
    let best = views.iter().max_by_key(|name| (**name == "orbit", of(name).len()));
    let mut turn: Vec<_> = best.map(|name| of(name)).unwrap_or_default();
    if turn.is_empty() {
        return Err(BallotError::File {
            file: run.to_path_buf(),
            cause: "its graph puts out no views; add an output such as `orbit: orbit.views`".to_owned(),
        });
    }
    turn.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    Ok(turn.into_iter().map(|file| run.join(file)).collect())
}

/// The number behind `yaw` in a file's name.
fn angle(file: &str) -> f64 {
    let name = file.rsplit('/').next().unwrap_or_default().trim_end_matches(".png");
    name.strip_prefix("yaw")
        .and_then(|angle| angle.parse().ok())
        .unwrap_or(0.0)
}

/// The painting that a run was given, if it can be had.
fn painting_of(record: &Json, size: usize) -> Option<Vec<u8>> {
    let nodes = record["nodes"].as_array()?;
    let painting = nodes
        .iter()
        .find(|node| node["input"] == true && node["type"] == "Image")?;
    let source = painting["source"].as_str()?;
    match source.strip_prefix("sample:") {
        Some(sample) => {
            let options = gear_sample::Options {
                longer_side: size.clamp(gear_sample::MIN_SIDE, gear_sample::MAX_SIDE),
                ..gear_sample::Options::default()
            };
            let sample = gear_sample::paint(sample, &options).ok()?;
            small(&sample.painting.rgb, size).ok()
        }
        None => jpeg(Path::new(source), size).ok(),
    }
}

fn turn(files: &[PathBuf], given: Given) -> Result<Vec<Vec<u8>>, BallotError> {
    let count = files.len().min(given.frames.max(1));
    (0..count)
        .map(|i| jpeg(&files[i * files.len() / count], given.size))
        .collect()
}

/// A picture file as a small JPEG that says nothing but its pixels.
fn jpeg(file: &Path, size: usize) -> Result<Vec<u8>, BallotError> {
    let bad = |cause: String| BallotError::File {
        file: file.to_path_buf(),
        cause,
    };
    let picture = image::open(file).map_err(|e| bad(e.to_string()))?.to_rgb8();
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let pixels = picture.pixels().map(|p| p.0.map(|c| f32::from(c) / 255.0)).collect();
    small(&SrgbImage::from_vec(width, height, pixels), size).map_err(bad)
}

fn small(rgb: &SrgbImage, size: usize) -> Result<Vec<u8>, String> {
    let (width, height) = rgb.size();
    let rgb = match fit_longer_side(width, height, size) {
        (w, h) if (w, h) != (width, height) => resize_rgb(rgb, w, h),
        _ => rgb.clone(),
    };
    let picture = Pixels::of_image(&Image::opaque(rgb))
        .jpeg()
        .map_err(|e| e.to_string())?;
    Ok(picture.bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_in_the_order_of_their_angles() {
        let record = serde_json::json!({
            "outputs": [{"name": "views", "type": "Views"}, {"name": "orbit", "type": "Views"}, {"name": "scene", "type": "Scene"}],
            "files": ["views/yaw-90.png", "views/yaw+0.png", "views/yaw+90.png",
                      "orbit/yaw+100.png", "orbit/yaw+20.png", "orbit/yaw+0.png", "scene.ply"],
        });
        let found = frames(Path::new("run"), &record).unwrap();
        let names = ["run/orbit/yaw+0.png", "run/orbit/yaw+20.png", "run/orbit/yaw+100.png"];
        assert_eq!(found, names.map(PathBuf::from));
        assert!(frames(Path::new("run"), &serde_json::json!({})).is_err());
    }

    #[test]
    fn cells_with_commas_and_quotes_stay_whole() {
        assert_eq!(
            cells("a,\"b, c\",\"say \"\"d\"\"\", e "),
            ["a", "b, c", "say \"d\"", "e"]
        );
    }

    #[test]
    fn what_is_known_of_cases_is_read_by_the_names_of_columns() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("about.csv");
        std::fs::write(
            &file,
            "tradition,case,painting\n\"Mural, east\",m1,p/m1.png\nThangka,t1,\n",
        )
        .unwrap();
        let about = About::read(&file).unwrap();
        assert_eq!(about["m1"].tradition, "Mural, east");
        assert_eq!(about["m1"].painting, Some(folder.path().join("p/m1.png")));
        assert_eq!(about["t1"].painting, None);
        std::fs::write(&file, "tradition\nMural\n").unwrap();
        assert!(About::read(&file).unwrap_err().to_string().contains("no column `case`"));
    }
}
