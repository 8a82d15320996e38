//! Rays that cross an asphere or a biconic more than once.
//!
//! Where a surface is neither convex nor concave, a ray may cross it from front to back, come out again, and
//! cross it a second time from front to back. Newton's method may arrive at either; light is refracted at the
//! first within the clear aperture, and for a surface without one at the first near the vertex: within its domain
//! and four times the ray's distance from the vertex beyond twice its radius of curvature, where roots are
//! searched for, too.
//!
//! Along a unit direction of cosine w to the axis, z − sag changes at w − ∇sag·(u, v) a millimetre. So where
//! w² > S² (1 − w²), with S the steepest slope as far from the axis as the ray gets on its way to a root, that
//! never changes its sign on the way, and the root is the first. Only for what is steeper are parts of the ray
//! bounded and halved until each is known to cross once or not at all (interval bisection: R. E. Moore, *Methods
//! and Applications of Interval Analysis*, 1979, chapter 5).

use super::biconic::Biconic;
use super::newton::{
    Newton, Profile, cross_by_newton, cross_by_search, interval, keeps_off, root_between,
    search_radius,
};
use super::rays::{Block, LANES, PENDING, Ray};
use super::refract::{IndexPair, RefractedRay, TOUCH, each_numbered_lane};
use super::surface::Surface;

/// Rings about the axis whose slopes are bounded one by one.
const RINGS: u32 = 64;

/// Number of times that a part of a ray is halved. After so many halves no part of a lens is longer
/// than a micrometre.
const HALVINGS: u32 = 20;

/// Slopes of a surface by the distance from its axis, as bounds on the rays that cross it only
/// once.
#[derive(Debug, Clone, Default)]
pub(crate) struct Slopes {
    /// Up to each of some distances from the axis, the squared cosine from which on no ray crosses twice from
    /// front to back; at last up to the end of the clear aperture, or more than any where there is none. Empty
    /// for a convex or concave surface, which no ray does.
    least: Vec<f64>,
    /// Rings in a square millimetre.
    density: f64,
}

/// A surface between two media, met from one side, and the bounds of its slopes.
#[derive(Debug)]
pub(super) struct ProfileBoundary<'a, P> {
    pub(super) surface: &'a P,
    pub(super) media: IndexPair,
    pub(super) slopes: &'a Slopes,
}

impl Slopes {
    pub(super) fn of_surface(surface: &Surface) -> Self {
        let terms = || surface.aspheric.iter().chain([&surface.curvature]);
        if terms().all(|&a| a >= 0.0) || terms().all(|&a| a <= 0.0) {
            return Self::default();
        }
        let slope = |squares: [f64; 2]| {
            let [low, high] = surface.slope_bounds(squares);
            squares[1].sqrt() * low.abs().max(high.abs())
        };
        let slopes = Self::by_rings(surface, slope);
        if surface.semi_diameter.is_infinite() {
            return slopes;
        }
        let (mut convex, mut concave) = (true, true);
        for ring in 0..RINGS {
            let squares = [ring, ring + 1].map(|i| f64::from(i) / slopes.density);
            let [low, high] = surface.bend_bounds(squares);
            convex &= low >= 0.0;
            concave &= high <= 0.0;
        }
        if convex || concave { Self::default() } else { slopes }
    }

    pub(super) fn of_biconic(biconic: &Biconic) -> Self {
        Self::by_rings(biconic, |squares| biconic.steepest(squares[1]))
    }

    /// Bounds of a surface by its greatest `slope` between two squared distances from the axis (mm²).
    fn by_rings(surface: &impl Profile, slope: impl Fn([f64; 2]) -> f64) -> Self {
        let [end, own] = surface.extent();
        let clear = surface.clear_radius();
        let radius = if clear.is_finite() { clear.min(end) } else { own.min(end) };
        let density = f64::from(RINGS) / (radius * radius);
        let mut steepest = 0.0_f64;
        let ring = |i: u32| {
            steepest = steepest.max(slope([i, i + 1].map(|i| f64::from(i) / density)));
            // Of a slope without bound, all rays.
            let square = steepest.min(1e100).powi(2);
            square / (1.0 + square)
        };
        let mut least: Vec<f64> = (0..RINGS).map(ring).collect();
        least.push(if clear.is_finite() { least[RINGS as usize - 1] } else { f64::INFINITY });
        Self { least, density }
    }

