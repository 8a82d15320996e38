//! Files beside the models that nothing names.
//!
//! Lights that glTF files bring along.
//!
//! Triangles that a mesh has twice.
//!
//! How exactly places of a scene can be told, before anything is rendered.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use aho_corasick::AhoCorasick;
use rayon::prelude::*;
use serde::Serialize;
use serde_json::Value;

use etendue_files::MappedFile;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Geometry, Mesh, Positions};

/// Endings of files that only make sense when something names them.
const SERVANTS: [&str; 10] =
    ["bin", "mtl", "png", "jpg", "jpeg", "ktx2", "webp", "bmp", "tga", "tif"];

/// A blank in a name, as itself and as URIs and shells write it.
const BLANKS: [&str; 3] = [" ", "%20", "\\ "];

/// Endings of files that name others.
const MASTERS: [&str; 5] = ["gltf", "glb", "obj", "mtl", "json"];

/// The most entries of a folder that are looked at.
const MOST_ENTRIES: usize = 10_000;

/// The most bytes of a file that are looked through for names.
const MOST_TEXT: usize = 16 << 20;

/// The most bytes of an OBJ file that are looked through: it names its libraries before its faces.
const OBJ_HEAD: usize = 1 << 16;

/// The most bytes that are looked through in a folder.
const MOST_IN_ALL: usize = 256 << 20;

/// Images, buffers and material files in the folders of `opened` whose name stands in no glTF, OBJ,
/// MTL or scene file of the same folder, nor in the scene at `scene`. Sorted.
///
/// The rule is narrow on purpose: names are looked for as text, so a file is listed only when
/// nothing there can mean it. Of a folder where too much is to be looked through none is listed. Of
/// OBJ files the head is looked at.
pub(super) fn find_leftovers(opened: &[&Path], scene: &Path) -> Vec<PathBuf> {
    let folder_of = |path: &&'_ Path| match path.parent() {
        Some(folder) if folder.as_os_str().is_empty() => Some(PathBuf::from(".")),
        folder => Some(folder?.to_owned()),
    };
    let folders: BTreeSet<PathBuf> = opened.iter().filter_map(folder_of).collect();
    let found = folders.iter().filter_map(|folder| unused_in(folder, scene));
    let mut unused: Vec<PathBuf> = found.flatten().collect();
    unused.sort();
    unused
}

/// The unused files of one folder; `None` where it cannot be told.
fn unused_in(folder: &Path, scene: &Path) -> Option<Vec<PathBuf>> {
    let files = files_in(folder)?;
    let candidates: Vec<&PathBuf> =
        files.iter().filter(|path| has_ending(path, &SERVANTS)).collect();
    if candidates.is_empty() {
        return Some(Vec::new());
    }
    // Each name as it is, and with its blanks as URIs and shells write them.
    let spellings: Vec<String> = candidates
        .iter()
        .map(|path| path.file_name().unwrap_or_default().to_string_lossy())
        .flat_map(|name| BLANKS.map(|blank| name.replace(' ', blank)))
        .collect();
    let names = AhoCorasick::new(&spellings).ok()?;
    let mut is_named = vec![false; candidates.len()];
    let mut looked_through = 0;
    let masters = files.iter().filter(|path| has_ending(path, &MASTERS));
    for master in masters.map(PathBuf::as_path).chain([scene]) {
        let Ok(file) = MappedFile::open(master) else { continue };
        let text = naming_part(file.bytes());
        let text = match has_ending(master, &["obj"]) {
            true => &text[..text.len().min(OBJ_HEAD)],
            false => text,
        };
        looked_through += text.len();
        if text.len() > MOST_TEXT || looked_through > MOST_IN_ALL {
            return None;
        }
        for found in names.find_overlapping_iter(text) {
            let candidate = found.pattern().as_usize() / BLANKS.len();
            is_named[candidate] |= candidates[candidate] != master;
        }
    }
    let unnamed = candidates.into_iter().zip(is_named).filter(|(_, is_named)| !is_named);
    Some(unnamed.map(|(path, _)| path.clone()).collect())
}

/// The regular files of a folder; `None` when it has too many entries or cannot be read.
fn files_in(folder: &Path) -> Option<Vec<PathBuf>> {
    let entries: Vec<_> = fs::read_dir(folder).ok()?.take(MOST_ENTRIES + 1).collect();
    if entries.len() > MOST_ENTRIES {
        return None;
    }
    let paths = entries.into_iter().filter_map(|entry| Some(entry.ok()?.path()));
    Some(paths.filter(|path| path.is_file()).collect())
}

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    endings.iter().any(|known| ending.eq_ignore_ascii_case(known))
}

