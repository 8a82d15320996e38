//! *Double precision measures*: where a ray meets the triangle that a single-precision backend found.
//!
//! Everything is relative to the ray's origin, so nothing is lost far from the world's origin: with
//! local corners `p0 p1 p2`, the placement's linear part `L` and its offset from the ray's origin
//! `o = T − O` (exact when the camera is near, see [`etendue_geometry::Transform`]),
//!
//! ```text
//! a = L p0 + o,   e1 = L (p1 − p0),   e2 = L (p2 − p0)
//! ```
//!
//! go into the one formula of [`crate::triangle`]. Its distance comes from the plane, whose error does
//! not grow with `|a|/|e|`: differences of f32 coordinates are exact in f64. The relative error of `t` is
//! a few 2⁻⁵³ over the cosine of incidence.
//!
//! A hit is *valid* when `u`, `v` and `1 − u − v` are negative by no more than their own rounding
//! error. Single precision picks the wrong one of two neighbours when a ray passes within about 10⁻⁷
//! of their edge; such a hit comes out invalid here and is looked at again by the backend.

use etendue_geometry::glam::DMat3;
use std::ops::Range;

use crate::triangle::{Vector, at, cross_plane};
use etendue_geometry::{
    Detail, Geometry, HitBatch, MISS, Mesh, Placement, Positions, RayBatch, Transform,
};

/// Rays worked on side by side: long enough to vectorise, short enough to stay in the first cache.
pub(crate) const LANES: usize = 64;

/// Barycentric coordinates are trusted to no worse than this, however grazing the ray: beyond it a
/// hit is looked at again.
const WORST_TOLERANCE: f64 = 1e-6;

/// Barycentric rounding error in units of 2⁻⁵³ times magnitudes: three products and their sums, each
/// within one unit, on values that are themselves within two.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

pub(crate) type Lane = [f64; LANES];

/// The triangles of one chunk of rays as seen from the rays' origins, and what comes of them.
#[derive(Debug)]
pub(crate) struct ChunkTriangles {
    /// Corner indices of each triangle.
    indices: [[u32; 3]; LANES],
    /// The corners `[corner][axis]` in their mesh, as most meshes have them, and in f64.
    narrow: [[[f32; LANES]; 3]; 3],
    corners: [[Lane; 3]; 3],
    pub(crate) a: [Lane; 3],
    pub(crate) e1: [Lane; 3],
    pub(crate) e2: [Lane; 3],
    pub(crate) d: [Lane; 3],
    /// Sum of the magnitudes that `a` was summed from, for its rounding error.
    magnitude: Lane,
    handedness: Lane,
    t: Lane,
    u: Lane,
    v: Lane,
    /// Excess of `u`, `v` or `1 − u − v` below zero beyond its rounding error; ≤ 0 is valid.
    excess: Lane,
    /// Positive when the ray comes from the triangle's front.
    front: Lane,
    n: [Lane; 3],
}

impl Default for ChunkTriangles {
    fn default() -> Self {
        let zero = [0.0; LANES];
        Self {
            indices: [[0; 3]; LANES],
            narrow: [[[0.0; LANES]; 3]; 3],
            corners: [[zero; 3]; 3],
            a: [zero; 3],
            e1: [zero; 3],
            e2: [zero; 3],
            d: [zero; 3],
            magnitude: zero,
            handedness: zero,
            t: zero,
            u: zero,
            v: zero,
            excess: zero,
            front: zero,
            n: [zero; 3],
        }
    }
}

/// Result of solving for each ray's hit, beside the hit itself.
#[derive(Debug, Default)]
pub(crate) struct HitSolutions {
    /// The ray meets its triangle within `t_min..=t_max`; true for misses.
    pub(crate) valid: Vec<bool>,
    /// It meets the triangle's front; false for misses.
    pub(crate) front: Vec<bool>,
    /// True if all are valid.
    pub(crate) all_valid: bool,
    /// True if triangles are met from both sides.
    pub(crate) both_sides: bool,
}

/// Works out `t` (and `u`, `v`, the normal, when `hits.detail` asks) for every entry of `hits` that
/// names a triangle, and makes the others misses.
pub(crate) fn solve(
    geometry: &Geometry,
    rays: &RayBatch,
    hits: &mut HitBatch,
    lanes: &mut ChunkTriangles,
    solved: &mut HitSolutions,
) {
    solved.valid.resize(rays.len(), true);
    solved.front.resize(rays.len(), false);
    solved.all_valid = true;
    let mut sides = [false; 2];
    let mut start = 0;
    while start < rays.len() {
        let count = LANES.min(rays.len() - start);
        lanes.gather(geometry, rays, &hits.placement, &hits.triangle, start..start + count);
        measure(lanes, hits.detail == Detail::Surface);
        let seen = scatter(rays, hits, start, count, lanes, solved);
        solved.all_valid &= seen.all_valid;
        sides = [sides[0] | seen.front, sides[1] | seen.back];
        start += count;
    }
    solved.both_sides = sides == [true; 2];
}

