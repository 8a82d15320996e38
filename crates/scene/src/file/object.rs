//! The objects of a scene file: models and shapes, and where they stand.

use std::borrow::Cow;
use std::collections::BTreeMap;

use etendue_geometry::units::Seconds;
use etendue_geometry::{Interpolation, Motion, MotionError, Steady, Transform};
use glam::{DMat3, DQuat, DVec3};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error as _;
use serde::ser::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value, json};

use super::values::read_within;
use crate::shape::ShapeSpec;

/// One entry of `objects`.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectSpec {
    /// Source of the object's triangles.
    pub source: Source,
    /// Name of the object in the rest of the file and in the outputs.
    pub name: Option<String>,
    /// The name of a material, which replaces those of the model.
    pub material: Option<String>,
    /// For materials of the model by name, the name of the material that replaces each; they go
    /// before [`Self::material`].
    pub materials: BTreeMap<String, String>,
    /// Axis of the model's file that points up; that of the scene when absent.
    pub up: Option<Up>,
    /// The moment of a glTF file's animation that is shown; at rest when absent.
    pub animation: Option<AnimationSpec>,
    /// Placement of the object.
    pub transform: TransformSpec,
    /// Placements of its copies before `transform` moves them all; one, unmoved, when absent.
    pub instances: Option<InstancesSpec>,
    /// Motion of the object, with all its copies, while the shutter is open; it stands still when absent.
    pub motion: Option<ObjectMotionSpec>,
}

/// Motion of an object, as the scene file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum ObjectMotionSpec {
    /// At constant speed along a line, turning at constant speed about an axis that goes along: from `transform`, where
    /// the object stands at the frame's time.
    Velocity {
        /// The velocity (m/s), along the world's axes.
        #[serde(default)]
        velocity: [f64; 3],
        /// The angular velocity (degrees/s): its direction is the axis, right-handed, along the world's axes.
        #[serde(default)]
        angular_velocity: [f64; 3],
        /// A point on the axis at the frame's time (m); where `transform` puts the object's origin when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        about: Option<[f64; 3]>,
    },
    /// Through transforms, instead of `transform`: between two of them the rotation goes the shorter way at constant
    /// speed, and the scale is linear.
    Transforms {
        /// Two or more, which do not shear.
        transforms: Vec<TransformSpec>,
        /// When the object is there (s, in the scene's clock), increasing.
        times: Vec<Seconds>,
        /// Interpolation of its place between two transforms.
        #[serde(default)]
        translation: Interpolation,
    },
}

impl ObjectMotionSpec {
    /// The motion of the object's frame in the clock of a frame of this time (s); `transform` is where it stands then.
    /// The error has the key and the reason.
    pub(crate) fn build(
        &self,
        transform: &TransformSpec,
        time: f64,
    ) -> Result<Motion, (String, String)> {
        match self {
            Self::Velocity { velocity, angular_velocity, about } => {
                let stands = transform.build().map_err(|(key, why)| (key.to_owned(), why))?;
                let about = about.map_or(stands.translation, DVec3::from);
                let steady = Steady::of_velocities(*velocity, *angular_velocity, about)
                    .map_err(|(key, why)| (key.to_owned(), why.to_owned()))?;
                let motion = Motion::default().with_steady(steady);
                let fault = |error: MotionError| ("angular_velocity".to_owned(), error.to_string());
                Ok(motion.map_err(fault)?.then_inner(&stands))
            }
            Self::Transforms { transforms, times, translation } => {
                if *transform != TransformSpec::default() {
                    let why =
                        "is given beside `transform`, whose place it takes\nhint: leave that out";
                    return Err(("transforms".to_owned(), why.to_owned()));
                }
                if transforms.len() < 2 {
                    let why =
                        "do not move\nhint: give two or more, or `transform` without `motion`";
                    return Err(("transforms".to_owned(), why.to_owned()));
                }
                let mut built = Vec::with_capacity(transforms.len());
                for (i, one) in transforms.iter().enumerate() {
                    built.push(one.build().map_err(|(key, why)| {
                        let dot = if key.is_empty() { "" } else { "." };
                        (format!("transforms[{i}]{dot}{key}"), why)
                    })?);
                }
                let times: Vec<f64> = times.iter().map(|at| at.0 - time).collect();
                let fault = |error: MotionError| {
                    let key = match &error {
                        MotionError::Count { .. }
                        | MotionError::Order { .. }
                        | MotionError::NotFinite(_) => "times".to_owned(),
                        MotionError::Shear(k) | MotionError::Scale(k) => format!("transforms[{k}]"),
                        MotionError::Axis => "transforms".to_owned(),
                    };
                    (key, error.to_string())
                };
                Motion::through(&times, &built, *translation).map_err(fault)
            }
        }
    }
}

