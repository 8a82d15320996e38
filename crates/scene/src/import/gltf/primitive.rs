//! Primitives: the meshes of a glTF file, each loaded once and only when the scene shows it.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

use etendue_geometry::{Buffer, Mesh, Positions, Vertices};
use gltf::json;
use json::mesh::{Mode, Primitive, Semantic};
use json::validation::Checked;
use rayon::prelude::*;

use super::chains::Chains;
use super::deform::{PrimitiveCorners, Skin};
use super::hierarchy::{NodeShape, SceneNodes};
use super::part::PrimitiveReader;
use super::reader::GltfReader;
use crate::import::admit::{AdmittedMesh, MeshCandidate, admit, cost};
use crate::import::deformer::Deformer;
use crate::import::error::{self, Note, NoteKind};
use crate::import::{Import, Refusal};

/// A primitive that became a mesh.
pub(super) struct LoadedPrimitive {
    /// Index into the import's meshes.
    pub mesh: u32,
    /// Index into the import's materials.
    pub material: u32,
    /// True if the primitive stands in the model's frame already.
    pub skinned: bool,
}

/// The shapes that a scene shows, each loaded once.
pub(super) struct ShapeSet {
    /// In order.
    shapes: Vec<NodeShape>,
    /// For each the primitives that have triangles.
    primitives: Vec<Vec<LoadedPrimitive>>,
}

impl ShapeSet {
    /// The shapes of `scene`, not loaded yet.
    fn of(scene: &SceneNodes) -> Self {
        let mut shapes: Vec<NodeShape> =
            scene.meshes.iter().map(|mesh| mesh.shape.clone()).collect();
        shapes.sort_unstable();
        shapes.dedup();
        let mut primitives = Vec::new();
        primitives.resize_with(shapes.len(), Vec::new);
        Self { shapes, primitives }
    }

    /// The primitives of `shape` that have triangles.
    pub(super) fn primitives(&self, shape: &NodeShape) -> &[LoadedPrimitive] {
        self.shapes.binary_search(shape).map_or(&[], |found| &self.primitives[found])
    }
}

/// A primitive on its way in.
struct ReadPrimitive {
    skinned: bool,
    admitted: AdmittedMesh,
    deformer: Option<Deformer>,
    copied: u64,
    mapped: u64,
    notes: Vec<Note>,
}

impl ReadPrimitive {
    /// A mesh of nothing, of which there are `notes`.
    fn empty(name: String, notes: Vec<Note>) -> Self {
        let positions = Positions::F32(Vertices::from_arrays(&[]));
        let mesh = Mesh::new(name, positions, Vec::new().into());
        let admitted = AdmittedMesh { mesh, dropped: 0, notes: Vec::new() };
        Self { skinned: false, admitted, deformer: None, copied: 0, mapped: 0, notes }
    }
}

/// Loads the meshes that `scene` shows. Materials are numbered as in the document.
pub(super) fn load(
    reader: &GltfReader<'_>,
    scene: &SceneNodes,
    chains: &Chains<'_>,
    import: &mut Import,
) -> Result<ShapeSet, Refusal> {
    let meshes = &reader.document.root.meshes;
    let mut shown = vec![false; meshes.len()];
    for placed in &scene.meshes {
        let Some(shown) = shown.get_mut(placed.shape.mesh) else {
            let from = format!("nodes[{}].mesh", placed.node);
            return Err(reader.absent(from, "mesh", placed.shape.mesh, meshes.len()));
        };
        *shown = true;
    }
    note_unused(&shown, &mut import.notes);
    let skins = skins(reader, scene, chains)?;
    let mut shapes = ShapeSet::of(scene);
    let wanted: Vec<(usize, usize, &Primitive)> = (shapes.shapes.iter().enumerate())
        .flat_map(|(s, shape)| {
            let primitives = meshes[shape.mesh].primitives.iter().enumerate();
            primitives.map(move |(number, primitive)| (s, number, primitive))
        })
        .collect();
    let read: Vec<_> = wanted
        .par_iter()
        .map(|&(s, number, primitive)| {
            let shape = &shapes.shapes[s];
            let skin = shape.skin.and_then(|skin| skins.get(&skin));
            read(reader, shape, skin, number, primitive)
        })
        .collect();
    // The first that fails is told, however threads run.
    let read = read.into_iter().collect::<Result<Vec<Option<ReadPrimitive>>, _>>()?;
    for ((s, number, primitive), read) in wanted.into_iter().zip(read) {
        let Some(read) = read else {
            note_no_triangles(&mut import.notes);
            continue;
        };
        let place = || place(reader, shapes.shapes[s].mesh, number);
        let material = super::material::number(reader, primitive, place)?;
        let skinned = read.skinned;
        let mesh = take(read, import, reader)?;
        shapes.primitives[s].push(LoadedPrimitive { mesh, material, skinned });
    }
    Ok(shapes)
}

/// The skins that nodes of `scene` wear.
fn skins(
    reader: &GltfReader<'_>,
    scene: &SceneNodes,
    chains: &Chains<'_>,
) -> Result<BTreeMap<usize, Skin>, Refusal> {
    let mut skins = BTreeMap::new();
    for placed in &scene.meshes {
        if let Some(index) = placed.shape.skin
            && let Entry::Vacant(entry) = skins.entry(index)
        {
            entry.insert(Skin::read(reader, index, placed.node, &scene.pose, chains)?);
        }
    }
    Ok(skins)
}

