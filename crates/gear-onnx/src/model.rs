//! A network as a value of a graph, and its file as an input.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use gear_graph::{
    Context, Digest, FileSource, Hasher, Loader, NodeError, Numerics, Params, Summary, Value, ValueError,
};
use serde_json::json;

use crate::{Declaration, Familiar, NUMERICS, OnnxError, proto, testing};

/// The largest message that protobuf can hold.
const MOST_BYTES: u64 = (1 << 31) - 1;

/// A network and its declaration.
#[derive(Clone, Debug)]
pub struct Model {
    /// The ONNX file, without the declaration that it may have carried.
    onnx: Arc<[u8]>,
    declaration: Declaration,
    digest: Digest,
}

impl Model {
    /// A network from the bytes of an ONNX file and the text of its declaration, which people call `name`; without one,
    /// from the declaration that the file carries.
    pub fn new(name: &str, file: &[u8], declaration: Option<&str>) -> Result<Self, OnnxError> {
        Self::declared(name, file, declaration, None)
    }

    /// As [`Model::new`]; where nothing else declares it, as the network that gear knows.
    fn declared(
        name: &str,
        file: &[u8],
        declaration: Option<&str>,
        known_as: Option<Familiar>,
    ) -> Result<Self, OnnxError> {
        let bad = |what: String| OnnxError::BadModel(what);
        if file.len() as u64 > MOST_BYTES {
            return Err(bad(format!(
                "the network has {} bytes, more than an ONNX file can",
                file.len()
            )));
        }
        let (onnx, carried) =
            proto::take_declaration(file).map_err(|error| bad(format!("not an ONNX file: {error}")))?;
        if proto::reads_other_files(&onnx).map_err(|error| bad(format!("not an ONNX file: {error}")))? {
            return Err(bad(
                "the network keeps tensors in other files, which gear does not read: save it as one file \
                 (`onnx.save_model(model, path, save_as_external_data=False)`)"
                    .to_owned(),
            ));
        }
        let text = declaration.or(carried.as_deref());
        let Some(text) = text.or(known_as.map(Familiar::declaration)) else {
            return Err(bad(format!(
                "nothing says what goes into the network and what comes out: expected {name} beside it, in the form that \
                 the guide's chapter on networks shows, or the input's parameter `known_as` ({})",
                Familiar::ALL.map(Familiar::name).join(", ")
            )));
        };
        let declaration = Declaration::read(name, text).map_err(|mistakes| bad(mistakes.to_string()))?;
        Ok(Self::of(onnx.into(), declaration))
    }

    fn of(onnx: Arc<[u8]>, declaration: Declaration) -> Self {
        let digest = Hasher::new("Model")
            .u64(NUMERICS.into())
            .bytes(&onnx)
            .bytes(canonical(&declaration).as_bytes())
            .finish();
        Self {
            onnx,
            declaration,
            digest,
        }
    }

    /// What goes into it and what comes out.
    pub fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    /// The ONNX file.
    pub fn onnx(&self) -> &[u8] {
        &self.onnx
    }
}

/// The declaration as one line that is YAML too: the same for the same content.
fn canonical(declaration: &Declaration) -> String {
    let mut value = serde_json::Value::Object(declaration.write());
    value.sort_all_objects();
    value.to_string()
}

impl Value for Model {
    const TYPE: &'static str = "Model";
    const DOC: &'static str = "A network: an ONNX file, and what goes into it and comes out. Stored as an ONNX file that carries its declaration as metadata.";
    const EXTENSION: &'static str = "onnx";
    // No numerics: those of preparation are in the digest, so that they touch only results that a network made.
    const NUMERICS: Numerics = Numerics::new("", 1);

    fn digest(&self) -> Digest {
        self.digest
    }

    fn size_bytes(&self) -> usize {
        self.onnx.len()
    }

    fn encode(&self) -> Result<Vec<u8>, ValueError> {
        Ok(proto::with_declaration(&self.onnx, &canonical(&self.declaration)))
    }

    fn decode(bytes: &[u8]) -> Result<Self, ValueError> {
        Self::new("the stored declaration", bytes, None).map_err(|error| ValueError::new(Self::TYPE, error.to_string()))
    }

    fn summary(&self) -> Summary {
        let channels: Vec<_> = self.declaration.channels.iter().map(|channel| channel.name()).collect();
        Summary::from_iter([
            ("bytes".to_owned(), json!(self.onnx.len())),
            ("channels".to_owned(), json!(channels)),
            ("answer".to_owned(), json!(self.declaration.answer.name())),
            ("licence".to_owned(), json!(self.declaration.licence)),
        ])
    }

    fn extremes() -> Vec<(&'static str, Self)> {
        testing::extremes()
    }
}

