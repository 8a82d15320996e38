//! One rule for surfaces in one place: the later placement wins, whatever a backend's traversal met first.

use etendue_geometry::{Coplanar, Geometry, HitBatch, MISS, RayBatch};

use crate::nearest::{Nearest, PlacementView, Query, Triangle};

/// Distances that differ by no more than this, of the largest coordinate of the ray's origin and of the distance, are
/// one: 64 units in f64's last place, more than a hit's own roundings.
const ONE_PLACE: f64 = 64.0 * f64::EPSILON;

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
        let own = [hits.placement[i], hits.triangle[i]];
        let others = coplanar.others(own);
        if others.is_empty() {
            continue;
        }
        let Some(query) = Query::of(rays, i) else { continue };
        let ends = rays.endpoint_triangles().map(|ends| ends[i]);
        let test = |[placement, number]: [u32; 2]| {
            let triangle = Triangle::of(geometry, placement, number);
            let place = &geometry.placements[placement as usize].world_from_mesh;
            Some((query.test(&PlacementView::new(place), triangle.corners)?, triangle))
        };
        let spared = |id: &&[u32; 2]| !ends.is_some_and(|ends| ends.contains(id));
        let met: Vec<_> = others.iter().filter(spared).copied().filter_map(test).collect();
        let found = test(own).map(|(hit, _)| hit.t);
        let Some(nearest) = met.iter().map(|(hit, _)| hit.t).chain(found).reduce(f64::min) else {
            continue;
        };
        let size = nearest.abs().max(query.origin.abs().max_element());
        let is_near = |t: f64| t <= nearest + ONE_PLACE * size;
        let near = met.into_iter().filter(|(hit, _)| is_near(hit.t));
        let latest = near
            .max_by(|(_, a), (_, b)| a.placement.cmp(&b.placement).then(b.number.cmp(&a.number)));
        let Some((hit, triangle)) = latest else { continue };
        // What was found stays, where it is as near and later.
        if found.is_some_and(is_near) && own[0] >= triangle.placement {
            continue;
        }
        let mut settled = Nearest::none(f64::INFINITY);
        settled.offer(hit, &triangle);
        settled.write(geometry, hits, i);
    }
}
