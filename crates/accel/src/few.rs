//! Scenes of few triangles: each ray against each of their faces, sixteen rays at a time. Below some dozens of
//! triangles that takes less time than going down a tree. Runs of triangles whose box no ray of a block meets are
//! left out.
//!
//! Rays are those of single precision, and so is what they meet, as in Embree. Where a ray meets a face's plane so
//! near a side that single precision cannot tell whether it is inside, it is traced again in double precision. There a
//! ray passes an edge on the side that the sign of their Plücker product tells. Triangles that
//! share an edge share its sign, whatever rounding did to it, so no ray slips between them along the edge (R. Jones,
//! "Intersecting a ray and a triangle with Plücker coordinates", Ray Tracing News 13.1, 2000; K. Shoemake, "Plücker
//! coordinate tutorial", Ray Tracing News 11.1, 1998). Where several edges meet, signs may contradict each other.

mod edges;
mod faces;

use etendue_geometry::block::LANES;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Geometry, MISS, RayBlock, is_degenerate};

use self::edges::{FewTriangle, MOST_TRIANGLES, PluckerEdges};
use self::faces::{BlockOcclusion, Face, FaceList, FaceRun, NearestFace};
use crate::single::{F32Frame, round};

/// Identity of a triangle in the scene.
#[derive(Debug, Clone, Copy)]
struct TriangleId {
    /// Its normal as hits tell it: of the placement's front.
    front: [f32; 3],
    placement: u32,
    triangle: u32,
}

/// The most triangles of a run: those of a box.
const RUN: usize = 12;

/// A scene of few triangles.
#[derive(Debug)]
pub(crate) struct FewTriangles {
    frame: F32Frame,
    edges: PluckerEdges,
    triangles: Vec<FewTriangle>,
    named: Vec<TriangleId>,
    list: FaceList,
}

