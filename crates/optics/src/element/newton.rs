//! Rays at a surface z = sag(x, y) that is met in no closed form: aspheres and biconics.
//!
//! Newton's method on F(t) = z − sag(x, y) along the ray, side by side on any number of rays. It is
//! stopped once a step is under 10⁻¹⁰ mm: convergence being quadratic, the error left is that squared
//! times the surface's curvature, far under 10⁻¹⁴ mm. A root that the ray crosses from behind, or one
//! that Newton does not find, is looked for again by bisection of the part of the ray that runs near the
//! surface, from its start on.

use super::rays::{Ray, at_lane};
use super::real::Real;
use super::refract::{IndexPair, RefractedRay, TOUCH};

/// The step (mm) at which the method has arrived. Not a setting: digits double with each step, so that a coarser end
/// would save one at most.
const SETTLED: f64 = 1e-10;
const MOST_STEPS: usize = 20;

/// Number of pieces of a ray that are searched for a change of sign. Not a setting: only rays are searched that the
/// method does not bring to the surface, and fewer pieces lose crossings.
const PIECES: u32 = 256;

/// A surface in its own frame (mm), as the search for its crossing with a ray asks for it.
pub(super) trait Profile {
    /// The slope at a place, in any number.
    type Slope<T: Real>: Copy + Default;

    /// The ray at the place where the method begins, and how far that is (mm); not finite where there
    /// is no such place.
    fn begin(&self, ray: Ray) -> (Ray, f64);

    /// The sag (mm) and the slope at the ray's place. Beyond its domain the surface goes on as if at
    /// the edge, which keeps an iteration going and is refused in the end.
    fn sag_and_slope<T: Real>(&self, at: Ray<T>) -> (T, Self::Slope<T>);

    /// Sags and slopes at `N` places at once, with the same bits as one by one.
    #[inline(always)]
    fn sags_and_slopes<const N: usize>(
        &self,
        position: &[[f64; N]; 3],
    ) -> ([f64; N], [Self::Slope<f64>; N]) {
        let (mut sags, mut slopes) = ([0.0; N], [Self::Slope::<f64>::default(); N]);
        for lane in 0..N {
            let at = Ray { position: at_lane(position, lane), direction: [0.0; 3] };
            (sags[lane], slopes[lane]) = self.sag_and_slope(at);
        }
        (sags, slopes)
    }

    /// The slope at the root, where the last step began with `slope`, within [`SETTLED`] of it.
    fn slope_at(&self, root: Ray, slope: Self::Slope<f64>) -> Self::Slope<f64>;

    /// dF/dt at the ray's place.
    fn along<T: Real>(&self, at: Ray<T>, slope: Self::Slope<T>) -> T;

    /// Tests whether the surface exists at a place (mm).
    fn exists(&self, place: [f64; 2]) -> bool;

    /// The ray as it goes on from its place on the surface, and whether it does.
    fn refract<T: Real>(
        &self,
        media: IndexPair,
        at: Ray<T>,
        slope: Self::Slope<T>,
    ) -> (Ray<T>, bool);

    /// The distance from the axis beyond which none of it exists, and another of the size of its radii
    /// of curvature (mm).
    fn extent(&self) -> [f64; 2];

    /// Half the clear diameter (mm); infinite where it is not limited.
    fn clear_radius(&self) -> f64;

    /// Lower and upper bounds of the sag up to `reach` from the axis (mm).
    fn sag_range(&self, reach: f64) -> [f64; 2];

    /// Lower and upper bounds of the sag along a part of a ray (mm).
    fn sag_bounds(&self, ray: Ray, part: [f64; 2]) -> [f64; 2];

    /// Lower and upper bounds of dF/dt along a part of a ray.
    fn along_bounds(&self, ray: Ray, part: [f64; 2]) -> [f64; 2];
}

