// What every stage shares: the view, ids of workgroups beyond 65535, the exponential.

struct View {
    // Rows of the rotation from world to camera.
    rotation: array<vec4<f32>, 3>,
    principal: vec2<f32>,
    // Focal length in pixels, or pixels a world unit.
    scale: f32,
    near: f32,
    // Largest |x/z| and |y/z| at which the Jacobian is taken.
    limit: vec2<f32>,
    // Variance that the screen filter adds, px².
    filter_variance: f32,
    // Bit 0: pinhole. Bit 1: the filter keeps a Gaussian's weight.
    flags: u32,
    size: vec2<u32>,
    // Columns and rows of tiles.
    grid: vec2<u32>,
    // Number of Gaussians.
    count: u32,
    sh_degree: u32,
    // Number of (tile, Gaussian) pairs.
    pairs: u32,
    // 32-bit words between the colours of two Gaussians.
    sh_stride: u32,
    background: vec4<f32>,
}

const TILE: u32 = 16u;
const ALPHA_MIN: f32 = 1.0 / 255.0;
const ALPHA_MAX: f32 = 0.99;
const TRANSMITTANCE_MIN: f32 = 1e-4;

fn is_pinhole(view: View) -> bool {
    return (view.flags & 1u) != 0u;
}

fn keeps_weight(view: View) -> bool {
    return (view.flags & 2u) != 0u;
}

// Workgroups come in rows of at most 65535.
fn group_index(group: vec3<u32>, groups: vec3<u32>) -> u32 {
    return group.x + group.y * groups.x;
}

// eˣ for |x| ≤ 87, within 2 ulp; e⁰ = 1 exactly. The same polynomial as on the CPU: WGSL's own may be off by 3 + 2|x| ulp.
fn exponential(x: f32) -> f32 {
    let t = clamp(x, -87.0, 87.0);
    let n = round(t * 1.44269504);
    let r = (t - n * 0.693359375) - n * -2.1219444e-4;
    var p = 1.9875691e-4;
    p = p * r + 1.3981999e-3;
    p = p * r + 8.333452e-3;
    p = p * r + 4.1665796e-2;
    p = p * r + 0.16666666;
    p = p * r + 0.5;
    p = p * (r * r) + r + 1.0;
    return bitcast<f32>(bitcast<u32>(p) + (u32(i32(n)) << 23u));
}

// α of a pixel at the whitened offset z from a Gaussian's centre; zero where it is not covered, and where the
// transmittance before it says that the pixel is finished.
fn alpha_at(z: vec2<f32>, opacity: f32, before: f32) -> f32 {
    let a = min(opacity * exponential(-0.5 * (z.x * z.x + z.y * z.y)), ALPHA_MAX);
    return select(0.0, a, a >= ALPHA_MIN && before >= TRANSMITTANCE_MIN);
}

fn cross2(a: vec2<f32>, b: vec2<f32>) -> f32 {
    return a.x * b.y - a.y * b.x;
}
