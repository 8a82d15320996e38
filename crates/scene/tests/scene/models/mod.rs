//! Small models made by hand: what the assets do not have, and what is broken.

mod animations;
mod broken;
mod build;
mod damaged;
mod draco;
mod gltf;
mod obj;
mod packed;
mod playing;
mod ply;
mod skins;

use std::path::{Path, PathBuf};

use etendue_geometry::Mesh;
use etendue_geometry::glam::DVec3;
use etendue_scene::Refusal;
use etendue_scene::import::{Import, Options, Strictness, Wanted, import};
use tempfile::TempDir;

pub(crate) fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

pub(crate) fn write(folder: &TempDir, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

pub(crate) fn load(path: &Path) -> Import {
    import(path, Wanted::EVERYTHING, &Options::default()).unwrap()
}

pub(crate) fn error(path: &Path) -> String {
    import(path, Wanted::EVERYTHING, &Options::default()).unwrap_err().to_string()
}

pub(crate) fn strict() -> Options {
    Options { strictness: Strictness::Strict, ..Options::default() }
}

pub(crate) fn points(mesh: &Mesh) -> Vec<DVec3> {
    (0..mesh.positions.len()).map(|i| mesh.positions.get(i)).collect()
}

pub(crate) fn import_with(folder: &TempDir, name: &str, wanted: Wanted) -> Import {
    import(&folder.path().join(name), wanted, &Options::default()).unwrap()
}

pub(crate) fn super_import(path: &Path) -> Import {
    import(path, Wanted::EVERYTHING, &Options::default()).unwrap()
}

pub(crate) fn import_strict(path: &Path) -> Result<Import, Refusal> {
    import(path, Wanted::EVERYTHING, &strict())
}

/// The file is refused with a message that has its name and all `words`.
pub(crate) fn refused(name: &str, bytes: Vec<u8>, words: &[&str]) {
    let folder = folder();
    let message = error(&write(&folder, name, bytes));
    assert!(message.contains(name), "{message}");
    for word in words {
        assert!(message.contains(word), "{name}: {message}");
    }
}

#[test]
fn what_cannot_be_opened_is_named() {
    let folder = folder();
    let missing = error(&folder.path().join("none.glb"));
    assert!(missing.contains("none.glb") && missing.contains("cannot be read"), "{missing}");
    assert!(error(&write(&folder, "a.fbx", "x")).contains("use .gltf, .glb, .obj or .ply"));
    std::fs::create_dir(folder.path().join("dir.obj")).unwrap();
    assert!(error(&folder.path().join("dir.obj")).contains("not a regular file"));
    assert!(error(&write(&folder, "empty.glb", "")).contains("empty.glb"));
}
