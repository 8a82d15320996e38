//! An element as a lens file writes it: a part, and how it is mounted.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value};

use super::gradient::GradientSpec;
use super::is_default;
use super::part::PartSpec;
use etendue_geometry::units::{Degrees, Millimetres};

/// An element of a lens file: a part, and how it is mounted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ElementSpec {
    /// Its kind.
    #[serde(flatten)]
    pub part: PartSpec,
    /// Its mount.
    #[serde(flatten)]
    pub mount: Mount,
}

/// Mount of an element.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Mount {
    /// From this element's vertex to the next one's along the axis (mm); behind the last element,
    /// to the sensor.
    #[serde(skip_serializing_if = "is_default")]
    pub thickness: Millimetres,
    /// True if this is the aperture stop, which chief rays pass in the middle.
    #[serde(skip_serializing_if = "is_default")]
    pub stop: bool,
    /// Turns about the x axis and then about the element's own y axis (degrees), right-handed,
    /// around its vertex. The elements behind are not moved.
    #[serde(skip_serializing_if = "is_default")]
    pub tilt: [Degrees; 2],
    /// Moved across the axis by x and y (mm). The elements behind are not moved.
    #[serde(skip_serializing_if = "is_default")]
    pub decentre: [Millimetres; 2],
    /// Change of the index of the glass behind a surface from place to place; it is the same everywhere when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gradient: Option<GradientSpec>,
}

/// The keys of [`Mount`].
const MOUNT_KEYS: [&str; 5] = ["thickness", "stop", "tilt", "decentre", "gradient"];

impl ElementSpec {
    /// A part on the axis, `thickness` (mm) before the next one.
    #[must_use]
    pub fn new(part: PartSpec, thickness: f64) -> Self {
        let mount = Mount { thickness: Millimetres(thickness), ..Mount::default() };
        Self { part, mount }
    }

    /// Marks the element as the aperture stop.
    #[must_use]
    pub fn as_stop(mut self) -> Self {
        self.mount.stop = true;
        self
    }
}

// Parts and mounts both refuse unknown keys, which serde cannot combine with flattening: so the
// mount's keys are taken out by hand, and the part sees all others.
impl<'de> Deserialize<'de> for ElementSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut keys = Map::deserialize(deserializer)?;
        let mut mount = Map::new();
        for key in MOUNT_KEYS {
            if let Some(value) = keys.remove(key) {
                mount.insert(key.to_owned(), value);
            }
        }
        let mount = read::<Mount>(mount);
        let part = read::<PartSpec>(keys).map_err(D::Error::custom)?;
        Ok(Self { part, mount: mount.map_err(D::Error::custom)? })
    }
}

/// Reads an object; the error names the key that is wrong.
fn read<T: DeserializeOwned>(keys: Map<String, Value>) -> Result<T, String> {
    serde_path_to_error::deserialize(Value::Object(keys)).map_err(|error| {
        let path = error.path().to_string();
        let why = error.into_inner().to_string();
        if path == "." { why } else { format!("{path}: {why}") }
    })
}

impl JsonSchema for ElementSpec {
    fn schema_name() -> Cow<'static, str> {
        "ElementSpec".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        element_schema(generator, Map::new(), &[])
    }
}

/// The schema of a part with the mount's keys, `extra` ones that are required, and not those of
/// `without`. As with reading, flattening would lose the refusal of unknown keys.
pub fn element_schema(
    generator: &mut SchemaGenerator,
    extra: Map<String, Value>,
    without: &[&str],
) -> Schema {
    let mut mount = Mount::json_schema(generator);
    let required: Vec<Value> = extra.keys().map(|key| key.as_str().into()).collect();
    let mut keys = extra;
    if let Some(Value::Object(members)) = mount.ensure_object().remove("properties") {
        keys.extend(members.into_iter().filter(|(key, _)| !without.contains(&key.as_str())));
    }
    let mut schema = PartSpec::json_schema(generator);
    if let Some(Value::Array(kinds)) = schema.get_mut("oneOf") {
        for kind in kinds {
            mount_on(kind, &keys, &required);
        }
    }
    schema
}

