//! A moving camera: its pose as an exact function of time, with its derivatives.
//!
//! Translation between two poses is linear, or cubic ([`etendue_geometry::hermite`]). Rotation turns about one axis at constant speed (slerp: Shoemake, "Animating rotation with quaternion curves", 1985). Before the first and
//! after the last pose the camera stands still.

use glam::{DMat3, DQuat, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{CameraError, Convention, Pose, PoseSpec, Shutter};
use etendue_geometry::hermite::{self, Interpolation, Points, Way};
use etendue_geometry::units::Seconds;

/// A rotation by less than this (radians) has no axis that is known.
const NO_TURN: f64 = 1e-9;

/// Motion of a camera, as the scene file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum CameraMotionSpec {
    /// At constant speed along a line, turning at constant speed about an axis of its own: from `pose`, where the
    /// camera stands at the frame's time.
    Velocity {
        /// The velocity (m/s).
        #[serde(default)]
        velocity: [f64; 3],
        /// The angular velocity (degrees/s): its direction is the axis, right-handed.
        #[serde(default)]
        angular_velocity: [f64; 3],
        /// The axes of both.
        #[serde(default)]
        axes: MotionAxes,
    },
    /// Through poses, instead of `pose`.
    Poses {
        /// Two or more.
        poses: Vec<PoseSpec>,
        /// When the camera is there (s, in the scene's clock), increasing.
        times: Vec<Seconds>,
        /// Interpolation of its place between two poses.
        #[serde(default)]
        translation: Interpolation,
        /// Whole turns that are added to the shorter rotation from each pose to the next, about the same axis; none
        /// when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        revolutions: Option<Vec<i32>>,
    },
}

/// The axes of a velocity.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MotionAxes {
    /// Those of the camera at the frame's time: right, up, backward.
    #[default]
    Camera,
    /// The world's.
    World,
}

/// The pose as a function of time (s, in the frame's clock).
#[derive(Debug, Clone, PartialEq)]
pub enum Trajectory {
    /// Constant velocity and angular velocity in the world.
    Velocity {
        /// At time 0.
        start: Pose,
        /// m/s.
        velocity: DVec3,
        /// rad/s.
        angular_velocity: DVec3,
    },
    /// Through poses.
    Keys(Vec<PoseKey>),
}

/// A pose of a trajectory, and the way on to the next.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseKey {
    time: f64,
    pose: Pose,
    /// The slope of the place at the start and the end of the way on (m/s).
    slopes: [DVec3; 2],
    /// The angular velocity of the way on (rad/s, world).
    turn: DVec3,
}

/// Pose, velocities and acceleration of a camera at a moment, in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kinematics {
    /// Its pose.
    pub pose: Pose,
    /// Its velocity (m/s).
    pub velocity: DVec3,
    /// Its acceleration (m/s²).
    pub acceleration: DVec3,
    /// Its angular velocity (rad/s).
    pub angular_velocity: DVec3,
}

impl Kinematics {
    /// Of a camera that stands still.
    #[must_use]
    pub fn still(pose: Pose) -> Self {
        let [velocity, acceleration, angular_velocity] = [DVec3::ZERO; 3];
        Self { pose, velocity, acceleration, angular_velocity }
    }

    /// A vector of the world along the camera's axes in a convention.
    #[must_use]
    pub fn along_camera(&self, vector: DVec3, convention: Convention) -> DVec3 {
        convention.ours_from_theirs() * (self.pose.rotation.transpose() * vector)
    }

    /// Reading of an inertial unit that is fixed to the camera at `at` (m, from its origin), with
    /// axes of the camera in a convention: the angular velocity (rad/s), and the specific force
    /// (m/s²): the acceleration without that of what falls (`gravity`, m/s², in the world).
    ///
    /// At `at` the acceleration is a + ω × (ω × r): ways turn at constant speed, so that ω has no derivative but at poses.
    #[must_use]
    pub fn inertial(&self, convention: Convention, at: DVec3, gravity: DVec3) -> [DVec3; 2] {
        let turn = self.angular_velocity;
        let arm = self.pose.rotation * (convention.ours_from_theirs() * at);
        let acceleration = self.acceleration + turn.cross(turn.cross(arm));
        [turn, acceleration - gravity].map(|vector| self.along_camera(vector, convention))
    }
}