/// The part of a file that may name others: of a GLB its JSON chunk.
pub(super) fn naming_part(bytes: &[u8]) -> &[u8] {
    match bytes.strip_prefix(b"glTF") {
        Some(_) => {
            let length = bytes.get(12..16).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
            let end = length.and_then(|length| 20_usize.checked_add(length as usize));
            end.and_then(|end| bytes.get(20..end)).unwrap_or_default()
        }
        None => bytes,
    }
}

/// Number of nodes of the glTF file at `path` that carry a light (`KHR_lights_punctual`); 0 for any other file.
pub(super) fn count_lights(path: &Path) -> u64 {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    if !["gltf", "glb"].iter().any(|known| ending.eq_ignore_ascii_case(known)) {
        return 0;
    }
    let Ok(file) = MappedFile::open(path) else { return 0 };
    let Ok(document) = serde_json::from_slice::<Value>(naming_part(file.bytes())) else { return 0 };
    let nodes = document.get("nodes").and_then(Value::as_array);
    let has_light = |node: &&Value| node.pointer("/extensions/KHR_lights_punctual/light").is_some();
    nodes.into_iter().flatten().filter(has_light).count() as u64
}

/// Number of triangles of `mesh` that have the same three corners, in any order, as an earlier one.
/// Corners are the same when their coordinates are, whatever their indices.
pub(super) fn count_duplicates(mesh: &Mesh) -> u64 {
    let same_as = representatives(&mesh.positions);
    let mut triangles: Vec<[u32; 3]> = mesh
        .triangles
        .par_iter()
        .map(|triangle| {
            let mut corners = triangle.map(|corner| same_as[corner as usize]);
            corners.sort_unstable();
            corners
        })
        .collect();
    triangles.par_sort_unstable();
    triangles.par_windows(2).filter(|pair| pair[0] == pair[1]).count() as u64
}

/// For each vertex one that stands for all at its place.
fn representatives(positions: &Positions) -> Vec<u32> {
    // Loaders keep indices in u32, so no mesh has a vertex beyond it that a triangle could use.
    let len = u32::try_from(positions.len()).unwrap_or(u32::MAX);
    // Adding zero turns −0 into 0; NaN vertices, which no triangle uses, have bits like any other.
    let key = |vertex: u32| positions.get(vertex as usize).to_array().map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..len).collect();
    order.par_sort_unstable_by_key(|&vertex| key(vertex));
    let mut same_as = vec![0; len as usize];
    let mut first = 0;
    for (rank, &vertex) in order.iter().enumerate() {
        if rank == 0 || key(order[rank - 1]) != key(vertex) {
            first = vertex;
        }
        same_as[vertex as usize] = first;
    }
    same_as
}

/// Steps between neighbouring numbers at the scene's size and distance (m).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StepSizes {
    /// The largest coordinate in world space (m).
    pub farthest_coordinate: f64,
    /// The step of the coordinates as the files store them, carried into the world (m): finer than
    /// this the input does not say.
    pub input_step: f64,
    /// The step of f32 at the farthest coordinate (m): what a renderer loses that traces world
    /// coordinates in f32.
    pub f32_step_in_world: f64,
    /// The step of f32 at half the scene's size (m): with this the triangle is found, relative to
    /// the scene's centre.
    pub f32_step_from_centre: f64,
    /// The step of f64 at the farthest coordinate (m): with this the hit is measured.
    pub f64_step: f64,
}

impl StepSizes {
    /// The forecast; `None` for a scene without triangles.
    pub(super) fn of(geometry: &Geometry, bounds: Bounds) -> Option<Self> {
        if bounds.is_empty() {
            return None;
        }
        let farthest = largest(bounds.min).max(largest(bounds.max));
        Some(Self {
            farthest_coordinate: farthest,
            input_step: input_step(geometry),
            f32_step_in_world: step(farthest, f32::EPSILON.into()),
            f32_step_from_centre: step(largest(bounds.max - bounds.centre()), f32::EPSILON.into()),
            f64_step: step(farthest, f64::EPSILON),
        })
    }
}

fn largest(v: DVec3) -> f64 {
    v.abs().max_element()
}

/// The step between neighbouring numbers at `value`, for numbers of this relative step.
fn step(value: f64, epsilon: f64) -> f64 {
    if value > 0.0 && value.is_finite() { value.log2().floor().exp2() * epsilon } else { 0.0 }
}