/// A ray in the surface's frame: Newton first, then the search, wherever it crosses first.
#[cfg(test)]
pub(super) fn cross<P: Profile>(
    surface: &P,
    media: IndexPair,
    ray: Ray,
    clip2: f64,
) -> RefractedRay {
    let found = cross_by_newton(surface, media, ray, clip2);
    if found.hit { found } else { cross_by_search(surface, media, ray, clip2) }
}

/// A ray in the surface's frame by Newton's method alone.
#[inline(always)]
pub(super) fn cross_by_newton<P: Profile>(
    surface: &P,
    media: IndexPair,
    ray: Ray,
    clip2: f64,
) -> RefractedRay {
    Newton::<1, P>::run(surface, |_| (ray, true)).refracted(surface, media, clip2, 0)
}

/// A ray in the surface's frame as it goes on from the place (mm) where it is known to meet the surface, in any number:
/// a last step of Newton's method has the derivatives of the place, since F is 0 there.
pub(super) fn cross_at<P: Profile, T: Real>(
    surface: &P,
    media: IndexPair,
    ray: Ray<T>,
    place: [f64; 3],
) -> Ray<T> {
    let start = ray.value();
    let travel: f64 = (0..3).map(|i| (place[i] - start.position[i]) * start.direction[i]).sum();
    let near = ray.advanced(T::constant(travel));
    let (sag, slope) = surface.sag_and_slope(near);
    let root = near.advanced((sag - near.position[2]) / surface.along(near, slope));
    surface.refract(media, root, surface.sag_and_slope(root).1).0
}

/// A ray in the surface's frame that Newton's method does not bring to it.
pub(super) fn cross_by_search<P: Profile>(
    surface: &P,
    media: IndexPair,
    ray: Ray,
    clip2: f64,
) -> RefractedRay {
    let Some(root) = search(surface, ray, clip2) else {
        return RefractedRay { ray, t: 0.0, hit: false, clear: false, through: false };
    };
    let [x, y, _] = root.position;
    let (out, through) = surface.refract(media, root, surface.sag_and_slope(root).1);
    RefractedRay { ray: out, t: 0.0, hit: true, clear: x * x + y * y <= clip2, through }
}

/// Newton's method on `N` rays side by side.
pub(super) struct Newton<const N: usize, P: Profile> {
    position: [[f64; N]; 3],
    direction: [[f64; N]; 3],
    /// Distance from the ray's start (mm).
    travel: [f64; N],
    /// The step taken last (mm).
    last: [f64; N],
    /// The slope where the last step began.
    slope: [P::Slope<f64>; N],
    /// 1 while the ray has not settled; a settled one is left alone, so that no ray's last bits
    /// depend on its neighbours.
    active: [u64; N],
}

impl<const N: usize, P: Profile> Newton<N, P> {
    /// Runs the method on rays in the surface's frame; those that come with `false` are left out.
    #[inline(always)]
    pub(super) fn run(surface: &P, rays: impl Fn(usize) -> (Ray, bool)) -> Self {
        let mut newton = Self::begin(surface, rays);
        for _ in 0..MOST_STEPS {
            if newton.step(surface) {
                break;
            }
        }
        newton
    }

    #[inline(always)]
    fn begin(surface: &P, rays: impl Fn(usize) -> (Ray, bool)) -> Self {
        let mut newton = Self {
            position: [[0.0; N]; 3],
            direction: [[0.0; N]; 3],
            travel: [0.0; N],
            last: [f64::INFINITY; N],
            slope: [P::Slope::<f64>::default(); N],
            active: [0; N],
        };
        for lane in 0..N {
            let (ray, alive) = rays(lane);
            let (begun, travel) = surface.begin(ray);
            for axis in 0..3 {
                newton.position[axis][lane] = begun.position[axis];
                newton.direction[axis][lane] = begun.direction[axis];
            }
            newton.travel[lane] = travel;
            newton.active[lane] = u64::from(alive & (travel.abs() < f64::INFINITY));
        }
        newton
    }

