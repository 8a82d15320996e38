//! Wavefront OBJ, in parallel from the mapped file.
//!
//! The file is cut into pieces of whole lines that are read side by side; indices that count
//! backwards, material changes and groups are settled afterwards. Crate `tobj` reads the material
//! files, and the tests compare all meshes with its own.
//!
//! Why not all of it through `tobj` 4.0: it reads on one thread, its errors do not know their line,
//! it takes lines (`l`) for faces, fans polygons whatever their shape, and forgets the names of
//! materials whose file is missing.
//!
//! # Sources
//!
//! Wavefront Technologies, *Object Files (.obj)*, appendix B1 of the Advanced Visualizer manual.
//!
//! Flat lamps at the rim of a model shine into it alone.
//!
//! MTL has no word for the side on which a surface shines, so `Ke` shines from both. A flat lamp right
//! under the ceiling then lights the slit behind it: the light goes to and fro there, comes out by a
//! gap that few paths find, and those few are white specks. Who draws such a lamp means its front.

mod chunk;
mod mtl;
mod weld;

use std::collections::HashMap;
use std::path::Path;

use rayon::prelude::*;

use super::admit::{self, AdmittedMesh};
use super::error::{self, Note, NoteKind};
use super::files::{Files, refuse_other_kind};
use super::text::{TextFault, TextSlice, pieces, with_newlines, without_mark};
use super::{Import, ImportedPlacement, Options, Refusal, Wanted};
use chunk::{Chunk, Segment, WantedColumns};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Mesh, Transform};
use weld::Pool;

/// Bytes that a byte of text becomes: a line `v 0 0 0` three f64, a corner of a face an index or three.
const PARSED_PER_BYTE: u64 = 3;

/// Bytes that one task reads.
const PIECE: usize = 1 << 20;

/// Reads the OBJ file at `path`.
pub(super) fn import(
    path: &Path,
    files: &Files,
    wanted: Wanted,
    options: &Options,
) -> Result<Import, Refusal> {
    let map = files.map_model(path)?;
    refuse_other_kind(path, map.bytes(), "an OBJ model")?;
    let text = with_newlines(without_mark(map.bytes()));
    let text: &[u8] = &text;
    let fault = |fault: TextFault| fault.locate(path, text);
    let wish = WantedColumns { uvs: wanted.uvs, normals: wanted.normals, colors: wanted.colors };
    let bytes = PARSED_PER_BYTE * text.len() as u64;
    files.take(bytes, || "the numbers of the text".to_owned())?;
    let pieces = pieces(text, PIECE);
    let chunks: Vec<Result<Chunk, TextFault>> = pieces
        .par_iter()
        .map(|&TextSlice { start, text }| {
            refuse_zero_bytes(text)
                .and_then(|()| Chunk::parse(text, wish))
                .map_err(|TextFault { at, reason }| TextFault { at: start + at, reason })
        })
        .collect();
    // The first of the file's faults is told, however threads run.
    let mut chunks = chunks.into_iter().collect::<Result<Vec<_>, _>>().map_err(fault)?;
    refuse_foreign(&chunks, &pieces).map_err(fault)?;
    let missing = weld::settle(&mut chunks, options.strictness)
        .map_err(|chunk| weld::find_bad_index(&pieces, chunk, &chunks, options.strictness))
        .map_err(fault)?;
    let mut import = Import::default();
    note_leftovers(&chunks, missing, &mut import.notes);
    let segments = chunk::divide(&chunks);
    let names = segments.iter().map(|s| s.name.len() + s.material.as_ref().map_or(0, String::len));
    files.take(4 * names.sum::<usize>() as u64, || "names of objects".to_owned())?;
    let pool = Pool::gather(&mut chunks);
    let libraries = chunk::libraries(&chunks);
    let numbers = mtl::load(&libraries, &segments, files, wanted, options.strictness, &mut import)?;
    let mut welder = weld::Welder::new(&pool, &chunks);
    let single = segments.len() == 1;
    let mut nodes: HashMap<&str, u32> = HashMap::new();
    for (segment, material) in segments.iter().zip(numbers) {
        let next = u32::try_from(nodes.len()).unwrap_or(u32::MAX);
        let node = *nodes.entry(&segment.name).or_insert(next);
        let candidate = welder.mesh(segment, path, files, single)?;
        let admitted = admit::admit(candidate, path, options)?;
        place(admitted, segment, [material, node], &mut import)?;
    }
    darken_backs(&mut import);
    Ok(import)
}

/// Files of other formats would else pass for models of lines that mean nothing.
fn refuse_zero_bytes(text: &[u8]) -> Result<(), TextFault> {
    if !text.contains(&0) {
        return Ok(());
    }
    let at = text.iter().position(|&byte| byte == 0).unwrap_or_default();
    Err(TextFault::new(
        at,
        "a zero byte: this is no text, hence no OBJ\nhint: export the model again",
    ))
}

