// Stage 4: compositing, front to back. A workgroup is a tile, a thread a pixel. Needs common, tiles, surface.
//
// For each pixel, over its Gaussians in order of depth: w = α·T, output += w·feature, T ← T·(1 − α). The tile's list is
// read in batches that all threads share; when no pixel can receive anything more, the tile ends, and tells how far
// it came, so that the gradient stops there too.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> splats: array<Splat>;
@group(0) @binding(2) var<storage, read> colors: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> surfaces: array<Surface>;
@group(0) @binding(4) var<storage, read> owners: array<u32>;
@group(0) @binding(5) var<storage, read> slots: array<u32>;
// Where each tile begins in the list, and how many entries it walked; the last one ends the list.
@group(0) @binding(6) var<storage, read_write> ranges: array<vec2<u32>>;
// One plane after the other, in the order red, green, blue, alpha, depth, median depth, normal x, y, z, and for
// the gradient Σ w and |Σ w n|. As bits: NaN stands for no depth, and WGSL does not promise to keep it as a number.
@group(0) @binding(7) var<storage, read_write> pictures: array<u32>;

override COLOR: bool = true;
override ALPHA: bool = true;
override DEPTH: bool = false;
override MEDIAN: bool = false;
override NORMAL: bool = false;
override SUMS: bool = false;

const BATCH: u32 = 128u;
const NOT_A_NUMBER: u32 = 0x7fc00000u;

var<workgroup> batch_splats: array<Splat, BATCH>;
var<workgroup> batch_colors: array<vec4<f32>, BATCH>;
var<workgroup> batch_normals: array<vec4<f32>, BATCH>;
var<workgroup> batch_slopes: array<vec2<f32>, BATCH>;
var<workgroup> alive: array<u32, 256>;
var<workgroup> any_alive: u32;
var<workgroup> list: vec2<u32>;

@compute @workgroup_size(256)
fn blend(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
         @builtin(local_invocation_index) local: u32) {
    let tile = group_index(group, groups);
    if tile >= view.grid.x * view.grid.y {
        return;
    }
    let corner = vec2(tile % view.grid.x, tile / view.grid.x) * TILE;
    let within = vec2(local % TILE, local / TILE);
    let inside = all(corner + within < view.size);
    let at = vec2<f32>(within);

    var transmittance = select(0.0, 1.0, inside);
    var color = vec3(0.0);
    // Σ w, for the mean depth: 1 − T would have lost its small digits.
    var weight = 0.0;
    var depth = 0.0;
    var median = NOT_A_NUMBER;
    var normal = vec3(0.0);

    if local == 0u {
        list = vec2(ranges[tile].x, ranges[tile + 1u].x);
    }
    let range = workgroupUniformLoad(&list);
    let first = range.x;
    let end = range.y;
    var next = first;
    while next < end {
        let count = min(BATCH, end - next);
        load(next, count, vec2<f32>(corner), local);
        workgroupBarrier();
        for (var n = 0u; n < count; n++) {
            if transmittance < TRANSMITTANCE_MIN {
                break;
            }
            let splat = batch_splats[n];
            let d = at - splat.mean;
            let z = vec2(d.x - splat.shear * d.y, d.y) * splat.inverse;
            let alpha = alpha_at(z, splat.opacity, transmittance);
            if alpha == 0.0 {
                continue;
            }
            let w = alpha * transmittance;
            let after = transmittance * (1.0 - alpha);
            if COLOR {
                color += batch_colors[n].xyz * w;
            }
            if DEPTH || MEDIAN || SUMS {
                let reach = batch_normals[n].w;
                let seen = splat.depth + clamp(dot(batch_slopes[n], d), -reach, reach);
                weight += w;
                depth += w * seen;
                if transmittance > 0.5 && after <= 0.5 {
                    median = bitcast<u32>(seen);
                }
            }
            if NORMAL || SUMS {
                normal += batch_normals[n].xyz * w;
            }
            transmittance = after;
        }
        next += count;
        if !someone_is_alive(transmittance, local) {
            break;
        }
    }
    if local == 0u {
        ranges[tile].y = next - first;
    }
    if !inside {
        return;
    }

    let pixels = view.size.x * view.size.y;
    var to = (corner.y + within.y) * view.size.x + corner.x + within.x;
    if COLOR {
        let shown = color + transmittance * view.background.xyz;
        pictures[to] = bitcast<u32>(shown.x);
        pictures[to + pixels] = bitcast<u32>(shown.y);
        pictures[to + 2u * pixels] = bitcast<u32>(shown.z);
        to += 3u * pixels;
    }
    if ALPHA {
        pictures[to] = bitcast<u32>(1.0 - transmittance);
        to += pixels;
    }
    if DEPTH {
        pictures[to] = select(NOT_A_NUMBER, bitcast<u32>(depth / max(weight, 1e-30)), weight > 0.0);
        to += pixels;
    }
    if MEDIAN {
        pictures[to] = median;
        to += pixels;
    }
    if NORMAL {
        let long = length(normal);
        let unit = select(vec3(0.0), normal / max(long, 1e-30), long > 0.0);
        pictures[to] = bitcast<u32>(unit.x);
        pictures[to + pixels] = bitcast<u32>(unit.y);
        pictures[to + 2u * pixels] = bitcast<u32>(unit.z);
        to += 3u * pixels;
    }
    if SUMS {
        pictures[to] = bitcast<u32>(weight);
        pictures[to + pixels] = bitcast<u32>(length(normal));
    }
}

// Half of the threads fetch splats and colours, the other half the planes. Centres become relative to the tile.
fn load(next: u32, count: u32, corner: vec2<f32>, local: u32) {
    let n = local % BATCH;
    if n >= count {
        return;
    }
    let i = owners[slots[next + n]];
    if local < BATCH {
        var splat = splats[i];
        splat.mean -= corner;
        batch_splats[n] = splat;
        if COLOR {
            batch_colors[n] = colors[i];
        }
    } else if DEPTH || MEDIAN || NORMAL || SUMS {
        let surface = surfaces[i];
        batch_normals[n] = surface.normal_reach;
        batch_slopes[n] = surface.slope;
    }
}

fn someone_is_alive(transmittance: f32, local: u32) -> bool {
    alive[local] = u32(transmittance >= TRANSMITTANCE_MIN);
    workgroupBarrier();
    if local < 16u {
        var found = 0u;
        for (var k = 0u; k < 16u; k++) {
            found |= alive[local * 16u + k];
        }
        // Row `local` is this thread's own.
        alive[local * 16u] = found;
    }
    workgroupBarrier();
    if local == 0u {
        var found = 0u;
        for (var k = 0u; k < 16u; k++) {
            found |= alive[k * 16u];
        }
        any_alive = found;
    }
    return workgroupUniformLoad(&any_alive) != 0u;
}
