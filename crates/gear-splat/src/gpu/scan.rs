//! Exclusive sums of u32, in place.

use wgpu::Buffer;

use super::GpuError;
use super::device::{Kernel, Recording};

const SOURCE: &[&str] = &[include_str!("scan.wgsl")];
const REDUCE: Kernel = Kernel::new(SOURCE, "reduce");
const SCAN: Kernel = Kernel::new(SOURCE, "scan");

/// Numbers a workgroup handles.
const BLOCK: usize = 2048;

/// Replaces each of the buffer's `len` numbers by the sum of those before it.
pub(super) fn exclusive(recording: &mut Recording, values: &Buffer, len: usize) -> Result<(), GpuError> {
    let blocks = len.div_ceil(BLOCK);
    // A single block starts from the zero that the buffer comes with.
    let sums = recording.gpu.buffer(blocks)?;
    if blocks > 1 {
        recording.run(REDUCE, blocks, &[(0, values), (1, &sums)]);
        exclusive(recording, &sums, blocks)?;
    }
    recording.run(SCAN, blocks, &[(0, values), (1, &sums)]);
    Ok(())
}
