//! Content of a model: meshes and where they stand, materials, textures, cameras and lights.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use super::deformer::Deformer;
use super::error::Note;
use etendue_geometry::{Link, Mesh, Motion, Transform};
use etendue_tracer::{Light, LightKind, Material, Texture};

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
