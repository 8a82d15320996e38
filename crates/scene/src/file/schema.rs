//! The scene format as a JSON Schema, made from the types that read it.

use std::sync::LazyLock;

use etendue_sensor::SensorSpec;
use schemars::generate::SchemaSettings;
use serde_json::Value;

use super::{SceneSpec, lenient};

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
    lenient::allow_notes(&mut schema);
    schema
}

/// The same, made once.
pub(crate) static SCENE: LazyLock<Value> = LazyLock::new(scene_schema);

/// The schema of a scene's `sensor`, made once.
pub(crate) static SENSOR: LazyLock<Value> = LazyLock::new(|| {
    let generator = SchemaSettings::draft2020_12().into_generator();
    let mut schema = generator.into_root_schema_for::<SensorSpec>().to_value();
    if let Some(member) = schema.pointer_mut("/properties/resolution") {
        lenient::allow_resolution_words(member);
    }
    lenient::allow_notes(&mut schema);
    schema
});
