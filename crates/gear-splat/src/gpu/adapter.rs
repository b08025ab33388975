//! Which GPUs there are.

use wgpu::{Adapter, AdapterInfo, Backends, DeviceType, Instance, InstanceDescriptor, InstanceFlags};

use super::GpuError;

/// Least limits that the kernels need, all of them WebGPU's defaults.
const STORAGE_BUFFERS: u32 = 8;
const WORKGROUP_BYTES: u32 = 16 << 10;
const INVOCATIONS: u32 = 256;
const WORKGROUPS: u32 = 65_535;

/// A GPU as people know it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterName {
    /// The device.
    pub device: String,
    /// The driver and its version.
    pub driver: String,
    /// True for a CPU that plays GPU.
    pub software: bool,
}

impl AdapterName {
    fn of(info: &AdapterInfo) -> Self {
        let driver = [info.driver.as_str(), info.driver_info.as_str()];
        Self {
            device: info.name.clone(),
            driver: driver
                .into_iter()
                .filter(|s| !s.is_empty())
                .collect::<Vec<_>>()
                .join(" "),
            software: info.device_type == DeviceType::Cpu,
        }
    }

    /// Where results computed there are valid.
    pub fn realm(&self) -> String {
        format!("gpu:{}:{}", self.device, self.driver)
    }
}

/// All adapters, the most able first: discrete, integrated, others, software.
fn adapters() -> Vec<(AdapterName, Adapter)> {
    // Neither the driver's validation nor debug names, which cost time in every call; our own tests find mistakes.
    let instance = Instance::new(InstanceDescriptor {
        backends: Backends::VULKAN | Backends::METAL | Backends::DX12,
        flags: InstanceFlags::empty(),
        ..InstanceDescriptor::new_without_display_handle()
    });
    let mut found = pollster::block_on(instance.enumerate_adapters(Backends::all()));
    found.sort_by_key(|adapter| match adapter.get_info().device_type {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu | DeviceType::Other => 2,
        DeviceType::Cpu => 3,
    });
    let named = |adapter: Adapter| (AdapterName::of(&adapter.get_info()), adapter);
    found.into_iter().map(named).collect()
}

/// The names of all adapters, the most able first.
pub fn names() -> Vec<AdapterName> {
    adapters().into_iter().map(|(name, _)| name).collect()
}

/// False where the system cannot have a GPU that is worth a look: asking drivers costs up to half a second, and some talk
/// to standard error when there is no display. On Linux a GPU has a render node, NVIDIA's own device or WSL's.
pub(crate) fn may_be_there() -> bool {
    let nodes = ["/dev/dri", "/dev/nvidia0", "/dev/dxg"];
    !cfg!(target_os = "linux") || nodes.into_iter().any(|node| std::path::Path::new(node).exists())
}

/// The first adapter whose name contains `wanted`, upper or lower case, or the most able one.
pub(super) fn find(wanted: Option<&str>) -> Result<(AdapterName, Adapter), GpuError> {
    let mut found = adapters();
    let names: Vec<String> = found.iter().map(|(name, _)| name.device.clone()).collect();
    let fits =
        |name: &AdapterName| wanted.is_none_or(|wanted| name.device.to_lowercase().contains(&wanted.to_lowercase()));
    match found.iter().position(|(name, _)| fits(name)) {
        Some(at) => Ok(found.swap_remove(at)),
        None if names.is_empty() => Err(GpuError::NoAdapter),
        None => Err(GpuError::NoSuchAdapter {
            wanted: wanted.unwrap_or_default().to_string(),
            found: names,
        }),
    }
}

/// What is asked of the device: WebGPU's defaults, with buffers as large as the adapter has them.
pub(super) fn limits(name: &AdapterName, adapter: &Adapter) -> Result<wgpu::Limits, GpuError> {
    let has = adapter.limits();
    for (what, found, needed) in [
        (
            "storage buffers a stage",
            has.max_storage_buffers_per_shader_stage,
            STORAGE_BUFFERS,
        ),
        (
            "bytes of workgroup memory",
            has.max_compute_workgroup_storage_size,
            WORKGROUP_BYTES,
        ),
        (
            "threads a workgroup",
            has.max_compute_invocations_per_workgroup,
            INVOCATIONS,
        ),
        (
            "workgroups a dimension",
            has.max_compute_workgroups_per_dimension,
            WORKGROUPS,
        ),
    ] {
        if found < needed {
            return Err(GpuError::Limit {
                adapter: name.device.clone(),
                what,
                found: found.into(),
                needed: needed.into(),
            });
        }
    }
    Ok(wgpu::Limits {
        max_buffer_size: has.max_buffer_size,
        max_storage_buffer_binding_size: has.max_storage_buffer_binding_size,
        ..wgpu::Limits::default()
    })
}