/// Shutter and motion of a camera.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraTime {
    /// The shutter.
    pub shutter: Shutter,
    /// The camera's motion, where it moves while the shutter is open.
    pub motion: Option<Trajectory>,
    /// Trajectory of the camera, whether it moves while the shutter is open or not.
    pub trajectory: Option<Trajectory>,
    /// True if anything of the scene moves while the shutter is open.
    pub things_move: bool,
    /// True if some light changes with time.
    pub lights_change: bool,
}

impl CameraTime {
    /// The moment (s) of the frame's pose: that at which data layers see the middle of a picture of so many rows.
    pub(crate) fn middle(&self, rows: u32) -> f64 {
        self.shutter.truth(0.5 * f64::from(rows))
    }
}

impl CameraMotionSpec {
    /// Returns the motion with times that count from `time` (s) on: from the scene's clock to a frame's.
    #[must_use]
    pub fn from_time(&self, time: f64) -> Self {
        let mut moved = self.clone();
        if let Self::Poses { times, .. } = &mut moved {
            times.iter_mut().for_each(|at| at.0 -= time);
        }
        moved
    }

    /// The trajectory. `start` is the camera's pose at time 0, of motions that begin there.
    ///
    /// # Errors
    ///
    /// When a number is not finite, times are not increasing, or a rotation has no axis; the error names the key.
    pub fn build(&self, start: Option<Pose>) -> Result<Trajectory, CameraError> {
        let fault = |key: &str, why: String| Err(CameraError::new(format!("motion.{key}"), why));
        match self {
            Self::Velocity { velocity, angular_velocity, axes } => {
                let Some(start) = start else {
                    let why =
                        "starts from the camera's `pose`, and there is none\nhint: give it one";
                    return Err(CameraError::new("motion", why));
                };
                let axes = match axes {
                    MotionAxes::Camera => start.rotation,
                    MotionAxes::World => DMat3::IDENTITY,
                };
                let [velocity, turn] = [*velocity, *angular_velocity].map(DVec3::from_array);
                for (key, vector) in [("velocity", velocity), ("angular_velocity", turn)] {
                    if !vector.length().is_finite() {
                        return fault(key, "a number is too large or not finite".to_owned());
                    }
                }
                let turn = turn * (std::f64::consts::PI / 180.0);
                let [velocity, angular_velocity] = [axes * velocity, axes * turn];
                Ok(Trajectory::Velocity { start, velocity, angular_velocity })
            }
            Self::Poses { poses, times, translation, revolutions } => {
                if poses.len() < 2 {
                    let why = format!(
                        "{} do not move\nhint: give two or more, or leave `motion` out",
                        poses.len()
                    );
                    return fault("poses", why);
                }
                if times.len() != poses.len() {
                    return fault(
                        "times",
                        format!("{} times for {} poses", times.len(), poses.len()),
                    );
                }
                let times: Vec<f64> = times.iter().map(|time| time.0).collect();
                if let Some(i) = times.iter().position(|time| !time.is_finite()) {
                    return fault(&format!("times[{i}]"), "is not finite".to_owned());
                }
                if let Some(i) = times.windows(2).position(|pair| pair[1] <= pair[0]) {
                    let why = format!(
                        "{} s does not come after {} s; times increase from pose to pose",
                        times[i + 1],
                        times[i]
                    );
                    return fault(&format!("times[{}]", i + 1), why);
                }
                let ways = poses.len() - 1;
                if let Some(turns) = revolutions.as_ref().filter(|turns| turns.len() != ways) {
                    let why =
                        format!("{} numbers for the {ways} ways between the poses", turns.len());
                    return fault("revolutions", why);
                }
                let build = |(i, pose): (usize, &PoseSpec)| {
                    pose.build().map_err(|error| error.under(&format!("motion.poses[{i}]")))
                };
                let poses: Vec<Pose> =
                    poses.iter().enumerate().map(build).collect::<Result<_, _>>()?;
                let turns = revolutions.clone().unwrap_or_else(|| vec![0; ways]);
                keys(&poses, &times, *translation, &turns).map(Trajectory::Keys)
            }
        }
    }
}

/// The places of poses.
struct PosePositions<'a> {
    poses: &'a [Pose],
    times: &'a [f64],
}

