//! The scene format as a JSON Schema, made from the types that read it.

use std::sync::LazyLock;

use schemars::generate::SchemaSettings;
use serde_json::Value;

use super::SceneSpec;

/// The JSON Schema (2020-12) of a scene file.
///
/// Editors that know it complete keys and mark errors. Beside the standard's words it carries
/// `x-quantity` and `x-unit` on numbers that may also be strings with a unit.
#[must_use]
pub fn scene_schema() -> Value {
    let mut schema =
        SchemaSettings::draft2020_12().into_generator().into_root_schema_for::<SceneSpec>();
    schema.insert("title".to_owned(), "etendue scene, version 1".into());
    schema.to_value()
}

/// The same, made once.
pub(crate) static SCENE: LazyLock<Value> = LazyLock::new(scene_schema);
