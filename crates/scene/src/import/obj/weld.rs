//! From corners with three indices to vertices with one.
//!
//! All vertices of a file together, and the indices that name them.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use super::chunk::{Chunk, KINDS, NONE, Polygon, Segment, V, VN, VT};
use crate::import::admit::MeshCandidate;
use crate::import::files::Files;
use crate::import::precision::precise_enough;
use crate::import::text::{TextFault, TextSlice, WordReader, whole};
use crate::import::{Refusal, Strictness, polygon};
use etendue_geometry::Vertices;
use etendue_geometry::glam::DVec3;

/// Makes meshes from segments.
pub(super) struct Welder<'a> {
    pool: &'a Pool,
    chunks: &'a [Chunk],
    /// For each position the last vertex at it, [`NONE`] before there is one.
    heads: Vec<u32>,
}

/// The most vertices at one position that are looked through one by one.
const LONGEST_CHAIN: u32 = 32;

/// A vertex: the indices of its position, texture coordinates and normal.
type Key = [u32; 3];

impl<'a> Welder<'a> {
    pub(super) fn new(pool: &'a Pool, chunks: &'a [Chunk]) -> Self {
        Self { pool, chunks, heads: Vec::new() }
    }

    /// The mesh of `segment`. The `only` one of a file uses all vertices of the file in their order
    /// where corners have nothing but a position, which saves the looking up.
    pub(super) fn mesh(
        &mut self,
        segment: &Segment,
        path: &Path,
        files: &Files,
        only: bool,
    ) -> Result<MeshCandidate, Refusal> {
        let (has_uvs, has_normals) = (self.has(segment, VT), self.has(segment, VN));
        let title = if segment.name.is_empty() { stem(path) } else { segment.name.clone() };
        let place = match &segment.material {
            Some(material) => format!("\"{title}\" of material \"{material}\""),
            None => format!("\"{title}\""),
        };
        let pool = self.pool;
        let take = |count: usize, each: usize| {
            files.take((count as u64).saturating_mul(each as u64), || place.clone())
        };
        let plain = only && !has_uvs && !has_normals;
        // Polygons have two triangles less than corners, and triangles a third as many as corners.
        let corners: usize = segment.runs.iter().map(|(_, range)| range.len()).sum();
        take(corners, if plain { size_of::<[u32; 3]>() } else { size_of::<[Key; 3]>() })?;
        if plain {
            take(pool.positions.len(), size_of::<[f64; 3]>())?;
        }
        if plain {
            let triangles = self.corners(segment, |chunk, corner| chunk.corners[V][corner]);
            return Ok(MeshCandidate {
                name: title,
                place,
                positions: precise_enough(&pool.positions),
                triangles: triangles.into(),
                normals: None,
                uvs: Vec::new(),
                colors: opaque(pool.colors.iter()),
                tangents: None,
            });
        }
        let index = |chunk: &Chunk, kind: usize, corner: usize| {
            chunk.corners[kind].get(corner).copied().unwrap_or(NONE)
        };
        let corners = self
            .corners(segment, |chunk, corner| [V, VT, VN].map(|kind| index(chunk, kind, corner)));
        let (triangles, keys) = self.weld(&corners);
        take(keys.len(), 2 * size_of::<[f64; 3]>() + size_of::<[f32; 5]>())?;
        let positions: Vec<[f64; 3]> =
            keys.par_iter().map(|key| pool.positions[key[V] as usize]).collect();
        Ok(MeshCandidate {
            name: title,
            place,
            positions: precise_enough(&positions),
            triangles: triangles.into(),
            normals: has_normals.then(|| pick(&keys, VN, &pool.normals)),
            uvs: if has_uvs { vec![pick(&keys, VT, &pool.uvs)] } else { Vec::new() },
            colors: opaque(keys.iter().filter_map(|key| pool.colors.get(key[V] as usize))),
            tangents: None,
        })
    }

    /// True if any corner of `segment` has an index of this kind.
    fn has(&self, segment: &Segment, kind: usize) -> bool {
        segment.runs.iter().any(|(chunk, range)| {
            let indices = &self.chunks[*chunk].corners[kind];
            let end = range.end.min(indices.len());
            indices.get(range.start..end).is_some_and(|run| run.iter().any(|&i| i != NONE))
        })
    }

