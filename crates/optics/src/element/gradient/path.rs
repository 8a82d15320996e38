//! A ray's way through a gradient.
//!
//! With dt = ds/n, s the length along the ray, the equation of rays is R'' = ½∇n², and T = R' = n dR/ds is the optical
//! direction. Runge and Kutta's rule for equations without R' takes three looks at ½∇n² a step: A = h D(R),
//! B = h D(R + h T/2 + h A/8), C = h D(R + h T + h B/2), R → R + h (T + (A + 2B)/6), T → T + (A + 4B + C)/6
//! (A. Sharma, D. V. Kumar and A. K. Ghatak, *Applied Optics* 21, 984 (1982)). The optical path is ∫n² dt, by Simpson's
//! rule at the same three places.
//!
//! In the parabolic rod R'' = −n₀²g² (x, y, 0), so that x and y swing and z goes on evenly: x = x₀ cos ωt + (Tₓ/ω) sin ωt
//! with ω = n₀g. That is worked out in closed form, the optical path too.

use glam::DVec3;

use super::{Gradient, IndexField, Law};

/// Distance (mm) to which a ray is brought to a surface.
const ARRIVED: f64 = 1e-13;

/// Distance (mm) within which a ray counts as on the surface already.
const THERE: f64 = 1e-12;

/// A ray in a gradient's own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OpticalRay {
    /// Position (mm).
    pub(crate) place: DVec3,
    /// n times its unit direction.
    pub(crate) optical: DVec3,
    /// The optical path up to here (mm).
    pub(crate) path: f64,
    /// The length of its way up to here (mm).
    pub(crate) length: f64,
}

/// Outcome of a ray in a gradient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Arrival {
    /// It is on the surface.
    On(OpticalRay),
    /// It left the side of the medium, here.
    Side(DVec3),
    /// It never comes to the surface.
    Lost,
}

impl Gradient {
    /// The ray farther on by `h` (mm) of t = ∫ds/n.
    #[inline]
    pub(super) fn advanced(&self, base: f64, ray: OpticalRay, h: f64) -> OpticalRay {
        match &self.law {
            Law::Rod { g } => swing(base, *g, ray, h),
            Law::Sum { .. } => self.step(base, ray, h),
        }
    }

    fn step(&self, base: f64, ray: OpticalRay, h: f64) -> OpticalRay {
        let (r, t) = (ray.place, ray.optical);
        let look = |place: DVec3| {
            let IndexField { square, across, along } = self.field(base, place.to_array());
            (h * DVec3::new(across * place.x, across * place.y, along), square)
        };
        let (a, first) = look(r);
        let (b, middle) = look(r + h * (0.5 * t + 0.125 * a));
        let (c, last) = look(r + h * (t + 0.5 * b));
        let root = |square: f64| square.max(0.0).sqrt();
        OpticalRay {
            place: r + h * (t + (a + 2.0 * b) / 6.0),
            optical: t + (a + 4.0 * b + c) / 6.0,
            path: ray.path + h / 6.0 * (first + 4.0 * middle + last),
            length: ray.length + h / 6.0 * (root(first) + 4.0 * root(middle) + root(last)),
        }
    }

    /// Takes a ray on to where `height` (mm above a surface along the axis, `None` where that does not exist) is 0; back to
    /// it where the ray has passed it. `clipped` is whether the side of the medium stops it, `reach` how far (mm) it may
    /// have to go.
    pub(crate) fn to_surface(
        &self,
        base: f64,
        start: OpticalRay,
        height: impl Fn(DVec3) -> Option<f64>,
        clipped: bool,
        reach: f64,
    ) -> Arrival {
        let of = |ray: &OpticalRay| height(ray.place).unwrap_or(f64::NAN);
        let mut here = start;
        let mut above = of(&here);
        if above.abs() <= THERE {
            return Arrival::On(start);
        }
        let onwards = start.optical.z.signum();
        let backwards = above * onwards > 0.0;
        let h = self.step / base * if backwards { -1.0 } else { 1.0 };
        let side2 = if clipped { self.semi_diameter * self.semi_diameter } else { f64::INFINITY };
        // Where the surface that it came through is wider than the medium.
        if !backwards && start.place.truncate().length_squared() > side2 {
            return Arrival::Side(start.place);
        }
        // A ray that runs steeply takes more steps than the gap is long.
        let most = 20.0 * (reach + self.semi_diameter) / self.step + 100.0;
        let mut taken = 0.0;
        while taken < most {
            let next = self.advanced(base, here, h);
            let there = of(&next);
            if next.optical.z * onwards <= 0.0 || !next.place.is_finite() {
                return Arrival::Lost;
            }
            if self.field(base, next.place.to_array()).square <= 0.0 {
                return Arrival::Lost;
            }
            if above * there <= 0.0 {
                let end = self.between(base, here, [above, there], h, &of);
                let beyond = end.place.truncate().length_squared() > side2;
                return if beyond { Arrival::Side(end.place) } else { Arrival::On(end) };
            }
            if let Some(place) = self.leaves(base, here, next, h, side2) {
                return Arrival::Side(place);
            }
            (here, above) = (next, there);
            taken += 1.0;
        }
        Arrival::Lost
    }

