//! A ray made ready for single precision.
//!
//! With ε = 2⁻²⁴ and everything in a frame where coordinates are at most about 1, each step on the
//! way to a box or a triangle is off by a few ε of the coordinates involved. Instead of tracking
//! each, the sum of all is bounded once a ray, and boxes and edges are widened by it. Nothing is
//! ever culled that f64 would hit; the widening is about 10⁻⁶ of the frame, which costs next to
//! nothing as long as triangles are larger than that.

use etendue_geometry::glam::{DVec3, Vec3};

use super::lanes::{Arithmetic, Lanes};
use super::wide::LeafNumbers;
use crate::nearest::Query;
use crate::parts::{LocalRay, PartInstance};

/// A ray in a frame's single-precision coordinates, with unit direction; its own distance τ is
/// (t · `length`) − `skipped`.
#[derive(Debug, Clone, Copy)]
pub(super) struct NarrowRay {
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    /// Bound on the error of a coordinate of the ray, against a box or a triangle near it.
    pub(super) error: f32,
    /// Distance at which the ray begins to count (τ).
    pub(super) near: f32,
    /// Frame lengths per world distance.
    length: f64,
    /// Distance by which the origin was moved along the ray.
    skipped: f64,
}

/// Bound on the error of a plane of a box, against a ray that begins within `origin` of the frame's origin along each
/// axis, is off by along its axis: with ε = 2⁻²⁴ and planes within 1, the plane is rounded (ε), the origin is (ε ·
/// `origin`), and so are its product with the reciprocal and the sum with this error (twice that); the direction, its
/// reciprocal and the last sum are relative to their distance (3 ε (1 + `origin`)). Then there is what f64 did before.
#[inline(always)]
pub(super) fn box_error(origin: f32, pad: f32) -> f32 {
    (f32::EPSILON / 2.0 * (7.0 * origin + 5.0) + 2.0 * pad).min(MOST_ERROR)
}

/// In units of [`box_error`], what edge tests and distances of triangles allow for. A coordinate
/// relative to the origin is off by 2 ε (1 + `origin`); after a shear by at most s, itself off by 4 ε s,
/// by (4 + 8 s) ε (1 + `origin`); an edge's determinant by 1.7 times that per length, with the
/// rounding of its own products. That is 20 for s = 1, where the box's error is 5 or more.
pub(super) const TRIANGLE_ERROR: f32 = 4.0;

/// Error bound, likewise, for shears by up to 2.1.
pub(super) const SKEW_TRIANGLE_ERROR: f32 = 7.0;

/// Farther from the frame's origin than this, the ray is moved closer before it is rounded. All
/// triangles are within √3 of it.
pub(super) const FAR: f64 = 4.0;

/// The largest error that is reckoned with: beyond the frame's 1 every box is met in any case, and an instance whose
/// coordinates f64 cannot tell apart (1e-39 m, seen from metres away) must not make sums of infinities, which meet even
/// boxes that are not there.
const MOST_ERROR: f32 = 1e12;

/// The least component that a reciprocal is taken of. In place of a smaller one it moves no point
/// of a ray inside the frame by more than a rounding.
const LEAST: f32 = 1e-12;

impl NarrowRay {
    /// The world's ray in `instance`'s frame.
    #[inline(always)]
    pub(super) fn new(instance: &PartInstance, query: &Query) -> Self {
        let local = instance.ray(query.origin, query.direction);
        // Nearly always a frame parallel to the world, a unit direction and an origin nearby.
        let scale = instance.parallel_scale;
        let is_near = local.origin.length_squared() <= FAR * FAR;
        let is_unit = (query.direction.length_squared() - 1.0).abs() < 0.1;
        if scale > 0.0 && is_near && is_unit {
            Self::rounded(local.origin, query.direction, local.pad, query.t_min, scale, 0.0)
        } else {
            Self::of_any_length(&local, query.t_min)
        }
    }

    fn of_any_length(ray: &LocalRay, t_min: f64) -> Self {
        let length = ray.direction.length();
        let direction = ray.direction / length;
        let distance = ray.origin.length();
        let skipped = if distance > FAR { distance - 2.0 } else { 0.0 };
        let origin = ray.origin + direction * skipped;
        Self::rounded(origin, direction, ray.pad, t_min, length, skipped)
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "single precision finds")]
    fn rounded(
        origin: DVec3,
        direction: DVec3,
        pad: f64,
        t_min: f64,
        length: f64,
        skipped: f64,
    ) -> Self {
        let near = (t_min * length - skipped) as f32;
        let origin = origin.as_vec3();
        let error = box_error(origin.abs().max_element(), pad as f32);
        Self {
            origin,
            direction: direction.as_vec3(),
            error,
            near: (near - near * f32::EPSILON).max(0.0),
            length,
            skipped,
        }
    }

    /// The ray's own distance for `t`, rounded up with room for the error of either.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "single precision finds")]
    pub(super) fn far(&self, t: f64) -> f32 {
        let far = ((t * self.length - self.skipped) as f32).max(f32::MIN);
        far + (far.abs() * (4.0 * f32::EPSILON) + self.error)
    }
}

