//! From corners with three indices to vertices with one.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

use etendue_geometry::Vertices;
use etendue_geometry::glam::DVec3;
use rayon::prelude::*;

use super::chunk::{Chunk, NONE, Polygon, V, VN, VT};
use super::pool::Pool;
use super::segment::Segment;
use crate::import::ImportError;
use crate::import::admit::Candidate;
use crate::import::files::Files;
use crate::import::polygon;
use crate::import::precision::precise_enough;

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
    ) -> Result<Candidate, ImportError> {
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
            return Ok(Candidate {
                name: title,
                place,
                positions: precise_enough(&pool.positions),
                triangles: triangles.into(),
                normals: None,
                uvs: Vec::new(),
                colors: opaque(pool.colors.iter()),
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
        Ok(Candidate {
            name: title,
            place,
            positions: precise_enough(&positions),
            triangles: triangles.into(),
            normals: has_normals.then(|| pick(&keys, VN, &pool.normals)),
            uvs: if has_uvs { vec![pick(&keys, VT, &pool.uvs)] } else { Vec::new() },
            colors: opaque(keys.iter().filter_map(|key| pool.colors.get(key[V] as usize))),
        })
    }

    /// Whether any corner of `segment` has an index of this kind.
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
