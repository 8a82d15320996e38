//! Files beside the models that nothing names.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use etendue_geometry::MappedFile;

/// Endings of files that only make sense when something names them.
const SERVANTS: [&str; 10] =
    ["bin", "mtl", "png", "jpg", "jpeg", "ktx2", "webp", "bmp", "tga", "tif"];

/// Endings of files that name others.
const MASTERS: [&str; 5] = ["gltf", "glb", "obj", "mtl", "json"];

/// Images, buffers and material files in the folders of `opened` whose name stands in no glTF, OBJ,
/// MTL or scene file of the same folder, nor in the scene at `scene`. Sorted.
///
/// The rule is narrow on purpose: names are looked for as text, so a file is listed only when
/// nothing there can mean it.
pub(super) fn find(opened: &[&Path], scene: &Path) -> Vec<PathBuf> {
    let folder_of = |path: &&'_ Path| match path.parent() {
        Some(folder) if folder.as_os_str().is_empty() => Some(PathBuf::from(".")),
        folder => Some(folder?.to_owned()),
    };
    let folders: BTreeSet<PathBuf> = opened.iter().filter_map(folder_of).collect();
    let mut unused = Vec::new();
    for folder in folders {
        let files = files_in(&folder);
        let mut candidates: Vec<&PathBuf> =
            files.iter().filter(|path| has_ending(path, &SERVANTS)).collect();
        let masters = files.iter().filter(|path| has_ending(path, &MASTERS));
        for master in masters.map(PathBuf::as_path).chain([scene]) {
            if candidates.is_empty() {
                break;
            }
            if let Ok(file) = MappedFile::open(master) {
                let text = String::from_utf8_lossy(naming_part(file.bytes()));
                candidates.retain(|candidate| *candidate == master || !names(&text, candidate));
            }
        }
        unused.extend(candidates.into_iter().cloned());
    }
    unused.sort();
    unused
}

fn files_in(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    paths.filter(|path| path.is_file()).collect()
}

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    endings.iter().any(|known| ending.eq_ignore_ascii_case(known))
}

/// Whether `text` has the file's name, as it is or with its blanks as URIs or shells write them.
fn names(text: &str, file: &Path) -> bool {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    [" ", "%20", "\\ "].iter().any(|blank| text.contains(&name.replace(' ', blank)))
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
    fn a_glb_names_files_in_its_json_only() {
        let mut glb = b"glTF\x02\0\0\0\0\0\0\0\x04\0\0\0JSON{ab}rest".to_vec();
        assert_eq!(naming_part(&glb), b"{ab}");
        glb.truncate(18);
        assert!(naming_part(&glb).is_empty());
        assert_eq!(naming_part(b"plain"), b"plain");
    }
}
