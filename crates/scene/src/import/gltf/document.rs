//! The JSON of a glTF file.

use std::fmt::Display;
use std::path::Path;

use gltf::json;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use crate::file::{JsonDocument as JsonText, JsonFault, Place, read_value};
use crate::import::Refusal;
use crate::import::error::{damaged, wrong_text};
use crate::words::kind_of;

/// A glTF document: crate `gltf`'s types, but for what is read in f64 here.
pub(super) struct GltfDocument {
    pub root: json::Root,
    pub nodes: Vec<GltfNode>,
    pub scenes: Vec<SceneRoots>,
    pub cameras: Vec<GltfCamera>,
    pub skins: Vec<GltfSkin>,
    /// Each as it is written; only one that is played is looked at.
    pub animations: Vec<Value>,
}

/// Keys of the document that crate `gltf` reads.
const READ: [&str; 13] = [
    "asset",
    "accessors",
    "buffers",
    "bufferViews",
    "extensions",
    "extensionsRequired",
    "extensionsUsed",
    "images",
    "materials",
    "meshes",
    "samplers",
    "scene",
    "textures",
];

/// A node. A mesh, a camera, both or neither, below its parent by a matrix or by TRS.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct GltfNode {
    pub name: Option<String>,
    pub children: Vec<usize>,
    pub matrix: Option<[f64; 16]>,
    pub translation: Option<[f64; 3]>,
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
    pub mesh: Option<usize>,
    pub camera: Option<usize>,
    pub skin: Option<usize>,
    /// For the morph targets of its mesh.
    pub weights: Option<Vec<f64>>,
    pub extensions: Map<String, Value>,
}

/// The roots of a hierarchy.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct SceneRoots {
    pub nodes: Vec<usize>,
}

/// The joints that carry a mesh.
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct GltfSkin {
    /// Nodes.
    pub joints: Vec<usize>,
    /// An accessor.
    pub inverse_bind_matrices: Option<usize>,
}

/// A camera.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct GltfCamera {
    pub name: Option<String>,
    pub perspective: Option<Perspective>,
    pub orthographic: Option<GltfOrthographic>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Perspective {
    pub yfov: f64,
    pub aspect_ratio: Option<f64>,
}

#[derive(Debug, Deserialize)]
pub(super) struct GltfOrthographic {
    pub xmag: f64,
    pub ymag: f64,
}

/// The arrays that crate `gltf` would read in f32, and those that only make sense with them.
#[derive(Default, Deserialize)]
#[serde(default)]
struct InF64 {
    nodes: Vec<GltfNode>,
    scenes: Vec<SceneRoots>,
    cameras: Vec<GltfCamera>,
    skins: Vec<GltfSkin>,
}

/// Reads the JSON of the glTF file at `path`, whole or a chunk of a GLB.
pub(super) fn parse(path: &Path, json: &[u8], in_glb: bool) -> Result<GltfDocument, Refusal> {
    let mut rest: Map<String, Value> =
        serde_json::from_slice(json).map_err(|error| broken(path, json, in_glb, &error))?;
    require_version_2(path, &rest)?;
    let animations = match rest.remove("animations") {
        Some(Value::Array(animations)) => animations,
        _ => Vec::new(),
    };
    let mut taken = Map::new();
    for key in ["nodes", "scenes", "cameras", "skins"] {
        if let Some((key, value)) = rest.remove_entry(key) {
            taken.insert(key, value);
        }
    }
    let whole = Value::Object(taken);
    refuse_arrays(&whole, "").map_err(|place| not_an_object(path, place))?;
    let InF64 { nodes, scenes, cameras, skins } = typed(path, &whole)?;
    // The crate refuses documents for parts that are not wanted, as animations that extensions
    // point elsewhere than to nodes.
    rest.retain(|key, _| READ.contains(&key.as_str()));
    let whole = Value::Object(rest);
    refuse_arrays(&whole, "").map_err(|place| not_an_object(path, place))?;
    let root = typed(path, &whole)?;
    Ok(GltfDocument { root, nodes, scenes, cameras, skins, animations })
}

fn require_version_2(path: &Path, document: &Map<String, Value>) -> Result<(), Refusal> {
    let asset = document.get("asset");
    let written = |key| asset.and_then(|asset| asset.get(key));
    // glTF 1.0 keeps its parts by name, and some of its files have a number here, or no version.
    let is_named = |key| document.get(key).is_some_and(Value::is_object);
    let is_first = ["nodes", "meshes", "accessors"].into_iter().any(is_named);
    let why = match written("minVersion").or(written("version")) {
        Some(Value::String(version)) if version == "2.0" => return Ok(()),
        Some(Value::String(version)) if version.starts_with("1.") => first_version(),
        Some(Value::Number(version)) if version.as_f64() == Some(1.0) => first_version(),
        None if is_first => first_version(),
        Some(Value::String(other)) => {
            format!("glTF {other} is not supported\nhint: export it as glTF 2.0")
        }
        Some(other) => {
            format!("{other} is no version; it must be the text \"2.0\" of a glTF 2.0 file")
        }
        None => "missing; this is not a glTF 2.0 file, or it is damaged".to_owned(),
    };
    Err(damaged(path, "asset.version", why))
}

