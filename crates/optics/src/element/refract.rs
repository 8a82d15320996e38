//! Intersection with a plane, a sphere or a conic, and refraction there: the inner loop of the camera kit.
//!
//! # Intersection
//!
//! In the surface's frame the conic is c (x² + y² + (1 + k) z²) − 2z = 0. The ray is first moved to
//! the foot of the perpendicular from the vertex, so that an object at infinity costs no digits.
//! With p + t d put in, A t² + 2B t + C = 0; then q = −(B + sign(B) √D), the root that the vertex'
//! sheet has for ordinary rays is C/q, and the other one is q/A (W. H. Press et al., *Numerical
//! Recipes*, eq. 5.6.4, is the stable quadratic). A root counts when t > 0 and 1 − (1 + k) c z ≥ 0:
//! the sheet that the sag formula describes. The nearest one is taken; where the other root might be
//! nearer and on the sheet, which takes a ray that cuts the rim of a cap, both are worked out.
//!
//! # Refraction
//!
//! Snell's law in vector form (G. H. Spencer and M. V. R. K. Murty, *J. Opt. Soc. Am.* 52, 672
//! (1962)) with an unnormalised normal m: d' = μ d + σ (√(|m|² (1 − μ²) + μ² (d·m)²) − μ |d·m|) m/|m|²,
//! where σ is the sign of d·m. |d·m| is √D, and |m|² is 1 − k c² r² on a conic, 1 on a sphere; where
//! roundings of the place make that untrue, as on conics of −10⁶ or spheres of a nanometre, the
//! direction is made a unit vector again. Equal indices leave every direction as it is, to the last
//! bit.

use super::rays::{Block, LANES, PENDING, Ray, RayStatus};
use super::real::Real;
use super::surface::Surface;

/// Steps that end this little before the last element (mm) still count, so that elements may touch.
pub(crate) const TOUCH: f64 = 1e-9;

/// The media on both sides of a surface at one wavelength, met from one side.
#[derive(Debug, Clone, Copy)]
pub(crate) struct IndexPair {
    /// The index before over the index behind, in the direction of travel.
    ratio: f64,
    /// 1 − μ².
    rest: f64,
}

/// Outcome of a ray at a surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RefractedRay<T = f64> {
    /// Ray that goes on from the point where it meets the surface.
    pub(crate) ray: Ray<T>,
    /// Distance travelled (mm).
    pub(crate) t: T,
    /// It meets the surface.
    pub(crate) hit: bool,
    /// Inside the clear aperture.
    pub(crate) clear: bool,
    /// Light goes on.
    pub(crate) through: bool,
}

/// Choice between the two roots of the quadratic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Root {
    /// C/q.
    Near,
    /// q/A.
    Far,
}

impl IndexPair {
    /// From a medium of index `before` into one of index `behind`.
    pub(crate) fn new(before: f64, behind: f64) -> Self {
        let ratio = before / behind;
        Self { ratio, rest: (1.0 - ratio) * (1.0 + ratio) }
    }

    /// Of a mirror: the kernels then give minus the direction that is reflected.
    pub(crate) const MIRROR: Self = Self { ratio: -1.0, rest: 0.0 };

    /// Refracts at `ray`'s position, where the normal is `m` with |m|² = `length2`, d·m has the
    /// sign of `sign`, and (d·m)² = `along2` with the root `along`.
    #[inline(always)]
    pub(crate) fn refract<T: Real>(
        &self,
        ray: Ray<T>,
        m: [T; 3],
        length2: T,
        along2: T,
        along: T,
    ) -> (Ray<T>, bool) {
        let behind2 = length2.times(self.rest) + along2.times(self.ratio * self.ratio);
        let g = (behind2.root().signed_as(along) - along.times(self.ratio)) / length2;
        let direction = [
            ray.direction[0].times(self.ratio) + g * m[0],
            ray.direction[1].times(self.ratio) + g * m[1],
            ray.direction[2].times(self.ratio) + g * m[2],
        ];
        (Ray { direction, ..ray }, (0.0..f64::INFINITY).contains(&behind2.value()))
    }
}

impl IndexPair {
    /// As [`Self::refract`] at a surface whose phase adds `kick` to the direction in its tangent plane. What is
    /// evanescent does not go on.
    pub(crate) fn diffract<T: Real>(
        &self,
        ray: Ray<T>,
        m: [T; 3],
        length2: T,
        along: T,
        kick: [T; 3],
    ) -> (Ray<T>, bool) {
        let dot = |a: [T; 3], b: [T; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (across, of_kick) = (along / length2, dot(kick, m) / length2);
        let tangent: [T; 3] = std::array::from_fn(|i| {
            (ray.direction[i] - across * m[i]).times(self.ratio) + kick[i] - of_kick * m[i]
        });
        let behind2 = T::constant(1.0) - dot(tangent, tangent);
        let rise = (behind2 / length2).root().signed_as(along);
        let direction = std::array::from_fn(|i| tangent[i] + rise * m[i]);
        (Ray { direction, ..ray }, (0.0..f64::INFINITY).contains(&behind2.value()))
    }
}

/// True if a place at distance `t` along the ray (mm) is ahead of it; a root that is no number is
/// not.
#[inline(always)]
pub(super) fn is_ahead<T: Real>(t: T) -> bool {
    (t.value() > -TOUCH) & (t.value() < f64::INFINITY)
}

/// True if a ray's place is within a clear aperture, by the square of its radius (mm²).
#[inline(always)]
pub(super) fn is_within<T: Real>(there: Ray<T>, clip2: f64) -> bool {
    let [x, y, _] = there.position;
    (x * x + y * y).value() <= clip2
}

/// Intersection of a ray with a conic.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Intersection<T = f64> {
    /// The ray, moved there.
    pub(crate) ray: Ray<T>,
    /// Distance from where it was.
    pub(crate) t: T,
    /// (d·m)²; negative when the ray misses.
    pub(crate) along2: T,
    /// d·m.
    pub(crate) along: T,
}

