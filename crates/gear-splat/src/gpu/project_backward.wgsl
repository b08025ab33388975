// Stage 6: the slots of a Gaussian are added up in order, and the chain rule leads from its ellipse on the screen back to
// the Gaussian in the world. Needs common, footprint, plane, sh,
// raw_color.
//
// Let W be the whitening, z = W (x − m), and a_k = σ_k t_k the axes on the screen, Σ = Σ_k a_k a_kᵀ + δ·1 = (WᵀW)⁻¹. With
// the moments H = Σ h, μ = Σ h z and M = Σ h z zᵀ of h = ∂ℓ/∂(log α),
//
// ∂ℓ/∂m = Wᵀ μ,   ∂ℓ = ½ tr(M W ∂Σ Wᵀ),   so ∂ℓ/∂a_k = Wᵀ M W a_k and ∂ℓ/∂(log σ_k) = (W a_k)ᵀ M (W a_k).
//
// W a_k is never longer than 1, so that needles and giants keep all their digits in f32. The filter that keeps a
// Gaussian's weight adds ½ H (log det₀ − log det): M loses H·1, and det₀ gives H Σ₀⁻¹ a_k, taken as a sum of
// cross products.
//
// A surfel's plane has slope = F⁻¹ Σ_k p_k c_k. With λ = F⁻¹ ∂ℓ/∂slope, ∂ℓ/∂p_k = λ (c_k − p_k·slope) − slope (λ·p_k) and
// ∂ℓ/∂c_k = λ·p_k.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> gaussians: array<Gaussian>;
@group(0) @binding(2) var<storage, read> harmonics: array<f32>;
@group(0) @binding(3) var<storage, read> order: array<u32>;
@group(0) @binding(4) var<storage, read> offsets: array<u32>;
@group(0) @binding(5) var<storage, read> sums: array<f32>;
// For every Gaussian the derivatives by centre, log scale, quaternion and logit: 11 numbers.
@group(0) @binding(6) var<storage, read_write> by_shape: array<f32>;
// As `harmonics`.
@group(0) @binding(7) var<storage, read_write> by_harmonics: array<f32>;

override SHAPE: bool = true;
override SURFACE: bool = false;

struct Sums {
    color: vec3<f32>,
    moment: f32,
    moments: vec2<f32>,
    squares: vec3<f32>,
    depth: vec2<f32>,
    plane: vec3<f32>,
    normal: vec3<f32>,
}

@compute @workgroup_size(64)
fn project_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                    @builtin(local_invocation_index) local: u32) {
    let rank = group_index(group, groups) * 64u + local;
    // What touches no tile keeps the zeros that the buffers come with.
    if rank >= view.count || offsets[rank] == offsets[rank + 1u] {
        return;
    }
    let i = order[rank];
    let gaussian = gaussians[i];
    let total = add_up(offsets[rank], offsets[rank + 1u]);
    let by_direction = color(i, gaussian.point_logit.xyz, total.color);
    if SHAPE {
        shape(i, gaussian, total, by_direction);
    }
}

fn add_up(first: u32, end: u32) -> Sums {
    var total = Sums();
    for (var slot = first; slot < end; slot++) {
        let at = slot * select(select(3u, 9u, SHAPE), 17u, SURFACE);
        total.color += vec3(sums[at], sums[at + 1u], sums[at + 2u]);
        if SHAPE {
            total.moment += sums[at + 3u];
            total.moments += vec2(sums[at + 4u], sums[at + 5u]);
            total.squares += vec3(sums[at + 6u], sums[at + 7u], sums[at + 8u]);
        }
        if SURFACE {
            total.depth += vec2(sums[at + 9u], sums[at + 10u]);
            total.plane += vec3(sums[at + 11u], sums[at + 12u], sums[at + 13u]);
            total.normal += vec3(sums[at + 14u], sums[at + 15u], sums[at + 16u]);
        }
    }
    return total;
}

