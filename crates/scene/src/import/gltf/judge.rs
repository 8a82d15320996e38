//! Treatment of material values that no surface can have.

use gltf::json;
use serde_json::Value;

use super::reader::GltfReader;
use crate::import::error::{self, Note, NoteKind};
use crate::import::{Import, Refusal, Strictness};

/// The judge of one material's numbers.
pub(super) struct Judge<'a> {
    pub reader: &'a GltfReader<'a>,
    /// Name of the material in messages.
    pub subject: String,
}

impl Judge<'_> {
    /// Says that the material's `what` is wrong and what is done about it; refused when strict.
    pub(super) fn say(&self, what: &str, remedy: &str, import: &mut Import) -> Result<(), Refusal> {
        if self.reader.options.strictness == Strictness::Strict {
            let place = format!("material \"{}\"", self.subject);
            return Err(self.reader.damaged(place, format!("its {what}\nhint: export it again")));
        }
        let message = format!("its {what}; {remedy}");
        error::push(&mut import.notes, Note::new(NoteKind::Irregular, &self.subject, message));
        Ok(())
    }

    /// Name of a key of the material in messages.
    pub(super) fn place(&self, key: &str) -> String {
        format!("material \"{}\".{key}", self.subject)
    }

    /// A factor brought to `low..=high`.
    pub(super) fn factor(
        &self,
        key: &str,
        value: f64,
        [low, high]: [f64; 2],
        import: &mut Import,
    ) -> Result<f64, Refusal> {
        if !(low..=high).contains(&value) {
            let what = match high {
                f64::INFINITY => format!("{key} {value} is below {low}"),
                _ => format!("{key} {value} is outside {low} to {high}"),
            };
            self.say(&what, "it is brought there", import)?;
        }
        Ok(if value.is_nan() { low } else { value.clamp(low, high) })
    }

    /// The number that an extension of the material gives; `None` without one.
    pub(super) fn number(
        &self,
        material: &json::Material,
        name: &str,
        key: &str,
        import: &mut Import,
    ) -> Result<Option<f64>, Refusal> {
        let extension = material.extensions.as_ref().and_then(|e| e.others.get(name));
        let Some(extension) = extension else { return Ok(None) };
        let value = match (extension.is_object(), extension.get(key)) {
            (true, None) => return Ok(None),
            (_, value) => value.and_then(Value::as_f64),
        };
        if value.is_none() {
            self.say(&format!("{name}.{key} is not a number"), "it is left out", import)?;
        }
        Ok(value)
    }
}
