//! Scenes and models from files: what is read, what is mended, what is refused.
#![allow(clippy::disallowed_methods, reason = "tests set their stage by hand")]

mod accuracy;
mod assets;
mod bad_input;
mod camera_files;
mod doctor;
mod documents;
mod models;
mod rigs;
mod scenes;
mod shutter_faults;
mod specs;
mod trajectories;

use std::path::{Path, PathBuf};

/// The folder of shared test data, if this machine has it.
fn test_data() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let folder = std::env::var_os("ETENDUE_ASSETS").map_or(beside, PathBuf::from);
    if folder.join("data").is_dir() {
        Some(folder.join("data"))
    } else {
        println!("skipped: no test data; name their folder in ETENDUE_ASSETS");
        None
    }
}
