//! Pose of a camera: where it stands, and which way it looks.

use glam::{DMat3, DMat4, DQuat, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::CameraError;

/// Tolerance of a given rotation's distance from orthonormal: the entries of matrices printed with five digits are.
const ROTATION_TOLERANCE: f64 = 1e-4;

/// The axes of a camera's own frame. Both are right-handed with +X to the right.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Convention {
    /// The camera looks along −Z, +Y is up (OpenGL, Blender, Nerfstudio).
    Opengl,
    /// The same as `opengl`, under glTF's name.
    Gltf,
    /// The camera looks along +Z, +Y is down (OpenCV, COLMAP).
    Opencv,
}

impl Convention {
    /// From this convention's camera frame to ours; its own inverse.
    pub(crate) fn ours_from_theirs(self) -> DMat3 {
        match self {
            Self::Opengl | Self::Gltf => DMat3::IDENTITY,
            Self::Opencv => DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)),
        }
    }
}

/// Direction in which a given pose maps points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Maps {
    /// Camera coordinates to world coordinates: the translation is the camera's position.
    WorldFromCamera,
    /// World coordinates to camera coordinates: OpenCV's extrinsics `[R | t]`, COLMAP's images.
    CameraFromWorld,
}

/// A pose as the scene file writes it. Lengths are metres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, deny_unknown_fields)]
pub enum PoseSpec {
    /// From a point towards a point.
    LookAt {
        /// The camera's position (m): its entrance pupil.
        from: [f64; 3],
        /// The point in the middle of the picture (m).
        look_at: [f64; 3],
        /// Direction that is up in the picture; +Y when absent.
        #[serde(default = "default_up")]
        up: [f64; 3],
    },
    /// A rigid 4×4 matrix.
    Matrix {
        /// Four rows; the last is `[0, 0, 0, 1]`.
        matrix: [[f64; 4]; 4],
        /// Direction in which the matrix maps.
        maps: Maps,
        /// The camera's axes.
        convention: Convention,
    },
    /// A rotation and a translation.
    Quaternion {
        /// The rotation `[x, y, z, w]`; normalised here.
        quaternion: [f64; 4],
        /// The translation, applied after the rotation (m).
        translation: [f64; 3],
        /// Direction in which they map.
        maps: Maps,
        /// The camera's axes.
        convention: Convention,
    },
}

fn default_up() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

/// A camera's place: a rigid map from the camera's frame (looks along −Z, +Y up) to the world (m).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// The camera's axes (right, up, backward) as columns, in world space. A rotation.
    pub rotation: DMat3,
    /// The camera's origin in world space (m).
    pub position: DVec3,
}

impl Pose {
    /// At the world's origin, looking along −Z.
    pub const IDENTITY: Self = Self { rotation: DMat3::IDENTITY, position: DVec3::ZERO };

    /// From `position` towards `target` (m), with `up` upwards in the picture.
    ///
    /// `None` when the two points coincide, or `up` is zero or along the view.
    #[must_use]
    pub fn look_at(position: DVec3, target: DVec3, up: DVec3) -> Option<Self> {
        let backward = unit(position - target)?;
        let up = unit(up)?;
        let right = up.cross(backward);
        // Below this the picture's up would be made of rounding errors.
        if right.length() < 1e-9 {
            return None;
        }
        let right = unit(right)?;
        Some(Self { rotation: DMat3::from_cols(right, backward.cross(right), backward), position })
    }

    /// The pose of a node that may scale, shear or mirror: the view direction −Z and the side on
    /// which up lies are kept, lengths and handedness are not.
    ///
    /// `None` when the map is singular or not finite.
    #[must_use]
    pub fn from_node(linear: DMat3, position: DVec3) -> Option<Self> {
        let backward = unit(linear.z_axis)?;
        let up = unit(linear.y_axis - backward * linear.y_axis.dot(backward))?;
        let rotation = DMat3::from_cols(up.cross(backward), up, backward);
        let pose = Self { rotation, position };
        pose.is_finite().then_some(pose)
    }

    /// To the right in the picture, in world space.
    #[must_use]
    pub fn right(&self) -> DVec3 {
        self.rotation.x_axis
    }

    /// Upwards in the picture, in world space.
    #[must_use]
    pub fn up(&self) -> DVec3 {
        self.rotation.y_axis
    }

    /// Along the camera's axis into the scene, in world space.
    #[must_use]
    pub fn forward(&self) -> DVec3 {
        -self.rotation.z_axis
    }

