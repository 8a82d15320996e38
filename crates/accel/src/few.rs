//! Scenes of few triangles: each ray against each of their edges, sixteen rays at a time. Below some dozens of
//! triangles that takes less time than going down a tree. Runs of triangles whose box no ray of a block meets are
//! left out.
//!
//! A ray passes an edge on the side that the sign of their Plücker product tells. Triangles that share an edge
//! share its sign, whatever rounding did to it, so no ray slips between them along the edge (R. Jones, "Intersecting
//! a ray and a triangle with Plücker coordinates", Ray Tracing News 13.1, 2000; K. Shoemake, "Plücker coordinate
//! tutorial", Ray Tracing News 11.1, 1998). Where several edges meet, signs may contradict each other.
//!
//! Rays are those of single precision, and so is what they meet, as in Embree. Where a ray passes an edge so near
//! that single precision cannot tell the side, its block is worked out again in double precision.

use std::ops::{Add, Mul, Range, Sub};

use etendue_geometry::block::{Floats, LANES};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Geometry, MISS, RayBatch, RayBlock, RayBlocks, is_degenerate};

use crate::single::{F32Frame, Rays32, round};

/// Scenes of more triangles are traced by trees.
const MOST_TRIANGLES: usize = 64;

/// A number of either precision.
trait Number:
    Copy + Default + PartialOrd + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self>
{
    /// The largest finite one.
    const LARGEST: Self;
    /// A number of single precision.
    fn of(x: f32) -> Self;
    /// Its absolute value.
    fn size(self) -> Self;
    /// 1 over it.
    fn inverse(self) -> Self;
    /// The number, rounded to single precision.
    fn single(self) -> f32;
}

impl Number for f32 {
    const LARGEST: Self = Self::MAX;
    #[inline(always)]
    fn of(x: f32) -> Self {
        x
    }
    #[inline(always)]
    fn size(self) -> Self {
        self.abs()
    }
    #[inline(always)]
    fn inverse(self) -> Self {
        1.0 / self
    }
    #[inline(always)]
    fn single(self) -> f32 {
        self
    }
}

impl Number for f64 {
    const LARGEST: Self = Self::MAX;
    #[inline(always)]
    fn of(x: f32) -> Self {
        Self::from(x)
    }
    #[inline(always)]
    fn size(self) -> Self {
        self.abs()
    }
    #[inline(always)]
    fn inverse(self) -> Self {
        1.0 / self
    }
    #[inline(always)]
    fn single(self) -> f32 {
        round(self)
    }
}

/// One number of each ray of a block.
type Row<F> = [F; LANES];

/// An edge, by its Plücker coordinates in the frame, the direction a unit vector.
#[derive(Debug, Clone, Copy)]
struct PluckerEdge<F> {
    along: [F; 3],
    moment: [F; 3],
}

/// A triangle in the frame.
#[derive(Debug, Clone, Copy)]
struct FewTriangle<F> {
    /// Numbers of the edges opposite to its corners.
    edges: [usize; 3],
    /// Their lengths, with the sign with which each is one of its own.
    lengths: [F; 3],
    /// Normal on the front where the corners run counter-clockwise, as long as twice the area.
    normal: [F; 3],
    /// A corner.
    corner: [F; 3],
}

/// Edges and triangles in one precision.
#[derive(Debug, Default)]
struct Shapes<F> {
    edges: Vec<PluckerEdge<F>>,
    triangles: Vec<FewTriangle<F>>,
}

/// Which triangle of the scene one is.
#[derive(Debug, Clone, Copy)]
struct Named {
    /// Its normal as hits tell it: of the placement's front.
    front: [f32; 3],
    placement: u32,
    triangle: u32,
}

/// The most triangles of a run: those of a box.
const RUN: usize = 12;

/// Triangles that follow each other in the list, with the edges that they have among them and their box.
#[derive(Debug)]
struct Run {
    edges: Range<usize>,
    triangles: Range<usize>,
    /// Number of the first triangle.
    first: u32,
    /// From and to, in the frame, and a little beyond.
    bounds: [[f32; 3]; 2],
}

/// A scene of few triangles.
#[derive(Debug)]
pub(crate) struct FewTriangles {
    frame: F32Frame,
    single: Shapes<f32>,
    double: Shapes<f64>,
    named: Vec<Named>,
    runs: Vec<Run>,
    /// The largest distance of a corner from the frame's origin (m).
    radius: f32,
}

