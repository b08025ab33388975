// Real spherical harmonics up to degree 3, in the signs and order of 3DGS; see sh.rs.

const Y0: f32 = 0.28209479;
const Y1: f32 = 0.48860251;

// The basis functions above the constant one at unit direction d.
fn sh_basis(degree: u32, d: vec3<f32>) -> array<f32, 15> {
    var y: array<f32, 15>;
    if degree >= 1u {
        y[0] = -Y1 * d.y;
        y[1] = Y1 * d.z;
        y[2] = -Y1 * d.x;
    }
    let xx = d.x * d.x;
    let yy = d.y * d.y;
    let zz = d.z * d.z;
    if degree >= 2u {
        y[3] = 1.09254843 * d.x * d.y;
        y[4] = -1.09254843 * d.y * d.z;
        y[5] = 0.31539157 * (2.0 * zz - xx - yy);
        y[6] = -1.09254843 * d.x * d.z;
        y[7] = 0.54627422 * (xx - yy);
    }
    if degree >= 3u {
        y[8] = -0.59004359 * d.y * (3.0 * xx - yy);
        y[9] = 2.89061144 * d.x * d.y * d.z;
        y[10] = -0.45704580 * d.y * (4.0 * zz - xx - yy);
        y[11] = 0.37317633 * d.z * (2.0 * zz - 3.0 * xx - 3.0 * yy);
        y[12] = -0.45704580 * d.x * (4.0 * zz - xx - yy);
        y[13] = 1.44530572 * d.z * (xx - yy);
        y[14] = -0.59004359 * d.x * (xx - 3.0 * yy);
    }
    return y;
}

// Its derivatives by the components of d, taken as free variables.
fn sh_basis_gradient(degree: u32, d: vec3<f32>) -> array<vec3<f32>, 15> {
    var g: array<vec3<f32>, 15>;
    let x = d.x;
    let y = d.y;
    let z = d.z;
    if degree >= 1u {
        g[0] = vec3(0.0, -Y1, 0.0);
        g[1] = vec3(0.0, 0.0, Y1);
        g[2] = vec3(-Y1, 0.0, 0.0);
    }
    let xx = x * x;
    let yy = y * y;
    let zz = z * z;
    if degree >= 2u {
        g[3] = 1.09254843 * vec3(y, x, 0.0);
        g[4] = -1.09254843 * vec3(0.0, z, y);
        g[5] = 0.31539157 * vec3(-2.0 * x, -2.0 * y, 4.0 * z);
        g[6] = -1.09254843 * vec3(z, 0.0, x);
        g[7] = 0.54627422 * vec3(2.0 * x, -2.0 * y, 0.0);
    }
    if degree >= 3u {
        g[8] = -0.59004359 * vec3(6.0 * x * y, 3.0 * (xx - yy), 0.0);
        g[9] = 2.89061144 * vec3(y * z, x * z, x * y);
        g[10] = -0.45704580 * vec3(-2.0 * x * y, 4.0 * zz - xx - 3.0 * yy, 8.0 * y * z);
        g[11] = 0.37317633 * vec3(-6.0 * x * z, -6.0 * y * z, 6.0 * zz - 3.0 * (xx + yy));
        g[12] = -0.45704580 * vec3(4.0 * zz - 3.0 * xx - yy, -2.0 * x * y, 8.0 * x * z);
        g[13] = 1.44530572 * vec3(2.0 * x * z, -2.0 * y * z, xx - yy);
        g[14] = -0.59004359 * vec3(3.0 * (xx - yy), -6.0 * x * y, 0.0);
    }
    return g;
}
