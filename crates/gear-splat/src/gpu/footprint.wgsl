// A Gaussian as an ellipse on the screen (EWA splatting), in f32.
//
// The CPU takes f64 here. What f32 would lose is kept by three habits. Lengths are divided by the longest of them before
// they are squared, so that neither 1e30 nor 1e-30 leaves the range. Determinants are sums of squares of cross
// products (Cauchy–Binet), which do not cancel. The centre arrives in camera space, rounded once, from the host: a
// scene may lie at 1e6 with details of 1e-3, and the order of depths must be the CPU's.

// 12 words a Gaussian.
struct Gaussian {
    // Camera-space centre, and the logit of the opacity.
    point_logit: vec4<f32>,
    // Logarithms of the standard deviations; 1 if every number is finite and the quaternion has a direction.
    log_scale_valid: vec4<f32>,
    // x, y, z, w, of any length.
    rotation: vec4<f32>,
}

struct Footprint {
    point: vec3<f32>,
    // s and the clamped slopes of J = [s 0 −s·slope.x; 0 s −s·slope.y].
    scale: f32,
    slope: vec2<f32>,
    mean: vec2<f32>,
    // Camera-space unit axes, one a column.
    axes: mat3x3<f32>,
    sigma: vec3<f32>,
    // The longest length below, px; the rest is in its units.
    unit: f32,
    // Projected axes times their standard deviations: Σ = Σ_k spread_k spread_kᵀ + dilation.
    spread: array<vec2<f32>, 3>,
    dilation: f32,
    // Σxx, Σxy, Σyy with the dilation.
    covariance: vec3<f32>,
    // det before the dilation, and after.
    before: f32,
    after: f32,
}

// The quaternion's length; its largest component is taken out before anything is squared.
fn quaternion_length(q: vec4<f32>) -> f32 {
    let most = max(max(abs(q.x), abs(q.y)), max(abs(q.z), abs(q.w)));
    return most * length(q / most);
}

fn rotation_matrix(stored: vec4<f32>) -> mat3x3<f32> {
    let most = max(max(abs(stored.x), abs(stored.y)), max(abs(stored.z), abs(stored.w)));
    let q = normalize(stored / most);
    return mat3x3<f32>(
        vec3(1.0 - 2.0 * (q.y * q.y + q.z * q.z), 2.0 * (q.x * q.y + q.w * q.z), 2.0 * (q.x * q.z - q.w * q.y)),
        vec3(2.0 * (q.x * q.y - q.w * q.z), 1.0 - 2.0 * (q.x * q.x + q.z * q.z), 2.0 * (q.y * q.z + q.w * q.x)),
        vec3(2.0 * (q.x * q.z + q.w * q.y), 2.0 * (q.y * q.z - q.w * q.x), 1.0 - 2.0 * (q.x * q.x + q.y * q.y)),
    );
}

fn to_camera(view: View, v: vec3<f32>) -> vec3<f32> {
    return vec3(dot(view.rotation[0].xyz, v), dot(view.rotation[1].xyz, v), dot(view.rotation[2].xyz, v));
}

fn to_world(view: View, v: vec3<f32>) -> vec3<f32> {
    return view.rotation[0].xyz * v.x + view.rotation[1].xyz * v.y + view.rotation[2].xyz * v.z;
}

// False where the camera cannot see it at all.
fn is_in_front(view: View, gaussian: Gaussian) -> bool {
    let point = gaussian.point_logit.xyz;
    if gaussian.log_scale_valid.w != 1.0 || (is_pinhole(view) && point.z < view.near) {
        return false;
    }
    // Beyond this even a Gaussian of the largest size does not reach the picture, and f32 would overflow.
    let s = select(view.scale, view.scale / point.z, is_pinhole(view));
    let far = min(1e31, 1e36 / s);
    return abs(point.x) < far && abs(point.y) < far;
}

fn footprint(view: View, gaussian: Gaussian) -> Footprint {
    var out: Footprint;
    out.point = gaussian.point_logit.xyz;
    out.scale = view.scale;
    if is_pinhole(view) {
        out.scale = view.scale / out.point.z;
        out.slope = clamp(out.point.xy / out.point.z, -view.limit, view.limit);
    }
    out.mean = view.principal + out.point.xy * out.scale;

    let own = rotation_matrix(gaussian.rotation);
    out.axes = mat3x3<f32>(to_camera(view, own[0]), to_camera(view, own[1]), to_camera(view, own[2]));
    let largest = min(1e30, 1e35 / out.scale);
    let log_scale = clamp(gaussian.log_scale_valid.xyz, vec3(-69.0775528), vec3(69.0775528));
    let sigma = vec3(exponential(log_scale.x), exponential(log_scale.y), exponential(log_scale.z));
    out.sigma = min(sigma, vec3(largest));

    out.unit = sqrt(view.filter_variance);
    for (var k = 0; k < 3; k++) {
        let m = out.axes[k];
        out.spread[k] = (m.xy - out.slope * m.z) * (out.scale * out.sigma[k]);
        out.unit = max(out.unit, max(abs(out.spread[k].x), abs(out.spread[k].y)));
    }
    // The floor counts beyond 5e8 px only.
    let filter_sigma = sqrt(view.filter_variance) / out.unit;
    out.dilation = max(filter_sigma * filter_sigma, 1e-18);
    var covariance = vec3(0.0);
    for (var k = 0; k < 3; k++) {
        let a = out.spread[k] / out.unit;
        out.spread[k] = a;
        covariance += vec3(a.x * a.x, a.x * a.y, a.y * a.y);
    }
    let xy = cross2(out.spread[0], out.spread[1]);
    let xz = cross2(out.spread[0], out.spread[2]);
    let yz = cross2(out.spread[1], out.spread[2]);
    out.before = xy * xy + xz * xz + yz * yz;
    out.after = out.before + out.dilation * (covariance.x + covariance.z) + out.dilation * out.dilation;
    out.covariance = covariance + vec3(out.dilation, 0.0, out.dilation);
    return out;
}

// Opacity at the centre of the ellipse.
fn opacity_on_screen(view: View, f: Footprint, logit: f32) -> f32 {
    let opacity = 1.0 / (1.0 + exponential(-logit));
    return select(opacity, opacity * sqrt(f.before / f.after), keeps_weight(view));
}

// The ellipse whitens offsets from its centre: z = (inverse.x·(dx − shear·dy), inverse.y·dy), α = opacity·exp(−½|z|²).
struct Whitening {
    shear: f32,
    inverse: vec2<f32>,
}

fn whitening(f: Footprint) -> Whitening {
    let sigma_y = sqrt(f.covariance.z);
    let sigma_x = sqrt(f.after) / sigma_y;
    return Whitening(f.covariance.y / f.covariance.z, vec2(1.0 / sigma_x, 1.0 / sigma_y) / f.unit);
}
