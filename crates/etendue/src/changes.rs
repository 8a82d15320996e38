//! What is to be set to make one scene out of another.

use serde_json::{Map, Value};

/// Paths and values that turn `before` into `after`, both JSON objects: as few and as deep as possible,
/// so that an error about one of them names what was changed. Where keys have gone, the object that had
/// them is set whole.
pub(crate) fn between(before: &Value, after: &Value) -> Vec<(String, Value)> {
    let mut changes = Vec::new();
    // A null at the top is an absent key to the format; the top itself has no path.
    if let (Value::Object(old), Value::Object(new)) = (before, after) {
        for key in old.keys().filter(|key| !new.contains_key(*key)) {
            changes.push((step("", key), Value::Null));
        }
        members("", old, new, &mut changes);
    }
    changes
}

fn members(
    path: &str,
    before: &Map<String, Value>,
    after: &Map<String, Value>,
    changes: &mut Vec<(String, Value)>,
) {
    for (key, new) in after {
        let path = step(path, key);
        match before.get(key) {
            Some(old) => values(&path, old, new, changes),
            None => changes.push((path, new.clone())),
        }
    }
}

fn values(path: &str, before: &Value, after: &Value, changes: &mut Vec<(String, Value)>) {
    match (before, after) {
        _ if before == after => {}
        (Value::Object(old), Value::Object(new)) if old.keys().all(|key| new.contains_key(key)) => {
            members(path, old, new, changes);
        }
        (Value::Array(old), Value::Array(new)) if old.len() == new.len() => {
            for (i, (old, new)) in old.iter().zip(new).enumerate() {
                values(&format!("{path}[{i}]"), old, new, changes);
            }
        }
        _ => changes.push((path.to_owned(), after.clone())),
    }
}

fn step(path: &str, key: &str) -> String {
    let plain = !key.is_empty() && key.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '-');
    match (path.is_empty(), plain) {
        (true, true) => key.to_owned(),
        (false, true) => format!("{path}.{key}"),
        (_, false) => format!("{path}[{key:?}]"),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn only_what_differs_is_set() {
        let before = json!({"camera": {"type": "pinhole", "fov": 30, "pose": {"from": [0, 0, 1]}},
                            "objects": [{"shape": "box"}], "tracer": {"type": "flat"}});
        let after = json!({"camera": {"type": "pinhole", "fov": 40, "pose": {"from": [0, 2, 1]}},
                           "objects": [{"shape": "box", "my name": 1}], "lights": []});
        let expected = [
            ("tracer", json!(null)),
            ("camera.fov", json!(40)),
            ("camera.pose.from[1]", json!(2)),
            ("lights", json!([])),
            ("objects[0][\"my name\"]", json!(1)),
        ];
        let expected = expected.map(|(path, value)| (path.to_owned(), value));
        assert_eq!(between(&before, &after), expected);
    }

    #[test]
    fn what_loses_a_key_is_set_whole() {
        let before = json!({"camera": {"type": "thin_lens", "f_number": 2}, "layers": [1, 2]});
        let after = json!({"camera": {"type": "pinhole"}, "layers": [1]});
        let expected = [("camera", json!({"type": "pinhole"})), ("layers", json!([1]))];
        let expected = expected.map(|(path, value)| (path.to_owned(), value));
        assert_eq!(between(&before, &after), expected);
    }
}
