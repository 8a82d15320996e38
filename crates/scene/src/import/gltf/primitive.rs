//! Primitives: the meshes of a glTF file, each loaded once and only when the scene shows it.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

use etendue_geometry::{Buffer, Positions, Vertices};
use gltf::json;
use json::mesh::{Mode, Primitive, Semantic};
use json::validation::Checked;
use rayon::prelude::*;

use super::Reader;
use super::accessor::Accessor;
use super::chains::Chains;
use super::deform::{Corners, Skin};
use super::draco::{Compressed, Decoded};
use super::hierarchy::{Scene, Shape};
use crate::import::admit::{Admitted, Candidate, admit, cost};
use crate::import::deformer::Deformer;
use crate::import::error::{self, Note, NoteKind};
use crate::import::{Import, ImportError, Strictness};

/// A primitive that became a mesh.
pub(super) struct Loaded {
    /// Index into the import's meshes.
    pub mesh: u32,
    /// Index into the import's materials.
    pub material: u32,
    /// Whether it stands in the model's frame already.
    pub skinned: bool,
}

/// The shapes that a scene shows, each loaded once.
pub(super) struct Shapes {
    /// In order.
    shapes: Vec<Shape>,
    /// For each the primitives that have triangles.
    primitives: Vec<Vec<Loaded>>,
}

impl Shapes {
    /// The shapes of `scene`, not loaded yet.
    fn of(scene: &Scene) -> Self {
        let mut shapes: Vec<Shape> = scene.meshes.iter().map(|mesh| mesh.shape.clone()).collect();
        shapes.sort_unstable();
        shapes.dedup();
        let mut primitives = Vec::new();
        primitives.resize_with(shapes.len(), Vec::new);
        Self { shapes, primitives }
    }

    /// The primitives of `shape` that have triangles.
    pub(super) fn primitives(&self, shape: &Shape) -> &[Loaded] {
        self.shapes.binary_search(shape).map_or(&[], |found| &self.primitives[found])
    }
}

/// A primitive on its way in.
struct Read {
    skinned: bool,
    admitted: Admitted,
    deformer: Option<Deformer>,
    copied: u64,
    mapped: u64,
    notes: Vec<Note>,
}

