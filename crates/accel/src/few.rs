//! Scenes of few triangles: each ray against each of their edges, sixteen rays at a time. Below some dozens of
//! triangles that takes less time than going down a tree. Runs of triangles whose box no ray of a block meets are
//! left out.
//!
//! Rays are those of single precision, and what they meet is worked out in double precision.
//!
//! A ray passes an edge on the side that the sign of their Plücker product tells. Triangles that share an edge
//! share its sign, whatever rounding did to it, so no ray slips between them along the edge (R. Jones, "Intersecting
//! a ray and a triangle with Plücker coordinates", Ray Tracing News 13.1, 2000; K. Shoemake, "Plücker coordinate
//! tutorial", Ray Tracing News 11.1, 1998).

use std::ops::Range;

use etendue_geometry::block::{Floats, LANES};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Geometry, MISS, RayBatch, RayBlock, RayBlocks, is_degenerate};

use crate::single::{F32Frame, Rays32, round};

/// Scenes of more triangles are traced by trees.
const MOST_TRIANGLES: usize = 64;

/// An edge, by its Plücker coordinates in the frame.
#[derive(Debug, Clone, Copy)]
struct PluckerEdge {
    along: [f64; 3],
    moment: [f64; 3],
}

/// A triangle in the frame.
#[derive(Debug, Clone, Copy)]
struct FewTriangle {
    /// Numbers of the edges opposite to its corners, and the sign with which each is one of its own.
    edges: [(usize, f64); 3],
    /// Normal on the front where the corners run counter-clockwise, as long as twice the area.
    normal: [f64; 3],
    /// The normal times any corner.
    offset: f64,
    /// The normal as hits tell it: of the placement's front.
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
    edges: Vec<PluckerEdge>,
    triangles: Vec<FewTriangle>,
    runs: Vec<Run>,
}

impl FewTriangles {
    /// Those of `geometry`; `None` where there are too many.
    pub(crate) fn of(geometry: &Geometry) -> Option<Self> {
        if geometry.triangles() > MOST_TRIANGLES as u64 {
            return None;
        }
        let frame = F32Frame::of(geometry.loose_bounds());
        let mut few = Self { frame, edges: Vec::new(), triangles: Vec::new(), runs: Vec::new() };
        let mut ends: Vec<[[f64; 3]; 2]> = Vec::new();
        let mut bounds = Bounds::EMPTY;
        for (number, placement) in (0_u32..).zip(&geometry.placements) {
            let mesh = geometry.mesh_of(placement);
            let place = &placement.world_from_mesh;
            // Of hits in one place the last one wins: of a placement the lowest triangle.
            for triangle in (0..mesh.triangles.len()).rev() {
                let own = mesh.corners(triangle);
                let wide = own.map(|corner| place.point_from(corner, frame.origin));
                let corners = wide.map(|corner| corner.to_array());
                let normal = (wide[1] - wide[0]).cross(wide[2] - wide[0]);
                if is_degenerate(wide) || normal.length_squared() == 0.0 {
                    continue;
                }
                let first = match few.runs.last() {
                    Some(run) if run.triangles.len() < RUN => run.edges.start,
                    _ => few.begin_run(&mut bounds),
                };
                let mut edge = |k: usize| {
                    let [a, b] = [corners[(k + 1) % 3], corners[(k + 2) % 3]];
                    let is_own = |ends: &[[f64; 3]; 2]| *ends == [a, b] || *ends == [b, a];
                    let found = ends[first..].iter().position(is_own).map(|k| first + k);
                    let at = found.unwrap_or_else(|| {
                        ends.push([a, b]);
                        few.edges.push(PluckerEdge::between(a, b));
                        ends.len() - 1
                    });
                    (at, if ends[at] == [a, b] { 1.0 } else { -1.0 })
                };
                few.triangles.push(FewTriangle {
                    edges: [edge(0), edge(1), edge(2)],
                    normal: normal.to_array(),
                    offset: normal.dot(wide[0]),
                    front: (normal * place.handedness()).to_array().map(round),
                    placement: number,
                    triangle: u32::try_from(triangle).unwrap_or(MISS),
                });
                wide.iter().for_each(|&corner| bounds.include(corner));
                few.end_run(bounds);
            }
        }
        Some(few)
    }

