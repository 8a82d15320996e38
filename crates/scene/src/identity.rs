//! A number that tells whether two renders were of the same scene.

use std::borrow::Cow;
use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use serde_json::Value;
use xxhash_rust::xxh3::{Xxh3Default, xxh3_128};

use crate::SceneError;
use crate::cache::Digests;

/// The identity of a scene: XXH3-128 (Collet, *xxHash fast digest algorithm*, 2020) of
///
/// 1. the scene's JSON after all settings, with sorted keys and no blanks,
/// 2. the camera as it was built, in the words of `camera.json`,
/// 3. name (relative to the scene's folder) and XXH3-128 of the **contents** of every file that was
///    read, and of every mesh that is in no file.
///
/// It does not see files that the render did not want, such as an image that no layer shows.
/// Formatting, machine, folder and time do not change it. It is no protection against forgery.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SceneHash(pub u128);

impl fmt::Display for SceneHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

/// What a scene was made of.
#[derive(Debug, Clone, Default)]
pub(crate) struct Ingredients {
    /// The scene's JSON with sorted keys and no blanks.
    json: String,
    /// XXH3-128 of the same without `render.samples`.
    of_any_samples: u128,
    /// Files by the name that the scene's folder gives them, sorted.
    files: Vec<(String, PathBuf)>,
    /// Fingerprints of meshes that are in no file, by their names.
    meshes: Vec<(String, u128)>,
    digests: Arc<Digests>,
}

impl Ingredients {
    pub(crate) fn new(
        value: &Value,
        mut files: Vec<(String, PathBuf)>,
        meshes: Vec<(String, u128)>,
        digests: Arc<Digests>,
    ) -> Self {
        files.sort();
        let mut json = String::new();
        canonical(value, &mut json);
        let of_any_samples = xxh3_128(without_samples(value).as_bytes());
        Self { json, of_any_samples, files, meshes, digests }
    }

    pub(crate) fn hash(&self, camera: &str) -> Result<SceneHash, SceneError> {
        self.hash_with(self.json.as_bytes(), camera)
    }

    /// The identity of the scene with any number of samples.
    pub(crate) fn hash_of_any_samples(&self, camera: &str) -> Result<SceneHash, SceneError> {
        self.hash_with(&self.of_any_samples.to_le_bytes(), camera)
    }

    fn hash_with(&self, values: &[u8], camera: &str) -> Result<SceneHash, SceneError> {
        let mut hash = Xxh3Default::new();
        add(&mut hash, values);
        add(&mut hash, camera.as_bytes());
        for (name, path) in &self.files {
            add(&mut hash, name.as_bytes());
            add(&mut hash, &self.digests.of(path)?.to_le_bytes());
        }
        for (name, digest) in &self.meshes {
            add(&mut hash, name.as_bytes());
            add(&mut hash, &digest.to_le_bytes());
        }
        Ok(SceneHash(hash.digest128()))
    }
}

/// Adds a part behind its length, so that parts cannot run into each other.
fn add(hash: &mut Xxh3Default, part: &[u8]) {
    hash.update(&(part.len() as u64).to_le_bytes());
    hash.update(part);
}

/// [`canonical`] JSON of a scene that says nothing of its samples.
fn without_samples(scene: &Value) -> String {
    let mut text = String::new();
    let Value::Object(members) = scene else { return text };
    let mut members: Vec<_> = members.iter().collect();
    members.sort_by_key(|(key, _)| key.as_str());
    for (key, member) in members {
        let mut member = Cow::Borrowed(member);
        if key == "render"
            && let Value::Object(render) = member.to_mut()
        {
            render.remove("samples");
            // One that says nothing else might as well be absent.
            if render.is_empty() {
                continue;
            }
        }
        text.push_str(&Value::from(key.as_str()).to_string());
        text.push(':');
        canonical(&member, &mut text);
        text.push(',');
    }
    text
}

/// JSON with sorted keys, whatever order the map keeps.
fn canonical(value: &Value, text: &mut String) {
    match value {
        Value::Object(members) => {
            let mut members: Vec<_> = members.iter().collect();
            members.sort_by_key(|(key, _)| key.as_str());
            text.push('{');
            for (key, member) in members {
                text.push_str(&Value::from(key.as_str()).to_string());
                text.push(':');
                canonical(member, text);
                text.push(',');
            }
            text.push('}');
        }
        Value::Array(elements) => {
            text.push('[');
            for element in elements {
                canonical(element, text);
                text.push(',');
            }
            text.push(']');
        }
        leaf => text.push_str(&leaf.to_string()),
    }
}
