//! The frame that depths and vectors of the camera's space refer to, and the cones around its rays.

use etendue_geometry::glam::{DMat3, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::footprint::{Cone, Pixel};

/// The frame of a vector-valued layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Space {
    /// The scene's own frame: right-handed, +Y up.
    #[default]
    World,
    /// The camera's frame as OpenGL has it: looking along −Z, +Y up, +X right.
    Camera,
    /// The camera's frame as OpenCV and `camera.json` have it: looking along +Z, +Y down, +X right.
    Opencv,
}

/// The frame that depths and camera-space vectors refer to.
#[derive(Debug, Clone, Copy)]
pub struct View {
    /// The entrance pupil (m, world).
    pub origin: DVec3,
    /// The camera's axes in the world: +X right, +Y up, and +Z, which points backwards.
    pub axes: DMat3,
    /// Extent that a sample of the picture covers, where the camera tells.
    pub pixel: Option<Pixel>,
}

impl View {
    /// The direction in which the camera looks.
    #[must_use]
    pub fn forward(&self) -> DVec3 {
        -self.axes.z_axis
    }

    /// The axes of a frame in the world.
    #[must_use]
    pub fn axes_of(&self, space: Space) -> DMat3 {
        let DMat3 { x_axis, y_axis, z_axis } = self.axes;
        match space {
            Space::World => DMat3::IDENTITY,
            Space::Camera => self.axes,
            Space::Opencv => DMat3::from_cols(x_axis, -y_axis, -z_axis),
        }
    }

    /// The cone around the camera's ray along the unit `direction`; `None` when the camera does not
    /// tell.
    ///
    /// Off the axis of a perspective camera a pixel's solid angle falls as cos³, so its side does as
    /// cos^1.5.
    #[must_use]
    pub fn cone(&self, direction: DVec3) -> Option<Cone> {
        Some(match self.pixel? {
            Pixel::Width(width) => Cone { width, spread: 0.0 },
            Pixel::Angle(angle) => {
                let cosine = direction.dot(self.forward()).clamp(0.0, 1.0);
                Cone { width: 0.0, spread: angle * cosine * cosine.sqrt() }
            }
        })
    }
}
