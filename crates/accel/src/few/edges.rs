//! Rays against edges and triangles in double precision: those that single precision leaves in doubt.

use etendue_geometry::RayBlock;
use etendue_geometry::block::vector;
use etendue_geometry::glam::DVec3;

/// Scenes of more triangles are traced by trees.
pub(super) const MOST_TRIANGLES: usize = 64;

/// Edges held against a line side by side.
const WIDTH: usize = 8;

/// Edges by their Plücker coordinates in the frame, the directions unit vectors.
#[derive(Debug, Clone, Copy, Default)]
struct EdgeBlock {
    along: [[f64; WIDTH]; 3],
    moment: [[f64; WIDTH]; 3],
}

/// The edges of a scene of few triangles.
#[derive(Debug, Default)]
pub(super) struct PluckerEdges {
    blocks: Vec<EdgeBlock>,
    pub(super) count: usize,
}

/// The distances of a line from all edges, times the sines of their angles (m): the same of both triangles of an edge.
type EdgeSides = [[f64; WIDTH]; 3 * MOST_TRIANGLES / WIDTH];

impl PluckerEdges {
    /// Appends the edge between two corners, and returns its number.
    pub(super) fn push(&mut self, from: DVec3, to: DVec3) -> usize {
        let (number, lane) = (self.count, self.count % WIDTH);
        if lane == 0 {
            self.blocks.push(EdgeBlock::default());
        }
        self.count += 1;
        let direction = (to - from).normalize();
        let moment = from.cross(direction);
        let EdgeBlock { along, moment: moments } = &mut self.blocks[number / WIDTH];
        for axis in 0..3 {
            (along[axis][lane], moments[axis][lane]) = (direction[axis], moment[axis]);
        }
        number
    }
}

/// Holds a line against all edges.
#[multiversion::multiversion(targets = "simd")]
fn sides_of(edges: &[EdgeBlock], line: &LaneRay, sides: &mut EdgeSides) {
    let ([dx, dy, dz], [mx, my, mz]) = (line.direction.to_array(), line.moment.to_array());
    for (EdgeBlock { along: [x, y, z], moment: [a, b, c] }, sides) in edges.iter().zip(sides) {
        for i in 0..WIDTH {
            sides[i] = (dx * a[i] + dy * b[i] + dz * c[i]) + (mx * x[i] + my * y[i] + mz * z[i]);
        }
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
    #[inline(always)]
    fn hit(&self, sides: &EdgeSides, line: &LaneRay) -> Option<(f64, [f64; 2])> {
        let side = |k: usize| self.lengths[k] * sides.as_flattened()[self.edges[k]];
        let [a, b, c] = [side(0), side(1), side(2)];
        let is_inside = (a >= 0.0) & (b >= 0.0) & (c >= 0.0) | (a <= 0.0) & (b <= 0.0) & (c <= 0.0);
        if !is_inside {
            return None;
        }
        let height = (self.corner - line.origin).dot(self.normal);
        let t = height / line.direction.dot(self.normal);
        let over = 1.0 / (a + b + c);
        // A line in the triangle's plane meets it nowhere.
        let is_between = t > line.t_min && t <= line.t_max && t <= f64::MAX;
        is_between.then_some((t, [b * over, c * over]))
    }
}

/// The closest hit of the ray of a lane; of those in one place the last.
pub(super) fn closest(
    edges: &PluckerEdges,
    triangles: &[FewTriangle],
    block: &RayBlock,
    lane: usize,
) -> Option<TriangleHit> {
    let (mut line, mut sides, mut nearest) = (LaneRay::of(block, lane), EdgeSides::default(), None);
    sides_of(&edges.blocks, &line, &mut sides);
    for (number, triangle) in triangles.iter().enumerate() {
        let Some((t, weights)) = triangle.hit(&sides, &line) else { continue };
        nearest = Some(TriangleHit { number, t, weights });
        line.t_max = t;
    }
    nearest
}

/// Tests whether anything is between the ends of the ray of a lane.
pub(super) fn is_occluded(
    edges: &PluckerEdges,
    triangles: &[FewTriangle],
    block: &RayBlock,
    lane: usize,
) -> bool {
    let (line, mut sides) = (LaneRay::of(block, lane), EdgeSides::default());
    sides_of(&edges.blocks, &line, &mut sides);
    triangles.iter().any(|triangle| triangle.hit(&sides, &line).is_some())
}
