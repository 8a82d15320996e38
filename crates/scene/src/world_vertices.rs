//! The tight box around a scene, and how far its vertices reach in any direction.

use std::collections::BTreeSet;

use rayon::prelude::*;

use crate::shape::GoOn;
use etendue_camera::SupportFunction;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{AreaTest, Bounds, Geometry, Mesh, Placement};

/// The tight box around all triangles in world space (m).
///
/// A placement whose loose box (around the eight corners of its mesh's own) lies inside the tight
/// box found so far cannot widen it and is not visited. Those that reach farthest go first, so of a
/// forest of instances only the trees at its edges are looked at.
pub(crate) fn tight(vertices: WorldVertices<'_>) -> Bounds {
    let geometry = vertices.geometry;
    let placements = &geometry.placements;
    let all: Vec<(Bounds, &Placement)> = placements
        .par_iter()
        .map(|placement| (geometry.loose_bounds_of(placement), placement))
        .filter(|(bounds, _)| !bounds.is_empty())
        .collect();
    let mut bounds = Bounds::EMPTY;
    for axis in 0..3 {
        let least = all.iter().min_by(|(a, _), (b, _)| a.min[axis].total_cmp(&b.min[axis]));
        let most = all.iter().max_by(|(a, _), (b, _)| a.max[axis].total_cmp(&b.max[axis]));
        for (_, placement) in least.into_iter().chain(most) {
            bounds = bounds.union(exact(vertices, placement));
        }
    }
    let beyond = |loose: &Bounds, bounds: &Bounds| {
        (bounds.min - loose.min).max_element().max((loose.max - bounds.max).max_element())
    };
    let mut open: Vec<(f64, &Bounds, &Placement)> =
        all.iter().map(|(loose, p)| (beyond(loose, &bounds), loose, *p)).collect();
    open.retain(|(beyond, ..)| *beyond > 0.0);
    open.sort_by(|(a, ..), (b, ..)| b.total_cmp(a));
    for (_, loose, placement) in open {
        if beyond(loose, &bounds) > 0.0 {
            bounds = bounds.union(exact(vertices, placement));
        }
    }
    bounds
}

/// The vertices of all triangles in world space, as a camera that frames them asks.
#[derive(Clone, Copy)]
pub(crate) struct WorldVertices<'a> {
    pub(crate) geometry: &'a Geometry,
    /// Once it says no, what is left is passed over, and what was found means nothing.
    pub(crate) go_on: GoOn<'a>,
}

impl<'a> From<&'a Geometry> for WorldVertices<'a> {
    /// To the end.
    fn from(geometry: &'a Geometry) -> Self {
        Self { geometry, go_on: &|| true }
    }
}

impl SupportFunction for WorldVertices<'_> {
    /// Visits the placements that may reach farthest first, and no other once their boxes do not.
    fn support(&self, origin: DVec3, directions: &[DVec3]) -> Vec<f64> {
        let geometry = self.geometry;
        let mut most = vec![f64::NEG_INFINITY; directions.len()];
        let boxes: Vec<Vec<f64>> = geometry
            .placements
            .par_iter()
            .map(|placement| match geometry.loose_bounds_of(placement) {
                bounds if bounds.is_empty() => Vec::new(),
                bounds => bounds.support(origin, directions),
            })
            .collect();
        let beyond =
            |reach: &[f64], most: &[f64]| reach.iter().zip(most).any(|(reach, most)| reach > most);
        let first = (0..directions.len()).filter_map(|k| {
            let reaches = boxes.iter().enumerate().filter(|(_, reach)| !reach.is_empty());
            reaches.max_by(|(_, a), (_, b)| a[k].total_cmp(&b[k])).map(|(index, _)| index)
        });
        let first: BTreeSet<usize> = first.collect();
        let rest = (0..boxes.len()).filter(|index| !first.contains(index));
        for index in first.iter().copied().chain(rest) {
            if beyond(&boxes[index], &most) {
                let found = farthest(*self, &geometry.placements[index], origin, directions);
                most.iter_mut().zip(found).for_each(|(most, found)| *most = most.max(found));
            }
        }
        most
    }
}

