//! A scene, loaded and validated: all that a render needs.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use crate::SceneError;
use crate::cache::Cache;
use crate::cameras::{CameraOrigin, SceneCamera};
use crate::file::{AccuracySpec, PlanSpec, RenderSpec, ToleranceSpec, TracerSpec};
use crate::identity::{Copies, IdName, Ingredients, SceneHash, SceneNode};
use crate::import::{Note, Strictness};
use crate::memory::Budget;
use etendue_camera::Camera;
use etendue_files::{InputFolder, Opener};
use etendue_geometry::Geometry;
use etendue_optics::glass::AgfCatalogue;
use etendue_sensor::Sensor;
use etendue_tracer::{LayerSpec, Light, Material, Texture};

/// A scene ready to be rendered.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The scene file, or the model that stands for one.
    pub path: PathBuf,
    /// Meshes and where they stand.
    pub geometry: Arc<Geometry>,
    /// Names of the objects; placements point here.
    pub objects: Vec<String>,
    /// The nodes of models, object by object; placements point here.
    pub nodes: Vec<SceneNode>,
    /// The copies of objects, and of nodes that make their own; placements point to single ones.
    pub copies: Vec<Copies>,
    /// Materials; placements point here.
    pub materials: Vec<Material>,
    /// Images that materials use, still encoded; empty unless wanted.
    pub textures: Vec<Texture>,
    /// Lights of the scene and of its models, beside emissive surfaces.
    pub lights: Vec<Light>,
    /// True if the scene names no lights, so that the studio is to light it where its own emitters
    /// and lamps do not, which shows when it is rendered.
    pub studio_if_dark: bool,
    /// Tracer of the picture, when the scene names one.
    pub tracer: Option<TracerSpec>,
    /// The camera.
    pub camera: Camera,
    /// The camera's sensor, of the camera's resolution; `None` when it is ideal: then the picture is
    /// all there is.
    pub sensor: Option<Sensor>,
    /// Origin of the camera.
    pub camera_origin: CameraOrigin,
    /// Cameras that came with the models.
    pub cameras: Vec<SceneCamera>,
    /// The layer that holds the picture, if there is to be one.
    pub picture: Option<LayerSpec>,
    /// The slots of its exposure; 0 where that is in one piece.
    pub slots: usize,
    /// All layers to render, each once: the picture first.
    pub layers: Vec<LayerSpec>,
    /// Settings of the render.
    pub render: RenderSpec,
    /// Settings that override decisions of the plan.
    pub plan: PlanSpec,
    /// Numbers that trade accuracy for speed.
    pub accuracy: AccuracySpec,
    /// Tolerance of the picture's errors; an exact picture when absent.
    pub tolerance: Option<ToleranceSpec>,
    /// Notes on what was dropped, ignored or missing on the way.
    pub notes: Vec<Note>,
    /// Statistics of loading.
    pub stats: LoadStats,
    /// Every file that the scene is made of, whether it was read or only named: the scene file,
    /// models with their buffers and material files, images, lenses, masks and arrays.
    pub inputs: Vec<PathBuf>,
    /// True if models were read into memory.
    pub(crate) is_copy: bool,
    /// Time at which loading began.
    pub(crate) since: SystemTime,
    pub(crate) ingredients: Ingredients,
}

impl Scene {
    /// Placements of meshes that are placed twice or more.
    #[must_use]
    pub fn placed_copies(&self) -> u64 {
        self.geometry.uses().into_iter().filter(|&uses| uses > 1).map(u64::from).sum()
    }

    /// The models that have gone, or were cut, written or replaced since loading began: they are used
    /// where they are mapped, so what was rendered may be of their old or their new contents.
    #[must_use]
    pub fn changed_files(&self) -> Vec<&Path> {
        if self.is_copy {
            return Vec::new();
        }
        let is_changed = |path: &Path, size: u64| match path.metadata() {
            Ok(now) => now.len() != size || now.modified().is_ok_and(|at| at > self.since),
            Err(_) => true,
        };
        let files = self.stats.files.iter();
        files.filter(|(path, size)| is_changed(path, *size)).map(|(path, _)| &**path).collect()
    }

    /// The scene's identity. Reads every file of the scene once more, from the system's cache as a
    /// rule; in later loads with the same [`Cache`] only those that have changed.
    ///
    /// # Errors
    ///
    /// When a file has gone.
    pub fn hash(&self) -> Result<SceneHash, SceneError> {
        // A camera is made of numbers and words only, which always serialise.
        let camera = serde_json::to_string(&self.camera.opencv()).unwrap_or_default();
        self.ingredients.hash(&camera)
    }

