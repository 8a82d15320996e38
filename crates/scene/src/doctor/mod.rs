//! The scene doctor: what a scene or model holds, what is wrong with it, what it will cost; without
//! rendering.

mod checks;
pub(crate) mod memory;
mod text;

use std::path::{Path, PathBuf};

use etendue_camera::CameraFile;
use etendue_geometry::{Coplanar, CoplanarPair, Geometry};
use serde::Serialize;

use crate::import::{NoteKind, Wanted};
use crate::world_vertices::tight;
use crate::{
    CameraOrigin, FileKind, IdName, LoadOptions, Note, Scene, SceneError, SceneFile, Setting,
};

pub use checks::StepSizes;
pub use memory::MemoryForecast;

/// Findings of `etendue check` on a scene or model. Serialises to what `--json` prints.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// The file.
    pub file: PathBuf,
    /// Triangles, counted as often as they are placed.
    pub triangles: u64,
    /// Triangles, each stored one once.
    pub triangles_unique: u64,
    /// Meshes, each once.
    pub meshes: usize,
    /// Meshes, as often as they are placed.
    pub placements: usize,
    /// The tight box around everything in world space (m); null when there is no triangle.
    pub bounds: Option<BoxExtent>,
    /// Judgement of whether the size looks like metres, and the remedy.
    pub units: Units,
    /// The objects, by the numbers of `Id.object`.
    pub objects: Vec<ObjectReport>,
    /// The copies of objects, by the numbers of `Id.instance`.
    pub instances: Vec<IdName>,
    /// The nodes of models, by the numbers of `Id.node`.
    pub nodes: Vec<IdName>,
    /// Triangles that are no good.
    pub defects: Defects,
    /// Precision of places.
    pub precision: Option<StepSizes>,
    /// The camera that a render would use, as `camera.json` tells it.
    pub camera: CameraFile,
    /// Origin of that camera, in words.
    pub camera_origin: String,
    /// Cameras that the models bring along; `--camera` takes their name or number.
    pub cameras: Vec<CameraReport>,
    /// Lights that the glTF models bring along (`KHR_lights_punctual`).
    pub lights: u64,
    /// Frames of the scene; null when it is one picture.
    pub frames: Option<usize>,
    /// Forecast of a render's memory.
    pub memory: MemoryForecast,
    /// glTF extensions that are not, or not wholly, supported, and what to do.
    pub extensions: Vec<Finding>,
    /// Files beside the models that no model, material or scene there names: images, buffers and
    /// material files.
    pub unused_files: Vec<PathBuf>,
    /// All else that was dropped, ignored or missing.
    pub findings: Vec<Finding>,
}

/// A box.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BoxExtent {
    /// The lower corner (m).
    pub min: [f64; 3],
    /// The upper corner (m).
    pub max: [f64; 3],
}

/// Judgement of the unit of coordinates.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Units {
    /// True if the longest side is between a millimetre and a kilometre.
    pub plausible: bool,
    /// The assumption, and what to do when it is wrong.
    pub remark: String,
}

/// One object.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ObjectReport {
    /// Its number in `Id.object`, from 1.
    pub id: u32,
    /// Its name.
    pub name: String,
    /// Its triangles, as often as they are placed.
    pub triangles: u64,
}

/// Triangles that are no good.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Defects {
    /// Dropped because a corner is NaN or infinite; under `--strict` the file is refused.
    pub not_finite: u64,
    /// Without area, each stored one once. Accelerators leave them out; the others keep their
    /// numbers.
    pub degenerate: u64,
    /// Placements that scale their mesh to a line or a point, as files hide objects.
    pub collapsed: u64,
    /// With the same three corners as another one of their mesh.
    pub duplicate: u64,
    /// Pairs of placements of which triangles lie over one another in one plane, facing one side: of them the later
    /// one is seen.
    pub coplanar: u64,
    /// With a corner that does not exist. Always 0: such a file is refused.
    pub out_of_range: u64,
}

/// A camera of a model.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct CameraReport {
    /// The number that `--camera` takes.
    pub index: usize,
    /// Its name; may be empty.
    pub name: String,
    /// `pinhole` or `orthographic`.
    #[serde(rename = "type")]
    pub kind: &'static str,
}

/// Something to know about.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Kind of thing.
    pub kind: NoteKind,
    /// Its subject.
    pub subject: String,
    /// Sentence on what happens, and what to do.
    pub message: String,
    /// Number of times.
    pub count: u64,
}

impl From<&Note> for Finding {
    fn from(note: &Note) -> Self {
        let Note { kind, subject, message, count } = note.clone();
        Self { kind, subject, message, count }
    }
}

/// Examines the scene or model at `path` as a render with the same `overrides` and `options` would
/// load it.
///
/// # Errors
///
/// When it cannot be loaded.
pub fn check(
    path: &Path,
    overrides: &[Setting],
    options: &LoadOptions<'_>,
) -> Result<Diagnosis, SceneError> {
    let file = SceneFile::read_with(&options.opener, path, overrides)?;
    let scene = file.load(Wanted::EVERYTHING, options)?;
    Ok(Diagnosis::of(&scene, file.kind()))
}

