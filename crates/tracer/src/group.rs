//! Groups of lights, each of which a picture may show by itself.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

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

/// Which group each light of a scene is of.
#[derive(Debug, Clone, Default)]
pub(crate) struct Groups {
    /// All that there are, in order; [`LightGroup::OTHER`] among them.
    names: Vec<LightGroup>,
    /// By the lights' numbers.
    of_light: Vec<u32>,
    /// By the materials' numbers.
    of_material: Vec<u32>,
}

impl Groups {
    /// Those of lights and materials.
    pub(crate) fn of(
        lights: impl Iterator<Item = Option<LightGroup>> + Clone,
        materials: impl Iterator<Item = Option<LightGroup>> + Clone,
    ) -> Self {
        let mut names: Vec<LightGroup> =
            lights.clone().chain(materials.clone()).flatten().collect();
        names.push(LightGroup::OTHER);
        names.sort_unstable();
        names.dedup();
        let number = |group: Option<LightGroup>| {
            let found = names.binary_search(&group.unwrap_or(LightGroup::OTHER));
            u32::try_from(found.unwrap_or(0)).unwrap_or(0)
        };
        let (of_light, of_material) =
            (lights.map(number).collect(), materials.map(number).collect());
        Self { names, of_light, of_material }
    }

    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.names.len()
    }

    /// The number of a group.
    pub(crate) fn number(&self, group: LightGroup) -> Option<usize> {
        self.names.binary_search(&group).ok()
    }

    /// The group of a light.
    pub(crate) fn of_light(&self, light: usize) -> u32 {
        self.of_light.get(light).copied().unwrap_or(0)
    }

    /// The group of a surface that shines.
    pub(crate) fn of_material(&self, material: u32) -> u32 {
        self.of_material.get(material as usize).copied().unwrap_or(0)
    }
}
