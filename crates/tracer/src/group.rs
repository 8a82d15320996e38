//! Groups of lights, each of which a picture may show by itself, and parts of them that change with time.

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use crate::Modulation;

/// The most letters of a name: what fits into the names of channels in files.
const MOST: usize = 24;

/// The name of a group of lights: lower-case letters, digits, `_` and `-`, 24 at most.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct LightGroup {
    /// Zeros after the last.
    letters: [u8; MOST],
}

impl LightGroup {
    /// The group of the lights that name none, and of the models' own.
    pub const OTHER: Self = {
        let mut letters = [0; MOST];
        let name = b"other";
        let mut i = 0;
        while i < name.len() {
            letters[i] = name[i];
            i += 1;
        }
        Self { letters }
    };

    /// The name.
    #[must_use]
    pub fn name(&self) -> &str {
        let length = self.letters.iter().take_while(|letter| **letter != 0).count();
        std::str::from_utf8(&self.letters[..length]).unwrap_or_default()
    }
}

impl TryFrom<String> for LightGroup {
    type Error = String;

    fn try_from(name: String) -> Result<Self, Self::Error> {
        let fits = |letter: u8| {
            letter.is_ascii_lowercase() || letter.is_ascii_digit() || b"_-".contains(&letter)
        };
        if name.is_empty() || name.len() > MOST || !name.bytes().all(fits) {
            return Err(format!(
                "{name:?} is no name of a group: give it 1 to {MOST} of a to z, 0 to 9, _ and -"
            ));
        }
        let mut letters = [0; MOST];
        letters[..name.len()].copy_from_slice(name.as_bytes());
        Ok(Self { letters })
    }
}

impl From<LightGroup> for String {
    fn from(group: LightGroup) -> Self {
        group.name().to_owned()
    }
}

impl fmt::Display for LightGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl fmt::Debug for LightGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.name())
    }
}

impl JsonSchema for LightGroup {
    fn schema_name() -> Cow<'static, str> {
        "LightGroup".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "The name of a group of lights: 1 to 24 of a to z, 0 to 9, _ and -.",
            "type": "string",
            "pattern": "^[a-z0-9_-]{1,24}$"
        })
    }
}

/// Part of the light of a ray that is told apart: that of a group, and of it what changes with time alike.
type Part = (LightGroup, Option<Arc<Modulation>>);

/// Part that each light of a scene is of.
#[derive(Debug, Clone, Default)]
pub(crate) struct Groups {
    /// All that there are, each group's side by side; that of [`LightGroup::OTHER`] without modulation among them.
    parts: Vec<Part>,
    /// By the lights' numbers.
    of_light: Vec<u32>,
    /// By the materials' numbers.
    of_material: Vec<u32>,
}

impl Groups {
    /// Those of lights and materials.
    pub(crate) fn of(
        lights: impl Iterator<Item = Part> + Clone,
        materials: impl Iterator<Item = Part> + Clone,
    ) -> Self {
        let mut parts: Vec<Part> = vec![(LightGroup::OTHER, None)];
        for part in lights.clone().chain(materials.clone()) {
            if !parts.contains(&part) {
                parts.push(part);
            }
        }
        parts.sort_by_key(|(group, modulation)| (*group, modulation.is_some()));
        let number = |part: Part| {
            let found = parts.iter().position(|other| *other == part);
            u32::try_from(found.unwrap_or(0)).unwrap_or(0)
        };
        let (of_light, of_material) =
            (lights.map(number).collect(), materials.map(number).collect());
        Self { parts, of_light, of_material }
    }

    /// All that there are.
    pub(crate) fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// The part that a light is of.
    pub(crate) fn of_light(&self, light: usize) -> u32 {
        self.of_light.get(light).copied().unwrap_or(0)
    }

    /// The part that a surface which shines is of.
    pub(crate) fn of_material(&self, material: u32) -> u32 {
        self.of_material.get(material as usize).copied().unwrap_or(0)
    }
}