    /// The triangles of a segment, with what `key` gives for each corner of a chunk.
    fn corners<K: Copy + Send>(
        &self,
        segment: &Segment,
        key: impl Fn(&Chunk, usize) -> K + Sync,
    ) -> Vec<[K; 3]> {
        let of_run = |(chunk, range): &(usize, Range<usize>)| {
            let chunk = &self.chunks[*chunk];
            let key = |corner: usize| key(chunk, corner);
            let first = chunk.polygons.partition_point(|polygon| polygon.first < range.start);
            let polygons = chunk.polygons[first..].iter().take_while(|p| p.first < range.end);
            let mut triangles = Vec::with_capacity(range.len() / 3);
            let mut at = range.start;
            for polygon in polygons {
                triangles.extend(in_threes(at..polygon.first).map(|t| t.map(key)));
                let cut = self.cut(chunk, polygon);
                let whole = |corner: u32| key(polygon.first + corner as usize);
                triangles.extend(cut.iter().map(|t| t.map(whole)));
                at = polygon.first + polygon.corners;
            }
            triangles.extend(in_threes(at..range.end).map(|t| t.map(key)));
            triangles
        };
        let parts: Vec<Vec<[K; 3]>> = segment.runs.par_iter().map(of_run).collect();
        let mut triangles = Vec::with_capacity(parts.iter().map(Vec::len).sum());
        for mut part in parts {
            triangles.append(&mut part);
        }
        triangles
    }

    fn cut(&self, chunk: &Chunk, polygon: &Polygon) -> Vec<[u32; 3]> {
        let range = polygon.first..polygon.first + polygon.corners;
        let points: Vec<DVec3> = chunk.corners[V][range]
            .iter()
            .map(|&corner| self.pool.positions[corner as usize].into())
            .collect();
        let mut triangles = Vec::with_capacity(polygon.corners - 2);
        polygon::triangulate(&points, &mut triangles);
        triangles
    }

    /// Numbers the different corners in the order of their first use. Those at one position are
    /// chained, which takes no hashing as long as few differ.
    fn weld(&mut self, corners: &[[Key; 3]]) -> (Vec<[u32; 3]>, Vec<Key>) {
        self.heads.resize(self.pool.positions.len(), NONE);
        let mut keys: Vec<Key> = Vec::new();
        // For each vertex the one before it at its position.
        let mut earlier: Vec<u32> = Vec::new();
        // Those beyond the longest chain of their position.
        let mut crowded: HashMap<Key, u32> = HashMap::new();
        let heads = &mut self.heads;
        let mut vertex = |key: Key| {
            let head = &mut heads[key[V] as usize];
            let (mut at, mut length) = (*head, 0);
            while at != NONE {
                if keys[at as usize] == key {
                    return at;
                }
                at = earlier[at as usize];
                length += 1;
            }
            let new = u32::try_from(keys.len()).unwrap_or(NONE);
            if length < LONGEST_CHAIN {
                earlier.push(std::mem::replace(head, new));
            } else {
                let known = *crowded.entry(key).or_insert(new);
                if known != new {
                    return known;
                }
                earlier.push(NONE);
            }
            keys.push(key);
            new
        };
        let triangles = corners.iter().map(|triangle| triangle.map(&mut vertex)).collect();
        for key in &keys {
            self.heads[key[V] as usize] = NONE;
        }
        (triangles, keys)
    }
}

/// The corners of `range`, three by three.
fn in_threes(range: Range<usize>) -> impl Iterator<Item = [usize; 3]> {
    range.step_by(3).map(|i| [i, i + 1, i + 2])
}

/// The values of `kind` for each key, zeros where it has none.
fn pick<const N: usize>(keys: &[Key], kind: usize, values: &[[f32; N]]) -> Vertices<N> {
    let picked: Vec<[f32; N]> = keys
        .par_iter()
        .map(|key| values.get(key[kind] as usize).copied().unwrap_or([0.0; N]))
        .collect();
    Vertices::from_arrays(&picked)
}

/// RGBA from RGB; nothing from nothing.
fn opaque<'c>(colors: impl Iterator<Item = &'c [f32; 3]>) -> Option<Vertices<4>> {
    let rgba: Vec<[f32; 4]> = colors.map(|&[r, g, b]| [r, g, b, 1.0]).collect();
    (!rgba.is_empty()).then(|| Vertices::from_arrays(&rgba))
}

/// The file's name without its ending.
fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Everything that corners name, in the order of the file.
pub(super) struct Pool {
    pub positions: Vec<[f64; 3]>,
    /// Empty when no vertex has a colour, else one each.
    pub colors: Vec<[f32; 3]>,
    pub uvs: Vec<[f32; 2]>,
    pub normals: Vec<[f32; 3]>,
}

impl Pool {
    /// Takes the vertices out of `chunks`.
    pub(super) fn gather(chunks: &mut [Chunk]) -> Self {
        let colored = chunks.iter().any(|chunk| !chunk.colors.is_empty());
        for chunk in chunks.iter_mut().filter(|_| colored) {
            chunk.colors.resize(chunk.positions.len(), [1.0; 3]);
        }
        Self {
            positions: concat(chunks, |chunk| &mut chunk.positions),
            colors: concat(chunks, |chunk| &mut chunk.colors),
            uvs: concat(chunks, |chunk| &mut chunk.uvs),
            normals: concat(chunks, |chunk| &mut chunk.normals),
        }
    }
}

