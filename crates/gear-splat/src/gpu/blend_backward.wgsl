// Stage 5: from derivatives by pixels to derivatives by ellipses. Needs common, tiles, surface. The formulae are
// those of cpu/blend_backward.rs, with the moments of the whitened offset z instead of e and d.
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
@group(0) @binding(3) var<storage, read> surfaces: array<Surface>;
@group(0) @binding(4) var<storage, read> owners: array<u32>;
@group(0) @binding(5) var<storage, read> slots: array<u32>;
@group(0) @binding(6) var<storage, read> ranges: array<vec2<u32>>;
// Planes: the derivative g by red, green, blue; what every Gaussian's sᵢ shares, g_A − g·b; S; and with SURFACE g_D / W,
// D, and the derivative by N.
@group(0) @binding(7) var<storage, read> loss: array<f32>;
// For every slot Σ w g; with SHAPE Σ h, Σ h z, Σ h z zᵀ; and with SURFACE, u = w g_D / W, Σ u, Σ ±u where the plane is
// held, Σ u, Σ u dx, Σ u dy where it is not, and Σ w ∂ℓ/∂N.
@group(0) @binding(8) var<storage, read_write> sums: array<f32>;

override SHAPE: bool = true;
// Implies SHAPE.
override SURFACE: bool = false;

const LANES: u32 = 64u;
const GROUPS: u32 = 64u;
const EACH: u32 = 4u;

var<workgroup> transmittance: array<f32, 256>;
// Rᵢ: what is still to come behind.
var<workgroup> remaining: array<f32, 256>;
var<workgroup> by_pixel: array<vec4<f32>, 256>;
// The derivative by N and g_D / W; D.
var<workgroup> by_surface: array<vec4<f32>, 256>;
var<workgroup> mean_depth: array<f32, 256>;

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

    let first = ranges[tile].x;
    let count = ranges[tile].y;
    let steps = (count + LANES - 1u) / LANES * GROUPS + LANES - 1u;
    var live = false;
    var slot = 0u;
    var splat = Splat();
    var color = vec3(0.0);
    var by_color = vec3(0.0);
    var moment = 0.0;
    var moments = vec2(0.0);
    var squares = vec3(0.0);
    var surface = Surface();
    var depth_sums = vec2(0.0);
    var plane_sums = vec3(0.0);
    var by_normal = vec3(0.0);
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
                    if SURFACE {
                        surface = surfaces[i];
                        depth_sums = vec2(0.0);
                        plane_sums = vec3(0.0);
                        by_normal = vec3(0.0);
                    }
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
                        var gain = dot(g.xyz, color) + g.w;
                        if SURFACE {
                            let n = by_surface[at];
                            let reach = surface.normal_reach.w;
                            let plane = dot(surface.slope, d);
                            let behind = clamp(plane, -reach, reach);
                            gain += n.w * (splat.depth + behind - mean_depth[at]) + dot(n.xyz, surface.normal_reach.xyz);
                            let u = w * n.w;
                            by_normal += n.xyz * w;
                            if behind == plane {
                                depth_sums.x += u;
                                plane_sums += vec3(1.0, d) * u;
                            } else {
                                depth_sums += vec2(1.0, sign(plane)) * u;
                            }
                        }
                        let s = w * gain;
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
                    let at = slot * stride();
                    write3(at, by_color);
                    if SHAPE {
                        write3(at + 3u, vec3(moment, moments));
                        write3(at + 6u, squares);
                    }
                    if SURFACE {
                        sums[at + 9u] = depth_sums.x;
                        sums[at + 10u] = depth_sums.y;
                        write3(at + 11u, plane_sums);
                        write3(at + 14u, by_normal);
                    }
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
    if SURFACE {
        let n = source + 7u * pixels;
        by_surface[at] = vec4(loss[n], loss[n + pixels], loss[n + 2u * pixels], loss[source + 5u * pixels]);
        mean_depth[at] = loss[source + 6u * pixels];
    }
}

// Numbers a slot.
fn stride() -> u32 {
    return select(select(3u, 9u, SHAPE), 17u, SURFACE);
}

fn write3(at: u32, value: vec3<f32>) {
    sums[at] = value.x;
    sums[at + 1u] = value.y;
    sums[at + 2u] = value.z;
}