    /// True if all numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.rotation.is_finite() && self.position.is_finite()
    }

    /// The matrix from the camera's frame in `convention` to the world.
    #[must_use]
    pub fn world_from_camera(&self, convention: Convention) -> DMat4 {
        let rotation = self.rotation * convention.ours_from_theirs();
        DMat4::from_cols(
            rotation.x_axis.extend(0.0),
            rotation.y_axis.extend(0.0),
            rotation.z_axis.extend(0.0),
            self.position.extend(1.0),
        )
    }

    /// The matrix from the world to the camera's frame in `convention`.
    #[must_use]
    pub fn camera_from_world(&self, convention: Convention) -> DMat4 {
        let rotation = (self.rotation * convention.ours_from_theirs()).transpose();
        DMat4::from_cols(
            rotation.x_axis.extend(0.0),
            rotation.y_axis.extend(0.0),
            rotation.z_axis.extend(0.0),
            (-(rotation * self.position)).extend(1.0),
        )
    }

    fn from_rigid(
        rotation: DMat3,
        translation: DVec3,
        maps: Maps,
        convention: Convention,
    ) -> Option<Self> {
        let (rotation, position) = match maps {
            Maps::WorldFromCamera => (rotation, translation),
            Maps::CameraFromWorld => {
                let inverse = rotation.transpose();
                (inverse, -(inverse * translation))
            }
        };
        Self::from_node(rotation * convention.ours_from_theirs(), position)
    }
}

impl PoseSpec {
    /// The pose.
    ///
    /// # Errors
    ///
    /// When a number is not finite, the view has no direction, up lies along it, or a matrix does
    /// not rotate rigidly; the error's key is one of the pose's own.
    pub fn build(&self) -> Result<Pose, CameraError> {
        let pose = match self {
            Self::LookAt { from, look_at, up } => Self::build_look_at(*from, *look_at, *up)?,
            Self::Matrix { matrix, maps, convention } => {
                let (rotation, translation) = rigid_parts(matrix)?;
                Pose::from_rigid(rotation, translation, *maps, *convention)
                    .ok_or_else(|| CameraError::new("matrix", "the matrix is singular"))?
            }
            Self::Quaternion { quaternion, translation, maps, convention } => {
                let rotation = DQuat::from_array(*quaternion);
                let length = rotation.length();
                if !(length.is_finite() && length > 1e-9) {
                    return Err(CameraError::new(
                        "quaternion",
                        format!("{quaternion:?} has no direction; no rotation is [0, 0, 0, 1]"),
                    ));
                }
                let rotation = DMat3::from_quat(rotation.normalize());
                Pose::from_rigid(rotation, DVec3::from_array(*translation), *maps, *convention)
                    .ok_or_else(|| CameraError::new("", "the rotation is singular"))?
            }
        };
        if pose.is_finite() {
            Ok(pose)
        } else {
            Err(CameraError::new("", "a number is too large or not finite"))
        }
    }

    fn build_look_at(from: [f64; 3], at: [f64; 3], up: [f64; 3]) -> Result<Pose, CameraError> {
        let fault = |at: &str, why: String| Err(CameraError::new(at, why));
        let (from, at, up) = (DVec3::from(from), DVec3::from(at), DVec3::from(up));
        if !(from.is_finite() && at.is_finite() && up.is_finite()) {
            return fault("", "a number is not finite".to_owned());
        }
        if !(at - from).length().is_finite() {
            return fault("", "a number is too large".to_owned());
        }
        if unit(at - from).is_none() {
            return fault(
                "look_at",
                "is the same point as `from`, so the camera looks nowhere\nhint: move one of them"
                    .to_owned(),
            );
        }
        match Pose::look_at(from, at, up) {
            Some(pose) => Ok(pose),
            None if unit(up).is_none() => {
                fault("up", "has no length; +Y up is [0, 1, 0]".to_owned())
            }
            None => fault(
                "up",
                "lies along the view from `from` to `look_at`, so the picture has no upright\
                 \nhint: choose another, such as [0, 0, -1]"
                    .to_owned(),
            ),
        }
    }
}

impl From<Pose> for PoseSpec {
    fn from(pose: Pose) -> Self {
        Self::Matrix {
            matrix: pose.world_from_camera(Convention::Gltf).transpose().to_cols_array_2d(),
            maps: Maps::WorldFromCamera,
            convention: Convention::Gltf,
        }
    }
}

/// `v` at length 1, exactly so along an axis; `None` for a vector without direction.
fn unit(v: DVec3) -> Option<DVec3> {
    let length = v.length();
    (length > 0.0 && length.is_finite()).then(|| v / length)
}

