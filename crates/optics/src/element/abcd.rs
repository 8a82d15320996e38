//! Matrices of first-order optics.
//!
//! A matrix acts on the height y and the reduced slope ν = n u of a ray: a refracting surface of
//! power Φ = (n' − n) c is [1 0; −Φ 1], a gap t in index n is [1 t/n; 0 1] (A. Gerrard and J. M.
//! Burch, *Introduction to Matrix Methods in Optics*, 1975). Both have determinant 1.

/// Matrix [a b; c d] on (y, ν).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Abcd {
    /// Height for height.
    pub a: f64,
    /// Height for reduced slope (mm).
    pub b: f64,
    /// Reduced slope for height (1/mm): minus the power.
    pub c: f64,
    /// Reduced slope for reduced slope.
    pub d: f64,
}

impl Abcd {
    pub(crate) const ONE: Self = Self { a: 1.0, b: 0.0, c: 0.0, d: 1.0 };

    pub(crate) fn power(power: f64) -> Self {
        Self { c: -power, ..Self::ONE }
    }

    pub(crate) fn gap(reduced: f64) -> Self {
        Self { b: reduced, ..Self::ONE }
    }

    /// First `self`, then `next`.
    pub(crate) fn then(self, next: Self) -> Self {
        Self {
            a: next.a * self.a + next.b * self.c,
            b: next.a * self.b + next.b * self.d,
            c: next.c * self.a + next.d * self.c,
            d: next.c * self.b + next.d * self.d,
        }
    }

    /// With `self` from the first vertex to the sensor: the height on the sensor (mm) for a slope of
    /// 1 through the axis at z = `pupil`, air in front.
    #[must_use]
    pub fn image_scale(&self, pupil: f64) -> f64 {
        self.b - self.a * pupil
    }

    /// Distance of the object plane in focus in front of the first vertex (mm), air in front.
    #[must_use]
    pub fn conjugate(&self) -> f64 {
        let distance = -self.b / self.a;
        // A rounding away from infinity is infinity.
        if distance.is_finite() && distance.abs() < 1e15 { distance } else { f64::INFINITY }
    }
}