    /// One step of all rays; whether all have settled.
    #[inline(always)]
    fn step(&mut self, surface: &P) -> bool {
        let mut moving = 0;
        let (sags, slopes) = surface.sags_and_slopes(&self.position);
        for lane in 0..N {
            let ray = self.ray(lane);
            let (sag, slope) = (sags[lane], slopes[lane]);
            let active = self.active[lane] != 0;
            let step = (sag - ray.position[2]) / surface.along(ray, slope);
            let next = ray.advanced(step);
            for axis in 0..3 {
                let old = self.position[axis][lane];
                self.position[axis][lane] = if active { next.position[axis] } else { old };
            }
            self.travel[lane] = if active { self.travel[lane] + step } else { self.travel[lane] };
            self.last[lane] = if active { step } else { self.last[lane] };
            self.slope[lane] = if active { slope } else { self.slope[lane] };
            let settled = step.abs() <= SETTLED;
            let still = u64::from(active & !settled);
            self.active[lane] = still;
            moving |= still;
        }
        moving == 0
    }

    /// Refracts a ray at its root; no hit where [`search`] has to look again.
    #[inline(always)]
    pub(super) fn refracted(
        &self,
        surface: &P,
        media: IndexPair,
        clip2: f64,
        lane: usize,
    ) -> RefractedRay {
        let root = self.ray(lane);
        let [x, y, _] = root.position;
        let slope = surface.slope_at(root, self.slope[lane]);
        let t = self.travel[lane];
        let hit = (self.last[lane].abs() <= SETTLED)
            & (t > -TOUCH)
            & surface.exists([x, y])
            & (surface.along(root, slope) * root.direction[2] > 0.0);
        let (ray, through) = surface.refract(media, root, slope);
        RefractedRay { ray, t, hit, clear: x * x + y * y <= clip2, through }
    }

    #[inline(always)]
    pub(super) fn ray(&self, lane: usize) -> Ray {
        Ray { position: at_lane(&self.position, lane), direction: at_lane(&self.direction, lane) }
    }
}

/// The first root ahead, among changes of sign on the part of the ray that runs through the box around
/// the surface.
fn search<P: Profile>(surface: &P, ray: Ray, clip2: f64) -> Option<Ray> {
    let behind = |t: f64| {
        let at = ray.advanced(t);
        at.position[2] - surface.sag_and_slope(at).0
    };
    let range = near_surface(surface, ray, clip2)?;
    let root = ray.advanced(first_root(range, behind, |part| keeps_off(surface, ray, part))?);
    let [x, y, _] = root.position;
    surface.exists([x, y]).then_some(root)
}

/// True if the bounds of the sag show that the ray is on one side of the surface all along a part
/// of it.
pub(super) fn keeps_off<P: Profile>(surface: &P, ray: Ray, part @ [from, to]: [f64; 2]) -> bool {
    let (z, w) = (ray.position[2], ray.direction[2]);
    let [low, high] = surface.sag_bounds(ray, part);
    let depths = [z + from * w, z + to * w];
    let [near, far] = [depths[0].min(depths[1]), depths[0].max(depths[1])];
    // Far more than sums of a few dozen roundings are off.
    let margin = 1e-9 + 1e-12 * (low.abs() + high.abs() + near.abs() + far.abs());
    near - high > margin || low - far > margin
}

/// The least and the greatest squared distance from the axis along a part of a ray (mm²).
pub(super) fn squares_along(ray: Ray, [from, to]: [f64; 2]) -> [f64; 2] {
    let Ray { position: [x, y, _], direction: [u, v, _] } = ray;
    let square = |t: f64| (x + t * u).powi(2) + (y + t * v).powi(2);
    // Nearest to the axis, which it may pass between the two.
    let nearest = -(x * u + y * v) / (u * u + v * v);
    let ends = [square(from), square(to)];
    let least = if nearest > from && nearest < to { square(nearest) } else { ends[0].min(ends[1]) };
    [least, ends[0].max(ends[1])]
}

