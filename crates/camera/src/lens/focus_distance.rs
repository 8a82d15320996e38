//! Distances in focus as files write them.

use std::borrow::Cow;

use etendue_geometry::units::Metres;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The distance of what is in focus (m); a file may write "infinity".
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FocusDistance(pub f64);

/// How files write an object at infinity.
const INFINITY: [&str; 2] = ["infinity", "inf"];

impl Serialize for FocusDistance {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 == f64::INFINITY {
            true => serializer.serialize_str(INFINITY[0]),
            false => Metres(self.0).serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for FocusDistance {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = serde_json::Value::deserialize(deserializer)?;
        if value.as_str().is_some_and(|text| INFINITY.contains(&text.trim())) {
            return Ok(Self(f64::INFINITY));
        }
        Metres::deserialize(value).map(|metres| Self(metres.0)).map_err(D::Error::custom)
    }
}

impl JsonSchema for FocusDistance {
    fn schema_name() -> Cow<'static, str> {
        "FocusDistance".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut schema = Metres::json_schema(generator);
        let about = "A number in m, a string with a unit, or \"infinity\".";
        schema.insert("description".to_owned(), about.into());
        schema.insert("x-also".to_owned(), INFINITY.as_slice().into());
        schema
    }
}
