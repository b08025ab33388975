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

use gear_graph::graph::nearest;
use serde::Deserialize;
use serde_json::Value as Json;

use super::{BallotError, Case, Collected, Turn, VERSION};
use crate::csv;
use crate::painting::painting;
use crate::study::Source;

/// What is taken in.
#[derive(Clone, Debug, Default)]
pub struct Given {
    /// Longer side of frames and paintings in the page.
    pub size: usize,
    /// At most so many frames of a turn, evenly chosen.
    pub frames: usize,
    /// Only these cases; all if none is named.
    pub cases: Vec<String>,
    /// Only these methods; all if none is named.
    pub methods: Vec<String>,
}

impl Given {
    pub(super) fn wants_case(&self, name: &str) -> bool {
        self.cases.is_empty() || self.cases.iter().any(|wanted| wanted == name)
    }

    pub(super) fn wants_method(&self, name: &str) -> bool {
        self.methods.is_empty() || self.methods.iter().any(|wanted| wanted == name)
    }

    /// Refuses what was asked for by a name that nothing has.
    pub(super) fn check(&self, cases: &[String], methods: &[String]) -> Result<(), BallotError> {
        for (what, wanted, known) in [("case", &self.cases, cases), ("method", &self.methods, methods)] {
            if let Some(name) = wanted.iter().find(|name| !known.contains(name)) {
                let near = nearest(name, known.iter().map(String::as_str));
                return Err(BallotError::Unknown {
                    what,
                    name: name.clone(),
                    help: match near {
                        Some(near) => format!("did you mean `{near}`?"),
                        None => format!("there are {}", known.join(", ")),
                    },
                });
            }
        }
        Ok(())
    }
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
        let mut lines = csv::rows(&text, 0)
            .into_iter()
            .map(|row| row.into_iter().map(|cell| cell.value).collect::<Vec<_>>());
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

/// The cases of a manifest.
pub fn from_manifest(file: &Path, given: &Given) -> Result<Collected, BallotError> {
    let manifest: Manifest = read(file)?;
    if manifest.ballot != VERSION {
        let cause = format!("is of version {}, expected {VERSION}", manifest.ballot);
        return Err(failed(file, cause));
    }
    let folder = file.parent().unwrap_or(Path::new(""));
    let names: Vec<String> = manifest.cases.iter().map(|case| case.name.clone()).collect();
    let methods = manifest.cases.iter().flat_map(|case| case.methods.keys().cloned());
    given.check(&names, &methods.collect::<Vec<_>>())?;
    let mut cases = Vec::new();
    for case in manifest.cases.into_iter().filter(|case| given.wants_case(&case.name)) {
        let mut turns = BTreeMap::new();
        for (method, files) in case.methods.into_iter().filter(|(m, _)| given.wants_method(m)) {
            let files = files.into_iter().map(|file| (angle(&file), folder.join(file)));
            turns.insert(method, turn(files.collect(), given)?);
        }
        let painting = case.painting.map(|painting| jpeg(&folder.join(painting), given.size));
        cases.push(Case {
            name: case.name,
            tradition: case.tradition,
            painting: painting.transpose()?,
            turns,
        });
    }
    paired(cases)
}

/// The cases of run folders, one folder a method.
pub fn from_folders(
    folders: &[(String, PathBuf)],
    about: &BTreeMap<String, About>,
    given: &Given,
) -> Result<Collected, BallotError> {
    let mut found = Vec::new();
    for (method, folder) in folders {
        found.extend(runs(folder)?.into_iter().map(|(name, run)| (method, name, run)));
    }
    let names: Vec<String> = found.iter().map(|(_, name, _)| name.clone()).collect();
    let methods: Vec<String> = folders.iter().map(|(method, _)| method.clone()).collect();
    given.check(&names, &methods)?;
    let mut cases: BTreeMap<String, Case> = BTreeMap::new();
    for (method, name, run) in found {
        if !given.wants_case(&name) || !given.wants_method(method) {
            continue;
        }
        let about = about.get(&name).cloned().unwrap_or_default();
        let record: Json = read(&run.join("run.json"))?;
        let turn = turn(frames(&run, &record)?, given)?;
        if !cases.contains_key(&name) {
            let painting = match &about.painting {
                Some(painting) => Some(jpeg(painting, given.size)?),
                None => painting_of(&record, given.size),
            };
            let case = Case {
                name: name.clone(),
                tradition: about.tradition,
                painting,
                turns: BTreeMap::new(),
            };
            cases.insert(name.clone(), case);
        }
        if let Some(case) = cases.get_mut(&name) {
            case.turns.insert(method.clone(), turn);
        }
    }
    paired(cases.into_values().collect())
}

/// The methods of cases; each case must have all of them.
pub(super) fn paired(cases: Vec<Case>) -> Result<Collected, BallotError> {
    let mut methods: Vec<String> = cases.iter().flat_map(|case| case.turns.keys().cloned()).collect();
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
    for case in &cases {
        if let Some(method) = methods.iter().find(|method| !case.turns.contains_key(*method)) {
            return Err(BallotError::Unpaired {
                method: method.clone(),
                case: case.name.clone(),
                other: case.turns.keys().next().cloned().unwrap_or_default(),
            });
        }
    }
    Ok(Collected {
        methods,
        cases,
        notes: Vec::new(),
    })
}

pub(super) fn failed(file: &Path, cause: impl Into<String>) -> BallotError {
    BallotError::File {
        file: file.to_path_buf(),
        cause: cause.into(),
    }
}

/// Reads a file of JSON.
pub(super) fn read<T: serde::de::DeserializeOwned>(file: &Path) -> Result<T, BallotError> {
    let text = std::fs::read(file).map_err(|e| failed(file, e.to_string()))?;
    serde_json::from_slice(&text).map_err(|e| failed(file, e.to_string()))
}

/// The runs in a folder: itself, or its subfolders, by name.
fn runs(folder: &Path) -> Result<Vec<(String, PathBuf)>, BallotError> {
    let bad = |cause: String| failed(folder, cause);
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

/// The files of a run's turn, with their angles.
fn frames(run: &Path, record: &Json) -> Result<Vec<(Option<f64>, PathBuf)>, BallotError> {
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
    let turn: Vec<_> = best.map(|name| of(name)).unwrap_or_default();
    if turn.is_empty() {
        let cause = "its graph puts out no views; add an output such as `orbit: orbit.views`";
        return Err(failed(run, cause));
    }
    let turn = turn.into_iter();
    Ok(turn.map(|file| (angle(Path::new(file)), run.join(file))).collect())
}

/// The number behind `yaw` in a file's name.
pub(super) fn angle(file: &Path) -> Option<f64> {
    let angle = file.file_stem()?.to_str()?.strip_prefix("yaw")?.parse();
    angle.ok().filter(|angle: &f64| angle.is_finite())
}

/// The painting that a run was given, if it can be had.
fn painting_of(record: &Json, size: usize) -> Option<Vec<u8>> {
    let nodes = record["nodes"].as_array()?;
    let painting = nodes
        .iter()
        .find(|node| node["input"] == true && node["type"] == "Image")?;
    let source = Source::parse(painting["source"].as_str()?, Path::new(""));
    Some(self::painting(&source, size).ok()?.jpeg().ok()?.bytes)
}

/// The files of a turn in the order of their angles; where a name tells none, they go evenly around.
pub(super) fn turn(mut files: Vec<(Option<f64>, PathBuf)>, given: &Given) -> Result<Turn, BallotError> {
    if files.iter().any(|(angle, _)| angle.is_none()) {
        let step = 360.0 / files.len() as f64;
        for (i, (angle, _)) in files.iter_mut().enumerate() {
            *angle = Some(step * i as f64);
        }
    }
    files.sort_by(|a, b| a.0.unwrap_or(0.0).total_cmp(&b.0.unwrap_or(0.0)));
    let count = files.len().min(given.frames.max(1));
    let chosen = (0..count).map(|i| &files[i * files.len() / count]);
    let mut turn = Turn {
        angles: Vec::new(),
        frames: Vec::new(),
    };
    for (angle, file) in chosen {
        turn.angles.push(angle.unwrap_or(0.0));
        turn.frames.push(jpeg(file, given.size)?);
    }
    Ok(turn)
}

/// A picture file as a small JPEG that says nothing but its pixels.
pub(super) fn jpeg(file: &Path, size: usize) -> Result<Vec<u8>, BallotError> {
    let pixels = painting(&Source::File(file.to_path_buf()), size);
    let picture = pixels.and_then(|pixels| pixels.jpeg().map_err(|e| e.to_string()));
    Ok(picture.map_err(|cause| failed(file, cause))?.bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_turn_of_a_run_is_its_orbit() {
        let record = serde_json::json!({
            "outputs": [{"name": "views", "type": "Views"}, {"name": "orbit", "type": "Views"}, {"name": "scene", "type": "Scene"}],
            "files": ["views/yaw-90.png", "views/yaw+0.png", "views/yaw+90.png",
                      "orbit/yaw+100.png", "orbit/yaw+20.png", "orbit/yaw+0.png", "scene.ply"],
        });
        let found = frames(Path::new("run"), &record).unwrap();
        let expected = [
            (100.0, "run/orbit/yaw+100.png"),
            (20.0, "run/orbit/yaw+20.png"),
            (0.0, "run/orbit/yaw+0.png"),
        ];
        assert_eq!(found, expected.map(|(angle, file)| (Some(angle), PathBuf::from(file))));
        assert!(frames(Path::new("run"), &serde_json::json!({})).is_err());
    }

    #[test]
    fn frames_go_by_their_angles_or_evenly_around() {
        let folder = tempfile::tempdir().unwrap();
        let picture = painting(&Source::Sample("vessel".into()), 32).unwrap().png().unwrap();
        let file = |name: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, &picture.bytes).unwrap();
            (angle(&path), path)
        };
        let named = vec![file("yaw+90.png"), file("yaw-90.png"), file("yaw+0.png")];
        let given = |frames| Given {
            size: 16,
            frames,
            ..Given::default()
        };
        assert_eq!(turn(named.clone(), &given(9)).unwrap().angles, [-90.0, 0.0, 90.0]);
        assert_eq!(turn(named, &given(2)).unwrap().frames.len(), 2);
        let unnamed = vec![file("a.png"), file("b.png"), file("yaw+3.png")];
        assert_eq!(turn(unnamed, &given(9)).unwrap().angles, [0.0, 120.0, 240.0]);
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
