//! Rays against edges and triangles in double precision: those that single precision leaves in doubt.

use etendue_geometry::RayBlock;
use etendue_geometry::block::vector;
use etendue_geometry::glam::DVec3;

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

/// The ray of a lane.
struct LaneRay {
    origin: DVec3,
    direction: DVec3,
    moment: DVec3,
    t_min: f64,
    t_max: f64,
}

impl LaneRay {
    fn of(block: &RayBlock, lane: usize) -> Self {
        let (origin, direction) = (vector(&block.origin, lane), vector(&block.direction, lane));
        let [t_min, t_max] = [block.t_min[lane], block.t_max[lane]].map(f64::from);
        Self { origin, direction, moment: origin.cross(direction), t_min, t_max }
    }
}

/// A hit on a triangle of the list: its number, distance (m), and weights of the second and third corners.
pub(super) struct TriangleHit {
    pub(super) number: usize,
    pub(super) t: f64,
    pub(super) weights: [f64; 2],
}

impl FewTriangle {
    /// The distance (m) and weights with which a line meets it between its ends.
    fn hit(&self, edges: &[PluckerEdge], line: &LaneRay) -> Option<(f64, [f64; 2])> {
        let mut sides = self.lengths;
        for (side, &edge) in sides.iter_mut().zip(&self.edges) {
            // The distance of the lines times the sine of their angle (m): the same of both triangles of an edge.
            let PluckerEdge { along, moment } = &edges[edge];
            *side *= line.direction.dot(*moment) + line.moment.dot(*along);
        }
        if !(sides.iter().all(|&side| side >= 0.0) || sides.iter().all(|&side| side <= 0.0)) {
            return None;
        }
        let height = (self.corner - line.origin).dot(self.normal);
        let t = height / line.direction.dot(self.normal);
        let over = 1.0 / (sides[0] + sides[1] + sides[2]);
        // A line in the triangle's plane meets it nowhere.
        let is_between = t > line.t_min && t <= line.t_max && t <= f64::MAX;
        is_between.then(|| (t, [sides[1] * over, sides[2] * over]))
    }
}

/// The closest hit of the ray of a lane; of those in one place the last.
pub(super) fn closest(
    edges: &[PluckerEdge],
    triangles: &[FewTriangle],
    block: &RayBlock,
    lane: usize,
) -> Option<TriangleHit> {
    let (mut line, mut nearest) = (LaneRay::of(block, lane), None);
    for (number, triangle) in triangles.iter().enumerate() {
        let Some((t, weights)) = triangle.hit(edges, &line) else { continue };
        nearest = Some(TriangleHit { number, t, weights });
        line.t_max = t;
    }
    nearest
}

/// Tests whether anything is between the ends of the ray of a lane.
pub(super) fn is_occluded(
    edges: &[PluckerEdge],
    triangles: &[FewTriangle],
    block: &RayBlock,
    lane: usize,
) -> bool {
    let line = LaneRay::of(block, lane);
    triangles.iter().any(|triangle| triangle.hit(edges, &line).is_some())
}
