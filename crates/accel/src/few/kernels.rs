//! A block of rays against edges and triangles, in either precision.

use std::ops::{Add, Div, Mul, Sub};

use etendue_geometry::block::{Floats, LANES};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{MISS, RayBlock};

use super::FewTriangles;
use crate::single::round;

/// A number of either precision.
pub(super) trait Number:
    Copy
    + Default
    + PartialOrd
    + From<f32>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
{
    /// The largest finite one.
    const LARGEST: Self;
    /// The number, rounded to single precision.
    fn single(self) -> f32;
}

impl Number for f32 {
    const LARGEST: Self = Self::MAX;
    #[inline(always)]
    fn single(self) -> f32 {
        self
    }
}

impl Number for f64 {
    const LARGEST: Self = Self::MAX;
    #[inline(always)]
    fn single(self) -> f32 {
        round(self)
    }
}

/// One number of each ray of a block.
pub(super) type Row<F> = [F; LANES];

/// An edge, by its Plücker coordinates in the frame, the direction a unit vector.
#[derive(Debug, Clone, Copy)]
pub(super) struct PluckerEdge<F> {
    along: [F; 3],
    moment: [F; 3],
}

/// A triangle in the frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct FewTriangle<F> {
    /// Numbers of the edges opposite to its corners.
    pub(super) edges: [usize; 3],
    /// Their lengths, with the sign with which each is one of its own.
    pub(super) lengths: [F; 3],
    /// Normal on the front where the corners run counter-clockwise, as long as twice the area.
    pub(super) normal: [F; 3],
    /// A corner.
    pub(super) corner: [F; 3],
}

/// Edges and triangles in one precision.
#[derive(Debug, Default)]
pub(super) struct Shapes<F> {
    pub(super) edges: Vec<PluckerEdge<F>>,
    pub(super) triangles: Vec<FewTriangle<F>>,
}

impl PluckerEdge<f64> {
    pub(super) fn between(from: DVec3, to: DVec3) -> Self {
        let along = (to - from).normalize();
        Self { along: along.to_array(), moment: from.cross(along).to_array() }
    }
}

impl Shapes<f64> {
    /// The same in single precision.
    pub(super) fn rounded(&self) -> Shapes<f32> {
        let edge = |own: &PluckerEdge<f64>| PluckerEdge {
            along: own.along.map(round),
            moment: own.moment.map(round),
        };
        let triangle = |own: &FewTriangle<f64>| FewTriangle {
            edges: own.edges,
            lengths: own.lengths.map(round),
            normal: own.normal.map(round),
            corner: own.corner.map(round),
        };
        Shapes {
            edges: self.edges.iter().map(edge).collect(),
            triangles: self.triangles.iter().map(triangle).collect(),
        }
    }
}

/// What of a block's rays is nearest so far.
pub(super) struct Nearest<F> {
    pub(super) t: Row<F>,
    pub(super) u: Row<F>,
    pub(super) v: Row<F>,
    /// Number of the triangle in the list, or [`MISS`].
    pub(super) number: [u32; LANES],
}

impl<F: Number> Nearest<F> {
    #[inline(always)]
    pub(super) fn of(block: &RayBlock) -> Self {
        let zero = [F::default(); LANES];
        Self { t: block.t_max.map(F::from), u: zero, v: zero, number: [MISS; LANES] }
    }
}

/// The rays of a block.
struct BlockLines<F> {
    origin: [Row<F>; 3],
    /// Plücker coordinates.
    direction: [Row<F>; 3],
    moment: [Row<F>; 3],
    /// Of the directions.
    inverse: [Floats; 3],
}

impl<F: Number> BlockLines<F> {
    #[inline(always)]
    fn of(block: &RayBlock) -> Self {
        let origin = block.origin.map(|axis| axis.map(F::from));
        let direction = block.direction.map(|axis| axis.map(F::from));
        let ([ox, oy, oz], [dx, dy, dz]) = (&origin, &direction);
        let zero = [F::default(); LANES];
        let (mut mx, mut my, mut mz) = (zero, zero, zero);
        for i in 0..LANES {
            mx[i] = oy[i] * dz[i] - oz[i] * dy[i];
            my[i] = oz[i] * dx[i] - ox[i] * dz[i];
            mz[i] = ox[i] * dy[i] - oy[i] * dx[i];
        }
        let inverse = block.direction.map(|axis| axis.map(|d| 1.0 / d));
        Self { origin, direction, moment: [mx, my, mz], inverse }
    }
}

/// What three roundings may do to the distance of a box, as a share of it, with room.
const SLACK: f32 = 1e-6;

