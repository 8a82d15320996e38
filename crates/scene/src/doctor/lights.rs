//! Lights that glTF files bring along.

use std::path::Path;

use etendue_files::MappedFile;
use serde_json::Value;

use super::leftovers::naming_part;

/// How many nodes of the glTF file at `path` carry a light (`KHR_lights_punctual`); 0 for any
/// other file.
pub(super) fn count(path: &Path) -> u64 {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    if !["gltf", "glb"].iter().any(|known| ending.eq_ignore_ascii_case(known)) {
        return 0;
    }
    let Ok(file) = MappedFile::open(path) else { return 0 };
    let Ok(document) = serde_json::from_slice::<Value>(naming_part(file.bytes())) else { return 0 };
    let nodes = document.get("nodes").and_then(Value::as_array);
    let has_light = |node: &&Value| node.pointer("/extensions/KHR_lights_punctual/light").is_some();
    nodes.into_iter().flatten().filter(has_light).count() as u64
}
