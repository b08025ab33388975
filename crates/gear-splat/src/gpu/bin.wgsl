// Stage 3: which Gaussians touch which tile, front to back within each. Needs common, tiles.
//
// The Gaussians, front to back, get consecutive slots, one for each tile they touch (`offset`, then a scan). `emit`
// writes the tile of every slot; a stable sort by tile then keeps the order of depths; `find` looks up where each tile
// begins. A Gaussian's slots stay together: the gradient writes there, and no atomic is needed to add them up.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> order: array<u32>;
@group(0) @binding(2) var<storage, read> counts: array<u32>;
@group(0) @binding(3) var<storage, read> splats: array<Splat>;
// First slot of the Gaussian at each rank, and one past the last.
@group(0) @binding(4) var<storage, read_write> offsets: array<u32>;
@group(0) @binding(5) var<storage, read_write> tiles: array<u32>;
@group(0) @binding(6) var<storage, read_write> slots: array<u32>;
// Which Gaussian a slot belongs to; for `find`, where each tile begins in the sorted list.
@group(0) @binding(7) var<storage, read_write> owners: array<u32>;

@compute @workgroup_size(256)
fn offset(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
          @builtin(local_invocation_index) local: u32) {
    let rank = group_index(group, groups) * 256u + local;
    if rank < view.count {
        offsets[rank] = counts[order[rank]];
    }
}

@compute @workgroup_size(256)
fn emit(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
        @builtin(local_invocation_index) local: u32) {
    let rank = group_index(group, groups) * 256u + local;
    if rank >= view.count {
        return;
    }
    let i = order[rank];
    var slot = offsets[rank];
    let end = offsets[rank + 1u];
    if slot == end {
        return;
    }
    let splat = splats[i];
    let rows = tile_rows(view, splat);
    for (var row = rows.x; row <= rows.y; row++) {
        let columns = tile_columns(view, splat, row);
        for (var column = columns.x; column <= columns.y && slot < end; column++) {
            tiles[slot] = row * view.grid.x + column;
            slots[slot] = slot;
            owners[slot] = i;
            slot++;
        }
    }
    // `project` counted with the same functions; should a driver compile them to other bits, no slot is left open.
    for (; slot < end; slot++) {
        tiles[slot] = view.grid.x * view.grid.y;
        slots[slot] = slot;
        owners[slot] = i;
    }
}