/// Ends of the part of the ray that is both near the surface's depths and no farther from the axis than the
/// surface reaches.
fn near_surface<P: Profile>(surface: &P, ray: Ray, clip2: f64) -> Option<[f64; 2]> {
    let Ray { position: [x, y, z], direction: [u, v, w] } = ray;
    let foot = ray.advanced(-(x * u + y * v + z * w));
    let clear = if clip2.is_finite() { 2.0 * clip2.sqrt() } else { f64::INFINITY };
    let reach = search_radius(surface, foot, clear);
    let across = interval(u * u + v * v, x * u + y * v, x * x + y * y - reach * reach)?;
    let [low, high] = surface.sag_range(reach);
    let slack = 0.1 * (high - low) + 1e-6;
    let mut range = [across[0].max(-TOUCH), across[1]];
    if w != 0.0 {
        let ends = [(low - slack - z) / w, (high + slack - z) / w];
        range = [range[0].max(ends[0].min(ends[1])), range[1].min(ends[0].max(ends[1]))];
    }
    (range[0] < range[1] && range[0].is_finite() && range[1].is_finite()).then_some(range)
}

/// Distance from the axis up to which a ray's crossing is looked for, at most `limit` (mm); `foot`
/// is where the ray is next to the vertex.
pub(super) fn search_radius<P: Profile>(surface: &P, foot: Ray, limit: f64) -> f64 {
    let height = foot.position[0].hypot(foot.position[1]);
    let [end, own] = surface.extent();
    end.min(limit).min(4.0 * height + own)
}

/// The first root of `at` from `from` to `to`, among changes of sign between [`PIECES`] places. No place is
/// looked at within parts that `has_none` knows to have no root.
fn first_root(
    [from, to]: [f64; 2],
    at: impl Fn(f64) -> f64,
    has_none: impl Fn([f64; 2]) -> bool,
) -> Option<f64> {
    let place = |i: u32| from + (to - from) * f64::from(i) / f64::from(PIECES);
    Some(root_between(first_change([0, PIECES], &place, &at, &has_none)?, at))
}

/// The root between two places of unlike sign: by false position, each end that stays for a second time at half its
/// weight (the Illinois algorithm; Dowell and Jarratt 1971), and every third step by halving.
pub(super) fn root_between([mut low, mut high]: [f64; 2], at: impl Fn(f64) -> f64) -> f64 {
    let (mut below, mut above) = (at(low), at(high));
    let before = below <= 0.0;
    let mut stayed = 0_i32;
    // Of the halvings alone 2⁻⁶⁰ of a stretch of metres would be left, less than the last bit of a millimetre.
    for step in 0..180 {
        let middle = 0.5 * (low + high);
        let secant = (low * above - high * below) / (above - below);
        let is_between = secant > low && secant < high && step % 3 != 2;
        let next = if is_between { secant } else { middle };
        if !(next > low && next < high) {
            break;
        }
        let value = at(next);
        if (value <= 0.0) == before {
            (low, below) = (next, value);
            above *= if stayed < 0 { 0.5 } else { 1.0 };
            stayed = -1;
        } else {
            (high, above) = (next, value);
            below *= if stayed > 0 { 0.5 } else { 1.0 };
            stayed = 1;
        }
    }
    0.5 * (low + high)
}

/// The first two neighbouring places of `first` to `last` between which the sign of `at` changes. Halves are
/// passed over whole, so that a ray costs a few looks however many places there are.
fn first_change(
    [first, last]: [u32; 2],
    place: &impl Fn(u32) -> f64,
    at: &impl Fn(f64) -> f64,
    has_none: &impl Fn([f64; 2]) -> bool,
) -> Option<[f64; 2]> {
    let ends = [place(first), place(last)];
    if last - first == 1 {
        return ((at(ends[0]) <= 0.0) != (at(ends[1]) <= 0.0)).then_some(ends);
    }
    if has_none(ends) {
        return None;
    }
    let middle = u32::midpoint(first, last);
    first_change([first, middle], place, at, has_none)
        .or_else(|| first_change([middle, last], place, at, has_none))
}