/// A network from an ONNX file, with the declaration that lies beside it under the same name (`lines.onnx`,
/// `lines.yaml`), or that the file carries as metadata.
#[derive(Clone, Debug, Params)]
pub struct ModelFile {
    /// The network that it is, if it is one that gear knows: declares it where nothing else does.
    pub known_as: Option<Familiar>,
}

/// Where the declaration lies.
fn declaration_of(file: &Path) -> PathBuf {
    file.with_extension("yaml")
}

impl Loader for ModelFile {
    const VERSION: u32 = 1;
    type Value = Model;

    fn beside(&self, path: &Path) -> Vec<PathBuf> {
        vec![declaration_of(path)]
    }

    fn load(&self, file: &FileSource, _ctx: &Context) -> Result<Model, NodeError> {
        let path = file.as_path();
        if let Some(path) = path {
            let is_yaml = |e: &std::ffi::OsStr| e.eq_ignore_ascii_case("yaml") || e.eq_ignore_ascii_case("yml");
            if path.extension().is_some_and(is_yaml) {
                let problem = "this is a declaration; give the ONNX file, and it is found beside it";
                return Err(NodeError::new(problem));
            }
            if std::fs::metadata(path)?.len() > MOST_BYTES {
                return Err(NodeError::new(
                    "the file is larger than 2 GiB, which no ONNX file can be",
                ));
            }
        }
        let beside = path.map(declaration_of);
        let name = match beside.as_ref().and_then(|path| path.file_name()) {
            Some(name) => format!("`{}`", name.to_string_lossy()),
            None => "a declaration".to_owned(),
        };
        let text = match &beside {
            Some(path) if path.exists() => Some(
                std::fs::read_to_string(path)
                    .map_err(|error| NodeError::new(format!("its declaration {name} cannot be read: {error}")))?,
            ),
            _ => None,
        };
        let name = name.trim_matches('`');
        Ok(Model::declared(name, &file.read()?, text.as_deref(), self.known_as)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gear_graph::testing::assert_codec;

    fn written(folder: &Path, yaml: Option<&str>) -> PathBuf {
        let path = folder.join("lines.onnx");
        std::fs::write(&path, testing::onnx(&testing::Net::Edges)).unwrap();
        if let Some(yaml) = yaml {
            std::fs::write(folder.join("lines.yaml"), yaml).unwrap();
        }
        path
    }

    fn load(path: &Path) -> Result<Model, NodeError> {
        Loader::load(&ModelFile::default(), &FileSource::path(path), &Context::detached())
    }

    #[test]
    fn storing_loses_nothing_and_garbage_is_an_error() {
        assert_codec::<Model>([]);
    }

    #[test]
    fn a_network_is_its_content_wherever_it_lies_and_wherever_its_declaration_does() {
        let (here, there) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let yaml = "network: 1\nanswer: edges\n";
        let model = load(&written(here.path(), Some(yaml))).unwrap();
        let commented = load(&written(there.path(), Some("# the same\nanswer: edges\nnetwork: 1\n"))).unwrap();
        assert_eq!(model.digest(), commented.digest());
        std::fs::write(here.path().join("alone.onnx"), model.encode().unwrap()).unwrap();
        assert_eq!(load(&here.path().join("alone.onnx")).unwrap().digest(), model.digest());
        let other = load(&written(here.path(), Some("network: 1\nwhite: 255\nanswer: edges\n"))).unwrap();
        assert_ne!(other.digest(), model.digest());
    }

    #[test]
    fn a_network_that_gear_knows_needs_no_declaration_and_one_that_lies_beside_it_comes_first() {
        let folder = tempfile::tempdir().unwrap();
        let pidinet = ModelFile {
            known_as: Some(Familiar::Pidinet),
        };
        let read = |yaml| {
            let path = written(folder.path(), yaml);
            let model = pidinet.load(&FileSource::path(&path), &Context::detached()).unwrap();
            model.declaration().clone()
        };
        assert_eq!(read(None).std, [0.229, 0.224, 0.225]);
        assert!(read(Some("network: 1\nanswer: edges\n")).std.is_empty());
    }

    #[test]
    fn what_is_wrong_with_a_file_is_said() {
        let folder = tempfile::tempdir().unwrap();
        let told = |path: &Path| load(path).unwrap_err().to_string();
        let message = told(&written(folder.path(), None));
        assert!(
            message.contains("expected lines.yaml beside it") && message.contains("`known_as` (pidinet, u2netp,"),
            "{message}"
        );
        let path = written(folder.path(), Some("network: 1\nanswer: edge\n"));
        assert!(told(&path).contains("did you mean `edges`?"));
        assert!(told(&path.with_extension("yaml")).contains("give the ONNX file"));
        std::fs::write(&path, b"\xff\xff").unwrap();
        assert!(told(&path).contains("not an ONNX file"));
    }
}