/// A moment of a glTF file's animation: nodes, skins, morph targets, cameras and lights are as they are then.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AnimationSpec {
    /// When; before its first key and after its last an animation stands still.
    pub time: Seconds,
    /// Name of one of the file's animations, or its number from 0; the first when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// True if it goes on from there while the shutter is open: nodes move, and skins and morph targets change shapes.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub plays: bool,
}

/// Axis of a file's coordinates that points up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Up {
    /// +Y, as in glTF and in the scene.
    #[default]
    Y,
    /// +Z: the model is turned by −90° about X, so that its +Z becomes +Y and its +Y becomes −Z.
    Z,
}

impl Up {
    /// From the file's coordinates to those with +Y up; exact.
    pub(crate) fn turn(self) -> Transform {
        match self {
            Self::Y => Transform::IDENTITY,
            Self::Z => {
                let linear = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y);
                Transform::new(linear, DVec3::ZERO)
            }
        }
    }
}

/// Copies of an object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum InstancesSpec {
    /// An NPY file of n × 4 × 4 or n × 3 × 4 matrices by rows, float32 or float64, relative to the
    /// scene file.
    File(String),
    /// A transform for each copy.
    List(Vec<TransformSpec>),
}

/// Source of an object's triangles.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// A glTF, OBJ or PLY file, as the scene writes its path.
    File(String),
    /// A shape made on load.
    Shape(ShapeSpec),
}

/// The keys that every object may have.
#[derive(Serialize, Deserialize, JsonSchema)]
struct Common {
    /// Name of the object in outputs.
    #[serde(default)]
    name: Option<String>,
    /// The name of one of `materials`; replaces those of the model.
    #[serde(default)]
    material: Option<String>,
    /// For materials of the model by name, the one of the scene's `materials` that replaces each.
    #[serde(default)]
    materials: BTreeMap<String, String>,
    /// Axis of the file's coordinates that points up, before `transform`; the scene's `up` for OBJ and
    /// PLY files when absent, and +Y for all else.
    #[serde(default)]
    up: Option<Up>,
    /// The moment of a glTF file's animation that is shown; at rest when absent.
    #[serde(default)]
    animation: Option<AnimationSpec>,
    /// Its placement.
    #[serde(default)]
    transform: TransformSpec,
    /// Placements of copies of it, all moved by `transform`: a list of transforms, or an NPY file of
    /// n × 4 × 4 or n × 3 × 4 matrices by rows.
    #[serde(default)]
    instances: Option<InstancesSpec>,
    /// Its motion while the shutter is open; it stands still when absent.
    #[serde(default)]
    motion: Option<ObjectMotionSpec>,
}

/// A model.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct WrittenModel {
    /// A glTF, GLB, OBJ or PLY file, relative to the scene file.
    #[serde(rename = "file")]
    _file: String,
}

impl ObjectSpec {
    /// Title of the object: its name, else its file's or shape's.
    #[must_use]
    pub fn title(&self) -> String {
        match (&self.name, &self.source) {
            (Some(name), _) => name.clone(),
            (None, Source::File(path)) => path.clone(),
            (None, Source::Shape(shape)) => shape.name().to_owned(),
        }
    }
}

impl<'de> Deserialize<'de> for ObjectSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut own = Map::<String, Value>::deserialize(deserializer)?;
        let mut common = Map::new();
        for key in
            ["name", "material", "materials", "up", "animation", "transform", "instances", "motion"]
        {
            if let Some(value) = own.remove(key) {
                common.insert(key.to_owned(), value);
            }
        }
        let Common { name, material, materials, up, animation, transform, instances, motion } =
            read_within::<_, D::Error>(&Value::Object(common))?;
        let source = match own.remove("file") {
            Some(Value::String(path)) if own.is_empty() => Source::File(path),
            Some(Value::String(_)) => {
                return Err(D::Error::custom("a model with a `file` has no keys of a shape"));
            }
            Some(_) => return Err(D::Error::custom("`file` is not a string")),
            None => Source::Shape(read_within::<_, D::Error>(&Value::Object(own))?),
        };
        Ok(Self { source, name, material, materials, up, animation, transform, instances, motion })
    }
}

