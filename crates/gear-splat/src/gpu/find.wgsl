// Where each tile begins in the list of pairs sorted by tile. Needs common.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> tiles: array<u32>;
@group(0) @binding(2) var<storage, read_write> ranges: array<vec2<u32>>;

@compute @workgroup_size(256)
fn find(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
        @builtin(local_invocation_index) local: u32) {
    let tile = group_index(group, groups) * 256u + local;
    if tile > view.grid.x * view.grid.y {
        return;
    }
    var low = 0u;
    var high = view.pairs;
    while low < high {
        let middle = low + (high - low) / 2u;
        if tiles[middle] < tile {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    ranges[tile] = vec2(low, 0u);
}
