// Which tiles an ellipse touches: for every row of tiles, the columns between its left- and rightmost point there.

struct Splat {
    mean: vec2<f32>,
    shear: f32,
    // The largest |z|² at which α ≥ 1/255; negative if it is not seen.
    cutoff: f32,
    inverse: vec2<f32>,
    opacity: f32,
    depth: f32,
}

// First and last tile that hold the pixels from low to high; the first is larger than the last if there are none.
fn tiles_between(low: f32, high: f32, side: u32) -> vec2<u32> {
    // A little slack: every pixel is tested again.
    let first = max(ceil(low - 1e-2), 0.0);
    let last = min(floor(high + 1e-2), f32(side) - 1.0);
    if !(first <= last) {
        return vec2(1u, 0u);
    }
    return vec2(u32(first) / TILE, u32(last) / TILE);
}

fn tile_rows(view: View, splat: Splat) -> vec2<u32> {
    let half = sqrt(splat.cutoff) / splat.inverse.y;
    return tiles_between(splat.mean.y - half, splat.mean.y + half, view.size.y);
}

fn tile_columns(view: View, splat: Splat, row: u32) -> vec2<u32> {
    let sigma = 1.0 / splat.inverse;
    let reach = sqrt(splat.cutoff);
    let half = reach * sigma.y;
    let low = max(f32(row * TILE) - splat.mean.y, -half);
    let high = min(f32(row * TILE + TILE - 1u) - splat.mean.y, half);
    // The rightmost point of the whole ellipse lies at y = Σxy·√(cutoff/Σxx), the leftmost opposite.
    let drift = splat.shear * sigma.y;
    let most = max(abs(drift), sigma.x);
    let total = most * length(vec2(drift, sigma.x) / most);
    let y_right = half * (drift / total);
    let right_at = clamp(y_right, low, high);
    let left_at = clamp(-y_right, low, high);
    let right = splat.shear * right_at + sigma.x * rest_of_reach(splat.cutoff, right_at * splat.inverse.y);
    let left = splat.shear * left_at - sigma.x * rest_of_reach(splat.cutoff, left_at * splat.inverse.y);
    return tiles_between(splat.mean.x + left, splat.mean.x + right, view.size.x);
}

fn rest_of_reach(cutoff: f32, z: f32) -> f32 {
    return sqrt(max(cutoff - z * z, 0.0));
}
