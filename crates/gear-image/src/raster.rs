//! The rasters: [`Field`] (one f32 a pixel), [`Rgb`] (three, in a colour space), [`Mask`] (a bit), [`Image`].

use std::marker::PhantomData;

/// One f32 a pixel, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    width: usize,
    height: usize,
    data: Vec<f32>,
}

/// A colour space as a type.
pub trait Space: Copy + Send + Sync + 'static {}

/// sRGB-encoded values, nominally in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Srgb;
/// Linear light with sRGB primaries; display white is 1, HDR may exceed it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear;
impl Space for Srgb {}
impl Space for Linear {}

/// Three f32 a pixel in the colour space `S`, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Rgb<S: Space> {
    width: usize,
    height: usize,
    data: Vec<[f32; 3]>,
    space: PhantomData<S>,
}

/// An sRGB-encoded colour raster.
pub type SrgbImage = Rgb<Srgb>;
/// A linear-light colour raster.
pub type LinearImage = Rgb<Linear>;

/// A bit a pixel; `true` is inside.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    width: usize,
    height: usize,
    data: Vec<bool>,
}

/// A picture as it travels through a graph: sRGB-encoded colour and, if it had one, its alpha in [0, 1].
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Encoded colour.
    pub rgb: SrgbImage,
    /// Coverage of each pixel, the same size as `rgb`.
    pub alpha: Option<Field>,
}

macro_rules! raster {
    ($name:ident $(<$s:ident>)?, $pixel:ty, [$($init:tt)*]) => {
        impl $(<$s: Space>)? $name $(<$s>)? {
            /// A raster filled with one value.
            pub fn filled(width: usize, height: usize, value: $pixel) -> Self {
                Self::from_vec(width, height, vec![value; width * height])
            }

            /// Takes row-major samples. Panics when `data.len() != width * height`: a caller's bug.
            pub fn from_vec(width: usize, height: usize, data: Vec<$pixel>) -> Self {
                assert_eq!(data.len(), width * height, "raster data must fill {width}x{height}");
                Self { width, height, data, $($init)* }
            }

            /// A raster from a function of (x, y).
            pub fn from_fn(width: usize, height: usize, mut f: impl FnMut(usize, usize) -> $pixel) -> Self {
                let mut data = Vec::with_capacity(width * height);
                for y in 0..height {
                    for x in 0..width {
                        data.push(f(x, y));
                    }
                }
                Self::from_vec(width, height, data)
            }

            /// Width in pixels.
            pub fn width(&self) -> usize {
                self.width
            }

            /// Height in pixels.
            pub fn height(&self) -> usize {
                self.height
            }

            /// (width, height) in pixels.
            pub fn size(&self) -> (usize, usize) {
                (self.width, self.height)
            }

            /// The longer side in pixels.
            pub fn longer_side(&self) -> usize {
                self.width.max(self.height)
            }

            /// Number of pixels.
            pub fn len(&self) -> usize {
                self.data.len()
            }

            /// True when the raster has no pixel.
            pub fn is_empty(&self) -> bool {
                self.data.is_empty()
            }

            /// All samples, row-major.
            pub fn data(&self) -> &[$pixel] {
                &self.data
            }

            /// All samples, row-major, to change.
            pub fn data_mut(&mut self) -> &mut [$pixel] {
                &mut self.data
            }

            /// The samples themselves.
            pub fn into_data(self) -> Vec<$pixel> {
                self.data
            }

            /// Row `y`.
            pub fn row(&self, y: usize) -> &[$pixel] {
                &self.data[y * self.width..(y + 1) * self.width]
            }

            /// Row `y`, to change.
            pub fn row_mut(&mut self, y: usize) -> &mut [$pixel] {
                &mut self.data[y * self.width..(y + 1) * self.width]
            }

            /// The sample at (x, y). Panics outside.
            #[inline]
            pub fn at(&self, x: usize, y: usize) -> $pixel {
                self.data[y * self.width + x]
            }

            /// Sets the sample at (x, y). Panics outside.
            #[inline]
            pub fn set(&mut self, x: usize, y: usize, value: $pixel) {
                self.data[y * self.width + x] = value;
            }

            /// The sample nearest to (x, y) inside the raster. Panics on an empty one.
            #[inline]
            pub fn at_clamped(&self, x: isize, y: isize) -> $pixel {
                let x = x.clamp(0, self.width as isize - 1) as usize;
                let y = y.clamp(0, self.height as isize - 1) as usize;
                self.data[y * self.width + x]
            }
        }
    };
}

raster!(Field, f32, []);
raster!(Rgb<S>, [f32; 3], [space: PhantomData]);
raster!(Mask, bool, []);

impl Mask {
    /// Number of inside pixels.
    pub fn count(&self) -> usize {
        self.data.iter().filter(|&&inside| inside).count()
    }

    /// True when every pixel is inside: whole-canvas relief.
    pub fn is_full(&self) -> bool {
        self.data.iter().all(|&inside| inside)
    }

    /// 1 inside, 0 outside.
    pub fn to_field(&self) -> Field {
        Field::from_vec(
            self.width,
            self.height,
            self.data.iter().map(|&m| f32::from(u8::from(m))).collect(),
        )
    }
}

impl Image {
    /// An opaque picture.
    pub fn opaque(rgb: SrgbImage) -> Self {
        Self { rgb, alpha: None }
    }

    /// (width, height) in pixels.
    pub fn size(&self) -> (usize, usize) {
        self.rgb.size()
    }
}