/// Whether any ray of a block meets a box. Where a ray runs in the plane of a side, what is not a number parts
/// nothing: the box is a little larger than what is in it.
#[inline(always)]
fn reaches([from, to]: [[f32; 3]; 2], block: &RayBlock, inverse: &[Floats; 3]) -> bool {
    let (mut enter, mut exit) = (block.t_min, block.t_max);
    for axis in 0..3 {
        let (origin, inverse) = (&block.origin[axis], &inverse[axis]);
        for i in 0..LANES {
            let a = (from[axis] - origin[i]) * inverse[i];
            let b = (to[axis] - origin[i]) * inverse[i];
            let (near, far) = if a < b { (a, b) } else { (b, a) };
            enter[i] = if near > enter[i] { near } else { enter[i] };
            exit[i] = if far < exit[i] { far } else { exit[i] };
        }
    }
    let mut any = 0_u32;
    for i in 0..LANES {
        any |= u32::from(enter[i] * (1.0 - SLACK) <= exit[i] * (1.0 + SLACK));
    }
    any != 0
}

/// On which side each ray passes each edge: the sign of what is found here, the distance of the lines times the sine
/// of their angle (m). `least` is brought down to the least of all.
#[inline(always)]
fn pass<F: Number>(
    edges: &[PluckerEdge<F>],
    lines: &BlockLines<F>,
    sides: &mut [Row<F>],
    least: &mut Row<F>,
) {
    let ([dx, dy, dz], [mx, my, mz]) = (&lines.direction, &lines.moment);
    for (PluckerEdge { along, moment }, side) in edges.iter().zip(sides) {
        for i in 0..LANES {
            let of_moment = dx[i] * moment[0] + dy[i] * moment[1] + dz[i] * moment[2];
            side[i] = of_moment + (mx[i] * along[0] + my[i] * along[1] + mz[i] * along[2]);
            least[i] = lower(least[i], higher(side[i], F::default() - side[i]));
        }
    }
}

/// Roundings of single precision that may be in the side of an edge, of the distances from the frame's origin of the
/// ray's start and of the edge: one of each of its six terms and of their sums, and three of the ray's moment.
const SIDE_ROUNDINGS: f32 = 12.0 * f32::EPSILON;

/// Whether any ray that is traced passes an edge as near as roundings may be, of which the `least` distance is known.
#[inline(always)]
fn is_doubtful(few: &FewTriangles, block: &RayBlock, least: &Row<f32>) -> bool {
    let [x, y, z] = &block.origin;
    let mut any = 0_u32;
    for i in 0..LANES {
        let size = x[i].abs() + y[i].abs() + z[i].abs() + few.radius;
        any |= u32::from((block.t_max[i] > 0.0) & (least[i] < SIDE_ROUNDINGS * size));
    }
    any != 0
}

#[inline(always)]
fn lower<F: Number>(a: F, b: F) -> F {
    if a < b { a } else { b }
}

#[inline(always)]
fn higher<F: Number>(a: F, b: F) -> F {
    if a > b { a } else { b }
}

/// How rays of a block pass a triangle's edges.
struct Passing<F> {
    /// Barycentric weights, times [`total`](Self::total).
    weights: [Row<F>; 3],
    total: Row<F>,
    /// All edges are passed on one side.
    is_inside: [bool; LANES],
}

impl<F: Number> FewTriangle<F> {
    /// `None` where no ray passes all edges on one side.
    #[inline(always)]
    fn passed(&self, sides: &[Row<F>]) -> Option<Passing<F>> {
        let [first, second, third] = self.edges.map(|edge| &sides[edge]);
        let [la, lb, lc] = self.lengths;
        let zero = F::default();
        let mut weights = [[zero; LANES]; 3];
        let (mut total, mut is_inside, mut any) = ([zero; LANES], [false; LANES], 0_u32);
        for i in 0..LANES {
            let (a, b, c) = (first[i] * la, second[i] * lb, third[i] * lc);
            let (lowest, highest) = (lower(lower(a, b), c), higher(higher(a, b), c));
            is_inside[i] = (lowest >= zero) | (highest <= zero);
            any |= u32::from(is_inside[i]);
            (weights[0][i], weights[1][i], weights[2][i]) = (a, b, c);
            total[i] = a + b + c;
        }
        (any != 0).then_some(Passing { weights, total, is_inside })
    }

