//! What rasterises: the CPU, or a GPU with the CPU behind it.
//!
//! A [`Device`] is opened once and shared. When its GPU cannot do what is asked of it, because there is none, a limit is
//! too small or the driver gives up, the CPU does it instead, with one warning; where that is not wanted
//! ([`Fallback::forbidden`], `GEAR_REQUIRE_GPU=1`) it is an error.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;
#[cfg(feature = "gpu")]
use std::sync::atomic::{AtomicBool, Ordering};

use crate::render::{PixelGradients, SceneGradients, Wanted};
use crate::{Camera, Outputs, RenderOptions, Rendering, Scene, cpu};

/// Where results computed on the CPU are valid: everywhere.
const CPU_REALM: &str = "cpu";

/// Which device is wanted. In text `auto`, `cpu`, `gpu` or `gpu:NAME`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// The most able GPU; the CPU if there is none, or only one that the CPU plays itself.
    #[default]
    Auto,
    /// The CPU.
    Cpu,
    /// The most able GPU, or the one with this in its name, be it played by the CPU.
    Gpu(Option<String>),
}

impl FromStr for DeviceChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            None if text == "auto" => Ok(Self::Auto),
            None if text == "cpu" => Ok(Self::Cpu),
            None if text == "gpu" => Ok(Self::Gpu(None)),
            Some(("gpu", name)) if !name.is_empty() => Ok(Self::Gpu(Some(name.to_string()))),
            _ => Err(format!("found `{text}`; expected `auto`, `cpu`, `gpu` or `gpu:NAME`")),
        }
    }
}

impl fmt::Display for DeviceChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Cpu => f.write_str("cpu"),
            Self::Gpu(None) => f.write_str("gpu"),
            Self::Gpu(Some(name)) => write!(f, "gpu:{name}"),
        }
    }
}

/// A GPU is required and cannot do it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a GPU is required, but {cause}")]
pub struct DeviceError {
    cause: String,
}

type Listener = dyn Fn(&str) + Send + Sync;

/// What happens when a GPU cannot do it.
#[derive(Clone)]
pub struct Fallback {
    allowed: bool,
    tell: Arc<Listener>,
}

impl Fallback {
    /// The CPU does it, and `tell` hears why, once.
    pub fn telling(tell: impl Fn(&str) + Send + Sync + 'static) -> Self {
        Self {
            allowed: true,
            tell: Arc::new(tell),
        }
    }

    /// It is an error.
    pub fn forbidden() -> Self {
        Self {
            allowed: false,
            ..Self::telling(|_| {})
        }
    }

    /// As it is, but forbidden if the environment says `GEAR_REQUIRE_GPU=1`.
    pub fn unless_required(self) -> Self {
        let required = std::env::var_os("GEAR_REQUIRE_GPU").is_some_and(|value| value == "1");
        Self {
            allowed: self.allowed && !required,
            ..self
        }
    }
}

impl Default for Fallback {
    /// The CPU does it with a `tracing` warning, unless `GEAR_REQUIRE_GPU=1`.
    fn default() -> Self {
        Self::telling(|cause| tracing::warn!("{cause}")).unless_required()
    }
}

/// What rasterises. Cheap to clone.
#[derive(Clone)]
pub struct Device {
    /// `None`: the CPU.
    #[cfg(feature = "gpu")]
    gpu: Option<Arc<OnGpu>>,
}

#[cfg(feature = "gpu")]
struct OnGpu {
    gpu: Arc<crate::gpu::Gpu>,
    fallback: Fallback,
    told: AtomicBool,
    /// It failed, and is not asked again.
    gone: AtomicBool,
}

impl fmt::Debug for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Device({})", self.realm())
    }
}

impl Default for Device {
    fn default() -> Self {
        Self::cpu()
    }
}

impl Device {
    /// The CPU.
    pub fn cpu() -> Self {
        Self {
            #[cfg(feature = "gpu")]
            gpu: None,
        }
    }

    /// Opens what is chosen. An error only where falling back is forbidden.
    ///
    /// Without any GPU [`DeviceChoice::Auto`] takes the CPU without a word, unless falling back is forbidden. Where the only
    /// GPU is played by the CPU it takes the CPU in any case: that is its choice, and no fallback.
    pub fn open(choice: &DeviceChoice, fallback: Fallback) -> Result<Self, DeviceError> {
        let opened = match choice {
            DeviceChoice::Cpu => return Ok(Self::cpu()),
            DeviceChoice::Auto => Self::best(&fallback),
            DeviceChoice::Gpu(name) => Self::named(name.as_deref(), &fallback),
        };
        match opened {
            Ok(device) => Ok(device),
            Err(cause) if !fallback.allowed => Err(DeviceError { cause }),
            Err(cause) => {
                (fallback.tell)(&instead(&cause));
                Ok(Self::cpu())
            }
        }
    }

