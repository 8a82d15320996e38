//! Motion of lights, as the scene file writes it.

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::units::Seconds;
use etendue_geometry::{Interpolation, Motion, MotionError, Steady, Transform};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::supply::Fault;

/// Motion of a light, as the scene file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum LightMotionSpec {
    /// At constant speed along a line, turning at constant speed about an axis that goes along: from where it is written
    /// to be, in which it is at the frame's time.
    Velocity {
        /// The velocity (m/s), along the world's axes.
        #[serde(default)]
        velocity: [f64; 3],
        /// The angular velocity (degrees/s): its direction is the axis, right-handed, along the world's axes.
        #[serde(default)]
        angular_velocity: [f64; 3],
        /// A point on the axis at the frame's time (m); where the light is when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        about: Option<[f64; 3]>,
    },
    /// Through places, without turning.
    Offsets {
        /// Two or more: how far from where it is written to be (m), along the world's axes.
        offsets: Vec<[f64; 3]>,
        /// When the light is there (s, in the scene's clock), increasing; before and after it stands still.
        times: Vec<Seconds>,
        /// Interpolation of its place between two of them.
        #[serde(default)]
        translation: Interpolation,
    },
}

impl LightMotionSpec {
    /// The motion of a light that is written to be `at` (m), in the clock of a frame of this time (s).
    ///
    /// # Errors
    ///
    /// On the first value that describes no motion, by its key below `motion`.
    pub fn build(&self, at: DVec3, time: f64) -> Result<Motion, Fault> {
        match self {
            Self::Velocity { velocity, angular_velocity, about } => {
                let about = about.map_or(at, DVec3::from);
                let steady = Steady::of_velocities(*velocity, *angular_velocity, about)
                    .map_err(|(key, why)| Fault::new(key, why))?;
                let fault = |error: MotionError| Fault::new("angular_velocity", error.to_string());
                Motion::steady(steady).map_err(fault)
            }
            Self::Offsets { offsets, times, translation } => {
                if offsets.len() < 2 {
                    let why = "do not move; give two or more, or no `motion`";
                    return Err(Fault::new("offsets", why));
                }
                let place =
                    |offset: &[f64; 3]| Transform::new(DMat3::IDENTITY, DVec3::from(*offset));
                if let Some(i) = offsets.iter().position(|it| !place(it).is_finite()) {
                    return Err(Fault::new(format!("offsets[{i}]"), "is not finite"));
                }
                let places: Vec<Transform> = offsets.iter().map(place).collect();
                let times: Vec<f64> = times.iter().map(|at| at.0 - time).collect();
                let fault = |error: MotionError| Fault::new("times", error.to_string());
                Motion::through(&times, &places, *translation).map_err(fault)
            }
        }
    }

    /// True if its times are those of the scene's clock.
    #[must_use]
    pub fn has_times(&self) -> bool {
        matches!(self, Self::Offsets { .. })
    }
}
