//! Orthographic and pinhole cameras: projection, rays, orbits.

use glam::{Mat3, Vec3};
use serde::{Deserialize, Serialize};

use crate::Bounds;

/// Distance of [`Camera::front`] from the plane z = 0, world units. It only shifts depths, which stay positive for
/// scenes of a painting's size; an orthographic camera has no near plane.
pub const FRONT_DISTANCE: f32 = 2.0;

/// How camera space is brought to pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Projection {
    /// Parallel rays: `u = cx + x · pixels_per_unit`, `v = cy + y · pixels_per_unit`.
    Orthographic {
        /// Pixels a world unit spans.
        pixels_per_unit: f32,
    },
    /// Rays through the camera centre: `u = cx + focal_px · x / z`, `v = cy + focal_px · y / z`.
    Pinhole {
        /// Focal length in pixels.
        focal_px: f32,
    },
}

impl Projection {
    /// So many times as many pixels.
    fn magnified(self, factor: f64) -> Self {
        let scale = |s: f32| (f64::from(s) * factor) as f32;
        match self {
            Self::Orthographic { pixels_per_unit } => Self::Orthographic {
                pixels_per_unit: scale(pixels_per_unit),
            },
            Self::Pinhole { focal_px } => Self::Pinhole {
                focal_px: scale(focal_px),
            },
        }
    }
}

/// A camera: a rigid world-to-camera motion (`p_cam = rotation · p_world + translation`) and a projection.
///
/// Camera space has x right, y down, z forward. Pixel centres have integer coordinates: pixel (0, 0) covers
/// [−½, ½)², so a picture W wide that is centred has `cx = (W − 1) / 2`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// World to camera.
    pub rotation: Mat3,
    /// World to camera, world units.
    pub translation: Vec3,
    /// Projection to pixels.
    pub projection: Projection,
    /// Principal point (cx, cy) in pixels.
    pub principal: [f32; 2],
    /// Picture width in pixels.
    pub width: u32,
    /// Picture height in pixels.
    pub height: u32,
}

/// Where a world point falls in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected {
    /// Pixel coordinates (u right, v down); pixel centres are integers.
    pub pixel: [f32; 2],
    /// Depth along the camera's z axis, world units.
    pub depth: f32,
}

/// A half line in world space. `direction` advances one unit of depth, so `origin + direction · depth` is the
/// point seen at that depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Point of depth zero.
    pub origin: Vec3,
    /// Displacement for one unit of depth.
    pub direction: Vec3,
}

impl Camera {
    /// The canonical orthographic camera of a painting: pixel (i, j) sees world x = (i − (W−1)/2) / max(W, H),
    /// y = −(j − (H−1)/2) / max(W, H), looking along −z.
    pub fn front(width: u32, height: u32) -> Self {
        Self {
            rotation: Mat3::from_diagonal(Vec3::new(1.0, -1.0, -1.0)),
            translation: Vec3::new(0.0, 0.0, FRONT_DISTANCE),
            projection: Projection::Orthographic {
                pixels_per_unit: width.max(height) as f32,
            },
            principal: centred(width, height),
            width,
            height,
        }
    }

    /// A pinhole camera that sees the plane z = 0 exactly as [`Camera::front`] does. `fov_radians` is the angle
    /// under which the longer side is seen.
    pub fn front_pinhole(width: u32, height: u32, fov_radians: f32) -> Self {
        let longer = width.max(height) as f32;
        let focal_px = (0.5 * f64::from(longer) / libm::tan(0.5 * f64::from(fov_radians))) as f32;
        Self {
            translation: Vec3::new(0.0, 0.0, focal_px / longer),
            projection: Projection::Pinhole { focal_px },
            ..Self::front(width, height)
        }
    }

    /// A pinhole camera at `eye` that looks at `target`, with `up` upwards in the picture.
    pub fn look_at(eye: Vec3, target: Vec3, up: Vec3, width: u32, height: u32, focal_px: f32) -> Self {
        let forward = (target - eye).normalize_or(Vec3::NEG_Z);
        let right = forward.cross(up).normalize_or(forward.any_orthonormal_vector());
        let rotation = Mat3::from_cols(right, forward.cross(right), forward).transpose();
        Self {
            rotation,
            translation: -(rotation * eye),
            projection: Projection::Pinhole { focal_px },
            principal: centred(width, height),
            width,
            height,
        }
    }

