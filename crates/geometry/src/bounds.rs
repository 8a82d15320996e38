//! Axis-aligned boxes, and which triangles are points or lines.

use glam::DVec3;

/// An axis-aligned box (m). Empty when `min` exceeds `max`, as a new one does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// The lower corner.
    pub min: DVec3,
    /// The upper corner.
    pub max: DVec3,
}

impl Bounds {
    /// The box of nothing: `+inf` to `−inf`, neutral in [`Self::union`].
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// The box of some points (m).
    #[must_use]
    pub fn of_points(points: impl IntoIterator<Item = DVec3>) -> Self {
        let mut bounds = Self::EMPTY;
        points.into_iter().for_each(|point| bounds.include(point));
        bounds
    }

    /// True if the box holds no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Grows the box to hold `point`. NaN coordinates are passed over.
    pub fn include(&mut self, point: DVec3) {
        self.min = self.min.min(point);
        self.max = self.max.max(point);
    }

    /// The smallest box that holds both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The centre (m); the origin for an empty box.
    #[must_use]
    pub fn centre(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.min + (self.max - self.min) * 0.5 }
    }

    /// The length of the diagonal (m); 0 for an empty box.
    #[must_use]
    pub fn diagonal(&self) -> f64 {
        if self.is_empty() { 0.0 } else { (self.max - self.min).length() }
    }

    /// The eight corners.
    #[must_use]
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            DVec3::new(
                if i & 1 == 0 { self.min.x } else { self.max.x },
                if i & 2 == 0 { self.min.y } else { self.max.y },
                if i & 4 == 0 { self.min.z } else { self.max.z },
            )
        })
    }
}

impl Default for Bounds {
    fn default() -> Self {
        Self::EMPTY
    }
}

/// True if a triangle is a point or a line.
///
/// Decided without rounding from the differences of its corners, so that no needle, however thin, is
/// taken for a line: products are compared by their rounded value and by what rounding took from it
/// (Dekker's exact product, *A floating-point technique for extending the available precision*, 1971).
#[must_use]
#[inline]
pub fn is_degenerate([a, b, c]: [DVec3; 3]) -> bool {
    let (e, f) = (b - a, c - a);
    e.cross(f) == DVec3::ZERO && are_parallel(e, f)
}

/// True if two vectors are parallel, or one of them is 0.
#[cold]
fn are_parallel(e: DVec3, f: DVec3) -> bool {
    let (Some(e), Some(f)) = (near_one(e), near_one(f)) else { return true };
    let is_same = |a: f64, b: f64, c: f64, d: f64| {
        let (p, q) = (a * b, c * d);
        p == q && a.mul_add(b, -p) == c.mul_add(d, -q)
    };
    is_same(e.x, f.y, e.y, f.x) && is_same(e.y, f.z, e.z, f.y) && is_same(e.z, f.x, e.x, f.z)
}

/// Scales a vector by a power of two so that its largest component is about 1; `None` for 0.
fn near_one(v: DVec3) -> Option<DVec3> {
    let size = v.abs().max_element();
    if size == 0.0 {
        return None;
    }
    // In two steps, because the reciprocal of the least numbers is none.
    let half = 2f64.powf(-(size.log2() / 2.0).round());
    Some(v * half * half)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_and_lines_have_no_area_and_needles_have() {
        let x = DVec3::new;
        let tiny = f64::EPSILON / 2.0;
        for (corners, expected) in [
            ([x(1.0, 2.0, 3.0); 3], true),
            ([DVec3::ZERO, DVec3::X, DVec3::X], true),
            ([DVec3::ZERO, x(1.0, 1.0, 1.0), x(3.0, 3.0, 3.0)], true),
            // In parts of f64's least numbers products vanish, and are no sign of a line.
            ([DVec3::ZERO, DVec3::X * 1e-300, DVec3::Y * 1e-300], false),
            ([DVec3::ZERO, DVec3::X * 5e-324, DVec3::Y * 5e-324], false),
            ([DVec3::ZERO, DVec3::X * 1e300, DVec3::Y * 1e300], false),
            // Both products of the cross product round to 1 + 4ε: (1 + 3ε)(1 + ε) and (1 + 2ε)².
            (
                [
                    DVec3::ZERO,
                    x(1.0 + 6.0 * tiny, 1.0 + 4.0 * tiny, 0.0),
                    x(1.0 + 4.0 * tiny, 1.0 + 2.0 * tiny, 0.0),
                ],
                false,
            ),
        ] {
            assert_eq!(is_degenerate(corners), expected, "{corners:?}");
        }
    }
}
