//! Cache kept from one load of a scene to the next, so that a change costs no more than it touches.

use std::collections::{BTreeMap, HashMap};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use etendue_camera::Camera;
use etendue_files::Stamp;
use etendue_geometry::{Geometry, Mesh};
use etendue_tracer::Material;
use xxhash_rust::xxh3::Xxh3Default;

use crate::SceneError;
use crate::cameras::CameraOrigin;
use crate::import::{Import, ImportedPlacement, Play, Stats, Strictness, Wanted};

/// Models, cameras and fingerprints of files that loads of one scene share, and the models that are in
/// no file. What a load does not use any more is dropped at its end, and a file that has changed
/// meanwhile is read again.
#[derive(Debug, Default)]
pub struct Cache {
    given: BTreeMap<String, GivenModel>,
    kept: Mutex<Vec<KeptModel>>,
    camera: Mutex<Option<KeptCamera>>,
    digests: Arc<Digests>,
}

/// A model that is in no file.
#[derive(Debug, Clone)]
struct GivenModel {
    import: Import,
    digest: u128,
}

/// Source of a model.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum ModelOrigin {
    /// A file, by its path.
    File(PathBuf),
    /// A shape, by its JSON.
    Shape(String),
}

/// Settings by which a model was read.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ImportManner {
    pub(crate) wanted: Wanted,
    pub(crate) strictness: Strictness,
    pub(crate) root: Option<PathBuf>,
    /// The moment of its animation.
    pub(crate) play: Option<Play>,
}

#[derive(Debug)]
struct KeptModel {
    origin: ModelOrigin,
    manner: ImportManner,
    import: Arc<Import>,
    /// Its files as they were.
    files: Vec<StampedFile>,
    is_used: bool,
}

/// A camera as it was built over a geometry.
#[derive(Debug, Clone)]
pub(crate) struct KeptCamera {
    /// All that the scene says of it.
    pub(crate) words: String,
    pub(crate) geometry: Arc<Geometry>,
    pub(crate) camera: Camera,
    pub(crate) origin: CameraOrigin,
    /// The files that it names, as they were.
    pub(crate) files: Vec<StampedFile>,
}

/// A file as it was.
#[derive(Debug, Clone)]
pub(crate) struct StampedFile {
    pub(crate) path: PathBuf,
    stamp: Stamp,
}

/// The files that are there, as they are.
pub(crate) fn stamped<'p>(files: impl IntoIterator<Item = &'p PathBuf>) -> Vec<StampedFile> {
    let stamped =
        |path: &PathBuf| Some(StampedFile { path: path.clone(), stamp: Stamp::of(path)? });
    files.into_iter().filter_map(stamped).collect()
}

