// Stage 5: from derivatives by pixels to derivatives by ellipses. Needs common, tiles. The formulae are those of
// cpu/blend_backward.rs, with the moments of the whitened offset z instead of e and d.
//
// Sums over pixels are the trouble: one thread a pixel would have to add up hundreds of threads for every Gaussian, by
// atomics (whose order changes from run to run) or by a tree of barriers. Here a thread owns a Gaussian and the pixels
// pass by, like parts on a line. The tile's pixels are 64 groups of four; the workgroup's 64 threads hold 64 consecutive
// Gaussians. In step s thread j works on group s − j, so that every group meets the Gaussians one after the other, in
// order, and no two threads ever hold the same group. Thread j then takes Gaussian j + 64 and goes on: the line never
// empties before the list ends. What must stay true: one barrier a step; a group's transmittance and rest live in
// workgroup memory; a thread adds up its Gaussian's sums alone, over pixels in order, and writes them to the slot of
// this (tile, Gaussian) pair. So the bits are the same on every run.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> splats: array<Splat>;
@group(0) @binding(2) var<storage, read> colors: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> owners: array<u32>;
@group(0) @binding(4) var<storage, read> slots: array<u32>;
@group(0) @binding(5) var<storage, read> starts: array<u32>;
@group(0) @binding(6) var<storage, read> walked: array<u32>;
// Five planes: the derivative g by red, green, blue; what every Gaussian's sᵢ shares, g_A − g·b; and S.
@group(0) @binding(7) var<storage, read> loss: array<f32>;
// For every slot Σ w g, and then Σ h, Σ h z, Σ h z zᵀ.
@group(0) @binding(8) var<storage, read_write> sums: array<f32>;

override SHAPE: bool = true;

const LANES: u32 = 64u;
const GROUPS: u32 = 64u;
const EACH: u32 = 4u;

var<workgroup> transmittance: array<f32, 256>;
// Rᵢ: what is still to come behind.
var<workgroup> remaining: array<f32, 256>;
var<workgroup> by_pixel: array<vec4<f32>, 256>;

@compute @workgroup_size(64)
fn blend_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) lane: u32) {
    let tile = group_index(group, groups);
    if tile >= view.grid.x * view.grid.y {
        return;
    }
    let corner = vec2(tile % view.grid.x, tile / view.grid.x) * TILE;
    for (var k = 0u; k < EACH; k++) {
        load_pixel(corner, lane * EACH + k);
    }
    workgroupBarrier();

    let first = starts[tile];
    let count = walked[tile];
    let steps = (count + LANES - 1u) / LANES * GROUPS + LANES - 1u;
    var live = false;
    var slot = 0u;
    var splat = Splat();
    var color = vec3(0.0);
    var by_color = vec3(0.0);
    var moment = 0.0;
    var moments = vec2(0.0);
    var squares = vec3(0.0);
    for (var step = 0u; step < steps; step++) {
        if step >= lane {
            let position = step - lane;
            let pixels = position % GROUPS;
            if pixels == 0u {
                let n = position / GROUPS * LANES + lane;
                live = n < count;
                if live {
                    slot = slots[first + n];
                    let i = owners[slot];
                    splat = splats[i];
                    splat.mean -= vec2<f32>(corner);
                    color = colors[i].xyz;
                    by_color = vec3(0.0);
                    moment = 0.0;
                    moments = vec2(0.0);
                    squares = vec3(0.0);
                }
            }
            if live {
                for (var k = 0u; k < EACH; k++) {
                    let at = pixels * EACH + k;
                    let before = transmittance[at];
                    let d = vec2<f32>(vec2(at % TILE, at / TILE)) - splat.mean;
                    let z = vec2(d.x - splat.shear * d.y, d.y) * splat.inverse;
                    let alpha = alpha_at(z, splat.opacity, before);
                    if alpha == 0.0 {
                        continue;
                    }
                    let w = alpha * before;
                    transmittance[at] = before * (1.0 - alpha);
                    let g = by_pixel[at];
                    by_color += g.xyz * w;
                    if SHAPE {
                        let s = w * (dot(g.xyz, color) + g.w);
                        let rest = remaining[at] - s;
                        remaining[at] = rest;
                        // Where α is held at 0.99 it depends on nothing.
                        let h = select(0.0, s - rest * (alpha / (1.0 - alpha)), alpha < ALPHA_MAX);
                        moment += h;
                        moments += z * h;
                        squares += vec3(z.x * z.x, z.x * z.y, z.y * z.y) * h;
                    }
                }
                if pixels == GROUPS - 1u {
                    write_sums(slot, by_color, moment, moments, squares);
                }
            }
        }
        workgroupBarrier();
    }
}

fn load_pixel(corner: vec2<u32>, at: u32) {
    let pixel = corner + vec2(at % TILE, at / TILE);
    if any(pixel >= view.size) {
        transmittance[at] = 0.0;
        return;
    }
    let pixels = view.size.x * view.size.y;
    let source = pixel.y * view.size.x + pixel.x;
    transmittance[at] = 1.0;
    by_pixel[at] = vec4(loss[source], loss[source + pixels], loss[source + 2u * pixels], loss[source + 3u * pixels]);
    remaining[at] = loss[source + 4u * pixels];
}

fn write_sums(slot: u32, by_color: vec3<f32>, moment: f32, moments: vec2<f32>, squares: vec3<f32>) {
    let at = slot * select(3u, 9u, SHAPE);
    sums[at] = by_color.x;
    sums[at + 1u] = by_color.y;
    sums[at + 2u] = by_color.z;
    if SHAPE {
        sums[at + 3u] = moment;
        sums[at + 4u] = moments.x;
        sums[at + 5u] = moments.y;
        sums[at + 6u] = squares.x;
        sums[at + 7u] = squares.y;
        sums[at + 8u] = squares.z;
    }
}
