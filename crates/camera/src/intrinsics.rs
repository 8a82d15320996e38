//! A pinhole's projection as OpenCV writes it.
//!
//! With camera coordinates (x right, y down, z forward) a point lands at
//! u = (fx·x + skew·y)/z + cx, v = fy·y/z + cy (OpenCV, *Camera Calibration and 3D Reconstruction*,
//! with the skew of Hartley and Zisserman, *Multiple View Geometry*, 2nd ed., eq. 6.10).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::CameraError;

/// Where pixel coordinates are counted from. A file must say which: half a pixel lies between them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PixelOrigin {
    /// (0, 0) is the centre of the top left pixel (OpenCV, COLMAP's depth maps).
    Center,
    /// (0, 0) is the outer corner of the top left pixel (COLMAP, pbrt, textures).
    Corner,
}

impl PixelOrigin {
    /// What to add to a coordinate counted from here, to have it counted from the corner (pixels).
    #[must_use]
    pub fn to_corner(self) -> f64 {
        match self {
            Self::Center => 0.5,
            Self::Corner => 0.0,
        }
    }
}

/// Intrinsic parameters as the scene file writes them (all in pixels).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IntrinsicsSpec {
    /// Focal length along the rows.
    pub fx: f64,
    /// Focal length along the columns.
    pub fy: f64,
    /// Column of the principal point, counted from `pixel_origin`.
    pub cx: f64,
    /// Row of the principal point, counted from `pixel_origin`.
    pub cy: f64,
    /// The skew of the pixel grid, K's second entry.
    #[serde(default)]
    pub skew: f64,
    /// What `cx` and `cy` are counted from.
    pub pixel_origin: PixelOrigin,
}

/// Intrinsic parameters in pixels, counted from the outer corner of the top left pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    /// Focal lengths along rows and columns (pixels).
    pub focal: [f64; 2],
    /// The principal point (pixels from the corner).
    pub centre: [f64; 2],
    /// K's second entry.
    pub skew: f64,
}

impl Intrinsics {
    /// The same on pixels `factor` times as large.
    pub(crate) fn coarser(&self, factor: f64) -> Self {
        let [focal, centre] = [self.focal, self.centre].map(|pair| pair.map(|x| x / factor));
        Self { focal, centre, skew: self.skew / factor }
    }

    /// Square pixels and a centred axis, for a vertical field of view (radians).
    #[must_use]
    pub fn from_fov(fov: f64, [width, height]: [u32; 2]) -> Self {
        let (width, height) = (f64::from(width), f64::from(height));
        let focal = 0.5 * height / (0.5 * fov).tan();
        Self { focal: [focal; 2], centre: [0.5 * width, 0.5 * height], skew: 0.0 }
    }

    /// The tangents (x right, y down) at a place on the sensor (pixels from the corner).
    #[must_use]
    #[inline]
    pub fn tangents(&self, u: f64, v: f64) -> [f64; 2] {
        let y = (v - self.centre[1]) / self.focal[1];
        [(u - self.centre[0] - self.skew * y) / self.focal[0], y]
    }

    /// The place on the sensor (pixels from the corner) of these tangents (x right, y down).
    #[must_use]
    pub fn project(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.focal[0] * x + self.skew * y + self.centre[0], self.focal[1] * y + self.centre[1]]
    }

    /// The matrix K by rows, with the principal point counted from `origin`.
    #[must_use]
    pub fn matrix(&self, origin: PixelOrigin) -> [[f64; 3]; 3] {
        let [cx, cy] = self.centre.map(|c| c - origin.to_corner());
        [[self.focal[0], self.skew, cx], [0.0, self.focal[1], cy], [0.0, 0.0, 1.0]]
    }
}

impl IntrinsicsSpec {
    /// The intrinsics, counted from the corner.
    ///
    /// # Errors
    ///
    /// When a number is not finite or a focal length not above zero.
    pub fn build(&self) -> Result<Intrinsics, CameraError> {
        for (key, focal) in [("fx", self.fx), ("fy", self.fy)] {
            if !(focal > 0.0 && focal.is_finite()) {
                return Err(CameraError::new(
                    format!("intrinsics.{key}"),
                    format!(
                        "{focal} is not above zero; the axes' signs belong into the pose's \
                         `convention`"
                    ),
                ));
            }
        }
        for (key, value) in [("cx", self.cx), ("cy", self.cy), ("skew", self.skew)] {
            if !value.is_finite() {
                return Err(CameraError::new(format!("intrinsics.{key}"), "is not finite"));
            }
        }
        let shift = self.pixel_origin.to_corner();
        Ok(Intrinsics {
            focal: [self.fx, self.fy],
            centre: [self.cx + shift, self.cy + shift],
            skew: self.skew,
        })
    }
}