/// Adds a mesh to `import`; its index.
fn take(read: ReadPrimitive, import: &mut Import, reader: &GltfReader<'_>) -> Result<u32, Refusal> {
    let index = u32::try_from(import.meshes.len())
        .map_err(|_| reader.damaged("meshes", "there are more than 32 bits can count"))?;
    import.stats.bytes_copied += read.copied;
    import.stats.bytes_mapped += read.mapped;
    import.stats.dropped += read.admitted.dropped;
    for note in read.notes.into_iter().chain(read.admitted.notes) {
        error::push(&mut import.notes, note);
    }
    import.deformers.extend(read.deformer.map(|deformer| (index, Arc::new(deformer))));
    import.meshes.push(read.admitted.mesh);
    Ok(index)
}

fn note_unused(shown: &[bool], notes: &mut Vec<Note>) {
    let unused = shown.iter().filter(|&&shown| !shown).count() as u64;
    if unused > 0 {
        let message = "meshes that no node of the default scene shows are not read";
        error::push(notes, Note::new(NoteKind::Unused, "meshes", message).counted(unused));
    }
}

fn note_no_triangles(notes: &mut Vec<Note>) {
    let message = "points and lines have no surface and are left out";
    error::push(notes, Note::new(NoteKind::Unsupported, "primitives", message));
}

/// Name of a primitive in messages.
fn place(reader: &GltfReader<'_>, mesh: usize, number: usize) -> String {
    let name = reader.document.root.meshes[mesh].name.as_deref().unwrap_or_default();
    if name.is_empty() {
        format!("meshes[{mesh}].primitives[{number}]")
    } else {
        format!("meshes[{mesh}].primitives[{number}] (\"{name}\")")
    }
}

/// Reads and checks one primitive of `shape`; `None` for points and lines.
fn read(
    reader: &GltfReader<'_>,
    shape: &NodeShape,
    skin: Option<&Skin>,
    number: usize,
    primitive: &Primitive,
) -> Result<Option<ReadPrimitive>, Refusal> {
    let name = reader.document.root.meshes[shape.mesh].name.clone().unwrap_or_default();
    let place = place(reader, shape.mesh, number);
    // Each primitive has the mesh's name for itself, and another one in messages.
    reader.files.take(2 * name.len() as u64, || format!("meshes[{}].name", shape.mesh))?;
    let Checked::Valid(mode) = primitive.mode else {
        return Err(
            reader.damaged(place, "its mode is none of 0 to 6\nhint: export the file again")
        );
    };
    if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
        return Ok(None);
    }
    let draco = reader.draco(primitive, &place)?;
    let mut part = PrimitiveReader::new(reader, primitive, draco, place);
    let Some(positions) = part.attribute::<3>(&Semantic::Positions, 0.0)? else {
        part.note(NoteKind::Irregular, "a primitive without positions is left out");
        return Ok(Some(ReadPrimitive::empty(name, part.notes)));
    };
    let triangles = part.triangles(mode, positions.len())?;
    let wanted = reader.wanted;
    let normals =
        if wanted.normals { part.vertex_data(&Semantic::Normals, 0.0, &positions)? } else { None };
    let uvs = if wanted.uvs { part.uvs(&positions)? } else { Vec::new() };
    let colors =
        if wanted.colors { part.vertex_data(&Semantic::Colors(0), 1.0, &positions)? } else { None };
    let tangents = match &normals {
        Some(_) if wanted.uvs => part.tangents(&positions)?,
        _ => None,
    };
    let PrimitiveCorners { positions, normals, is_deformed, skinned, mirrored, deformer } =
        part.deformed(shape, skin, positions, normals)?;
    // Those of other shapes follow from the texture coordinates, as in files without tangents.
    let tangents = tangents.filter(|_| !is_deformed);
    let triangles = if mirrored { turned_over(&triangles) } else { triangles };
    let (mut copied, mut mapped) = cost(&triangles, triangles.len());
    let mut add = |(c, m): (u64, u64)| {
        copied += c;
        mapped += m;
    };
    add(match &positions {
        Positions::F32(positions) => cost(positions.floats(), positions.len() * 3),
        Positions::F64(positions) => cost(positions, positions.len()),
    });
    normals.iter().for_each(|v| add(cost(v.floats(), v.len() * 3)));
    uvs.iter().for_each(|v| add(cost(v.floats(), v.len() * 2)));
    let of_four = colors.iter().chain(tangents.as_ref().map(|tangents| &tangents.corners));
    of_four.for_each(|v| add(cost(v.floats(), v.len() * 4)));
    let candidate = MeshCandidate {
        name,
        place: part.place,
        positions,
        triangles,
        normals,
        uvs,
        colors,
        tangents,
    };
    let admitted = admit(candidate, reader.file, reader.options)?;
    Ok(Some(ReadPrimitive { skinned, admitted, deformer, copied, mapped, notes: part.notes }))
}

/// `triangles` with their backs in front.
fn turned_over(triangles: &[[u32; 3]]) -> Buffer<[u32; 3]> {
    let turned: Vec<[u32; 3]> = triangles.par_iter().map(|&[a, b, c]| [a, c, b]).collect();
    turned.into()
}