/// The quadratic of a ray and a conic, from the foot of the perpendicular on.
struct Quadratic<T> {
    moved: Ray<T>,
    foot: T,
    a: T,
    d: T,
    along2: T,
    along: T,
    q: T,
}

#[inline(always)]
fn quadratic<const SPHERE: bool, T: Real>(s: &Surface, ray: Ray<T>) -> Quadratic<T> {
    let Ray { position: [x, y, z], direction: [u, v, w] } = ray;
    let (c, k) = (s.curvature, s.conic);
    let foot = -(x * u + y * v + z * w);
    let moved = ray.advanced(foot);
    let [x, y, z] = moved.position;
    let stretch = if SPHERE { 1.0 } else { 1.0 + k };
    let a = if SPHERE { T::constant(c) } else { (w * w).times(k).plus(1.0).times(c) };
    let b = (x * u + y * v + (z * w).times(stretch)).times(c) - w;
    let d = (x * x + y * y + (z * z).times(stretch)).times(c) - z.times(2.0);
    let along2 = b * b - a * d;
    let along = along2.root().signed_as(b);
    Quadratic { moved, foot, a, d, along2, along, q: -(b + along) }
}

#[inline(always)]
pub(crate) fn meet_conic<const SPHERE: bool, T: Real>(
    s: &Surface,
    ray: Ray<T>,
    which: Root,
) -> Intersection<T> {
    let Quadratic { moved, foot, a, d, along2, along, q } = quadratic::<SPHERE, T>(s, ray);
    // m is minus half the gradient of the conic, hence the signs.
    let (t, along) = match which {
        Root::Near => (d / q, -along),
        Root::Far => (q / a, along),
    };
    Intersection { ray: moved.advanced(t), t: foot + t, along2, along }
}

/// True if the far root comes after the near one, or lies on the other sheet; without a division.
#[inline(always)]
pub(super) fn rival_is_elsewhere<const SPHERE: bool, T: Real>(s: &Surface, ray: Ray<T>) -> bool {
    let Quadratic { moved, a, q, .. } = quadratic::<SPHERE, T>(s, ray);
    let (a, q, z) = (a.value(), q.value(), moved.position[2].value());
    let (c, k, w) = (s.curvature, s.conic, ray.direction[2].value());
    // 1 − (1 + k) c (z + q/a · w), times the square of a/c = 1 + k w².
    let (stretch, e) = if SPHERE { (1.0, 1.0) } else { (1.0 + k, 1.0 + k * (w * w)) };
    let sheet = e * (e * (1.0 - stretch * c * z) - stretch * (q * w));
    (a * q >= 0.0) | (sheet < 0.0)
}

/// Runs `cross` on every living ray of a block; rays that it does not let through are left as
/// they were and marked for the exact path. Says whether there are any.
#[inline(always)]
pub(crate) fn each_lane(
    block: &mut Block,
    element: usize,
    z: f64,
    cross: impl Fn(Ray) -> RefractedRay,
) -> bool {
    each_numbered_lane(
        block,
        element,
        z,
        #[inline(always)]
        |_, ray| cross(ray),
    )
}

/// As [`each_lane`], for what also wants to know the ray's place in the block.
#[inline(always)]
pub(crate) fn each_numbered_lane(
    block: &mut Block,
    element: usize,
    z: f64,
    cross: impl Fn(usize, Ray) -> RefractedRay,
) -> bool {
    let vignetted = RayStatus::Vignetted { element }.code();
    let mut pending = 0;
    for lane in 0..LANES {
        let old = block.ray(lane);
        let [x, y, depth] = old.position;
        let mut new = cross(lane, Ray { position: [x, y, depth - z], ..old });
        new.ray.position[2] += z;
        let outcome = block.outcome[lane];
        let alive = outcome == 0;
        let moved = alive & new.hit & (!new.clear | new.through);
        let passed = moved & new.clear;
        let position = if moved { new.ray.position } else { old.position };
        let direction = if passed { new.ray.direction } else { old.direction };
        block.set_ray(lane, Ray { position, direction });
        let ended = if new.hit & !new.clear { vignetted } else { PENDING };
        let outcome = if alive & !passed { ended } else { outcome };
        block.outcome[lane] = outcome;
        pending |= u64::from(outcome == PENDING);
    }
    pending != 0
}
