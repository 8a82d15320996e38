//! One body that moves: the rays that it is asked for, and its hits.

use std::sync::Arc;

use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Detail, HitBatch, Motion, RayBatch};

/// A placement that moves.
#[derive(Debug)]
pub(super) struct MovingPlacement {
    pub(super) placement: u32,
    pub(super) shape: usize,
    pub(super) motion: Arc<Motion>,
    /// Bounds of the body while the shutter is open (m, world).
    pub(super) swept: Bounds,
    /// The box of its mesh, in its frame (m).
    pub(super) local: Bounds,
    /// Its mesh changes its shape, so that its structure wants times.
    pub(super) deforms: bool,
}

impl MovingPlacement {
    /// True if a hit on it at `t` (m) is nearer than what ray `i` has, or later in the same place, where distances that
    /// differ by the share `one_place` are one.
    pub(super) fn is_nearest(
        &self,
        rays: &RayBatch,
        hits: &HitBatch,
        i: usize,
        t: f64,
        one_place: f64,
    ) -> bool {
        let size = t.abs().max(rays.origin(i).abs().max_element());
        let known = hits.placement[i];
        match hits.is_hit(i) {
            false => true,
            true if self.placement > known => t <= hits.t[i] + one_place * size,
            true => t < hits.t[i] - one_place * size,
        }
    }
}

/// Rays that meet the box which a body sweeps.
pub(super) struct BodyRays<'a> {
    pub(super) body: &'a MovingPlacement,
    /// The body's number and that of each ray.
    pub(super) near: &'a [[u32; 2]],
}

impl BodyRays<'_> {
    /// Numbers of the rays in their batch.
    pub(super) fn numbers(&self) -> impl Iterator<Item = usize> {
        self.near.iter().map(|&[_, ray]| ray as usize)
    }
}

/// Hit of a ray on a body, in the world.
pub(super) struct BodyHit {
    pub(super) t: f64,
    pub(super) triangle: u32,
    pub(super) weights: [f64; 2],
    /// Unit, on the front.
    pub(super) normal: DVec3,
}

impl BodyHit {
    /// Makes it the hit of ray `i`, on `placement`.
    pub(super) fn put(self, hits: &mut HitBatch, i: usize, placement: u32) {
        let Self { t, triangle, weights, normal } = self;
        (hits.t[i], hits.placement[i], hits.triangle[i]) = (t, placement, triangle);
        if hits.detail == Detail::Surface {
            [hits.u[i], hits.v[i]] = weights;
            for axis in 0..3 {
                hits.normal[axis][i] = normal[axis];
            }
        }
    }
}
