//! The layers that a render may write beside its picture: one [`table`] says all that is
//! known of each, and everything else reads it.

mod fill;
mod layers;
pub mod pair;
mod rows;
pub mod table;

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

pub use self::pair::{FrameStep, OtherFrame, RowMoment, Sight, StepAxis, WrittenStep};
pub use self::table::LayerSpec;
use crate::{LightingContext, Needs, SceneView, TracedBatch};

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

/// One of a surface's two normals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NormalKind {
    /// The plane of the triangle.
    #[default]
    Geometric,
    /// Interpolated from the file's vertex normals, where it has them.
    Shading,
}

/// A row of the table of layers: what is known of a layer without rendering it.
#[derive(Debug, Clone)]
pub struct Layer {
    /// The name in files.
    pub name: Cow<'static, str>,
    /// The channels in files, in order. [`LayerSpec::Radiance`] has one a band instead, where the
    /// bands are others than red, green and blue.
    pub channels: &'static [&'static str],
    /// Format in which the numbers are kept.
    pub kept: ValueKind,
    /// Rays of a pixel that they are taken from.
    pub taken: RaySource,
    /// Way in which a preview shows them.
    pub look: Look,
    /// Data of the meshes and of hits that filling it needs.
    pub needs: Needs,
    /// Meaning of the numbers, by key: `definition`, `unit`, `frame`, `miss` and their like.
    pub meaning: Vec<(&'static str, &'static str)>,
    /// The definition of each channel, where each is a layer of its own in files, `Id.object.X`:
    /// the form that Blender reads.
    pub apart: Option<&'static [&'static str]>,
}

impl Layer {
    /// The names of the layers that it is in files.
    #[must_use]
    pub fn names_in_files(&self) -> Vec<String> {
        match self.apart {
            Some(_) => self.channels.iter().map(|c| format!("{}.{c}", self.name)).collect(),
            None => vec![self.name.clone().into_owned()],
        }
    }
}

/// Kind of the numbers of a layer, and so the way in which a preview shows them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// Linear light, one channel (grey) or three (red, green, blue), 1 being full scale. Shown
    /// through the sRGB curve; what is brighter than 1 is clipped.
    Color,
    /// One channel of distances: the nearest hundredth white, farther ones darker, linear in the
    /// reciprocal; a miss (not finite) black.
    Distance,
    /// Three channels of a unit vector n, shown as (n + 1)/2; a miss (the zero vector)
    /// transparent.
    Direction,
    /// One to three channels, each stretched from its least to its greatest finite value (one alone is grey):
    /// positions, texture coordinates, numbers of samples. A pixel that is not finite is transparent.
    Extent,
    /// Integers that name things, each in a colour of its own; 0 (a miss) transparent. Only the
    /// first channel is shown.
    Ids,
    /// One channel of shares in 0..=1, linear grey: coverage, vignetting.
    Share,
    /// Any number of channels of linear light, shown as the grey of their mean.
    Cube,
    /// One channel or three of a sensor's digital numbers of so many bits. Not a preview: a PNG
    /// holds the numbers themselves, unscaled, in 16 bits.
    Counts {
        /// Bits of a number, 1 to 16.
        bits: u8,
    },
}

/// Format in which numbers are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ValueKind {
    /// As 64-bit floats where a file is wanted that holds them, else 32-bit: measurements.
    Measured,
    /// As 32-bit floats: colours and shares.
    Shown,
    /// As 32-bit integers, counted from 1: names of things.
    Counted,
}

/// Rays of a pixel that a layer is taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RaySource {
    /// The chief ray of its centre.
    ChiefRay,
    /// The mean over its samples. What is averaged is three numbers a ray, of which the camera sends
    /// each its own way where wavelengths part, as it does with red, green and blue.
    Samples,
    /// The mean over the samples of the picture, even if that is one alone: what the picture is to
    /// be judged by.
    PictureSamples,
    /// The light of the samples of the picture, which a tracer follows: one number a spectral band.
    Light,
    /// The sum of the first number over the samples of the picture, as a share of the sum of the
    /// second.
    PictureShare,
    /// Statistics of the picture's own sampling.
    Sampling,
}

impl RaySource {
    /// Tests whether the layer is taken where the picture's own samples are.
    #[must_use]
    pub fn with_picture(self) -> bool {
        match self {
            Self::ChiefRay | Self::Samples | Self::Light | Self::Sampling => false,
            Self::PictureSamples | Self::PictureShare => true,
        }
    }
}

/// Data that layers are filled from: the rays of a batch, what they hit, and the scene.
#[derive(Debug, Clone, Copy)]
pub struct LayerContext<'a> {
    /// The scene.
    pub scene: SceneView<'a>,
    /// The batch.
    pub traced: TracedBatch<'a>,
    /// The scene's light, where it is traced.
    pub light: Option<LightingContext<'a>>,
    /// Columns and rows of the rays on the sensor (pixels from the corner of the top left one); empty where
    /// layers are averaged over samples.
    pub places: [&'a [f64]; 2],
    /// Other frames of the scene, for layers that compare frames.
    pub others: &'a [&'a dyn OtherFrame],
}

/// One number of each ray, as many times as a layer has channels.
pub type Columns = [Vec<f64>; 4];

/// A half or a quarter of the pupil, as the camera sees it from behind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PupilPart {
    /// Left, else right.
    pub left: bool,
    /// Above, below, or both.
    pub top: Option<bool>,
}

impl PupilPart {
    /// Tests whether a place of the entrance pupil, to the right of its middle and above it, is in this part. The
    /// middle is right and above.
    #[must_use]
    pub fn contains(self, [right, up]: [f64; 2]) -> bool {
        self.left == (right < 0.0) && self.top.is_none_or(|top| top == (up >= 0.0))
    }
}

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
