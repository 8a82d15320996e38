//! *Double precision measures*: where a ray meets the triangle that a single-precision backend found.
//!
//! Everything is relative to the ray's origin, so nothing is lost far from the world's origin: with
//! local corners `p0 p1 p2`, the placement's linear part `L` and its offset from the ray's origin
//! `o = T − O` (exact when the camera is near, see [`etendue_geometry::Transform`]),
//!
//! ```text
//! a = L p0 + o,   e1 = L (p1 − p0),   e2 = L (p2 − p0),   n = e1 × e2
//! t = n·a / n·d,  u = (−a)·(d × e2) / det,  v = d·((−a) × e1) / det,  det = e1·(d × e2)
//! ```
//!
//! (Möller & Trumbore 1997, with the distance from the plane, whose error does not grow with `|a|/|e|`:
//! differences of f32 coordinates are exact in f64.) The relative error of `t` is a few 2⁻⁵³ over the
//! cosine of incidence.
//!
//! A hit is *valid* when `u`, `v` and `1 − u − v` are negative by no more than their own rounding
//! error. Single precision picks the wrong one of two neighbours when a ray passes within about 10⁻⁷
//! of their edge; such a hit comes out invalid here and is looked at again by the backend.

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{
    Detail, Geometry, HitBatch, MISS, Mesh, Placement, Positions, RayBatch, Transform,
};

/// Rays worked on side by side: long enough to vectorise, short enough to stay in the first cache.
const LANES: usize = 64;

/// Barycentric coordinates are trusted to no worse than this, however grazing the ray: beyond it a
/// hit is looked at again.
const WORST_TOLERANCE: f64 = 1e-6;

/// Barycentric rounding error in units of 2⁻⁵³ times magnitudes: three products and their sums, each
/// within one unit, on values that are themselves within two.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

type Lane = [f64; LANES];

/// The triangles of one chunk of rays as seen from the rays' origins, and what comes of them.
#[derive(Debug)]
pub(crate) struct Lanes {
    a: [Lane; 3],
    e1: [Lane; 3],
    e2: [Lane; 3],
    d: [Lane; 3],
    /// What `a` was summed from, for its rounding error.
    magnitude: Lane,
    handedness: Lane,
    t: Lane,
    u: Lane,
    v: Lane,
    /// How far `u`, `v` or `1 − u − v` is below zero beyond its rounding error; ≤ 0 is valid.
    excess: Lane,
    /// Positive when the ray comes from the triangle's front.
    front: Lane,
    n: [Lane; 3],
}

