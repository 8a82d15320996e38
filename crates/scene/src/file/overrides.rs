//! `--set camera.fov=30`: single values of a scene file, changed from the command line.

use etendue_report::Refusal;
use serde::Serialize;
use serde_json::Value;

use super::document::JsonDocument;
use super::path::ScenePath;

/// A value of a scene that is set in place of the file's.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(into = "[String; 2]")]
pub struct Setting {
    /// Its path from the scene's top, such as `camera.fov`.
    pub path: String,
    /// JSON when it is JSON, such as `30`, and else a string.
    pub value: String,
}

impl Setting {
    /// A path and a value.
    #[must_use]
    pub fn new(path: impl Into<String>, value: impl Into<String>) -> Self {
        Self { path: path.into(), value: value.into() }
    }
}

impl From<Setting> for [String; 2] {
    fn from(Setting { path, value }: Setting) -> Self {
        [path, value]
    }
}

/// Sets `path` of `root` to `text`: JSON when it is JSON, else a string. Objects on the way that
/// are missing are made. Returns the path as messages write it.
///
/// # Errors
///
/// When the path cannot be read or leads nowhere.
pub(crate) fn apply(root: &mut Value, path: &str, text: &str) -> Result<ScenePath, Refusal> {
    path.parse::<ScenePath>()?.set(root, read(text)?)
}

/// JSON, as strictly as files are read, where the text is JSON at all, else a string.
fn read(text: &str) -> Result<Value, Refusal> {
    let is_number = text.trim_start().starts_with(|c: char| c.is_ascii_digit() || c == '-');
    match serde_json::from_str::<serde::de::IgnoredAny>(text) {
        Ok(_) => match JsonDocument::parse(text.to_owned()) {
            Ok((_, value)) => Ok(value),
            Err(fault) => Err(fault.reason.into()),
        },
        Err(_) if is_number && text.trim().parse().is_ok_and(f64::is_infinite) => {
            let number = text.trim();
            Err(format!("{number} is beyond the numbers that a computer holds (1.8e308)").into())
        }
        Err(_) => Ok(Value::String(text.to_owned())),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn set(path: &str, text: &str) -> Result<Value, String> {
        let mut scene = json!({
            "camera": {"fov": 40, "type": "pinhole"},
            "objects": [{"file": "a.obj"}, {"file": "b.obj"}],
            "materials": {"a.b": {"type": "matte"}}
        });
        apply(&mut scene, path, text).map_err(|error| error.to_string())?;
        Ok(scene)
    }

    #[test]
    fn values_are_json_or_bare_strings() {
        assert_eq!(set("camera.fov", "30.5").unwrap()["camera"]["fov"], json!(30.5));
        assert_eq!(set("camera.fov", "50 deg").unwrap()["camera"]["fov"], json!("50 deg"));
        assert_eq!(set("camera.type", "orthographic").unwrap()["camera"]["type"], "orthographic");
        assert_eq!(set("layers", "[\"depth\"]").unwrap()["layers"], json!(["depth"]));
    }

    #[test]
    fn paths_reach_arrays_and_make_objects() {
        assert_eq!(set("objects[1].file", "c.obj").unwrap()["objects"][1]["file"], "c.obj");
        assert_eq!(set("objects.0.file", "c.obj").unwrap()["objects"][0]["file"], "c.obj");
        let made = set("camera.sensor.resolution", "[4, 3]").unwrap();
        assert_eq!(made["camera"]["sensor"], json!({"resolution": [4, 3]}));
        let dotted = set("materials[\"a.b\"].type", "checker").unwrap();
        assert_eq!(dotted["materials"]["a.b"]["type"], "checker");
    }

    #[test]
    fn paths_that_lead_nowhere_are_refused() {
        let error = |path: &str| set(path, "1").unwrap_err();
        assert_eq!(error("objects[2].file"), "objects has 2 entries, so there is no objects[2]");
        assert!(error("objects.first").contains("no objects[first]"));
        assert_eq!(error("camera.fov.x"), "camera.fov is a number, which has no `x`");
        assert!(error("a.".repeat(60_000).trim_end_matches('.')).contains("60000 steps"));
        for path in ["", ".", "a..b", "a.", "a[", "a[x]", "a[0]b", "[\"a\"", ".a"] {
            assert!(error(path).contains("is no path"), "{path}: {}", error(path));
        }
    }
}
