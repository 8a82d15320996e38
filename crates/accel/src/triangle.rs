//! The formula of a line and a triangle, written once: one ray calls it as it is, and loops over rays
//! side by side call it for each, which vectorises because nothing in it branches.
//!
//! With corners seen from the ray's origin, *a* the first and *e₁*, *e₂* the edges that leave it, the
//! line along *d* meets the triangle's plane where *a* + u *e₁* + v *e₂* = t *d*. Each unknown comes from
//! the product that makes the other two vanish:
//!
//! ```text
//! n = e1 × e2,   t = n·a / n·d,   u = (a × d)·e2 / n·d,   v = −(a × d)·e1 / n·d
//! ```
//!
//! (Möller & Trumbore 1997, with the distance from the plane: Kensler & Shirley 2006.)

/// A vector by its components, as loops over rays side by side have them.
pub(crate) type Vector = [f64; 3];

/// The line's meeting with the plane, every unknown still times [`Self::along`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlaneCrossing {
    /// n, of twice the triangle's area.
    pub(crate) normal: Vector,
    /// n·d: below zero when the line meets the front; 0 for a triangle that is seen edge-on.
    pub(crate) along: f64,
    /// t times `along`.
    pub(crate) t: f64,
    /// u times `along`.
    pub(crate) u: f64,
    /// v times `along`.
    pub(crate) v: f64,
}

/// The crossing of the line from the origin along `d` with the triangle `a`, `a` + `e1`, `a` + `e2`.
#[inline(always)]
pub(crate) fn cross_plane(a: Vector, e1: Vector, e2: Vector, d: Vector) -> PlaneCrossing {
    let normal = cross(e1, e2);
    let moment = cross(a, d);
    PlaneCrossing {
        normal,
        along: dot(normal, d),
        t: dot(normal, a),
        u: dot(moment, e2),
        v: -dot(moment, e1),
    }
}

/// The vector product.
#[inline(always)]
pub(crate) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The scalar product, summed from x to z.
#[inline(always)]
pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The difference `a` − `b`.
#[inline(always)]
pub(crate) fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Entry `i` of three arrays, one an axis.
#[inline(always)]
pub(crate) fn at<const N: usize>(axes: &[[f64; N]; 3], i: usize) -> Vector {
    [axes[0][i], axes[1][i], axes[2][i]]
}