/// Number of values at the beginning that are `wanted`.
fn leading(values: &[u32], wanted: impl Fn(&u32) -> bool) -> usize {
    values.iter().position(|value| !wanted(value)).unwrap_or(values.len())
}

/// A placement's transform with what is asked of it for every hit.
struct PlacedTransform<'a> {
    transform: &'a Transform,
    handedness: f64,
    /// Nothing to multiply.
    moved_only: bool,
    /// The corners are in [`ChunkTriangles::narrow`].
    narrow: bool,
}

impl ChunkTriangles {
    /// Fills the lanes with one triangle a ray, by placement and triangle, for the rays of `range`. Where
    /// there is none, whatever stands in the lanes is measured and not looked at.
    pub(crate) fn gather(
        &mut self,
        geometry: &Geometry,
        rays: &RayBatch,
        placements: &[u32],
        triangles: &[u32],
        range: Range<usize>,
    ) {
        for axis in 0..3 {
            self.d[axis][..range.len()].copy_from_slice(&rays.directions()[axis][range.clone()]);
        }
        let mut i = range.start;
        while i < range.end {
            let index = placements[i];
            let rest = &placements[i..range.end];
            // Mostly all of them, which is told without a branch for each.
            let others = rest.iter().fold(0, |others, &other| others | (other ^ index));
            let same = |&other: &u32| other == index;
            let run = i..if others == 0 { range.end } else { i + leading(rest, same) };
            i = run.end;
            if index != MISS {
                let placement = &geometry.placements[index as usize];
                let mesh = geometry.mesh_of(placement);
                self.gather_run(placement, mesh, rays, triangles, range.start, run);
            }
        }
    }

    /// Fills the lanes of consecutive rays that hit the same placement.
    fn gather_run(
        &mut self,
        placement: &Placement,
        mesh: &Mesh,
        rays: &RayBatch,
        numbers: &[u32],
        first: usize,
        run: Range<usize>,
    ) {
        let here = run.start - first..run.end - first;
        let triangles: &[[u32; 3]] = &mesh.triangles;
        // One kind of memory at a time: the processor fetches as many ahead as it can.
        for (indices, &triangle) in self.indices[here.clone()].iter_mut().zip(&numbers[run.clone()])
        {
            *indices = triangles[triangle as usize];
        }
        let narrow = match &mesh.positions {
            // The usual layout, with one bounds check a corner.
            Positions::F32(vertices) if vertices.stride() == 3 => {
                let (floats, _) = vertices.floats().as_chunks::<3>();
                for lane in here.clone() {
                    for (k, corner) in self.indices[lane].into_iter().enumerate() {
                        let point = floats[corner as usize];
                        let [x, y, z] = &mut self.narrow[k];
                        (x[lane], y[lane], z[lane]) = (point[0], point[1], point[2]);
                    }
                }
                true
            }
            positions @ (Positions::F32(_) | Positions::F64(_)) => {
                for lane in here.clone() {
                    for (k, corner) in self.indices[lane].into_iter().enumerate() {
                        let point = positions.get(corner as usize);
                        let [x, y, z] = &mut self.corners[k];
                        (x[lane], y[lane], z[lane]) = (point[0], point[1], point[2]);
                    }
                }
                false
            }
        };
        let transform = &placement.world_from_mesh;
        let place = PlacedTransform {
            transform,
            handedness: transform.handedness(),
            moved_only: transform.linear == DMat3::IDENTITY,
            narrow,
        };
        let origin = rays.origins().map(|axis| &axis[run.clone()]);
        self.put(here, &place, origin);
    }

    /// Brings the corners of some lanes to where they are seen from the rays' origins.
    fn put(&mut self, range: Range<usize>, place: &PlacedTransform<'_>, origin: [&[f64]; 3]) {
        see(self, range, place, origin);
    }
}

#[multiversion::multiversion(targets = "simd")]
fn see(
    lanes: &mut ChunkTriangles,
    range: Range<usize>,
    place: &PlacedTransform<'_>,
    origin: [&[f64]; 3],
) {
    let Range { start, end } = range;
    let ChunkTriangles { narrow, corners, a, e1, e2, magnitude, handedness, .. } = lanes;
    // Corners in f64, and from them the edges.
    if place.narrow {
        for (wide, narrow) in corners.iter_mut().flatten().zip(narrow.iter().flatten()) {
            for (wide, &narrow) in wide[start..end].iter_mut().zip(&narrow[start..end]) {
                *wide = f64::from(narrow);
            }
        }
    }
    magnitude[start..end].fill(0.0);
    handedness[start..end].fill(place.handedness);
    let [p, q, r] = corners;
    for axis in 0..3 {
        for i in start..end {
            a[axis][i] = p[axis][i];
            e1[axis][i] = q[axis][i] - p[axis][i];
            e2[axis][i] = r[axis][i] - p[axis][i];
        }
    }
    // Into the world's axes.
    if !place.moved_only {
        let linear = &place.transform.linear;
        for vectors in [&mut *a, &mut *e1, &mut *e2] {
            turn(linear, vectors, start, end);
        }
    }
    // Relative to the ray's origin, with twice the digits in the translation.
    let (high, low) = (place.transform.translation, place.transform.translation_low);
    for axis in 0..3 {
        let origin = &origin[axis][..end - start];
        for i in start..end {
            let offset = (high[axis] - origin[i - start]) + low[axis];
            magnitude[i] += a[axis][i].abs() + offset.abs();
            a[axis][i] += offset;
        }
    }
}

