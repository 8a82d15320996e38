//! Which of single precision's answers deserve a second look, and what decides then.
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

use std::f64::consts::TAU;

use etendue_geometry::glam::DVec3;
use etendue_geometry::{HitBatch, MISS};

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
