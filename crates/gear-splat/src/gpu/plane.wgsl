// The planes of surfels, for depth and normals. Needs common, footprint.
//
// The plane of the two longer axes: taking the smallest variance away leaves a flat ellipse whose depth is a linear
// function of the pixel, slope = F⁻¹ Σ_k p_k c_k with p_k the flattened axis on the screen, c_k its extent in depth and
// F = Σ_k p_k p_kᵀ + floor.

// Standard deviations at which even an opaque Gaussian falls below 1/255.
const REACH_SIGMAS: f32 = 3.3290429;
// Variance in px² that keeps the slope of an edge-on surfel's plane finite.
const SLOPE_FLOOR: f32 = 1e-4;
// Below this cosine a surfel is seen edge-on, and keeps the side that its axis shows.
const EDGE_ON: f32 = 1e-5;

struct Plane {
    // Depth gained by a pixel to the right, and one down.
    slope: vec2<f32>,
    // √(1 − σ_min²/σ_k²): what is left of each axis.
    left: vec3<f32>,
    // Of the whole Gaussian in depth.
    deviation: f32,
    // p_k in units of the footprint, the floor there, and det F.
    flat: array<vec2<f32>, 3>,
    least_variance: f32,
    determinant: f32,
}

fn plane(f: Footprint) -> Plane {
    var out: Plane;
    let least = min(f.sigma.x, min(f.sigma.y, f.sigma.z));
    var along = vec3(0.0);
    var trace = 0.0;
    for (var k = 0; k < 3; k++) {
        let ratio = least / f.sigma[k];
        out.left[k] = sqrt(max((1.0 - ratio) * (1.0 + ratio), 0.0));
        out.flat[k] = f.spread[k] * out.left[k];
        along[k] = f.sigma[k] * out.left[k] * f.axes[k].z;
        trace += dot(out.flat[k], out.flat[k]);
    }
    let floor_sigma = sqrt(SLOPE_FLOOR) / f.unit;
    out.least_variance = max(floor_sigma * floor_sigma, 1e-18);
    let xy = cross2(out.flat[0], out.flat[1]);
    let xz = cross2(out.flat[0], out.flat[2]);
    let yz = cross2(out.flat[1], out.flat[2]);
    let crosses = xy * xy + xz * xz + yz * yz;
    out.determinant = crosses + out.least_variance * (trace + out.least_variance);
    var slope = vec2(0.0);
    for (var k = 0; k < 3; k++) {
        slope += solve_plane(out, out.flat[k], along[k]);
    }
    out.slope = slope / f.unit;

    let extent = f.sigma * vec3(f.axes[0].z, f.axes[1].z, f.axes[2].z);
    let most = max(max(abs(extent.x), abs(extent.y)), max(abs(extent.z), 1e-30));
    out.deviation = most * length(extent / most);
    return out;
}

// F⁻¹ v · by, in units of the footprint: adj(Σ_l p_l p_lᵀ + f·1) v = Σ_l u_l (u_l·v) + f·v with u = (p.y, −p.x), no
// difference of products of squares.
fn solve_plane(p: Plane, v: vec2<f32>, by: f32) -> vec2<f32> {
    var turned = v * p.least_variance;
    for (var l = 0; l < 3; l++) {
        turned += vec2(p.flat[l].y, -p.flat[l].x) * cross2(v, p.flat[l]);
    }
    return turned * (by / p.determinant);
}

// The axis of the smallest scale, the last among equals.
fn thinnest_axis(scale: vec3<f32>) -> i32 {
    if scale.z <= scale.x && scale.z <= scale.y {
        return 2;
    }
    return select(0, 1, scale.y <= scale.x);
}

// −1 where the axis points away from the camera.
fn towards_camera(view: View, f: Footprint, axis: i32) -> f32 {
    let sight = select(vec3(0.0, 0.0, 1.0), f.point, is_pinhole(view));
    return select(1.0, -1.0, dot(f.axes[axis], normalize(sight)) > EDGE_ON);
}
