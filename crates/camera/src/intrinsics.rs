//! A pinhole's projection as OpenCV writes it.
//!
//! With camera coordinates (x right, y down, z forward) a point lands at
//! u = (fx·x + skew·y)/z + cx, v = fy·y/z + cy (OpenCV, *Camera Calibration and 3D Reconstruction*,
//! with the skew of Hartley and Zisserman, *Multiple View Geometry*, 2nd ed., eq. 6.10).
//!
//! The sensor as the camera needs it: how many pixels, and how large.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::CameraError;
use etendue_geometry::units::Micrometres;

/// Origin of pixel coordinates. A file must say which: half a pixel lies between them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PixelOrigin {
    /// (0, 0) is the centre of the top left pixel (OpenCV, COLMAP's depth maps).
    Center,
    /// (0, 0) is the outer corner of the top left pixel (COLMAP, pbrt, textures).
    Corner,
}

impl PixelOrigin {
    /// Offset from a coordinate counted from here to one counted from the corner (pixels).
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
    /// Origin of `cx` and `cy`.
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
    /// Returns the intrinsics on pixels `factor` times as large.
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

/// The most pixels along a side: what image formats and OpenCV can hold.
const LONGEST_SIDE: u32 = 65_535;

/// The most pixels of a picture.
const MOST_PIXELS: u64 = 1 << 31;

/// The sensor's grid of pixels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorSpec {
    /// Columns and rows.
    #[serde(default = "default_resolution")]
    pub resolution: [u32; 2],
    /// From one pixel's centre to the next (µm). Pinhole and orthographic pictures do not depend on
    /// it; with it, `camera.json` can tell the focal length in millimetres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pixel_pitch: Option<Micrometres>,
}

fn default_resolution() -> [u32; 2] {
    [1024, 1024]
}

impl Default for SensorSpec {
    fn default() -> Self {
        Self { resolution: default_resolution(), pixel_pitch: None }
    }
}

impl SensorSpec {
    /// A sensor of this many columns and rows.
    #[must_use]
    pub fn new(resolution: [u32; 2]) -> Self {
        Self { resolution, pixel_pitch: None }
    }

    /// Width over height of the picture; the pixels are square.
    #[must_use]
    pub fn aspect(&self) -> f64 {
        f64::from(self.resolution[0]) / f64::from(self.resolution[1])
    }

    /// Refuses sensors without pixels, and with more than any image file holds.
    ///
    /// # Errors
    ///
    /// As said, or when the pixel pitch is not above zero.
    pub fn check(&self) -> Result<(), CameraError> {
        let [width, height] = self.resolution;
        let fault = |why: String| Err(CameraError::new("sensor.resolution", why));
        if width == 0 || height == 0 {
            return fault(format!("[{width}, {height}] has no pixels; both must be at least 1"));
        }
        if width > LONGEST_SIDE || height > LONGEST_SIDE {
            return fault(format!("[{width}, {height}] is over {LONGEST_SIDE} pixels a side"));
        }
        if u64::from(width) * u64::from(height) > MOST_PIXELS {
            return fault(format!("[{width}, {height}] is over {MOST_PIXELS} pixels in all"));
        }
        match self.pixel_pitch {
            Some(Micrometres(pitch)) if !(pitch > 0.0 && pitch.is_finite()) => {
                Err(CameraError::new("sensor.pixel_pitch", format!("{pitch} µm is not above zero")))
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absurd_resolutions_are_refused() {
        for (resolution, word) in [
            ([0, 480], "no pixels"),
            ([640, 0], "no pixels"),
            ([70_000, 1], "65535"),
            ([65_535, 65_535], "2147483648"),
        ] {
            let error = SensorSpec::new(resolution).check().unwrap_err();
            assert_eq!(error.at, "sensor.resolution");
            assert!(error.why.contains(word), "{error}");
        }
        assert!(SensorSpec::new([65_535, 32_768]).check().is_ok());
        let flat = SensorSpec { pixel_pitch: Some(Micrometres(0.0)), ..SensorSpec::default() };
        assert_eq!(flat.check().unwrap_err().at, "sensor.pixel_pitch");
    }
}
