//! The gate that every imported mesh passes: indices exist, positions that triangles use are
//! finite, attributes are finite. Bounds are found in the same pass, in parallel.

use std::path::Path;

use bytemuck::AnyBitPattern;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Buffer, Mesh, Positions, Tangents, Vertices, is_degenerate};
use rayon::prelude::*;

use super::{Note, NoteKind, Options, Refusal, Strictness, error};

/// Triangles that one task looks at: large enough to forget the cost of a task, small enough to
/// share 100 000 triangles among many cores.
const CHUNK: usize = 1 << 14;

/// A mesh as a file has it, before anything is known of it.
#[derive(Debug)]
pub(super) struct MeshCandidate {
    /// Name of the mesh in the file.
    pub name: String,
    /// Place of the mesh in the file, for messages.
    pub place: String,
    pub positions: Positions,
    pub triangles: Buffer<[u32; 3]>,
    pub normals: Option<Vertices<3>>,
    pub uvs: Vec<Vertices<2>>,
    pub colors: Option<Vertices<4>>,
    pub tangents: Option<Tangents>,
}

/// A mesh that passed.
#[derive(Debug)]
pub(super) struct AdmittedMesh {
    pub mesh: Mesh,
    /// Triangles dropped because a corner is not finite.
    pub dropped: u64,
    pub notes: Vec<Note>,
}

/// Checks `candidate`, drops what is not finite, and works out the bounds.
///
/// # Errors
///
/// When a triangle names a vertex that does not exist; under [`Strictness::Strict`] also when a
/// value is not finite.
pub(super) fn admit(
    candidate: MeshCandidate,
    file: &Path,
    options: &Options,
) -> Result<AdmittedMesh, Refusal> {
    let mut gate =
        Gate { file, place: &candidate.place, strictness: options.strictness, notes: Vec::new() };
    let survey = gate.survey(&candidate.positions, &candidate.triangles)?;
    let (triangles, bounds, degenerate) = if survey.broken == 0 {
        (candidate.triangles, survey.bounds, survey.degenerate)
    } else {
        gate.defect(
            survey.broken,
            "triangle",
            "with a corner that is not a finite number",
            "dropped",
        )?;
        let kept = finite_triangles(&candidate.positions, &candidate.triangles);
        let bounds = bounds_of(&candidate.positions, &kept);
        let degenerate = count_degenerate(&candidate.positions, &kept);
        (kept.into(), bounds, degenerate)
    };
    let mesh = Mesh {
        normals: candidate.normals.map(|v| gate.finite(v, "normal", 0.0)).transpose()?,
        uvs: candidate
            .uvs
            .into_iter()
            .map(|v| gate.finite(v, "texture coordinate", 0.0))
            .collect::<Result<_, _>>()?,
        colors: candidate.colors.map(|v| gate.finite(v, "vertex colour", 1.0)).transpose()?,
        tangents: match candidate.tangents {
            Some(Tangents { set, corners }) => {
                Some(Tangents { set, corners: gate.finite(corners, "tangent", 0.0)? })
            }
            None => None,
        },
        name: candidate.name,
        positions: candidate.positions,
        triangles,
        bounds,
        degenerate,
        steps: None,
    };
    Ok(AdmittedMesh { mesh, dropped: survey.broken, notes: gate.notes })
}

/// Result of one look at all triangles.
#[derive(Clone, Copy)]
struct Survey {
    bounds: Bounds,
    /// Triangles with a corner that is not finite.
    broken: u64,
    /// Triangles without area; not counted where any is broken.
    degenerate: u64,
}

struct Gate<'a> {
    file: &'a Path,
    place: &'a str,
    strictness: Strictness,
    notes: Vec<Note>,
}

