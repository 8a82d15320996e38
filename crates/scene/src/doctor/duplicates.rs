//! Triangles that a mesh has twice.

use etendue_geometry::{Mesh, Positions};
use rayon::prelude::*;

/// How many triangles of `mesh` have the same three corners, in any order, as an earlier one.
/// Corners are the same when their coordinates are, whatever their indices.
pub(super) fn count(mesh: &Mesh) -> u64 {
    let same_as = representatives(&mesh.positions);
    let mut triangles: Vec<[u32; 3]> = mesh
        .triangles
        .par_iter()
        .map(|triangle| {
            let mut corners = triangle.map(|corner| same_as[corner as usize]);
            corners.sort_unstable();
            corners
        })
        .collect();
    triangles.par_sort_unstable();
    triangles.par_windows(2).filter(|pair| pair[0] == pair[1]).count() as u64
}

/// For each vertex one that stands for all at its place.
fn representatives(positions: &Positions) -> Vec<u32> {
    // Loaders keep indices in u32, so no mesh has a vertex beyond it that a triangle could use.
    let len = u32::try_from(positions.len()).unwrap_or(u32::MAX);
    // Adding zero turns −0 into 0; NaN vertices, which no triangle uses, have bits like any other.
    let key = |vertex: u32| positions.get(vertex as usize).to_array().map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..len).collect();
    order.par_sort_unstable_by_key(|&vertex| key(vertex));
    let mut same_as = vec![0; len as usize];
    let mut first = 0;
    for (rank, &vertex) in order.iter().enumerate() {
        if rank == 0 || key(order[rank - 1]) != key(vertex) {
            first = vertex;
        }
        same_as[vertex as usize] = first;
    }
    same_as
}

#[cfg(test)]
mod tests {
    use etendue_geometry::Vertices;

    use super::*;

    #[test]
    fn the_same_corners_by_any_index_in_any_order() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.0, 0.0, 0.0]];
        let count_of = |triangles: Vec<[u32; 3]>| {
            let positions = Positions::F32(Vertices::from_arrays(&corners));
            count(&Mesh::new("", positions, triangles.into()))
        };
        assert_eq!(count_of(vec![[0, 1, 2]]), 0);
        assert_eq!(count_of(vec![[0, 1, 2], [2, 1, 0], [1, 2, 3]]), 2);
        assert_eq!(count_of(vec![[0, 1, 2], [0, 1, 1]]), 0);
        assert_eq!(count_of(Vec::new()), 0);
    }
}
