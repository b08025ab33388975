//! Sessions: one a network and provider, shared by all threads.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use gear_graph::{Context, Digest, Value};
use ort::logging::LogLevel;
use ort::session::{RunOptions, Session};
use ort::value::{Outlet, TensorElementType, TensorRef, ValueType};

use crate::declaration::Layout;
use crate::planes::{MOST_SAMPLES, Tensor};
use crate::{Declaration, Model, OnnxError, Provider, library};

/// Sessions that are kept; a graph asks few networks, and each holds its weights in memory.
const KEPT: usize = 4;

/// Threads of a session, on any machine: their number decides how sums are split (between two and three threads a U-Net
/// changed by 3e-8), and one realm has one set of bits. Where there are fewer cores they wait without spinning.
const THREADS: usize = 4;

/// How often a run that goes on looks for an interruption.
const LOOK: Duration = Duration::from_millis(50);

struct Held {
    digest: Digest,
    provider: Provider,
    /// `run` takes the session for itself: providers' allocators are not safe to share.
    session: Arc<Mutex<Session>>,
}

/// The last ones used at the end.
static SESSIONS: Mutex<Vec<Held>> = Mutex::new(Vec::new());

/// What a network gave: dimensions and samples.
#[derive(Debug)]
pub(crate) struct Raw {
    pub dims: Vec<usize>,
    pub data: Vec<f32>,
}

/// Runs the network.
pub(crate) fn run(model: &Model, provider: Provider, tensor: &Tensor, ctx: &Context) -> Result<Raw, OnnxError> {
    let session = session(model, provider, ctx)?;
    let mut session = session.lock().unwrap_or_else(PoisonError::into_inner);
    if ctx.is_cancelled() {
        return Err(OnnxError::Cancelled);
    }
    guarded("stopped while it ran the network", || {
        compute(&mut session, model, tensor, ctx)
    })
}

/// The session of this network, made if there is none.
fn session(model: &Model, provider: Provider, ctx: &Context) -> Result<Arc<Mutex<Session>>, OnnxError> {
    let library = library::open(ctx.resources())?;
    // Held while a session is made, so that two threads do not make the same one.
    let mut sessions = SESSIONS.lock().unwrap_or_else(PoisonError::into_inner);
    let digest = model.digest();
    if let Some(i) = sessions
        .iter()
        .position(|held| held.digest == digest && held.provider == provider)
    {
        let held = sessions.remove(i);
        let session = Arc::clone(&held.session);
        sessions.push(held);
        return Ok(session);
    }
    let made = guarded("stopped while it read the network", || make(&library, model, provider))?;
    let session = Arc::new(Mutex::new(made));
    if sessions.len() >= KEPT {
        sessions.remove(0);
    }
    sessions.push(Held {
        digest,
        provider,
        session: Arc::clone(&session),
    });
    Ok(session)
}

/// The binding may panic on kinds of values that it does not know, which a network can have.
fn guarded<T>(doing: &'static str, run: impl FnOnce() -> Result<T, OnnxError>) -> Result<T, OnnxError> {
    catch_unwind(AssertUnwindSafe(run)).unwrap_or_else(|_| {
        Err(OnnxError::Runtime {
            doing,
            cause: "it has values of a kind that is not supported".to_owned(),
        })
    })
}

fn failed<R>(doing: &'static str) -> impl Fn(ort::Error<R>) -> OnnxError {
    move |error| OnnxError::Runtime {
        doing,
        cause: error.message().to_owned(),
    }
}

fn make(library: &library::Library, model: &Model, provider: Provider) -> Result<Session, OnnxError> {
    let doing = "cannot read the network";
    let mut builder = Session::builder(library.environment())
        .map_err(failed(doing))?
        .with_intra_threads(THREADS)
        .map_err(failed(doing))?
        .with_intra_op_spinning(false)
        .map_err(failed(doing))?
        .with_deterministic_compute(true)
        .map_err(failed(doing))?
        // Errors are returned, and told once; an interrupted run is none.
        .with_log_level(LogLevel::Fatal)
        .map_err(failed(doing))?
        // Pictures differ in size.
        .with_memory_pattern(false)
        .map_err(failed(doing))?;
    if let Some(dispatch) = provider.dispatch(library.version())? {
        builder = builder
            .with_execution_providers([dispatch])
            .map_err(failed("cannot use the provider"))?;
    }
    let session = builder.commit_from_memory(model.onnx()).map_err(failed(doing))?;
    fits(&session, model.declaration())?;
    Ok(session)
}

/// The input that is fed and the output that is read.
fn ends<'s>(session: &'s Session, declaration: &Declaration) -> Result<(&'s Outlet, &'s Outlet), OnnxError> {
    let names = |outlets: &[Outlet]| outlets.iter().map(Outlet::name).collect::<Vec<_>>().join(", ");
    let named = |outlets: &'s [Outlet], name: &str, what: &str| {
        outlets
            .iter()
            .find(|outlet| outlet.name() == name)
            .ok_or_else(|| OnnxError::Mismatch(format!("it has no {what} `{name}`, but {}", names(outlets))))
    };
    let inputs = session.inputs();
    let input = match (&declaration.input, inputs) {
        (Some(name), _) => named(inputs, name, "input")?,
        (None, [one]) => one,
        (None, _) => return Err(OnnxError::Mismatch("it has no single input".to_owned())),
    };
    if inputs.len() != 1 {
        return Err(OnnxError::Mismatch(format!(
            "it has {} inputs ({}), and networks of one input can be used",
            inputs.len(),
            names(inputs)
        )));
    }
    let outputs = session.outputs();
    let output = match (&declaration.output, outputs.first()) {
        (Some(name), _) => named(outputs, name, "output")?,
        (None, Some(first)) => first,
        (None, None) => return Err(OnnxError::Mismatch("it has no output".to_owned())),
    };
    Ok((input, output))
}

