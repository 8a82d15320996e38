//! Which of single precision's answers deserve a second look, and what decides then.
//!
//! Embree's robust mode is watertight along edges, but a ray aimed within rounding error of a vertex
//! slips between its triangles in about one of a hundred cases, and single precision takes the wrong
//! neighbour when a ray passes within about 10⁻⁷ of an edge. Three signs betray both:
//!
//! * the f64 solution lies outside the triangle that was found (*invalid*);
//! * nothing was found although the ray's line crosses the scene's box;
//! * the ray met a mesh from the other side than most of its batch: rays that slip into a closed
//!   mesh meet it next from within.
//!
//! A ray under suspicion for its miss or its side is traced once more, moved sideways by no more than
//! what single precision blurs anyway ([`Frame::blur`]); if the answer is of the same kind, it
//! stands. Otherwise, and for an invalid hit, a bundle of sixteen such rays collects the triangles
//! thereabouts, and the exact test of [`crate::watertight`] on each in f64 decides.

use std::f64::consts::TAU;

use etendue_geometry::glam::DVec3;
use etendue_geometry::{Geometry, HitBatch, MISS, RayBatch};

use crate::watertight;

/// Rays in a bundle.
pub(crate) const BUNDLE: usize = 16;

/// Sideways offsets (m) of the rays of a bundle around `direction`, within `radius` (m): the ray
/// itself first, then two rings turned against each other.
pub(crate) fn bundle(direction: DVec3, radius: f64) -> [DVec3; BUNDLE] {
    let (x, y) = direction.any_orthonormal_pair();
    std::array::from_fn(|k| {
        if k == 0 {
            return DVec3::ZERO;
        }
        let ring = if k < 8 { 0.25 } else { 1.0 };
        let angle = TAU * (k as f64 * 0.127 + 0.05);
        (x * angle.cos() + y * angle.sin()) * (radius * ring)
    })
}

/// One sideways offset (m), for a second opinion.
pub(crate) fn nudge(direction: DVec3, radius: f64) -> DVec3 {
    let (x, y) = direction.any_orthonormal_pair();
    (x * 0.6 + y * 0.8) * radius
}

/// A triangle that a ray may hit: placement and triangle.
pub(crate) type Candidate = (u32, u32);

/// The nearest of `candidates` that ray `i` hits by the exact test, written to `hits`; a miss when
/// there is none. Returns whether there was one.
pub(crate) fn decide(
    geometry: &Geometry,
    rays: &RayBatch,
    i: usize,
    candidates: &[Candidate],
    hits: &mut HitBatch,
) -> bool {
    let mut best = (f64::INFINITY, (MISS, MISS));
    let (origin, direction) = (rays.origin(i), rays.direction(i));
    for &(index, triangle) in candidates {
        let placement = &geometry.placements[index as usize];
        let corners = geometry.mesh_of(placement).corners(triangle as usize);
        let [a, b, c] = corners.map(|p| placement.world_from_mesh.point_from(p, origin));
        if let Some(hit) = watertight::intersect(a, b, c, direction)
            && hit.t >= rays.t_min[i]
            && hit.t <= rays.t_max[i]
            && (hit.t, (index, triangle)) < best
        {
            best = (hit.t, (index, triangle));
        }
    }
    let (t, (placement, triangle)) = best;
    hits.t[i] = t;
    hits.placement[i] = placement;
    hits.triangle[i] = triangle;
    placement != MISS
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
