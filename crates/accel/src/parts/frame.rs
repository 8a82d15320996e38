//! Frames in which coordinates are about 1, and boxes in single precision that lose nothing.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Transform};

/// Origin and scale of a part: `p ↦ (p − origin) · scale`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PartFrame {
    pub(crate) origin: DVec3,
    /// A power of two.
    pub(crate) scale: f64,
}

impl PartFrame {
    /// A frame in which `bounds` lies within about −1..1. The origin stays where it is unless it is
    /// far away, because f32 coordinates stay exact then.
    pub(crate) fn of(bounds: Bounds) -> Self {
        if bounds.is_empty() {
            return Self { origin: DVec3::ZERO, scale: 1.0 };
        }
        let centre = bounds.min * 0.5 + bounds.max * 0.5;
        let half = bounds.max * 0.5 - bounds.min * 0.5;
        let far = centre.abs().max_element() > 4.0 * half.max_element();
        let origin = if far { centre } else { DVec3::ZERO };
        let reach = (bounds.max - origin).abs().max((bounds.min - origin).abs()).max_element();
        let origin = if origin.is_finite() { origin } else { DVec3::ZERO };
        Self { origin, scale: reciprocal_power(reach) }
    }

    /// A point of the mesh whose frame this is.
    #[inline(always)]
    pub(super) fn local(&self, point: DVec3) -> DVec3 {
        (point - self.origin) * self.scale
    }

    /// A point of a mesh that `transform` places in the world.
    #[inline(always)]
    pub(super) fn baked(&self, transform: &Transform, point: DVec3) -> DVec3 {
        transform.point_from(point, self.origin) * self.scale
    }
}

/// The power of two that brings `size` to at most 1 (1 for a size of 0), within f64's range.
#[expect(clippy::cast_possible_truncation, reason = "an exponent of f64 has 11 bits")]
pub(super) fn reciprocal_power(size: f64) -> f64 {
    if size > 0.0 { 2f64.powi(-(size.log2().ceil().clamp(-1000.0, 1000.0) as i32)) } else { 1.0 }
}

/// The single-precision box around `points`, rounded outward.
#[inline]
pub(crate) fn outward<const N: usize>(points: [DVec3; N]) -> ([f32; 3], [f32; 3]) {
    let mut bounds = Bounds::EMPTY;
    for point in points {
        bounds.include(point);
    }
    (bounds.min.to_array().map(round_down), bounds.max.to_array().map(round_up))
}

/// The largest f32 not above `x`.
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "rounding is the point")]
fn round_down(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) > x { near.next_down() } else { near }
}

/// The smallest f32 not below `x`.
#[inline]
fn round_up(x: f64) -> f32 {
    -round_down(-x)
}