impl FewTriangles {
    /// Those of `geometry`; `None` where there are too many.
    pub(crate) fn of(geometry: &Geometry) -> Option<Self> {
        if geometry.triangles() > MOST_TRIANGLES as u64 {
            return None;
        }
        let mut few = Self {
            frame: F32Frame::of(geometry.loose_bounds()),
            single: Shapes::default(),
            double: Shapes::default(),
            named: Vec::new(),
            runs: Vec::new(),
            radius: 0.0,
        };
        let mut ends: Vec<[[f64; 3]; 2]> = Vec::new();
        let mut bounds = Bounds::EMPTY;
        for (number, placement) in (0_u32..).zip(&geometry.placements) {
            let mesh = geometry.mesh_of(placement);
            let place = &placement.world_from_mesh;
            // Of hits in one place the last one wins: of a placement the lowest triangle.
            for triangle in (0..mesh.triangles.len()).rev() {
                let own = mesh.corners(triangle);
                let wide = own.map(|corner| place.point_from(corner, few.frame.origin));
                let normal = (wide[1] - wide[0]).cross(wide[2] - wide[0]);
                if is_degenerate(wide) || normal.length_squared() == 0.0 {
                    continue;
                }
                let first = match few.runs.last() {
                    Some(run) if run.triangles.len() < RUN => run.edges.start,
                    _ => few.begin_run(&mut bounds),
                };
                let edges = [0, 1, 2]
                    .map(|k| few.edge([wide[(k + 1) % 3], wide[(k + 2) % 3]], &mut ends, first));
                few.double.triangles.push(FewTriangle {
                    edges: edges.map(|(edge, _)| edge),
                    lengths: edges.map(|(_, length)| length),
                    normal: normal.to_array(),
                    corner: wide[0].to_array(),
                });
                few.named.push(Named {
                    front: (normal * place.handedness()).to_array().map(round),
                    placement: number,
                    triangle: u32::try_from(triangle).unwrap_or(MISS),
                });
                wide.iter().for_each(|&corner| bounds.include(corner));
                few.end_run(bounds);
            }
        }
        few.single = few.double.rounded();
        Some(few)
    }

    /// The number of the edge between two corners, found among those from `first` on or appended, and its length,
    /// negative where it runs the other way.
    fn edge(
        &mut self,
        [from, to]: [DVec3; 2],
        ends: &mut Vec<[[f64; 3]; 2]>,
        first: usize,
    ) -> (usize, f64) {
        let [a, b] = [from.to_array(), to.to_array()];
        let is_own = |ends: &[[f64; 3]; 2]| *ends == [a, b] || *ends == [b, a];
        let found = ends[first..].iter().position(is_own).map(|k| first + k);
        let at = found.unwrap_or_else(|| {
            ends.push([a, b]);
            self.double.edges.push(PluckerEdge::between(from, to));
            ends.len() - 1
        });
        self.radius = self.radius.max(round(from.length()));
        let length = from.distance(to);
        (at, if ends[at] == [a, b] { length } else { -length })
    }

    /// Begins a run behind all others; the number of its first edge.
    fn begin_run(&mut self, bounds: &mut Bounds) -> usize {
        let (edge, triangle) = (self.double.edges.len(), self.double.triangles.len());
        *bounds = Bounds::EMPTY;
        self.runs.push(Run {
            edges: edge..edge,
            triangles: triangle..triangle,
            first: u32::try_from(triangle).unwrap_or(MISS),
            bounds: [[0.0; 3]; 2],
        });
        edge
    }

    /// Sets the last run to what has been added since it began, within these bounds.
    fn end_run(&mut self, bounds: Bounds) {
        let Some(run) = self.runs.last_mut() else { return };
        let Shapes { edges, triangles } = &self.double;
        (run.edges.end, run.triangles.end) = (edges.len(), triangles.len());
        // Some roundings of the largest coordinate.
        let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
        let beyond = DVec3::splat(largest * 4.0 * f64::from(f32::EPSILON));
        run.bounds =
            [bounds.min - beyond, bounds.max + beyond].map(|corner| corner.to_array().map(round));
    }

    /// What origins of blocks are relative to (m, world).
    pub(crate) fn origin(&self) -> DVec3 {
        self.frame.origin
    }

