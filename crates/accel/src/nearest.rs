//! One ray's question and the best answer so far: the rules about limits and ties, in one place.
//!
//! One rule for surfaces in one place: the later placement wins, whatever a backend's traversal met first.

use crate::single::round;
use crate::watertight;
use etendue_geometry::block::{LANES, vector};
use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{
    Coplanar, Detail, Geometry, HitBatch, MISS, PlacedTriangle, Placement, RayBatch, RayBlock,
    Transform,
};

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
            t_min: rays.t_min()[i],
            t_max: rays.t_max()[i],
        };
        let sound = query.origin.is_finite()
            && query.direction.is_finite()
            && query.direction != DVec3::ZERO
            && query.t_min <= query.t_max;
        sound.then_some(query)
    }

    /// The exact answer for one triangle, given by its corners in the mesh's frame.
    #[inline(always)]
    pub(crate) fn test(
        &self,
        view: &PlacementView<'_>,
        [a, b, c]: [DVec3; 3],
    ) -> Option<watertight::Hit> {
        let [a, b, c] = view.seen_from(self.origin, [a, b, c]);
        let hit = watertight::intersect(a, b, c, self.direction)?;
        (hit.t >= self.t_min && hit.t <= self.t_max).then_some(hit)
    }

    /// As [`Self::test`], with the reason.
    #[cfg(feature = "embree")]
    pub(crate) fn judge(&self, view: &PlacementView<'_>, corners: [DVec3; 3]) -> Verdict {
        let [a, b, c] = view.seen_from(self.origin, corners);
        match watertight::intersect(a, b, c, self.direction) {
            Some(hit) if hit.t >= self.t_min && hit.t <= self.t_max => Verdict::Hit(hit),
            Some(_) => Verdict::OutOfRange,
            None => Verdict::Miss,
        }
    }
}

/// Verdict of the exact test on a ray and a triangle.
#[cfg(feature = "embree")]
#[derive(Debug, Clone, Copy)]
pub(crate) enum Verdict {
    /// The ray hits it.
    Hit(watertight::Hit),
    /// Its line does, nearer or farther than counts.
    OutOfRange,
    /// Its line passes beside it.
    Miss,
}

/// A placement's transform, applied as [`Transform::point_from`] does but once for all corners.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlacementView<'a> {
    transform: &'a Transform,
    is_parallel: bool,
}

impl<'a> PlacementView<'a> {
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

/// A triangle, and which it is.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Triangle {
    pub(crate) placement: u32,
    pub(crate) number: u32,
    /// In its mesh's frame (m).
    pub(crate) corners: [DVec3; 3],
}

impl Triangle {
    #[inline(always)]
    pub(crate) fn of(geometry: &Geometry, placement: u32, number: u32) -> Self {
        let mesh = geometry.mesh_of(&geometry.placements[placement as usize]);
        Self { placement, number, corners: mesh.corners(number as usize) }
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
    /// On the triangle's front, in its mesh's frame, of any length.
    normal: DVec3,
}

impl Nearest {
    /// Nothing yet; nothing beyond `t_max` counts.
    #[inline]
    pub(crate) fn none(t_max: f64) -> Self {
        let (placement, triangle, normal) = (MISS, MISS, DVec3::ZERO);
        Self { t: t_max, placement, triangle, u: 0.0, v: 0.0, normal }
    }

    /// Takes `hit` when it is closer, or as close and of a later placement, then of a lower triangle.
    #[inline(always)]
    pub(crate) fn offer(&mut self, hit: watertight::Hit, triangle: &Triangle) {
        let &Triangle { placement, number, corners } = triangle;
        let closer = hit.t < self.t || (hit.t == self.t && self.is_before(placement, number));
        if closer {
            // Now, while the corners are at hand: afterwards they would have to be fetched anew.
            let normal = local_normal(corners);
            *self = Self { t: hit.t, placement, triangle: number, u: hit.u, v: hit.v, normal };
        }
    }

    /// True if a triangle as near goes before it, as anything does before a miss.
    #[inline(always)]
    fn is_before(&self, placement: u32, number: u32) -> bool {
        self.placement == MISS
            || placement > self.placement
            || (placement == self.placement && number < self.triangle)
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
            hits.u[i] = self.u;
            hits.v[i] = self.v;
            let normal = world_normal(&geometry.placements[self.placement as usize], self.normal);
            for axis in 0..3 {
                hits.normal[axis][i] = normal[axis];
            }
        }
    }
}

/// The normal on the front of a triangle, of any length. From its edges, whose differences f64 forms
/// without rounding when the corners were f32.
#[inline(always)]
fn local_normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    let normal = (b - a).cross(c - a);
    if normal.length_squared().is_normal() { normal } else { unit(b - a).cross(unit(c - a)) }
}

