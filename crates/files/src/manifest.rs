//! The files that a command wrote into a folder and below it, by name, size and fingerprint: what of them
//! the next run does not write again is removed, and nothing else.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::Xxh3Default;

use crate::{SOFTWARE, Transaction, WriteError};

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
    /// Places below, by command, that list files of their own.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    below: BTreeMap<String, BTreeSet<String>>,
}

impl Book {
    fn write(&self, folder: &Path) -> Result<(), WriteError> {
        let path = folder.join(MANIFEST);
        let json =
            serde_json::to_string_pretty(self).map_err(|e| WriteError::io(&path, e.into()))?;
        Transaction::at_once().write(&path, |part| writeln!(part, "{json}"))
    }
}

/// Fingerprint that tells whether a file is as it was written.
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
    /// As it was found, without the command's own.
    others: Book,
    old: BTreeMap<String, Print>,
    new: BTreeMap<String, Print>,
    old_below: BTreeSet<String>,
    new_below: BTreeSet<String>,
}

impl Ledger {
    /// The manifest of `folder` for `command`. One that is not there or makes no sense is empty.
    #[must_use]
    pub fn open(folder: &Path, command: &'static str) -> Self {
        let mut others = read(&folder.join(MANIFEST)).unwrap_or_default();
        let old = others.files.remove(command).unwrap_or_default();
        let old_below = others.below.remove(command).unwrap_or_default();
        Self {
            folder: folder.to_owned(),
            command,
            others,
            old,
            new: BTreeMap::new(),
            old_below,
            new_below: BTreeSet::new(),
        }
    }

    /// Folder of the files.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// True if all files that the command wrote are as it wrote them.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        let is_there = |(name, print): (&String, &Print)| {
            Print::of(&self.folder.join(name)).is_ok_and(|found| found == *print)
        };
        self.old.iter().all(is_there)
    }

    /// True if no command has anything in the folder.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        let own = self.old.is_empty() && self.new.is_empty();
        let below = self.old_below.is_empty() && self.new_below.is_empty();
        let others = self.others.files.values().all(BTreeMap::is_empty);
        own && below && others && self.others.below.values().all(BTreeSet::is_empty)
    }

    /// Lists places below the folder that list files of their own: folders with a manifest, and the like.
    /// The manifest has them once it is [saved](Self::save): before anything is in them.
    pub fn list_below(&mut self, places: impl IntoIterator<Item = String>) {
        self.new_below.extend(places);
    }

    /// Places below that the command listed before and does not list now, as far as they lie in the folder.
    #[must_use]
    pub fn stale_below(&self) -> Vec<PathBuf> {
        let stale = self.old_below.difference(&self.new_below);
        stale.filter(|name| is_plain(name)).map(|name| self.folder.join(name)).collect()
    }

    /// Notes `files`, as far as they are in the folder or below it.
    ///
    /// # Errors
    ///
    /// When the manifest cannot be written.
    pub fn record(&mut self, files: &[PathBuf]) -> Result<(), WriteError> {
        if files.is_empty() {
            return Ok(());
        }
        for path in files {
            let Some(name) = path.strip_prefix(&self.folder).ok().and_then(Path::to_str) else {
                continue;
            };
            // Gone again already, or no regular file: nothing to remove later.
            let Ok(print) = Print::of(path) else { continue };
            self.old.remove(name);
            self.new.insert(name.to_owned(), print);
        }
        self.save()
    }

    /// Removes what the command wrote before and not again, as far as it is what it was, and folders below
    /// that are empty then.
    ///
    /// # Errors
    ///
    /// When the manifest cannot be written.
    pub fn clear(&mut self) -> Result<(), WriteError> {
        let root = self.folder.canonicalize().ok();
        // Not through a link that leads elsewhere.
        let is_here = |path: &Path| {
            let real = path.parent().and_then(|parent| parent.canonicalize().ok());
            real.zip(root.as_ref()).is_some_and(|(real, root)| real.starts_with(root))
        };
        for (name, print) in std::mem::take(&mut self.old) {
            let path = self.folder.join(&name);
            let has_size = fs::symlink_metadata(&path).is_ok_and(|data| data.len() == print.bytes);
            if is_plain(&name)
                && has_size
                && is_here(&path)
                && Print::of(&path).is_ok_and(|found| found == print)
            {
                // What cannot be removed is nobody's loss.
                let _ = fs::remove_file(&path);
                remove_empty_folders(&self.folder, &path);
            }
        }
        self.old_below.clear();
        self.save()
    }

    /// Writes the manifest: what was there before, and what is listed and recorded since.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub fn save(&self) -> Result<(), WriteError> {
        let mut book = Book {
            software: SOFTWARE.to_owned(),
            about: ABOUT.to_owned(),
            files: self.others.files.clone(),
            below: self.others.below.clone(),
        };
        let own = self.old.iter().chain(&self.new);
        book.files.insert(
            self.command.to_owned(),
            own.map(|(name, print)| (name.clone(), print.clone())).collect(),
        );
        let below: BTreeSet<String> = self.old_below.union(&self.new_below).cloned().collect();
        if !below.is_empty() {
            book.below.insert(self.command.to_owned(), below);
        }
        book.write(&self.folder)
    }
}

