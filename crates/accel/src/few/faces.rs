//! Blocks of rays against the faces of a scene of few triangles in single precision: convex quadrilaterals, as two
//! triangles in one plane often are, and triangles alone.
//!
//! The plane is met first, then the place in it is held against each side. Where roundings leave it open on which
//! side of an outline a ray passes, it is in doubt, and [`super::edges`] decide in double precision.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use std::hint::select_unpredictable;
use std::ops::Range;

use etendue_geometry::block::{Floats, LANES};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{MISS, RayBlock};

use crate::single::round;

/// Roundings of single precision in the distance of a place from a side, of the distances from the frame's origin of
/// the ray's start and of the scene's farthest corner: so many of the place and of the side's own numbers, each of
/// half a unit.
const PLACE_ROUNDINGS: f32 = 8.0 * f32::EPSILON;

/// Roundings, likewise, over the cosine of incidence: of the distance along the ray, and of
/// quadrilaterals that are not quite flat.
const DISTANCE_ROUNDINGS: f32 = 6.0 * f32::EPSILON;

/// A number that goes linearly with a place in a face's plane: at its origin, and along x and y.
type Linear = [f32; 3];

/// A triangle, or two that make a convex quadrilateral, in the frame. Places in its plane have coordinates x and y
/// (m), of which x is the distance from the first side.
#[derive(Debug)]
pub(super) struct Face {
    normal: [f32; 3],
    /// Distance of the plane from the frame's origin along the normal (m).
    offset: f32,
    /// Unit vectors along x and y, and the coordinates of the frame's origin (m).
    axes: [([f32; 3], f32); 2],
    /// Distances from the sides but the first (m), inside above 0; a triangle's last is there twice.
    sides: [Linear; 3],
    /// Distance from the diagonal (m), above 0 in the first triangle; 1 of a single triangle.
    diagonal: Linear,
    /// Weights of the second and third corners, by triangle.
    weights: [[Linear; 2]; 2],
    /// Numbers of its triangles in the list.
    pub(super) triangles: Range<usize>,
}

/// A face's axes while it is made, in double precision.
struct FaceBasis {
    origin: DVec3,
    x: DVec3,
    y: DVec3,
}

impl FaceBasis {
    fn linear(&self, at_origin: f64, gradient: DVec3) -> Linear {
        [at_origin, gradient.dot(self.x), gradient.dot(self.y)].map(round)
    }

    /// Distance from the side between two corners, above 0 on the left as the normal sees it.
    fn side(&self, normal: DVec3, [from, to]: [DVec3; 2]) -> Linear {
        let inwards = normal.cross(to - from).normalize();
        self.linear(inwards.dot(self.origin - from), inwards)
    }

    /// Weights of the second and third corners.
    fn weights(&self, normal: DVec3, corners: [DVec3; 3]) -> [Linear; 2] {
        [1, 2].map(|k| {
            let [from, to] = [corners[(k + 1) % 3], corners[(k + 2) % 3]];
            let inwards = normal.cross(to - from);
            let gradient = inwards / inwards.dot(corners[k] - from);
            self.linear(gradient.dot(self.origin - from), gradient)
        })
    }
}

impl Face {
    /// The face that triangles begin with, of which the first has number `first`: of that alone, or of the first two.
    pub(super) fn first_of(triangles: &[[DVec3; 3]], first: usize, radius: f32) -> Option<Self> {
        let &own = triangles.first()?;
        let tolerance = f64::from(f32::EPSILON * radius);
        let other = triangles.get(1).copied();
        let quad = other.and_then(|other| quadrilateral(own, other, tolerance));
        let normal = (own[1] - own[0]).cross(own[2] - own[0]).normalize();
        let outline = quad.as_ref().map_or(&own[..], |quad| &quad[..]);
        let along = (outline[1] - outline[0]).normalize();
        let plane = FaceBasis { origin: outline[0], x: normal.cross(along).normalize(), y: along };
        let side = |k: usize| {
            let k = k.min(outline.len() - 1);
            plane.side(normal, [outline[k], outline[(k + 1) % outline.len()]])
        };
        let axis = |axis: DVec3| (axis.to_array().map(round), round(-axis.dot(plane.origin)));
        let diagonal = quad.map(|[_, from, _, to]| plane.side(normal, [from, to]));
        Some(Self {
            normal: normal.to_array().map(round),
            offset: round(normal.dot(plane.origin)),
            axes: [axis(plane.x), axis(plane.y)],
            sides: [1, 2, 3].map(side),
            diagonal: diagonal.unwrap_or([1.0, 0.0, 0.0]),
            weights: [own, quad.and(other).unwrap_or(own)].map(|own| plane.weights(normal, own)),
            triangles: first..first + if quad.is_some() { 2 } else { 1 },
        })
    }

    /// The number of the triangle at a place of the face, and its second and third weights there.
    #[inline(always)]
    pub(super) fn at(&self, [x, y]: [f32; 2]) -> (usize, [f32; 2]) {
        let linear = |[c, a, b]: Linear| c + a * x + b * y;
        let is_other = usize::from(linear(self.diagonal) < 0.0);
        let [second, third] = self.weights[is_other];
        (self.triangles.start + is_other, [linear(second), linear(third)])
    }
}