#[inline(always)]
fn turn(linear: &DMat3, vectors: &mut [Lane; 3], start: usize, end: usize) {
    let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
    let [vx, vy, vz] = vectors.each_mut().map(|axis| &mut axis[start..end]);
    for ((vx, vy), vz) in vx.iter_mut().zip(vy).zip(vz) {
        let v = [*vx, *vy, *vz];
        *vx = x.x * v[0] + y.x * v[1] + z.x * v[2];
        *vy = x.y * v[0] + y.y * v[1] + z.y * v[2];
        *vz = x.z * v[0] + y.z * v[1] + z.z * v[2];
    }
}

/// Intersects each ray with its triangle's plane, and tests whether the point is inside of the triangle.
#[multiversion::multiversion(targets = "simd")]
fn measure(lanes: &mut ChunkTriangles, want_normal: bool) {
    let ChunkTriangles { a, e1, e2, d, magnitude, handedness, t, u, v, excess, front, n, .. } =
        lanes;
    for i in 0..LANES {
        let [p, b, c] = [at(a, i), at(e1, i), at(e2, i)];
        let crossing = cross_plane(p, b, c, at(d, i));
        let inverse = 1.0 / crossing.along;
        t[i] = crossing.t * inverse;
        front[i] = -crossing.along * handedness[i];
        let (ui, vi) = (crossing.u * inverse, crossing.v * inverse);
        u[i] = ui;
        v[i] = vi;
        let sum = |edge: Vector| edge[0].abs() + edge[1].abs() + edge[2].abs();
        let edges = sum(b).max(sum(c));
        let tolerance = (ROUNDING * magnitude[i] * edges * inverse.abs()).min(WORST_TOLERANCE);
        excess[i] = (-ui).max(-vi).max(ui + vi - 1.0) - tolerance;
        (n[0][i], n[1][i], n[2][i]) = crossing.normal.into();
    }
    if want_normal {
        for i in 0..LANES {
            let (nx, ny, nz) = (n[0][i], n[1][i], n[2][i]);
            let scale = handedness[i] / (nx * nx + ny * ny + nz * nz).sqrt();
            n[0][i] = nx * scale;
            n[1][i] = ny * scale;
            n[2][i] = nz * scale;
        }
    }
}

/// Summary of one chunk's hits.
struct ChunkSides {
    all_valid: bool,
    front: bool,
    back: bool,
}

/// Copies one chunk's results to the hits.
#[multiversion::multiversion(targets = "simd")]
fn scatter(
    rays: &RayBatch,
    hits: &mut HitBatch,
    start: usize,
    count: usize,
    lanes: &ChunkTriangles,
    solved: &mut HitSolutions,
) -> ChunkSides {
    let range = start..start + count;
    let placement = &hits.placement[range.clone()];
    let (t_min, t_max) = (&rays.t_min()[range.clone()], &rays.t_max()[range.clone()]);
    let (out, t) = (&mut hits.t[range.clone()], &lanes.t[..count]);
    let (excess, front) = (&lanes.excess[..count], &lanes.front[..count]);
    let valid_out = &mut solved.valid[range.clone()];
    let front_out = &mut solved.front[range.clone()];
    let mut seen = ChunkSides { all_valid: true, front: false, back: false };
    for i in 0..count {
        let hit = placement[i] != MISS;
        // Written so that NaN, from a triangle seen edge-on, is invalid.
        let valid = !hit | ((excess[i] <= 0.0) & (t[i] >= t_min[i]) & (t[i] <= t_max[i]));
        let is_front = hit & (front[i] > 0.0);
        out[i] = if hit { t[i] } else { f64::INFINITY };
        valid_out[i] = valid;
        front_out[i] = is_front;
        seen.all_valid &= valid;
        seen.front |= is_front;
        seen.back |= hit & !is_front;
    }
    if hits.detail == Detail::Surface {
        for (out, weight) in [(&mut hits.u, &lanes.u), (&mut hits.v, &lanes.v)] {
            let out = &mut out[range.clone()];
            for i in 0..count {
                out[i] = if placement[i] != MISS { weight[i].clamp(0.0, 1.0) } else { 0.0 };
            }
        }
        for (out, normal) in hits.normal.iter_mut().zip(&lanes.n) {
            let out = &mut out[range.clone()];
            for i in 0..count {
                out[i] = if placement[i] != MISS { normal[i] } else { 0.0 };
            }
        }
    }
    seen
}
