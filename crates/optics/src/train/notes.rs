//! What people and editors write beside the format of lens and scene files.

use serde_json::Value;

/// Keys that mean nothing, anywhere: what an editor completes by, and what a person remarks.
pub const NOTES: [&str; 2] = ["$schema", "comment"];

/// The one object whose keys are other people's words and whose values are strings: the materials of a model
/// that an object of a scene replaces.
const FOREIGN: &str = "materials";

/// Takes the keys of [`NOTES`] out of all objects, where their values are text or lists of text. Returns
/// whether there were any.
pub fn remove_notes(value: &mut Value) -> bool {
    match value {
        Value::Object(members) => {
            let count = members.len();
            members.retain(|key, member| !(NOTES.contains(&key.as_str()) && is_text(member)));
            let mut is_changed = members.len() < count;
            for (key, member) in members {
                if !(key == FOREIGN && has_only_text(member)) {
                    is_changed |= remove_notes(member);
                }
            }
            is_changed
        }
        Value::Array(elements) => elements
            .iter_mut()
            .fold(false, |is_changed, element| remove_notes(element) | is_changed),
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => false,
    }
}

fn is_text(value: &Value) -> bool {
    match value {
        Value::String(_) => true,
        Value::Array(lines) => lines.iter().all(Value::is_string),
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::Object(_) => false,
    }
}

fn has_only_text(value: &Value) -> bool {
    value.as_object().is_some_and(|members| members.values().all(Value::is_string))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn remarks_go_and_names_stay() {
        let mut value = json!({
            "$schema": "scene.schema.json", "comment": ["two", "lines"],
            "camera": {"comment": "mine", "fov": 3},
            "objects": [{"comment": "x", "materials": {"comment": "clay"}}],
            "materials": {"comment": {"type": "matte"}, "clay": {"comment": "y", "type": "matte"}}
        });
        assert!(remove_notes(&mut value));
        assert_eq!(
            value,
            json!({
                "camera": {"fov": 3},
                "objects": [{"materials": {"comment": "clay"}}],
                "materials": {"comment": {"type": "matte"}, "clay": {"type": "matte"}}
            })
        );
        assert!(!remove_notes(&mut value));
    }
}