/// Tests whether all files are as they were.
pub(crate) fn are_current(files: &[StampedFile]) -> bool {
    files.iter().all(|file| Stamp::of(&file.path) == Some(file.stamp))
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Cache {
    /// Adds a model of one mesh that is in no file, or replaces it. An object whose `file` is `name` is
    /// made of it.
    pub fn insert_mesh(&mut self, name: &str, mesh: Mesh) {
        let digest = digest_of(&mesh);
        let stats = Stats { bytes_copied: mesh.heap_bytes() as u64, ..Stats::default() };
        let import = Import {
            placements: vec![ImportedPlacement::whole(0)],
            meshes: vec![mesh],
            materials: vec![Material::unnamed()],
            stats,
            ..Import::default()
        };
        self.given.insert(name.to_owned(), GivenModel { import, digest });
    }

    /// Names and meshes of the models in no file.
    pub fn meshes(&self) -> impl Iterator<Item = (&str, &Mesh)> {
        self.given.iter().map(|(name, given)| (name.as_str(), &given.import.meshes[0]))
    }

    /// The model in no file that is called so.
    pub(crate) fn given(&self, name: &str) -> Option<&Import> {
        self.given.get(name).map(|given| &given.import)
    }

    /// Names and fingerprints of the models in no file.
    pub(crate) fn digests_of_given(&self) -> impl Iterator<Item = (String, u128)> + '_ {
        self.given.iter().map(|(name, given)| (name.clone(), given.digest))
    }

    /// The fingerprints of files.
    pub(crate) fn digests(&self) -> Arc<Digests> {
        Arc::clone(&self.digests)
    }

    /// The model, where it was read in this manner and its files have not changed since.
    pub(crate) fn model(&self, origin: &ModelOrigin, manner: &ImportManner) -> Option<Arc<Import>> {
        let mut kept = locked(&self.kept);
        let known = kept.iter_mut().find(|k| k.origin == *origin && k.manner == *manner)?;
        if !are_current(&known.files) {
            return None;
        }
        known.is_used = true;
        Some(Arc::clone(&known.import))
    }

    /// Keeps a model. Corners and triangles that are the same as before, when less or more was read of
    /// the file, are in memory once.
    pub(crate) fn keep(&self, origin: ModelOrigin, manner: ImportManner, import: &mut Import) {
        let mut kept = locked(&self.kept);
        kept.retain(|k| !(k.origin == origin && k.manner == manner));
        for other in kept.iter().filter(|k| k.origin == origin) {
            for (mesh, old) in import.meshes.iter_mut().zip(&other.import.meshes) {
                mesh.share_surface(old);
            }
        }
        let files = stamped(import.stats.files.iter().map(|(path, _)| path));
        kept.push(KeptModel {
            origin,
            manner,
            import: Arc::new(import.clone()),
            files,
            is_used: true,
        });
    }

    /// Drops the models whose origin the last load did not use.
    pub(crate) fn sweep(&self) {
        let mut kept = locked(&self.kept);
        let used: Vec<ModelOrigin> =
            kept.iter().filter(|k| k.is_used).map(|k| k.origin.clone()).collect();
        // Moments of an animation are as many as there are frames.
        let stays = |k: &KeptModel| k.manner.play.is_none() && used.contains(&k.origin);
        kept.retain(|k| k.is_used || stays(k));
        kept.iter_mut().for_each(|k| k.is_used = false);
    }

    /// The last camera, where the scene says the same of it and its files have not changed.
    pub(crate) fn camera(&self, words: &str) -> Option<KeptCamera> {
        let known = locked(&self.camera).clone()?;
        (known.words == words && are_current(&known.files)).then_some(known)
    }

    pub(crate) fn keep_camera(&self, camera: KeptCamera) {
        *locked(&self.camera) = Some(camera);
    }
}

/// The fingerprint of a mesh' corners, triangles and what is known at the corners.
fn digest_of(mesh: &Mesh) -> u128 {
    let mut hash = Xxh3Default::new();
    for i in 0..mesh.positions.len() {
        let corner = mesh.positions.get(i).to_array();
        corner.iter().for_each(|value| hash.update(&value.to_le_bytes()));
    }
    for corner in mesh.triangles.iter().flatten() {
        hash.update(&corner.to_le_bytes());
    }
    let normals = mesh.normals.iter().flat_map(|n| (0..n.len()).flat_map(|i| n.get(i)));
    let uvs = mesh.uvs.iter().flat_map(|u| (0..u.len()).flat_map(|i| u.get(i)));
    let colors = mesh.colors.iter().flat_map(|c| (0..c.len()).flat_map(|i| c.get(i)));
    let tangents = mesh.tangents.iter().map(|tangents| &tangents.corners);
    let tangents = tangents.flat_map(|t| (0..t.len()).flat_map(|i| t.get(i)));
    for value in normals.chain(uvs).chain(colors).chain(tangents) {
        hash.update(&value.to_le_bytes());
    }
    hash.digest128()
}

/// Fingerprints of files' contents, each worked out once until the file changes.
#[derive(Debug, Default)]
pub(crate) struct Digests(Mutex<HashMap<PathBuf, (Stamp, u128)>>);

impl Digests {
    /// XXH3-128 of the contents of the file at `path`.
    pub(crate) fn of(&self, path: &Path) -> Result<u128, SceneError> {
        let unreadable = |source| SceneError::unreadable(path, &source);
        let stamp = Stamp::from(&path.metadata().map_err(unreadable)?);
        if let Some((_, digest)) = locked(&self.0).get(path).filter(|(known, _)| *known == stamp) {
            return Ok(*digest);
        }
        let digest = read_through(path).map_err(unreadable)?;
        locked(&self.0).insert(path.to_owned(), (stamp, digest));
        Ok(digest)
    }
}

/// XXH3-128 of a file, piece by piece: a file that another program cuts meanwhile is none that may be
/// mapped for it.
fn read_through(path: &Path) -> io::Result<u128> {
    let mut file = etendue_files::open(path)?;
    let mut hash = Xxh3Default::new();
    let mut piece = vec![0; 1 << 20];
    loop {
        match file.read(&mut piece) {
            Ok(0) => return Ok(hash.digest128()),
            Ok(length) => hash.update(&piece[..length]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}
