//! Hits of single precision beside the edges of their triangles: paths that leave them start a little
//! inside.
//!
//! In f32 a hit is misplaced, and the ray that leaves it is rounded, by some 10⁻⁷ of the coordinates. Where two
//! walls meet at a corner, what starts nearer to the other wall than that may start behind it, and sees
//! what is outside of a closed room. So a point that is nearer to an edge of its triangle than an eighth of
//! the bound of [`spawn`](crate::spawn) is moved along the triangle until it is as far.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{HitBatch, Placement};

use super::Tracing;
use super::paths::Paths;
use crate::reference::SurfacePoint;

/// Hits whose least barycentric weight is above this are not looked at: only triangles that are less than
/// some hundred bounds high have others, and a mesh of those has no sharp corners that it can resolve.
const BESIDE: f64 = 1.0 / 256.0;

/// What is kept clear of the edge, over the bound, which counts more roundings for safety than these two: of
/// the hit, and of the origin of the ray that leaves it.
const SHARE: f64 = 0.125;

/// The largest of the least weights: a triangle's middle is inside.
const MOST: f64 = 1.0 / 3.0;

impl Tracing<'_> {
    /// Moves the rays of hits beside edges by as much as their points have to be moved.
    pub(super) fn keep_off_edges(&self, paths: &mut Paths, hits: &HitBatch) {
        for i in 0..paths.states.len() {
            let (u, v) = (hits.u[i], hits.v[i]);
            let weights = [1.0 - u - v, u, v];
            if weights.iter().all(|weight| *weight > BESIDE) {
                continue;
            }
            let Some(placed) = self.stage.placed.get(hits.placement[i]) else { continue };
            let Some(spot) = self.stage.surroundings.spot(hits, i) else { continue };
            let origin = paths.rays.origin(i);
            let point = origin + paths.rays.direction(i) * hits.t[i];
            let magnitudes = point.abs() + origin.abs() + placed.magnitudes;
            let bound = SHARE * self.stage.roundings() * magnitudes.max_element();
            if let Some(by) = inwards(spot.placement, &spot, weights, bound) {
                let rays = paths.rays.arrays_mut();
                for axis in 0..3 {
                    rays.origins[axis][i] += by[axis];
                }
            }
        }
    }
}

/// What brings a place of a triangle to a distance `bound` (m) from all its edges, or into its middle; `None`
/// where it is so far, or the triangle has no area.
fn inwards(
    placement: &Placement,
    spot: &SurfacePoint<'_>,
    weights: [f64; 3],
    bound: f64,
) -> Option<DVec3> {
    let linear = &placement.world_from_mesh.linear;
    let [a, b, c] = spot.mesh.corners(spot.triangle);
    let [to_b, to_c] = [linear.mul_vec3(b - a), linear.mul_vec3(c - a)];
    let doubled_area = to_b.cross(to_c).length();
    // Of the edge across from each corner.
    let lengths = [(to_c - to_b).length(), to_c.length(), to_b.length()];
    let least = lengths.map(|length| (bound * length / doubled_area).min(MOST));
    let is_off = weights.iter().zip(&least).all(|(weight, least)| weight >= least);
    if is_off || doubled_area == 0.0 {
        return None;
    }
    let raised: [f64; 3] = std::array::from_fn(|k| (weights[k] - least[k]).max(0.0));
    let (left, sum) = (1.0 - least.iter().sum::<f64>(), raised.iter().sum::<f64>());
    let share = if sum > 0.0 { left / sum } else { 0.0 };
    let moved: [f64; 3] = std::array::from_fn(|k| least[k] + raised[k] * share);
    Some(to_b * (moved[1] - weights[1]) + to_c * (moved[2] - weights[2]))
}