/// The support function of one placement's triangles.
fn farthest(
    vertices: WorldVertices<'_>,
    placement: &Placement,
    origin: DVec3,
    directions: &[DVec3],
) -> Vec<f64> {
    const CHUNK: usize = 1 << 15;
    let mesh = vertices.geometry.mesh_of(placement);
    let none = || vec![f64::NEG_INFINITY; directions.len()];
    let chunks = corners_with_area(mesh, placement, CHUNK, vertices.go_on).map(|corners| {
        let mut most = none();
        for corner in corners {
            let local = mesh.positions.get(corner as usize);
            let point = placement.world_from_mesh.point_from(local, origin);
            for (most, direction) in most.iter_mut().zip(directions) {
                *most = most.max(point.dot(*direction));
            }
        }
        most
    });
    chunks.reduce(none, |mut a, b| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a = a.max(b));
        a
    })
}

/// The corners of the triangles that have an area where the mesh is placed, in chunks of so many triangles.
fn corners_with_area<'a>(
    mesh: &'a Mesh,
    placement: &'a Placement,
    chunk: usize,
    go_on: GoOn<'a>,
) -> impl ParallelIterator<Item = impl Iterator<Item = u32> + 'a> + 'a {
    let test = AreaTest::under(mesh, &placement.world_from_mesh.linear);
    let keeps_all = test.keeps_all();
    mesh.triangles.par_chunks(chunk).enumerate().map(move |(number, triangles)| {
        let kept = if go_on() { triangles } else { &[] }.iter().enumerate();
        let kept = kept.filter(move |(k, _)| keeps_all || test.keeps(number * chunk + k));
        kept.flat_map(|(_, triangle)| *triangle)
    })
}

fn exact(vertices: WorldVertices<'_>, placement: &Placement) -> Bounds {
    const CHUNK: usize = 1 << 16;
    let mesh = vertices.geometry.mesh_of(placement);
    if placement.world_from_mesh.is_identity() {
        return mesh.bounds;
    }
    let boxes = corners_with_area(mesh, placement, CHUNK, vertices.go_on).map(|corners| {
        let mut bounds = Bounds::EMPTY;
        for corner in corners {
            bounds.include(placement.world_from_mesh.point(mesh.positions.get(corner as usize)));
        }
        bounds
    });
    boxes.reduce(Bounds::default, Bounds::union)
}

#[cfg(test)]
mod tests {
    use super::*;
    use etendue_geometry::glam::{DMat3, DQuat};
    use etendue_geometry::{Positions, Transform, Vertices};

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
            Placement::of(0, Transform::new(turned, at))
        };
        Geometry {
            meshes: vec![Mesh::new("", positions, vec![[0, 1, 2]].into())],
            placements: (0..count).map(place).collect(),
        }
    }

    #[test]
    fn support_is_that_of_every_corner() {
        let directions = [DVec3::X, DVec3::new(-0.3, 0.9, 0.4), DVec3::new(0.1, -1.0, 2.0)];
        let geometry = needles(200);
        let origin = DVec3::new(1.0, 2.0, 3.0);
        let mut expected = [f64::NEG_INFINITY; 3];
        for placement in &geometry.placements {
            for corner in geometry.meshes[0].corners(0) {
                let point = placement.world_from_mesh.point(corner) - origin;
                for (most, d) in expected.iter_mut().zip(directions) {
                    *most = most.max(point.dot(d));
                }
            }
        }
        let found = WorldVertices::from(&geometry).support(origin, &directions);
        for (found, expected) in found.iter().zip(expected) {
            // A few roundings of numbers near 10.
            assert!((found - expected).abs() < 1e-13, "{found} {expected}");
        }
        assert_eq!(
            WorldVertices::from(&Geometry::default()).support(origin, &[DVec3::X]),
            [f64::NEG_INFINITY]
        );
    }

    #[test]
    fn passing_over_placements_changes_nothing() {
        for count in [0, 1, 2, 500] {
            let geometry = needles(count);
            assert_eq!(tight((&geometry).into()), geometry.bounds(), "{count} placements");
        }
        let geometry = needles(500);
        let loose = geometry.loose_bounds();
        assert!(
            loose.diagonal() > tight((&geometry).into()).diagonal(),
            "the test can tell them apart"
        );
    }
}