impl FewTriangles {
    /// Those of `geometry`; `None` where there are too many.
    pub(crate) fn of(geometry: &Geometry) -> Option<Self> {
        if geometry.triangles() > MOST_TRIANGLES as u64 {
            return None;
        }
        let mut few = Self {
            frame: F32Frame::of(geometry.loose_bounds()),
            edges: PluckerEdges::default(),
            triangles: Vec::new(),
            named: Vec::new(),
            list: FaceList::default(),
        };
        let mut ends: Vec<[[f64; 3]; 2]> = Vec::new();
        let mut corners: Vec<[DVec3; 3]> = Vec::new();
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
                let edges =
                    [0, 1, 2].map(|k| few.edge([wide[(k + 1) % 3], wide[(k + 2) % 3]], &mut ends));
                few.triangles.push(FewTriangle {
                    edges: edges.map(|(edge, _)| edge),
                    lengths: edges.map(|(_, length)| length),
                    normal,
                    corner: wide[0],
                });
                few.named.push(TriangleId {
                    front: (normal * place.handedness()).to_array().map(round),
                    placement: number,
                    triangle: u32::try_from(triangle).unwrap_or(MISS),
                });
                corners.push(wide);
            }
        }
        few.join(&corners);
        Some(few)
    }

    /// The number of the edge between two corners, found or appended, and its length, negative where it runs the
    /// other way.
    fn edge(&mut self, [from, to]: [DVec3; 2], ends: &mut Vec<[[f64; 3]; 2]>) -> (usize, f64) {
        let [a, b] = [from.to_array(), to.to_array()];
        let is_own = |ends: &[[f64; 3]; 2]| *ends == [a, b] || *ends == [b, a];
        let at = ends.iter().position(is_own).unwrap_or_else(|| {
            ends.push([a, b]);
            self.edges.push(from, to)
        });
        self.list.radius = self.list.radius.max(round(from.length()));
        let length = from.distance(to);
        (at, if ends[at] == [a, b] { length } else { -length })
    }

    /// Makes faces and runs of the triangles, of which these are the corners.
    fn join(&mut self, corners: &[[DVec3; 3]]) {
        let is_together = |a: &TriangleId, b: &TriangleId| a.placement == b.placement;
        let ends = self.named.chunk_by(is_together).scan(0, |end, own| {
            *end += own.len();
            Some(*end)
        });
        let list = &mut self.list;
        let (mut number, mut held, mut bounds) = (0, RUN, Bounds::EMPTY);
        for end in ends {
            while let Some(face) = Face::first_of(&corners[number..end], number, list.radius) {
                let count = face.triangles.len();
                if held + count > RUN {
                    (held, bounds) = (0, Bounds::EMPTY);
                    let start = list.faces.len();
                    list.runs.push(FaceRun {
                        faces: start..start,
                        first: u32::try_from(start).unwrap_or(MISS),
                        bounds: [[0.0; 3]; 2],
                    });
                }
                let own = &corners[number..number + count];
                own.iter().flatten().for_each(|&corner| bounds.include(corner));
                // Some roundings of the largest coordinate.
                let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
                let beyond = DVec3::splat(largest * 4.0 * f64::from(f32::EPSILON));
                let grown = [bounds.min - beyond, bounds.max + beyond];
                if let Some(run) = list.runs.last_mut() {
                    run.faces.end += 1;
                    run.bounds = grown.map(|corner| corner.to_array().map(round));
                }
                list.faces.push(face);
                (number, held) = (number + count, held + count);
            }
        }
    }

    /// Frame of the coordinates of blocks.
    pub(crate) fn frame(&self) -> &F32Frame {
        &self.frame
    }

    /// The closest hits of blocks, as [`BlockAccel`](crate::BlockAccel) has them; of triangles in one place the last.
    pub(crate) fn closest_of_blocks(&self, blocks: &mut [RayBlock]) {
        let mut nearest = NearestFace::NONE;
        for block in blocks {
            block.clear_hits();
            faces::closest(&self.list, block, &mut nearest);
            for lane in 0..LANES {
                if nearest.doubts[lane] != 0 {
                    if let Some(hit) = edges::closest(&self.edges, &self.triangles, block, lane) {
                        self.note(block, lane, hit.number, round(hit.t), hit.weights.map(round));
                    }
                } else if let Some(face) = self.list.faces.get(nearest.face[lane] as usize) {
                    let [x, y] = &nearest.place;
                    let (number, weights) = face.at([x[lane], y[lane]]);
                    self.note(block, lane, number, nearest.t[lane], weights);
                }
            }
        }
    }

    /// Tells a block what a ray hit: the triangle's number in the list, its distance (m) and weights.
    #[inline(always)]
    fn note(&self, block: &mut RayBlock, lane: usize, number: usize, t: f32, [u, v]: [f32; 2]) {
        let Some(hit) = self.named.get(number) else { return };
        (block.t_max[lane], block.u[lane], block.v[lane]) = (t, u, v);
        (block.placement[lane], block.triangle[lane]) = (hit.placement, hit.triangle);
        for axis in 0..3 {
            block.normal[axis][lane] = hit.front[axis];
        }
    }

    /// Tests whether anything is between the ends of the rays of blocks.
    pub(crate) fn occluded_of_blocks(&self, blocks: &mut [RayBlock]) {
        let mut occlusion = BlockOcclusion::default();
        for block in blocks {
            faces::occluded(&self.list, block, &mut occlusion);
            for lane in 0..LANES {
                let is_blocked = match occlusion.doubts[lane] {
                    0 => occlusion.blocked[lane] != 0,
                    _ => edges::is_occluded(&self.edges, &self.triangles, block, lane),
                };
                block.t_max[lane] = if is_blocked { f32::NEG_INFINITY } else { block.t_max[lane] };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use etendue_geometry::glam::DMat3;
    use etendue_geometry::{
        Detail, HitBatch, HitPrecision, Mesh, Placement, Positions, RayBatch, RayBlocks, Transform,
        Vertices,
    };

    use super::*;
    use crate::{Accel, BuildOptions, Exact};

    /// Numbers in −1..1 that are spread out (Weyl's sequence).
    fn spread(k: u32, step: f64) -> f64 {
        2.0 * (f64::from(k) * step).fract() - 1.0
    }

    fn direction(k: u32) -> DVec3 {
        let (up, azimuth) = (spread(k, 0.618_034), 2.399_963 * f64::from(k));
        let r = (1.0 - up * up).sqrt();
        DVec3::new(r * azimuth.cos(), up, r * azimuth.sin())
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

    /// A frustum, whose faces are quadrilaterals of two triangles that begin at any of their corners.
    fn frustum() -> Mesh {
        let at = |k: u32| {
            let [x, y, z] =
                [k & 1, k >> 1 & 1, k >> 2].map(|side| if side == 0 { -1.0 } else { 1.0 });
            let narrow = if y > 0.0 { 0.5 } else { 1.0 };
            [narrow * x, y, narrow * z]
        };
        let corners: Vec<[f32; 3]> = (0..8).map(at).collect();
        let faces =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let halves = |(k, [a, b, c, d]): (usize, [u32; 4])| {
            let mut halves = [[a, b, c], [a, c, d]];
            halves[0].rotate_left(k % 3);
            halves[1].rotate_left((k + 1) % 3);
            halves
        };
        mesh(&corners, faces.into_iter().enumerate().flat_map(halves).collect())
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

    /// A frustum and a mirrored one in an icosahedron, at a place.
    fn quadrilaterals(far: f64) -> Arc<Geometry> {
        let at = |shift: f64| DVec3::splat(far + shift);
        let small = Transform::new(DMat3::from_rotation_y(0.4) * 0.3, at(-0.4));
        let mut geometry = Geometry::alone(frustum(), small);
        let mirror = DMat3::from_diagonal(DVec3::new(-0.3, 0.3, 0.2));
        let placement = geometry.placements[0].clone();
        geometry.placements.push(Placement {
            world_from_mesh: Transform::new(mirror, at(0.3)),
            ..placement.clone()
        });
        geometry.meshes.push(icosahedron());
        geometry.placements.push(Placement {
            mesh: 1,
            world_from_mesh: Transform::new(DMat3::IDENTITY, at(0.0)),
            ..placement
        });
        Arc::new(geometry)
    }

    #[test]
    fn hits_are_those_of_the_reference() {
        let cases = [0.0, 1e4].map(|far| [(far, scene(far), 52), (far, quadrilaterals(far), 32)]);
        for (far, geometry, count) in cases.into_iter().flatten() {
            let few = FewTriangles::of(&geometry).unwrap();
            assert_eq!(few.list.faces.len(), count);
            assert!(few.edges.count < 3 * few.named.len(), "edges are shared");
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
            few.frame.convert(&rays, &mut blocks);
            rays.precision = HitPrecision::Single;
            few.frame.convert(&rays, &mut single);
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
        // As long as scenes may be.
        for scale in [1e-12, 1.0, 0.5e12] {
            no_ray_slips_through_an_edge_of(icosahedron(), scale, 0.7);
            no_ray_slips_through_an_edge_of(frustum(), scale, 0.45);
        }
    }

    /// From so far about the middle, in units of the mesh, which is scaled.
    fn no_ray_slips_through_an_edge_of(body: Mesh, scale: f64, inside: f64) {
        let place = Transform::new(DMat3::from_diagonal(DVec3::splat(scale)), DVec3::ZERO);
        let geometry = Geometry::alone(body, place);
        let few = FewTriangles::of(&geometry).unwrap();
        let mut rays = RayBatch::default();
        let body = &geometry.meshes[0];
        for k in 0..100_000_u32 {
            let start = DVec3::from([0.377, 0.913, 0.151].map(|step| inside * spread(k, step)));
            let [a, b, _] = body.corners(k as usize % body.triangles.len());
            // To 10⁻⁶ of its length from the corners, where all edges are near.
            let near = 10.0_f64.powf(-6.0 * (f64::from(k) * 0.731).fract());
            let target = a + (b - a) * (0.5 * near);
            rays.push(start * scale, (target - start).normalize());
        }
        rays.precision = HitPrecision::Single;
        let mut blocks = RayBlocks::default();
        few.frame.convert(&rays, &mut blocks);
        let mut shadows = blocks.clone();
        few.closest_of_blocks(blocks.blocks_mut());
        few.occluded_of_blocks(shadows.blocks_mut());
        let missed = blocks.blocks().iter().flat_map(|block| block.placement);
        assert_eq!(missed.filter(|&placement| placement == MISS).count(), 0);
        let whole = |block: &RayBlock| (0..LANES).all(|lane| block.is_blocked(lane));
        assert!(shadows.blocks().iter().all(whole));
    }

    /// Faces are flat and convex: two triangles are no face that are bent along the diagonal, not
    /// convex, wound the other way, or of two placements.
    #[test]
    fn faces_are_flat_and_convex() {
        let base = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let faces = |last: [f32; 3], second: [u32; 3]| {
            let corners = [base[0], base[1], base[2], last];
            let own = mesh(&corners, vec![[0, 1, 2], second]);
            FewTriangles::of(&Geometry::alone(own, Transform::IDENTITY)).unwrap().list.faces.len()
        };
        assert_eq!(faces([0.9, 0.8, 0.0], [3, 2, 1]), 1);
        assert_eq!(faces([0.9, 0.8, 1e-5], [3, 2, 1]), 2, "bent");
        assert_eq!(faces([3.0, -0.5, 0.0], [3, 2, 1]), 2, "not convex");
        assert_eq!(faces([0.9, 0.8, 0.0], [3, 1, 2]), 2, "wound the other way");
        let half = |triangle| mesh(&[base[0], base[1], base[2], [1.0, 1.0, 0.0]], vec![triangle]);
        let mut geometry = Geometry::alone(half([0, 1, 2]), Transform::IDENTITY);
        geometry.meshes.push(half([3, 2, 1]));
        geometry.placements.push(Placement { mesh: 1, ..geometry.placements[0].clone() });
        assert_eq!(FewTriangles::of(&geometry).unwrap().list.faces.len(), 2, "of two placements");
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