impl Serialize for ObjectSpec {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let source = match &self.source {
            Source::File(path) => Ok(json!({ "file": path })),
            Source::Shape(shape) => serde_json::to_value(shape),
        };
        let Self { name, material, materials, up, animation, transform, instances, motion, .. } =
            self.clone();
        let common =
            Common { name, material, materials, up, animation, transform, instances, motion };
        let mut keys = Map::new();
        for part in [source, serde_json::to_value(common)] {
            if let Value::Object(part) = part.map_err(S::Error::custom)? {
                keys.extend(part.into_iter().filter(|(_, value)| !value.is_null()));
            }
        }
        keys.serialize(serializer)
    }
}

impl JsonSchema for ObjectSpec {
    fn schema_name() -> Cow<'static, str> {
        "Object".into()
    }

    /// The model and each shape, all with the common keys: serde cannot both flatten and refuse
    /// unknown keys, so the parts are joined here.
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let common = Common::json_schema(generator);
        let mut kinds = vec![WrittenModel::json_schema(generator).to_value()];
        match ShapeSpec::json_schema(generator).get("oneOf") {
            Some(Value::Array(shapes)) => kinds.extend(shapes.iter().cloned()),
            _ => kinds.push(ShapeSpec::json_schema(generator).to_value()),
        }
        for kind in &mut kinds {
            let keys = kind.get_mut("properties").and_then(Value::as_object_mut);
            if let (Some(keys), Some(Value::Object(shared))) = (keys, common.get("properties")) {
                keys.extend(shared.clone());
            }
        }
        json_schema!({ "description": "A model or a shape.", "oneOf": kinds })
    }
}

/// Placement of an object: scaled, then rotated, then translated; or one matrix.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TransformSpec {
    /// Moves by this much (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub translate: Option<[f64; 3]>,
    /// Turns about the axis (x, y, z) by an angle: `[x, y, z, degrees]`, counter-clockwise when
    /// looked at against the axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotate: Option<[f64; 4]>,
    /// Turns by a quaternion `[x, y, z, w]`; normalised here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quaternion: Option<[f64; 4]>,
    /// Scales alike along all axes, or by one factor an axis; negative factors mirror.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<Scale>,
    /// Four rows, translation in the last column (m), instead of the others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub matrix: Option<[[f64; 4]; 4]>,
}

/// A scale.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Scale {
    /// The same along all axes.
    Uniform(f64),
    /// One factor an axis.
    PerAxis([f64; 3]),
}

