//! Re-check of single precision's answers: which deserve a second look, and what decides then.
//!
//! Rays are turned aside before they are rounded (`NUDGE` of [`crate::single`]), so that vertices are
//! never aimed at exactly, and single precision takes the wrong neighbour when a ray passes within about 10⁻⁶ of
//! an edge. What is wrong after that betrays itself:
//!
//! * the f64 solution lies outside the triangle that was found (*invalid*);
//! * nothing was found within the scene's box, where nearly all of the batch found something;
//! * the ray met a mesh from the other side than most of its batch: rays that slip into a closed
//!   mesh meet it next from within.
//!
//! A ray under suspicion for its miss or its side is traced once more, a little further aside; if
//! nothing nearer is found, the answer stands. Otherwise, and for an invalid hit, the exact test of
//! [`crate::watertight`] decides on every triangle that single precision meets along the ray, and, if
//! that does not confirm where the hit was, along a bundle of sixteen rays around it.
//!
//! Rays that leave known triangles, started clear of them in single precision.
//!
//! Around a ray's start, single precision cannot tell the triangle that it leaves from one that it
//! meets, so a filter has to judge each such meeting, and Embree stops a whole packet for every one of
//! them: most of what a shadow ray costs. But a ray that starts well inside of its triangle meets
//! nothing else there, so single precision may begin where it is clear of the triangle's plane,
//!
//! ```text
//! s = b / cos θ
//! ```
//!
//! along the ray, b being what rounding misplaces its start by. *Well inside* is five times that from
//! all edges, so that neighbours are met even where they lean over the triangle by 80°. Rays flatter than
//! [`FLATTEST`] and those beside an edge are judged as before; so is a triangle that is met all the same.
//!
//! What is nearer than `b` over the start and does not touch the triangle is passed over: less than what
//! single precision cannot tell apart in any case (docs/measurements/accuracy.md).

use std::f64::consts::TAU;
use std::ops::Range;

use crate::single::{F32_EPSILON, Rays32, round};
use crate::solve::{ChunkTriangles, LANES, Lane};
use crate::triangle::{at, cross, cross_plane, dot, minus};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Geometry, HitBatch, MISS, RayBatch};

/// Rays in a bundle.
pub(crate) const BUNDLE: usize = 16;

/// Rays of a bundle that meet triangles where these are on all sides. Some slip between slivers near the
/// corner where they meet; beside an outline half of the rays meet nothing.
pub(crate) const MOSTLY_SURROUNDED: u32 = 12;

/// Sideways offsets (m) of the rays of a bundle around `direction`, within `radius` (m): the ray
/// itself first, then two rings. Bundles of another `turn` fill the gaps of the others, for slivers
/// that lie between their rays.
pub(crate) fn bundle(direction: DVec3, radius: f64, turn: u32) -> [DVec3; BUNDLE] {
    let (x, y) = direction.any_orthonormal_pair();
    std::array::from_fn(|k| {
        if k == 0 {
            return DVec3::ZERO;
        }
        let (ring, step) = if k < 8 { (0.25, k as f64 / 7.0) } else { (1.0, k as f64 / 8.0) };
        // The golden ratio spreads any number of turns evenly.
        let angle = TAU * (step + f64::from(turn) * 0.618_033_988_75 / 8.0);
        (x * angle.cos() + y * angle.sin()) * (radius * ring)
    })
}

/// Sideways offsets (m) to the side of a `corner` (m, sideways from the ray along `direction`) on which
/// the ray passes it, ever farther from it, in pairs that are 2 `radius` (m) apart. Near the corner single
/// precision cannot tell apart the slivers that meet there, and farther out it can.
pub(crate) fn away_from(corner: DVec3, direction: DVec3, radius: f64) -> [DVec3; BUNDLE] {
    let side = -corner.normalize_or_zero();
    let across = side.cross(direction) * radius;
    std::array::from_fn(|k| {
        let far = corner + side * (radius * f64::from(1_u32 << (2 * (k / 2))));
        if k % 2 == 0 { far + across } else { far - across }
    })
}

/// Sideways offsets (m) that lie on different sides of `direction`, for a second opinion and a third.
pub(crate) fn nudges(direction: DVec3, radius: f64) -> [DVec3; 2] {
    let (x, y) = direction.any_orthonormal_pair();
    [(x * 0.6 + y * 0.8) * radius, (y * 0.6 - x * 0.8) * radius]
}

/// The misses of a batch that mostly hits, where `in_box` says that the ray crosses the scene's box:
/// rays that slip through are rare, so they are few among many, and the sky around an object is not
/// looked at twice.
pub(crate) fn lonely_misses(
    missed: impl Fn(usize) -> bool,
    count: usize,
    in_box: impl Fn(usize) -> bool,
    suspects: &mut Vec<u32>,
) {
    let misses = (0..count).filter(|&i| missed(i)).count();
    if misses == 0 || (misses * 8 > count && count >= 16) {
        return;
    }
    let lonely = (0..count).filter(|&i| missed(i) && in_box(i));
    #[expect(clippy::cast_possible_truncation, reason = "batches are small")]
    suspects.extend(lonely.map(|i| i as u32));
}

