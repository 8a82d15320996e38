//! Records of earlier runs: the pictures, frames and data sets that they left in a folder.

use std::fs;
use std::path::{Component, Path, PathBuf};

use etendue_files::{Ledger, MANIFEST, MOST_OWN_BYTES, remove_empty_folders};
use etendue_render::denoise;
use etendue_render::output::HeaderEntry;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// File that lists the frames of a data set.
pub(crate) const INDEX: &str = "index.json";

/// File that lists the files of a frame, where they lie among those of others.
pub(crate) const RECORD: &str = "frames/{frame}.json";

/// Record by which a complete frame is known, where its files lie among those of others.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct Record {
    /// Entries of its files' headers.
    pub(crate) fingerprints: Vec<HeaderEntry>,
    /// Its files and their sizes (bytes).
    pub(crate) files: Vec<(String, u64)>,
}

/// True if a place that lists files is a record, and no folder.
pub(crate) fn is_record(place: &Path) -> bool {
    place.extension().is_some_and(|ending| ending == "json")
}

/// Removes from `out` what a record lists, as far as it has the size that it had, and the record.
pub(crate) fn remove_recorded(out: &Path, path: &Path) {
    let is_plain =
        |name: &str| Path::new(name).components().all(|part| matches!(part, Component::Normal(_)));
    let files = read_record(path).unwrap_or_default().files;
    for (name, size) in files.iter().filter(|(name, _)| is_plain(name)) {
        let file = out.join(name);
        // What cannot be removed is nobody's loss.
        if fs::symlink_metadata(&file).is_ok_and(|data| data.is_file() && data.len() == *size) {
            let _ = fs::remove_file(&file);
            remove_empty_folders(out, &file);
        }
    }
    let _ = fs::remove_file(path);
}

pub(crate) fn numbered(text: &str, number: usize) -> String {
    text.replace("{frame}", &format!("{number:06}"))
}

pub(crate) fn record_of(out: &Path, number: usize) -> PathBuf {
    out.join(numbered(RECORD, number))
}

pub(crate) fn read_record(path: &Path) -> Option<Record> {
    serde_json::from_slice(&etendue_files::read(path, MOST_OWN_BYTES).ok()?).ok()
}

/// True if `folder` has a complete picture of the scene with these fingerprints, `files` among its
/// files, and all as they were written.
pub(crate) fn is_rendered(folder: &Path, fingerprints: &[HeaderEntry], files: &[String]) -> bool {
    let Some((header, found)) = complete_picture(folder) else { return false };
    // What its noise was taken out of is another picture.
    let denoised = denoise::fingerprint().key;
    let is_wanted = fingerprints.iter().any(|own| own.key == denoised);
    is_of(&header, fingerprints)
        && (is_wanted || header.get(&denoised).is_none())
        && files.iter().all(|file| found.contains_key(file))
        && Ledger::open(folder, "render").is_whole()
}

/// True if a header has these fingerprints among its entries.
fn is_of(header: &Value, fingerprints: &[HeaderEntry]) -> bool {
    let is_same = |HeaderEntry { key, text }: &HeaderEntry| {
        header.get(key).and_then(Value::as_str) == Some(text.as_str())
    };
    fingerprints.iter().all(is_same)
}

/// The header and the files of the picture in `folder`, as [`picture`]; `None` also when it was stopped before
/// all samples were taken.
pub(crate) fn complete_picture(folder: &Path) -> Option<(Value, Map<String, Value>)> {
    picture(folder).filter(|(header, _)| header.get("partial").is_none())
}

/// The samples a pixel of the picture with these fingerprints in `folder`, where it was stopped before all of
/// them were taken.
pub(crate) fn stopped_samples(folder: &Path, fingerprints: &[HeaderEntry]) -> Option<u64> {
    let (header, _) = picture(folder)?;
    header.get("partial").filter(|_| is_of(&header, fingerprints))?;
    header.get("samples")?.as_str()?.parse().ok()
}

/// The header and the files of the picture in `folder`; `None` when there is none, or when a file of it is
/// missing.
fn picture(folder: &Path) -> Option<(Value, Map<String, Value>)> {
    let read = |name: &str| -> Option<Value> {
        let bytes = etendue_files::read(&folder.join(name), MOST_OWN_BYTES).ok()?;
        serde_json::from_slice(&bytes).ok()
    };
    let header = read("layers.json")?.get("header")?.clone();
    let Value::Object(files) = read(MANIFEST)?.pointer("/files/render")?.clone() else {
        return None;
    };
    let is_there = |(name, print): (&String, &Value)| {
        let bytes = print.get("bytes").and_then(Value::as_u64);
        folder.join(name).metadata().is_ok_and(|data| Some(data.len()) == bytes)
    };
    files.iter().all(is_there).then_some((header, files))
}

/// The numbers of the frames of the data set that was written to `folder`.
pub(crate) fn frame_numbers(folder: &Path) -> Vec<usize> {
    let index = etendue_files::read(&folder.join(INDEX), MOST_OWN_BYTES).ok();
    let index: Option<Value> = index.and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let frames = index.as_ref().and_then(|index| index["frames"].as_array());
    let number = |frame: &Value| usize::try_from(frame["frame"].as_u64()?).ok();
    frames.into_iter().flatten().filter_map(number).collect()
}
