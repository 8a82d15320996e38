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
//!
//! Whether f32 is enough for coordinates that a file gives in more digits.

mod admit;
mod deformer;
mod error;
mod files;
mod gltf;
mod obj;
mod ply;
mod polygon;
mod text;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;

use crate::memory::Budget;
use crate::sniff::what_it_is;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Link, Mesh, Motion, Positions, Transform, Vertices};
use etendue_tracer::{Light, LightKind, Material, Texture};
use files::Files;

pub(crate) use admit::count_degenerate;
pub use deformer::Deformer;
pub(crate) use deformer::NoSteps;
use etendue_report::Refusal;

pub use error::{Note, NoteKind};

/// Attributes of a model that the render uses; the rest of the file is left alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Wanted {
    /// Shading normals.
    pub normals: bool,
    /// Texture coordinates.
    pub uvs: bool,
    /// Vertex colours.
    pub colors: bool,
    /// Images of materials. They are located, not decoded.
    pub textures: bool,
    /// Lights, and all that materials say of light.
    pub light: bool,
    /// The images of ambient occlusion.
    pub occlusion: bool,
}

impl Wanted {
    /// Geometry alone.
    pub const NOTHING: Self = Self {
        normals: false,
        uvs: false,
        colors: false,
        textures: false,
        light: false,
        occlusion: false,
    };
    /// All that is understood.
    pub const EVERYTHING: Self = Self {
        normals: true,
        uvs: true,
        colors: true,
        textures: true,
        light: true,
        occlusion: true,
    };
}

/// Treatment of defects in the data, such as a NaN position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Strictness {
    /// The triangle (or value) is dropped and a note counts it.
    #[default]
    Tolerant,
    /// The file is refused.
    Strict,
}

/// Options of an import.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Treatment of defects in the data.
    pub strictness: Strictness,
    /// The folder that the files named inside the model may not leave (after links are followed);
    /// `None` allows any place.
    pub root: Option<PathBuf>,
    /// The account of what the models take; without a limit by default.
    pub budget: Arc<Budget>,
    /// Read files into memory instead of mapping them, so that they may change meanwhile.
    pub copy: bool,
    /// The animation to show a moment of; glTF only. At rest when absent.
    pub animation: Option<Play>,
}

/// A moment of an animation.
#[derive(Debug, Clone, PartialEq)]
pub struct Play {
    /// The animation's name, or its number from 0; the first when absent.
    pub which: Option<String>,
    /// Time of the animation (s): before the first key and after the last, things stand as there.
    pub time: f64,
    /// True if the animation goes on from there: placements then have links.
    pub plays: bool,
}

/// Content of a model file.
#[derive(Debug, Clone, Default)]
pub struct Import {
    /// Each mesh (a glTF primitive, an OBJ group of one material) once.
    pub meshes: Vec<Mesh>,
    /// Deformations of some of the meshes, by their indices, from the moment that is shown on;
    /// nothing where no animation plays.
    pub deformers: BTreeMap<u32, Arc<Deformer>>,
    /// Placements of the meshes.
    pub placements: Vec<ImportedPlacement>,
    /// The materials that placements name.
    pub materials: Vec<Material>,
    /// The images that materials name; empty unless wanted.
    pub textures: Vec<Texture>,
    /// Cameras of the default scene, in the order of their nodes.
    pub cameras: Vec<ImportedCamera>,
    /// Lights of the default scene, in the order of their nodes; empty unless wanted.
    pub lights: Vec<ImportedLight>,
    /// Notes on what was dropped, ignored or missing.
    pub notes: Vec<Note>,
    /// Statistics of reading.
    pub stats: Stats,
}

/// One mesh at one place.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedPlacement {
    /// Index into [`Import::meshes`].
    pub mesh: u32,
    /// Index into [`Import::materials`].
    pub material: u32,
    /// From the mesh's frame to the model's (m).
    pub model_from_mesh: Transform,
    /// The node's or group's name; may be empty.
    pub name: String,
    /// Index of the node or group of the file.
    pub node: u32,
    /// Index of the copy, of a node that names many places for its mesh
    /// (`EXT_mesh_gpu_instancing`).
    pub instance: Option<u32>,
    /// Motion from the mesh's frame to the model's, the outermost frame first, in s from the moment
    /// that is shown; empty where it stands still.
    pub links: Vec<Link>,
}

impl ImportedPlacement {
    /// A mesh without a name where it is, of the first material.
    pub(crate) fn whole(mesh: u32) -> Self {
        Self {
            mesh,
            material: 0,
            model_from_mesh: Transform::IDENTITY,
            name: String::new(),
            node: 0,
            instance: None,
            links: Vec::new(),
        }
    }
}

/// A light of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedLight {
    /// The light in its node's frame: at the origin, shining along −Z.
    pub light: Light,
    /// From the node's frame to the model's (m).
    pub model_from_light: Transform,
    /// Motion from the node's frame to the model's, the outermost frame first, in s from the moment
    /// that is shown; empty where it stands still.
    pub links: Vec<Link>,
}

