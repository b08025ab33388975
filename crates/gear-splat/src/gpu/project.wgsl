// Stage 1: every Gaussian becomes an ellipse on the screen. Needs common, footprint, tiles.

// Depth and normal of the plane of a surfel.
struct Surface {
    // World-space normal, turned to the camera; the plane's depth is held within this distance of the centre's.
    normal_reach: vec4<f32>,
    // Depth gained by a pixel to the right, and one down.
    slope: vec2<f32>,
    padding: vec2<f32>,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> gaussians: array<Gaussian>;
@group(0) @binding(2) var<storage, read_write> splats: array<Splat>;
// Depths as integers of the same order, 2³² − 1 where nothing is seen; the Gaussians that they belong to.
@group(0) @binding(3) var<storage, read_write> keys: array<u32>;
@group(0) @binding(4) var<storage, read_write> order: array<u32>;
// Tiles touched.
@group(0) @binding(5) var<storage, read_write> counts: array<u32>;
@group(0) @binding(6) var<storage, read_write> surfaces: array<Surface>;

override SURFACES: bool = false;

const REACH_SIGMAS: f32 = 3.3290429;
const EDGE_ON: f32 = 1e-5;
// Variance in px² that keeps the slope of an edge-on surfel's plane finite.
const SLOPE_FLOOR: f32 = 1e-4;

@compute @workgroup_size(256)
fn project(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
           @builtin(local_invocation_index) local: u32) {
    let i = group_index(group, groups) * 256u + local;
    if i >= view.count {
        return;
    }
    let gaussian = gaussians[i];
    let splat = see(gaussian);
    splats[i] = splat;
    order[i] = i;
    if splat.cutoff < 0.0 {
        keys[i] = 0xffffffffu;
        counts[i] = 0u;
        return;
    }
    keys[i] = ordered(splat.depth);
    var count = 0u;
    let rows = tile_rows(view, splat);
    for (var row = rows.x; row <= rows.y; row++) {
        let columns = tile_columns(view, splat, row);
        count += columns.y + 1u - min(columns.x, columns.y + 1u);
    }
    counts[i] = count;
    if SURFACES {
        surfaces[i] = surface(gaussian);
    }
}

fn unseen() -> Splat {
    return Splat(vec2(0.0), 0.0, -1.0, vec2(0.0), 0.0, 0.0);
}

fn see(gaussian: Gaussian) -> Splat {
    if !is_in_front(view, gaussian) {
        return unseen();
    }
    let f = footprint(view, gaussian);
    let opacity = opacity_on_screen(view, f, gaussian.point_logit.w);
    if !(opacity >= ALPHA_MIN) {
        return unseen();
    }
    let cutoff = max(2.0 * log(255.0 * opacity), 0.0);
    let half = sqrt(cutoff * vec2(f.covariance.x, f.covariance.z)) * f.unit;
    if any(f.mean + half < vec2(0.0)) || any(f.mean - half > vec2<f32>(view.size) - 1.0) {
        return unseen();
    }
    let w = whitening(f);
    return Splat(f.mean, w.shear, cutoff, w.inverse, opacity, f.point.z);
}

// Maps an f32 to a u32 of the same order: negatives are flipped whole, the others get the sign bit.
fn ordered(x: f32) -> u32 {
    let bits = bitcast<u32>(x);
    if bits == 0x80000000u {
        return 0x80000000u; // −0 is 0
    }
    return select(bits | 0x80000000u, ~bits, (bits >> 31u) == 1u);
}

// The plane of the two longer axes: taking the smallest variance away leaves a flat ellipse whose depth is a linear
// function of the pixel, slope = Σ'⁻¹ Σ_k F_k d_k with F_k the flattened axis on the screen and d_k its extent in depth.
fn surface(gaussian: Gaussian) -> Surface {
    let f = footprint(view, gaussian);
    let least = min(f.sigma.x, min(f.sigma.y, f.sigma.z));
    var flat: array<vec2<f32>, 3>;
    var depth: vec3<f32>;
    var trace = 0.0;
    for (var k = 0; k < 3; k++) {
        let ratio = least / f.sigma[k];
        let left = sqrt(max((1.0 - ratio) * (1.0 + ratio), 0.0));
        flat[k] = f.spread[k] * left;
        depth[k] = f.sigma[k] * left * f.axes[k].z;
        trace += dot(flat[k], flat[k]);
    }
    let floor_sigma = sqrt(SLOPE_FLOOR) / f.unit;
    let least_variance = max(floor_sigma * floor_sigma, 1e-18);
    let xy = cross2(flat[0], flat[1]);
    let xz = cross2(flat[0], flat[2]);
    let yz = cross2(flat[1], flat[2]);
    let determinant = xy * xy + xz * xz + yz * yz + least_variance * (trace + least_variance);
    // adj(Σ_l F_l F_lᵀ + f·1) G = Σ_l u_l (u_l·G) + f·G with u = (F.y, −F.x): no difference of products of squares.
    var slope = vec2(0.0);
    for (var k = 0; k < 3; k++) {
        var turned = flat[k] * least_variance;
        for (var l = 0; l < 3; l++) {
            turned += vec2(flat[l].y, -flat[l].x) * cross2(flat[k], flat[l]);
        }
        slope += turned * (depth[k] / determinant);
    }

    let extent = f.sigma * vec3(f.axes[0].z, f.axes[1].z, f.axes[2].z);
    let most = max(max(abs(extent.x), abs(extent.y)), max(abs(extent.z), 1e-30));
    let reach = min(REACH_SIGMAS * most * length(extent / most), 1e30);
    let axis = thinnest_axis(f.axes, gaussian.log_scale_valid.xyz);
    let sight = select(vec3(0.0, 0.0, 1.0), f.point, is_pinhole(view));
    let outward = select(axis, -axis, dot(axis, normalize(sight)) > EDGE_ON);
    return Surface(vec4(to_world(view, outward), reach), slope / f.unit, vec2(0.0));
}

// The axis of the smallest scale, the last among equals.
fn thinnest_axis(axes: mat3x3<f32>, scale: vec3<f32>) -> vec3<f32> {
    if scale.z <= scale.x && scale.z <= scale.y {
        return axes[2];
    }
    if scale.y <= scale.x {
        return axes[1];
    }
    return axes[0];
}
