//! The files that a command wrote into a folder, by name, size and fingerprint: what of them the next
//! run does not write again is removed, and nothing else.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::Xxh3Default;

use super::atomic::take_finished;
use super::sidecar::write_json;
use super::{OutputError, SOFTWARE};

/// The name of the manifest.
pub const MANIFEST: &str = "etendue-manifest.json";

/// A manifest is not read beyond this (bytes): ours have a hundred a file.
const LONGEST: u64 = 16 << 20;

const ABOUT: &str = "files that etendue wrote here, by command; the next run of a command removes \
                     those of its own that it does not write again, unless they were changed";

/// The manifest.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Book {
    #[serde(default)]
    software: String,
    #[serde(default)]
    about: String,
    files: BTreeMap<String, BTreeMap<String, Print>>,
}

/// What tells whether a file is as it was written.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Print {
    bytes: u64,
    xxh3_128: String,
}

impl Print {
    /// Of a regular file; a link is none.
    fn of(path: &Path) -> io::Result<Self> {
        let data = fs::symlink_metadata(path)?;
        if !data.is_file() {
            return Err(io::ErrorKind::InvalidInput.into());
        }
        let mut file = File::open(path)?;
        let (mut hash, mut buffer) = (Xxh3Default::new(), vec![0; 1 << 16]);
        loop {
            match file.read(&mut buffer)? {
                0 => break,
                n => hash.update(&buffer[..n]),
            }
        }
        Ok(Self { bytes: data.len(), xxh3_128: format!("{:032x}", hash.digest128()) })
    }
}

/// A folder's manifest, and what one command did there before and does now.
#[derive(Debug)]
pub struct Ledger {
    folder: PathBuf,
    command: &'static str,
    others: BTreeMap<String, BTreeMap<String, Print>>,
    old: BTreeMap<String, Print>,
    new: BTreeMap<String, Print>,
}

impl Ledger {
    /// The manifest of `folder` for `command`. One that is not there or makes no sense is empty.
    #[must_use]
    pub fn open(folder: &Path, command: &'static str) -> Self {
        let mut others = read(&folder.join(MANIFEST)).unwrap_or_default().files;
        let old = others.remove(command).unwrap_or_default();
        Self { folder: folder.to_owned(), command, others, old, new: BTreeMap::new() }
    }

    /// Where the files are.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Whether all files that the command wrote are as it wrote them.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        let is_there = |(name, print): (&String, &Print)| {
            Print::of(&self.folder.join(name)).is_ok_and(|found| found == *print)
        };
        self.old.iter().all(is_there)
    }

    /// The names of the files that the command wrote.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.old.keys().map(String::as_str)
    }

    /// Notes the files that this process finished in the folder since it was last asked.
    ///
    /// # Errors
    ///
    /// When the manifest cannot be written.
    pub fn record(&mut self) -> Result<(), OutputError> {
        for path in take_finished(&self.folder) {
            let Some(name) = path.file_name().and_then(|name| name.to_str()) else { continue };
            // What a render goes on from is no result of it.
            if name == MANIFEST || name.ends_with(".film") {
                continue;
            }
            // Gone again already, or no regular file: nothing to remove later.
            let Ok(print) = Print::of(&path) else { continue };
            self.old.remove(name);
            self.new.insert(name.to_owned(), print);
        }
        self.write()
    }

    /// Removes what the command wrote before and not again, as far as it is what it was.
    ///
    /// # Errors
    ///
    /// When the manifest cannot be written.
    pub fn clear(&mut self) -> Result<(), OutputError> {
        for (name, print) in std::mem::take(&mut self.old) {
            let path = self.folder.join(&name);
            let is_plain = matches!(
                Path::new(&name).components().collect::<Vec<_>>()[..],
                [Component::Normal(_)]
            );
            let has_size = fs::symlink_metadata(&path).is_ok_and(|data| data.len() == print.bytes);
            if is_plain && has_size && Print::of(&path).is_ok_and(|found| found == print) {
                // What cannot be removed is nobody's loss.
                let _ = fs::remove_file(&path);
            }
        }
        self.write()
    }

    fn write(&self) -> Result<(), OutputError> {
        let mut files = self.others.clone();
        let own = self.old.iter().chain(&self.new);
        files.insert(
            self.command.to_owned(),
            own.map(|(name, print)| (name.clone(), print.clone())).collect(),
        );
        let book = Book { software: SOFTWARE.to_owned(), about: ABOUT.to_owned(), files };
        write_json(&self.folder.join(MANIFEST), &book)
    }
}

fn read(path: &Path) -> Option<Book> {
    let data = fs::symlink_metadata(path).ok()?;
    if !data.is_file() || data.len() > LONGEST {
        return None;
    }
    serde_json::from_slice(&fs::read(path).ok()?).ok()
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::super::write_whole;
    use super::*;

    fn put(folder: &Path, name: &str) {
        write_whole(&folder.join(name), |part| part.write_all(name.as_bytes())).unwrap();
    }

    /// One run that writes `names`.
    fn run(folder: &Path, command: &'static str, names: &[&str]) {
        let mut ledger = Ledger::open(folder, command);
        names.iter().for_each(|name| put(folder, name));
        ledger.record().unwrap();
        ledger.clear().unwrap();
    }

    fn names(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder).unwrap();
        let mut names: Vec<String> =
            names.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.retain(|name| name != MANIFEST);
        names.sort();
        names
    }

    #[test]
    fn own_files_go_and_nobody_elses() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        fs::write(folder.join("mine.txt"), "mine").unwrap();
        run(folder, "render", &["a", "b", "c", "d"]);
        run(folder, "bench", &["e"]);
        // One is changed in place, and one replaced by another of the same size.
        fs::write(folder.join("b"), "bb").unwrap();
        fs::write(folder.join("c"), "x").unwrap();
        run(folder, "render", &["a", "f"]);
        assert_eq!(names(folder), ["a", "b", "c", "e", "f", "mine.txt"]);
        run(folder, "render", &["f"]);
        assert_eq!(names(folder), ["b", "c", "e", "f", "mine.txt"]);
    }

    #[test]
    fn a_forged_manifest_removes_nothing_outside() {
        let outer = tempfile::tempdir().unwrap();
        let folder = outer.path().join("inner");
        fs::create_dir(&folder).unwrap();
        fs::write(outer.path().join("precious"), "").unwrap();
        fs::write(folder.join("real"), "").unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink("real", folder.join("link")).unwrap();
        let empty = Print::of(&outer.path().join("precious")).unwrap();
        let absolute = outer.path().join("precious").to_string_lossy().into_owned();
        let listed = ["../precious", &absolute, "", "..", "link", "missing"];
        let own = listed.map(|name| (name.to_owned(), empty.clone())).into();
        let book = Book { files: [("render".to_owned(), own)].into(), ..Book::default() };
        write_json(&folder.join(MANIFEST), &book).unwrap();
        run(&folder, "render", &["a"]);
        assert!(outer.path().join("precious").exists());
        assert!(folder.join("real").exists());
        for text in ["", "[]", "{\"files\": 3}", "{"] {
            fs::write(folder.join(MANIFEST), text).unwrap();
            run(&folder, "render", &["a"]);
            assert!(folder.join("a").exists(), "{text}");
        }
    }
}
