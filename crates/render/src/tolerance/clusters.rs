//! Meshes of fewer triangles: of corners that lie together within a cell of a grid, one is left, the mean of them, and of
//! triangles those whose corners are in three cells (J. Rossignac & P. Borrel, "Multi-resolution 3D approximations for
//! rendering complex scenes", 1993).
//!
//! Where a mesh ends, the mean is that of the corners on its border alone, which it would draw inwards else.

use std::collections::HashMap;

use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Mesh, Positions, Vertices};

/// `mesh` with one corner a cell of this side (m, of its own frame); `None` where that would leave a quarter of its
/// triangles or more.
pub(super) fn clustered(mesh: &Mesh, side: f64) -> Option<Mesh> {
    let extent = mesh.bounds.max - mesh.bounds.min;
    let faces = extent.x * extent.y + extent.y * extent.z + extent.z * extent.x;
    // A surface through a cell leaves some two triangles there; a box has each of its faces twice.
    let expected = 4.0 * faces / (side * side);
    let is_coarse = side.is_finite() && expected < 0.25 * mesh.triangles.len() as f64;
    if !is_coarse || mesh.bounds.is_empty() {
        return None;
    }
    let cells = CubeGrid::over(&mesh.bounds, side);
    let mut clusters = VertexClusters::new(&cells, mesh.positions.len());
    let of_corner: Vec<u32> = (0..mesh.positions.len())
        .map(|i| {
            let normal =
                mesh.normals.as_ref().map(|normals| DVec3::from(normals.get(i).map(f64::from)));
            clusters.add(cells.of(mesh.positions.get(i)), mesh.positions.get(i), normal)
        })
        .collect();
    // Those that keep three cells apart, each once, from its least cell on.
    let mut triangles: Vec<[[u32; 3]; 2]> = mesh
        .triangles
        .iter()
        .filter_map(|triangle| {
            let corners = triangle.map(|corner| of_corner[corner as usize]);
            let cells @ [a, b, c] = corners.map(|corner| clusters.cell_of(corner));
            let first = match a.min(b).min(c) {
                least if least == a => 0,
                least if least == b => 1,
                _ => 2,
            };
            let turned = |of: [u32; 3]| [0, 1, 2].map(|k| of[(first + k) % 3]);
            (a != b && b != c && c != a).then(|| [turned(cells), turned(corners)])
        })
        .collect();
    triangles.sort_unstable();
    triangles.dedup_by_key(|[cells, _]| *cells);
    if triangles.len() >= mesh.triangles.len() / 4 {
        return None;
    }
    clusters.keep_borders(mesh, &of_corner, &triangles);
    let triangles: Vec<[u32; 3]> = triangles.into_iter().map(|[_, corners]| corners).collect();
    let positions = clusters.positions(&mesh.positions);
    let mut less = Mesh::new(mesh.name.clone(), positions, triangles.into());
    less.normals = mesh.normals.as_ref().map(|_| clusters.normals());
    Some(less)
}

/// A grid of cubes over a box.
struct CubeGrid {
    origin: DVec3,
    side: f64,
    /// Columns, rows and layers.
    counts: [u64; 3],
}

impl CubeGrid {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 2²⁰")]
    fn over(bounds: &Bounds, side: f64) -> Self {
        let extent = (bounds.max - bounds.min) / side;
        let counts = extent.to_array().map(|cells| (cells.floor() as u64 + 1).min(1 << 20));
        Self { origin: bounds.min, side, counts }
    }

    /// All of them, and one for what is no point.
    fn len(&self) -> u64 {
        self.counts.iter().product::<u64>() + 1
    }

    /// The number of a point's cell. Those outside of the box, which no triangle with an area has, are in its outermost
    /// cells.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it saturates")]
    fn of(&self, point: DVec3) -> u64 {
        if !point.is_finite() {
            return self.len() - 1;
        }
        let cell = ((point - self.origin) / self.side).to_array();
        let [x, y, z] = [0, 1, 2].map(|k| (cell[k].max(0.0) as u64).min(self.counts[k] - 1));
        (z * self.counts[1] + y) * self.counts[0] + x
    }
}

/// By cell, the number of what is in it.
enum NumberOfCell {
    /// Of all cells, where they are not many more than what is put into them.
    Dense(Vec<u32>),
    Sparse(HashMap<u64, u32>),
}

/// None yet.
const NONE: u32 = u32::MAX;

/// Corners that were put together.
struct VertexClusters {
    number: NumberOfCell,
    /// Of each cell the corner for each way that normals point ([`facing`]); without normals the first alone.
    corners: Vec<[u32; 6]>,
    /// Sums of the places in each cell, and how many.
    places: Vec<(DVec3, f64)>,
    /// The cell of each corner, and the sum of its normals.
    of_corner: Vec<(u32, DVec3)>,
}

impl VertexClusters {
    /// For so many corners in the cells of a grid.
    fn new(cells: &CubeGrid, corners: usize) -> Self {
        let number = match usize::try_from(cells.len()) {
            Ok(count) if count <= 4 * corners => NumberOfCell::Dense(vec![NONE; count]),
            _ => NumberOfCell::Sparse(HashMap::new()),
        };
        Self { number, corners: Vec::new(), places: Vec::new(), of_corner: Vec::new() }
    }

