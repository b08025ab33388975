// Stage 1: every Gaussian becomes an ellipse on the screen. Needs common, footprint, plane, tiles, surface.

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

fn surface(gaussian: Gaussian) -> Surface {
    let f = footprint(view, gaussian);
    let p = plane(f);
    let axis = thinnest_axis(gaussian.log_scale_valid.xyz);
    let outward = f.axes[axis] * towards_camera(view, f, axis);
    let reach = min(REACH_SIGMAS * p.deviation, 1e30);
    return Surface(vec4(to_world(view, outward), reach), p.slope, vec2(0.0));
}