/// True if a name stays in its folder, or below it.
fn is_plain(name: &str) -> bool {
    let mut parts = Path::new(name).components().peekable();
    parts.peek().is_some() && parts.all(|part| matches!(part, Component::Normal(_)))
}

/// Removes the folders between `root` and `path` that have nothing in them.
pub fn remove_empty_folders(root: &Path, path: &Path) {
    let between = path.ancestors().skip(1).take_while(|folder| *folder != root);
    for folder in between.filter(|folder| folder.starts_with(root)) {
        if fs::remove_dir(folder).is_err() {
            return;
        }
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
    use super::*;

    fn put(files: &Transaction, folder: &Path, name: &str) {
        fs::create_dir_all(folder.join(name).parent().unwrap()).unwrap();
        files.write(&folder.join(name), |part| part.write_all(name.as_bytes())).unwrap();
    }

    /// One run that writes `names`.
    fn run(folder: &Path, command: &'static str, names: &[&str]) {
        let mut ledger = Ledger::open(folder, command);
        let files = Transaction::new();
        names.iter().for_each(|name| put(&files, folder, name));
        files.commit().unwrap();
        ledger.record(&files.finished()).unwrap();
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
    fn files_below_go_with_their_folders_and_others_keep_theirs() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        run(folder, "render", &["a", "views/one", "views/two", "hci/deep/one"]);
        fs::write(folder.join("views/mine"), "mine").unwrap();
        run(folder, "render", &["a", "views/two"]);
        assert_eq!(names(folder), ["a", "views"]);
        assert_eq!(names(&folder.join("views")), ["mine", "two"]);
        run(folder, "render", &["a"]);
        assert_eq!(names(&folder.join("views")), ["mine"]);
    }

    #[test]
    fn places_below_are_stale_when_they_are_not_listed_again() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let list = |names: &[&str]| {
            let mut ledger = Ledger::open(folder, "render");
            ledger.list_below(names.iter().map(|&name| name.to_owned()));
            ledger.save().unwrap();
            let stale = ledger.stale_below();
            ledger.clear().unwrap();
            stale
        };
        assert!(list(&["frames/0", "frames/1", "../elsewhere"]).is_empty());
        assert_eq!(list(&["frames/0"]), [folder.join("frames/1")]);
        run(folder, "bench", &["a"]);
        assert_eq!(list(&[]), [folder.join("frames/0")]);
        assert!(list(&[]).is_empty());
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
        fs::create_dir(outer.path().join("elsewhere")).unwrap();
        fs::write(outer.path().join("elsewhere/precious"), "").unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink("../elsewhere", folder.join("away")).unwrap();
        let listed = [
            "../precious",
            &absolute,
            "",
            "..",
            "link",
            "missing",
            "away/precious",
            "a/../../precious",
        ];
        let own = listed.map(|name| (name.to_owned(), empty.clone())).into();
        let book = Book { files: [("render".to_owned(), own)].into(), ..Book::default() };
        book.write(&folder).unwrap();
        run(&folder, "render", &["a"]);
        assert!(outer.path().join("precious").exists());
        assert!(outer.path().join("elsewhere/precious").exists());
        assert!(folder.join("real").exists());
        for text in ["", "[]", "{\"files\": 3}", "{"] {
            fs::write(folder.join(MANIFEST), text).unwrap();
            run(&folder, "render", &["a"]);
            assert!(folder.join("a").exists(), "{text}");
        }
    }
}