/// The reciprocal of a direction, finite and not zero.
#[inline(always)]
pub(super) fn safe_reciprocal(direction: Vec3) -> Vec3 {
    Vec3::new(steer(direction.x), steer(direction.y), steer(direction.z)).recip()
}

/// A component of a direction that has a finite reciprocal.
#[inline(always)]
pub(super) fn steer(d: f32) -> f32 {
    if d.abs() < LEAST { LEAST.copysign(d) } else { d }
}

#[inline(always)]
fn splat<L: Arithmetic>(lanes: L, v: Vec3) -> [L::F; 3] {
    [lanes.splat(v.x), lanes.splat(v.y), lanes.splat(v.z)]
}

#[inline(always)]
fn backwards(d: f32) -> usize {
    usize::from(d < 0.0)
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
        Self {
            backwards: [backwards(inverse.x), backwards(inverse.y), backwards(inverse.z)],
            inverse_near: splat(lanes, inverse),
            inverse_far: splat(lanes, inverse),
            near_offset: splat(lanes, offset + widening),
            far_offset: splat(lanes, offset - widening),
            near: lanes.splat(ray.near),
        }
    }
}

/// The axis after each.
const NEXT: [usize; 3] = [1, 2, 0];

/// The axes, with the longest of `direction` last.
#[inline(always)]
pub(super) fn axes(direction: Vec3) -> [usize; 3] {
    let size = direction.abs();
    let z = if size.x > size.y && size.x > size.z {
        0
    } else if size.y > size.z {
        1
    } else {
        2
    };
    [NEXT[z], NEXT[NEXT[z]], z]
}

/// A ray against eight triangles, by S. Woop, C. Benthin, I. Wald, "Watertight ray/triangle
/// intersection", 2013: a shear that makes the ray the z axis, in which edges are lines past the
/// origin. Here only to *reject*: what is kept is decided in f64.
#[derive(Clone, Copy)]
pub(super) struct TriangleTest<L: Arithmetic> {
    /// Numbers of the axes: the ray's longest last.
    pub(super) axes: [usize; 3],
    pub(super) origin: [L::F; 3],
    pub(super) shear: [L::F; 3],
    /// Bound on the error of a distance, or of an edge's determinant per length.
    pub(super) error: L::F,
    pub(super) near: L::F,
}

impl<L: Lanes> TriangleTest<L> {
    #[inline(always)]
    pub(super) fn new(lanes: L, ray: &NarrowRay) -> Self {
        let d = ray.direction.to_array();
        let [x, y, z] = axes(ray.direction);
        let inverse = 1.0 / d[z];
        let o = ray.origin.to_array();
        Self {
            axes: [x, y, z],
            origin: splat(lanes, Vec3::new(o[x], o[y], o[z])),
            shear: splat(lanes, Vec3::new(d[x] * inverse, d[y] * inverse, inverse)),
            error: lanes.splat(TRIANGLE_ERROR * ray.error),
            near: lanes.splat(ray.near),
        }
    }

    /// Mask of the `n` triangles of a leaf that the ray may hit before `far`.
    #[inline(always)]
    pub(super) fn maybe(&self, l: L, numbers: &LeafNumbers, n: usize, far: f32) -> u32 {
        let a = self.shear(l, self.runs(l, numbers, 0, n));
        let b = self.shear(l, self.runs(l, numbers, 3, n));
        let c = self.shear(l, self.runs(l, numbers, 6, n));
        self.decide(l, [a, b, c], l.splat(far)).maybe & ((1 << n) - 1)
    }

    /// The coordinates of eight corners that begin with run `first`, along this test's axes.
    #[inline(always)]
    fn runs(&self, l: L, numbers: &LeafNumbers, first: usize, n: usize) -> [L::F; 3] {
        [
            run(l, numbers, (first + self.axes[0]) * n),
            run(l, numbers, (first + self.axes[1]) * n),
            run(l, numbers, (first + self.axes[2]) * n),
        ]
    }
}

impl<L: Arithmetic> TriangleTest<L> {
    /// Tests some rays (this test being that of a different ray in each lane) against triangle `i`
    /// of a leaf before `far`.
    #[inline(always)]
    pub(super) fn look(
        &self,
        l: L,
        runs: &LeafCorners<'_>,
        i: usize,
        far: L::F,
    ) -> TriangleLook<L> {
        let [a, b, c] = runs.corners;
        let a = self.shear(l, [l.splat(a[0][i]), l.splat(a[1][i]), l.splat(a[2][i])]);
        let b = self.shear(l, [l.splat(b[0][i]), l.splat(b[1][i]), l.splat(b[2][i])]);
        let c = self.shear(l, [l.splat(c[0][i]), l.splat(c[1][i]), l.splat(c[2][i])]);
        self.decide(l, [a, b, c], far)
    }

