//! Which triangles have an area. Those without are points or lines: no ray hits them, and builders of
//! trees need not bear them, so accelerators leave them out.

use glam::{DMat3, DVec3};

use crate::{Geometry, Mesh, Placement};

/// Whether a triangle is a point or a line.
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

/// Whether two vectors are parallel, or one of them 0.
#[cold]
fn are_parallel(e: DVec3, f: DVec3) -> bool {
    let (Some(e), Some(f)) = (near_one(e), near_one(f)) else { return true };
    let is_same = |a: f64, b: f64, c: f64, d: f64| {
        let (p, q) = (a * b, c * d);
        p == q && a.mul_add(b, -p) == c.mul_add(d, -q)
    };
    is_same(e.x, f.y, e.y, f.x) && is_same(e.y, f.z, e.z, f.y) && is_same(e.z, f.x, e.x, f.z)
}

/// The same direction by a power of two, its largest component about 1; `None` for 0.
fn near_one(v: DVec3) -> Option<DVec3> {
    let size = v.abs().max_element();
    if size == 0.0 {
        return None;
    }
    // In two steps, because the reciprocal of the least numbers is none.
    let half = 2f64.powf(-(size.log2() / 2.0).round());
    Some(v * half * half)
}

/// Tells the triangles of a mesh under a linear map apart: those with an area and those without.
#[derive(Debug, Clone, Copy)]
pub struct AreaTest<'a> {
    mesh: &'a Mesh,
    /// `None` where the map has an inverse, which keeps what has an area.
    linear: Option<&'a DMat3>,
}

impl<'a> AreaTest<'a> {
    /// For the mesh in its own frame.
    #[must_use]
    pub fn of(mesh: &'a Mesh) -> Self {
        Self { mesh, linear: None }
    }

    /// For the mesh as `linear` turns and stretches it.
    #[must_use]
    pub fn under(mesh: &'a Mesh, linear: &'a DMat3) -> Self {
        Self { mesh, linear: (linear.determinant() == 0.0).then_some(linear) }
    }

    /// Whether all triangles are known to have an area, without a look at each.
    #[must_use]
    pub fn keeps_all(&self) -> bool {
        self.linear.is_none() && self.mesh.degenerate == 0
    }

    /// Whether triangle `i` has an area.
    #[must_use]
    #[inline]
    pub fn keeps(&self, i: usize) -> bool {
        let [a, b, c] = self.mesh.corners(i);
        match self.linear {
            None => !is_degenerate([a, b, c]),
            Some(linear) => !is_degenerate([DVec3::ZERO, *linear * (b - a), *linear * (c - a)]),
        }
    }
}

impl Placement {
    /// Whether the placement leaves anything an area: not when it scales two of three axes to 0, as
    /// files hide objects.
    #[must_use]
    pub fn has_extent(&self) -> bool {
        let [x, y, z] = {
            let m = &self.world_from_mesh.linear;
            [m.x_axis, m.y_axis, m.z_axis]
        };
        [(x, y), (y, z), (z, x)].into_iter().any(|(a, b)| !is_degenerate([DVec3::ZERO, a, b]))
    }
}

impl Geometry {
    /// Whether any triangle of `placement` has an area where it stands.
    #[must_use]
    pub fn has_area(&self, placement: &Placement) -> bool {
        let mesh = self.mesh_of(placement);
        let count = mesh.triangles.len();
        if mesh.degenerate >= count as u64 || !placement.has_extent() {
            return false;
        }
        let linear = &placement.world_from_mesh.linear;
        // With an inverse, some triangle keeps its area.
        linear.determinant() != 0.0 || {
            let test = AreaTest::under(mesh, linear);
            (0..count).any(|i| test.keeps(i))
        }
    }
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
