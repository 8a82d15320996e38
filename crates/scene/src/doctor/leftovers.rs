//! Files beside the models that nothing names.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use aho_corasick::AhoCorasick;
use etendue_files::MappedFile;

/// Endings of files that only make sense when something names them.
const SERVANTS: [&str; 10] =
    ["bin", "mtl", "png", "jpg", "jpeg", "ktx2", "webp", "bmp", "tga", "tif"];

/// A blank in a name, as itself and as URIs and shells write it.
const BLANKS: [&str; 3] = [" ", "%20", "\\ "];

/// Endings of files that name others.
const MASTERS: [&str; 5] = ["gltf", "glb", "obj", "mtl", "json"];

/// The most entries of a folder that are looked at.
const MOST_ENTRIES: usize = 10_000;

/// The most bytes of a file that are looked through for names.
const MOST_TEXT: usize = 16 << 20;

/// The most bytes of an OBJ file that are looked through: it names its libraries before its faces.
const OBJ_HEAD: usize = 1 << 16;

/// The most bytes that are looked through in a folder.
const MOST_IN_ALL: usize = 256 << 20;

/// Images, buffers and material files in the folders of `opened` whose name stands in no glTF, OBJ,
/// MTL or scene file of the same folder, nor in the scene at `scene`. Sorted.
///
/// The rule is narrow on purpose: names are looked for as text, so a file is listed only when
/// nothing there can mean it. Of a folder where too much is to be looked through none is listed. Of
/// OBJ files the head is looked at.
pub(super) fn find(opened: &[&Path], scene: &Path) -> Vec<PathBuf> {
    let folder_of = |path: &&'_ Path| match path.parent() {
        Some(folder) if folder.as_os_str().is_empty() => Some(PathBuf::from(".")),
        folder => Some(folder?.to_owned()),
    };
    let folders: BTreeSet<PathBuf> = opened.iter().filter_map(folder_of).collect();
    let found = folders.iter().filter_map(|folder| unused_in(folder, scene));
    let mut unused: Vec<PathBuf> = found.flatten().collect();
    unused.sort();
    unused
}

/// The unused files of one folder; `None` where it cannot be told.
fn unused_in(folder: &Path, scene: &Path) -> Option<Vec<PathBuf>> {
    let files = files_in(folder)?;
    let candidates: Vec<&PathBuf> =
        files.iter().filter(|path| has_ending(path, &SERVANTS)).collect();
    if candidates.is_empty() {
        return Some(Vec::new());
    }
    // Each name as it is, and with its blanks as URIs and shells write them.
    let spellings: Vec<String> = candidates
        .iter()
        .map(|path| path.file_name().unwrap_or_default().to_string_lossy())
        .flat_map(|name| BLANKS.map(|blank| name.replace(' ', blank)))
        .collect();
    let names = AhoCorasick::new(&spellings).ok()?;
    let mut is_named = vec![false; candidates.len()];
    let mut looked_through = 0;
    let masters = files.iter().filter(|path| has_ending(path, &MASTERS));
    for master in masters.map(PathBuf::as_path).chain([scene]) {
        let Ok(file) = MappedFile::open(master) else { continue };
        let text = naming_part(file.bytes());
        let text = match has_ending(master, &["obj"]) {
            true => &text[..text.len().min(OBJ_HEAD)],
            false => text,
        };
        looked_through += text.len();
        if text.len() > MOST_TEXT || looked_through > MOST_IN_ALL {
            return None;
        }
        for found in names.find_overlapping_iter(text) {
            let candidate = found.pattern().as_usize() / BLANKS.len();
            is_named[candidate] |= candidates[candidate] != master;
        }
    }
    let unnamed = candidates.into_iter().zip(is_named).filter(|(_, is_named)| !is_named);
    Some(unnamed.map(|(path, _)| path.clone()).collect())
}

/// The regular files of a folder; `None` when it has too many entries or cannot be read.
fn files_in(folder: &Path) -> Option<Vec<PathBuf>> {
    let entries: Vec<_> = fs::read_dir(folder).ok()?.take(MOST_ENTRIES + 1).collect();
    if entries.len() > MOST_ENTRIES {
        return None;
    }
    let paths = entries.into_iter().filter_map(|entry| Some(entry.ok()?.path()));
    Some(paths.filter(|path| path.is_file()).collect())
}

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    endings.iter().any(|known| ending.eq_ignore_ascii_case(known))
}

/// The part of a file that may name others: of a GLB its JSON chunk.
pub(super) fn naming_part(bytes: &[u8]) -> &[u8] {
    match bytes.strip_prefix(b"glTF") {
        Some(_) => {
            let length = bytes.get(12..16).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
            let end = length.and_then(|length| 20_usize.checked_add(length as usize));
            end.and_then(|end| bytes.get(20..end)).unwrap_or_default()
        }
        None => bytes,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_nothing_names_is_listed() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &[u8]| {
            let path = folder.path().join(name);
            fs::write(&path, text).unwrap();
            path
        };
        let model = write("a.obj", b"mtllib a.mtl\n");
        write("a.mtl", b"map_Kd wood grain.png\n");
        write("wood grain.png", b"");
        let stray = write("old.png", b"");
        let lonely = write("b.mtl", b"map_Kd old%20.png\n");
        write("notes.txt", b"");
        write("c.gltf", b"{\"images\": [{\"uri\": \"tall%20grass.jpg\"}]}");
        write("tall grass.jpg", b"");
        assert_eq!(find(&[&model], Path::new("none")), [lonely, stray]);
    }

    #[test]
    fn only_the_heads_of_large_files_are_looked_through() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::write(path("old.png"), b"").unwrap();
        // Gigabytes that take no room: reading them would take minutes.
        let obj = path("a.obj");
        fs::write(&obj, b"mtllib a.mtl\n").unwrap();
        fs::File::options().write(true).open(&obj).unwrap().set_len(1 << 36).unwrap();
        assert_eq!(find(&[&obj], Path::new("none")), [path("old.png")]);
        // What is too large and names files anywhere leaves it open.
        fs::File::create(path("b.gltf")).unwrap().set_len(1 << 36).unwrap();
        assert_eq!(find(&[&obj], Path::new("none")), [] as [PathBuf; 0]);
    }

    #[test]
    fn a_glb_names_files_in_its_json_only() {
        let mut glb = b"glTF\x02\0\0\0\0\0\0\0\x04\0\0\0JSON{ab}rest".to_vec();
        assert_eq!(naming_part(&glb), b"{ab}");
        glb.truncate(18);
        assert!(naming_part(&glb).is_empty());
        assert_eq!(naming_part(b"plain"), b"plain");
    }
}
