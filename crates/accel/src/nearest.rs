//! One ray's question and the best answer so far: the rules about limits and ties, in one place.

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Detail, Geometry, HitBatch, MISS, Placement, RayBatch, Transform};

use crate::watertight;

/// A ray and the distances that count.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Query {
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
    pub(crate) t_min: f64,
    pub(crate) t_max: f64,
}

impl Query {
    /// Ray `i` of a batch; `None` when it cannot hit anything, as when a number is NaN.
    #[inline(always)]
    pub(crate) fn of(rays: &RayBatch, i: usize) -> Option<Self> {
        let query = Self {
            origin: rays.origin(i),
            direction: rays.direction(i),
            t_min: rays.t_min[i],
            t_max: rays.t_max[i],
        };
        let sound = query.origin.is_finite()
            && query.direction.is_finite()
            && query.direction != DVec3::ZERO
            && query.t_min <= query.t_max;
        sound.then_some(query)
    }

    /// The exact answer for one triangle, given by its corners in the mesh's frame.
    #[inline(always)]
    pub(crate) fn test(&self, view: &View<'_>, [a, b, c]: [DVec3; 3]) -> Option<watertight::Hit> {
        let [a, b, c] = view.seen_from(self.origin, [a, b, c]);
        let hit = watertight::intersect(a, b, c, self.direction)?;
        (hit.t >= self.t_min && hit.t <= self.t_max).then_some(hit)
    }

    /// As [`Self::test`], with the reason.
    #[cfg(feature = "embree")]
    pub(crate) fn judge(&self, view: &View<'_>, corners: [DVec3; 3]) -> Verdict {
        let [a, b, c] = view.seen_from(self.origin, corners);
        match watertight::intersect(a, b, c, self.direction) {
            Some(hit) if hit.t >= self.t_min && hit.t <= self.t_max => Verdict::Hit(hit),
            Some(_) => Verdict::OutOfRange,
            None => Verdict::Beside,
        }
    }
}

/// What the exact test says of a ray and a triangle.
#[cfg(feature = "embree")]
#[derive(Debug, Clone, Copy)]
pub(crate) enum Verdict {
    /// The ray hits it.
    Hit(watertight::Hit),
    /// Its line does, nearer or farther than counts.
    OutOfRange,
    /// Its line passes beside it.
    Beside,
}

/// A placement's transform, applied as [`Transform::point_from`] does but once for all corners.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View<'a> {
    transform: &'a Transform,
    is_parallel: bool,
}

impl<'a> View<'a> {
    #[inline(always)]
    pub(crate) fn new(transform: &'a Transform) -> Self {
        Self { transform, is_parallel: transform.linear == DMat3::IDENTITY }
    }

    /// The corners in the world, from `origin` (m).
    #[inline(always)]
    pub(crate) fn seen_from(&self, origin: DVec3, [a, b, c]: [DVec3; 3]) -> [DVec3; 3] {
        let offset = self.transform.offset_from(origin);
        [self.turned(a) + offset, self.turned(b) + offset, self.turned(c) + offset]
    }

    #[inline(always)]
    fn turned(&self, corner: DVec3) -> DVec3 {
        // Multiplying by ones and adding zeros is exact.
        if self.is_parallel { corner } else { self.transform.linear * corner }
    }
}

/// The closest hit so far.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Nearest {
    pub(crate) t: f64,
    pub(crate) placement: u32,
    pub(crate) triangle: u32,
    u: f64,
    v: f64,
}

impl Nearest {
    /// Nothing yet; nothing beyond `t_max` counts.
    #[inline]
    pub(crate) fn none(t_max: f64) -> Self {
        Self { t: t_max, placement: MISS, triangle: MISS, u: 0.0, v: 0.0 }
    }

    /// Takes `hit` when it is closer, or as close and of a lower placement, then triangle.
    #[inline(always)]
    pub(crate) fn offer(&mut self, hit: watertight::Hit, placement: u32, triangle: u32) {
        let closer = hit.t < self.t
            || (hit.t == self.t && (placement, triangle) < (self.placement, self.triangle));
        if closer {
            *self = Self { t: hit.t, placement, triangle, u: hit.u, v: hit.v };
        }
    }

    /// Writes the answer into place `i` of a batch that has been reset to misses.
    #[inline(always)]
    pub(crate) fn write(&self, geometry: &Geometry, hits: &mut HitBatch, i: usize) {
        if self.placement == MISS {
            return;
        }
        hits.t[i] = self.t;
        hits.placement[i] = self.placement;
        hits.triangle[i] = self.triangle;
        if hits.detail == Detail::Surface {
            self.write_surface(geometry, hits, i);
        }
    }

    fn write_surface(&self, geometry: &Geometry, hits: &mut HitBatch, i: usize) {
        hits.u[i] = self.u;
        hits.v[i] = self.v;
        let placement = &geometry.placements[self.placement as usize];
        let corners = geometry.mesh_of(placement).corners(self.triangle as usize);
        let normal = front_normal(placement, corners);
        for axis in 0..3 {
            hits.normal[axis][i] = normal[axis];
        }
    }
}

/// The unit normal, in world space, on the front of a placed triangle. From the local edges, whose
/// differences f64 forms without rounding when the corners were f32.
pub(crate) fn front_normal(placement: &Placement, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let unit = |v: DVec3| v / v.abs().max_element();
    let normal = (b - a).cross(c - a);
    let normal =
        if normal.length_squared().is_normal() { normal } else { unit(b - a).cross(unit(c - a)) };
    let world = placement.world_from_mesh.normal_matrix() * normal.normalize_or_zero();
    if world.length_squared().is_normal() {
        world.normalize()
    } else {
        unit(world).normalize_or_zero()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(t: f64) -> watertight::Hit {
        watertight::Hit { t, u: 0.0, v: 0.0, front: true }
    }

    #[test]
    fn ties_go_to_the_lower_placement_then_triangle_in_any_order() {
        let offers = [(2.0, 0, 0), (1.0, 3, 4), (1.0, 2, 9), (1.0, 2, 7), (1.5, 0, 0)];
        for start in 0..offers.len() {
            let mut nearest = Nearest::none(f64::INFINITY);
            for k in 0..offers.len() {
                let (t, placement, triangle) = offers[(start + k) % offers.len()];
                nearest.offer(hit(t), placement, triangle);
            }
            assert_eq!((nearest.placement, nearest.triangle), (2, 7));
        }
    }

    #[test]
    fn a_hit_exactly_at_the_limit_counts() {
        let mut nearest = Nearest::none(1.0);
        nearest.offer(hit(1.0), 5, 6);
        assert_eq!(nearest.placement, 5);
    }
}
