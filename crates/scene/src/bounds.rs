//! The tight box around a scene.

use etendue_geometry::{Bounds, Geometry, Placement};
use rayon::prelude::*;

/// The tight box around all triangles in world space (m).
///
/// A placement whose loose box (around the eight corners of its mesh's own) lies inside the tight
/// box found so far cannot widen it and is not visited. Those that reach farthest go first, so of a
/// forest of instances only the trees at its edges are looked at.
pub(crate) fn tight(geometry: &Geometry) -> Bounds {
    let placements = &geometry.placements;
    let all: Vec<(Bounds, &Placement)> = placements
        .par_iter()
        .map(|placement| (loose(geometry, placement), placement))
        .filter(|(bounds, _)| !bounds.is_empty())
        .collect();
    let mut bounds = Bounds::EMPTY;
    for axis in 0..3 {
        let least = all.iter().min_by(|(a, _), (b, _)| a.min[axis].total_cmp(&b.min[axis]));
        let most = all.iter().max_by(|(a, _), (b, _)| a.max[axis].total_cmp(&b.max[axis]));
        for (_, placement) in least.into_iter().chain(most) {
            bounds = bounds.union(exact(geometry, placement));
        }
    }
    let beyond = |around: &Bounds, bounds: &Bounds| {
        (bounds.min - around.min).max_element().max((around.max - bounds.max).max_element())
    };
    let mut open: Vec<(f64, &Bounds, &Placement)> =
        all.iter().map(|(around, p)| (beyond(around, &bounds), around, *p)).collect();
    open.retain(|(beyond, ..)| *beyond > 0.0);
    open.sort_by(|(a, ..), (b, ..)| b.total_cmp(a));
    for (_, around, placement) in open {
        if beyond(around, &bounds) > 0.0 {
            bounds = bounds.union(exact(geometry, placement));
        }
    }
    bounds
}

fn loose(geometry: &Geometry, placement: &Placement) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    let local = geometry.mesh_of(placement).bounds;
    if !local.is_empty() {
        for corner in local.corners() {
            bounds.include(placement.world_from_mesh.point(corner));
        }
    }
    bounds
}

fn exact(geometry: &Geometry, placement: &Placement) -> Bounds {
    const CHUNK: usize = 1 << 16;
    let mesh = geometry.mesh_of(placement);
    if placement.world_from_mesh.is_identity() {
        return mesh.bounds;
    }
    let boxes = mesh.triangles.par_chunks(CHUNK).map(|triangles| {
        let mut bounds = Bounds::EMPTY;
        for &corner in triangles.iter().flatten() {
            bounds.include(placement.world_from_mesh.point(mesh.positions.get(corner as usize)));
        }
        bounds
    });
    boxes.reduce(Bounds::default, Bounds::union)
}

#[cfg(test)]
mod tests {
    use etendue_geometry::glam::{DMat3, DQuat, DVec3};
    use etendue_geometry::{Mesh, Positions, Transform, Vertices};

    use super::*;

    /// Needles along the diagonal, whose own boxes are far from tight once they are turned.
    fn needles(count: u32) -> Geometry {
        let corners = [[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 0.9]];
        let positions = Positions::F32(Vertices::from_arrays(&corners));
        let place = |i: u32| {
            let i = f64::from(i);
            let turned = DMat3::from_quat(DQuat::from_euler(
                etendue_geometry::glam::EulerRot::XYZ,
                0.7 * i,
                1.3 * i,
                2.1 * i,
            ));
            let at = DVec3::new((37.0 * i) % 11.0, (53.0 * i) % 7.0, (71.0 * i) % 5.0);
            Placement {
                mesh: 0,
                object: 0,
                material: 0,
                world_from_mesh: Transform::new(turned, at),
            }
        };
        Geometry {
            meshes: vec![Mesh::new("", positions, vec![[0, 1, 2]].into())],
            placements: (0..count).map(place).collect(),
        }
    }

    #[test]
    fn passing_over_placements_changes_nothing() {
        for count in [0, 1, 2, 500] {
            let geometry = needles(count);
            assert_eq!(tight(&geometry), geometry.bounds(), "{count} placements");
        }
        let geometry = needles(500);
        let loose = geometry.loose_bounds();
        assert!(loose.diagonal() > tight(&geometry).diagonal(), "the test can tell them apart");
    }
}
