//! One primitive on its way in: its attributes and triangles, and what was noted of it.

use etendue_geometry::{Buffer, Tangents, Vertices};
use gltf::json;
use json::mesh::{Mode, Primitive, Semantic};
use json::validation::Checked;
use rayon::prelude::*;

use super::accessor::Accessor;
use super::draco::DracoData;
use super::reader::GltfReader;
use crate::import::error::{Note, NoteKind};
use crate::import::{Refusal, Strictness};

/// A primitive being read.
pub(super) struct PrimitiveReader<'a> {
    pub reader: &'a GltfReader<'a>,
    pub primitive: &'a Primitive,
    /// Vertices and triangles, when they are compressed.
    draco: Option<DracoData<'a>>,
    pub place: String,
    pub notes: Vec<Note>,
}

impl<'a> PrimitiveReader<'a> {
    /// A primitive that messages call `place`, of which nothing is read yet.
    pub(super) fn new(
        reader: &'a GltfReader<'a>,
        primitive: &'a Primitive,
        draco: Option<DracoData<'a>>,
        place: String,
    ) -> Self {
        Self { reader, primitive, draco, place, notes: Vec::new() }
    }

    /// The floats of an attribute; `None` when the primitive has none.
    pub(super) fn attribute<const N: usize>(
        &self,
        semantic: &Semantic,
        fill: f32,
    ) -> Result<Option<Vertices<N>>, Refusal> {
        let Some((accessor, place)) = self.accessor(semantic)? else { return Ok(None) };
        match accessor.floats(fill) {
            Some(floats) => Ok(Some(floats)),
            None => Err(self.reader.damaged(
                place,
                format!(
                    "it has {} components, not {N}\nhint: export the file again",
                    accessor.components
                ),
            )),
        }
    }

    /// As [`Self::attribute`], one for each position; an attribute of another length is left out
    /// with a note, or refused under strict rules.
    pub(super) fn vertex_data<const N: usize>(
        &mut self,
        semantic: &Semantic,
        fill: f32,
        positions: &Vertices<3>,
    ) -> Result<Option<Vertices<N>>, Refusal> {
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

    pub(super) fn uvs(&mut self, positions: &Vertices<3>) -> Result<Vec<Vertices<2>>, Refusal> {
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

    /// Tangents, along the texture coordinates by which the primitive's material maps normals.
    pub(super) fn tangents(
        &mut self,
        positions: &Vertices<3>,
    ) -> Result<Option<Tangents>, Refusal> {
        let corners = self.vertex_data(&Semantic::Tangents, 0.0, positions)?;
        let materials = &self.reader.document.root.materials;
        let material = self.primitive.material.and_then(|index| materials.get(index.value()));
        let map = material.and_then(|material| material.normal_texture.as_ref());
        let set = map.map_or(0, |map| map.tex_coord as usize);
        Ok(corners.map(|corners| Tangents { set, corners }))
    }

    fn accessor(&self, semantic: &Semantic) -> Result<Option<(Accessor<'a>, String)>, Refusal> {
        let wanted = semantic.to_string();
        let found = self.primitive.attributes.iter().find(|(known, _)| match known {
            Checked::Valid(known) => known.to_string() == wanted,
            Checked::Invalid => false,
        });
        let place = format!("{}, {wanted}", self.place);
        if let Some(DracoData { primitive: compressed, mesh: decoded }) = &self.draco {
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

    pub(super) fn triangles(
        &mut self,
        mode: Mode,
        vertices: usize,
    ) -> Result<Buffer<[u32; 3]>, Refusal> {
        if let Some(DracoData { mesh, .. }) = &self.draco {
            return Ok(mesh.triangles.clone().into());
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
                "they are not scalars of componentType 5121, 5123 or 5125\nhint: export the file again",
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

    fn whole_triangles(&mut self, mode: Mode, corners: usize) -> Result<(), Refusal> {
        match corners % 3 {
            left @ 1.. if mode == Mode::Triangles => self.irregular(
                &format!("{left} of {corners} corners make no whole triangle"),
                "left out",
            ),
            _ => Ok(()),
        }
    }

    pub(super) fn irregular(&mut self, reason: &str, done: &str) -> Result<(), Refusal> {
        if self.reader.options.strictness == Strictness::Strict {
            return Err(self.reader.damaged(
                self.place.clone(),
                format!("{reason}; without --strict they are {done}"),
            ));
        }
        self.note(NoteKind::Irregular, &format!("{reason}; they are {done}"));
        Ok(())
    }

    pub(super) fn note(&mut self, kind: NoteKind, message: &str) {
        self.note_counted(kind, message, 1);
    }

    pub(super) fn note_counted(&mut self, kind: NoteKind, message: &str, count: u64) {
        self.notes.push(Note::new(kind, self.place.clone(), message).counted(count));
    }
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