impl Points for PosePositions<'_> {
    fn count(&self) -> usize {
        self.poses.len()
    }

    fn time(&self, i: usize) -> f64 {
        self.times[i]
    }

    fn place(&self, i: usize) -> DVec3 {
        self.poses[i].position
    }
}

/// The poses with their ways on.
fn keys(
    poses: &[Pose],
    times: &[f64],
    translation: Interpolation,
    revolutions: &[i32],
) -> Result<Vec<PoseKey>, CameraError> {
    let last = poses.len() - 1;
    let places = PosePositions { poses, times };
    let way = |i: usize| -> Result<PoseKey, CameraError> {
        let key =
            PoseKey { time: times[i], pose: poses[i], slopes: [DVec3::ZERO; 2], turn: DVec3::ZERO };
        if i == last {
            return Ok(key);
        }
        let slopes = hermite::slopes(&places, i, translation);
        let between = DQuat::from_mat3(&(poses[i + 1].rotation * poses[i].rotation.transpose()));
        let between = if between.w < 0.0 { -between } else { between };
        let sine = DVec3::new(between.x, between.y, between.z);
        let angle = 2.0 * sine.length().atan2(between.w);
        let whole = std::f64::consts::TAU * f64::from(revolutions[i]);
        let turn = if angle < NO_TURN {
            if revolutions[i] != 0 {
                let why = "the two poses are turned alike, so that the axis of a whole turn is not known\nhint: put a pose \
                           in between";
                return Err(CameraError::new(format!("motion.revolutions[{i}]"), why));
            }
            // The axis of rounding errors, at their size.
            2.0 * sine
        } else {
            sine.normalize() * (angle + whole)
        };
        Ok(PoseKey { slopes, turn: turn / (times[i + 1] - times[i]), ..key })
    };
    (0..=last).map(way).collect()
}

impl Trajectory {
    /// The pose at a time (s).
    #[must_use]
    pub fn at(&self, time: f64) -> Pose {
        self.kinematics(time).pose
    }

    /// Times at which the camera begins to move and stops (s).
    #[must_use]
    pub fn span(&self) -> [f64; 2] {
        match self {
            Self::Velocity { .. } => [f64::NEG_INFINITY, f64::INFINITY],
            Self::Keys(keys) => [keys[0].time, keys[keys.len() - 1].time],
        }
    }

    /// True if the camera stands still between two times (s).
    #[must_use]
    pub fn is_still(&self, [from, to]: [f64; 2]) -> bool {
        match self {
            Self::Velocity { velocity, angular_velocity, .. } => {
                *velocity == DVec3::ZERO && *angular_velocity == DVec3::ZERO || from == to
            }
            Self::Keys(keys) => keys.windows(2).all(|pair| {
                let stands = pair[0].pose == pair[1].pose && pair[0].slopes == [DVec3::ZERO; 2];
                stands || pair[1].time <= from || pair[0].time >= to || from == to
            }),
        }
    }

    /// The pose at a time (s), and how it changes there; at a pose of a list, of the way that begins there.
    #[must_use]
    pub fn kinematics(&self, time: f64) -> Kinematics {
        match self {
            Self::Velocity { start, velocity, angular_velocity } => Kinematics {
                pose: Pose {
                    rotation: turned(*angular_velocity * time) * start.rotation,
                    position: start.position + *velocity * time,
                },
                velocity: *velocity,
                acceleration: DVec3::ZERO,
                angular_velocity: *angular_velocity,
            },
            Self::Keys(keys) => {
                let after = keys.partition_point(|key| key.time <= time);
                if after == 0 {
                    return Kinematics::still(keys[0].pose);
                }
                let key = &keys[after - 1];
                let Some(next) = keys.get(after) else {
                    return Kinematics::still(key.pose);
                };
                let length = next.time - key.time;
                let since = time - key.time;
                let s = since / length;
                let across = next.pose.position - key.pose.position;
                let way = Way { length, across, slopes: key.slopes };
                Kinematics {
                    pose: Pose {
                        rotation: turned(key.turn * since) * key.pose.rotation,
                        position: key.pose.position + way.at(s),
                    },
                    velocity: way.velocity(s),
                    acceleration: way.acceleration(s),
                    angular_velocity: key.turn,
                }
            }
        }
    }
}

/// The rotation by a vector's length (radians) about its direction.
fn turned(by: DVec3) -> DMat3 {
    DMat3::from_quat(DQuat::from_scaled_axis(by))
}