    /// Camera coordinates of a world point.
    pub fn to_camera(&self, point: Vec3) -> Vec3 {
        self.rotation * point + self.translation
    }

    /// World coordinates of a camera-space point.
    pub fn to_world(&self, point: Vec3) -> Vec3 {
        self.rotation.transpose() * (point - self.translation)
    }

    /// Pixel and depth of a world point; `None` at or behind a pinhole's centre.
    pub fn project(&self, point: Vec3) -> Option<Projected> {
        let p = self.to_camera(point);
        let scale = match self.projection {
            Projection::Orthographic { pixels_per_unit } => pixels_per_unit,
            Projection::Pinhole { focal_px } if p.z > 0.0 => focal_px / p.z,
            Projection::Pinhole { .. } => return None,
        };
        Some(Projected {
            pixel: [self.principal[0] + p.x * scale, self.principal[1] + p.y * scale],
            depth: p.z,
        })
    }

    /// The ray of pixel coordinates (u, v).
    pub fn ray(&self, u: f32, v: f32) -> Ray {
        let offset = Vec3::new(u - self.principal[0], v - self.principal[1], 0.0);
        let (origin, direction) = match self.projection {
            Projection::Orthographic { pixels_per_unit } => (offset / pixels_per_unit, Vec3::Z),
            Projection::Pinhole { focal_px } => (Vec3::ZERO, offset / focal_px + Vec3::Z),
        };
        Ray {
            origin: self.to_world(origin),
            direction: self.rotation.transpose() * direction,
        }
    }

    /// The world point seen at pixel coordinates (u, v) at a depth.
    pub fn unproject(&self, u: f32, v: f32, depth: f32) -> Vec3 {
        let ray = self.ray(u, v);
        ray.origin + ray.direction * depth
    }

    /// Unit direction from the camera towards a world point.
    pub fn direction_to(&self, point: Vec3) -> Vec3 {
        match self.projection {
            Projection::Orthographic { .. } => self.forward(),
            Projection::Pinhole { .. } => (point - self.position()).normalize_or(self.forward()),
        }
    }

    /// The viewing axis in world space, a unit vector.
    pub fn forward(&self) -> Vec3 {
        self.rotation.transpose().z_axis
    }

    /// The world point at the origin of camera space: a pinhole's centre of projection.
    pub fn position(&self) -> Vec3 {
        self.to_world(Vec3::ZERO)
    }

    /// Pixels that a world unit spans at a depth.
    pub fn pixels_per_unit(&self, depth: f32) -> f32 {
        match self.projection {
            Projection::Orthographic { pixels_per_unit } => pixels_per_unit,
            Projection::Pinhole { focal_px } => focal_px / depth,
        }
    }

    /// Largest |x/z| and |y/z| at which the projection of a covariance is still linearised: 1.3 times the tangent
    /// of the half field of view, as in 3DGS. Farther out the first-order model of a Gaussian explodes.
    pub fn jacobian_limit(&self) -> [f32; 2] {
        match self.projection {
            Projection::Orthographic { .. } => [f32::INFINITY; 2],
            Projection::Pinhole { focal_px } => {
                [self.width, self.height].map(|side| 1.3 * (0.5 * side as f32 / focal_px))
            }
        }
    }

    /// Derivative of pixel coordinates by camera coordinates at `p` (rows u, v; columns x, y, z), with the
    /// clamp of [`Camera::jacobian_limit`].
    pub fn jacobian(&self, p: Vec3) -> [[f32; 3]; 2] {
        match self.projection {
            Projection::Orthographic { pixels_per_unit: s } => [[s, 0.0, 0.0], [0.0, s, 0.0]],
            Projection::Pinhole { focal_px } => {
                let limit = self.jacobian_limit();
                let s = focal_px / p.z;
                let (tx, ty) = (
                    (p.x / p.z).clamp(-limit[0], limit[0]),
                    (p.y / p.z).clamp(-limit[1], limit[1]),
                );
                [[s, 0.0, -s * tx], [0.0, s, -s * ty]]
            }
        }
    }

