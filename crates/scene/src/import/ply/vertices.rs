//! The vertices of a PLY file, from a table of numbers.
//!
//! Faces: polygons and triangle strips into triangles.

use rayon::prelude::*;

use super::header::{RowElement, Type};
use crate::import::precision::{precise_enough, single};
use crate::import::{Wanted, polygon};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Buffer, Positions, Vertices};

/// Numbers by row and by property of the vertex element.
pub(super) trait VertexTable: Sync {
    /// The number of rows.
    fn rows(&self) -> usize;

    /// One number. Text and binary data alike are read as f64, which holds each of PLY's types.
    fn get(&self, row: usize, property: usize) -> f64;

    /// Positions that can be used where they are.
    fn mapped_positions(&self, _xyz: [usize; 3]) -> Option<Vertices<3>> {
        None
    }
}

/// All that is read of the vertices.
#[derive(Debug)]
pub(super) struct VertexData {
    pub positions: Positions,
    pub normals: Option<Vertices<3>>,
    pub uvs: Option<Vertices<2>>,
    pub colors: Option<Vertices<4>>,
}

/// Properties that are read.
#[derive(Debug, Clone)]
pub(super) struct VertexColumns {
    xyz: [usize; 3],
    normal: Option<[usize; 3]>,
    uv: Option<[usize; 2]>,
    color: Option<[usize; 3]>,
    /// Positions have more digits than f32.
    in_f64: bool,
    /// Colours are bytes.
    byte_color: bool,
}

impl VertexColumns {
    /// The wanted properties of `element`; an error without x, y and z.
    pub(super) fn of(element: &RowElement, wanted: Wanted, in_text: bool) -> Result<Self, String> {
        let plain = |names: &[&str]| {
            element.find(names).filter(|&column| element.properties[column].list.is_none())
        };
        let all = |names: [&[&str]; 3]| {
            let [a, b, c] = names.map(plain);
            Some([a?, b?, c?])
        };
        let Some(xyz) = all([&["x"], &["y"], &["z"]]) else {
            return Err("the vertices have no x, y and z\nhint: export the file again".to_owned());
        };
        let color = all([
            &["red", "r", "diffuse_red"],
            &["green", "g", "diffuse_green"],
            &["blue", "b", "diffuse_blue"],
        ]);
        let uv = plain(&["s", "u", "texture_u"]).zip(plain(&["t", "v", "texture_v"]));
        let kind = |column: usize| element.properties[column].kind;
        Ok(Self {
            xyz,
            normal: all([&["nx"], &["ny"], &["nz"]]).filter(|_| wanted.normals),
            uv: uv.map(|(u, v)| [u, v]).filter(|_| wanted.uvs),
            color: color.filter(|_| wanted.colors),
            in_f64: in_text || xyz.iter().any(|&column| is_wide(kind(column))),
            byte_color: color.is_some_and(|[red, ..]| kind(red) == Type::U8),
        })
    }

    /// Reads the columns of `table`.
    pub(super) fn read(&self, table: &impl VertexTable) -> VertexData {
        VertexData {
            positions: self.positions(table),
            normals: self.normal.map(|columns| singles(table, columns)),
            uvs: self.uv.map(|[u, v]| {
                each(table, |row| [single(table.get(row, u)), single(1.0 - table.get(row, v))])
            }),
            colors: self.color.map(|columns| self.colors(table, columns)),
        }
    }

    fn positions(&self, table: &impl VertexTable) -> Positions {
        if let Some(mapped) = table.mapped_positions(self.xyz) {
            return Positions::F32(mapped);
        }
        if !self.in_f64 {
            return Positions::F32(singles(table, self.xyz));
        }
        let point = |row: usize| self.xyz.map(|column| table.get(row, column));
        let points: Vec<[f64; 3]> = (0..table.rows()).into_par_iter().map(point).collect();
        precise_enough(&points)
    }

    fn colors(&self, table: &impl VertexTable, columns: [usize; 3]) -> Vertices<4> {
        let linear = |value: f64| if self.byte_color { linear(value / 255.0) } else { value };
        each(table, |row| {
            let [red, green, blue] = columns.map(|column| single(linear(table.get(row, column))));
            [red, green, blue, 1.0]
        })
    }
}