    /// True if no ray crosses the surface twice from front to back.
    #[inline(always)]
    pub(super) fn are_convex(&self) -> bool {
        self.least.is_empty()
    }

    /// True if the slopes between a ray's start and a root forbid another crossing before it, or
    /// one within the clear aperture where the root is outside of that.
    #[inline]
    pub(super) fn forbid_another(&self, start: Ray, root: Ray) -> bool {
        let square = |ray: Ray| ray.position[0].powi(2) + ray.position[1].powi(2);
        let rings = square(start).max(square(root)) * self.density;
        let last = self.least.len().saturating_sub(1);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it saturates")]
        let ring = (rings as usize).min(last);
        self.least.get(ring).is_none_or(|least| start.direction[2].powi(2) >= *least)
    }

    /// True if no ray of this direction crosses the surface twice.
    fn forbid_two(&self, ray: Ray) -> bool {
        self.least.last().is_none_or(|least| ray.direction[2].powi(2) >= *least)
    }
}

/// A ray in the surface's frame, at the first place within the clear aperture where it crosses from front to
/// back; where there is none, as Newton's method and its search have it.
pub(super) fn cross_first<P: Profile>(
    boundary: &ProfileBoundary<'_, P>,
    ray: Ray,
    clip2: f64,
) -> RefractedRay {
    let newton = cross_by_newton(boundary.surface, boundary.media, ray, clip2);
    cross_first_after(boundary, ray, clip2, newton)
}

/// Crosses the surface where Newton's method has found `newton`.
pub(super) fn cross_first_after<P: Profile>(
    boundary: &ProfileBoundary<'_, P>,
    ray: Ray,
    clip2: f64,
    newton: RefractedRay,
) -> RefractedRay {
    let &ProfileBoundary { surface, media, slopes } = boundary;
    if newton.hit && slopes.forbid_another(ray, newton.ray) {
        return newton;
    }
    let otherwise =
        || if newton.hit { newton } else { cross_by_search(surface, media, ray, clip2) };
    if slopes.forbid_two(ray) {
        return otherwise();
    }
    // Measured from the foot of the perpendicular from the vertex, so that a far start costs no digits.
    let Ray { position: [x, y, z], direction: [u, v, w] } = ray;
    let foot = -(x * u + y * v + z * w);
    let moved = ray.advanced(foot);
    let Some(whole @ [from, to]) = part_near(surface, moved, -foot - TOUCH) else {
        return otherwise();
    };
    let travel: f64 =
        (0..3).map(|i| (newton.ray.position[i] - moved.position[i]) * ray.direction[i]).sum();
    // On most ways the surface is approached all along, so that the root is the first.
    if newton.hit && travel >= from && travel <= to {
        let [least, most] = surface.along_bounds(moved, [from, travel]).map(|bound| bound * w);
        if least.min(most) > 0.0 {
            return newton;
        }
    }
    let Some(first) = first_within(surface, moved, whole, HALVINGS) else {
        return otherwise();
    };
    if newton.hit && (first.part[0] - TOUCH..=first.part[1] + TOUCH).contains(&travel) {
        return newton;
    }
    let root = moved.advanced(first.root);
    let [x, y, _] = root.position;
    let (ray, through) = surface.refract(media, root, surface.sag_and_slope(root).1);
    RefractedRay { ray, t: 0.0, hit: true, clear: x * x + y * y <= clip2, through }
}

