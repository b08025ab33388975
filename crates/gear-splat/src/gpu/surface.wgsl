// Depth and normal of the plane of a surfel.

struct Surface {
    // World-space normal, turned to the camera; the plane's depth is held within this distance of the centre's.
    normal_reach: vec4<f32>,
    // Depth gained by a pixel to the right, and one down.
    slope: vec2<f32>,
    padding: vec2<f32>,
}