/// Compares the network's input and output with what is declared, as far as the file tells.
fn fits(session: &Session, declaration: &Declaration) -> Result<(), OnnxError> {
    let (input, output) = ends(session, declaration)?;
    for (what, outlet) in [("input", input), ("output", output)] {
        match outlet.dtype() {
            ValueType::Tensor {
                ty: TensorElementType::Float32,
                ..
            } => {}
            other => {
                return Err(OnnxError::Mismatch(format!(
                    "its {what} `{}` is {other}, and 32-bit floats can be used",
                    outlet.name()
                )));
            }
        }
    }
    let ValueType::Tensor { shape, .. } = input.dtype() else {
        return Ok(());
    };
    if shape.len() != 4 {
        return Err(OnnxError::Mismatch(format!(
            "its input has {} axes, and 4 are needed (picture, channels, rows, columns)",
            shape.len()
        )));
    }
    let axis = match declaration.layout {
        Layout::Nchw => 1,
        Layout::Nhwc => 3,
    };
    let (found, declared) = (shape[axis], declaration.channels.len());
    if found >= 0 && found != declared as i64 {
        return Err(OnnxError::Mismatch(format!(
            "its input takes {found} channels, and {declared} are declared"
        )));
    }
    if let ValueType::Tensor { shape, .. } = output.dtype()
        && shape.iter().all(|side| *side >= 0)
        && samples(shape).is_none()
    {
        return Err(OnnxError::Mismatch(format!(
            "its output has the shape {shape}, which is too large"
        )));
    }
    Ok(())
}

/// The number of samples, if it is one that can be held.
fn samples(shape: &[i64]) -> Option<usize> {
    let mut count = 1usize;
    for side in shape {
        count = count.checked_mul(usize::try_from(*side).ok()?)?;
    }
    (count <= MOST_SAMPLES).then_some(count)
}

fn compute(session: &mut Session, model: &Model, tensor: &Tensor, ctx: &Context) -> Result<Raw, OnnxError> {
    let doing = "cannot run the network";
    let declaration = model.declaration();
    let (input, output) = ends(session, declaration)?;
    takes(input, tensor)?;
    let output = output.name().to_owned();
    let value = TensorRef::from_array_view((tensor.shape, tensor.data.as_slice())).map_err(failed(doing))?;
    let options = RunOptions::new().map_err(failed(doing))?;
    let finished = AtomicBool::new(false);
    let answer = std::thread::scope(|scope| {
        let watch = scope.spawn(|| {
            while !finished.load(Ordering::Acquire) {
                if ctx.is_cancelled() {
                    // Fails only where the options are none.
                    let _ = options.terminate();
                }
                std::thread::park_timeout(LOOK);
            }
        });
        let run = || session.run_with_options(ort::inputs![value], &options);
        let answer = catch_unwind(AssertUnwindSafe(run));
        finished.store(true, Ordering::Release);
        watch.thread().unpark();
        answer
    });
    let outputs = match answer {
        Ok(Ok(outputs)) => outputs,
        _ if ctx.is_cancelled() => return Err(OnnxError::Cancelled),
        Ok(Err(error)) => return Err(failed(doing)(error)),
        Err(cause) => std::panic::resume_unwind(cause),
    };
    let Some(value) = outputs.get(&output) else {
        return Err(OnnxError::BadAnswer(format!("it has no output `{output}`")));
    };
    let ValueType::Tensor { ty, shape, .. } = value.dtype() else {
        return Err(OnnxError::BadAnswer("it is no tensor".to_owned()));
    };
    if *ty != TensorElementType::Float32 {
        return Err(OnnxError::BadAnswer(format!("it is of {ty}, expected 32-bit floats")));
    }
    // Before the binding multiplies the sides, which may overflow.
    let Some(count) = samples(shape) else {
        return Err(OnnxError::BadAnswer(format!(
            "its shape is {shape}, and at most {MOST_SAMPLES} samples are taken"
        )));
    };
    let dims = shape.iter().map(|side| *side as usize).collect();
    if count == 0 {
        return Ok(Raw { dims, data: Vec::new() });
    }
    let (_, data) = value.try_extract_tensor::<f32>().map_err(failed(doing))?;
    Ok(Raw {
        dims,
        data: data.to_vec(),
    })
}

/// Whether the network's input takes this tensor: fixed sides are the declaration's to say.
fn takes(input: &Outlet, tensor: &Tensor) -> Result<(), OnnxError> {
    let ValueType::Tensor { shape, .. } = input.dtype() else {
        return Ok(());
    };
    let differs = |(takes, given): (&i64, usize)| *takes >= 0 && *takes as usize != given;
    if shape.iter().zip(tensor.shape).any(differs) {
        return Err(OnnxError::Mismatch(format!(
            "its input takes {shape} and would be given {:?}; a network of one size declares \
             `size: {{fixed: {{width: …, height: …}}}}`",
            tensor.shape
        )));
    }
    Ok(())
}
