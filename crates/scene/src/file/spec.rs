//! A scene file's top level.
//!
//! What people and editors may write beside the format: comments, the schema's address, and a resolution as
//! screens have it.
//!
//! The scene format as a JSON Schema, made from the types that read it.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::LazyLock;

use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value, json};

use super::{
    AccuracySpec, FramesSpec, ObjectSpec, PlanSpec, RenderSpec, ScenePath, SlotSpec, ToleranceSpec,
    TracerSpec, Up,
};
use etendue_camera::CameraSpec;
use etendue_optics::train::NOTES;
use etendue_sensor::SensorSpec;
use etendue_tracer::{LayerSpec, LightGroup, LightSpec, MaterialSpec};

/// A scene as the file writes it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneSpec {
    /// The version of the format.
    pub etendue: FormatVersion,
    /// The camera; a pinhole that frames the scene when absent.
    #[serde(default)]
    #[schemars(with = "Option<CameraSource>")]
    pub camera: Option<CameraSpec>,
    /// Content of the picture. When absent there is a picture only if there are no `layers` either, and
    /// it shows `facing`.
    #[serde(default)]
    pub tracer: Option<TracerSpec>,
    /// The layers to write beside the picture.
    #[serde(default)]
    pub layers: Vec<LayerSpec>,
    /// Axis that points up in OBJ and PLY files, which do not say; an object's own `up` goes before.
    #[serde(default)]
    pub up: Up,
    /// Surfaces of glTF models that are not `doubleSided` are not there from behind.
    #[serde(default)]
    pub cull_backfaces: bool,
    /// Objects of the scene; may be empty.
    #[serde(default)]
    pub objects: Vec<ObjectSpec>,
    /// Materials by name, for `objects` to use.
    #[serde(default)]
    pub materials: BTreeMap<String, MaterialSpec>,
    /// Lights of the scene, beside emissive surfaces and the models' own lights. When there is
    /// none at all, a studio lights the scene; an empty list leaves it dark.
    #[serde(default)]
    pub lights: Option<Vec<LightSpec>>,
    /// Settings of the render.
    #[serde(default)]
    pub render: RenderSpec,
    /// Decisions that the plan is given instead of making them.
    #[serde(default)]
    pub plan: PlanSpec,
    /// Numbers that trade accuracy for speed.
    #[serde(default, skip_serializing_if = "AccuracySpec::is_default")]
    pub accuracy: AccuracySpec,
    /// Errors that the picture may have, of which the plan takes what is cheapest. Nothing is approximated when
    /// absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<ToleranceSpec>,
    /// The pictures to be made of it; one when absent.
    #[serde(default)]
    pub frames: Option<FramesSpec>,
    /// The slots of its exposure, whose light the sensor adds up: with cameras, masks, filters or lights of their own.
    /// It is in one piece when there are none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub serial: Vec<SlotSpec>,
}

impl SceneSpec {
    /// The layer that holds the picture, if there is to be one.
    #[must_use]
    pub fn picture(&self) -> Option<LayerSpec> {
        match (self.tracer, self.layers.is_empty()) {
            (Some(tracer), _) => Some(tracer.layer()),
            (None, true) => Some(LayerSpec::Facing),
            (None, false) => None,
        }
    }

    /// All layers, each once: the picture first.
    #[must_use]
    pub fn all_layers(&self) -> Vec<LayerSpec> {
        let mut all = Vec::new();
        let picture = self.picture();
        let behind = match picture.filter(|_| self.render.alpha) {
            Some(LayerSpec::Radiance) => [Some(LayerSpec::Alpha), Some(LayerSpec::Backdrop)],
            Some(_) => [Some(LayerSpec::Alpha), None],
            None => [None; 2],
        };
        let wanted = self.layers.iter().copied().chain(behind.into_iter().flatten());
        for layer in picture.into_iter().chain(wanted) {
            let layers = match layer {
                LayerSpec::LightGroups => self.light_groups(),
                layer => vec![layer],
            };
            for layer in layers {
                if !all.contains(&layer) {
                    all.push(layer);
                }
            }
        }
        all
    }

    /// The layer of each group of lights.
    fn light_groups(&self) -> Vec<LayerSpec> {
        let lights = self.lights.iter().flatten().filter_map(LightSpec::group);
        let shining = self.materials.values().filter_map(MaterialSpec::group);
        let groups: BTreeSet<LightGroup> =
            lights.chain(shining).chain([LightGroup::OTHER]).collect();
        groups.into_iter().map(|group| LayerSpec::LightGroup { group }).collect()
    }

    /// Fault of the layers: their place, and why.
    pub(super) fn layer_fault(&self) -> Option<(String, String)> {
        if self.picture() == Some(LayerSpec::Radiance) {
            return None;
        }
        let number = self.layers.iter().position(|layer| layer.is_light())?;
        let why = "is a part of the picture's light, and the picture shows none\nhint: give the scene a `tracer` \
                   of light, such as {\"type\": \"path\"}, or leave the layer out";
        Some((format!("layers[{number}]"), why.to_owned()))
    }

    /// The layers that tell of samples which go on until an error is reached, by name.
    pub(super) fn sampling_layers(&self) -> Vec<&'static str> {
        let statistics =
            [(LayerSpec::SampleCount, "sample_count"), (LayerSpec::Variance, "variance")];
        statistics
            .iter()
            .filter(|(layer, _)| self.layers.contains(layer))
            .map(|(_, name)| *name)
            .collect()
    }
}