/// For each placement met by the batch, the rays that met the side that fewer of the others met.
/// `front[i]` is whether hit `i` is on its triangle's front.
pub(crate) fn minority_sides(hits: &HitBatch, front: &[bool], suspects: &mut Vec<u32>) {
    // Nearly always one or two placements, and nearly always one side.
    let mut sides: Vec<(u32, [u32; 2])> = Vec::with_capacity(4);
    let mut last = 0;
    for (i, &placement) in hits.placement.iter().enumerate() {
        if placement == MISS {
            continue;
        }
        if sides.get(last).is_none_or(|entry| entry.0 != placement) {
            last = sides.iter().position(|entry| entry.0 == placement).unwrap_or_else(|| {
                sides.push((placement, [0, 0]));
                sides.len() - 1
            });
        }
        sides[last].1[usize::from(front[i])] += 1;
    }
    sides.retain(|(_, [back, front])| *back > 0 && *front > 0);
    if sides.is_empty() {
        return;
    }
    for (i, placement) in hits.placement.iter().enumerate() {
        if let Some((_, [back_count, front_count])) = sides.iter().find(|s| s.0 == *placement) {
            let minority_is_front = front_count < back_count;
            if front[i] == minority_is_front || front_count == back_count {
                #[expect(clippy::cast_possible_truncation, reason = "batches are small")]
                suspects.push(i as u32);
            }
        }
    }
}

/// Rounding error by which a start may be misplaced, per sum of its coordinates: half a unit in the
/// last place of each, and half as much again for the triangle's.
const ROUNDING: f64 = 0.75 * F32_EPSILON;

/// Times `s` from all edges.
const INSIDE: f64 = 5.0;

/// The least cos θ of rays that are started so.
const FLATTEST: f64 = 0.25;

/// Triangles that a batch's rays leave.
#[derive(Debug, Default)]
pub(crate) struct EndTriangles {
    placement: Vec<u32>,
    triangle: Vec<u32>,
    clear: Clear,
}

/// Distance from its start at which each ray of a chunk is clear of the triangle; infinite where it
/// is not known to meet nothing else before.
#[derive(Debug)]
struct Clear(Lane);

impl Default for Clear {
    fn default() -> Self {
        Self([f64::INFINITY; LANES])
    }
}

impl EndTriangles {
    /// Begins `rays32` where they are clear of the triangles that `rays` leave.
    pub(crate) fn spare(
        &mut self,
        geometry: &Geometry,
        rays: &RayBatch,
        rays32: &mut Rays32,
        lanes: &mut ChunkTriangles,
    ) {
        let Some(triangles) = rays.endpoint_triangles() else { return };
        self.placement.clear();
        self.placement.extend(triangles.iter().map(|[left, _]| left[0]));
        self.triangle.clear();
        self.triangle.extend(triangles.iter().map(|[left, _]| left[1]));
        for start in (0..rays.len()).step_by(LANES) {
            let range = start..rays.len().min(start + LANES);
            lanes.gather(geometry, rays, &self.placement, &self.triangle, range.clone());
            measure(lanes, rays32, range.clone(), &mut self.clear);
            for i in range {
                let clear = self.clear.0[i - start];
                // Most of a short ray is left for what may be in between.
                let long = clear < 0.25 * rays.t_max()[i] && clear >= rays.t_min()[i];
                if long && self.placement[i] != MISS {
                    let (near, far) = (&mut rays32.t_near[i], rays32.t_far[i]);
                    *near = near.max(round(clear - rays32.advance[i])).min(far);
                }
            }
        }
    }
}

/// The formula of this module's head for the rays of `range`, whose triangles are in `lanes`.
#[multiversion::multiversion(targets = "simd")]
fn measure(lanes: &ChunkTriangles, rays32: &Rays32, range: Range<usize>, out: &mut Clear) {
    let ChunkTriangles { a, e1, e2, d, .. } = lanes;
    let mut size = [0.0; LANES];
    for axis in &rays32.origin {
        for (size, &x) in size.iter_mut().zip(&axis[range.clone()]) {
            *size += f64::from(x).abs();
        }
    }
    for (i, (out, &size)) in out.0.iter_mut().zip(&size).enumerate() {
        let (b, c) = (at(e1, i), at(e2, i));
        let n = cross(b, c);
        // The start's own weights, times n·n: those of the line from it along the normal.
        let foot = cross_plane(at(a, i), b, c, n);
        let (nn, length) = (foot.along, foot.along.sqrt());
        let cosine = dot(n, at(d, i)).abs() / length;
        let clear = ROUNDING * size / cosine;
        // Distances from the edges, by the areas that the start makes with them.
        let opposite = minus(c, b);
        let edges = [
            foot.u / dot(c, c).sqrt(),
            foot.v / dot(b, b).sqrt(),
            (nn - foot.u - foot.v) / dot(opposite, opposite).sqrt(),
        ];
        let inside = edges[0].min(edges[1]).min(edges[2]) / length;
        // Comparisons with what is no number are false.
        let known = (cosine >= FLATTEST) & (inside > INSIDE * clear);
        *out = if known { clear } else { f64::INFINITY };
    }
}
