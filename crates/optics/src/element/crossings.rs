//! Rays that cross an asphere more than once.
//!
//! Where an asphere is neither convex nor concave, a ray may cross it from front to back, come out again, and
//! cross it a second time from front to back. Newton's method may arrive at either; light is refracted at the
//! first.
//!
//! Along a unit direction of cosine w to the axis, z − sag changes at w − ∇sag·(u, v) a millimetre, and ∇sag is
//! S at most within the clear aperture. So where w² > S² (1 − w²) that never changes its sign, and a ray crosses
//! once. Only for what is steeper are parts of the ray bounded and halved until each is known to cross once or
//! not at all (interval bisection: R. E. Moore, *Methods and Applications of Interval Analysis*, 1979, chapter 5).

use super::newton::{Profile, cross, interval, keeps_off, root_between, squares_along};
use super::rays::Ray;
use super::refract::{Refracted, Refraction, TOUCH};
use super::surface::Surface;

/// Rings of the clear aperture whose slopes are bounded one by one.
const RINGS: u32 = 64;

/// How often a part of a ray is halved. After so many halves no part of a lens is longer than a micrometre.
const HALVINGS: u32 = 20;

/// The squared cosine to the axis from which on no ray crosses a surface twice from front to back within its clear
/// aperture: 0 for a convex or concave one. Without a clear aperture no crossing is within it, and this is 0,
/// too.
pub(super) fn least_single(surface: &Surface) -> f64 {
    let radius = surface.semi_diameter.min(surface.domain());
    if surface.aspheric.is_empty() || !surface.semi_diameter.is_finite() {
        return 0.0;
    }
    let (mut convex, mut concave) = (true, true);
    let mut steepest = 0.0_f64;
    for ring in 0..RINGS {
        let [near, far] = [ring, ring + 1].map(|i| radius * f64::from(i) / f64::from(RINGS));
        let squares = [near * near, far * far];
        let [low, high] = surface.bend_bounds(squares);
        convex &= low >= 0.0;
        concave &= high <= 0.0;
        let [low, high] = surface.slope_bounds(squares);
        steepest = steepest.max(far * low.abs().max(high.abs()));
    }
    // Of a slope without bound, all rays.
    let square = steepest.min(1e100).powi(2);
    if convex || concave { 0.0 } else { square / (1.0 + square) }
}

impl Refraction {
    /// A ray in an asphere's frame, at the first place within the clear aperture where it crosses from front to
    /// back; where there is none, as Newton's method and its search have it.
    pub(crate) fn at_asphere(&self, ray: Ray, clip2: f64) -> Refracted {
        let newton = cross(&self.surface, self.media, ray, clip2);
        if self.crosses_once(ray) {
            return newton;
        }
        // Measured from the foot of the perpendicular from the vertex, so that a far start costs no digits.
        let Ray { position: [x, y, z], direction: [u, v, w] } = ray;
        let foot = -(x * u + y * v + z * w);
        let moved = ray.advanced(foot);
        let Some([low, high]) = first_crossing(&self.surface, moved, -foot - TOUCH) else {
            return newton;
        };
        let travel: f64 =
            (0..3).map(|i| (newton.ray.position[i] - moved.position[i]) * ray.direction[i]).sum();
        if newton.hit && (low - TOUCH..=high + TOUCH).contains(&travel) {
            return newton;
        }
        let root = moved.advanced(root_between([low, high], |t| behind(&self.surface, moved, t)));
        let [x, y, _] = root.position;
        let slope = self.surface.sag_and_slope(root).1;
        let (ray, through) = Profile::refract(&self.surface, self.media, root, slope);
        Refracted { ray, t: 0.0, hit: true, clear: x * x + y * y <= clip2, through }
    }

    /// Whether the ray is too flat for an asphere's slopes to cross it twice from front to back.
    #[inline(always)]
    pub(super) fn crosses_once(&self, ray: Ray) -> bool {
        ray.direction[2] * ray.direction[2] >= self.least_single
    }
}

/// How far a ray's place is behind a surface (mm).
fn behind(surface: &Surface, ray: Ray, t: f64) -> f64 {
    let at = ray.advanced(t);
    at.position[2] - surface.sag_and_slope(at).0
}

/// The part of a ray, from `start` on, in which it crosses for the first time from front to back within the clear
/// aperture, and nowhere the other way.
fn first_crossing(surface: &Surface, ray: Ray, start: f64) -> Option<[f64; 2]> {
    let Ray { position: [x, y, z], direction: [u, v, w] } = ray;
    let square = surface.semi_diameter.min(surface.domain()).powi(2);
    let [from, to] = interval(u * u + v * v, x * u + y * v, x * x + y * y - square)?;
    let depths = surface.sag_bounds([0.0, square]).map(|sag| (sag - z) / w);
    let from = from.max(start).max(depths[0].min(depths[1]));
    let to = to.min(depths[0].max(depths[1]));
    // Neither holds of what is no number.
    (from < to && to - from < f64::INFINITY)
        .then(|| first_within(surface, ray, [from, to], HALVINGS))?
}

fn first_within(
    surface: &Surface,
    ray: Ray,
    part @ [from, to]: [f64; 2],
    halvings: u32,
) -> Option<[f64; 2]> {
    if keeps_off(surface, ray, part) {
        return None;
    }
    let sense = ray.direction[2].signum();
    let [least, most] = approach(surface, ray, part).map(|bound| bound * sense);
    if least.max(most) < 0.0 {
        return None;
    }
    if least.min(most) > 0.0 || halvings == 0 {
        let [before, after] = part.map(|t| sense * behind(surface, ray, t));
        return (before <= 0.0 && after > 0.0).then_some(part);
    }
    let middle = 0.5 * (from + to);
    first_within(surface, ray, [from, middle], halvings - 1)
        .or_else(|| first_within(surface, ray, [middle, to], halvings - 1))
}

/// What [`behind`] changes by at least and at most along a part of a ray: w − g (x u + y v), with g the slope
/// over the distance from the axis.
fn approach(surface: &Surface, ray: Ray, part: [f64; 2]) -> [f64; 2] {
    let Ray { position: [x, y, _], direction: [u, v, w] } = ray;
    let slopes = surface.slope_bounds(squares_along(ray, part));
    let across = part.map(|t| (x + t * u) * u + (y + t * v) * v);
    let changes = slopes.into_iter().flat_map(|slope| across.map(|across| w - slope * across));
    changes.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], c| [l.min(c), h.max(c)])
}
