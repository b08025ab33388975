//! Stage 2: front to back. A stable radix sort, four bits a pass: reduce, scan, scatter.

use wgpu::Buffer;

use super::device::{Kernel, Recording};
use super::{GpuError, scan};

const SOURCE: &[&str] = &[include_str!("sort.wgsl")];
const COUNT: Kernel = Kernel::new(SOURCE, "count");
const SCATTER: Kernel = Kernel::new(SOURCE, "scatter");

/// Items a workgroup handles.
const BLOCK: usize = 2048;
const DIGIT_BITS: u32 = 4;

/// Keys, and what moves with them.
pub(super) struct Sorted {
    pub keys: Buffer,
    pub items: Buffer,
}

/// Orders `len` items by the lowest `bits` of their keys; equal keys keep their order.
pub(super) fn stable(recording: &mut Recording, mut from: Sorted, len: usize, bits: u32) -> Result<Sorted, GpuError> {
    let gpu = recording.gpu;
    let blocks = len.div_ceil(BLOCK);
    let mut to = Sorted {
        keys: gpu.buffer(len)?,
        items: gpu.buffer(len)?,
    };
    let digits = blocks << DIGIT_BITS;
    let starts = gpu.buffer(digits)?;
    for shift in (0..bits).step_by(DIGIT_BITS as usize) {
        let pass = gpu.uniform(&[len as u32, shift, blocks as u32, 0]);
        recording.run(COUNT, blocks, &[(0, &pass), (1, &from.keys), (5, &starts)]);
        scan::exclusive(recording, &starts, digits)?;
        let buffers = [
            (0, &pass),
            (1, &from.keys),
            (2, &from.items),
            (3, &to.keys),
            (4, &to.items),
            (5, &starts),
        ];
        recording.run(SCATTER, blocks, &buffers);
        std::mem::swap(&mut from, &mut to);
    }
    Ok(from)
}
