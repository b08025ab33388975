// One pass of a stable radix sort by four bits. A block of 2048 items counts its digits (`count`), the counts of all
// blocks are scanned digit by digit, and each block writes its items from there (`scatter`). Nobody waits for another
// workgroup: a scan that looks back over running workgroups deadlocks where the driver does not run them all.

const THREADS: u32 = 256u;
const EACH: u32 = 8u;
const SEGMENTS: u32 = 32u;

struct Pass {
    count: u32,
    shift: u32,
    blocks: u32,
}

@group(0) @binding(0) var<uniform> work: Pass;
@group(0) @binding(1) var<storage, read> keys: array<u32>;
@group(0) @binding(2) var<storage, read> items: array<u32>;
@group(0) @binding(3) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(4) var<storage, read_write> items_out: array<u32>;
// [digit · blocks + block]
@group(0) @binding(5) var<storage, read_write> starts: array<u32>;

// Counts of the 16 digits by thread, two in a word: row r holds digits 2r and 2r + 1. A block has fewer than 2¹⁶ items.
var<workgroup> counts: array<u32, 2048>;
// Row r is cut into 32 segments of 8 threads.
var<workgroup> segments: array<u32, 256>;

fn digit_of(key: u32) -> u32 {
    return (key >> work.shift) & 15u;
}

// Leaves each thread's counts in `counts` and the sums of segments in `segments`.
fn count_digits(block: u32, local: u32) {
    var own: array<u32, 8>;
    let first = (block * THREADS + local) * EACH;
    for (var k = 0u; k < EACH; k++) {
        if first + k < work.count {
            let digit = digit_of(keys[first + k]);
            own[digit / 2u] += 1u << (16u * (digit & 1u));
        }
    }
    for (var row = 0u; row < 8u; row++) {
        counts[row * THREADS + local] = own[row];
    }
    workgroupBarrier();
    var sum = 0u;
    for (var k = 0u; k < 8u; k++) {
        sum += counts[local * 8u + k];
    }
    segments[local] = sum;
    workgroupBarrier();
}

@compute @workgroup_size(256)
fn count(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
         @builtin(local_invocation_index) local: u32) {
    let block = group.x + group.y * groups.x;
    count_digits(block, local);
    if local < 8u && block < work.blocks {
        var sum = 0u;
        for (var k = 0u; k < SEGMENTS; k++) {
            sum += segments[local * SEGMENTS + k];
        }
        starts[2u * local * work.blocks + block] = sum & 0xffffu;
        starts[(2u * local + 1u) * work.blocks + block] = sum >> 16u;
    }
}

@compute @workgroup_size(256)
fn scatter(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
           @builtin(local_invocation_index) local: u32) {
    let block = group.x + group.y * groups.x;
    count_digits(block, local);
    // Sums of the segments before, within the row.
    let segment = local % SEGMENTS;
    for (var step = 1u; step < SEGMENTS; step *= 2u) {
        var before = 0u;
        if segment >= step {
            before = segments[local - step];
        }
        workgroupBarrier();
        segments[local] += before;
        workgroupBarrier();
    }
    var running = 0u;
    if segment > 0u {
        running = segments[local - 1u];
    }
    for (var k = 0u; k < 8u; k++) {
        let at = local * 8u + k;
        let own = counts[at];
        counts[at] = running;
        running += own;
    }
    workgroupBarrier();
    var places: array<u32, 16>;
    for (var row = 0u; row < 8u; row++) {
        let before = counts[row * THREADS + local];
        places[2u * row] = before & 0xffffu;
        places[2u * row + 1u] = before >> 16u;
    }
    let first = (block * THREADS + local) * EACH;
    for (var k = 0u; k < EACH; k++) {
        if first + k < work.count {
            let key = keys[first + k];
            let digit = digit_of(key);
            let to = starts[digit * work.blocks + block] + places[digit];
            places[digit] += 1u;
            keys_out[to] = key;
            items_out[to] = items[first + k];
        }
    }
}