    /// Begins a run behind all others; the number of its first edge.
    fn begin_run(&mut self, bounds: &mut Bounds) -> usize {
        let (edge, triangle) = (self.edges.len(), self.triangles.len());
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
        (run.edges.end, run.triangles.end) = (self.edges.len(), self.triangles.len());
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
        let mut of_edges = vec![[0.0; LANES]; self.edges.len()];
        for block in blocks {
            let mut best = Best {
                t: block.t_max.map(f64::from),
                u: [0.0; LANES],
                v: [0.0; LANES],
                number: [MISS; LANES],
            };
            closest(self, block, &mut of_edges, &mut best);
            block.clear_hits();
            [block.t_max, block.u, block.v] = [best.t, best.u, best.v].map(|row| row.map(round));
            for (lane, &number) in best.number.iter().enumerate() {
                let Some(hit) = self.triangles.get(number as usize) else { continue };
                (block.placement[lane], block.triangle[lane]) = (hit.placement, hit.triangle);
                for axis in 0..3 {
                    block.normal[axis][lane] = hit.front[axis];
                }
            }
        }
    }

    /// Whether anything is between the ends of rays of blocks.
    pub(crate) fn occluded_of_blocks(&self, blocks: &mut [RayBlock]) {
        let mut of_edges = vec![[0.0; LANES]; self.edges.len()];
        for block in blocks {
            let mut blocked = [0; LANES];
            occluded(self, block, &mut of_edges, &mut blocked);
            for (t_max, &blocked) in block.t_max.iter_mut().zip(&blocked) {
                *t_max = if blocked != 0 { f32::NEG_INFINITY } else { *t_max };
            }
        }
    }
}

impl PluckerEdge {
    fn between(a: [f64; 3], b: [f64; 3]) -> Self {
        let [from, to] = [a, b].map(DVec3::from);
        Self { along: (to - from).to_array(), moment: from.cross(to).to_array() }
    }
}

/// One number of each ray of a block.
type Doubles = [f64; LANES];

/// What of a block's rays is nearest so far.
struct Best {
    t: Doubles,
    u: Doubles,
    v: Doubles,
    /// Number of the triangle in the list, or [`MISS`].
    number: [u32; LANES],
}

/// The rays of a block.
struct BlockLines {
    origin: [Doubles; 3],
    /// Plücker coordinates.
    direction: [Doubles; 3],
    moment: [Doubles; 3],
    /// Of the directions.
    inverse: [Floats; 3],
}