/// `value` as a `T`, or where in the document it is not one.
fn typed<T: DeserializeOwned>(path: &Path, value: &Value) -> Result<T, Refusal> {
    read_value(value).map_err(|(place, why)| damaged(path, place, why))
}

/// The error of a text that is no JSON object.
fn broken(path: &Path, json: &[u8], in_glb: bool, error: &serde_json::Error) -> Refusal {
    let len = json.len();
    let JsonFault { place, reason } = fault_of(json, error);
    let wrong = "its length in the GLB is wrong, or the file is damaged\nhint: export it again";
    let reason = match in_glb {
        true if error.is_eof() => {
            format!("the JSON chunk ends after {len} bytes, inside the document: {wrong}")
        }
        true => format!("the JSON chunk of {len} bytes is damaged: {reason}"),
        false => format!("this is not the JSON of a glTF file: {reason}"),
    };
    let line = json.split(|&byte| byte == b'\n').nth(place.line - 1);
    let shown = excerpt(line.unwrap_or_default(), place.column);
    wrong_text(path, place.line, place.column, reason, &shown)
}

/// Fault of a text that is no JSON object: its place, and the reason.
fn fault_of(json: &[u8], error: &serde_json::Error) -> JsonFault {
    let at_its = |reason: String| JsonFault {
        place: Place { line: error.line().max(1), column: error.column().max(1) },
        reason,
    };
    match str::from_utf8(json).map(|text| JsonText::parse(text.to_owned())) {
        Ok(Err(fault)) => fault,
        Ok(Ok((_, value))) => at_its(format!("expected an object, found {}", kind_of(&value))),
        Err(error) => at_its(format!("is not UTF-8 text (byte {})", error.valid_up_to())),
    }
}

/// The keys of glTF that hold an object, and those that hold a list of objects.
const OBJECTS: [&str; 11] = [
    "asset",
    "pbrMetallicRoughness",
    "baseColorTexture",
    "metallicRoughnessTexture",
    "normalTexture",
    "occlusionTexture",
    "emissiveTexture",
    "attributes",
    "sparse",
    "perspective",
    "orthographic",
];
const LISTS: [&str; 12] = [
    "accessors",
    "buffers",
    "bufferViews",
    "cameras",
    "images",
    "materials",
    "meshes",
    "primitives",
    "samplers",
    "scenes",
    "skins",
    "textures",
];

/// Finds an array where glTF has an object; its place. Derived readers would take the array's
/// elements for the object's members in order, and complain about one of those.
fn refuse_arrays(value: &Value, at: &str) -> Result<(), String> {
    let Value::Object(members) = value else { return Ok(()) };
    for (key, member) in members {
        let inside = if at.is_empty() { key.clone() } else { format!("{at}.{key}") };
        match member {
            _ if key == "extensions" || key == "extras" => {}
            Value::Array(_) if OBJECTS.contains(&key.as_str()) => return Err(inside),
            Value::Array(elements) => {
                let of_objects = LISTS.contains(&key.as_str()) || (at.is_empty() && key == "nodes");
                for (index, element) in elements.iter().enumerate() {
                    let place = || format!("{inside}[{index}]");
                    match element {
                        Value::Array(_) if of_objects => return Err(place()),
                        Value::Object(_) => refuse_arrays(element, &place())?,
                        _ => {}
                    }
                }
            }
            member => refuse_arrays(member, &inside)?,
        }
    }
    Ok(())
}

fn not_an_object(path: &Path, place: String) -> Refusal {
    damaged(path, place, "expected an object, found an array\nhint: export the file again")
}

/// At most 80 characters of a line around `column`.
fn excerpt(line: &[u8], column: usize) -> String {
    let from = column.saturating_sub(50);
    let part = line.get(from..).unwrap_or_default();
    String::from_utf8_lossy(&part[..part.len().min(80)]).trim_ascii().to_owned()
}

/// Advice on a file of glTF's first version.
pub(super) fn first_version() -> String {
    "this is glTF 1.0, which is not supported\nhint: convert it: npx gltf-pipeline -i OLD.gltf -o NEW.glb, or \
     export it as glTF 2.0"
        .to_owned()
}

/// The error that `from` names the `what` number `index`, of which there are only `count`.
pub(super) fn absent(
    file: &Path,
    from: impl Display,
    what: &str,
    index: usize,
    count: usize,
) -> Refusal {
    let reason = format!("there is no {what} {index}; the file has {count}\nhint: export it again");
    damaged(file, from, reason)
}
