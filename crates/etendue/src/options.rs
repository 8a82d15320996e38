//! Options of opening a scene.

use std::path::PathBuf;

use etendue_files::Reach;
use etendue_render::output::Outputs;
use etendue_scene::{Setting, Strictness};

/// Options of opening and building a scene.
#[derive(Debug, Clone)]
pub struct Options {
    /// Settings of the scene's values, the later the stronger.
    pub settings: Vec<Setting>,
    /// Treatment of defects in the data.
    pub strictness: Strictness,
    /// Permission to read files outside of the scene's folder.
    pub reach: Reach,
    /// Catalogues of glasses in Zemax' AGF format, looked through before the built-in one, the last first. They
    /// are inputs like what the scene names.
    pub glass_catalogs: Vec<PathBuf>,
    /// Files that the caller has read for the scene: they are not written over, and the scene's hash sees them.
    pub inputs: Vec<PathBuf>,
    /// A camera of one of the models by name or number, in place of the scene's.
    pub camera: Option<String>,
    /// The most memory that may be taken (bytes); `None` for what the system has free.
    pub memory_limit: Option<u64>,
    /// True if models are read into memory instead of being used where their files are mapped: for
    /// files that other programs change meanwhile.
    pub copy: bool,
    /// Kinds of file to be written of the pictures: without NPY data layers are kept in single precision.
    pub outputs: Outputs,
    /// True if the structure is watertight (see [`etendue_accel::BuildOptions::robust`]).
    pub robust: bool,
    /// One of Embree's instruction sets (see [`etendue_accel::BuildOptions::isa`]).
    pub isa: Option<String>,
    /// True if memory for the picture and the structure is spoken for when the scene is loaded, so
    /// that a render that would not fit is refused before any work is done.
    pub to_render: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            settings: Vec::new(),
            strictness: Strictness::default(),
            reach: Reach::default(),
            glass_catalogs: Vec::new(),
            inputs: Vec::new(),
            camera: None,
            memory_limit: None,
            copy: false,
            outputs: Outputs::ALL,
            robust: true,
            isa: None,
            to_render: true,
        }
    }
}
