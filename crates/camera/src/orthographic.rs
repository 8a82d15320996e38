//! The orthographic camera: all rays are parallel to the axis.

use etendue_geometry::{RayBatch, RaysMut};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::framing::{self, Subject};
use crate::{CameraError, Pose, PoseSpec, SensorSpec};
use etendue_geometry::units::Metres;

/// An orthographic camera as the scene file writes it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OrthographicSpec {
    /// How much of the world the picture is high (m); the pixels are square. When absent, the whole
    /// scene fits in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height: Option<Metres>,
    /// Where the camera stands: rays start in the plane through it across its axis. When absent,
    /// the whole scene is framed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<PoseSpec>,
    /// The grid of pixels.
    #[serde(default)]
    pub sensor: SensorSpec,
}

/// An orthographic projection.
#[derive(Debug, Clone, PartialEq)]
pub struct Orthographic {
    /// A pixel's side in the world (m).
    pixel: f64,
    /// Half the picture's columns and rows (pixels).
    centre: [f64; 2],
}

impl OrthographicSpec {
    /// The pose and projection. `subject` is asked for only when something is to be chosen.
    pub(crate) fn build<'a>(
        &self,
        subject: impl FnOnce() -> Subject<'a>,
    ) -> Result<(Pose, Orthographic), CameraError> {
        if let Some(Metres(height)) = self.height
            && !(height > 0.0 && height.is_finite())
        {
            let why = format!("{height} m is not above zero");
            return Err(CameraError::new("height", why));
        }
        let aspect = self.sensor.aspect();
        let given = self.pose.as_ref().map(PoseSpec::build).transpose()?;
        let (pose, height) = match (given, self.height) {
            (Some(pose), Some(Metres(height))) => (pose, height),
            (Some(pose), None) => (pose, framing::orthographic_height(subject(), &pose, aspect)),
            (None, height) => {
                let (pose, fitting) = framing::orthographic(subject(), aspect);
                (pose, height.map_or(fitting, |Metres(height)| height))
            }
        };
        let [width, rows] = self.sensor.resolution.map(f64::from);
        Ok((pose, Orthographic { pixel: height / rows, centre: [0.5 * width, 0.5 * rows] }))
    }
}

impl Orthographic {
    /// A pixel's side in the world (m).
    #[must_use]
    pub fn metres_per_pixel(&self) -> f64 {
        self.pixel
    }

    /// The same on pixels `factor` times as large.
    pub(crate) fn coarser(&self, factor: f64) -> Self {
        Self { pixel: self.pixel * factor, centre: self.centre.map(|c| c / factor) }
    }

    /// The place of the axis on the sensor (pixels from the corner).
    #[must_use]
    pub fn centre(&self) -> [f64; 2] {
        self.centre
    }

    /// Turns places on the sensor (pixels from the corner), which stand in the first two arrays of
    /// the directions, into parallel rays. All arrays have the same length.
    pub(crate) fn aim(&self, pose: &Pose, rays: &mut RayBatch) {
        let (right, down, forward) = (pose.right(), -pose.up(), pose.forward());
        let RaysMut { origins, directions: [dx, dy, dz], .. } = rays.arrays_mut();
        for (axis, origins) in origins.into_iter().enumerate() {
            let (start, right, down) = (pose.position[axis], right[axis], down[axis]);
            for ((origin, u), v) in origins.iter_mut().zip(&*dx).zip(&*dy) {
                let (x, y) = ((u - self.centre[0]) * self.pixel, (v - self.centre[1]) * self.pixel);
                *origin = start + (right * x + down * y);
            }
        }
        dx.fill(forward.x);
        dy.fill(forward.y);
        dz.fill(forward.z);
    }
}