    /// Point at which a step leaves the side of the medium, whose squared radius is `side2` (mm²):
    /// at its end, or where the ray is farthest from the axis on the way.
    fn leaves(
        &self,
        base: f64,
        here: OpticalRay,
        next: OpticalRay,
        h: f64,
        side2: f64,
    ) -> Option<DVec3> {
        let beyond = |ray: &OpticalRay| ray.place.truncate().length_squared() > side2;
        if beyond(&next) {
            return Some(next.place);
        }
        let outwards = |ray: &OpticalRay| h * ray.place.truncate().dot(ray.optical.truncate());
        let (before, after) = (outwards(&here), outwards(&next));
        if side2.is_infinite() || !(before > 0.0 && after < 0.0) {
            return None;
        }
        // By the secant, and once more from there: the second is off by the cube of what the first is.
        let at = h * before / (before - after);
        let near = self.advanced(base, here, at);
        let slope = outwards(&near);
        let further = match slope > 0.0 {
            true => at + (h - at) * slope / (slope - after),
            false => at * before / (before - slope),
        };
        let farthest = self.advanced(base, here, further);
        beyond(&farthest).then_some(farthest.place)
    }

    /// The ray where it is on the surface, between its place and one a step of `h` farther on, at these heights (mm): by
    /// the regula falsi with halved ordinates (M. Dowell and P. Jarratt, *BIT* 11, 168 (1971)).
    fn between(
        &self,
        base: f64,
        here: OpticalRay,
        [above, there]: [f64; 2],
        h: f64,
        of: &impl Fn(&OpticalRay) -> f64,
    ) -> OpticalRay {
        let (mut low, mut high) = ((0.0, above), (h, there));
        let mut best = self.advanced(base, here, h);
        for _ in 0..60 {
            let share = high.0 - high.1 * (high.0 - low.0) / (high.1 - low.1);
            let at = if share.is_finite() { share } else { 0.5 * (low.0 + high.0) };
            best = self.advanced(base, here, at);
            let height = of(&best);
            if height.abs() <= ARRIVED || height.is_nan() {
                break;
            }
            if height * high.1 < 0.0 {
                low = high;
            } else {
                low.1 *= 0.5;
            }
            high = (at, height);
        }
        best
    }
}

/// A ray of the parabolic rod farther on by `t`.
fn swing(base: f64, g: f64, ray: OpticalRay, t: f64) -> OpticalRay {
    let omega = base * g;
    let (sine, cosine) = (omega * t).sin_cos();
    let (from, slope) = (ray.place.truncate(), ray.optical.truncate() / omega);
    let at = |sine: f64, cosine: f64| from * cosine + slope * sine;
    let (place, optical) = (at(sine, cosine), (slope * cosine - from * sine) * omega);
    // ∫ r² dt of the swing.
    let double = 0.5 * sine * cosine / omega;
    let squares = from.length_squared() * (0.5 * t + double)
        + slope.length_squared() * (0.5 * t - double)
        + from.dot(slope) * sine * sine / omega;
    let n2 = base * base;
    let (half_sine, half_cosine) = (0.5 * omega * t).sin_cos();
    let index = |square: f64| (n2 * (1.0 - g * g * square)).max(0.0).sqrt();
    let middle = index(at(half_sine, half_cosine).length_squared());
    let ends = index(from.length_squared()) + index(place.length_squared());
    OpticalRay {
        place: place.extend(ray.place.z + t * ray.optical.z),
        optical: optical.extend(ray.optical.z),
        path: ray.path + n2 * (t - g * g * squares),
        length: ray.length + t / 6.0 * (ends + 4.0 * middle),
    }
}
