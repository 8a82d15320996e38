//! The sensor as the camera needs it: how many pixels, and how large.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::CameraError;
use etendue_geometry::units::Micrometres;

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
