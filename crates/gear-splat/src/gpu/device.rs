//! An open GPU: compiled kernels, buffers, and what went wrong.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError, mpsc};

use wgpu::{
    BufferDescriptor, BufferUsages, CommandEncoder, ComputePipeline, ComputePipelineDescriptor,
    PipelineCompilationOptions, PollType, ShaderModuleDescriptor, ShaderSource,
};

use super::adapter::{self, AdapterName};

/// Why something was not computed on a GPU.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// No driver offers a GPU.
    #[error("no GPU was found; a Vulkan, Metal or Direct3D 12 driver is needed")]
    NoAdapter,
    /// No GPU has that name.
    #[error("no GPU has `{wanted}` in its name; found: {}", found.join(", "))]
    NoSuchAdapter {
        /// What was asked for.
        wanted: String,
        /// What there is.
        found: Vec<String>,
    },
    /// A limit of the GPU is too small.
    #[error("{adapter} has {found} {what}, but {needed} are needed")]
    Limit {
        /// The GPU.
        adapter: String,
        /// What there is too little of.
        what: &'static str,
        /// How much there is.
        found: u64,
        /// How much is needed.
        needed: u64,
    },
    /// The driver reported an error, or the device went away.
    #[error("{adapter} failed: {cause}")]
    Failed {
        /// The GPU.
        adapter: String,
        /// What the driver said.
        cause: String,
    },
}

/// A kernel: an entry point of a module, with its constants.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Kernel {
    /// Parts of the module, which are joined.
    pub source: &'static [&'static str],
    pub entry: &'static str,
    /// Bits of the constants that are switched on.
    pub switches: u32,
    /// The constants, the lowest bit's first.
    pub constants: &'static [&'static str],
}

impl Kernel {
    pub const fn new(source: &'static [&'static str], entry: &'static str) -> Self {
        Self {
            source,
            entry,
            switches: 0,
            constants: &[],
        }
    }
}

/// An open GPU.
pub struct Gpu {
    name: AdapterName,
    device: wgpu::Device,
    queue: wgpu::Queue,
    largest_buffer: u64,
    kernels: Mutex<HashMap<Kernel, Arc<ComputePipeline>>>,
    failure: Arc<Mutex<Option<String>>>,
}

/// Keeps the first cause: those that follow are its consequences.
fn remember(failure: &Mutex<Option<String>>, cause: String) {
    failure
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .get_or_insert(cause);
}

