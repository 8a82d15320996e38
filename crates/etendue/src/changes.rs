//! Settings that make one scene out of another.

use etendue_scene::ScenePath;
use serde_json::{Map, Value};

/// Paths and values that turn `before` into `after`, both JSON objects: as few and as deep as possible,
/// so that an error about one of them names what was changed. Where keys have gone, the object that had
/// them is set whole.
pub(crate) fn between(before: &Value, after: &Value) -> Vec<(ScenePath, Value)> {
    let mut changes = Vec::new();
    // A null at the top is an absent key to the format; the top itself has no path.
    if let (Value::Object(old), Value::Object(new)) = (before, after) {
        let top = ScenePath::default();
        for key in old.keys().filter(|key| !new.contains_key(*key)) {
            changes.push((top.key(key), Value::Null));
        }
        members(&top, old, new, &mut changes);
    }
    changes
}

fn members(
    path: &ScenePath,
    before: &Map<String, Value>,
    after: &Map<String, Value>,
    changes: &mut Vec<(ScenePath, Value)>,
) {
    for (key, new) in after {
        let path = path.key(key);
        match before.get(key) {
            Some(old) => values(&path, old, new, changes),
            None => changes.push((path, new.clone())),
        }
    }
}

fn values(path: &ScenePath, before: &Value, after: &Value, changes: &mut Vec<(ScenePath, Value)>) {
    match (before, after) {
        _ if before == after => {}
        (Value::Object(old), Value::Object(new)) if old.keys().all(|key| new.contains_key(key)) => {
            members(path, old, new, changes);
        }
        (Value::Array(old), Value::Array(new)) if old.len() == new.len() => {
            for (i, (old, new)) in old.iter().zip(new).enumerate() {
                values(&path.index(i), old, new, changes);
            }
        }
        _ => changes.push((path.clone(), after.clone())),
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
        let expected = expected.map(|(path, value)| (ScenePath::of(path), value));
        assert_eq!(between(&before, &after), expected);
    }

    #[test]
    fn what_loses_a_key_is_set_whole() {
        let before = json!({"camera": {"type": "thin_lens", "f_number": 2}, "layers": [1, 2]});
        let after = json!({"camera": {"type": "pinhole"}, "layers": [1]});
        let expected = [("camera", json!({"type": "pinhole"})), ("layers", json!([1]))];
        let expected = expected.map(|(path, value)| (ScenePath::of(path), value));
        assert_eq!(between(&before, &after), expected);
    }
}
