//! From corners with three indices to vertices with one.

use std::collections::HashMap;
use std::path::Path;

use etendue_geometry::Vertices;
use etendue_geometry::glam::DVec3;
use rayon::prelude::*;

use super::chunk::{Chunk, NONE, Polygon, V, VN, VT};
use super::pool::Pool;
use super::segment::Segment;
use crate::import::admit::Candidate;
use crate::import::polygon;
use crate::import::precision::precise_enough;

/// Makes meshes from segments.
pub(super) struct Welder<'a> {
    pool: &'a Pool,
    chunks: &'a [Chunk],
}

/// A vertex: the indices of its position, texture coordinates and normal.
type Key = [u32; 3];

impl<'a> Welder<'a> {
    pub(super) fn new(pool: &'a Pool, chunks: &'a [Chunk]) -> Self {
        Self { pool, chunks }
    }

    /// The mesh of `segment`. The `only` one of a file may use all vertices of the file in their
    /// order, which saves the looking up.
    pub(super) fn mesh(&mut self, segment: &Segment, path: &Path, only: bool) -> Candidate {
        let corners = self.corners(segment);
        let has = |kind: usize| {
            segment.runs.iter().any(|(chunk, range)| {
                let indices = &self.chunks[*chunk].corners[kind];
                let end = range.end.min(indices.len());
                indices.get(range.start..end).is_some_and(|run| run.iter().any(|&i| i != NONE))
            })
        };
        let (has_uvs, has_normals) = (has(VT), has(VN));
        let in_order = only && !has_uvs && !has_normals;
        let (triangles, keys) = if in_order {
            (corners.par_iter().map(|t| t.map(|[v, ..]| v)).collect(), None)
        } else {
            let (triangles, keys) = weld(&corners);
            (triangles, Some(keys))
        };
        let pool = self.pool;
        let positions = match &keys {
            None => precise_enough(pool.positions.clone()),
            Some(keys) => {
                let used: Vec<[f64; 3]> =
                    keys.iter().map(|key| pool.positions[key[V] as usize]).collect();
                precise_enough(used)
            }
        };
        let keys = keys.as_deref();
        let title = if segment.name.is_empty() { stem(path) } else { segment.name.clone() };
        Candidate {
            place: match &segment.material {
                Some(material) => format!("\"{title}\" of material \"{material}\""),
                None => format!("\"{title}\""),
            },
            name: title,
            positions,
            triangles: triangles.into(),
            normals: has_normals.then(|| pick(keys, VN, &pool.normals, [0.0; 3])),
            uvs: if has_uvs { vec![pick(keys, VT, &pool.uvs, [0.0; 2])] } else { Vec::new() },
            colors: (!pool.colors.is_empty()).then(|| {
                let rgba: Vec<[f32; 4]> = match keys {
                    None => pool.colors.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect(),
                    Some(keys) => keys
                        .iter()
                        .map(|key| pool.colors[key[V] as usize])
                        .map(|[r, g, b]| [r, g, b, 1.0])
                        .collect(),
                };
                Vertices::from_arrays(&rgba)
            }),
        }
    }

    /// The triangles of a segment, corner by corner with all indices.
    fn corners(&self, segment: &Segment) -> Vec<[Key; 3]> {
        let of_run = |(chunk, range): &(usize, std::ops::Range<usize>)| {
            let chunk = &self.chunks[*chunk];
            let index = |kind: usize, corner: usize| {
                chunk.corners[kind].get(corner).copied().unwrap_or(NONE)
            };
            let key = |corner: usize| [V, VT, VN].map(|kind| index(kind, corner));
            let first = chunk.polygons.partition_point(|polygon| polygon.first < range.start);
            let mut triangles = Vec::with_capacity(range.len() / 3);
            let mut at = range.start;
            let polygons = chunk.polygons[first..].iter().take_while(|p| p.first < range.end);
            for polygon in polygons {
                triangles
                    .extend((at..polygon.first).step_by(3).map(|i| [i, i + 1, i + 2].map(key)));
                let cut = self.cut(chunk, polygon);
                triangles.extend(
                    cut.iter().map(|t| t.map(|corner| key(polygon.first + corner as usize))),
                );
                at = polygon.first + polygon.corners;
            }
            triangles.extend((at..range.end).step_by(3).map(|i| [i, i + 1, i + 2].map(key)));
            triangles
        };
        let parts: Vec<Vec<[Key; 3]>> = segment.runs.par_iter().map(of_run).collect();
        parts.concat()
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
}

/// Numbers the different corners in the order of their first use.
fn weld(corners: &[[Key; 3]]) -> (Vec<[u32; 3]>, Vec<Key>) {
    let mut keys: Vec<Key> = Vec::new();
    let mut known: HashMap<Key, u32> = HashMap::with_capacity(corners.len());
    let triangles = corners
        .iter()
        .map(|triangle| {
            triangle.map(|key| {
                *known.entry(key).or_insert_with(|| {
                    keys.push(key);
                    u32::try_from(keys.len() - 1).unwrap_or(u32::MAX)
                })
            })
        })
        .collect();
    (triangles, keys)
}

/// The values of `kind` for each key, `instead` where it has none.
fn pick<const N: usize>(
    keys: Option<&[Key]>,
    kind: usize,
    values: &[[f32; N]],
    instead: [f32; N],
) -> Vertices<N> {
    let picked: Vec<[f32; N]> = (keys.unwrap_or_default().iter())
        .map(|key| values.get(key[kind] as usize).copied().unwrap_or(instead))
        .collect();
    Vertices::from_arrays(&picked)
}

/// The file's name without its ending.
fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}