/// The number 1: the version of the format that this program reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FormatVersion;

impl FormatVersion {
    /// The number.
    pub const NUMBER: u64 = 1;
}

impl Serialize for FormatVersion {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_u64(Self::NUMBER)
    }
}

impl<'de> Deserialize<'de> for FormatVersion {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match u64::deserialize(deserializer)? {
            Self::NUMBER => Ok(Self),
            other => Err(D::Error::custom(format!("version {other} is not version 1"))),
        }
    }
}

impl JsonSchema for FormatVersion {
    fn schema_name() -> Cow<'static, str> {
        "Version".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "The version of the format: 1.",
            "type": "integer",
            "const": Self::NUMBER
        })
    }
}

/// The schema of a scene's `camera`: the object, or the file that holds it, in whose place its values stand
/// once it is read.
struct CameraSource;

impl JsonSchema for CameraSource {
    fn schema_name() -> Cow<'static, str> {
        "CameraSource".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let camera = generator.subschema_for::<CameraSpec>();
        json_schema!({
            "anyOf": [
                {
                    "description": "The path of a JSON file that holds the camera, from the scene's folder. The \
                                    file's own paths start at its own folder.",
                    "type": "string"
                },
                camera
            ]
        })
    }
}

/// Makes `[640, 480]` of a resolution written `"640x480"` at `at`. The error says how
/// it is written.
pub(super) fn read_resolution(value: &mut Value, at: &ScenePath) -> Result<(), String> {
    let Some(place) = at.find(value) else { return Ok(()) };
    let Value::String(text) = &*place else { return Ok(()) };
    let sides: Vec<Option<u32>> =
        text.split(['x', 'X', '×']).map(|side| side.trim().parse().ok()).collect();
    let [Some(width), Some(height)] = sides[..] else {
        return Err(format!("\"{text}\" is no resolution\nhint: write [640, 480] or \"640x480\""));
    };
    *place = json!([width, height]);
    Ok(())
}

/// Lets the schema of a resolution take `"640x480"`, too.
pub(super) fn allow_resolution_words(schema: &mut Value) {
    let Value::Object(members) = schema else { return };
    let about = members.remove("description");
    let numbers = Value::Object(std::mem::take(members));
    members.extend(about.map(|about| ("description".to_owned(), about)));
    let words = json!({ "type": "string", "pattern": "^\\s*\\d+\\s*[xX×]\\s*\\d+\\s*$" });
    members.insert("anyOf".to_owned(), json!([numbers, words]));
}

/// Adds the keys of [`NOTES`] to every object of a schema that refuses keys it does not know.
pub(super) fn allow_notes(schema: &mut Value) {
    match schema {
        Value::Object(members) => {
            members.values_mut().for_each(allow_notes);
            let closed = members.get("additionalProperties") == Some(&Value::Bool(false));
            if closed || members.get("unevaluatedProperties") == Some(&Value::Bool(false)) {
                let known = members.entry("properties").or_insert_with(|| Map::new().into());
                if let Value::Object(known) = known {
                    known.entry(NOTES[0]).or_insert_with(|| json!({ "type": "string" }));
                    known.entry(NOTES[1]).or_insert_with(|| {
                        let lines = json!({ "type": "array", "items": { "type": "string" } });
                        json!({ "description": "A remark; means nothing.",
                                "anyOf": [{ "type": "string" }, lines] })
                    });
                }
            }
        }
        Value::Array(elements) => elements.iter_mut().for_each(allow_notes),
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => {}
    }
}

/// The JSON Schema (2020-12) of a scene file.
///
/// Editors that know it complete keys and mark errors. Beside the standard's words it carries
/// `x-quantity` and `x-unit` on numbers that may also be strings with a unit.
#[must_use]
pub fn scene_schema() -> Value {
    let mut schema =
        SchemaSettings::draft2020_12().into_generator().into_root_schema_for::<SceneSpec>();
    schema.insert("title".to_owned(), "etendue scene, version 1".into());
    let mut schema = schema.to_value();
    // The camera knows of its sensor no more than the grid of pixels; a scene says all of it.
    if let Some(definitions) = schema.get_mut("$defs").and_then(Value::as_object_mut)
        && let Value::Object(mut sensor) = SENSOR.clone()
    {
        sensor.remove("$schema");
        if let Some(Value::Object(more)) = sensor.remove("$defs") {
            more.into_iter().for_each(|(name, schema)| {
                definitions.entry(name).or_insert(schema);
            });
        }
        definitions.insert("SensorSpec".to_owned(), Value::Object(sensor));
    }
    allow_notes(&mut schema);
    schema
}

/// Schema of scenes, made once.
pub(crate) static SCENE: LazyLock<Value> = LazyLock::new(scene_schema);

/// The schema of a scene's `sensor`, made once.
pub(crate) static SENSOR: LazyLock<Value> = LazyLock::new(|| {
    let generator = SchemaSettings::draft2020_12().into_generator();
    let mut schema = generator.into_root_schema_for::<SensorSpec>().to_value();
    if let Some(member) = schema.pointer_mut("/properties/resolution") {
        allow_resolution_words(member);
    }
    allow_notes(&mut schema);
    schema
});
