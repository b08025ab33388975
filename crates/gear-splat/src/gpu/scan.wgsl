// Exclusive sums of u32, in place: reduce, scan the sums of the blocks, then scan every block from its sum on. Sums stop
// at 2³² − 1, so that a total that is too large is seen instead of wrapping round. (min(a + b, top) is associative.)

const THREADS: u32 = 256u;
const EACH: u32 = 8u;

@group(0) @binding(0) var<storage, read_write> values: array<u32>;
// One a block.
@group(0) @binding(1) var<storage, read_write> sums: array<u32>;

var<workgroup> partial: array<u32, 256>;

fn add(a: u32, b: u32) -> u32 {
    let sum = a + b;
    return select(sum, 0xffffffffu, sum < a);
}

fn value(i: u32) -> u32 {
    if i < arrayLength(&values) {
        return values[i];
    }
    return 0u;
}

fn own_sum(first: u32) -> u32 {
    var sum = 0u;
    for (var k = 0u; k < EACH; k++) {
        sum = add(sum, value(first + k));
    }
    return sum;
}

@compute @workgroup_size(256)
fn reduce(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
          @builtin(local_invocation_index) local: u32) {
    let block = group.x + group.y * groups.x;
    partial[local] = own_sum((block * THREADS + local) * EACH);
    workgroupBarrier();
    for (var half = THREADS / 2u; half > 0u; half /= 2u) {
        if local < half {
            partial[local] = add(partial[local], partial[local + half]);
        }
        workgroupBarrier();
    }
    if local == 0u && block < arrayLength(&sums) {
        sums[block] = partial[0];
    }
}

@compute @workgroup_size(256)
fn scan(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
        @builtin(local_invocation_index) local: u32) {
    let block = group.x + group.y * groups.x;
    let first = (block * THREADS + local) * EACH;
    var own = own_sum(first);
    partial[local] = own;
    workgroupBarrier();
    for (var step = 1u; step < THREADS; step *= 2u) {
        var before = 0u;
        if local >= step {
            before = partial[local - step];
        }
        workgroupBarrier();
        partial[local] = add(partial[local], before);
        workgroupBarrier();
    }
    if block >= arrayLength(&sums) {
        return;
    }
    var total = sums[block];
    if local > 0u {
        total = add(total, partial[local - 1u]);
    }
    for (var k = 0u; k < EACH && first + k < arrayLength(&values); k++) {
        let next = add(total, values[first + k]);
        values[first + k] = total;
        total = next;
    }
}