    /// Adds a corner: where it went. Normals of both sides of a sheet are kept apart.
    #[expect(clippy::cast_possible_truncation, reason = "a mesh has fewer than 2³² corners")]
    fn add(&mut self, cell: u64, place: DVec3, normal: Option<DVec3>) -> u32 {
        let known = match &mut self.number {
            NumberOfCell::Dense(numbers) => &mut numbers[cell as usize],
            NumberOfCell::Sparse(numbers) => numbers.entry(cell).or_insert(NONE),
        };
        if *known == NONE {
            *known = self.places.len() as u32;
            self.places.push((DVec3::ZERO, 0.0));
            self.corners.push([NONE; 6]);
        }
        let number = *known;
        let (sum, count) = &mut self.places[number as usize];
        *sum += place;
        *count += 1.0;
        let corner = &mut self.corners[number as usize][normal.map_or(0, facing)];
        if *corner == NONE {
            *corner = self.of_corner.len() as u32;
            self.of_corner.push((number, DVec3::ZERO));
        }
        self.of_corner[*corner as usize].1 += normal.unwrap_or_default();
        *corner
    }

    fn cell_of(&self, corner: u32) -> u32 {
        self.of_corner[corner as usize].0
    }

    /// Moves each cell at the end of the coarser triangles, of these cells and corners, to the mean
    /// of the places of its corners on the border of the mesh.
    fn keep_borders(&mut self, mesh: &Mesh, of_corner: &[u32], triangles: &[[[u32; 3]; 2]]) {
        let mut is_border = vec![false; self.places.len()];
        let coarse = edges_of_one(triangles.iter().flat_map(|[cells, _]| edges(*cells)));
        if coarse.is_empty() {
            return;
        }
        coarse.iter().flatten().for_each(|&cell| is_border[cell as usize] = true);
        let cell = |corner: u32| self.cell_of(of_corner[corner as usize]) as usize;
        // Both triangles at an edge that ends in such a cell are among those that do.
        let near = mesh
            .triangles
            .iter()
            .filter(|triangle| triangle.iter().any(|&corner| is_border[cell(corner)]));
        let mut places = vec![(DVec3::ZERO, 0.0); self.places.len()];
        for &corner in edges_of_one(near.flat_map(|triangle| edges(*triangle))).iter().flatten() {
            let (sum, count) = &mut places[cell(corner)];
            *sum += mesh.positions.get(corner as usize);
            *count += 1.0;
        }
        let on_border = places.into_iter().zip(is_border).enumerate();
        for (cell, (place, _)) in on_border.filter(|(_, (place, is))| *is && place.1 > 0.0) {
            self.places[cell] = place;
        }
    }

    /// In the precision of those that were put together.
    fn positions(&self, before: &Positions) -> Positions {
        let places = self.of_corner.iter().map(|(cell, _)| {
            let (sum, count) = self.places[*cell as usize];
            sum / count
        });
        match before {
            Positions::F32(_) => {
                let places = places.map(|place| place.as_vec3().to_array());
                Positions::F32(Vertices::from_arrays(&places.collect::<Vec<_>>()))
            }
            Positions::F64(_) => {
                Positions::F64(places.map(|place| place.to_array()).collect::<Vec<_>>().into())
            }
        }
    }

    fn normals(&self) -> Vertices<3> {
        let normals =
            self.of_corner.iter().map(|(_, sum)| sum.normalize_or_zero().as_vec3().to_array());
        Vertices::from_arrays(&normals.collect::<Vec<_>>())
    }
}

/// The edges of a triangle, each from its lower corner.
fn edges([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)])
}

/// Those that occur once.
fn edges_of_one(edges: impl Iterator<Item = [u32; 2]>) -> Vec<[u32; 2]> {
    let mut edges: Vec<[u32; 2]> = edges.collect();
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).filter(|same| same.len() == 1).map(|same| same[0]).collect()
}

/// Along which axis a normal points most, and to which side of it: a number below 6.
fn facing(normal: DVec3) -> usize {
    let size = normal.abs();
    let axis = match size.max_element() {
        most if most == size.x => 0,
        most if most == size.y => 1,
        _ => 2,
    };
    2 * axis + usize::from(normal[axis] < 0.0)
}

/// The area of all triangles of a mesh (m², of its own frame).
pub(super) fn area(mesh: &Mesh) -> f64 {
    let of_one = |i: usize| {
        let [a, b, c] = mesh.corners(i);
        0.5 * (b - a).cross(c - a).length()
    };
    (0..mesh.triangles.len()).map(of_one).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A waved square of 200 × 200 in 40 × 40 cells keeps its border and its area, and a place of each cell is in the
    /// cell. Means of all corners there would draw the border in by half a cell: 5 % of the area.
    #[test]
    fn an_open_mesh_keeps_its_border() {
        let side = 200_u32;
        let corner = |i: u32| {
            let [x, y] = [i % (side + 1), i / (side + 1)].map(|k| k as f32 / side as f32);
            [x, y, 0.01 * (6.0 * x).sin()]
        };
        let corners: Vec<[f32; 3]> = (0..(side + 1).pow(2)).map(corner).collect();
        let square = |k: u32| {
            let i = k / side * (side + 1) + k % side;
            [[i, i + 1, i + side + 2], [i, i + side + 2, i + side + 1]]
        };
        let triangles: Vec<[u32; 3]> = (0..side * side).flat_map(square).collect();
        let positions = Positions::F32(Vertices::from_arrays(&corners));
        let mesh = Mesh::new("sheet", positions, triangles.into());
        let cell = 0.025 - 1e-6;
        let less = clustered(&mesh, cell).unwrap();
        assert!(less.triangles.len() < 5000, "{}", less.triangles.len());
        let change = area(&less) / area(&mesh) - 1.0;
        // The four outermost corners lose a quarter of a cell each.
        assert!(change.abs() < 2e-3, "{change}");
        let [own, others] = [&mesh, &less].map(|mesh| mesh.bounds);
        assert!((own.max - others.max).abs().max_element() < 0.01 * cell, "{others:?}");
        assert!((own.min - others.min).abs().max_element() < 0.01 * cell, "{others:?}");
    }
}