    /// The rays of a batch as blocks.
    pub(crate) fn convert(&self, rays: &RayBatch, blocks: &mut RayBlocks) {
        Rays32::default().convert_to_blocks(rays, &self.frame, blocks);
    }

    /// The closest hits of blocks, as [`BlockAccel`](crate::BlockAccel) has them; of triangles in one place the last.
    pub(crate) fn closest_of_blocks(&self, blocks: &mut [RayBlock]) {
        let mut sides = Sides::of(self);
        for block in blocks {
            let mut nearest = Nearest::of(block);
            if closest_in_single(self, block, &mut sides.single, &mut nearest) {
                let mut exact = Nearest::of(block);
                closest_in_double(self, block, &mut sides.double, &mut exact);
                self.note(block, &exact);
            } else {
                self.note(block, &nearest);
            }
        }
    }

    /// Tells a block what its rays hit.
    #[inline(always)]
    fn note<F: Number>(&self, block: &mut RayBlock, nearest: &Nearest<F>) {
        block.clear_hits();
        [block.t_max, block.u, block.v] =
            [&nearest.t, &nearest.u, &nearest.v].map(|row| row.map(F::single));
        for (lane, &number) in nearest.number.iter().enumerate() {
            let Some(hit) = self.named.get(number as usize) else { continue };
            (block.placement[lane], block.triangle[lane]) = (hit.placement, hit.triangle);
            for axis in 0..3 {
                block.normal[axis][lane] = hit.front[axis];
            }
        }
    }

    /// Whether anything is between the ends of rays of blocks.
    pub(crate) fn occluded_of_blocks(&self, blocks: &mut [RayBlock]) {
        let mut sides = Sides::of(self);
        for block in blocks {
            let mut blocked = [0; LANES];
            if occluded_in_single(self, block, &mut sides.single, &mut blocked) {
                blocked = [0; LANES];
                occluded_in_double(self, block, &mut sides.double, &mut blocked);
            }
            for (t_max, &blocked) in block.t_max.iter_mut().zip(&blocked) {
                *t_max = if blocked != 0 { f32::NEG_INFINITY } else { *t_max };
            }
        }
    }
}

impl PluckerEdge<f64> {
    fn between(from: DVec3, to: DVec3) -> Self {
        let along = (to - from).normalize();
        Self { along: along.to_array(), moment: from.cross(along).to_array() }
    }
}