impl Diagnosis {
    /// Collects what there is to tell of a scene that was loaded with [`Wanted::EVERYTHING`] from a
    /// file of this kind. Its forecast of memory is [`MemoryForecast::of`], and its frames are not
    /// counted.
    #[must_use]
    pub fn of(scene: &Scene, kind: FileKind) -> Self {
        let geometry = &*scene.geometry;
        let bounds = tight(geometry.into());
        let coplanar = Coplanar::of(geometry).pairs(geometry);
        let is_extension = |note: &&Note| note.kind == NoteKind::Extension;
        let models: Vec<&Path> = scene.stats.files.iter().map(|(path, _)| path.as_path()).collect();
        Self {
            file: scene.path.clone(),
            triangles: geometry.triangles(),
            triangles_unique: geometry.triangles_unique(),
            meshes: geometry.meshes.len(),
            placements: geometry.placements.len(),
            bounds: (!bounds.is_empty())
                .then(|| BoxExtent { min: bounds.min.to_array(), max: bounds.max.to_array() }),
            units: units(&bounds, kind, &scene.path),
            objects: objects(scene),
            instances: scene.instance_names(),
            nodes: scene.node_names(),
            defects: Defects {
                not_finite: scene.stats.dropped,
                degenerate: geometry.meshes.iter().map(|mesh| mesh.degenerate).sum(),
                collapsed: geometry.placements.iter().filter(|p| !p.has_extent()).count() as u64,
                duplicate: geometry.meshes.iter().map(checks::count_duplicates).sum(),
                coplanar: coplanar.len() as u64,
                out_of_range: 0,
            },
            precision: StepSizes::of(geometry, bounds),
            camera: scene.camera.opencv(),
            camera_origin: match &scene.camera_origin {
                CameraOrigin::Scene => "the scene file".to_owned(),
                CameraOrigin::Framed => "placed to show the whole scene".to_owned(),
                CameraOrigin::Model(name) => format!("the model's camera {name}"),
            },
            cameras: cameras(scene),
            lights: models.iter().map(|path| checks::count_lights(path)).sum(),
            frames: None,
            memory: MemoryForecast::of(scene),
            extensions: scene.notes.iter().filter(is_extension).map(Finding::from).collect(),
            unused_files: checks::find_leftovers(&models, &scene.path),
            findings: scene
                .notes
                .iter()
                .filter(|n| !is_extension(n))
                .map(Finding::from)
                .chain(in_one_plane(scene, &coplanar))
                .collect(),
        }
    }
}

/// Findings on what lies in one plane with something else.
fn in_one_plane(scene: &Scene, pairs: &[CoplanarPair]) -> Vec<Finding> {
    /// The most pairs that are named.
    const NAMED: usize = 8;
    let name = |placement: u32| {
        let placement = &scene.geometry.placements[placement as usize];
        let object = scene.objects.get(placement.object as usize);
        let mesh = &scene.geometry.mesh_of(placement).name;
        object.map_or_else(
            || mesh.clone(),
            |name| format!("object {} \"{name}\"", placement.object + 1),
        )
    };
    let finding = |&CoplanarPair { placements: [earlier, later], triangles }: &CoplanarPair| {
        Finding {
        kind: NoteKind::Irregular,
        subject: format!("{} and {}", name(earlier), name(later)),
        message: "lie over one another in one plane; the later one is seen. Move one of them by a millimetre, or leave \
                  out what is hidden"
            .to_owned(),
        count: triangles as u64,
    }
    };
    let mut findings: Vec<Finding> = pairs.iter().take(NAMED).map(finding).collect();
    if let Some(more) = pairs.len().checked_sub(NAMED).filter(|more| *more > 0) {
        findings.push(Finding {
            kind: NoteKind::Irregular,
            subject: format!("{more} more pairs"),
            message: "lie over one another in one plane, too".to_owned(),
            count: 1,
        });
    }
    findings
}

fn cameras(scene: &Scene) -> Vec<CameraReport> {
    let report = |(index, camera): (usize, &crate::SceneCamera)| CameraReport {
        index,
        name: camera.name.clone(),
        kind: camera.spec.type_name(),
    };
    scene.cameras.iter().enumerate().map(report).collect()
}

fn objects(scene: &Scene) -> Vec<ObjectReport> {
    let geometry: &Geometry = &scene.geometry;
    let mut triangles = vec![0; scene.objects.len()];
    for placement in &geometry.placements {
        triangles[placement.object as usize] += geometry.mesh_of(placement).triangles.len() as u64;
    }
    let names = scene.object_names().into_iter().zip(triangles);
    let report = |(IdName { id, name, .. }, triangles)| ObjectReport { id, name, triangles };
    names.map(report).collect()
}

/// Scenes between a millimetre and a kilometre are taken to be in metres.
fn units(bounds: &etendue_geometry::Bounds, kind: FileKind, path: &Path) -> Units {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    let assumed = match (kind, &*ending) {
        (FileKind::Model, "obj" | "ply") => "metres are assumed, the format names no unit",
        _ => "metres",
    };
    let longest = if bounds.is_empty() { 1.0 } else { (bounds.max - bounds.min).max_element() };
    let remark = if longest > 1e3 {
        format!(
            "{assumed}; {longest:.4} m is large: if the file is in millimetres, give its object \
             \"transform\": {{\"scale\": 0.001}}"
        )
    } else if longest < 1e-3 {
        format!(
            "{assumed}; {longest:.3e} m is small: if the file is in kilometres, give its object \
             \"transform\": {{\"scale\": 1000}}"
        )
    } else {
        assumed.to_owned()
    };
    Units { plausible: (1e-3..=1e3).contains(&longest), remark }
}