    #[cfg(feature = "gpu")]
    fn best(fallback: &Fallback) -> Result<Self, String> {
        if fallback.allowed && !crate::gpu::may_be_there() {
            return Ok(Self::cpu());
        }
        match crate::gpu::names().first() {
            None if fallback.allowed => Ok(Self::cpu()),
            Some(best) if best.software => Ok(Self::cpu()),
            _ => Self::named(None, fallback),
        }
    }

    #[cfg(feature = "gpu")]
    fn named(name: Option<&str>, fallback: &Fallback) -> Result<Self, String> {
        let gpu = crate::gpu::Gpu::open(name).map_err(|error| error.to_string())?;
        if gpu.name().software {
            let device = &gpu.name().device;
            (fallback.tell)(&format!(
                "{device} is a GPU that the CPU plays; `--device cpu` is many times faster"
            ));
        }
        Ok(Self::on(gpu, fallback.clone()))
    }

    #[cfg(not(feature = "gpu"))]
    fn best(fallback: &Fallback) -> Result<Self, String> {
        if fallback.allowed {
            Ok(Self::cpu())
        } else {
            Self::named(None, fallback)
        }
    }

    #[cfg(not(feature = "gpu"))]
    fn named(_name: Option<&str>, _fallback: &Fallback) -> Result<Self, String> {
        Err("this program was built without GPU support (the feature `gpu`)".to_string())
    }

    /// A GPU that is already open.
    #[cfg(feature = "gpu")]
    pub fn on(gpu: crate::gpu::Gpu, fallback: Fallback) -> Self {
        Self {
            gpu: Some(Arc::new(OnGpu {
                gpu: Arc::new(gpu),
                fallback,
                told: AtomicBool::new(false),
                gone: AtomicBool::new(false),
            })),
        }
    }

    /// The device that a run lends ([`gear_graph::Run::resource`]); the CPU if it lends none.
    #[cfg(feature = "graph")]
    pub fn lent(resources: &gear_graph::Resources) -> Self {
        resources.get().cloned().unwrap_or_default()
    }

    /// Where results computed here are valid: `cpu`, or `gpu:adapter:driver`.
    pub fn realm(&self) -> String {
        #[cfg(feature = "gpu")]
        if let Some(on) = &self.gpu {
            return on.gpu.name().realm();
        }
        CPU_REALM.to_string()
    }

    /// Projects, sorts and bins a scene.
    ///
    /// # Panics
    /// When the scene is ragged ([`Scene::validate`]): a caller's bug.
    pub fn frame(
        &self,
        scene: &Scene,
        camera: &Camera,
        options: &RenderOptions,
        outputs: Outputs,
    ) -> Result<Frame, DeviceError> {
        #[cfg(feature = "gpu")]
        if let Some(on) = self.gpu.as_ref().filter(|on| !on.gone.load(Ordering::Relaxed)) {
            match crate::gpu::Frame::new(&on.gpu, scene, camera, options, outputs) {
                Ok(frame) => {
                    return Ok(Frame::Gpu(Box::new(GpuFrame {
                        on: Arc::clone(on),
                        frame,
                        camera: *camera,
                        options: *options,
                        outputs,
                    })));
                }
                Err(error) => on.fall_back(&error)?,
            }
        }
        let frame = cpu::Frame::new(scene, camera, options, outputs);
        Ok(Frame::Cpu(Box::new(frame)))
    }

    /// Renders a scene. Invalid Gaussians are left out; see [`Scene::count_invalid`].
    ///
    /// # Panics
    /// When the scene is ragged ([`Scene::validate`]): a caller's bug.
    pub fn render(
        &self,
        scene: &Scene,
        camera: &Camera,
        options: &RenderOptions,
        outputs: Outputs,
    ) -> Result<Rendering, DeviceError> {
        self.frame(scene, camera, options, outputs)?.draw(scene)
    }
}

fn instead(cause: &str) -> String {
    format!("{cause}; the CPU is used instead")
}