impl Gpu {
    /// Opens the first GPU whose name contains `wanted`, or the most able one.
    pub fn open(wanted: Option<&str>) -> Result<Self, GpuError> {
        let (name, adapter) = adapter::find(wanted)?;
        let limits = adapter::limits(&name, &adapter)?;
        let opened = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("gear-splat"),
            required_limits: limits.clone(),
            ..Default::default()
        }));
        let (device, queue) = opened.map_err(|error| GpuError::Failed {
            adapter: name.device.clone(),
            cause: error.to_string(),
        })?;
        let failure = Arc::new(Mutex::new(None));
        let on_error = Arc::clone(&failure);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            remember(&on_error, error.to_string())
        }));
        let on_loss = Arc::clone(&failure);
        device.set_device_lost_callback(move |reason, message| {
            remember(
                &on_loss,
                format!("the device was lost ({reason:?}) {message}")
                    .trim_end()
                    .to_string(),
            );
        });
        Ok(Self {
            name,
            device,
            queue,
            largest_buffer: limits.max_storage_buffer_binding_size.min(limits.max_buffer_size),
            kernels: Mutex::default(),
            failure,
        })
    }

    /// The same device, with no buffer above so many bytes: leaves room for others.
    pub fn with_largest_buffer(mut self, bytes: u64) -> Self {
        self.largest_buffer = self.largest_buffer.min(bytes);
        self
    }

    /// What it is called.
    pub fn name(&self) -> &AdapterName {
        &self.name
    }

    /// Closes the device. Everything after that fails, as when a driver dies.
    pub fn close(&self) {
        self.device.destroy();
        remember(&self.failure, "the device was closed".to_string());
    }

    /// The first thing that went wrong.
    pub(super) fn check(&self) -> Result<(), GpuError> {
        match &*self.failure.lock().unwrap_or_else(PoisonError::into_inner) {
            None => Ok(()),
            Some(cause) => Err(self.failed(cause.clone())),
        }
    }

    fn failed(&self, cause: String) -> GpuError {
        GpuError::Failed {
            adapter: self.name.device.clone(),
            cause,
        }
    }

    /// A buffer of zeros for `words` numbers of 32 bits.
    pub(super) fn buffer(&self, words: usize) -> Result<wgpu::Buffer, GpuError> {
        let size = 4 * words.max(1) as u64;
        if size > self.largest_buffer {
            return Err(GpuError::Limit {
                adapter: self.name.device.clone(),
                what: "bytes a buffer",
                found: self.largest_buffer,
                needed: size,
            });
        }
        Ok(self.device.create_buffer(&BufferDescriptor {
            label: None,
            size,
            usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        }))
    }

    /// A buffer with a content.
    pub(super) fn upload<T: bytemuck::NoUninit>(&self, content: &[T]) -> Result<wgpu::Buffer, GpuError> {
        let bytes: &[u8] = bytemuck::cast_slice(content);
        let buffer = self.buffer(bytes.len() / 4)?;
        self.write(&buffer, bytes);
        Ok(buffer)
    }

    /// Changes the beginning of a buffer, before what is submitted next.
    pub(super) fn write<T: bytemuck::NoUninit>(&self, buffer: &wgpu::Buffer, content: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(content);
        if !bytes.is_empty() {
            self.queue.write_buffer(buffer, 0, bytes);
        }
    }

    /// A buffer of constants for a kernel.
    pub(super) fn uniform(&self, words: &[u32]) -> wgpu::Buffer {
        let buffer = self.device.create_buffer(&BufferDescriptor {
            label: None,
            size: 4 * words.len() as u64,
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.write(&buffer, words);
        buffer
    }

    pub(super) fn record(&self) -> Recording<'_> {
        Recording {
            gpu: self,
            encoder: self.device.create_command_encoder(&Default::default()),
        }
    }

    fn pipeline(&self, kernel: Kernel) -> Arc<ComputePipeline> {
        let mut kernels = self.kernels.lock().unwrap_or_else(PoisonError::into_inner);
        let compile = || {
            let module = self.device.create_shader_module(ShaderModuleDescriptor {
                label: Some(kernel.entry),
                source: ShaderSource::Wgsl(kernel.source.concat().into()),
            });
            let constants: Vec<(&str, f64)> = kernel
                .constants
                .iter()
                .enumerate()
                .map(|(bit, name)| (*name, f64::from(kernel.switches >> bit & 1)))
                .collect();
            Arc::new(self.device.create_compute_pipeline(&ComputePipelineDescriptor {
                label: Some(kernel.entry),
                layout: None,
                module: &module,
                entry_point: Some(kernel.entry),
                compilation_options: PipelineCompilationOptions {
                    constants: &constants,
                    // The kernels write their workgroup memory before they read it.
                    zero_initialize_workgroup_memory: false,
                },
                cache: None,
            }))
        };
        Arc::clone(kernels.entry(kernel).or_insert_with(compile))
    }

    /// The content of buffers, once everything submitted so far is done.
    pub(super) fn read<T: bytemuck::Pod>(&self, buffers: &[(&wgpu::Buffer, u64)]) -> Result<Vec<Vec<T>>, GpuError> {
        let mut recording = self.record();
        let mut copies = Vec::new();
        for &(buffer, from) in buffers {
            let size = buffer.size() - from;
            let copy = self.device.create_buffer(&BufferDescriptor {
                label: None,
                size,
                usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            recording.encoder.copy_buffer_to_buffer(buffer, from, &copy, 0, size);
            copies.push(copy);
        }
        recording.submit();
        self.check()?;
        let (sender, receiver) = mpsc::channel();
        for copy in &copies {
            let sender = sender.clone();
            copy.map_async(wgpu::MapMode::Read, .., move |result| {
                // The receiver is on this stack; it cannot be gone before the callback.
                let _ = sender.send(result);
            });
        }
        drop(sender);
        let waited = self.device.poll(PollType::wait_indefinitely());
        self.check()?;
        waited.map_err(|error| self.failed(error.to_string()))?;
        for result in receiver.iter().take(copies.len()) {
            result.map_err(|error| self.failed(error.to_string()))?;
        }
        let content = |copy: &wgpu::Buffer| {
            let view = copy
                .get_mapped_range(..)
                .map_err(|error| self.failed(error.to_string()))?;
            Ok(bytemuck::pod_collect_to_vec(&view))
        };
        copies.iter().map(content).collect()
    }
}

/// Commands that are being put together.
pub(super) struct Recording<'g> {
    pub gpu: &'g Gpu,
    encoder: CommandEncoder,
}

impl Recording<'_> {
    /// Runs `groups` workgroups of a kernel on buffers, given with their bindings.
    pub fn run(&mut self, kernel: Kernel, groups: usize, buffers: &[(u32, &wgpu::Buffer)]) {
        if groups == 0 {
            return;
        }
        let pipeline = self.gpu.pipeline(kernel);
        let entries: Vec<_> = buffers
            .iter()
            .map(|(binding, buffer)| wgpu::BindGroupEntry {
                binding: *binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        let group = self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(kernel.entry),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        let mut pass = self.encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        // A dimension holds 65535; the kernels count on in y and stop where their data ends.
        let columns = groups.min(65_535);
        pass.dispatch_workgroups(columns as u32, groups.div_ceil(columns) as u32, 1);
    }

    pub fn submit(self) {
        self.gpu.queue.submit([self.encoder.finish()]);
    }
}
