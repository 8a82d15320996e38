//! Targets of rays to lights.

use etendue_geometry::glam::DVec3;

/// A place on a light, or a direction to it, that was chosen.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Target {
    /// Kind of place that it is.
    pub(crate) kind: TargetKind,
    /// Position (m), the sum of the three: where a triangle begins, what f64 lost of that, and from there to the place.
    /// Of a direction, the first alone.
    pub(crate) place: [DVec3; 3],
    /// Unit normal of a triangle; else zero.
    pub(crate) normal: DVec3,
    /// Magnitudes of a triangle's own numbers, which add to the rounding of the place (m).
    pub(crate) magnitudes: DVec3,
    /// Density over the area (1/m²) or, of a direction, over the solid angle (1/sr), the light's chance
    /// included; of a point the chance alone.
    pub(crate) density: f64,
}

/// Kinds of places that light comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TargetKind {
    /// A point, which no direction meets by chance.
    Point,
    /// A direction, which no other is alike.
    Parallel,
    /// A place on a triangle.
    Triangle {
        /// It shines to both sides.
        two_sided: bool,
    },
}

impl Target {
    /// A direction (unit) or a point (m).
    pub(crate) fn bare(kind: TargetKind, place: DVec3, density: f64) -> Self {
        let place = [place, DVec3::ZERO, DVec3::ZERO];
        let (normal, magnitudes) = (DVec3::ZERO, DVec3::ZERO);
        Self { kind, place, normal, magnitudes, density }
    }
}