/// Distance of a ray's place behind a surface (mm), along the axis.
fn behind<P: Profile>(surface: &P, ray: Ray, t: f64) -> f64 {
    let at = ray.advanced(t);
    at.position[2] - surface.sag_and_slope(at).0
}

/// The part of a ray, from `start` on, that is within the clear aperture and at the depths of the surface there.
fn part_near<P: Profile>(surface: &P, ray: Ray, start: f64) -> Option<[f64; 2]> {
    let Ray { position: [x, y, z], direction: [u, v, w] } = ray;
    let clear = surface.clear_radius();
    let reach = if clear.is_finite() {
        clear.min(surface.extent()[0])
    } else {
        search_radius(surface, ray, clear)
    };
    let across = interval(u * u + v * v, x * u + y * v, x * x + y * y - reach * reach)?;
    let depths = surface.sag_range(reach).map(|sag| (sag - z) / w);
    let from = across[0].max(start).max(depths[0].min(depths[1]));
    let to = across[1].min(depths[0].max(depths[1]));
    // Neither holds of what is no number.
    (from < to && to - from < f64::INFINITY).then_some([from, to])
}

/// Crossing of a ray with a surface from front to back.
struct SurfaceCrossing {
    /// A part of the ray in which it crosses nowhere else.
    part: [f64; 2],
    root: f64,
}

/// The first crossing from front to back within a part of a ray.
fn first_within<P: Profile>(
    surface: &P,
    ray: Ray,
    part @ [from, to]: [f64; 2],
    halvings: u32,
) -> Option<SurfaceCrossing> {
    if keeps_off(surface, ray, part) {
        return None;
    }
    let sense = ray.direction[2].signum();
    let [least, most] = surface.along_bounds(ray, part).map(|bound| bound * sense);
    if least.max(most) < 0.0 {
        return None;
    }
    if least.min(most) > 0.0 || halvings == 0 {
        let [before, after] = part.map(|t| sense * behind(surface, ray, t));
        if !(before <= 0.0 && after > 0.0) {
            return None;
        }
        let root = root_between(part, |t| behind(surface, ray, t));
        let [x, y, _] = ray.advanced(root).position;
        return surface.exists([x, y]).then_some(SurfaceCrossing { part, root });
    }
    let middle = 0.5 * (from + to);
    first_within(surface, ray, [from, middle], halvings - 1)
        .or_else(|| first_within(surface, ray, [middle, to], halvings - 1))
}

/// Takes a block through a surface at `z` (mm), as [`super::refract::each_lane`] does for conics. Rays that the
/// method does not bring to it, and those that may cross elsewhere first by their slopes, are left to `decide`, one by
/// one with what the method has found.
#[inline(always)]
pub(super) fn cross_block<P: Profile>(
    boundary: &ProfileBoundary<'_, P>,
    block: &mut Block,
    element: usize,
    z: f64,
    clip2: f64,
    decide: impl Fn(&mut Block, usize, RefractedRay),
) {
    let &ProfileBoundary { surface, media, slopes } = boundary;
    let newton = Newton::<LANES, P>::run(
        surface,
        #[inline(always)]
        |lane| {
            let mut ray = block.ray(lane);
            ray.position[2] -= z;
            (ray, block.outcome[lane] == 0)
        },
    );
    let mut is_first = [true; LANES];
    if !slopes.are_convex() {
        for (lane, is_first) in is_first.iter_mut().enumerate() {
            *is_first = slopes.forbid_another(block.ray(lane), newton.ray(lane));
        }
    }
    let pending = each_numbered_lane(
        block,
        element,
        z,
        #[inline(always)]
        |lane, _| {
            let found = newton.refracted(surface, media, clip2, lane);
            RefractedRay { hit: found.hit & is_first[lane], ..found }
        },
    );
    if pending {
        for lane in 0..LANES {
            if block.outcome[lane] == PENDING {
                decide(block, lane, newton.refracted(surface, media, clip2, lane));
            }
        }
    }
}