    /// This camera moved around `center`: by `yaw_degrees` about the world's vertical (positive: to the right, so
    /// that more of the scene's right side is seen), then by `pitch_degrees` upwards (positive: seen from above).
    /// At (0, 0) the camera is unchanged, to the bit.
    pub fn orbit(&self, center: Vec3, yaw_degrees: f32, pitch_degrees: f32) -> Self {
        if yaw_degrees == 0.0 && pitch_degrees == 0.0 {
            return *self;
        }
        let right = self.rotation.transpose().x_axis;
        let motion = axis_rotation(right, pitch_degrees) * axis_rotation(Vec3::Y, -yaw_degrees);
        Self {
            rotation: self.rotation * motion,
            translation: self.rotation * (center - motion * center) + self.translation,
            ..*self
        }
    }

    /// The same view sampled so that the longer side has `longer_side` pixels (at least 1).
    pub fn resized(&self, longer_side: u32) -> Self {
        let longer = self.width.max(self.height).max(1);
        if longer_side == longer {
            return *self;
        }
        let factor = f64::from(longer_side.max(1)) / f64::from(longer);
        let side = |n: u32| libm::round(f64::from(n) * factor).max(1.0) as u32;
        let scale = |s: f32| (f64::from(s) * factor) as f32;
        Self {
            projection: self.projection.magnified(factor),
            // Pixel centres are integers: the picture's corner −½ stays where it is.
            principal: self.principal.map(|c| scale(c + 0.5) - 0.5),
            width: side(self.width),
            height: side(self.height),
            ..*self
        }
    }

    /// The same view in a picture of this size (at least 1 a side): scaled until it touches two sides, in the middle, so
    /// that beyond the other two more is seen.
    pub fn fitted(&self, width: u32, height: u32) -> Self {
        let (old, new) = ([self.width, self.height], [width.max(1), height.max(1)]);
        if old == new {
            return *self;
        }
        let ratio = |axis: usize| f64::from(new[axis]) / f64::from(old[axis].max(1));
        let factor = ratio(0).min(ratio(1));
        let principal = [0, 1].map(|axis| {
            let room = f64::from(new[axis]) - factor * f64::from(old[axis]);
            ((f64::from(self.principal[axis]) + 0.5) * factor - 0.5 + 0.5 * room) as f32
        });
        Self {
            projection: self.projection.magnified(factor),
            principal,
            width: new[0],
            height: new[1],
            ..*self
        }
    }

    /// This camera in a world that was turned as [`crate::Scene::turned_over`] turns a scene: it sees the same.
    pub fn turned_over(&self) -> Self {
        Self {
            rotation: self.rotation * Mat3::from_diagonal(Vec3::new(1.0, -1.0, -1.0)),
            ..*self
        }
    }

    /// This camera with whole pixels added on each side, as few as hold the box `bounds`, at the same scale. Corners
    /// behind a pinhole are left out. At most `max_side` pixels a side.
    pub fn framing(&self, bounds: &Bounds, max_side: u32) -> Self {
        let mut low = [-0.5f32; 2];
        let mut high = [self.width as f32 - 0.5, self.height as f32 - 0.5];
        for corner in bounds.corners() {
            if let Some(seen) = self.project(corner) {
                for axis in 0..2 {
                    low[axis] = low[axis].min(seen.pixel[axis]);
                    high[axis] = high[axis].max(seen.pixel[axis]);
                }
            }
        }
        let room = |side: u32| max_side.saturating_sub(side) / 2;
        let pad = |by: f32, side: u32| (by.max(0.0).ceil() as u32).min(room(side));
        let (left, top) = (pad(-0.5 - low[0], self.width), pad(-0.5 - low[1], self.height));
        let right = pad(high[0] - (self.width as f32 - 0.5), self.width);
        let bottom = pad(high[1] - (self.height as f32 - 0.5), self.height);
        Self {
            principal: [self.principal[0] + left as f32, self.principal[1] + top as f32],
            width: self.width + left + right,
            height: self.height + top + bottom,
            ..*self
        }
    }

