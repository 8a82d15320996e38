//! Starts of rays that leave a surface, by the hit's own error bound.
//!
//! A hit is solved in f64 (or found in f32, with f32's ε), so the point `p = o + t d` misses its triangle's plane by a few roundings
//! of the numbers that it was made from. Along the normal `n` these are at most
//!
//! ```text
//! e = k ε Σᵢ |nᵢ| (|pᵢ| + |oᵢ| + |Tᵢ| + |L p₀|ᵢ)
//! ```
//!
//! with the ray's origin `o`, the placement's translation `T` and the farthest corner of the mesh's box
//! turned into the world `L p₀` (each term is one that the solution adds or subtracts, or whose product it rounds; the sum
//! over the axes is Higham's bound for dot products, *Accuracy and Stability of Numerical
//! Algorithms*, 2002, section 3.1). A ray that leaves starts `e` off the plane, on its own side: the
//! idea of Wächter and Binder, "A Fast and Robust Method for Avoiding Self-Intersection", Ray Tracing
//! Gems 2019, with a bound in place of their constants. Nothing here has a unit, so nothing depends on
//! the scene's scale, and far from the origin the bound grows as f64's spacing does.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{HitPrecision, Mesh, Placement};

/// Roundings that a point, a later ray's origin and that ray's own test of this triangle go through:
/// about five each, and as many again for safety.
const ROUNDINGS: f64 = 32.0 * f64::EPSILON;

/// The same where hits are those of single precision: of the corners, of the ray and of the distance,
/// about two each, of which each number of the sum has its share, and as many again for safety.
const SINGLE_ROUNDINGS: f64 = 8.0 * f32::EPSILON as f64;

/// `k ε` of the bound for hits of some precision.
#[must_use]
pub fn roundings(precision: HitPrecision) -> f64 {
    match precision {
        HitPrecision::Double => ROUNDINGS,
        HitPrecision::Single => SINGLE_ROUNDINGS,
    }
}

/// A point of a surface, with how well it is known.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    /// The point (m, world).
    pub point: DVec3,
    /// Unit geometric normal.
    pub normal: DVec3,
    /// Bound on the distance (m) of the point from its triangle's plane, whatever is traced next.
    pub error: f64,
}

impl Anchor {
    /// The point on a triangle, found by a ray from `origin`, or for one; `magnitudes` are those of its
    /// placement, and `roundings` those of the hits' precision.
    pub(crate) fn new(
        point: DVec3,
        normal: DVec3,
        origin: DVec3,
        magnitudes: DVec3,
        roundings: f64,
    ) -> Self {
        let magnitudes = point.abs() + origin.abs() + magnitudes;
        Self { point, normal, error: roundings * normal.abs().dot(magnitudes) }
    }

    /// The point moved off the surface to the side that `towards` is on.
    #[must_use]
    pub fn leave(&self, towards: DVec3) -> DVec3 {
        let side = if towards.dot(self.normal) < 0.0 { -1.0 } else { 1.0 };
        self.point + self.normal * (side * self.error)
    }
}

/// `|T| + |L p₀|`: what a placement's own numbers add to the rounding of a hit (m). Of one that moves it is
/// `2 |L p₀|`, however it is turned: `|T|` is at most `|p| + |L p₀|`.
#[must_use]
pub fn magnitudes(placement: &Placement, mesh: &Mesh) -> DVec3 {
    let place = &placement.world_from_mesh;
    let bounds = mesh.bounds_at_all_times();
    let corner = bounds.min.abs().max(bounds.max.abs());
    if let Some(motion) = &placement.motion {
        return DVec3::splat(2.0 * motion.stretch() * corner.length());
    }
    let linear = &place.linear;
    let turned = linear.x_axis.abs() * corner.x
        + linear.y_axis.abs() * corner.y
        + linear.z_axis.abs() * corner.z;
    place.translation.abs() + turned
}
