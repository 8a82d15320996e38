//! What people and editors may write beside the format: comments, the schema's address, and a resolution as
//! screens have it.

use etendue_optics::train::NOTES;
use serde_json::{Map, Value, json};

/// Makes `[640, 480]` of a resolution written `"640x480"` at the dotted path `at`. The error says how
/// it is written.
pub(super) fn read_resolution(value: &mut Value, at: &str) -> Result<(), String> {
    let pointer = format!("/{}", at.replace('.', "/"));
    let Some(place) = value.pointer_mut(&pointer) else { return Ok(()) };
    let Value::String(text) = &*place else { return Ok(()) };
    let sides: Vec<Option<u32>> =
        text.split(['x', 'X', '×']).map(|side| side.trim().parse().ok()).collect();
    let [Some(width), Some(height)] = sides[..] else {
        return Err(format!("\"{text}\" is no resolution; write [640, 480] or \"640x480\""));
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
