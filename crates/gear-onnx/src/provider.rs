//! What computes a network.

use gear_graph::Choice;
use ort::ep::{self, ExecutionProvider, ExecutionProviderDispatch};

use crate::OnnxError;

/// What computes a network. Results of each have a realm of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Choice)]
pub enum Provider {
    /// The CPU; every build of the library has it.
    Cpu,
    /// NVIDIA GPUs, by CUDA.
    Cuda,
    /// NVIDIA GPUs, by TensorRT.
    Tensorrt,
    /// Apple's devices, by Core ML.
    Coreml,
    /// GPUs under Windows, by DirectML.
    Directml,
}

impl Provider {
    /// The name in graphs and realms.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Cuda => "cuda",
            Self::Tensorrt => "tensorrt",
            Self::Coreml => "coreml",
            Self::Directml => "directml",
        }
    }

    /// What a session registers; nothing for the CPU. An error if the library was built without it: the library itself
    /// would quietly compute on the CPU, under the wrong realm.
    pub(crate) fn dispatch(self, version: &str) -> Result<Option<ExecutionProviderDispatch>, OnnxError> {
        let (there, dispatch) = match self {
            Self::Cpu => return Ok(None),
            Self::Cuda => (ep::CUDA::is_available(), ep::CUDA::default().build()),
            Self::Tensorrt => (ep::TensorRT::is_available(), ep::TensorRT::default().build()),
            Self::Coreml => (ep::CoreML::is_available(), ep::CoreML::default().build()),
            Self::Directml => (ep::DirectML::is_available(), ep::DirectML::default().build()),
        };
        if there.unwrap_or(false) {
            return Ok(Some(dispatch.error_on_failure()));
        }
        Err(OnnxError::NoProvider {
            provider: self.name(),
            version: version.to_owned(),
        })
    }
}