    /// Whole-pixel offset (x, y) from this picture to another that looks along the same rays: what is at (x, y) here is at
    /// (x + dx, y + dy) there. `None` if the rays differ.
    pub fn offset_to(&self, other: &Self) -> Option<(isize, isize)> {
        let same = self.rotation == other.rotation
            && self.translation == other.translation
            && self.projection == other.projection;
        let [dx, dy] = [0, 1].map(|k| other.principal[k] - self.principal[k]);
        (same && dx == dx.round() && dy == dy.round()).then_some((dx as isize, dy as isize))
    }

    /// True when every number is finite, the picture has pixels and the projection magnifies.
    pub fn is_valid(&self) -> bool {
        let scale = match self.projection {
            Projection::Orthographic { pixels_per_unit } => pixels_per_unit,
            Projection::Pinhole { focal_px } => focal_px,
        };
        self.rotation.is_finite()
            && self.translation.is_finite()
            && self.principal.iter().all(|c| c.is_finite())
            && scale.is_finite()
            && scale > 0.0
            && self.width > 0
            && self.height > 0
    }
}

fn centred(width: u32, height: u32) -> [f32; 2] {
    [width, height].map(|side| (side as f32 - 1.0) / 2.0)
}

/// Rotation by an angle in degrees about a unit axis. The quarter turns are exact.
fn axis_rotation(axis: Vec3, degrees: f32) -> Mat3 {
    let turn = libm::fmod(f64::from(degrees), 360.0);
    let (sin, cos) = match turn {
        0.0 => (0.0, 1.0),
        90.0 | -270.0 => (1.0, 0.0),
        180.0 | -180.0 => (0.0, -1.0),
        270.0 | -90.0 => (-1.0, 0.0),
        _ => libm::sincos(turn.to_radians()),
    };
    let (sin, cos) = (sin as f32, cos as f32);
    let cross = Mat3::from_cols(axis.cross(Vec3::X), axis.cross(Vec3::Y), axis.cross(Vec3::Z));
    // Rodrigues: R = cos·1 + sin·[a]× + (1 − cos)·a aᵀ, where [a]× e_i = a × e_i.
    let outer = Mat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
    Mat3::IDENTITY * cos + cross * sin + outer * (1.0 - cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: Vec3, b: Vec3) -> bool {
        (a - b).length() < 1e-5
    }

    #[test]
    fn the_front_camera_sees_pixels_where_the_convention_says() {
        let camera = Camera::front(300, 200);
        for (i, j) in [(0.0, 0.0), (299.0, 199.0), (17.0, 150.0)] {
            let world = Vec3::new((i - 149.5) / 300.0, -(j - 99.5) / 300.0, 0.25);
            let seen = camera.project(world).unwrap();
            assert!((seen.pixel[0] - i).abs() < 1e-4 && (seen.pixel[1] - j).abs() < 1e-4);
            assert!((seen.depth - (FRONT_DISTANCE - 0.25)).abs() < 1e-6);
        }
    }

    #[test]
    fn the_pinhole_front_sees_the_picture_plane_as_the_orthographic_one_does() {
        let (parallel, pinhole) = (Camera::front(64, 96), Camera::front_pinhole(64, 96, 0.7));
        let point = Vec3::new(0.21, -0.33, 0.0);
        let (a, b) = (parallel.project(point).unwrap(), pinhole.project(point).unwrap());
        assert!((a.pixel[0] - b.pixel[0]).abs() < 1e-3 && (a.pixel[1] - b.pixel[1]).abs() < 1e-3);
    }

    #[test]
    fn a_fitted_picture_shows_the_whole_frame_in_its_middle() {
        let camera = Camera::front_pinhole(64, 48, 0.9);
        let wide = camera.fitted(200, 96);
        assert_eq!((wide.width, wide.height), (200, 96));
        // Twice as large, and (200 − 128) / 2 pixels more on the left.
        for point in [Vec3::ZERO, Vec3::new(0.3, -0.2, 0.1)] {
            let (a, b) = (camera.project(point).unwrap(), wide.project(point).unwrap());
            assert!((b.pixel[0] - (2.0 * a.pixel[0] + 0.5 + 36.0)).abs() < 1e-3);
            assert!((b.pixel[1] - (2.0 * a.pixel[1] + 0.5)).abs() < 1e-3);
        }
        assert_eq!(camera.fitted(64, 48), camera);
    }

    #[test]
    fn unproject_inverts_project() {
        let eye = Vec3::new(1.0, 0.7, 2.0);
        for camera in [
            Camera::front(50, 40).orbit(Vec3::new(0.1, 0.0, -0.2), 37.0, 12.0),
            Camera::look_at(eye, Vec3::ZERO, Vec3::Y, 50, 40, 60.0),
        ] {
            let point = Vec3::new(0.3, -0.2, 0.1);
            let seen = camera.project(point).unwrap();
            assert!(close(camera.unproject(seen.pixel[0], seen.pixel[1], seen.depth), point));
        }
    }

    #[test]
    fn a_positive_yaw_shows_the_right_side_and_a_full_turn_comes_back() {
        let camera = Camera::front(10, 10);
        let right = camera.orbit(Vec3::ZERO, 90.0, 0.0);
        assert!(close(right.forward(), Vec3::NEG_X), "{:?}", right.forward());
        assert!(close(camera.orbit(Vec3::ZERO, 0.0, 90.0).forward(), Vec3::NEG_Y));
        assert!(close(right.orbit(Vec3::ZERO, 270.0, 0.0).forward(), camera.forward()));
        assert_eq!(camera.orbit(Vec3::ONE, 0.0, 0.0), camera);
    }

    #[test]
    fn an_orbit_keeps_its_centre_where_it_is_in_the_picture() {
        let center = Vec3::new(0.3, -0.1, 0.2);
        for camera in [Camera::front(80, 60), Camera::front_pinhole(80, 60, 0.9)] {
            let before = camera.project(center).unwrap();
            let after = camera.orbit(center, -55.0, 20.0).project(center).unwrap();
            assert!((before.pixel[0] - after.pixel[0]).abs() < 1e-3);
            assert!((before.pixel[1] - after.pixel[1]).abs() < 1e-3);
        }
    }

    #[test]
    fn the_jacobian_is_the_derivative_of_the_projection() {
        let camera = Camera::look_at(Vec3::new(0.0, 0.0, 3.0), Vec3::ZERO, Vec3::Y, 64, 64, 70.0);
        let p = Vec3::new(0.3, -0.4, 2.5);
        let jacobian = camera.jacobian(p);
        let pixel = |p: Vec3| camera.project(camera.to_world(p)).unwrap().pixel;
        for (axis, unit) in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().enumerate() {
            let (a, b) = (pixel(p + unit * 1e-2), pixel(p - unit * 1e-2));
            for row in 0..2 {
                let slope = (a[row] - b[row]) / 2e-2;
                assert!((slope - jacobian[row][axis]).abs() < 2e-2, "{slope} {jacobian:?}");
            }
        }
    }

    #[test]
    fn framing_adds_pixels_only_where_the_box_leaves_the_picture() {
        let camera = Camera::front(20, 40);
        let inside = Bounds {
            min: Vec3::splat(-0.2),
            max: Vec3::splat(0.2),
        };
        assert_eq!(camera.framing(&inside, 4096), camera);
        let wide = Bounds {
            min: Vec3::new(-0.5, -0.1, 0.0),
            max: Vec3::new(0.2, 0.1, 0.0),
        };
        let framed = camera.framing(&wide, 4096);
        assert_eq!((framed.width, framed.height), (30, 40));
        let seen = framed.project(wide.min).unwrap();
        assert!(seen.pixel[0] >= -0.5 && seen.pixel[0] < 1.0);
    }

    #[test]
    fn resizing_keeps_the_frame() {
        let camera = Camera::front(30, 60).resized(180);
        assert_eq!((camera.width, camera.height), (90, 180));
        let corner = camera.project(Vec3::new(-0.25, 0.5, 0.0)).unwrap();
        assert!((corner.pixel[0] + 0.5).abs() < 1e-4 && (corner.pixel[1] + 0.5).abs() < 1e-4);
    }
}
