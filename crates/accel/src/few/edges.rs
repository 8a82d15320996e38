//! Rays against edges and triangles in double precision: those that single precision leaves in doubt.

use etendue_geometry::RayBlock;
use etendue_geometry::block::vector;
use etendue_geometry::glam::DVec3;

use super::FewTriangles;

/// An edge, by its Plücker coordinates in the frame, the direction a unit vector.
#[derive(Debug, Clone, Copy)]
pub(super) struct PluckerEdge {
    along: DVec3,
    moment: DVec3,
}

impl PluckerEdge {
    pub(super) fn between(from: DVec3, to: DVec3) -> Self {
        let along = (to - from).normalize();
        Self { along, moment: from.cross(along) }
    }
}

/// A triangle in the frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct FewTriangle {
    /// Numbers of the edges opposite to its corners.
    pub(super) edges: [usize; 3],
    /// Their lengths (m), with the sign with which each is one of its own.
    pub(super) lengths: [f64; 3],
    /// Normal on the front where the corners run counter-clockwise, as long as twice the area.
    pub(super) normal: DVec3,
    /// A corner.
    pub(super) corner: DVec3,
}

/// A hit on a triangle of the list: its number, distance (m), and weights of the second and third corners.
pub(super) struct Hit {
    pub(super) number: usize,
    pub(super) t: f64,
    pub(super) weights: [f64; 2],
}

/// The hits of the ray of a lane with triangles in turn, each no farther than those before where `is_closest`.
fn hits(few: &FewTriangles, block: &RayBlock, lane: usize, is_closest: bool) -> Option<Hit> {
    let (origin, direction) = (vector(&block.origin, lane), vector(&block.direction, lane));
    let moment = origin.cross(direction);
    let [t_min, mut t_max] = [&block.t_min, &block.t_max].map(|limits| f64::from(limits[lane]));
    let mut nearest = None;
    for (number, triangle) in few.triangles.iter().enumerate() {
        let mut sides = triangle.lengths;
        for (side, &edge) in sides.iter_mut().zip(&triangle.edges) {
            // The distance of the lines times the sine of their angle (m): the same of both triangles of an edge.
            let PluckerEdge { along, moment: of_edge } = &few.edges[edge];
            *side *= direction.dot(*of_edge) + moment.dot(*along);
        }
        if !(sides.iter().all(|&side| side >= 0.0) || sides.iter().all(|&side| side <= 0.0)) {
            continue;
        }
        let height = (triangle.corner - origin).dot(triangle.normal);
        let t = height / direction.dot(triangle.normal);
        // A ray in the triangle's plane meets it nowhere.
        if t > t_min && t <= t_max && t <= f64::MAX {
            let over = 1.0 / (sides[0] + sides[1] + sides[2]);
            nearest = Some(Hit { number, t, weights: [sides[1] * over, sides[2] * over] });
            if !is_closest {
                break;
            }
            t_max = t;
        }
    }
    nearest
}

/// The closest hit of the ray of a lane; of those in one place the last.
pub(super) fn closest(few: &FewTriangles, block: &RayBlock, lane: usize) -> Option<Hit> {
    hits(few, block, lane, true)
}

/// Whether anything is between the ends of the ray of a lane.
pub(super) fn is_occluded(few: &FewTriangles, block: &RayBlock, lane: usize) -> bool {
    hits(few, block, lane, false).is_some()
}
