//! The vertices of a PLY file, from a table of numbers.

use etendue_geometry::{Positions, Vertices};
use rayon::prelude::*;

use super::header::{Element, Type};
use crate::import::Wanted;
use crate::import::precision::{precise_enough, single};

/// Numbers by row and by property of the vertex element.
pub(super) trait Table: Sync {
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

/// Which properties are read.
#[derive(Debug, Clone)]
pub(super) struct Columns {
    xyz: [usize; 3],
    normal: Option<[usize; 3]>,
    uv: Option<[usize; 2]>,
    color: Option<[usize; 3]>,
    /// Positions have more digits than f32.
    in_f64: bool,
    /// Colours are bytes.
    byte_color: bool,
}

impl Columns {
    /// The wanted properties of `element`; an error without x, y and z.
    pub(super) fn of(element: &Element, wanted: Wanted, in_text: bool) -> Result<Self, String> {
        let plain = |names: &[&str]| {
            element.find(names).filter(|&column| element.properties[column].list.is_none())
        };
        let all = |names: [&[&str]; 3]| {
            let [a, b, c] = names.map(plain);
            Some([a?, b?, c?])
        };
        let Some(xyz) = all([&["x"], &["y"], &["z"]]) else {
            return Err("the vertices have no x, y and z; export the file again".to_owned());
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
    pub(super) fn read(&self, table: &impl Table) -> VertexData {
        VertexData {
            positions: self.positions(table),
            normals: self.normal.map(|columns| singles(table, columns)),
            uvs: self.uv.map(|[u, v]| {
                each(table, |row| [single(table.get(row, u)), single(1.0 - table.get(row, v))])
            }),
            colors: self.color.map(|columns| self.colors(table, columns)),
        }
    }

    fn positions(&self, table: &impl Table) -> Positions {
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

    fn colors(&self, table: &impl Table, columns: [usize; 3]) -> Vertices<4> {
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

fn singles(table: &impl Table, columns: [usize; 3]) -> Vertices<3> {
    each(table, |row| columns.map(|column| single(table.get(row, column))))
}

/// `N` floats for each row, with the padding that Embree wants behind them.
fn each<const N: usize>(
    table: &impl Table,
    values: impl Fn(usize) -> [f32; N] + Sync,
) -> Vertices<N> {
    let mut floats = vec![0.0; table.rows() * N + 4];
    floats[..table.rows() * N]
        .par_chunks_exact_mut(N)
        .enumerate()
        .for_each(|(row, to)| to.copy_from_slice(&values(row)));
    Vertices::new(floats.into(), N, table.rows()).unwrap_or_else(|| Vertices::from_arrays(&[]))
}