    /// The identity of the scene whatever its `render.samples` are.
    ///
    /// # Errors
    ///
    /// As [`Self::hash`].
    pub fn hash_of_any_samples(&self) -> Result<SceneHash, SceneError> {
        let camera = serde_json::to_string(&self.camera.opencv()).unwrap_or_default();
        self.ingredients.hash_of_any_samples(&camera)
    }
}

/// Statistics of loading a scene.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct LoadStats {
    /// Files that were opened, with their sizes in bytes.
    pub files: Vec<(PathBuf, u64)>,
    /// Bytes of vertices and indices used where they are in mapped files.
    pub bytes_mapped: u64,
    /// Bytes of vertices and indices on the heap.
    pub bytes_copied: u64,
    /// Triangles dropped because a corner is not finite.
    pub dropped: u64,
}

/// Options of loading a scene.
#[derive(Clone, Default)]
pub struct LoadOptions<'a> {
    /// Treatment of defects in the data.
    pub strictness: Strictness,
    /// Opens what the scene names, where it may be, and records it.
    pub opener: Opener,
    /// Files that were read for the scene by other means, such as glass catalogues: its hash sees them.
    pub also_read: &'a [PathBuf],
    /// Catalogues of glasses of the user's, looked through before the built-in one, the last first.
    pub glasses: &'a [AgfCatalogue],
    /// A camera of one of the models by name or number, instead of the scene's.
    pub camera: Option<&'a str>,
    /// The most memory that may be taken (bytes); `None` for what the system has free.
    pub memory_limit: Option<u64>,
    /// Speak for the picture and the accelerator as well, so that a render that would not fit is
    /// refused before any work is done.
    pub to_render: bool,
    /// Read models into memory instead of using them where their files are mapped.
    pub copy: bool,
    /// Cache of earlier loads, and of models that are in no file.
    pub cache: Option<&'a Cache>,
    /// Told now and then how far loading is; answering `false` stops it.
    pub progress: Option<&'a (dyn Fn(LoadProgress<'_>) -> bool + Sync)>,
}

impl std::fmt::Debug for LoadOptions<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LoadOptions")
            .field("strictness", &self.strictness)
            .field("opener", &self.opener)
            .field("camera", &self.camera)
            .field("memory_limit", &self.memory_limit)
            .field("to_render", &self.to_render)
            .field("copy", &self.copy)
            .finish_non_exhaustive()
    }
}

/// Context that all steps of loading a scene share.
#[derive(Clone, Copy)]
pub(crate) struct LoadContext<'a> {
    pub(crate) folder: &'a InputFolder,
    pub(crate) options: &'a LoadOptions<'a>,
    pub(crate) budget: &'a Arc<Budget>,
    pub(crate) kept: &'a Cache,
}

/// Progress of loading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LoadProgress<'a> {
    /// The model or shape that is being loaded or has just been; `camera` while one without a pose is placed.
    pub name: &'a str,
    /// Number of models and shapes that are loaded.
    pub done: usize,
    /// Of how many.
    pub total: usize,
}

impl Scene {
    /// The objects by the numbers of `Id.object`.
    #[must_use]
    pub fn object_names(&self) -> Vec<IdName> {
        named(&self.objects)
    }

    /// The copies by the numbers of `Id.instance`: every object has one at least. Of more than 10,000
    /// copies of one thing, the first and the last number are given.
    #[must_use]
    pub fn instance_names(&self) -> Vec<IdName> {
        self.copies.iter().flat_map(Copies::names).collect()
    }

    /// The nodes of models by the numbers of `Id.node`.
    #[must_use]
    pub fn node_names(&self) -> Vec<IdName> {
        let entry = |(id, node): (u32, &SceneNode)| IdName {
            id,
            last: None,
            name: node.name.clone(),
            object: Some(node.object + 1),
        };
        (1..).zip(&self.nodes).map(entry).collect()
    }

    /// The materials by the numbers of `MaterialId.X`.
    #[must_use]
    pub fn material_names(&self) -> Vec<IdName> {
        named(self.materials.iter().map(|material| &material.name))
    }
}

fn named<'a>(names: impl IntoIterator<Item = &'a String>) -> Vec<IdName> {
    let entry =
        |(id, name): (u32, &String)| IdName { id, last: None, name: name.clone(), object: None };
    (1..).zip(names).map(entry).collect()
}