/// The corners of two triangles in order, if they make a convex quadrilateral that is flat but for `tolerance` (m):
/// the one of the first that the other lacks, the diagonal's first, the other's own, the diagonal's second.
fn quadrilateral(own: [DVec3; 3], other: [DVec3; 3], tolerance: f64) -> Option<[DVec3; 4]> {
    let edge = |of: [DVec3; 3], k: usize| [of[(k + 1) % 3], of[(k + 2) % 3]];
    let mut pairs = (0..3).flat_map(|k| (0..3).map(move |l| (k, l)));
    let (k, l) = pairs.find(|&(k, l)| {
        let [from, to] = edge(other, l);
        edge(own, k) == [to, from]
    })?;
    let [from, to] = edge(own, k);
    let quad = [own[k], from, other[l], to];
    let normal = (from - own[k]).cross(to - own[k]).normalize();
    let is_flat = normal.dot(other[l] - from).abs() <= tolerance;
    let turn = |i: usize| {
        let [before, here, after] = [quad[(i + 3) % 4], quad[i], quad[(i + 1) % 4]];
        let [before, after] = [(here - before).normalize(), (after - here).normalize()];
        normal.dot(before.cross(after))
    };
    // A corner that is hardly one has sides whose roundings tell nothing.
    (is_flat && (0..4).all(|i| turn(i) > 1e-3)).then_some(quad)
}

/// Faces of triangles that follow each other in the list, and their box.
#[derive(Debug)]
pub(super) struct FaceRun {
    pub(super) faces: Range<usize>,
    /// Number of the first face.
    pub(super) first: u32,
    /// From and to, in the frame, and a little beyond.
    pub(super) bounds: [[f32; 3]; 2],
}

/// The faces of a scene, in runs.
#[derive(Debug, Default)]
pub(super) struct FaceList {
    pub(super) faces: Vec<Face>,
    pub(super) runs: Vec<FaceRun>,
    /// The largest distance of a corner from the frame's origin (m).
    pub(super) radius: f32,
}

/// The closest hits of a block's rays: distances (m), numbers of faces or [`MISS`], and places in them.
pub(super) struct NearestFace {
    pub(super) t: Floats,
    pub(super) face: [u32; LANES],
    pub(super) place: [Floats; 2],
    /// 1 of rays of which roundings leave it open.
    pub(super) doubts: [u32; LANES],
}

impl NearestFace {
    pub(super) const NONE: Self =
        Self { t: [0.0; LANES], face: [MISS; LANES], place: [[0.0; LANES]; 2], doubts: [0; LANES] };
}

/// Occlusion of the rays of a block.
#[derive(Default)]
pub(super) struct BlockOcclusion {
    /// 1 of rays that have.
    pub(super) blocked: [u32; LANES],
    /// 1 of rays of which roundings leave it open.
    pub(super) doubts: [u32; LANES],
}

/// Values that are worked out once of a block's rays.
struct BlockRays {
    /// Farthest distances that count (m), finite.
    t_max: Floats,
    /// The distances from the frame's origin of their starts and of the scene's farthest corner (m).
    size: Floats,
    /// Of the directions.
    inverse: [Floats; 3],
}

impl BlockRays {
    #[inline(always)]
    fn of(block: &RayBlock, radius: f32) -> Self {
        let [x, y, z] = &block.origin;
        let (mut t_max, mut size, mut inverse) = ([0.0; LANES], [0.0; LANES], [[0.0; LANES]; 3]);
        for i in 0..LANES {
            size[i] = (x[i] * x[i] + y[i] * y[i] + z[i] * z[i]).sqrt() + radius;
            t_max[i] = if block.t_max[i] < f32::MAX { block.t_max[i] } else { f32::MAX };
        }
        for (inverse, direction) in inverse.iter_mut().zip(&block.direction) {
            for i in 0..LANES {
                inverse[i] = 1.0 / direction[i];
            }
        }
        Self { t_max, size, inverse }
    }
}

/// Crossings of a block's rays with a face's plane.
struct FaceCrossing {
    /// Distances (m); infinity of rays that do not cross it between their ends.
    t: Floats,
    place: [Floats; 2],
    /// Distance from the nearest side (m), inside above 0.
    least: Floats,
    /// Uncertainty of that distance by roundings (m).
    blur: Floats,
}