/// Fault of a transform: the key and the reason.
pub(crate) type TransformFault = (&'static str, String);

impl TransformSpec {
    /// The map from the object's frame to the world (m); the error when it is singular or not
    /// finite, an axis has no length, or two keys contradict.
    pub(crate) fn build(&self) -> Result<Transform, TransformFault> {
        let transform = match &self.matrix {
            Some(rows) => self.affine(rows)?,
            None => {
                let rotation = self.rotation()?;
                let linear = rotation * DMat3::from_diagonal(self.scale_factors()?);
                Transform::new(linear, DVec3::from(self.translate.unwrap_or_default()))
            }
        };
        if transform.is_finite() {
            Ok(transform)
        } else {
            Err(("", "a number is too large or not finite".to_owned()))
        }
    }

    fn affine(&self, rows: &[[f64; 4]; 4]) -> Result<Transform, TransformFault> {
        let others = [
            ("translate", self.translate.is_some()),
            ("rotate", self.rotate.is_some()),
            ("quaternion", self.quaternion.is_some()),
            ("scale", self.scale.is_some()),
        ];
        if let Some((key, _)) = others.into_iter().find(|(_, given)| *given) {
            return Err((key, "is given beside `matrix`\nhint: give one or the other".to_owned()));
        }
        if rows[3] != [0.0, 0.0, 0.0, 1.0] {
            let why = format!(
                "the last row is {:?} instead of [0, 0, 0, 1]; the matrix is given by rows, with \
                 the translation in the last column",
                rows[3]
            );
            return Err(("matrix", why));
        }
        let column = |k: usize| DVec3::new(rows[0][k], rows[1][k], rows[2][k]);
        let linear = DMat3::from_cols(column(0), column(1), column(2));
        // Relative to its columns' lengths the determinant is a volume without unit.
        let volume: f64 = (0..3).map(|k| column(k).length()).product();
        let determinant = linear.determinant().abs();
        if determinant.is_nan() || determinant <= 1e-12 * volume {
            let why = "is singular: it flattens the object\nhint: check the rows".to_owned();
            return Err(("matrix", why));
        }
        Ok(Transform::new(linear, column(3)))
    }

    fn rotation(&self) -> Result<DMat3, TransformFault> {
        match (self.rotate, self.quaternion) {
            (Some(_), Some(_)) => Err((
                "quaternion",
                "is given beside `rotate`\nhint: give one or the other".to_owned(),
            )),
            (Some([x, y, z, degrees]), None) => match DVec3::new(x, y, z).try_normalize() {
                Some(axis) => Ok(turn(axis, degrees)),
                None => Err((
                    "rotate",
                    format!("the axis [{x}, {y}, {z}] has no length; about +Y it is [0, 1, 0, …]"),
                )),
            },
            (None, Some(quaternion)) => {
                let rotation = DQuat::from_array(quaternion);
                if rotation.length() > 1e-9 {
                    Ok(DMat3::from_quat(rotation.normalize()))
                } else {
                    let why = "has no direction; no rotation is [0, 0, 0, 1]".to_owned();
                    Err(("quaternion", why))
                }
            }
            (None, None) => Ok(DMat3::IDENTITY),
        }
    }

    fn scale_factors(&self) -> Result<DVec3, TransformFault> {
        let factors = match self.scale {
            None => DVec3::ONE,
            Some(Scale::Uniform(factor)) => DVec3::splat(factor),
            Some(Scale::PerAxis(factors)) => factors.into(),
        };
        if factors.cmpeq(DVec3::ZERO).any() {
            return Err(("scale", "is zero, which flattens the object".to_owned()));
        }
        Ok(factors)
    }
}

/// The rotation about a unit axis (Rodrigues), exact for quarter turns about the coordinate axes.
fn turn(axis: DVec3, degrees: f64) -> DMat3 {
    let (sin, cos) = match degrees.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        other => other.to_radians().sin_cos(),
    };
    let column = |e: DVec3| e * cos + axis.cross(e) * sin + axis * (axis.dot(e) * (1.0 - cos));
    DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn build(json: &str) -> Result<Transform, TransformFault> {
        serde_json::from_str::<TransformSpec>(json).unwrap().build()
    }

    #[test]
    fn scales_then_turns_then_moves() {
        let map =
            build(r#"{"translate": [1, 2, 3], "rotate": [0, 2, 0, 90], "scale": 2}"#).unwrap();
        assert_eq!(map.point(DVec3::X), DVec3::new(1.0, 2.0, 1.0), "+X turns to −Z about +Y");
        let map = build(r#"{"quaternion": [0, 0, 1, 0], "scale": [1, 2, 3]}"#).unwrap();
        assert_eq!(map.point(DVec3::ONE), DVec3::new(-1.0, -2.0, 3.0));
        let rows = r#"{"matrix": [[0,0,2,1],[0,2,0,2],[-2,0,0,3],[0,0,0,1]]}"#;
        assert_eq!(build(rows).unwrap().point(DVec3::X), DVec3::new(1.0, 2.0, 1.0));
        assert!(build("{}").unwrap().is_identity());
        // A third of a turn about the diagonal swaps the axes around; sin and cos round once each.
        let turned = build(r#"{"rotate": [1, 1, 1, 120]}"#).unwrap().point(DVec3::X);
        assert!((turned - DVec3::Y).length() < 1e-15, "{turned}");
    }

    #[test]
    fn what_cannot_be_undone_is_refused() {
        let fault = |json| build(json).unwrap_err();
        assert_eq!(fault(r#"{"scale": 0}"#).0, "scale");
        assert_eq!(fault(r#"{"scale": [1, 0, 1]}"#).0, "scale");
        assert_eq!(fault(r#"{"rotate": [0, 0, 0, 30]}"#).0, "rotate");
        assert_eq!(fault(r#"{"quaternion": [0, 0, 0, 0]}"#).0, "quaternion");
        assert_eq!(fault(r#"{"quaternion": [0,0,0,1], "rotate": [1,0,0,1]}"#).0, "quaternion");
        let flat = r#"{"matrix": [[1,2,0,0],[2,4,0,0],[0,0,1,0],[0,0,0,1]]}"#;
        assert!(fault(flat).1.contains("singular"));
        let turned_over = r#"{"matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[1,2,3,1]]}"#;
        assert!(fault(turned_over).1.contains("last row"));
        let both = r#"{"matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "scale": 2}"#;
        assert_eq!(fault(both).0, "scale");
    }
}
