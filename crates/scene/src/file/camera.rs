//! A camera in a file of its own, which a scene names in place of the object.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use etendue_camera::CameraSpec;
use etendue_files::InputFolder;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde_json::Value;

use super::document::Document;
use super::lens::SCENE_KEYS;
use super::{kind_of, read_document};
use crate::SceneError;
use crate::error::not_found;

/// The schema of a scene's `camera`: the object, or the file that holds it, in whose place its values stand
/// once it is read.
pub(super) struct CameraSource;

impl JsonSchema for CameraSource {
    fn schema_name() -> Cow<'static, str> {
        "CameraSource".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let camera = generator.subschema_for::<CameraSpec>();
        json_schema!({
            "anyOf": [
                {
                    "description": "The path of a JSON file that holds the camera, from the scene's folder. The \
                                    file's own paths start at its own folder.",
                    "type": "string"
                },
                camera
            ]
        })
    }
}

/// The file that holds a scene's camera.
#[derive(Debug, Clone)]
pub(super) struct CameraFile {
    pub(super) path: PathBuf,
    pub(super) document: Document,
}

impl CameraFile {
    /// Reads the camera file that a scene in `folder` calls `written`, with its paths from that folder. A
    /// text is an error that belongs to the scene's key `camera`.
    pub(super) fn read(
        folder: &InputFolder,
        written: &str,
    ) -> Result<Result<(Self, Value), String>, SceneError> {
        let path = match folder.find(written) {
            Ok(found) => found.path,
            Err(error) => return Ok(Err(not_found(error))),
        };
        let (document, mut value) = match read_document(&path) {
            Err(SceneError::NotAScene { reason, .. }) => {
                return Ok(Err(format!("\"{written}\" {reason}; {}", remedy())));
            }
            read => read?,
        };
        let Value::Object(members) = &value else {
            let kind = kind_of(&value);
            return Ok(Err(format!("\"{written}\" holds {kind}, not an object; {}", remedy())));
        };
        if SCENE_KEYS.iter().any(|key| members.contains_key(*key)) {
            return Ok(Err(format!("\"{written}\" is a whole scene; {}", remedy())));
        }
        let own = Path::new(written).parent().unwrap_or(Path::new(""));
        if !own.as_os_str().is_empty() {
            move_paths(&mut value, own);
        }
        Ok(Ok((Self { path, document }, value)))
    }

    /// What the scene calls `path`, in the words of the file.
    pub(super) fn own_path(path: &str) -> Option<&str> {
        let inside = path.strip_prefix("camera")?;
        match inside.strip_prefix('.') {
            Some(inside) => Some(inside),
            None => (inside.is_empty() || inside.starts_with('[')).then_some(inside),
        }
    }
}

fn remedy() -> &'static str {
    "name a JSON file that holds what a scene's `camera` does, such as {\"type\": \"pinhole\", \"fov\": 40}"
}

/// The keys of a camera and of what it consists of that name files.
const FILES: [&str; 4] = ["lens", "file", "image", "glass_catalogs"];

/// Lets paths that start at the folder `own` start where that does.
fn move_paths(value: &mut Value, own: &Path) {
    let moved = |path: &mut Value| {
        if let Value::String(text) = path {
            *text = own.join(&*text).to_string_lossy().into_owned();
        }
    };
    match value {
        Value::Object(members) => {
            for (key, member) in members {
                match member {
                    Value::String(_) if FILES.contains(&key.as_str()) => moved(member),
                    Value::Array(paths) if FILES.contains(&key.as_str()) => {
                        paths.iter_mut().for_each(moved);
                    }
                    _ => move_paths(member, own),
                }
            }
        }
        Value::Array(elements) => elements.iter_mut().for_each(|element| move_paths(element, own)),
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => {}
    }
}
