//! A scene, loaded and validated: all that a render needs.
//!
//! The tight box around a scene, and how far its vertices reach in any direction.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use rayon::prelude::*;

use crate::cache::Cache;
use crate::file::{AccuracySpec, PlanSpec, RenderSpec, ToleranceSpec, TracerSpec};
use crate::identity::{Copies, Ingredients, SceneNode};
use crate::import::{Note, Strictness};
use crate::shape::GoOn;
use crate::{CameraOrigin, SceneCamera, SceneError, SceneHash};
use etendue_camera::{Camera, SupportFunction};
use etendue_files::Opener;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{AreaTest, Bounds, Geometry, Mesh, Placement};
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

/// The tight box around all triangles in world space (m).
///
/// A placement whose loose box (around the eight corners of its mesh's own) lies inside the tight
/// box found so far cannot widen it and is not visited. Those that reach farthest go first, so of a
/// forest of instances only the trees at its edges are looked at.
pub(crate) fn tight(vertices: WorldVertices<'_>) -> Bounds {
    let geometry = vertices.geometry;
    let placements = &geometry.placements;
    let all: Vec<(Bounds, &Placement)> = placements
        .par_iter()
        .map(|placement| (geometry.loose_bounds_of(placement), placement))
        .filter(|(bounds, _)| !bounds.is_empty())
        .collect();
    let mut bounds = Bounds::EMPTY;
    for axis in 0..3 {
        let least = all.iter().min_by(|(a, _), (b, _)| a.min[axis].total_cmp(&b.min[axis]));
        let most = all.iter().max_by(|(a, _), (b, _)| a.max[axis].total_cmp(&b.max[axis]));
        for (_, placement) in least.into_iter().chain(most) {
            bounds = bounds.union(exact(vertices, placement));
        }
    }
    let beyond = |loose: &Bounds, bounds: &Bounds| {
        (bounds.min - loose.min).max_element().max((loose.max - bounds.max).max_element())
    };
    let mut open: Vec<(f64, &Bounds, &Placement)> =
        all.iter().map(|(loose, p)| (beyond(loose, &bounds), loose, *p)).collect();
    open.retain(|(beyond, ..)| *beyond > 0.0);
    open.sort_by(|(a, ..), (b, ..)| b.total_cmp(a));
    for (_, loose, placement) in open {
        if beyond(loose, &bounds) > 0.0 {
            bounds = bounds.union(exact(vertices, placement));
        }
    }
    bounds
}

/// The vertices of all triangles in world space, as a camera that frames them asks.
#[derive(Clone, Copy)]
pub(crate) struct WorldVertices<'a> {
    pub(crate) geometry: &'a Geometry,
    /// Once it says no, what is left is passed over, and what was found means nothing.
    pub(crate) go_on: GoOn<'a>,
}

impl<'a> From<&'a Geometry> for WorldVertices<'a> {
    /// To the end.
    fn from(geometry: &'a Geometry) -> Self {
        Self { geometry, go_on: &|| true }
    }
}

impl SupportFunction for WorldVertices<'_> {
    /// Visits the placements that may reach farthest first, and no other once their boxes do not.
    fn support(&self, origin: DVec3, directions: &[DVec3]) -> Vec<f64> {
        let geometry = self.geometry;
        let mut most = vec![f64::NEG_INFINITY; directions.len()];
        let boxes: Vec<Vec<f64>> = geometry
            .placements
            .par_iter()
            .map(|placement| match geometry.loose_bounds_of(placement) {
                bounds if bounds.is_empty() => Vec::new(),
                bounds => bounds.support(origin, directions),
            })
            .collect();
        let beyond =
            |reach: &[f64], most: &[f64]| reach.iter().zip(most).any(|(reach, most)| reach > most);
        let first = (0..directions.len()).filter_map(|k| {
            let reaches = boxes.iter().enumerate().filter(|(_, reach)| !reach.is_empty());
            reaches.max_by(|(_, a), (_, b)| a[k].total_cmp(&b[k])).map(|(index, _)| index)
        });
        let first: BTreeSet<usize> = first.collect();
        let rest = (0..boxes.len()).filter(|index| !first.contains(index));
        for index in first.iter().copied().chain(rest) {
            if beyond(&boxes[index], &most) {
                let found = farthest(*self, &geometry.placements[index], origin, directions);
                most.iter_mut().zip(found).for_each(|(most, found)| *most = most.max(found));
            }
        }
        most
    }
}