/// Loads the meshes that `scene` shows. Materials are numbered as in the document.
pub(super) fn load(
    reader: &Reader<'_>,
    (scene, chains): (&Scene, &Chains<'_>),
    import: &mut Import,
) -> Result<Shapes, ImportError> {
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
    let skins = skins(reader, (scene, chains))?;
    let mut shapes = Shapes::of(scene);
    let wanted: Vec<(usize, usize, &Primitive)> = (shapes.shapes.iter().enumerate())
        .flat_map(|(s, shape)| {
            let primitives = meshes[shape.mesh].primitives.iter().enumerate();
            primitives.map(move |(number, primitive)| (s, number, primitive))
        })
        .collect();
    let read: Vec<Option<Read>> = wanted
        .par_iter()
        .map(|&(s, number, primitive)| {
            let shape = &shapes.shapes[s];
            let skin = shape.skin.and_then(|skin| skins.get(&skin));
            read(reader, shape, skin, number, primitive)
        })
        .collect::<Result<_, _>>()?;
    for ((s, number, primitive), read) in wanted.into_iter().zip(read) {
        let Some(read) = read else {
            note_no_triangles(&mut import.notes);
            continue;
        };
        let place = || place(reader, shapes.shapes[s].mesh, number);
        let material = super::material::number(reader, primitive, place)?;
        let skinned = read.skinned;
        let mesh = take(read, import, reader)?;
        shapes.primitives[s].push(Loaded { mesh, material, skinned });
    }
    Ok(shapes)
}

/// The skins that nodes of `scene` wear.
fn skins(
    reader: &Reader<'_>,
    (scene, chains): (&Scene, &Chains<'_>),
) -> Result<BTreeMap<usize, Skin>, ImportError> {
    let mut skins = BTreeMap::new();
    for placed in &scene.meshes {
        if let Some(index) = placed.shape.skin
            && let Entry::Vacant(entry) = skins.entry(index)
        {
            entry.insert(Skin::read(reader, index, placed.node, (&scene.pose, chains))?);
        }
    }
    Ok(skins)
}

/// Adds a mesh to `import`; its index.
fn take(read: Read, import: &mut Import, reader: &Reader<'_>) -> Result<u32, ImportError> {
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

/// What messages call a primitive.
fn place(reader: &Reader<'_>, mesh: usize, number: usize) -> String {
    let name = reader.document.root.meshes[mesh].name.as_deref().unwrap_or_default();
    if name.is_empty() {
        format!("meshes[{mesh}].primitives[{number}]")
    } else {
        format!("meshes[{mesh}].primitives[{number}] (\"{name}\")")
    }
}

/// Reads and checks one primitive of `shape`; `None` for points and lines.
fn read(
    reader: &Reader<'_>,
    shape: &Shape,
    skin: Option<&Skin>,
    number: usize,
    primitive: &Primitive,
) -> Result<Option<Read>, ImportError> {
    let name = reader.document.root.meshes[shape.mesh].name.clone().unwrap_or_default();
    let place = place(reader, shape.mesh, number);
    // Each primitive has the mesh's name for itself, and another one in messages.
    reader.files.take(2 * name.len() as u64, || format!("meshes[{}].name", shape.mesh))?;
    let Checked::Valid(mode) = primitive.mode else {
        return Err(reader.damaged(place, "its mode is none of 0 to 6; export the file again"));
    };
    if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
        return Ok(None);
    }
    let draco = reader.draco(primitive, &place)?;
    let mut part = Part { reader, primitive, draco, place, notes: Vec::new() };
    let Some(positions) = part.attribute::<3>(&Semantic::Positions, 0.0)? else {
        part.note(NoteKind::Irregular, "a primitive without positions is left out");
        return Ok(Some(part.empty(name)));
    };
    let triangles = part.triangles(mode, positions.len())?;
    let wanted = reader.wanted;
    let normals =
        if wanted.normals { part.vertex_data(&Semantic::Normals, 0.0, &positions)? } else { None };
    let uvs = if wanted.uvs { part.uvs(&positions)? } else { Vec::new() };
    let colors =
        if wanted.colors { part.vertex_data(&Semantic::Colors(0), 1.0, &positions)? } else { None };
    let Corners { positions, normals, skinned, mirrored, deformer } =
        part.deformed(shape, skin, positions, normals)?;
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
    colors.iter().for_each(|v| add(cost(v.floats(), v.len() * 4)));
    let candidate =
        Candidate { name, place: part.place, positions, triangles, normals, uvs, colors };
    let admitted = admit(candidate, reader.file, reader.options)?;
    Ok(Some(Read { skinned, admitted, deformer, copied, mapped, notes: part.notes }))
}

/// A primitive being read.
pub(super) struct Part<'a> {
    pub reader: &'a Reader<'a>,
    pub primitive: &'a Primitive,
    /// Where its vertices and triangles are, when they are compressed.
    draco: Option<(Compressed, &'a Decoded)>,
    pub place: String,
    notes: Vec<Note>,
}

impl<'a> Part<'a> {
    /// The floats of an attribute; `None` when the primitive has none.
    pub(super) fn attribute<const N: usize>(
        &self,
        semantic: &Semantic,
        fill: f32,
    ) -> Result<Option<Vertices<N>>, ImportError> {
        let Some((accessor, place)) = self.accessor(semantic)? else { return Ok(None) };
        match accessor.floats(fill) {
            Some(floats) => Ok(Some(floats)),
            None => Err(self.reader.damaged(
                place,
                format!(
                    "it has {} components, not {N}; export the file again",
                    accessor.components
                ),
            )),
        }
    }

    /// As [`Self::attribute`], one for each position; an attribute of another length is left out
    /// with a note, or refused under strict rules.
    fn vertex_data<const N: usize>(
        &mut self,
        semantic: &Semantic,
        fill: f32,
        positions: &Vertices<3>,
    ) -> Result<Option<Vertices<N>>, ImportError> {
        let Some(values) = self.attribute(semantic, fill)? else { return Ok(None) };
        if values.len() == positions.len() {
            return Ok(Some(values));
        }
        let reason = format!(
            "{} has {} values for {} positions",
            semantic.to_string(),
            values.len(),
            positions.len()
        );
        self.irregular(&reason, "left out")?;
        Ok(None)
    }

    fn uvs(&mut self, positions: &Vertices<3>) -> Result<Vec<Vertices<2>>, ImportError> {
        let mut sets = Vec::new();
        // glTF numbers sets without gaps.
        while let Ok(set) = u32::try_from(sets.len()) {
            match self.vertex_data(&Semantic::TexCoords(set), 0.0, positions)? {
                Some(uvs) => sets.push(uvs),
                None => break,
            }
        }
        Ok(sets)
    }

    fn accessor(&self, semantic: &Semantic) -> Result<Option<(Accessor<'a>, String)>, ImportError> {
        let wanted = semantic.to_string();
        let found = self.primitive.attributes.iter().find(|(known, _)| match known {
            Checked::Valid(known) => known.to_string() == wanted,
            Checked::Invalid => false,
        });
        let place = format!("{}, {wanted}", self.place);
        if let Some((compressed, decoded)) = &self.draco {
            let accessors = &self.reader.document.root.accessors;
            let own = found.and_then(|(_, index)| accessors.get(index.value()));
            let normalized = own.is_some_and(|accessor| accessor.normalized);
            if let Some(accessor) = decoded.accessor(compressed, &wanted, normalized) {
                let accessor = accessor.map_err(|why| self.reader.damaged(&*place, why))?;
                return Ok(Some((accessor, place)));
            }
        }
        let Some((_, index)) = found else { return Ok(None) };
        let accessor = self.reader.accessor(index.value(), &place)?;
        Ok(Some((accessor, place)))
    }

    fn triangles(&mut self, mode: Mode, vertices: usize) -> Result<Buffer<[u32; 3]>, ImportError> {
        if let Some((_, decoded)) = &self.draco {
            return Ok(decoded.triangles.clone().into());
        }
        let Some(index) = self.primitive.indices else {
            let count = u32::try_from(vertices).unwrap_or(u32::MAX);
            self.whole_triangles(mode, vertices)?;
            return Ok(assemble(mode, vertices, |i| u32::try_from(i).unwrap_or(count)).into());
        };
        let place = format!("{}, indices", self.place);
        let accessor = self.reader.accessor(index.value(), &place)?;
        self.reader.files.take(12 * accessor.count as u64 / 3, || place.clone())?;
        if !accessor.is_index() {
            return Err(self.reader.damaged(
                place,
                "they are not scalars of componentType 5121, 5123 or 5125; export the file again",
            ));
        }
        self.whole_triangles(mode, accessor.count)?;
        if mode == Mode::Triangles
            && let Some(mapped) = accessor.mapped_triangles()
        {
            return Ok(mapped);
        }
        let corners = accessor.integers();
        let corners: &[u32] = &corners;
        Ok(assemble(mode, corners.len(), |i| corners[i]).into())
    }

    fn whole_triangles(&mut self, mode: Mode, corners: usize) -> Result<(), ImportError> {
        match corners % 3 {
            left @ 1.. if mode == Mode::Triangles => self.irregular(
                &format!("{left} of {corners} corners make no whole triangle"),
                "left out",
            ),
            _ => Ok(()),
        }
    }

    pub(super) fn irregular(&mut self, reason: &str, done: &str) -> Result<(), ImportError> {
        if self.reader.options.strictness == Strictness::Strict {
            return Err(self.reader.damaged(
                self.place.clone(),
                format!("{reason}; without --strict they are {done}"),
            ));
        }
        self.note(NoteKind::Irregular, &format!("{reason}; they are {done}"));
        Ok(())
    }

    fn note(&mut self, kind: NoteKind, message: &str) {
        self.note_counted(kind, message, 1);
    }

    pub(super) fn note_counted(&mut self, kind: NoteKind, message: &str, count: u64) {
        self.notes.push(Note::new(kind, self.place.clone(), message).counted(count));
    }

    /// A mesh of nothing.
    fn empty(self, name: String) -> Read {
        let positions = Positions::F32(Vertices::from_arrays(&[]));
        let mesh = etendue_geometry::Mesh::new(name, positions, Vec::new().into());
        let admitted = Admitted { mesh, dropped: 0, notes: Vec::new() };
        Read { skinned: false, admitted, deformer: None, copied: 0, mapped: 0, notes: self.notes }
    }
}

/// `triangles` with their backs in front.
fn turned_over(triangles: &[[u32; 3]]) -> Buffer<[u32; 3]> {
    let turned: Vec<[u32; 3]> = triangles.par_iter().map(|&[a, b, c]| [a, c, b]).collect();
    turned.into()
}

/// Triangles from `len` corners (glTF 2.0, section 3.7.2.1): in strips, every other triangle is
/// turned round so that all fronts are on one side.
fn assemble(mode: Mode, len: usize, corner: impl Fn(usize) -> u32 + Sync) -> Vec<[u32; 3]> {
    let count = match mode {
        Mode::Triangles => len / 3,
        _ => len.saturating_sub(2),
    };
    let triangle = |i: usize| match mode {
        Mode::Triangles => [3 * i, 3 * i + 1, 3 * i + 2],
        Mode::TriangleStrip => [i, i + 1 + i % 2, i + 2 - i % 2],
        _ => [i + 1, i + 2, 0],
    };
    (0..count).into_par_iter().map(|i| triangle(i).map(&corner)).collect()
}
