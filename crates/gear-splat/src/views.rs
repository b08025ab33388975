//! Rendered views and the cameras they were seen through.

use gear_image::{Field, SrgbImage};

use crate::Camera;

/// One rendering. All rasters have the camera's size.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The camera.
    pub camera: Camera,
    /// A short name for files and reports, such as `yaw+30`.
    pub name: String,
    /// sRGB-encoded colour over a white ground (splats are blended in encoded values, as 3DGS does).
    pub rgb: SrgbImage,
    /// Coverage in [0, 1].
    pub alpha: Option<Field>,
    /// Depth along the camera's z axis, world units; NaN where nothing is.
    pub depth: Option<Field>,
    /// World-space unit normals; zero where nothing is.
    pub normal: Option<Vec<[f32; 3]>>,
    /// For appearance targets: how far each pixel may be trusted, in [0, 1].
    pub weight: Option<Field>,
}

/// An ordered set of views.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Views {
    /// The views, in rendering order.
    pub views: Vec<View>,
}