/// The unit normal, in world space, of a placed triangle.
#[inline(always)]
fn world_normal(placement: &Placement, normal: DVec3) -> DVec3 {
    let transform = &placement.world_from_mesh;
    let world = if transform.linear == DMat3::IDENTITY {
        normal
    } else {
        transform.normal_matrix() * normal.normalize_or_zero()
    };
    if world.length_squared().is_normal() {
        world.normalize()
    } else {
        unit(world).normalize_or_zero()
    }
}

/// `v` with 1 as its largest component.
fn unit(v: DVec3) -> DVec3 {
    v / v.abs().max_element()
}

/// Distances that differ by no more than this, of the largest coordinate of the ray's origin and of the distance, are
/// one: 64 units in f64's last place, more than a hit's own roundings.
const ONE_PLACE: f64 = 64.0 * f64::EPSILON;

/// Greatest distance (of the largest coordinate of a ray's origin and a distance) of a hit of single precision from
/// its place: some of its roundings.
const HIT_ERROR: f64 = 16.0 * f32::EPSILON as f64;

/// Hit that [`crate::Accel`]'s rule puts in the place of a hit at `t` (m) on `own`, where other triangles of its plane
/// are; `None` where it stays. Of `ends`, which the ray leaves or ends on, none counts.
fn later(
    coplanar: &Coplanar,
    geometry: &Geometry,
    query: &Query,
    own: PlacedTriangle,
    t: f64,
    ends: Option<[PlacedTriangle; 2]>,
) -> Option<(watertight::Hit, Triangle)> {
    let test = |[placement, number]: PlacedTriangle| {
        let triangle = Triangle::of(geometry, placement, number);
        let place = &geometry.placements[placement as usize].world_from_mesh;
        Some((query.test(&PlacementView::new(place), triangle.corners)?, triangle))
    };
    let slack = HIT_ERROR * t.abs().max(query.origin.abs().max_element());
    let near = coplanar.others_near(own, query.origin + query.direction * t, slack);
    let spared = |id: &PlacedTriangle| !ends.is_some_and(|ends| ends.contains(id));
    let hits: Vec<_> = near.filter(spared).filter_map(test).collect();
    if hits.is_empty() {
        return None;
    }
    let found = test(own).map(|(hit, _)| hit.t);
    let nearest = hits.iter().map(|(hit, _)| hit.t).chain(found).reduce(f64::min)?;
    let size = nearest.abs().max(query.origin.abs().max_element());
    let is_near = |t: f64| t <= nearest + ONE_PLACE * size;
    let near = hits.into_iter().filter(|(hit, _)| is_near(hit.t));
    let latest =
        near.max_by(|(_, a), (_, b)| a.placement.cmp(&b.placement).then(b.number.cmp(&a.number)))?;
    // What was found stays, where it is as near and later.
    let stays = found.is_some_and(is_near) && own[0] >= latest.1.placement;
    (!stays).then_some(latest)
}

/// Weights of the second and third corner at the place where a ray (m) hit a triangle; `None` along its plane.
#[cfg(feature = "embree")]
fn weights(
    geometry: &Geometry,
    [placement, number]: PlacedTriangle,
    origin: DVec3,
    direction: DVec3,
) -> Option<[f64; 2]> {
    let triangle = Triangle::of(geometry, placement, number);
    let place = &geometry.placements[placement as usize].world_from_mesh;
    let [a, b, c] = PlacementView::new(place).seen_from(origin, triangle.corners);
    // Möller and Trumbore 1997, of edges without a scale.
    let longest = (b - a).abs().max((c - a).abs()).max_element();
    let [along, across, from] = [b - a, c - a, -a].map(|v| v / longest);
    let side = direction.cross(across);
    let volume = along.dot(side);
    let weights = [from.dot(side) / volume, direction.dot(from.cross(along)) / volume];
    weights.iter().all(|w| w.is_finite()).then(|| weights.map(|w| w.clamp(0.0, 1.0)))
}

/// Finds the weights of hits that have none: Embree leaves both at 0 where twice a triangle's area, as large as the ray sees
/// it, is below 10⁻¹⁸ (m², in the mesh's frame, times the length that the ray's direction has there).
#[cfg(feature = "embree")]
pub(crate) fn find_lost_weights(geometry: &Geometry, rays: &RayBatch, hits: &mut HitBatch) {
    for i in 0..rays.len() {
        if hits.u[i] == 0.0 && hits.v[i] == 0.0 && hits.placement[i] != MISS {
            let id = [hits.placement[i], hits.triangle[i]];
            if let Some([u, v]) = weights(geometry, id, rays.origin(i), rays.direction(i)) {
                (hits.u[i], hits.v[i]) = (u, v);
            }
        }
    }
}

