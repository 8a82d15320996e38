//! The pinhole: every ray of the picture passes through one point.

use etendue_geometry::{Bounds, RayBatch};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::framing::{self, Reach};
use crate::length::Degrees;
use crate::{CameraError, Intrinsics, IntrinsicsSpec, PixelOrigin, Pose, PoseSpec, SensorSpec};

/// The vertical field of view of a pinhole that says nothing about it.
const DEFAULT_FOV: Degrees = Degrees(40.0);

/// A pinhole camera as the scene file writes it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PinholeSpec {
    /// Vertical field of view (degrees), between 0 and 180; 40 when neither this nor `intrinsics`
    /// is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fov: Option<Degrees>,
    /// OpenCV's K instead of `fov`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intrinsics: Option<IntrinsicsSpec>,
    /// Where the camera stands; when absent, the whole scene is framed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<PoseSpec>,
    /// The grid of pixels.
    #[serde(default)]
    pub sensor: SensorSpec,
}

/// A pinhole's projection.
#[derive(Debug, Clone, PartialEq)]
pub struct Pinhole {
    intrinsics: Intrinsics,
    pixel_origin: PixelOrigin,
}

impl PinholeSpec {
    /// The pose and projection. `bounds` is asked for only when the pose is to be chosen.
    pub(crate) fn build(
        &self,
        bounds: impl FnOnce() -> Bounds,
    ) -> Result<(Pose, Pinhole), CameraError> {
        let intrinsics = match (&self.intrinsics, self.fov) {
            (Some(_), Some(_)) => {
                return Err(CameraError::new(
                    "fov",
                    "is given beside `intrinsics`, which already fix it; remove one of them",
                ));
            }
            (Some(spec), None) => spec.build()?,
            (None, fov) => {
                let Degrees(fov) = fov.unwrap_or(DEFAULT_FOV);
                if !(fov > 0.0 && fov < 180.0) {
                    let why = format!("{fov} is outside 0 to 180 degrees (both excluded)");
                    return Err(CameraError::new("fov", why));
                }
                Intrinsics::from_fov(fov.to_radians(), self.sensor.resolution)
            }
        };
        let pixel_origin = match &self.intrinsics {
            Some(spec) => spec.pixel_origin,
            None => PixelOrigin::Center,
        };
        let pinhole = Pinhole { intrinsics, pixel_origin };
        let pose = match &self.pose {
            Some(pose) => pose.build()?,
            None => framing::perspective(bounds(), pinhole.reach(self.sensor.resolution)),
        };
        Ok((pose, pinhole))
    }
}

impl Pinhole {
    /// The intrinsic parameters.
    #[must_use]
    pub fn intrinsics(&self) -> Intrinsics {
        self.intrinsics
    }

    /// What the file counted the principal point from; the centre when it gave a field of view.
    #[must_use]
    pub fn pixel_origin(&self) -> PixelOrigin {
        self.pixel_origin
    }

    /// The tangents of the picture's edges.
    fn reach(&self, [width, height]: [u32; 2]) -> Reach {
        let [left, up] = self.intrinsics.tangents(0.0, 0.0);
        let [right, down] = self.intrinsics.tangents(width.into(), height.into());
        Reach { left: -left, right, down, up: -up }
    }

    /// Turns places on the sensor (pixels from the corner), which stand in the first two arrays of
    /// the directions, into rays from the pinhole. All arrays have the same length.
    pub(crate) fn aim(&self, pose: &Pose, rays: &mut RayBatch) {
        for (axis, origins) in rays.origin.iter_mut().enumerate() {
            origins.fill(pose.position[axis]);
        }
        let (right, down, forward) = (pose.right(), -pose.up(), pose.forward());
        let intrinsics = self.intrinsics;
        let [dx, dy, dz] = &mut rays.direction;
        // The three arrays walk in step, so that the loop has no bounds to check and vectorises.
        for ((dx, dy), dz) in dx.iter_mut().zip(dy).zip(dz) {
            let [x, y] = intrinsics.tangents(*dx, *dy);
            let shorten = 1.0 / (x * x + y * y + 1.0).sqrt();
            let (x, y, z) = (x * shorten, y * shorten, shorten);
            *dx = right.x * x + down.x * y + forward.x * z;
            *dy = right.y * x + down.y * y + forward.y * z;
            *dz = right.z * x + down.z * y + forward.z * z;
        }
    }
}