impl Default for Lanes {
    fn default() -> Self {
        let zero = [0.0; LANES];
        Self {
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

/// What solving says of each ray's hit, beside the hit itself.
#[derive(Debug, Default)]
pub(crate) struct Solved {
    /// The ray meets its triangle within `t_min..=t_max`; true for misses.
    pub(crate) valid: Vec<bool>,
    /// It meets the triangle's front.
    pub(crate) front: Vec<bool>,
}

/// Works out `t` (and `u`, `v`, the normal, when `hits.detail` asks) for every entry of `hits` that
/// names a triangle.
pub(crate) fn solve(
    geometry: &Geometry,
    rays: &RayBatch,
    hits: &mut HitBatch,
    lanes: &mut Lanes,
    solved: &mut Solved,
) {
    solved.valid.clear();
    solved.valid.resize(rays.len(), true);
    solved.front.clear();
    solved.front.resize(rays.len(), false);
    let mut start = 0;
    while start < rays.len() {
        let count = LANES.min(rays.len() - start);
        if gather(geometry, rays, hits, start..start + count, lanes) {
            measure(lanes, hits.detail == Detail::Surface);
            scatter(rays, hits, start, start..start + count, lanes, solved);
        }
        start += count;
    }
}

/// Fills the lanes with the triangles of one chunk; `false` when no ray of it hit anything.
fn gather(
    geometry: &Geometry,
    rays: &RayBatch,
    hits: &HitBatch,
    range: std::ops::Range<usize>,
    lanes: &mut Lanes,
) -> bool {
    for axis in 0..3 {
        lanes.d[axis][..range.len()].copy_from_slice(&rays.direction[axis][range.clone()]);
    }
    let mut any = false;
    let mut i = range.start;
    while i < range.end {
        let index = hits.placement[i];
        let run_end = (i..range.end).find(|&k| hits.placement[k] != index).unwrap_or(range.end);
        if index == MISS {
            // Whatever stands in the lanes is measured and not looked at.
        } else {
            any = true;
            let placement = &geometry.placements[index as usize];
            let mesh = geometry.mesh_of(placement);
            gather_run(placement, mesh, rays, hits, range.start, i..run_end, lanes);
        }
        i = run_end;
    }
    any
}

/// Fills the lanes of consecutive rays that hit the same placement.
fn gather_run(
    placement: &Placement,
    mesh: &Mesh,
    rays: &RayBatch,
    hits: &HitBatch,
    first: usize,
    run: std::ops::Range<usize>,
    lanes: &mut Lanes,
) {
    let triangles: &[[u32; 3]] = &mesh.triangles;
    let place = Place::of(&placement.world_from_mesh);
    let corners = |i: usize| triangles[hits.triangle[i] as usize].map(|corner| corner as usize);
    match &mesh.positions {
        Positions::F32(vertices) if vertices.stride() == 3 => {
            // The usual layout, with one bounds check a corner.
            let (floats, _) = vertices.floats().as_chunks::<3>();
            for i in run {
                let [p, q, r] = corners(i);
                let corners = [wide(floats[p]), wide(floats[q]), wide(floats[r])];
                lanes.put(i - first, &place, rays.origin(i), corners);
            }
        }
        positions => {
            for i in run {
                let corners = corners(i).map(|corner| positions.get(corner));
                lanes.put(i - first, &place, rays.origin(i), corners);
            }
        }
    }
}

/// A placement's transform with what is asked of it for every hit.
struct Place<'a> {
    transform: &'a Transform,
    handedness: f64,
    /// Nothing to multiply.
    moved_only: bool,
}

impl<'a> Place<'a> {
    fn of(transform: &'a Transform) -> Self {
        let moved_only = transform.linear == DMat3::IDENTITY;
        Self { transform, handedness: transform.handedness(), moved_only }
    }
}

impl Lanes {
    /// Puts a triangle of local corners, seen from `origin`, into a lane.
    #[inline]
    fn put(&mut self, lane: usize, place: &Place<'_>, origin: DVec3, [p0, p1, p2]: [DVec3; 3]) {
        let offset = place.transform.offset_from(origin);
        let (mut p0, mut e1, mut e2) = (p0, p1 - p0, p2 - p0);
        if !place.moved_only {
            let linear = &place.transform.linear;
            (p0, e1, e2) = (*linear * p0, *linear * e1, *linear * e2);
        }
        let a = p0 + offset;
        for axis in 0..3 {
            self.a[axis][lane] = a[axis];
            self.e1[axis][lane] = e1[axis];
            self.e2[axis][lane] = e2[axis];
        }
        self.magnitude[lane] = l1(p0) + l1(offset);
        self.handedness[lane] = place.handedness;
    }
}

#[inline]
fn wide([x, y, z]: [f32; 3]) -> DVec3 {
    DVec3::new(x.into(), y.into(), z.into())
}

#[inline]
fn l1(v: DVec3) -> f64 {
    v.x.abs() + v.y.abs() + v.z.abs()
}

/// The formulas of this module's head, one lane beside the other.
#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
fn measure(lanes: &mut Lanes, want_normal: bool) {
    let Lanes { a, e1, e2, d, magnitude, handedness, t, u, v, excess, front, n } = lanes;
    for i in 0..LANES {
        let (ax, ay, az) = (a[0][i], a[1][i], a[2][i]);
        let (bx, by, bz) = (e1[0][i], e1[1][i], e1[2][i]);
        let (cx, cy, cz) = (e2[0][i], e2[1][i], e2[2][i]);
        let (dx, dy, dz) = (d[0][i], d[1][i], d[2][i]);
        let (nx, ny, nz) = (by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx);
        let along = nx * dx + ny * dy + nz * dz;
        t[i] = (nx * ax + ny * ay + nz * az) / along;
        front[i] = -along * handedness[i];
        let (px, py, pz) = (dy * cz - dz * cy, dz * cx - dx * cz, dx * cy - dy * cx);
        let (qx, qy, qz) = (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx);
        let inverse = -1.0 / (bx * px + by * py + bz * pz);
        let ui = (ax * px + ay * py + az * pz) * inverse;
        let vi = (dx * qx + dy * qy + dz * qz) * inverse;
        u[i] = ui;
        v[i] = vi;
        let edges = (bx.abs() + by.abs() + bz.abs()).max(cx.abs() + cy.abs() + cz.abs());
        let tolerance = (ROUNDING * magnitude[i] * edges * inverse.abs()).min(WORST_TOLERANCE);
        excess[i] = (-ui).max(-vi).max(ui + vi - 1.0) - tolerance;
        n[0][i] = nx;
        n[1][i] = ny;
        n[2][i] = nz;
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

/// Copies one chunk's results to the hits.
fn scatter(
    rays: &RayBatch,
    hits: &mut HitBatch,
    start: usize,
    range: std::ops::Range<usize>,
    lanes: &Lanes,
    solved: &mut Solved,
) {
    let surface = hits.detail == Detail::Surface;
    for i in range {
        let lane = i - start;
        if hits.placement[i] == MISS {
            continue;
        }
        let t = lanes.t[lane];
        // Written so that NaN, from a triangle seen edge-on, is invalid.
        solved.valid[i] = lanes.excess[lane] <= 0.0 && t >= rays.t_min[i] && t <= rays.t_max[i];
        solved.front[i] = lanes.front[lane] > 0.0;
        hits.t[i] = t;
        if surface {
            hits.u[i] = lanes.u[lane].clamp(0.0, 1.0);
            hits.v[i] = lanes.v[lane].clamp(0.0, 1.0);
            for axis in 0..3 {
                hits.normal[axis][i] = lanes.n[axis][lane];
            }
        }
    }
}
