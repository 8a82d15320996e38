//! A number that tells whether two renders were of the same scene.
//!
//! What the numbers of the layers `ids` and `material_id` name: objects, nodes of models, copies and
//! materials, all counted from 1 through the whole scene.

use std::borrow::Cow;
use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use serde::Serialize;
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

/// Ingredients that a scene was made of.
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

/// The most copies of one object that are named one by one.
const NAMED_ONE_BY_ONE: u32 = 10_000;

/// A number of a layer of ids, and what it stands for.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct IdName {
    /// The number, from 1.
    pub id: u32,
    /// The last number of a run of copies that are not named one by one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub last: Option<u32>,
    /// The name; may be empty.
    pub name: String,
    /// The number of the object that it belongs to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub object: Option<u32>,
}

/// A node of a model in the scene, or the whole of a model or shape without nodes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SceneNode {
    /// Its name, else that of its object.
    pub name: String,
    /// Index of its object.
    pub object: u32,
}

/// Copies of an object, or of one node of it, whose numbers follow each other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Copies {
    /// Index of the first.
    pub first: u32,
    /// Number of copies, at least 1.
    pub count: u32,
    /// The name of what is copied.
    pub name: String,
    /// Index of the object.
    pub object: u32,
}

impl Copies {
    pub(crate) fn names(&self) -> Vec<IdName> {
        let Self { first, count, ref name, object } = *self;
        let entry = |id, last, name| IdName { id, last, name, object: Some(object + 1) };
        match count {
            1 => vec![entry(first + 1, None, name.clone())],
            2..=NAMED_ONE_BY_ONE => {
                (0..count).map(|k| entry(first + k + 1, None, format!("{name}[{k}]"))).collect()
            }
            _ => vec![entry(first + 1, Some(first + count), name.clone())],
        }
    }
}

/// Objects, nodes and copies while a scene is put together. Numbers are given in the order asked for;
/// each error says what there is too much of.
#[derive(Debug, Default)]
pub(crate) struct Register {
    pub(crate) objects: Vec<String>,
    pub(crate) nodes: Vec<SceneNode>,
    pub(crate) copies: Vec<Copies>,
}

impl Register {
    /// Adds an object and returns its index.
    pub(crate) fn object(&mut self, name: &str) -> Result<u32, &'static str> {
        let index = next(self.objects.len(), 1).ok_or("objects")?;
        self.objects.push(name.to_owned());
        Ok(index)
    }

    /// Adds a node of an object and returns its index.
    pub(crate) fn node(&mut self, name: &str, object: u32) -> Result<u32, &'static str> {
        let index = next(self.nodes.len(), 1).ok_or("nodes")?;
        self.nodes.push(SceneNode { name: name.to_owned(), object });
        Ok(index)
    }

    /// Adds copies of an object and returns the index of the first.
    pub(crate) fn copies(
        &mut self,
        name: &str,
        object: u32,
        count: usize,
    ) -> Result<u32, &'static str> {
        let before = self.copies.last().map_or(0, |last| last.first + last.count);
        let first = next(before as usize, count).ok_or("instances")?;
        // A scene may ask for no copies of an object at all.
        if let Ok(count @ 1..) = u32::try_from(count) {
            self.copies.push(Copies { first, count, name: name.to_owned(), object });
        }
        Ok(first)
    }
}

/// `before` as an index, when `count` more after it can be counted from 1 in 32 bits.
fn next(before: usize, count: usize) -> Option<u32> {
    u32::try_from(before.checked_add(count)?).ok()?;
    u32::try_from(before).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_are_counted_through_all_objects() {
        let mut register = Register::default();
        assert_eq!(register.copies("a", 0, 1), Ok(0));
        assert_eq!(register.copies("b", 1, 3), Ok(1));
        assert_eq!(register.copies("none", 2, 0), Ok(4));
        assert_eq!(register.copies("forest", 3, 20_000), Ok(4));
        assert_eq!(register.copies("too many", 4, u32::MAX as usize), Err("instances"));
        let names: Vec<IdName> = register.copies.iter().flat_map(Copies::names).collect();
        let short: Vec<_> = names.iter().map(|n| (n.id, &*n.name, n.last, n.object)).collect();
        assert_eq!(
            short,
            [
                (1, "a", None, Some(1)),
                (2, "b[0]", None, Some(2)),
                (3, "b[1]", None, Some(2)),
                (4, "b[2]", None, Some(2)),
                (5, "forest", Some(20_004), Some(4)),
            ]
        );
    }
}