/// The support function of one placement's triangles.
fn farthest(
    vertices: WorldVertices<'_>,
    placement: &Placement,
    origin: DVec3,
    directions: &[DVec3],
) -> Vec<f64> {
    const CHUNK: usize = 1 << 15;
    let mesh = vertices.geometry.mesh_of(placement);
    let none = || vec![f64::NEG_INFINITY; directions.len()];
    let chunks = corners_with_area(mesh, placement, CHUNK, vertices.go_on).map(|corners| {
        let mut most = none();
        for corner in corners {
            let local = mesh.positions.get(corner as usize);
            let point = placement.world_from_mesh.point_from(local, origin);
            for (most, direction) in most.iter_mut().zip(directions) {
                *most = most.max(point.dot(*direction));
            }
        }
        most
    });
    chunks.reduce(none, |mut a, b| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a = a.max(b));
        a
    })
}

/// The corners of the triangles that have an area where the mesh is placed, in chunks of so many triangles.
fn corners_with_area<'a>(
    mesh: &'a Mesh,
    placement: &'a Placement,
    chunk: usize,
    go_on: GoOn<'a>,
) -> impl ParallelIterator<Item = impl Iterator<Item = u32> + 'a> + 'a {
    let test = AreaTest::under(mesh, &placement.world_from_mesh.linear);
    let keeps_all = test.keeps_all();
    mesh.triangles.par_chunks(chunk).enumerate().map(move |(number, triangles)| {
        let kept = if go_on() { triangles } else { &[] }.iter().enumerate();
        let kept = kept.filter(move |(k, _)| keeps_all || test.keeps(number * chunk + k));
        kept.flat_map(|(_, triangle)| *triangle)
    })
}

fn exact(vertices: WorldVertices<'_>, placement: &Placement) -> Bounds {
    const CHUNK: usize = 1 << 16;
    let mesh = vertices.geometry.mesh_of(placement);
    if placement.world_from_mesh.is_identity() {
        return mesh.bounds;
    }
    let boxes = corners_with_area(mesh, placement, CHUNK, vertices.go_on).map(|corners| {
        let mut bounds = Bounds::EMPTY;
        for corner in corners {
            bounds.include(placement.world_from_mesh.point(mesh.positions.get(corner as usize)));
        }
        bounds
    });
    boxes.reduce(Bounds::default, Bounds::union)
}

#[cfg(test)]
mod tests {
    use super::*;
    use etendue_geometry::glam::{DMat3, DQuat};
    use etendue_geometry::{Positions, Transform, Vertices};

    /// Needles along the diagonal, whose own boxes are far from tight once they are turned.
    fn needles(count: u32) -> Geometry {
        let corners = [[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 0.9]];
        let positions = Positions::F32(Vertices::from_arrays(&corners));
        let place = |i: u32| {
            let i = f64::from(i);
            let turned = DMat3::from_quat(DQuat::from_euler(
                etendue_geometry::glam::EulerRot::XYZ,
                0.7 * i,
                1.3 * i,
                2.1 * i,
            ));
            let at = DVec3::new((37.0 * i) % 11.0, (53.0 * i) % 7.0, (71.0 * i) % 5.0);
            Placement::of(0, Transform::new(turned, at))
        };
        Geometry {
            meshes: vec![Mesh::new("", positions, vec![[0, 1, 2]].into())],
            placements: (0..count).map(place).collect(),
        }
    }

    #[test]
    fn support_is_that_of_every_corner() {
        let directions = [DVec3::X, DVec3::new(-0.3, 0.9, 0.4), DVec3::new(0.1, -1.0, 2.0)];
        let geometry = needles(200);
        let origin = DVec3::new(1.0, 2.0, 3.0);
        let mut expected = [f64::NEG_INFINITY; 3];
        for placement in &geometry.placements {
            for corner in geometry.meshes[0].corners(0) {
                let point = placement.world_from_mesh.point(corner) - origin;
                for (most, d) in expected.iter_mut().zip(directions) {
                    *most = most.max(point.dot(d));
                }
            }
        }
        let found = WorldVertices::from(&geometry).support(origin, &directions);
        for (found, expected) in found.iter().zip(expected) {
            // A few roundings of numbers near 10.
            assert!((found - expected).abs() < 1e-13, "{found} {expected}");
        }
        assert_eq!(
            WorldVertices::from(&Geometry::default()).support(origin, &[DVec3::X]),
            [f64::NEG_INFINITY]
        );
    }

    #[test]
    fn passing_over_placements_changes_nothing() {
        for count in [0, 1, 2, 500] {
            let geometry = needles(count);
            assert_eq!(tight((&geometry).into()), geometry.bounds(), "{count} placements");
        }
        let geometry = needles(500);
        let loose = geometry.loose_bounds();
        assert!(
            loose.diagonal() > tight((&geometry).into()).diagonal(),
            "the test can tell them apart"
        );
    }
}
