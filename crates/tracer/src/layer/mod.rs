//! The layers that a render may write beside its picture: one [`table`] says all that is
//! known of each, and everything else reads it.

pub mod context;
mod fill;
mod layers;
pub mod pair;
mod plain_colors;
pub mod row;
mod rows;
pub mod table;

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

pub use self::context::{Columns, LayerContext, OtherFrame, Sight};
pub use self::pair::{FrameStep, RowMoment, StepAxis, WrittenStep};
pub use self::plain_colors::PlainColors;
pub use self::row::{Layer, Look, PupilPart, RaySource, ValueKind};
pub use self::table::LayerSpec;
use crate::Needs;

impl LayerSpec {
    /// The layer that files call `name`, with default options: names of layers with options begin with that of their
    /// row. `None` of other programs' layers.
    #[must_use]
    pub fn from_file_name(name: &str) -> Option<Self> {
        let layers = Self::NAMES.iter().filter_map(|plain| Self::from_name(plain));
        let begins = |spec: &Self| {
            let row = spec.row();
            // Where each channel is a layer of its own, its name stands behind a dot.
            let is_channel = |rest: &str| row.apart.is_none() || rest.contains('.');
            name.strip_prefix(&*row.name).is_some_and(is_channel)
        };
        layers.filter(begins).max_by_key(|spec| spec.row().name.len())
    }

    /// Tests whether the layer is a mean over the samples of a pixel; the others are taken along
    /// the chief ray of its centre.
    #[must_use]
    pub fn is_averaged(self) -> bool {
        !matches!(self.row().taken, RaySource::ChiefRay | RaySource::Sampling)
    }

    /// Tests whether the layer is light, or a part of it, which a tracer of light fills.
    #[must_use]
    pub fn is_light(self) -> bool {
        self.row().taken == RaySource::Light
    }

    /// Of which part of the pupil's light it is: whether that is left or right, and above or below where it is a
    /// quarter. `None` of other layers.
    #[must_use]
    pub fn pupil_part(self) -> Option<PupilPart> {
        Some(match self {
            Self::LeftPupil => PupilPart { left: true, top: None },
            Self::RightPupil => PupilPart { left: false, top: None },
            Self::TopLeftPupil => PupilPart { left: true, top: Some(true) },
            Self::TopRightPupil => PupilPart { left: false, top: Some(true) },
            Self::BottomLeftPupil => PupilPart { left: true, top: Some(false) },
            Self::BottomRightPupil => PupilPart { left: false, top: Some(false) },
            _ => return None,
        })
    }

    /// Tests whether the layer tells of the samples of the picture.
    #[must_use]
    pub fn is_of_sampling(self) -> bool {
        self.row().taken == RaySource::Sampling
    }

    /// The other frame that it compares this one with.
    #[must_use]
    pub fn step(self) -> Option<FrameStep> {
        match self {
            Self::Flow { to } | Self::Occlusion { to } => Some(to),
            Self::Disparity { to } => Some(to.across()),
            _ => None,
        }
    }

    /// Data of the meshes and of hits that this layer needs.
    #[must_use]
    pub fn needs(self) -> Needs {
        self.row().needs
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
            other => {
                table::LayerInput::deserialize(other).map(Self::from).map_err(D::Error::custom)
            }
        }
    }
}

impl JsonSchema for LayerSpec {
    fn schema_name() -> Cow<'static, str> {
        "Layer".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let object = generator.subschema_for::<table::LayerInput>();
        json_schema!({ "anyOf": [{ "type": "string", "enum": Self::NAMES }, object] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{NormalKind, Space};

    #[test]
    fn a_name_and_an_object_mean_the_same_layer() {
        for name in LayerSpec::NAMES {
            let short: LayerSpec = serde_json::from_value(name.into()).unwrap();
            let long: LayerSpec =
                serde_json::from_value(serde_json::json!({ "type": name })).unwrap();
            assert_eq!(short, long);
        }
        let camera: LayerSpec =
            serde_json::from_str(r#"{"type": "normal", "space": "camera"}"#).unwrap();
        assert_ne!(LayerSpec::from_name("normal"), Some(camera));
    }

    #[test]
    fn every_name_is_a_layer_and_others_are_refused() {
        for name in LayerSpec::NAMES {
            assert!(LayerSpec::from_name(name).is_some(), "{name}");
        }
        let error = serde_json::from_str::<LayerSpec>("\"dept\"").unwrap_err().to_string();
        assert!(error.contains("`depth`"), "{error}");
        assert!(serde_json::from_str::<LayerSpec>(r#"{"type": "depth", "space": 1}"#).is_err());
        assert!(serde_json::from_str::<LayerSpec>(r#"{"type": "radiance"}"#).is_err());
    }

    #[test]
    fn layers_of_files_have_names_of_their_own() {
        let frames = [Space::World, Space::Camera, Space::Opencv];
        let kinds = [NormalKind::Geometric, NormalKind::Shading];
        let normals = frames
            .iter()
            .flat_map(|&space| kinds.iter().map(move |&kind| LayerSpec::Normal { space, kind }));
        let positions = frames.iter().map(|&space| LayerSpec::Position { space });
        let plain = LayerSpec::NAMES.iter().filter_map(|name| LayerSpec::from_name(name));
        let mut layers: Vec<LayerSpec> = plain.chain(normals).chain(positions).collect();
        layers.extend([LayerSpec::Backdrop, LayerSpec::Radiance]);
        for step in [-12, -1, 2] {
            let to = FrameStep::try_from(WrittenStep::Frames(step)).unwrap();
            let pair =
                [LayerSpec::Flow { to }, LayerSpec::Disparity { to }, LayerSpec::Occlusion { to }];
            layers.extend(pair);
            let to = to.across();
            let pair =
                [LayerSpec::Flow { to }, LayerSpec::Disparity { to }, LayerSpec::Occlusion { to }];
            layers.extend(pair);
        }
        for moment in [RowMoment::Open, RowMoment::Close] {
            let to = FrameStep::try_from(WrittenStep::Moment(moment)).unwrap();
            assert_eq!((to.moment(), to.across()), (Some(moment), to));
            let pair =
                [LayerSpec::Flow { to }, LayerSpec::Disparity { to }, LayerSpec::Occlusion { to }];
            layers.extend(pair);
        }
        layers.dedup();
        let rows = layers.into_iter().collect::<std::collections::HashSet<_>>();
        let count: usize = rows.iter().map(|layer| layer.row().names_in_files().len()).sum();
        let names: std::collections::HashSet<_> =
            rows.iter().flat_map(|layer| layer.row().names_in_files()).collect();
        assert_eq!(names.len(), count, "{names:?}");
        // And files' names lead back to them.
        for layer in rows
            .iter()
            .filter(|layer| layer.row().name != "Backdrop" && layer.row().name != "Radiance")
        {
            for name in layer.row().names_in_files() {
                let found = LayerSpec::from_file_name(&name).unwrap();
                assert_eq!(std::mem::discriminant(&found), std::mem::discriminant(layer), "{name}");
            }
        }
        for foreign in ["", "Radiance", "Id", "Identity", "T"] {
            assert_eq!(LayerSpec::from_file_name(foreign), None, "{foreign}");
        }
    }
}
