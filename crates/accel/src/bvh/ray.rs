//! A ray made ready for single precision.
//!
//! With ε = 2⁻²⁴ and everything in a frame where coordinates are at most about 1, each step on the
//! way to a box or a triangle is off by a few ε of the coordinates involved. Instead of tracking
//! each, the sum of all is bounded once a ray, and boxes and edges are widened by it. Nothing is
//! ever culled that f64 would hit; the widening is about 10⁻⁶ of the frame, which costs next to
//! nothing as long as triangles are larger than that.

use etendue_geometry::glam::Vec3;

use super::lanes::Lanes;
use crate::parts::{LocalRay, round_down, round_up};

/// A ray in a frame's single-precision coordinates, with unit direction; its own distance τ is
/// (t · `length`) − `skipped`.
#[derive(Debug, Clone, Copy)]
pub(super) struct NarrowRay {
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    /// What no coordinate of the ray, against a box or a triangle near it, is off by.
    pub(super) error: f32,
    /// Where the ray begins to count (τ).
    pub(super) near: f32,
    /// Frame lengths per world distance.
    length: f64,
    /// How far the origin was moved along the ray.
    skipped: f64,
}

/// Farther from the frame's origin than this, the ray is moved closer before it is rounded. All
/// triangles are within √3 of it.
const FAR: f64 = 4.0;

/// The least component that a reciprocal is taken of. In place of a smaller one it moves no point
/// of a ray inside the frame by more than a rounding.
const LEAST: f32 = 1e-12;

impl NarrowRay {
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "single precision finds")]
    pub(super) fn new(ray: &LocalRay, t_min: f64) -> Self {
        let length = ray.direction.length();
        let direction = ray.direction / length;
        let distance = ray.origin.length();
        let skipped = if distance > FAR { distance - 2.0 } else { 0.0 };
        let origin = ray.origin + direction * skipped;
        let origin_size = origin.abs().max_element();
        Self {
            origin: origin.as_vec3(),
            direction: direction.as_vec3(),
            error: f32::EPSILON * (8.0 * origin_size as f32 + 6.0) + 4.0 * round_up(ray.pad),
            near: round_down(t_min * length - skipped).max(0.0),
            length,
            skipped,
        }
    }

    /// The ray's own distance for `t`, rounded up with room for the error of either.
    #[inline(always)]
    pub(super) fn far(&self, t: f64) -> f32 {
        let far = round_up(t * self.length - self.skipped);
        far + (far.abs() * 4.0 * f32::EPSILON + self.error)
    }
}

/// The reciprocal of a direction, finite and not zero.
#[inline(always)]
pub(super) fn safe_reciprocal(direction: Vec3) -> Vec3 {
    let steer = |d: f32| if d.abs() < LEAST { LEAST.copysign(d) } else { d };
    Vec3::from_array(direction.to_array().map(steer)).recip()
}

/// A ray, or a bundle of them, against eight boxes: for each axis, *near* plane · `inverse_near` −
/// `near_offset` is at most the distance to it, and likewise far.
#[derive(Clone, Copy)]
pub(super) struct BoxTest<L: Lanes> {
    /// 1 for axes along which the ray runs backwards.
    pub(super) backwards: [usize; 3],
    pub(super) inverse_near: [L::F; 3],
    pub(super) inverse_far: [L::F; 3],
    pub(super) near_offset: [L::F; 3],
    pub(super) far_offset: [L::F; 3],
    pub(super) near: L::F,
}

impl<L: Lanes> BoxTest<L> {
    #[inline(always)]
    pub(super) fn new(lanes: L, ray: &NarrowRay) -> Self {
        let inverse = safe_reciprocal(ray.direction);
        let offset = ray.origin * inverse;
        let widening = inverse.abs() * ray.error;
        let splat = |v: Vec3| v.to_array().map(|x| lanes.splat(x));
        Self {
            backwards: inverse.to_array().map(|x| usize::from(x < 0.0)),
            inverse_near: splat(inverse),
            inverse_far: splat(inverse),
            near_offset: splat(offset + widening),
            far_offset: splat(offset - widening),
            near: lanes.splat(ray.near),
        }
    }
}

