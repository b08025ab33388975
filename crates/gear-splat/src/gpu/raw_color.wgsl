// Colour of a Gaussian before it is held above zero. Needs a module with `view` and `harmonics`.

// Unit direction from the camera to a camera-space point, in the world.
fn direction_to(point: vec3<f32>) -> vec3<f32> {
    if is_pinhole(view) {
        let most = max(point.z, max(abs(point.x), abs(point.y)));
        return to_world(view, normalize(point / most));
    }
    return view.rotation[2].xyz;
}

fn raw_color(i: u32, point: vec3<f32>) -> vec3<f32> {
    let at = i * view.sh_stride;
    var color = vec3(harmonics[at], harmonics[at + 1u], harmonics[at + 2u]) * Y0 + 0.5;
    if view.sh_degree > 0u {
        var basis = sh_basis(view.sh_degree, direction_to(point));
        let bands = (view.sh_stride - 3u) / 3u;
        for (var c = 0u; c < 3u; c++) {
            var sum = 0.0;
            for (var k = 0u; k < bands; k++) {
                sum += harmonics[at + 3u + c * bands + k] * basis[k];
            }
            color[c] += sum;
        }
    }
    return color;
}