impl Shapes<f64> {
    /// The same in single precision.
    fn rounded(&self) -> Shapes<f32> {
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

/// Room for the sides on which a block's rays pass all edges, in both precisions.
struct Sides {
    single: Vec<Row<f32>>,
    double: Vec<Row<f64>>,
}

impl Sides {
    fn of(few: &FewTriangles) -> Self {
        let count = few.double.edges.len();
        Self { single: vec![[0.0; LANES]; count], double: vec![[0.0; LANES]; count] }
    }
}

/// What of a block's rays is nearest so far.
struct Nearest<F> {
    t: Row<F>,
    u: Row<F>,
    v: Row<F>,
    /// Number of the triangle in the list, or [`MISS`].
    number: [u32; LANES],
}

impl<F: Number> Nearest<F> {
    #[inline(always)]
    fn of(block: &RayBlock) -> Self {
        let zero = [F::default(); LANES];
        Self { t: block.t_max.map(F::of), u: zero, v: zero, number: [MISS; LANES] }
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
        let origin = block.origin.map(|axis| axis.map(F::of));
        let direction = block.direction.map(|axis| axis.map(F::of));
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
            least[i] = lower(least[i], side[i].size());
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
            t[i] = height * (dx[i] * nx + dy[i] * ny + dz[i] * nz).inverse();
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
    let t_min = block.t_min.map(F::of);
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
                let over = passing.total[i].inverse();
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
    let [t_min, t_max] = [block.t_min, block.t_max].map(|limits| limits.map(F::of));
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
fn closest_in_single(
    few: &FewTriangles,
    block: &RayBlock,
    sides: &mut [Row<f32>],
    nearest: &mut Nearest<f32>,
) -> bool {
    let least = closest((few, &few.single), block, sides, nearest);
    is_doubtful(few, block, &least)
}

#[multiversion::multiversion(targets = "simd")]
fn closest_in_double(
    few: &FewTriangles,
    block: &RayBlock,
    sides: &mut [Row<f64>],
    nearest: &mut Nearest<f64>,
) {
    closest((few, &few.double), block, sides, nearest);
}

/// Marks rays with anything between their ends; whether single precision left any in doubt.
#[multiversion::multiversion(targets = "simd")]
fn occluded_in_single(
    few: &FewTriangles,
    block: &RayBlock,
    sides: &mut [Row<f32>],
    blocked: &mut [u32; LANES],
) -> bool {
    let least = occluded((few, &few.single), block, sides, blocked);
    is_doubtful(few, block, &least)
}

#[multiversion::multiversion(targets = "simd")]
fn occluded_in_double(
    few: &FewTriangles,
    block: &RayBlock,
    sides: &mut [Row<f64>],
    blocked: &mut [u32; LANES],
) {
    occluded((few, &few.double), block, sides, blocked);
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use etendue_geometry::glam::DMat3;
    use etendue_geometry::{
        Detail, HitBatch, HitPrecision, Mesh, Placement, Positions, Transform, Vertices,
    };

    use super::*;
    use crate::{Accel, BuildOptions, Exact};

    /// Numbers in −1..1 that are spread out (Weyl's sequence).
    fn spread(k: u32, step: f64) -> f64 {
        2.0 * (f64::from(k) * step).fract() - 1.0
    }

    fn direction(k: u32) -> DVec3 {
        let (up, around) = (spread(k, 0.618_034), 2.399_963 * f64::from(k));
        let r = (1.0 - up * up).sqrt();
        DVec3::new(r * around.cos(), up, r * around.sin())
    }

    fn mesh(corners: &[[f32; 3]], triangles: Vec<[u32; 3]>) -> Mesh {
        Mesh::new("few", Positions::F32(Vertices::from_arrays(corners)), triangles.into())
    }

    /// An icosahedron: no two of its triangles are in one plane.
    fn icosahedron() -> Mesh {
        let golden = 1.618_034_f32;
        let mut corners = Vec::new();
        for k in 0..3 {
            for (a, b) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
                let mut corner = [0.0; 3];
                (corner[(k + 1) % 3], corner[(k + 2) % 3]) = (a, b);
                corners.push(corner);
            }
        }
        let far = |i: usize, j: usize| {
            (0..3).map(|k| (corners[i][k] - corners[j][k]).powi(2)).sum::<f32>() > 4.1
        };
        let mut triangles = Vec::new();
        for (a, b, c) in
            (0..12).flat_map(|a| (a + 1..12).flat_map(move |b| (b + 1..12).map(move |c| (a, b, c))))
        {
            if !far(a, b) && !far(b, c) && !far(c, a) {
                triangles.push([a, b, c].map(|k| u32::try_from(k).unwrap()));
            }
        }
        assert_eq!(triangles.len(), 20);
        mesh(&corners, triangles)
    }

    /// Loose triangles, a mirrored copy of them, and a closed body about all, at a place.
    fn scene(far: f64) -> Arc<Geometry> {
        let corners: Vec<[f32; 3]> = (0..48)
            .map(|k| [0.811_f64, 0.434, 0.279].map(|step| round(0.8 * spread(k, step))))
            .collect();
        let loose = mesh(&corners, (0..16).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect());
        let mut geometry =
            Geometry::alone(loose, Transform::new(DMat3::IDENTITY, DVec3::splat(far)));
        let mirror = DMat3::from_diagonal(DVec3::new(-1.0, 0.9, 0.8));
        let placement = geometry.placements[0].clone();
        geometry.placements.push(Placement {
            world_from_mesh: Transform::new(mirror, DVec3::splat(far)),
            ..placement.clone()
        });
        geometry.meshes.push(icosahedron());
        geometry.placements.push(Placement {
            mesh: 1,
            world_from_mesh: Transform::new(DMat3::IDENTITY, DVec3::splat(far)),
            ..placement
        });
        Arc::new(geometry)
    }

    #[test]
    fn hits_are_those_of_the_reference() {
        for far in [0.0, 1e4] {
            let geometry = scene(far);
            let few = FewTriangles::of(&geometry).unwrap();
            assert!(few.double.edges.len() < 3 * few.named.len(), "edges are shared");
            let exact = Exact::build(Arc::clone(&geometry), &BuildOptions::default()).unwrap();
            let mut rays = RayBatch::default();
            for k in 0..4096 {
                let start = [0.377, 0.913, 0.151].map(|step| 1.2 * spread(k, step));
                let end = if k % 3 == 0 { 0.7 } else { f64::INFINITY };
                let start = DVec3::splat(far) + DVec3::from(start);
                rays.push_between(start, direction(k), 0.0, end);
            }
            let mut hits = HitBatch::new(Detail::Surface);
            exact.closest(&rays, &mut hits);
            // Whatever precision the batch asks for, blocks have its rays as they are.
            let [mut blocks, mut single] = [RayBlocks::default(), RayBlocks::default()];
            few.convert(&rays, &mut blocks);
            rays.precision = HitPrecision::Single;
            few.convert(&rays, &mut single);
            for (block, single) in blocks.blocks().iter().zip(single.blocks()) {
                assert_eq!(block.origin, single.origin);
                assert_eq!(block.direction, single.direction);
            }
            let mut shadows = blocks.clone();
            few.closest_of_blocks(blocks.blocks_mut());
            few.occluded_of_blocks(shadows.blocks_mut());
            let mut apart = 0;
            for i in 0..rays.len() {
                let (block, lane) = (&blocks.blocks()[i / LANES], i % LANES);
                let own = [block.placement[lane], block.triangle[lane]];
                let is_hit = own[0] != MISS;
                assert_eq!(shadows.blocks()[i / LANES].is_blocked(lane), is_hit);
                if own != [hits.placement[i], hits.triangle[i]] {
                    apart += 1;
                    continue;
                }
                if !is_hit {
                    continue;
                }
                // A few roundings of coordinates of about 2, over the cosine of incidence.
                let normal = DVec3::from(block.normal.map(|axis| f64::from(axis[lane])));
                let cosine = normal.normalize().dot(rays.direction(i)).abs();
                let bound = 32.0 * f64::from(f32::EPSILON) / cosine;
                let t = f64::from(block.t_max[lane]);
                assert!((t - hits.t[i]).abs() < bound, "{far} {i}: {t} {}", hits.t[i]);
                assert!(normal.normalize().distance(hits.normal(i)) < 1e-5, "{far} {i}");
                // Triangles are some 0.3 m long at least: weights are off by as much over that.
                let off = (f64::from(block.u[lane]) - hits.u[i]).abs()
                    + (f64::from(block.v[lane]) - hits.v[i]).abs();
                assert!(off < 16.0 * bound, "{far} {i}: {off}");
            }
            // Rays within f32's rounding of an edge.
            assert!(apart <= 4, "{far}: {apart} of {}", rays.len());
        }
    }

    /// From within, aimed at the edges of a closed body and beside its corners.
    #[test]
    fn no_ray_slips_through_an_edge() {
        let geometry = Geometry::alone(icosahedron(), Transform::IDENTITY);
        let few = FewTriangles::of(&geometry).unwrap();
        let mut rays = RayBatch::default();
        let body = &geometry.meshes[0];
        for k in 0..100_000_u32 {
            let start = DVec3::from([0.377, 0.913, 0.151].map(|step| 0.7 * spread(k, step)));
            let [a, b, _] = body.corners(k as usize % body.triangles.len());
            // To 10⁻⁶ of its length from the corners, where all edges are near.
            let near = 10.0_f64.powf(-6.0 * (f64::from(k) * 0.731).fract());
            let target = a + (b - a) * (0.5 * near);
            rays.push(start, (target - start).normalize());
        }
        rays.precision = HitPrecision::Single;
        let mut blocks = RayBlocks::default();
        few.convert(&rays, &mut blocks);
        let mut shadows = blocks.clone();
        few.closest_of_blocks(blocks.blocks_mut());
        few.occluded_of_blocks(shadows.blocks_mut());
        let missed = blocks.blocks().iter().flat_map(|block| block.placement);
        assert_eq!(missed.filter(|&placement| placement == MISS).count(), 0);
        let whole = |block: &RayBlock| (0..LANES).all(|lane| block.is_blocked(lane));
        assert!(shadows.blocks().iter().all(whole));
    }

    #[test]
    fn scenes_of_many_triangles_are_not_taken() {
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let of =
            |count| Geometry::alone(mesh(&corners, vec![[0, 1, 2]; count]), Transform::IDENTITY);
        assert!(FewTriangles::of(&of(MOST_TRIANGLES)).is_some());
        assert!(FewTriangles::of(&of(MOST_TRIANGLES + 1)).is_none());
    }
}