/// Refuses text of another format: no line of it is one of OBJ, and some line is no comment.
fn refuse_foreign(chunks: &[Chunk], pieces: &[TextSlice<'_>]) -> Result<(), TextFault> {
    if chunks.iter().any(|chunk| chunk.is_obj) {
        return Ok(());
    }
    let first = pieces.iter().zip(chunks).find_map(|(piece, chunk)| {
        chunk.foreign.as_ref().map(|(at, word)| (piece.start + at, word))
    });
    let Some((at, word)) = first else { return Ok(()) };
    let what = match word.as_str() {
        // The letter says what it holds, numbers of its surface follow (MNI's BIC-obj, `bicobj.c`).
        "P" | "L" | "M" => "this looks like a surface of the MNI's tools",
        _ => "this is another format",
    };
    let why = format!(
        "no line is one of Wavefront's OBJ, such as `v 0 0 0` or `f 1 2 3`: {what}\nhint: convert it to OBJ, PLY or \
         glTF"
    );
    Err(TextFault::new(at, why))
}

/// Adds a mesh where the file has it.
fn place(
    admitted: AdmittedMesh,
    segment: &Segment,
    [material, node]: [u32; 2],
    import: &mut Import,
) -> Result<(), Refusal> {
    import.stats.bytes_copied += admitted.mesh.heap_bytes() as u64;
    import.stats.dropped += admitted.dropped;
    for note in admitted.notes {
        error::push(&mut import.notes, note);
    }
    import.placements.push(ImportedPlacement {
        // Fewer meshes than corners, and those are counted in 32 bits.
        mesh: u32::try_from(import.meshes.len()).unwrap_or(u32::MAX),
        material,
        model_from_mesh: Transform::IDENTITY,
        name: segment.name.clone(),
        node,
        links: Vec::new(),
        instance: None,
    });
    import.meshes.push(admitted.mesh);
    Ok(())
}

fn note_leftovers(chunks: &[Chunk], missing: u64, notes: &mut Vec<Note>) {
    if missing > 0 {
        let message = "texture coordinates and normals that do not exist are left out";
        error::push(notes, Note::new(NoteKind::Irregular, "f", message).counted(missing));
    }
    let lines: u64 = chunks.iter().map(|chunk| chunk.without_surface).sum();
    if lines > 0 {
        let message = "points and lines have no surface and are left out";
        error::push(notes, Note::new(NoteKind::Unsupported, "l, p", message).counted(lines));
    }
    let free_form: u64 = chunks.iter().map(|chunk| chunk.free_form).sum();
    if free_form > 0 {
        let message = "free-form curves and surfaces are left out; export the model as polygons";
        error::push(
            notes,
            Note::new(NoteKind::Unsupported, "curv, surf", message).counted(free_form),
        );
    }
    let small: u64 = chunks.iter().map(|chunk| chunk.too_small).sum();
    if small > 0 {
        let message = "faces of fewer than three corners are left out";
        error::push(notes, Note::new(NoteKind::Irregular, "f", message).counted(small));
    }
}

/// Share of the model that may lie behind a lamp, against that before it, when it shines to the front alone.
const BEHIND: f64 = 0.02;

/// Least reach of a model before a lamp, as a share of the lamp's size, when the lamp is there to light it.
const LEAST_BEFORE: f64 = 0.1;

/// Tolerance of corners' distance from a plane, as a share of the size of what they span: files have six digits.
const FLAT: f64 = 1e-5;

/// Leaves the backs of flat lamps dark that have next to nothing behind them.
fn darken_backs(import: &mut Import) {
    if import.materials.iter().all(|material| material.emission.is_none()) {
        return;
    }
    let model = bounds(import.meshes.iter());
    for (number, material) in (0_u32..).zip(&mut import.materials) {
        let Some(emission) = &mut material.emission else { continue };
        let own = import.placements.iter().filter(|placement| placement.material == number);
        let meshes: Vec<&Mesh> = own.map(|own| &import.meshes[own.mesh as usize]).collect();
        if let Some(Sheet { normal, at, size }) = Sheet::of(&meshes) {
            let [behind, before] = extent(model, normal, at);
            // A lamp by itself has nothing before it, and shines wherever it is put.
            let lights_model = before > LEAST_BEFORE * size;
            emission.two_sided = !lights_model || behind > BEHIND * before;
        }
    }
}

fn bounds<'a>(meshes: impl Iterator<Item = &'a Mesh>) -> Bounds {
    let mut bounds = Bounds::default();
    for mesh in meshes {
        (0..mesh.triangles.len()).flat_map(|t| mesh.corners(t)).for_each(|at| bounds.include(at));
    }
    bounds
}

/// Triangles in one plane with their fronts to the same side.
struct Sheet {
    /// Unit normal of the fronts.
    normal: DVec3,
    /// Distance along the normal at which they lie.
    at: f64,
    /// The diagonal of their box.
    size: f64,
}

impl Sheet {
    /// `None` where the triangles lie in no plane.
    fn of(meshes: &[&Mesh]) -> Option<Self> {
        let triangles = || meshes.iter().flat_map(|m| (0..m.triangles.len()).map(|t| m.corners(t)));
        let cross = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
        let normal = triangles().find_map(|corners| cross(corners).try_normalize())?;
        let at = normal.dot(triangles().next()?[0]);
        let size = bounds(meshes.iter().copied()).diagonal();
        let lies_in = |corners: [DVec3; 3]| {
            let near = |corner: DVec3| (normal.dot(corner) - at).abs() <= FLAT * size;
            corners.into_iter().all(near) && normal.dot(cross(corners)) >= 0.0
        };
        triangles().all(lies_in).then_some(Self { normal, at, size })
    }
}

/// Reach of `bounds` behind a plane and before it.
fn extent(bounds: Bounds, normal: DVec3, at: f64) -> [f64; 2] {
    let middle = normal.dot(bounds.centre()) - at;
    let reach = normal.abs().dot(0.5 * (bounds.max - bounds.min));
    [(reach - middle).max(0.0), (reach + middle).max(0.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_reaches_as_far_as_its_corners() {
        let bounds = Bounds { min: DVec3::ZERO, max: DVec3::new(1.0, 2.0, 4.0) };
        assert_eq!(extent(bounds, DVec3::NEG_Y, -1.5), [0.5, 1.5]);
        assert_eq!(extent(bounds, DVec3::Z, 5.0), [5.0, 0.0], "all is behind");
    }
}
