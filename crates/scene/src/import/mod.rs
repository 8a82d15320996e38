//! Meshes from other programs: glTF 2.0, Wavefront OBJ and PLY.
//!
//! All three give the same [`Import`]: meshes in their own frames, where each of them stands,
//! materials, textures (still encoded) and cameras. What the plan does not want is not read:
//! a depth map costs no texture and no normal.
//!
//! Vertices and indices of a glTF or binary PLY file stay in the mapped file wherever their layout
//! is one that a ray tracer takes ([`Stats::bytes_copied`] counts what had to be converted).
//!
//! Nothing is guessed silently: what a file asks for and is not done, and what is dropped, becomes
//! a [`Note`]; under [`Strictness::Strict`] defects of the data are errors instead.

mod admit;
mod deformer;
mod error;
mod files;
mod gltf;
mod imported;
mod obj;
mod options;
mod ply;
mod polygon;
mod precision;
mod text;

use std::path::Path;

use etendue_report::Refusal;
use files::Files;

pub(crate) use admit::count_degenerate;
pub use deformer::Deformer;
pub(crate) use deformer::NoSteps;
pub use error::{Note, NoteKind};
pub use imported::{
    CameraProjection, Import, ImportedCamera, ImportedLight, ImportedPlacement, Stats,
};
pub use options::{Options, Play, Strictness, Wanted};

/// Reads the model at `path`; its ending tells the format: `gltf`, `glb`, `obj` or `ply`.
///
/// # Errors
///
/// When the file, or one that it names, cannot be read, is damaged, leaves [`Options::root`], or
/// needs an extension that is not supported; under [`Strictness::Strict`] also for defective data.
pub fn import(path: &Path, wanted: Wanted, options: &Options) -> Result<Import, Refusal> {
    let files = Files::of_model(path, options)?;
    let extension =
        path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let mut import = match extension.as_str() {
        "gltf" | "glb" => gltf::import(path, &files, wanted, options),
        "obj" => obj::import(path, &files, wanted, options),
        "ply" => ply::import(path, &files, wanted, options),

        _ => Err({
            let why = "not a format that can be read\nhint: use .gltf, .glb, .obj or .ply";
            Refusal::new(why).at(path.display())
        }),
    }?;
    import.stats.files = files.opened();
    Ok(import)
}