/// One array of the arrays of all chunks, which are emptied as they are copied.
fn concat<T: Copy>(chunks: &mut [Chunk], part: impl Fn(&mut Chunk) -> &mut Vec<T>) -> Vec<T> {
    if let [only] = chunks {
        return std::mem::take(part(only));
    }
    let mut parts: Vec<Vec<T>> =
        chunks.iter_mut().map(|chunk| std::mem::take(part(chunk))).collect();
    let mut all = Vec::with_capacity(parts.iter().map(Vec::len).sum());
    for part in &mut parts {
        all.extend_from_slice(part);
        *part = Vec::new();
    }
    all
}

/// Number of definitions of each kind before each chunk, and in all.
fn bases(chunks: &[Chunk]) -> (Vec<[usize; KINDS]>, [usize; KINDS]) {
    let mut before = [0; KINDS];
    let mut bases = Vec::with_capacity(chunks.len());
    for chunk in chunks {
        bases.push(before);
        for (sum, here) in before.iter_mut().zip(chunk.defined) {
            *sum += here;
        }
    }
    (bases, before)
}

/// Makes all indices absolute and checks that what they name exists; on failure, a chunk that names
/// what does not. Texture coordinates and normals that do not exist are left out unless under
/// strict rules; so many there were.
pub(super) fn settle(chunks: &mut [Chunk], strictness: Strictness) -> Result<u64, usize> {
    let (bases, total) = bases(chunks);
    let settle_chunk = |(chunk, base): (&mut Chunk, &[usize; KINDS])| {
        for (kind, corner, local) in std::mem::take(&mut chunk.relative) {
            let index = i64::try_from(base[kind]).ok().and_then(|base| base.checked_add(local));
            let index = index.and_then(|index| u32::try_from(index).ok());
            // As large as an index can be: it names nothing either.
            chunk.corners[kind][corner] = index.unwrap_or(NONE - 1);
        }
        let mut missing = 0;
        for (kind, indices) in chunk.corners.iter_mut().enumerate() {
            let is_missing = |&index: &u32| index != NONE && index as usize >= total[kind];
            if !indices.par_iter().any(is_missing) {
                continue;
            }
            if kind == V || strictness == Strictness::Strict {
                return None;
            }
            for index in indices.iter_mut().filter(|index| is_missing(index)) {
                *index = NONE;
                missing += 1;
            }
        }
        Some(missing)
    };
    let settled: Vec<Option<u64>> = chunks.par_iter_mut().zip(&bases).map(settle_chunk).collect();
    let mut missing = 0;
    for (chunk, settled) in settled.into_iter().enumerate() {
        missing += settled.ok_or(chunk)?;
    }
    Ok(missing)
}

/// Fault of an index, in chunk number `chunk`, that names what does not exist.
pub(super) fn find_bad_index(
    pieces: &[TextSlice<'_>],
    chunk: usize,
    chunks: &[Chunk],
    strictness: Strictness,
) -> TextFault {
    let kinds = if strictness == Strictness::Strict { KINDS } else { V + 1 };
    let (bases, total) = bases(chunks);
    let TextSlice { start, text } = pieces[chunk];
    let mut defined = bases[chunk];
    let mut words = WordReader::new(text);
    while !words.is_done() {
        match words.word() {
            Some(b"v") => defined[V] += 1,
            Some(b"vt") => defined[VT] += 1,
            Some(b"vn") => defined[VN] += 1,
            Some(b"f" | b"fo") => {
                while let Some(word) = words.word() {
                    if let Some(reason) = bad_corner(word, kinds, defined, total) {
                        return TextFault::new(start + words.at() - word.len(), reason);
                    }
                }
            }
            _ => {}
        }
        words.end_line();
    }
    TextFault::new(start, "a face names a vertex that does not exist")
}

fn bad_corner(
    word: &[u8],
    kinds: usize,
    defined: [usize; KINDS],
    total: [usize; KINDS],
) -> Option<String> {
    let names = ["vertices", "texture coordinates", "normals"];
    for (kind, part) in word.split(|&byte| byte == b'/').enumerate().take(kinds) {
        let Some(index) = whole(part) else { continue };
        let count = i64::try_from(total[kind]).ok()?;
        let before = i64::try_from(defined[kind]).ok()?;
        if index > count || (index < 0 && before + index < 0) {
            return Some(format!(
                "\"{}\" names number {index} of {} {}\nhint: export the file again",
                String::from_utf8_lossy(word),
                if index < 0 { before } else { count },
                names[kind]
            ));
        }
    }
    None
}