/// The rotation and translation of a rigid matrix given by rows.
fn rigid_parts(rows: &[[f64; 4]; 4]) -> Result<(DMat3, DVec3), CameraError> {
    let fault = |why: String| Err(CameraError::new("matrix", why));
    if !rows.iter().flatten().all(|x| x.is_finite()) {
        return fault("a number is not finite".to_owned());
    }
    if rows[3] != [0.0, 0.0, 0.0, 1.0] {
        return fault(format!(
            "the last row is {:?} instead of [0, 0, 0, 1]; the matrix is given by rows, with the \
             translation in the last column",
            rows[3]
        ));
    }
    let column = |k: usize| DVec3::new(rows[0][k], rows[1][k], rows[2][k]);
    let rotation = DMat3::from_cols(column(0), column(1), column(2));
    let excess = rotation.transpose() * rotation - DMat3::IDENTITY;
    let worst = excess.to_cols_array().iter().fold(0.0, |worst: f64, x| worst.max(x.abs()));
    if worst > ROTATION_TOLERANCE {
        return fault(format!(
            "its upper left 3×3 part scales or shears (off a rotation by {worst:.2e}); a camera's \
             pose only turns and moves"
        ));
    }
    if rotation.determinant() < 0.0 {
        return fault(
            "its upper left 3×3 part mirrors\nhint: check the convention's signs".to_owned(),
        );
    }
    Ok((rotation, column(3)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(json: &str) -> Result<Pose, CameraError> {
        serde_json::from_str::<PoseSpec>(json).unwrap().build()
    }

    #[test]
    fn one_pose_in_every_manner_of_writing() {
        let expected =
            read(r#"{"from": [1, 2, 3], "look_at": [1, 2, 10], "up": [0, 1, 0]}"#).unwrap();
        assert_eq!(expected.forward(), DVec3::Z);
        assert_eq!(expected.right(), DVec3::NEG_X, "looking along +Z with +Y up, right is −X");
        let others = [
            r#"{"matrix": [[-1,0,0,1],[0,1,0,2],[0,0,-1,3],[0,0,0,1]],
                "maps": "world_from_camera", "convention": "gltf"}"#,
            r#"{"matrix": [[-1,0,0,1],[0,-1,0,2],[0,0,1,3],[0,0,0,1]],
                "maps": "world_from_camera", "convention": "opencv"}"#,
            r#"{"matrix": [[-1,0,0,1],[0,-1,0,2],[0,0,1,-3],[0,0,0,1]],
                "maps": "camera_from_world", "convention": "opencv"}"#,
            r#"{"quaternion": [0, 1, 0, 0], "translation": [1, 2, 3],
                "maps": "world_from_camera", "convention": "opengl"}"#,
            r#"{"quaternion": [0, 0, 2, 0], "translation": [1, 2, -3],
                "maps": "camera_from_world", "convention": "opencv"}"#,
        ];
        for json in others {
            assert_eq!(read(json).unwrap(), expected, "{json}");
        }
    }

    #[test]
    fn matrices_of_a_pose_are_inverses() {
        let pose = Pose::look_at(DVec3::new(3.0, 1.0, -2.0), DVec3::ZERO, DVec3::Y).unwrap();
        for convention in [Convention::Gltf, Convention::Opencv] {
            let product = pose.camera_from_world(convention) * pose.world_from_camera(convention);
            assert!(product.abs_diff_eq(DMat4::IDENTITY, 1e-15), "a few roundings: {product}");
        }
        let seen = pose.camera_from_world(Convention::Opencv).transform_point3(DVec3::ZERO);
        assert!((seen - DVec3::Z * 14f64.sqrt()).length() < 1e-15, "OpenCV looks along +Z: {seen}");
    }

    #[test]
    fn degenerate_views_are_refused_by_name() {
        let error = |json| read(json).unwrap_err();
        let same = error(r#"{"from": [1, 2, 3], "look_at": [1, 2, 3]}"#);
        assert_eq!(same.at, "look_at");
        let along = error(r#"{"from": [0, 5, 0], "look_at": [0, 0, 0]}"#);
        assert_eq!(along.at, "up");
        assert!(along.why.contains("[0, 0, -1]"), "{along}");
        let none = error(r#"{"from": [0, 5, 0], "look_at": [1, 0, 0], "up": [0, 0, 0]}"#);
        assert!(none.why.contains("no length"), "{none}");
        let zero = error(
            r#"{"quaternion": [0,0,0,0], "translation": [0,0,0], "maps": "world_from_camera",
                "convention": "gltf"}"#,
        );
        assert_eq!(zero.at, "quaternion");
    }

    #[test]
    fn matrices_that_are_no_rotation_are_refused() {
        let error = |matrix: &str| {
            read(&format!(
                r#"{{"matrix": {matrix}, "maps": "world_from_camera", "convention": "gltf"}}"#
            ))
            .unwrap_err()
            .why
        };
        assert!(error("[[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]").contains("scales"));
        assert!(error("[[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]").contains("mirrors"));
        assert!(error("[[1,0,0,0],[0,1,0,0],[0,0,1,0],[5,6,7,1]]").contains("last row"));
        assert!(error("[[0,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,1]]").contains("scales"));
    }

    #[test]
    fn a_scaled_and_mirrored_node_keeps_its_view() {
        let node = DMat3::from_diagonal(DVec3::new(-2.0, 3.0, 0.5));
        let pose = Pose::from_node(node, DVec3::X).unwrap();
        assert_eq!(pose, Pose { rotation: DMat3::IDENTITY, position: DVec3::X });
        assert!(Pose::from_node(DMat3::ZERO, DVec3::X).is_none());
    }
}
