//! Affine maps whose translation keeps twice f64's precision.
//!
//! A chain of nodes may carry a mesh 10⁷ m away and then place it to the millimetre. In one f64 the
//! sum of both would round to 2·10⁻⁹ m; here the rounding error of every sum is kept beside it
//! (Knuth's two-sum, *The Art of Computer Programming* vol. 2, 4.2.2, theorem B), so that what a
//! camera nearby sees, which depends on differences only, is exact.

use glam::{DAffine3, DMat3, DQuat, DVec3};

/// `p ↦ linear · p + translation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform {
    /// Rotation, scale and shear.
    pub linear: DMat3,
    /// Translation (m), rounded to f64.
    pub translation: DVec3,
    /// Rounding error of the translation (m): what rounding took from it.
    pub translation_low: DVec3,
}

impl Transform {
    /// The map that changes nothing.
    pub const IDENTITY: Self =
        Self { linear: DMat3::IDENTITY, translation: DVec3::ZERO, translation_low: DVec3::ZERO };

    /// From a linear part and a translation (m).
    #[must_use]
    pub fn new(linear: DMat3, translation: DVec3) -> Self {
        Self { linear, translation, translation_low: DVec3::ZERO }
    }

    /// Scales, then rotates, then translates (m): glTF's TRS.
    #[must_use]
    pub fn from_trs(translation: DVec3, rotation: DQuat, scale: DVec3) -> Self {
        Self::new(DMat3::from_quat(rotation) * DMat3::from_diagonal(scale), translation)
    }

    /// The map that applies `inner` first and then `self`.
    #[must_use]
    pub fn then_inner(&self, inner: &Self) -> Self {
        let moved = self.linear * inner.translation;
        let (translation, low) = two_sum(self.translation, moved);
        Self {
            linear: self.linear * inner.linear,
            translation,
            translation_low: low + self.translation_low + self.linear * inner.translation_low,
        }
    }

    /// Maps `point` (m).
    #[must_use]
    pub fn point(&self, point: DVec3) -> DVec3 {
        self.point_from(point, DVec3::ZERO)
    }

    /// Maps `point`, as seen from `origin` (m): `self(point) − origin`, without the loss of forming
    /// `self(point)` first.
    #[must_use]
    pub fn point_from(&self, point: DVec3, origin: DVec3) -> DVec3 {
        self.linear * point + self.offset_from(origin)
    }

    /// The translation as seen from `origin` (m).
    #[must_use]
    pub fn offset_from(&self, origin: DVec3) -> DVec3 {
        (self.translation - origin) + self.translation_low
    }

    /// −1 when the map turns a triangle's winding over, else 1.
    #[must_use]
    pub fn handedness(&self) -> f64 {
        if self.linear.determinant() < 0.0 { -1.0 } else { 1.0 }
    }

    /// True if the map changes nothing at all.
    #[must_use]
    pub fn is_identity(&self) -> bool {
        *self == Self::IDENTITY
    }

    /// True if all numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.linear.is_finite() && self.translation.is_finite() && self.translation_low.is_finite()
    }

    /// The matrix that carries normals, up to length: the cofactors of the linear part, which
    /// exist for singular maps too.
    #[must_use]
    pub fn normal_matrix(&self) -> DMat3 {
        let [x, y, z] = [self.linear.x_axis, self.linear.y_axis, self.linear.z_axis];
        DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * self.handedness()
    }
}

impl Default for Transform {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl From<DAffine3> for Transform {
    fn from(affine: DAffine3) -> Self {
        Self::new(affine.matrix3, affine.translation)
    }
}

/// `a + b` and its rounding error, exactly.
fn two_sum(a: DVec3, b: DVec3) -> (DVec3, DVec3) {
    let sum = a + b;
    let b_virtual = sum - a;
    let a_virtual = sum - b_virtual;
    (sum, (a - a_virtual) + (b - b_virtual))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_far_away_keeps_what_f64_would_round_off() {
        let far = Transform::new(DMat3::IDENTITY, DVec3::new(1e7, -1e7, 1e7));
        let near = Transform::new(DMat3::IDENTITY, DVec3::splat(0.1));
        let chain = far.then_inner(&near);
        let seen = chain.point_from(DVec3::ZERO, far.translation);
        assert_eq!(seen, DVec3::splat(0.1), "0.1 m beside a camera at 10⁷ m must stay 0.1 m");
    }

    #[test]
    fn normals_stay_outside_under_mirrors() {
        let mirror = Transform::from_trs(DVec3::ZERO, DQuat::IDENTITY, DVec3::new(-1.0, 1.0, 1.0));
        assert_eq!(mirror.handedness(), -1.0);
        // The outside of a face that looks along +x looks along −x once x is mirrored.
        assert_eq!((mirror.normal_matrix() * DVec3::X).normalize(), DVec3::NEG_X);
        assert_eq!((mirror.normal_matrix() * DVec3::Y).normalize(), DVec3::Y);
    }
}