fn is_wide(kind: Type) -> bool {
    matches!(kind, Type::F64 | Type::I32 | Type::U32)
}

/// The sRGB transfer curve undone (IEC 61966-2-1:1999).
fn linear(encoded: f64) -> f64 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

fn singles(table: &impl VertexTable, columns: [usize; 3]) -> Vertices<3> {
    each(table, |row| columns.map(|column| single(table.get(row, column))))
}

/// `N` floats for each row, with the padding that Embree wants behind them.
fn each<const N: usize>(
    table: &impl VertexTable,
    values: impl Fn(usize) -> [f32; N] + Sync,
) -> Vertices<N> {
    let mut floats = vec![0.0; table.rows() * N + 4];
    floats[..table.rows() * N]
        .par_chunks_exact_mut(N)
        .enumerate()
        .for_each(|(row, to)| to.copy_from_slice(&values(row)));
    Vertices::new(floats.into(), N, table.rows()).unwrap_or_else(|| Vertices::from_arrays(&[]))
}

/// Meaning of an element's lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lists {
    Polygons,
    /// Strips, each ended by −1.
    Strips,
}

impl Lists {
    /// The lists of `element` and the number of the property; `None` when it has no surface.
    pub(super) fn of(element: &RowElement) -> Option<(Self, usize)> {
        let kind = match element.name.as_str() {
            "face" | "faces" => Self::Polygons,
            "tristrips" => Self::Strips,
            _ => return None,
        };
        let column = element.find(&["vertex_indices", "vertex_index"])?;
        element.properties[column].list.map(|_| (kind, column))
    }
}

/// The faces of a file.
#[derive(Debug, Default)]
pub(super) struct Faces {
    triangles: Vec<[u32; 3]>,
    /// Corners of faces with more than three.
    corners: Vec<u32>,
    /// Positions in `corners` at which each of those ends.
    ends: Vec<usize>,
}

impl Faces {
    /// From triangles alone.
    pub(super) fn from_triangles(triangles: Vec<[u32; 3]>) -> Self {
        Self { triangles, ..Self::default() }
    }

    /// Adds one list. Indices below zero are given as the two's complement.
    pub(super) fn push(&mut self, lists: Lists, corners: &[u32]) {
        match (lists, corners) {
            (Lists::Strips, _) => {
                for strip in corners.split(|&corner| corner == u32::MAX) {
                    self.triangles.extend(strip.windows(3).enumerate().map(|(i, t)| {
                        if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] }
                    }));
                }
            }
            (Lists::Polygons, &[a, b, c]) => self.triangles.push([a, b, c]),
            (Lists::Polygons, [_, _, _, _, ..]) => {
                self.corners.extend_from_slice(corners);
                self.ends.push(self.corners.len());
            }
            (Lists::Polygons, _) => {}
        }
    }

    /// Adds what another part of the file has.
    pub(super) fn append(&mut self, mut other: Self) {
        let before = self.corners.len();
        self.triangles.append(&mut other.triangles);
        self.corners.append(&mut other.corners);
        self.ends.extend(other.ends.iter().map(|end| before + end));
    }

    /// Bytes of the triangles that polygons are cut into.
    pub(super) fn bytes_to_cut(&self) -> u64 {
        let triangles = self.corners.len().saturating_sub(2 * self.ends.len());
        (triangles * size_of::<[u32; 3]>()) as u64
    }

    /// All faces as triangles: triangles in the order of the file, then those of polygons.
    pub(super) fn triangles(mut self, positions: &Positions) -> Buffer<[u32; 3]> {
        let mut start = 0;
        let mut cut = Vec::new();
        for &end in &self.ends {
            let corners = &self.corners[start..end];
            start = end;
            // What does not exist is refused where all triangles are checked.
            let point = |&corner: &u32| match corner as usize {
                corner if corner < positions.len() => positions.get(corner),
                _ => DVec3::NAN,
            };
            let points: Vec<DVec3> = corners.iter().map(point).collect();
            cut.clear();
            polygon::triangulate(&points, &mut cut);
            self.triangles.extend(cut.iter().map(|t| t.map(|corner| corners[corner as usize])));
        }
        self.triangles.into()
    }
}