/// Solves a t² + 2b t + c ≤ 0 for the interval of t between its roots.
pub(super) fn interval(a: f64, b: f64, c: f64) -> Option<[f64; 2]> {
    if a <= 0.0 {
        return (c <= 0.0).then_some([f64::NEG_INFINITY, f64::INFINITY]);
    }
    let root = (b * b - a * c).sqrt();
    (root >= 0.0).then(|| [(-b - root) / a, (-b + root) / a])
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;
    use crate::element::surface::Surface;

    /// Rays at aspheres up to the highest order, from within and from far outside: a search that passes over
    /// parts finds what one finds that looks at every place, and looks at few.
    #[test]
    fn a_search_that_passes_over_parts_finds_the_same_and_looks_at_few_places() {
        let mut looks = Vec::new();
        let (mut found, mut missed) = (0, 0);
        for (order, height) in [(4, 0.5), (10, -2.0), (30, 1.0), (30, -1.0), (30, -1e-2)] {
            for second in [0.0, 3e-3] {
                let mut aspheric = vec![0.0; order / 2];
                aspheric[order / 2 - 1] = height / 8.0_f64.powi(i32::try_from(order).unwrap());
                aspheric[1] += second / 8.0_f64.powi(2);
                let surface =
                    Surface { curvature: 0.03, conic: -0.5, aspheric, semi_diameter: 10.0 };
                for i in 0..60 {
                    let x = f64::from(i) * 0.3 - 9.0;
                    for tilt in [-0.9, -0.2, 0.0, 0.4, 1.5] {
                        let ray = Ray::new([x, 0.4, 7.0].into(), [tilt, 0.1, -1.0].into()).unwrap();
                        let count = Cell::new(0);
                        let behind = |t: f64| {
                            count.set(count.get() + 1);
                            let at = ray.advanced(t);
                            at.position[2] - surface.sag_and_slope(at).0
                        };
                        let Some(range) = near_surface(&surface, ray, 100.0) else { continue };
                        let root = first_root(range, behind, |part| keeps_off(&surface, ray, part));
                        looks.push(count.get());
                        assert_eq!(root, first_root(range, behind, |_| false), "{order} {ray:?}");
                        *(if root.is_some() { &mut found } else { &mut missed }) += 1;
                    }
                }
            }
        }
        assert!(found > 500 && missed > 100, "{found} found, {missed} missed");
        // 61 halve a piece; without bounds a miss alone takes 512.
        let mean = looks.iter().sum::<u32>() as f64 / looks.len() as f64;
        assert!(mean < 90.0, "{mean} looks a ray");
    }

    #[test]
    fn bounds_hold_every_sag_between_two_places() {
        let aspheric = vec![1e-3, -2e-5, 3e-7, -4e-9, 0.0, 1e-12];
        for (curvature, conic) in [(0.03, -0.5), (-0.05, 0.0), (0.02, -3.0), (0.1, 2.0)] {
            let surface =
                Surface { curvature, conic, aspheric: aspheric.clone(), semi_diameter: 20.0 };
            for i in 0..40 {
                for j in i..40 {
                    let [from, to] = [i, j].map(|k| f64::from(k).powi(2) * 0.25);
                    let [low, high] = surface.sag_bounds_between([from, to]);
                    for k in 0..=8 {
                        let sag = surface.profile(from + (to - from) * f64::from(k) / 8.0).0;
                        // Sums of seven terms, in another order.
                        let rounding = 1e-13 * (1.0 + low.abs() + high.abs());
                        assert!(sag >= low - rounding && sag <= high + rounding, "{from} {to}");
                    }
                }
            }
        }
    }
}