    /// The distances along the rays of a block to the triangle's plane (m).
    #[inline(always)]
    fn distances(&self, lines: &BlockLines<F>) -> Row<F> {
        let ([x, y, z], [dx, dy, dz]) = (&lines.origin, &lines.direction);
        let ([nx, ny, nz], [cx, cy, cz]) = (self.normal, self.corner);
        let mut t = [F::default(); LANES];
        for i in 0..LANES {
            let height = (cx - x[i]) * nx + (cy - y[i]) * ny + (cz - z[i]) * nz;
            t[i] = height * (F::from(1.0) / (dx[i] * nx + dy[i] * ny + dz[i] * nz));
        }
        t
    }
}

/// The closest hits of a block; the least distance (m) at which each ray passes an edge.
#[inline(always)]
fn closest<F: Number>(
    (few, shapes): (&FewTriangles, &Shapes<F>),
    block: &RayBlock,
    sides: &mut [Row<F>],
    nearest: &mut Nearest<F>,
) -> Row<F> {
    let lines = BlockLines::of(block);
    let t_min = block.t_min.map(F::from);
    let mut least = [F::LARGEST; LANES];
    for run in &few.runs {
        if !reaches(run.bounds, block, &lines.inverse) {
            continue;
        }
        let edges = run.edges.clone();
        pass(&shapes.edges[edges.clone()], &lines, &mut sides[edges], &mut least);
        for (number, triangle) in (run.first..).zip(&shapes.triangles[run.triangles.clone()]) {
            let Some(passing) = triangle.passed(sides) else { continue };
            let t = triangle.distances(&lines);
            for i in 0..LANES {
                let over = F::from(1.0) / passing.total[i];
                let is_between = (t[i] > t_min[i]) & (t[i] <= nearest.t[i]);
                // A ray in the triangle's plane meets it nowhere.
                let counts = passing.is_inside[i] & is_between & (t[i] <= F::LARGEST);
                nearest.t[i] = if counts { t[i] } else { nearest.t[i] };
                nearest.u[i] = if counts { passing.weights[1][i] * over } else { nearest.u[i] };
                nearest.v[i] = if counts { passing.weights[2][i] * over } else { nearest.v[i] };
                nearest.number[i] = if counts { number } else { nearest.number[i] };
            }
        }
    }
    least
}

/// Marks the rays of a block that have anything between their ends; the least distance (m) at which each passes an
/// edge.
#[inline(always)]
fn occluded<F: Number>(
    (few, shapes): (&FewTriangles, &Shapes<F>),
    block: &RayBlock,
    sides: &mut [Row<F>],
    blocked: &mut [u32; LANES],
) -> Row<F> {
    let lines = BlockLines::of(block);
    let [t_min, t_max] = [block.t_min, block.t_max].map(|limits| limits.map(F::from));
    let mut least = [F::LARGEST; LANES];
    for run in &few.runs {
        if !reaches(run.bounds, block, &lines.inverse) {
            continue;
        }
        let edges = run.edges.clone();
        pass(&shapes.edges[edges.clone()], &lines, &mut sides[edges], &mut least);
        for triangle in &shapes.triangles[run.triangles.clone()] {
            let Some(passing) = triangle.passed(sides) else { continue };
            let t = triangle.distances(&lines);
            for i in 0..LANES {
                let is_between = (t[i] > t_min[i]) & (t[i] <= t_max[i]);
                let counts = passing.is_inside[i] & is_between & (t[i] <= F::LARGEST);
                blocked[i] |= u32::from(counts);
            }
        }
    }
    least
}

/// The closest hits of a block; whether single precision left any in doubt.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn closest_in_single(
    few: &FewTriangles,
    block: &RayBlock,
    sides: &mut [Row<f32>],
    nearest: &mut Nearest<f32>,
) -> bool {
    let least = closest((few, &few.single), block, sides, nearest);
    is_doubtful(few, block, &least)
}

#[multiversion::multiversion(targets = "simd")]
pub(super) fn closest_in_double(
    few: &FewTriangles,
    block: &RayBlock,
    sides: &mut [Row<f64>],
    nearest: &mut Nearest<f64>,
) {
    closest((few, &few.double), block, sides, nearest);
}

/// Marks rays with anything between their ends; whether single precision left any in doubt.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn occluded_in_single(
    few: &FewTriangles,
    block: &RayBlock,
    sides: &mut [Row<f32>],
    blocked: &mut [u32; LANES],
) -> bool {
    let least = occluded((few, &few.single), block, sides, blocked);
    is_doubtful(few, block, &least)
}

#[multiversion::multiversion(targets = "simd")]
pub(super) fn occluded_in_double(
    few: &FewTriangles,
    block: &RayBlock,
    sides: &mut [Row<f64>],
    blocked: &mut [u32; LANES],
) {
    occluded((few, &few.double), block, sides, blocked);
}
