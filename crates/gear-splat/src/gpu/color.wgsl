// Colours as the camera sees them, not below zero. Needs common, footprint, sh.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> gaussians: array<Gaussian>;
// For every Gaussian f_dc, then f_rest, channel-major.
@group(0) @binding(2) var<storage, read> harmonics: array<f32>;
@group(0) @binding(3) var<storage, read_write> colors: array<vec4<f32>>;

@compute @workgroup_size(256)
fn color(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
         @builtin(local_invocation_index) local: u32) {
    let i = group_index(group, groups) * 256u + local;
    if i >= view.count {
        return;
    }
    let gaussian = gaussians[i];
    var shown = vec3(0.0);
    if is_in_front(view, gaussian) {
        shown = max(raw_color(i, gaussian.point_logit.xyz), vec3(0.0));
    }
    colors[i] = vec4(shown, 0.0);
}