// A gradient that overflows is no direction to go.
fn finite(x: f32) -> f32 {
    return select(0.0, x, (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u);
}

// Writes the derivatives by the harmonics; returns the derivative by the centre, in camera space, through the direction.
fn color(i: u32, point: vec3<f32>, by_shown: vec3<f32>) -> vec3<f32> {
    let shown = raw_color(i, point);
    let by_color = select(vec3(0.0), by_shown, shown >= vec3(0.0));
    let at = i * view.sh_stride;
    for (var c = 0u; c < 3u; c++) {
        by_harmonics[at + c] = finite(by_color[c] * Y0);
    }
    if view.sh_degree == 0u {
        return vec3(0.0);
    }
    let direction = direction_to(point);
    var basis = sh_basis(view.sh_degree, direction);
    var slopes = sh_basis_gradient(view.sh_degree, direction);
    let bands = (view.sh_stride - 3u) / 3u;
    var by_direction = vec3(0.0);
    for (var c = 0u; c < 3u; c++) {
        for (var k = 0u; k < bands; k++) {
            let n = at + 3u + c * bands + k;
            by_harmonics[n] = finite(by_color[c] * basis[k]);
            by_direction += slopes[k] * (by_color[c] * harmonics[n]);
        }
    }
    if !is_pinhole(view) {
        return vec3(0.0);
    }
    // direction = p / |p|.
    let across = by_direction - direction * dot(direction, by_direction);
    let most = max(point.z, max(abs(point.x), abs(point.y)));
    return to_camera(view, across) / (most * length(point / most));
}

fn shape(i: u32, gaussian: Gaussian, total: Sums, by_direction: vec3<f32>) {
    let f = footprint(view, gaussian);
    let w = whitening(f);
    var by = ByPlane();
    if SURFACE {
        by = surface(f, gaussian.log_scale_valid.xyz, total);
    }
    let by_mean = unwhiten(w, total.moments) + by.mean;
    let by_logit = total.moment / (1.0 + exponential(gaussian.point_logit.w));

    var squares = total.squares;
    if keeps_weight(view) {
        squares -= vec3(total.moment, 0.0, total.moment);
    }
    var by_log_scale: vec3<f32>;
    var by_axes: mat3x3<f32>;
    var by_jacobian = array<vec3<f32>, 2>(vec3(0.0), vec3(0.0));
    for (var k = 0; k < 3; k++) {
        let a = f.spread[k] * f.unit;
        let white = vec2(a.x - w.shear * a.y, a.y) * w.inverse;
        let turned = vec2(squares.x * white.x + squares.y * white.y, squares.y * white.x + squares.z * white.y);
        by_log_scale[k] = dot(white, turned);
        var by_spread = unwhiten(w, turned);
        if keeps_weight(view) && f.before > 0.0 {
            // Σ₀⁻¹ a_k = Σ_l u_l (u_l·a_k) / det₀ with u = (a.y, −a.x).
            for (var l = 0; l < 3; l++) {
                let area = cross2(f.spread[k], f.spread[l]);
                by_log_scale[k] += total.moment * (area * (area / f.before));
                by_spread += vec2(f.spread[l].y, -f.spread[l].x) * (total.moment * (area / f.before) / f.unit);
            }
        }
        by_log_scale[k] += by.log_scale[k];
        let by_t = (by_spread + by.spread[k]) * f.sigma[k];
        by_axes[k] = vec3(by_t, -dot(f.slope, by_t)) * f.scale + by.axes[k];
        by_jacobian[0] += f.axes[k] * by_t.x;
        by_jacobian[1] += f.axes[k] * by_t.y;
    }

    var by_point = vec3(by_mean * f.scale, total.depth.x) + by_direction;
    if is_pinhole(view) {
        by_point += pinhole(f, by_mean, by_jacobian);
    }
    let center = to_world(view, by_point);
    let by_rotation = mat3x3<f32>(to_world(view, by_axes[0]), to_world(view, by_axes[1]), to_world(view, by_axes[2]));
    let rotation = quaternion(gaussian.rotation, by_rotation);
    let at = i * 11u;
    for (var k = 0u; k < 3u; k++) {
        by_shape[at + k] = finite(center[k]);
        by_shape[at + 3u + k] = finite(by_log_scale[k]);
    }
    for (var k = 0u; k < 4u; k++) {
        by_shape[at + 6u + k] = finite(rotation[k]);
    }
    by_shape[at + 10u] = finite(by_logit);
}

// Derivatives through the surfel's plane.
struct ByPlane {
    mean: vec2<f32>,
    log_scale: vec3<f32>,
    // By the axes on the screen, a_k.
    spread: array<vec2<f32>, 3>,
    // By the camera-space axes, other than through a_k.
    axes: array<vec3<f32>, 3>,
}

fn surface(f: Footprint, log_scale: vec3<f32>, total: Sums) -> ByPlane {
    var by: ByPlane;
    let p = plane(f);
    by.mean = -p.slope * total.plane.x;
    // λ · unit: F is in squares of the unit.
    let lambda = solve_plane(p, total.plane.yz, 1.0 / f.unit);
    var least = 2;
    for (var k = 0; k < 2; k++) {
        if f.sigma[k] < f.sigma[least] {
            least = k;
        }
    }
    for (var k = 0; k < 3; k++) {
        let z = f.axes[k].z;
        // λ·a_k, and how far the end of the axis lies behind the plane.
        let along = dot(lambda, f.spread[k]);
        let behind = f.sigma[k] * z - dot(p.slope, f.spread[k]) * f.unit;
        let left = p.left[k] * p.left[k];
        let by_flat = 2.0 * along * behind;
        let ratio = f.sigma[least] / f.sigma[k];
        by.log_scale[k] += by_flat;
        by.log_scale[least] -= by_flat * ratio * ratio;
        by.spread[k] = (lambda * (behind / f.unit) - p.slope * along) * left;
        by.axes[k].z = f.sigma[k] * left * along;
        if p.deviation > 0.0 {
            // reach = c·√(Σ_k σ_k² m_kz²).
            let share = f.sigma[k] * z / p.deviation;
            let by_reach = REACH_SIGMAS * total.depth.y * share * f.sigma[k];
            by.log_scale[k] += by_reach * z;
            by.axes[k].z += by_reach;
        }
    }
    let axis = thinnest_axis(log_scale);
    by.axes[axis] += to_camera(view, total.normal) * towards_camera(view, f, axis);
    return by;
}

// Wᵀ v.
fn unwhiten(w: Whitening, v: vec2<f32>) -> vec2<f32> {
    let x = w.inverse.x * v.x;
    return vec2(x, w.inverse.y * v.y - w.shear * x);
}

// The derivative by the camera-space centre through z of the mean and through the Jacobian.
fn pinhole(f: Footprint, by_mean: vec2<f32>, by_jacobian: array<vec3<f32>, 2>) -> vec3<f32> {
    let p = f.point;
    // mean = principal + s·(x, y), s = f/z.
    var out = vec3(0.0, 0.0, -f.scale * dot(by_mean, p.xy / p.z));
    var by = by_jacobian;
    for (var row = 0; row < 2; row++) {
        out.z -= (by[row][row] - f.slope[row] * by[row].z) * (f.scale / p.z);
        if abs(p[row] / p.z) <= view.limit[row] {
            let by_slope = -f.scale * by[row].z;
            out[row] += by_slope / p.z;
            out.z -= by_slope * f.slope[row] / p.z;
        }
    }
    return out;
}

// From the rotation matrix to the quaternion as stored: R(q/|q|).
fn quaternion(stored: vec4<f32>, m: mat3x3<f32>) -> vec4<f32> {
    let long = quaternion_length(stored);
    let q = stored / long;
    // m[column][row]
    let by_unit = vec4(
        -4.0 * q.x * (m[1][1] + m[2][2])
            + 2.0 * (q.y * (m[1][0] + m[0][1]) + q.z * (m[2][0] + m[0][2]) + q.w * (m[1][2] - m[2][1])),
        -4.0 * q.y * (m[0][0] + m[2][2])
            + 2.0 * (q.x * (m[1][0] + m[0][1]) + q.z * (m[2][1] + m[1][2]) + q.w * (m[2][0] - m[0][2])),
        -4.0 * q.z * (m[0][0] + m[1][1])
            + 2.0 * (q.x * (m[2][0] + m[0][2]) + q.y * (m[2][1] + m[1][2]) + q.w * (m[0][1] - m[1][0])),
        2.0 * (q.x * (m[1][2] - m[2][1]) + q.y * (m[2][0] - m[0][2]) + q.z * (m[0][1] - m[1][0])),
    );
    return (by_unit - q * dot(q, by_unit)) / long;
}
