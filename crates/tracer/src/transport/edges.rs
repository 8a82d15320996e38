//! Hits of single precision beside the edges of their triangles: paths that leave them start a little
//! before.
//!
//! In f32 a hit is misplaced, and the ray that leaves it is rounded, by some 10⁻⁷ of the coordinates. Where two
//! walls meet at a corner, what starts nearer to the other wall than that may start behind it, and sees
//! what is outside of a closed room. The ray itself came from inside: so hits beside an edge are brought back
//! along it by a share of the bound of [`spawn`](crate::spawn).

use etendue_geometry::HitBatch;

use super::Tracing;
use super::paths::Paths;

/// Hits whose least barycentric weight is above this are where they are: only triangles that are less than
/// some hundred bounds high have others so near to an edge, and a mesh of those has no sharp corners that it
/// can resolve.
const BESIDE: f64 = 1.0 / 256.0;

/// How far hits are brought back, over the bound, which counts more roundings for safety than these two: of
/// the hit, and of the origin of the ray that leaves it.
const SHARE: f64 = 0.25;

impl Tracing<'_> {
    /// Brings hits beside edges back, but for surfaces that light passes, which it leaves on the other side.
    pub(super) fn keep_off_edges(&self, paths: &Paths, hits: &mut HitBatch) {
        for i in 0..paths.states.len() {
            let (u, v) = (hits.u[i], hits.v[i]);
            if u.min(v).min(1.0 - u - v) > BESIDE {
                continue;
            }
            let Some(placed) = self.stage.placed.get(hits.placement[i]).filter(|p| p.is_opaque)
            else {
                continue;
            };
            let origin = paths.rays.origin(i);
            let point = origin + paths.rays.direction(i) * hits.t[i];
            let magnitudes = point.abs() + origin.abs() + placed.magnitudes;
            let back = SHARE * self.stage.roundings() * magnitudes.max_element();
            hits.t[i] = (hits.t[i] - back).max(0.0);
        }
    }
}