/// Adds `keys` to all objects that a schema chooses between, which refuse all others.
fn mount_on(schema: &mut Value, keys: &Map<String, Value>, required: &[Value]) {
    let Value::Object(schema) = schema else { return };
    schema.remove("unevaluatedProperties");
    let mut known = keys.clone();
    if let Some(Value::Object(own)) = schema.get("properties") {
        known.extend(own.clone());
    }
    if let Some(Value::Array(shapes)) = schema.get_mut("oneOf") {
        // The tag has been looked at when it comes to the shapes.
        known.insert("type".to_owned(), Value::Bool(true));
        for shape in shapes {
            mount_on(shape, &known, required);
        }
        return;
    }
    if let Some(Value::Array(all)) = schema.get_mut("required") {
        all.extend_from_slice(required);
    }
    schema.insert("properties".to_owned(), Value::Object(known));
    schema.insert("additionalProperties".to_owned(), Value::Bool(false));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(json: &str) -> Result<ElementSpec, String> {
        let spec: ElementSpec = serde_json::from_str(json).map_err(|e| e.to_string())?;
        let text = serde_json::to_string(&spec).unwrap();
        let again: ElementSpec = serde_json::from_str(&text).unwrap();
        assert_eq!(spec, again, "{text}");
        Ok(spec)
    }

    #[test]
    fn elements_read_as_the_design_writes_them() {
        let surface = read(
            r#"{ "type": "surface", "radius": 84.83, "thickness": 0.12, "semi_diameter": 12.6,
             "conic": -0.5, "aspheric": { "4": 1e-6 }, "tilt": [1, "30 arcmin"] }"#,
        )
        .unwrap();
        assert_eq!(surface.mount.thickness, Millimetres(0.12));
        assert_eq!(surface.mount.tilt, [Degrees(1.0), Degrees(0.5)]);
        let PartSpec::Surface(spec) = &surface.part else { panic!("{surface:?}") };
        assert_eq!(spec.aspheric["4"], 1e-6);
        let stop = read(
            r#"{ "type": "aperture", "shape": "circular", "radius": 8.55, "thickness": 4.5,
             "stop": true }"#,
        );
        assert_eq!(stop.unwrap(), ElementSpec::new(PartSpec::circular(8.55), 4.5).as_stop());
        assert!(read(r#"{"type": "thin_lens", "focal_length": "50 mm"}"#).is_ok());
        assert!(read(r#"{"type": "filter", "transmission": [[400, 0.1], [700, 0.9]]}"#).is_ok());
    }

    #[test]
    fn the_schema_knows_the_keys_of_part_and_mount_and_refuses_others() {
        fn leaves<'a>(schema: &'a Value, found: &mut Vec<&'a Value>) {
            match schema.get("oneOf").and_then(Value::as_array) {
                Some(kinds) => kinds.iter().for_each(|kind| leaves(kind, found)),
                None => found.push(schema),
            }
        }
        let schema = schemars::schema_for!(ElementSpec).to_value();
        let mut kinds = Vec::new();
        leaves(&schema, &mut kinds);
        assert_eq!(kinds.len(), 16, "eight shapes of apertures");
        for kind in kinds {
            assert_eq!(kind["additionalProperties"], false, "{kind}");
            let keys = kind["properties"].as_object().unwrap();
            assert!(MOUNT_KEYS.iter().all(|key| keys.contains_key(*key)), "{kind}");
            assert!(keys.len() > MOUNT_KEYS.len() + 1 && keys.contains_key("type"), "{kind}");
        }
    }

    #[test]
    fn unknown_keys_and_types_are_refused_by_name() {
        let error = |json| read(json).unwrap_err();
        assert!(error(r#"{"type": "surface", "radios": 3}"#).contains("unknown field `radios`"));
        assert!(error(r#"{"type": "prism"}"#).contains("unknown variant `prism`"));
        assert!(error(r#"{"radius": 3}"#).contains("missing field `type`"));
        let stop = r#"{"type": "surface", "stop": "yes"}"#;
        assert!(error(stop).contains("invalid type: string \"yes\""), "{}", error(stop));
        let thick = r#"{"type": "surface", "thickness": "3 mn"}"#;
        assert!(error(thick).contains("unknown unit `mn`"), "{}", error(thick));
    }
}