/// A ray against eight triangles, by S. Woop, C. Benthin, I. Wald, "Watertight ray/triangle
/// intersection", 2013: a shear that makes the ray the z axis, in which edges are lines past the
/// origin. Here only to *reject*: what is kept is decided in f64.
#[derive(Clone, Copy)]
pub(super) struct TriangleTest<L: Lanes> {
    /// Numbers of the axes: the ray's longest last.
    pub(super) axes: [usize; 3],
    pub(super) origin: [L::F; 3],
    pub(super) shear: [L::F; 3],
    /// A sheared coordinate is off by no more than half of this.
    pub(super) error: L::F,
    pub(super) near: L::F,
}

impl<L: Lanes> TriangleTest<L> {
    #[inline(always)]
    pub(super) fn new(lanes: L, ray: &NarrowRay) -> Self {
        let d = ray.direction.to_array();
        let size = ray.direction.abs();
        let z = if size.x > size.y && size.x > size.z {
            0
        } else if size.y > size.z {
            1
        } else {
            2
        };
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let origin = ray.origin.to_array();
        Self {
            axes,
            origin: axes.map(|axis| lanes.splat(origin[axis])),
            shear: [d[axes[0]] / d[z], d[axes[1]] / d[z], 1.0 / d[z]].map(|x| lanes.splat(x)),
            error: lanes.splat(4.0 * ray.error),
            near: lanes.splat(ray.near - 4.0 * ray.error),
        }
    }

    /// Which of up to eight triangles the ray may hit before `far`. `corners` has the coordinates
    /// of `n` triangles, in runs of `n`.
    #[inline(always)]
    pub(super) fn maybe(&self, lanes: L, corners: &[f32], n: usize, far: f32) -> u32 {
        let l = lanes;
        let coordinate = |corner: usize, axis: usize| {
            let start = (3 * corner + axis) * n;
            match corners.get(start..).and_then(|rest| rest.first_chunk::<8>()) {
                Some(run) => l.load(run),
                None => l.splat(0.0),
            }
        };
        let sheared = [0, 1, 2].map(|corner| {
            let z = l.sub(coordinate(corner, self.axes[2]), self.origin[2]);
            let x = l.sub(coordinate(corner, self.axes[0]), self.origin[0]);
            let y = l.sub(coordinate(corner, self.axes[1]), self.origin[1]);
            [l.neg_mul_add(self.shear[0], z, x), l.neg_mul_add(self.shear[1], z, y), z]
        });
        let edge =
            |[px, py, _]: [L::F; 3], [qx, qy, _]: [L::F; 3]| l.mul_sub(px, qy, l.mul(py, qx));
        let [a, b, c] = sheared;
        let [u, v, w] = [edge(c, b), edge(a, c), edge(b, a)];
        // Each product has two coordinates that are off by at most half the error.
        let size = |[x, y, _]: [L::F; 3]| l.add(l.abs(x), l.abs(y));
        let sizes = l.add(l.add(size(a), size(b)), l.add(size(c), self.error));
        let error = l.mul(sizes, self.error);
        let least = l.min(l.min(u, v), w);
        let most = l.max(l.max(u, v), w);
        let zero = l.splat(0.0);
        let inside = l.le(l.sub(zero, least), error) | l.le(most, error);

        let z = [a[2], b[2], c[2]].map(|z| l.mul(z, self.shear[2]));
        let closest = l.min(l.min(z[0], z[1]), z[2]);
        let farthest = l.max(l.max(z[0], z[1]), z[2]);
        let within = l.le(closest, l.add(l.splat(far), self.error)) & l.le(self.near, farthest);
        inside & within & ((1 << n) - 1)
    }
}