impl BlockLines {
    #[inline(always)]
    fn of(block: &RayBlock) -> Self {
        let origin = block.origin.map(|axis| axis.map(f64::from));
        let direction = block.direction.map(|axis| axis.map(f64::from));
        let ([ox, oy, oz], [dx, dy, dz]) = (&origin, &direction);
        let (mut mx, mut my, mut mz) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
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
fn reaches([from, to]: [[f32; 3]; 2], block: &RayBlock, lines: &BlockLines) -> bool {
    let (mut enter, mut exit) = (block.t_min, block.t_max);
    for axis in 0..3 {
        let (origin, inverse) = (&block.origin[axis], &lines.inverse[axis]);
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

/// On which side each ray passes each edge: the sign of what is found here.
#[inline(always)]
fn sides(edges: &[PluckerEdge], lines: &BlockLines, sides: &mut [Doubles]) {
    let ([dx, dy, dz], [mx, my, mz]) = (&lines.direction, &lines.moment);
    for (PluckerEdge { along, moment }, side) in edges.iter().zip(sides) {
        for i in 0..LANES {
            let of_moment = dx[i] * moment[0] + dy[i] * moment[1] + dz[i] * moment[2];
            side[i] = of_moment + (mx[i] * along[0] + my[i] * along[1] + mz[i] * along[2]);
        }
    }
}

#[inline(always)]
fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

#[inline(always)]
fn most(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Whether any ray passes all three edges on one side.
#[inline(always)]
fn is_inside(lowest: &Doubles, highest: &Doubles) -> bool {
    let mut any = 0_u32;
    for i in 0..LANES {
        any |= u32::from((lowest[i] >= 0.0) | (highest[i] <= 0.0));
    }
    any != 0
}

#[multiversion::multiversion(targets = "simd")]
fn closest(few: &FewTriangles, block: &RayBlock, of_edges: &mut [Doubles], best: &mut Best) {
    let lines = BlockLines::of(block);
    let t_min = block.t_min.map(f64::from);
    let [x, y, z] = &lines.origin;
    for run in &few.runs {
        if !reaches(run.bounds, block, &lines) {
            continue;
        }
        sides(&few.edges[run.edges.clone()], &lines, &mut of_edges[run.edges.clone()]);
        for (number, triangle) in (run.first..).zip(&few.triangles[run.triangles.clone()]) {
            let [first, second, third] = triangle.edges.map(|(edge, _)| &of_edges[edge]);
            let [sa, sb, sc] = triangle.edges.map(|(_, sign)| sign);
            let (mut lowest, mut highest) = ([0.0; LANES], [0.0; LANES]);
            for i in 0..LANES {
                let (a, b, c) = (first[i] * sa, second[i] * sb, third[i] * sc);
                lowest[i] = least(least(a, b), c);
                highest[i] = most(most(a, b), c);
            }
            if !is_inside(&lowest, &highest) {
                continue;
            }
            let [nx, ny, nz] = triangle.normal;
            for i in 0..LANES {
                let (a, b, c) = (first[i] * sa, second[i] * sb, third[i] * sc);
                let sum = a + b + c;
                let over = 1.0 / sum;
                let height = triangle.offset - (x[i] * nx + y[i] * ny + z[i] * nz);
                let t = height * over;
                let is_inside = (lowest[i] >= 0.0) | (highest[i] <= 0.0);
                let counts = is_inside & (sum != 0.0) & (t > t_min[i]) & (t <= best.t[i]);
                best.t[i] = if counts { t } else { best.t[i] };
                best.u[i] = if counts { b * over } else { best.u[i] };
                best.v[i] = if counts { c * over } else { best.v[i] };
                best.number[i] = if counts { number } else { best.number[i] };
            }
        }
    }
}

#[multiversion::multiversion(targets = "simd")]
fn occluded(
    few: &FewTriangles,
    block: &RayBlock,
    of_edges: &mut [Doubles],
    blocked: &mut [u32; LANES],
) {
    let lines = BlockLines::of(block);
    let [t_min, t_max] = [block.t_min, block.t_max].map(|limits| limits.map(f64::from));
    let [x, y, z] = &lines.origin;
    for run in &few.runs {
        if !reaches(run.bounds, block, &lines) {
            continue;
        }
        sides(&few.edges[run.edges.clone()], &lines, &mut of_edges[run.edges.clone()]);
        for triangle in &few.triangles[run.triangles.clone()] {
            let [first, second, third] = triangle.edges.map(|(edge, _)| &of_edges[edge]);
            let [sa, sb, sc] = triangle.edges.map(|(_, sign)| sign);
            let (mut lowest, mut highest, mut sums) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
            for i in 0..LANES {
                let (a, b, c) = (first[i] * sa, second[i] * sb, third[i] * sc);
                lowest[i] = least(least(a, b), c);
                highest[i] = most(most(a, b), c);
                sums[i] = a + b + c;
            }
            if !is_inside(&lowest, &highest) {
                continue;
            }
            let [nx, ny, nz] = triangle.normal;
            for i in 0..LANES {
                let height = triangle.offset - (x[i] * nx + y[i] * ny + z[i] * nz);
                let t = height / sums[i];
                let is_inside = (lowest[i] >= 0.0) | (highest[i] <= 0.0);
                let counts = is_inside & (sums[i] != 0.0) & (t > t_min[i]) & (t <= t_max[i]);
                blocked[i] |= u32::from(counts);
            }
        }
    }
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
            assert!(few.edges.len() < 3 * few.triangles.len(), "edges are shared");
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