    #[inline(always)]
    fn decide(&self, l: L, [a, b, c]: [ShearedPoint<L>; 3], far: L::F) -> TriangleLook<L> {
        let (u, v, w) = (edge(l, c, b), edge(l, a, c), edge(l, b, a));
        let sizes = l.add(l.add(size(l, a), size(l, b)), l.add(size(l, c), self.error));
        let error = l.mul(sizes, self.error);
        let least = l.min(l.min(u, v), w);
        let most = l.max(l.max(u, v), w);
        let negative = l.sub(l.splat(0.0), error);
        let inside = l.le(negative, least) | l.le(most, error);

        let (az, bz, cz) =
            (l.mul(a.z, self.shear[2]), l.mul(b.z, self.shear[2]), l.mul(c.z, self.shear[2]));
        let closest = l.sub(l.min(l.min(az, bz), cz), self.error);
        let farthest = l.add(l.max(l.max(az, bz), cz), self.error);
        TriangleLook {
            maybe: inside & l.le(closest, far) & l.le(self.near, farthest),
            inside: l.le(error, least) | l.le(most, negative),
            closest,
            farthest,
        }
    }

    /// Corners as the ray sees them.
    #[inline(always)]
    fn shear(&self, l: L, [x, y, z]: [L::F; 3]) -> ShearedPoint<L> {
        let z = l.sub(z, self.origin[2]);
        let x = l.neg_mul_add(self.shear[0], z, l.sub(x, self.origin[0]));
        let y = l.neg_mul_add(self.shear[1], z, l.sub(y, self.origin[1]));
        ShearedPoint { x, y, z }
    }
}

/// Result of single precision's test of rays and a triangle.
#[derive(Clone, Copy)]
pub(super) struct TriangleLook<L: Arithmetic> {
    /// The lanes that f64 might call a hit within the limits.
    pub(super) maybe: u32,
    /// The lanes that f64 will certainly call inside.
    pub(super) inside: u32,
    /// Hits are no closer and no farther than this.
    pub(super) closest: L::F,
    pub(super) farthest: L::F,
}

/// Corners in the frame of which the ray is the z axis, but for the scale of z.
#[derive(Clone, Copy)]
struct ShearedPoint<L: Arithmetic> {
    x: L::F,
    y: L::F,
    z: L::F,
}

/// Eight numbers from `start` on, one of a leaf's runs.
#[inline(always)]
fn run<L: Lanes>(l: L, numbers: &LeafNumbers, start: usize) -> L::F {
    match numbers.get(start..start + 8).and_then(|run| run.first_chunk()) {
        Some(run) => l.load(run),
        None => l.splat(0.0),
    }
}

/// Mask of the `n` triangles of a leaf whose boxes the rays of a box test meet before `far`.
#[inline(always)]
pub(super) fn meet_triangles<L: Lanes>(
    l: L,
    numbers: &LeafNumbers,
    n: usize,
    test: &BoxTest<L>,
    far: f32,
) -> u32 {
    let (x0, x1) = meet_slabs(l, numbers, n, test, 0);
    let (y0, y1) = meet_slabs(l, numbers, n, test, 1);
    let (z0, z1) = meet_slabs(l, numbers, n, test, 2);
    let enter = l.max(l.max(x0, y0), l.max(z0, test.near));
    let leave = l.min(l.min(x1, y1), l.min(z1, l.splat(far)));
    l.le(enter, leave) & ((1 << n) - 1)
}

#[inline(always)]
fn meet_slabs<L: Lanes>(
    l: L,
    numbers: &LeafNumbers,
    n: usize,
    test: &BoxTest<L>,
    axis: usize,
) -> (L::F, L::F) {
    let a = run(l, numbers, axis * n);
    let b = run(l, numbers, (3 + axis) * n);
    let c = run(l, numbers, (6 + axis) * n);
    let (lower, upper) = (l.min(l.min(a, b), c), l.max(l.max(a, b), c));
    let (near, far) = if test.backwards[axis] == 0 { (lower, upper) } else { (upper, lower) };
    (
        l.mul_sub(near, test.inverse_near[axis], test.near_offset[axis]),
        l.mul_sub(far, test.inverse_far[axis], test.far_offset[axis]),
    )
}

/// The coordinates of a leaf's triangles: a run for each corner and axis, along a test's axes.
pub(super) struct LeafCorners<'a> {
    corners: [[&'a [f32]; 3]; 3],
}

impl<'a> LeafCorners<'a> {
    #[inline(always)]
    pub(super) fn new(numbers: &'a LeafNumbers, n: usize, axes: [usize; 3]) -> Option<Self> {
        let [x, y, z] = [axes[0] * n, axes[1] * n, axes[2] * n];
        let run = |start: usize| numbers.get(start..start + n);
        let corner = |start: usize| Some([run(start + x)?, run(start + y)?, run(start + z)?]);
        Some(Self { corners: [corner(0)?, corner(3 * n)?, corner(6 * n)?] })
    }
}

/// Twice the signed area of the origin and an edge from `p` to `q`.
#[inline(always)]
fn edge<L: Arithmetic>(l: L, p: ShearedPoint<L>, q: ShearedPoint<L>) -> L::F {
    l.mul_sub(p.x, q.y, l.mul(p.y, q.x))
}

#[inline(always)]
fn size<L: Arithmetic>(l: L, p: ShearedPoint<L>) -> L::F {
    l.add(l.abs(p.x), l.abs(p.y))
}