#[cfg(feature = "gpu")]
impl OnGpu {
    /// What one frame asks too much of may do for the next; after anything else the GPU is not asked again.
    fn fall_back(&self, error: &crate::gpu::GpuError) -> Result<(), DeviceError> {
        let cause = error.to_string();
        if !self.fallback.allowed {
            return Err(DeviceError { cause });
        }
        if !matches!(error, crate::gpu::GpuError::Limit { .. }) {
            self.gone.store(true, Ordering::Relaxed);
        }
        if !self.told.swap(true, Ordering::Relaxed) {
            (self.fallback.tell)(&instead(&cause));
        }
        Ok(())
    }
}

/// A scene seen by a camera, ready to be drawn.
pub enum Frame {
    /// On the CPU.
    Cpu(Box<cpu::Frame>),
    /// On a GPU.
    #[cfg(feature = "gpu")]
    Gpu(Box<GpuFrame>),
}

/// A frame on a GPU, and what it takes to go on without it.
#[cfg(feature = "gpu")]
pub struct GpuFrame {
    on: Arc<OnGpu>,
    frame: crate::gpu::Frame,
    camera: Camera,
    options: RenderOptions,
    outputs: Outputs,
}

impl Frame {
    /// Takes the scene's colours anew. Everything else of the scene must be as it was.
    pub fn recolor(&mut self, scene: &Scene) {
        match self {
            Self::Cpu(frame) => frame.recolor(scene),
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => gpu.frame.recolor(scene),
        }
    }

    /// The pictures that were wanted. `scene` is the one that the frame shows.
    pub fn draw(&mut self, scene: &Scene) -> Result<Rendering, DeviceError> {
        #[cfg(feature = "gpu")]
        if let Self::Gpu(gpu) = self {
            match gpu.frame.draw() {
                Ok(rendering) => return Ok(rendering),
                Err(error) => gpu.on.fall_back(&error)?,
            }
        }
        Ok(self.on_cpu(scene).draw())
    }

    /// Derivatives of a loss by the scene, from its derivatives by the pixels of `rendering`, which must be what
    /// [`Frame::draw`] gave.
    ///
    /// # Panics
    /// When a picture that has gradients was not wanted, or a gradient has not one entry a pixel: a caller's bug.
    pub fn backward(
        &mut self,
        scene: &Scene,
        rendering: &Rendering,
        pixels: &PixelGradients,
        wanted: Wanted,
    ) -> Result<SceneGradients, DeviceError> {
        #[cfg(feature = "gpu")]
        if let Self::Gpu(gpu) = self {
            match gpu.frame.backward(scene, rendering, pixels, wanted) {
                Ok(gradients) => return Ok(gradients),
                Err(error) => gpu.on.fall_back(&error)?,
            }
        }
        Ok(self.on_cpu(scene).backward(scene, rendering, pixels, wanted))
    }

    fn on_cpu(&mut self, #[cfg_attr(not(feature = "gpu"), expect(unused))] scene: &Scene) -> &cpu::Frame {
        #[cfg(feature = "gpu")]
        if let Self::Gpu(gpu) = self {
            let frame = cpu::Frame::new(scene, &gpu.camera, &gpu.options, gpu.outputs);
            *self = Self::Cpu(Box::new(frame));
        }
        match self {
            Self::Cpu(frame) => frame,
            #[cfg(feature = "gpu")]
            Self::Gpu(_) => unreachable!("the frame was moved to the CPU above"),
        }
    }
}

#[cfg(feature = "graph")]
impl From<DeviceError> for gear_graph::NodeError {
    fn from(error: DeviceError) -> Self {
        Self::new(error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_choice_is_read_as_it_is_written() {
        for choice in [
            DeviceChoice::Auto,
            DeviceChoice::Cpu,
            DeviceChoice::Gpu(None),
            DeviceChoice::Gpu(Some("Radeon: RX".into())),
        ] {
            assert_eq!(choice.to_string().parse(), Ok(choice));
        }
        for wrong in ["", "GPU", "gpu:", "cuda", "cpu:0", "auto:x"] {
            assert!(
                wrong.parse::<DeviceChoice>().unwrap_err().contains("gpu:NAME"),
                "{wrong}"
            );
        }
    }

    #[test]
    fn the_cpu_needs_nothing() {
        let device = Device::open(&DeviceChoice::Cpu, Fallback::forbidden()).unwrap();
        assert_eq!(device.realm(), "cpu");
    }
}