/// Intersects rays with a face's plane between their nearest distances and the farthest, `t_max`, which are finite;
/// `None` where none crosses it.
#[inline(always)]
fn cross(face: &Face, block: &RayBlock, lines: &BlockRays, t_max: &Floats) -> Option<FaceCrossing> {
    let ([x, y, z], [dx, dy, dz]) = (&block.origin, &block.direction);
    let (t_min, [nx, ny, nz]) = (&block.t_min, face.normal);
    let (mut t, mut blur) = ([0.0; LANES], [0.0; LANES]);
    let mut any = 0_u32;
    for i in 0..LANES {
        let height = face.offset - (x[i] * nx + y[i] * ny + z[i] * nz);
        let slope = 1.0 / (dx[i] * nx + dy[i] * ny + dz[i] * nz);
        let along = height * slope;
        // The distance of a ray in the plane is not a number, and leaves it in doubt.
        let is_beyond = (along <= t_min[i]) | (along > t_max[i]);
        t[i] = select_unpredictable(is_beyond, f32::INFINITY, along);
        blur[i] = lines.size[i] * (PLACE_ROUNDINGS + DISTANCE_ROUNDINGS * slope.abs());
        any |= u32::from(!is_beyond);
    }
    if any == 0 {
        return None;
    }
    let mut place = [[0.0; LANES]; 2];
    let [([ax, ay, az], a), ([bx, by, bz], b)] = face.axes;
    for i in 0..LANES {
        let at = [x[i] + t[i] * dx[i], y[i] + t[i] * dy[i], z[i] + t[i] * dz[i]];
        place[0][i] = at[0] * ax + at[1] * ay + at[2] * az + a;
        place[1][i] = at[0] * bx + at[1] * by + at[2] * bz + b;
    }
    let mut least = place[0];
    for [c, along, across] in face.sides {
        for i in 0..LANES {
            let side = c + along * place[0][i] + across * place[1][i];
            least[i] = select_unpredictable(side < least[i], side, least[i]);
        }
    }
    Some(FaceCrossing { t, place, least, blur })
}

impl FaceCrossing {
    /// Notes rays of which roundings leave it open whether they meet the face.
    #[inline(always)]
    fn doubt(&self, doubts: &mut [u32; LANES]) {
        for i in 0..LANES {
            let is_clear = (self.t[i] == f32::INFINITY) | (self.least[i].abs() >= self.blur[i]);
            doubts[i] = select_unpredictable(is_clear, doubts[i], 1);
        }
    }

    #[inline(always)]
    fn is_hit(&self, i: usize) -> bool {
        (self.t[i] < f32::INFINITY) & (self.least[i] >= 0.0)
    }
}

/// Bound on what three roundings may do to the distance of a box, as a share of it, with a margin.
const SLACK: f32 = 1e-6;

/// Tests whether any ray of a block meets a box. Where a ray runs in the plane of a side, what is
/// not a number parts nothing: the box is a little larger than what is in it.
#[inline(always)]
fn reaches([from, to]: [[f32; 3]; 2], block: &RayBlock, inverse: &[Floats; 3]) -> bool {
    let (mut enter, mut exit) = (block.t_min, block.t_max);
    for axis in 0..3 {
        let (origin, inverse) = (&block.origin[axis], &inverse[axis]);
        for i in 0..LANES {
            let a = (from[axis] - origin[i]) * inverse[i];
            let b = (to[axis] - origin[i]) * inverse[i];
            let (near, far) = if a < b { (a, b) } else { (b, a) };
            enter[i] = select_unpredictable(near > enter[i], near, enter[i]);
            exit[i] = select_unpredictable(far < exit[i], far, exit[i]);
        }
    }
    let mut any = 0_u32;
    for i in 0..LANES {
        any |= u32::from(enter[i] * (1.0 - SLACK) <= exit[i] * (1.0 + SLACK));
    }
    any != 0
}

/// The closest hits of a block.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn closest(list: &FaceList, block: &RayBlock, nearest: &mut NearestFace) {
    let lines = BlockRays::of(block, list.radius);
    let mut doubts = [0; LANES];
    let (mut t, mut hit, mut place) = (lines.t_max, [MISS; LANES], [[0.0; LANES]; 2]);
    for run in &list.runs {
        if !reaches(run.bounds, block, &lines.inverse) {
            continue;
        }
        for (number, face) in (run.first..).zip(&list.faces[run.faces.clone()]) {
            let Some(own) = cross(face, block, &lines, &t) else { continue };
            own.doubt(&mut doubts);
            for i in 0..LANES {
                let counts = own.is_hit(i);
                t[i] = select_unpredictable(counts, own.t[i], t[i]);
                hit[i] = select_unpredictable(counts, number, hit[i]);
                place[0][i] = select_unpredictable(counts, own.place[0][i], place[0][i]);
                place[1][i] = select_unpredictable(counts, own.place[1][i], place[1][i]);
            }
        }
    }
    *nearest = NearestFace { t, face: hit, place, doubts };
}

/// Finds the rays of a block that have anything between their ends.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn occluded(list: &FaceList, block: &RayBlock, occlusion: &mut BlockOcclusion) {
    let lines = BlockRays::of(block, list.radius);
    let (mut doubts, mut hit) = ([0; LANES], [0; LANES]);
    for run in &list.runs {
        if !reaches(run.bounds, block, &lines.inverse) {
            continue;
        }
        for face in &list.faces[run.faces.clone()] {
            let Some(own) = cross(face, block, &lines, &lines.t_max) else { continue };
            own.doubt(&mut doubts);
            for i in 0..LANES {
                hit[i] = select_unpredictable(own.is_hit(i), 1, hit[i]);
            }
        }
    }
    *occlusion = BlockOcclusion { blocked: hit, doubts };
}
