//! The layers that a render may write beside its picture, as the scene file names them.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

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

/// Which of a surface's two normals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NormalKind {
    /// The plane of the triangle.
    #[default]
    Geometric,
    /// Interpolated from the file's vertex normals, where it has them.
    Shading,
}

/// A layer as the scene file writes it: a name (`"depth"`), or an object with a `type` and options
/// (`{"type": "normal", "space": "camera"}`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum LayerSpec {
    /// `Depth.Z`: distance along the camera's axis from the entrance pupil (m).
    Depth,
    /// `Distance.Z`: distance along the ray from the entrance pupil, or for parallel rays from the
    /// plane through the camera's origin (m).
    Distance,
    /// `Normal.X Y Z`: unit normal that faces the viewer.
    Normal {
        /// The frame.
        space: Space,
        /// Which normal.
        kind: NormalKind,
    },
    /// `Position.X Y Z`: the point that was hit (m).
    Position {
        /// The frame.
        space: Space,
    },
    /// `Id.object.X`, `Id.instance.X`, `Id.node.X` and `Id.primitive.X`: which object, which copy of it,
    /// which node of its model, and which triangle of its mesh.
    Ids,
    /// `Coverage.A`: 1 where the pixel's chief ray hits, else 0.
    Coverage,
    /// `Flat.R G B`: base colour without light.
    Flat,
    /// `Facing.R G B`: base colour under a headlight, to look at.
    Facing,
    /// `Albedo.R G B`: base colour along the chief ray, not averaged.
    Albedo,
    /// `Uv.U V`: texture coordinates of the first set.
    Uv,
    /// `MaterialId.X`: which material.
    MaterialId,
    /// `Alpha.A`: share of the pixel's samples that hit something.
    Alpha,
    /// `Backdrop.R G B`: the part of the picture's radiance that came past everything. No file names
    /// it; it comes with `render.alpha` and a tracer of light.
    Backdrop,
    /// The picture of a tracer of light: radiance, one channel a spectral band. No file names it;
    /// it comes with the tracer.
    Radiance,
}

/// The same, with every option optional and unknown keys refused: what is read.
#[derive(Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
enum Written {
    Depth {},
    Distance {},
    Normal {
        #[serde(default)]
        space: Space,
        #[serde(default)]
        kind: NormalKind,
    },
    Position {
        #[serde(default)]
        space: Space,
    },
    Ids {},
    Coverage {},
    Flat {},
    Facing {},
    Albedo {},
    Uv {},
    MaterialId {},
    Alpha {},
}

impl LayerSpec {
    /// Every layer by its plain name, in the order that help texts list them.
    pub const NAMES: [&'static str; 12] = [
        "depth",
        "distance",
        "normal",
        "position",
        "ids",
        "coverage",
        "flat",
        "facing",
        "albedo",
        "uv",
        "material_id",
        "alpha",
    ];

    /// Whether the layer is a mean over the samples of a pixel; the others are taken along the chief
    /// ray of its centre.
    #[must_use]
    pub fn is_averaged(self) -> bool {
        matches!(self, Self::Flat | Self::Facing | Self::Alpha | Self::Backdrop | Self::Radiance)
    }

    /// The layer of this plain name, with default options.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "depth" => Self::Depth,
            "distance" => Self::Distance,
            "normal" => Self::Normal { space: Space::World, kind: NormalKind::Geometric },
            "position" => Self::Position { space: Space::World },
            "ids" => Self::Ids,
            "coverage" => Self::Coverage,
            "flat" => Self::Flat,
            "facing" => Self::Facing,
            "albedo" => Self::Albedo,
            "uv" => Self::Uv,
            "material_id" => Self::MaterialId,
            "alpha" => Self::Alpha,
            _ => return None,
        })
    }
}

impl From<Written> for LayerSpec {
    fn from(written: Written) -> Self {
        match written {
            Written::Depth {} => Self::Depth,
            Written::Distance {} => Self::Distance,
            Written::Normal { space, kind } => Self::Normal { space, kind },
            Written::Position { space } => Self::Position { space },
            Written::Ids {} => Self::Ids,
            Written::Coverage {} => Self::Coverage,
            Written::Flat {} => Self::Flat,
            Written::Facing {} => Self::Facing,
            Written::Albedo {} => Self::Albedo,
            Written::Uv {} => Self::Uv,
            Written::MaterialId {} => Self::MaterialId,
            Written::Alpha {} => Self::Alpha,
        }
    }
}

impl<'de> Deserialize<'de> for LayerSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match serde_json::Value::deserialize(deserializer)? {
            serde_json::Value::String(name) => Self::from_name(&name).ok_or_else(|| {
                D::Error::custom(format!(
                    "unknown layer `{name}`, expected one of {}",
                    Self::NAMES.map(|name| format!("`{name}`")).join(", ")
                ))
            }),
            other => Written::deserialize(other).map(Self::from).map_err(D::Error::custom),
        }
    }
}

impl JsonSchema for LayerSpec {
    fn schema_name() -> Cow<'static, str> {
        "Layer".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let object = generator.subschema_for::<Written>();
        json_schema!({ "anyOf": [{ "type": "string", "enum": Self::NAMES }, object] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_and_an_object_mean_the_same_layer() {
        let short: LayerSpec = serde_json::from_str("\"normal\"").unwrap();
        let long: LayerSpec = serde_json::from_str(r#"{"type": "normal"}"#).unwrap();
        assert_eq!(short, long);
        let camera: LayerSpec =
            serde_json::from_str(r#"{"type": "normal", "space": "camera"}"#).unwrap();
        assert_ne!(short, camera);
    }

    #[test]
    fn every_name_is_a_layer_and_others_are_refused() {
        for name in LayerSpec::NAMES {
            assert!(LayerSpec::from_name(name).is_some(), "{name}");
        }
        let error = serde_json::from_str::<LayerSpec>("\"dept\"").unwrap_err().to_string();
        assert!(error.contains("`depth`"), "{error}");
        assert!(serde_json::from_str::<LayerSpec>(r#"{"type": "depth", "space": 1}"#).is_err());
    }
}