impl ImportedLight {
    /// The light in the world of a model placed by `world_from_model`, or that moves as `motion` says; `None` where that
    /// leaves it no direction.
    pub(crate) fn placed(
        &self,
        world_from_model: &Transform,
        motion: Option<&Motion>,
    ) -> Option<Light> {
        if motion.is_some() || !self.links.is_empty() {
            let still = Motion::default().then_inner(world_from_model);
            let motion = motion.unwrap_or(&still);
            let motion = match self.links.is_empty() {
                true => motion.then_inner(&self.model_from_light),
                false => motion.then_links(&self.links),
            };
            return Some(Light { motion: Some(Arc::new(motion)), ..self.light.clone() });
        }
        let world = world_from_model.then_inner(&self.model_from_light);
        let at = world.translation + world.translation_low;
        let along = || (-world.linear.z_axis).try_normalize();
        let kind = match self.light.kind.clone() {
            LightKind::Point(_) => LightKind::Point(at),
            LightKind::Spot { cos_outer, cos_inner, .. } => {
                LightKind::Spot { at, axis: along()?, cos_outer, cos_inner }
            }
            LightKind::Directional { cos_radius, visible, .. } => {
                LightKind::Directional { along: along()?, cos_radius, visible }
            }
            kind @ (LightKind::Projector(_)
            | LightKind::Goniometric(_)
            | LightKind::Environment { .. }) => kind,
        };
        Some(Light { kind, ..self.light.clone() })
    }
}

/// A camera of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedCamera {
    /// The node's name, else the camera's; may be empty.
    pub name: String,
    /// From the camera's frame (looking along −Z, +Y up) to the model's (m). Its linear part may
    /// hold the scale of the nodes above, which glTF tells readers to leave out of the view.
    pub model_from_camera: Transform,
    /// Projection of the camera.
    pub projection: CameraProjection,
}

/// Projection of a glTF camera. Clip planes are not kept: rays have none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CameraProjection {
    /// A pinhole.
    Perspective {
        /// Full vertical field of view (rad).
        yfov: f64,
        /// Width over height; the image's own when the file has none.
        aspect_ratio: Option<f64>,
    },
    /// Parallel rays.
    Orthographic {
        /// Half the width of the view (m).
        xmag: f64,
        /// Half the height of the view (m).
        ymag: f64,
    },
}

/// Statistics of reading a model.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Stats {
    /// Files that were opened, with their sizes in bytes.
    pub files: Vec<(PathBuf, u64)>,
    /// Bytes of vertices and indices used where they are in the mapped file.
    pub bytes_mapped: u64,
    /// Bytes of vertices and indices converted into memory of their own.
    pub bytes_copied: u64,
    /// Triangles dropped because a corner is not finite.
    pub dropped: u64,
}

/// Refuses a file whose bytes are those of something else than `wanted`.
fn refuse_other_kind(file: &Path, bytes: &[u8], wanted: &str) -> Result<(), Refusal> {
    match what_it_is(bytes) {
        Some(what) => Err(error::damaged(
            file,
            "the file",
            format!("it is {what}, not {wanted}\nhint: name the model itself"),
        )),
        None => Ok(()),
    }
}

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

/// Rounding to f32 may move a vertex by this fraction of the mesh's diagonal; farther, and the
/// mesh keeps f64. Not a setting: it is what f32 rounds the corners of a mesh by that stands at the origin.
const MOST_ROUNDING: f64 = 1e-7;

/// `positions` in f32, or in f64 where rounding would move one too far.
fn precise_enough(positions: &[[f64; 3]]) -> Positions {
    let finite = |p: &&[f64; 3]| p.iter().all(|x| x.is_finite());
    let of_chunk = |chunk: &[[f64; 3]]| {
        let mut bounds = Bounds::EMPTY;
        chunk.iter().filter(finite).for_each(|&p| bounds.include(p.into()));
        bounds
    };
    let bounds =
        positions.par_chunks(1 << 14).map(of_chunk).reduce(|| Bounds::EMPTY, Bounds::union);
    let most = MOST_ROUNDING * bounds.diagonal();
    let moved = |p: &[f64; 3]| {
        let rounded = p.map(|x| f64::from(single(x)));
        DVec3::from(rounded).distance(DVec3::from(*p))
    };
    if positions.par_iter().filter(finite).any(|p| moved(p) > most) {
        return Positions::F64(positions.to_vec().into());
    }
    let mut floats = vec![0.0; positions.len() * 3 + 4];
    floats.par_chunks_exact_mut(3).zip(positions).for_each(|(to, from)| {
        to.copy_from_slice(&from.map(single));
    });
    match Vertices::new(floats.into(), 3, positions.len()) {
        Some(vertices) => Positions::F32(vertices),
        None => Positions::F64(positions.to_vec().into()),
    }
}

/// Rounded to f32; infinite where it is too large.
#[expect(clippy::cast_possible_truncation, reason = "rounding is what it is for")]
fn single(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_from_the_origin_f64_is_kept() {
        let square = |at: f64| {
            vec![[at + 0.1, 0.0, 0.0], [at + 1.1, 0.0, 0.0], [at + 0.1, 1.3, 0.0], [f64::NAN; 3]]
        };
        assert!(matches!(precise_enough(&square(0.0)), Positions::F32(_)));
        assert!(matches!(precise_enough(&square(1e6)), Positions::F64(_)));
        // Whole numbers are exact however far.
        let far = vec![[1e6, 0.0, 0.0], [1e6 + 1.0, 0.0, 0.0], [1e6, 1.0, 0.0]];
        assert!(matches!(precise_enough(&far), Positions::F32(_)));
    }
}