impl Gate<'_> {
    fn survey(&self, positions: &Positions, triangles: &[[u32; 3]]) -> Result<Survey, Refusal> {
        match positions {
            Positions::F32(vertices) => {
                let (floats, stride): (&[f32], _) = (vertices.floats(), vertices.stride());
                self.survey_by(vertices.len(), triangles, |corner| {
                    let at = corner as usize * stride;
                    let [x, y, z] = [floats[at], floats[at + 1], floats[at + 2]];
                    DVec3::new(x.into(), y.into(), z.into())
                })
            }
            Positions::F64(vertices) => {
                let vertices: &[[f64; 3]] = vertices;
                self.survey_by(vertices.len(), triangles, |corner| vertices[corner as usize].into())
            }
        }
    }

    fn survey_by(
        &self,
        vertices: usize,
        triangles: &[[u32; 3]],
        position: impl Fn(u32) -> DVec3 + Sync,
    ) -> Result<Survey, Refusal> {
        let parts: Vec<Option<Survey>> = triangles
            .par_chunks(CHUNK)
            .map(|chunk| {
                let highest = chunk.as_flattened().iter().copied().max().unwrap_or(0);
                ((highest as usize) < vertices).then(|| survey_chunk(chunk, &position))
            })
            .collect();
        let mut survey = Survey { bounds: Bounds::EMPTY, broken: 0, degenerate: 0 };
        for (number, part) in parts.into_iter().enumerate() {
            let Some(part) = part else {
                return Err(self.out_of_range(vertices, triangles, number * CHUNK));
            };
            survey.bounds = survey.bounds.union(part.bounds);
            survey.broken += part.broken;
            survey.degenerate += part.degenerate;
        }
        Ok(survey)
    }

    fn out_of_range(&self, vertices: usize, triangles: &[[u32; 3]], from: usize) -> Refusal {
        let found = triangles[from..]
            .iter()
            .enumerate()
            .find_map(|(i, t)| Some((i, *t.iter().find(|&&corner| corner as usize >= vertices)?)));
        let (i, corner) = found.unwrap_or_default();
        self.damaged(format!(
            "triangle {} names vertex {corner}, but there are only {vertices} vertices\
             \nhint: export the file again",
            from + i
        ))
    }

    /// `vertices` with every value finite; whole vertices are replaced by `instead`.
    fn finite<const N: usize>(
        &mut self,
        vertices: Vertices<N>,
        what: &str,
        instead: f32,
    ) -> Result<Vertices<N>, Refusal> {
        let is_finite = |i: usize| vertices.get(i).iter().all(|value| value.is_finite());
        let bad = (0..vertices.len()).into_par_iter().filter(|&i| !is_finite(i)).count() as u64;
        if bad == 0 {
            return Ok(vertices);
        }
        self.defect(bad, what, "that is not a finite number", &format!("replaced by {instead}"))?;
        let values: Vec<[f32; N]> = (0..vertices.len())
            .into_par_iter()
            .map(|i| if is_finite(i) { vertices.get(i) } else { [instead; N] })
            .collect();
        Ok(Vertices::from_arrays(&values))
    }

    /// Notes `count` defects, or refuses the file for them.
    fn defect(&mut self, count: u64, what: &str, wrong: &str, done: &str) -> Result<(), Refusal> {
        let plural = if count == 1 { "" } else { "s" };
        if self.strictness == Strictness::Strict {
            return Err(self.damaged(format!(
                "{count} {what}{plural} {wrong}; without --strict they are {done}"
            )));
        }
        let message = format!("{what}s {wrong} are {done}");
        self.notes.push(Note::new(NoteKind::NotFinite, self.place, message).counted(count));
        Ok(())
    }

    fn damaged(&self, reason: String) -> Refusal {
        error::damaged(self.file, self.place, reason)
    }
}

/// The bounds and broken triangles of a chunk whose indices are known to exist.
fn survey_chunk(chunk: &[[u32; 3]], position: &impl Fn(u32) -> DVec3) -> Survey {
    let mut bounds = Bounds::EMPTY;
    // 0 as long as everything is finite, NaN from then on: cheaper than a test a corner.
    let mut taint = DVec3::ZERO;
    for &corner in chunk.as_flattened() {
        let p = position(corner);
        bounds.include(p);
        taint += p * 0.0;
    }
    // In a loop of its own, which is quicker; the chunk's vertices are at hand still.
    let degenerate = chunk.iter().filter(|t| is_degenerate(t.map(position))).count() as u64;
    if taint == DVec3::ZERO {
        if degenerate > 0 {
            bounds = bounds_of_areas(chunk.iter().map(|t| t.map(position)));
        }
        return Survey { bounds, broken: 0, degenerate };
    }
    let broken =
        chunk.iter().filter(|t| !t.iter().all(|&corner| position(corner).is_finite())).count();
    Survey { bounds, broken: broken as u64, degenerate }
}

fn finite_triangles(positions: &Positions, triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let is_finite = |t: &[u32; 3]| t.iter().all(|&c| positions.get(c as usize).is_finite());
    triangles.par_iter().copied().filter(is_finite).collect()
}

/// The box of those triangles that have an area.
fn bounds_of_areas(triangles: impl Iterator<Item = [DVec3; 3]>) -> Bounds {
    Bounds::of_points(triangles.filter(|&corners| !is_degenerate(corners)).flatten())
}

/// The box of those of `triangles`, whose indices exist, that have an area.
pub(crate) fn bounds_of(positions: &Positions, triangles: &[[u32; 3]]) -> Bounds {
    let of_chunk = |chunk: &[[u32; 3]]| {
        bounds_of_areas(chunk.iter().map(|t| t.map(|corner| positions.get(corner as usize))))
    };
    triangles.par_chunks(CHUNK).map(of_chunk).reduce(|| Bounds::EMPTY, Bounds::union)
}

/// Number of `triangles`, whose indices exist, that have no area.
pub(crate) fn count_degenerate(positions: &Positions, triangles: &[[u32; 3]]) -> u64 {
    let of_chunk = |chunk: &[[u32; 3]]| {
        let corners = chunk.iter().map(|t| t.map(|corner| positions.get(corner as usize)));
        corners.filter(|&corners| is_degenerate(corners)).count() as u64
    };
    triangles.par_chunks(CHUNK).map(of_chunk).sum()
}

/// Bytes that `buffer` holds in memory of its own and in a mapped file.
pub(super) fn cost<T: AnyBitPattern>(buffer: &Buffer<T>, used: usize) -> (u64, u64) {
    let bytes = used as u64 * size_of::<T>() as u64;
    if buffer.is_mapped() { (0, bytes) } else { (bytes, 0) }
}
