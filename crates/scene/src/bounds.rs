//! The tight box around a scene.

use etendue_geometry::{Bounds, Geometry, Placement};
use rayon::prelude::*;

/// The tight box around all triangles in world space (m).
///
/// A placement whose loose box (around the eight corners of its mesh's own) lies inside the tight
/// box found so far cannot widen it and is not visited, so a forest of instances costs a few trees.
pub(crate) fn tight(geometry: &Geometry) -> Bounds {
    let mut open: Vec<(Bounds, &Placement)> = geometry
        .placements
        .iter()
        .map(|placement| (loose(geometry, placement), placement))
        .filter(|(bounds, _)| !bounds.is_empty())
        .collect();
    open.sort_by(|(a, _), (b, _)| b.diagonal().total_cmp(&a.diagonal()));
    let mut bounds = Bounds::EMPTY;
    for (around, placement) in open {
        let inside = around.min.cmpge(bounds.min).all() && around.max.cmple(bounds.max).all();
        if !inside {
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