/// The largest step of a stored coordinate, scaled as its placement does.
fn input_step(geometry: &Geometry) -> f64 {
    let steps = geometry.placements.iter().map(|placement| {
        let mesh = geometry.mesh_of(placement);
        if mesh.bounds.is_empty() || !geometry.has_area(placement) {
            return 0.0;
        }
        let epsilon = match mesh.positions {
            Positions::F32(_) => f64::from(f32::EPSILON),
            Positions::F64(_) => f64::EPSILON,
        };
        let local = largest(mesh.bounds.min).max(largest(mesh.bounds.max));
        let linear = placement.world_from_mesh.linear;
        let scale = [linear.x_axis, linear.y_axis, linear.z_axis]
            .iter()
            .fold(0.0, |most: f64, axis| most.max(axis.length()));
        step(local, epsilon) * scale
    });
    steps.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use etendue_geometry::glam::DMat3;
    use etendue_geometry::{Mesh, Transform, Vertices};

    #[test]
    fn only_what_nothing_names_is_listed() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &[u8]| {
            let path = folder.path().join(name);
            fs::write(&path, text).unwrap();
            path
        };
        let model = write("a.obj", b"mtllib a.mtl\n");
        write("a.mtl", b"map_Kd wood grain.png\n");
        write("wood grain.png", b"");
        let stray = write("old.png", b"");
        let lonely = write("b.mtl", b"map_Kd old%20.png\n");
        write("notes.txt", b"");
        write("c.gltf", b"{\"images\": [{\"uri\": \"tall%20grass.jpg\"}]}");
        write("tall grass.jpg", b"");
        assert_eq!(find_leftovers(&[&model], Path::new("none")), [lonely, stray]);
    }

    #[test]
    fn only_the_heads_of_large_files_are_looked_through() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::write(path("old.png"), b"").unwrap();
        // Gigabytes that take no room: reading them would take minutes.
        let obj = path("a.obj");
        fs::write(&obj, b"mtllib a.mtl\n").unwrap();
        fs::File::options().write(true).open(&obj).unwrap().set_len(1 << 36).unwrap();
        assert_eq!(find_leftovers(&[&obj], Path::new("none")), [path("old.png")]);
        // What is too large and names files anywhere leaves it open.
        fs::File::create(path("b.gltf")).unwrap().set_len(1 << 36).unwrap();
        assert_eq!(find_leftovers(&[&obj], Path::new("none")), [] as [PathBuf; 0]);
    }

    #[test]
    fn a_glb_names_files_in_its_json_only() {
        let mut glb = b"glTF\x02\0\0\0\0\0\0\0\x04\0\0\0JSON{ab}rest".to_vec();
        assert_eq!(naming_part(&glb), b"{ab}");
        glb.truncate(18);
        assert!(naming_part(&glb).is_empty());
        assert_eq!(naming_part(b"plain"), b"plain");
    }

    #[test]
    fn the_same_corners_by_any_index_in_any_order() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.0, 0.0, 0.0]];
        let count_of = |triangles: Vec<[u32; 3]>| {
            let positions = Positions::F32(Vertices::from_arrays(&corners));
            count_duplicates(&Mesh::new("", positions, triangles.into()))
        };
        assert_eq!(count_of(vec![[0, 1, 2]]), 0);
        assert_eq!(count_of(vec![[0, 1, 2], [2, 1, 0], [1, 2, 3]]), 2);
        assert_eq!(count_of(vec![[0, 1, 2], [0, 1, 1]]), 0);
        assert_eq!(count_of(Vec::new()), 0);
    }

    #[test]
    fn steps_are_those_of_the_number_formats() {
        assert_eq!(step(1.0, f32::EPSILON.into()), f64::from(f32::EPSILON));
        assert_eq!(step(1e7, f32::EPSILON.into()), 1.0, "above 2²³ f32 has whole numbers only");
        assert_eq!(step(0.0, 1.0), 0.0);
    }

    #[test]
    fn a_scene_far_away_is_found_from_its_centre() {
        let corners = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
        let positions = Positions::F32(Vertices::from_arrays(&corners));
        let mesh = Mesh::new("", positions, vec![[0, 1, 2]].into());
        let geometry =
            Geometry::alone(mesh, Transform::new(DMat3::IDENTITY * 0.5, DVec3::splat(1e7)));
        let forecast = StepSizes::of(&geometry, geometry.bounds()).unwrap();
        assert_eq!(forecast.f32_step_in_world, 1.0);
        assert_eq!(forecast.f32_step_from_centre, 0.5 * f64::from(f32::EPSILON));
        assert_eq!(forecast.input_step, f64::from(f32::EPSILON), "2 m stored, halved on placing");
        assert!(StepSizes::of(&Geometry::default(), Bounds::EMPTY).is_none());
    }
}