/// As [`find_lost_weights`], of blocks of rays, which start from `origin` (m).
#[cfg(feature = "embree")]
pub(crate) fn find_lost_weights_of_blocks(
    geometry: &Geometry,
    origin: DVec3,
    blocks: &mut [RayBlock],
) {
    for block in blocks {
        for lane in 0..LANES {
            if block.u[lane] == 0.0 && block.v[lane] == 0.0 && block.placement[lane] != MISS {
                let id = [block.placement[lane], block.triangle[lane]];
                let start = origin + vector(&block.origin, lane);
                let found = weights(geometry, id, start, vector(&block.direction, lane));
                if let Some(found) = found {
                    [block.u[lane], block.v[lane]] = found.map(round);
                }
            }
        }
    }
}

/// Settles by [`crate::Accel`]'s rule what each ray hit whose triangle has others in its plane.
pub(crate) fn settle(
    coplanar: &Coplanar,
    geometry: &Geometry,
    rays: &RayBatch,
    hits: &mut HitBatch,
) {
    if coplanar.is_empty() {
        return;
    }
    for i in 0..rays.len() {
        if hits.placement[i] == MISS {
            continue;
        }
        hits.placement[i] = coplanar.last(hits.placement[i]);
        if !coplanar.has_others([hits.placement[i], hits.triangle[i]]) {
            continue;
        }
        let own = [hits.placement[i], hits.triangle[i]];
        let Some(query) = Query::of(rays, i) else { continue };
        let ends = rays.endpoint_triangles().map(|ends| ends[i]);
        let found = later(coplanar, geometry, &query, own, hits.t[i], ends);
        let Some((hit, triangle)) = found else {
            continue;
        };
        let mut settled = Nearest::none(f64::INFINITY);
        settled.offer(hit, &triangle);
        settled.write(geometry, hits, i);
    }
}

/// Settles the hits of blocks of rays, which start from `origin` (m).
pub(crate) fn settle_blocks(
    coplanar: &Coplanar,
    geometry: &Geometry,
    origin: DVec3,
    blocks: &mut [RayBlock],
) {
    if coplanar.is_empty() {
        return;
    }
    for block in blocks {
        for lane in 0..LANES {
            if block.placement[lane] == MISS {
                continue;
            }
            block.placement[lane] = coplanar.last(block.placement[lane]);
            if !coplanar.has_others([block.placement[lane], block.triangle[lane]]) {
                continue;
            }
            let query = Query {
                origin: origin + vector(&block.origin, lane),
                direction: vector(&block.direction, lane),
                t_min: f64::from(block.t_min[lane]),
                t_max: f64::INFINITY,
            };
            let own = [block.placement[lane], block.triangle[lane]];
            let t = f64::from(block.t_max[lane]);
            let Some((hit, triangle)) = later(coplanar, geometry, &query, own, t, None) else {
                continue;
            };
            (block.placement[lane], block.triangle[lane]) = (triangle.placement, triangle.number);
            [block.t_max[lane], block.u[lane], block.v[lane]] = [hit.t, hit.u, hit.v].map(round);
            let place = &geometry.placements[triangle.placement as usize].world_from_mesh;
            let [a, b, c] = triangle.corners.map(|corner| place.linear * corner);
            let normal = (b - a).cross(c - a) * place.handedness();
            for (axis, to) in block.normal.iter_mut().enumerate() {
                to[lane] = round(normal[axis]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(t: f64) -> watertight::Hit {
        watertight::Hit { t, u: 0.0, v: 0.0, front: true }
    }

    fn named(placement: u32, number: u32) -> Triangle {
        Triangle { placement, number, corners: [DVec3::X, DVec3::Y, DVec3::Z] }
    }

    #[test]
    fn ties_go_to_the_later_placement_then_the_lower_triangle_in_any_order() {
        let offers = [(2.0, 9, 0), (1.0, 1, 4), (1.0, 2, 9), (1.0, 2, 7), (1.5, 8, 0)];
        for start in 0..offers.len() {
            let mut nearest = Nearest::none(f64::INFINITY);
            for k in 0..offers.len() {
                let (t, placement, triangle) = offers[(start + k) % offers.len()];
                nearest.offer(hit(t), &named(placement, triangle));
            }
            assert_eq!((nearest.placement, nearest.triangle), (2, 7));
        }
    }

    #[test]
    fn a_hit_exactly_at_the_limit_counts() {
        let mut nearest = Nearest::none(1.0);
        nearest.offer(hit(1.0), &named(5, 6));
        assert_eq!(nearest.placement, 5);
    }
}
