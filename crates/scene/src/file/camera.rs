//! A camera in a file of its own, which a scene names in place of the object.
//!
//! JSON files, whatever they hold: how they are read.

use std::io;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::document::{JsonDocument, Place, excerpt};
use super::path::ScenePath;
use crate::SceneError;
use crate::error::not_found;
use crate::memory::{has_room, of_json};
use crate::sniff::what_it_is;
use crate::words::kind_of;
use etendue_files::InputFolder;
use etendue_report::Refusal;

/// The file that holds a scene's camera.
#[derive(Debug, Clone)]
pub(super) struct CameraDocument {
    pub(super) path: PathBuf,
    pub(super) document: JsonDocument,
}

impl CameraDocument {
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
                return Ok(Err(format!("\"{written}\" {reason}\nhint: {}", remedy())));
            }
            read => read?,
        };
        let Value::Object(members) = &value else {
            let kind = kind_of(&value);
            return Ok(Err(format!(
                "\"{written}\" holds {kind}, not an object\nhint: {}",
                remedy()
            )));
        };
        if SCENE_KEYS.iter().any(|key| members.contains_key(*key)) {
            return Ok(Err(format!("\"{written}\" is a whole scene\nhint: {}", remedy())));
        }
        let own = Path::new(written).parent().unwrap_or(Path::new(""));
        if !own.as_os_str().is_empty() {
            move_paths(&mut value, own);
        }
        Ok(Ok((Self { path, document }, value)))
    }

    /// The scene's `path`, counted from the top of the camera's file.
    pub(super) fn own_path(path: &ScenePath) -> Option<ScenePath> {
        path.inside(&ScenePath::of("camera"))
    }
}

fn remedy() -> &'static str {
    "name a JSON file that holds what a scene's `camera` does, such as {\"type\": \"pinhole\", \"fov\": 40}"
}

/// The keys of a camera and of what it consists of that name files.
const FILES: [&str; 5] = ["lens", "file", "image", "glass_catalogs", "defect_map"];

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

/// The keys of a scene that no lens file has.
pub(super) const SCENE_KEYS: [&str; 3] = ["etendue", "camera", "objects"];

/// The longest text that is read as a scene (bytes): scenes name their meshes, they do not hold
/// them.
const LONGEST: u64 = 64 << 20;

pub(super) fn read_document(path: &Path) -> Result<(JsonDocument, Value), SceneError> {
    let bytes = read_bytes(path)?;
    let not_a_scene = |reason| SceneError::NotAScene { file: path.to_owned(), reason };
    if let Some(what) = what_it_is(&bytes) {
        return Err(not_a_scene(format!("is {what}, not JSON text")));
    }
    // Its text is kept beside its values.
    if !has_room(of_json(&bytes) + bytes.len() as u64) {
        return Err(not_a_scene("is more than the system has memory for".to_owned()));
    }
    let text = String::from_utf8(bytes).map_err(|error| {
        not_a_scene(format!("is not UTF-8 text (byte {})", error.utf8_error().valid_up_to()))
    })?;
    let text = text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text);
    // Text of another format, such as an STL model's: a name that is none of ours tells.
    let is_named_json = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"));
    if !is_named_json && !text.trim_start().starts_with(['{', '[']) {
        return Err(not_a_scene("is text that is no JSON".to_owned()));
    }
    parse_document(path, text)
}

/// The document of a text of the file at `path`.
pub(super) fn parse_document(
    path: &Path,
    text: String,
) -> Result<(JsonDocument, Value), SceneError> {
    JsonDocument::parse(text.clone()).map_err(|fault| {
        let Place { line, column } = fault.place;
        let why = Refusal::new(fault.reason).and(&format!("\n{}", excerpt(&text, fault.place)));
        let place = format!("{}, line {line}, column {column}: broken JSON", path.display());
        SceneError::Refused(why.at(place))
    })
}

/// The bytes of a regular file of sensible size.
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>, SceneError> {
    etendue_files::read(path, LONGEST).map_err(|source| match source.kind() {
        // What the opener itself says: it is there but no file for us.
        io::ErrorKind::Other => {
            SceneError::NotAScene { file: path.to_owned(), reason: source.to_string() }
        }
        _ => SceneError::unreadable(path, &source),
    })
}
