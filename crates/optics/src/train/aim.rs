//! Chief rays: rays aimed at the stop's centre through everything that aberrates on the way.
//!
//! Newton's method in two unknowns with differences for derivatives, backing off while a step does
//! not come nearer, and approached from the axis where the direct way fails, as it does for wide
//! angles.

use glam::{DVec2, DVec3};

use super::{MonochromaticTrain, OpticalTrain, Side};
use crate::element::Ray;

/// Tolerance of a chief ray's distance from the stop's centre (mm). Not a setting: digits double with each step of
/// Newton's method, so that a coarser end would save one at most.
const ON_TARGET: f64 = 1e-9;

/// A ray of the object's side that passes the stop's centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChiefRay {
    /// A point in front of the lens (mm).
    pub position: DVec3,
    /// The unit direction towards the lens.
    pub direction: DVec3,
}

impl OpticalTrain {
    /// The chief ray of a point at infinity that stands `field` degrees off the axis, downwards: its
    /// light goes up, (0, sin field, cos field). Fields beyond 90° come from behind the front.
    ///
    /// `None` when the stop's centre cannot be seen from there.
    #[must_use]
    pub fn chief_ray(&self, at: &MonochromaticTrain, field: f64) -> Option<ChiefRay> {
        // The ray is (0, 0, pupil) plus an offset square to it.
        let pupil = self.paraxial(at.wavelength()).ok()?.entrance_pupil.z.unwrap_or(0.0);
        let back = self.far_in_front(pupil);
        let launch = |angle: f64, offset: DVec2| {
            let (sine, cosine) = angle.to_radians().sin_cos();
            let direction = DVec3::new(0.0, sine, cosine);
            let across = DVec3::new(0.0, cosine, -sine);
            let through = DVec3::new(offset.x, 0.0, pupil) + across * offset.y;
            ChiefRay { position: through - direction * back, direction }
        };
        let miss = |angle: f64| {
            move |offset: DVec2| {
                let ChiefRay { position, direction } = launch(angle, offset);
                at.crossing(Side::Object, self.stop, Ray::new(position, direction)?)
                    .map(DVec2::from)
            }
        };
        let scale = self.lateral_scale();
        let direct = solve(miss(field), DVec2::ZERO, scale);
        let offset = direct.or_else(|| follow(|share| miss(share * field), DVec2::ZERO, scale))?;
        Some(launch(field, offset))
    }

    /// The unit direction of the chief ray of a point of the sensor (mm, in lens coordinates),
    /// towards the lens.
    ///
    /// `None` when the stop's centre cannot be seen from there.
    #[must_use]
    pub fn chief_direction(&self, at: &MonochromaticTrain, film: DVec3) -> Option<DVec3> {
        self.chief_direction_from(at, film, None)
    }

    /// As [`Self::chief_direction`], begun from slopes that are known to be near.
    pub(crate) fn chief_direction_from(
        &self,
        at: &MonochromaticTrain,
        film: DVec3,
        start: Option<DVec2>,
    ) -> Option<DVec3> {
        let paraxial = || match self.paraxial(at.wavelength()).ok()?.exit_pupil.z {
            Some(z) if (film.z - z).abs() > 1e-9 => Some(-film.truncate() / (film.z - z)),
            _ => Some(DVec2::ZERO),
        };
        let start = start.or_else(paraxial)?;
        let shares = |share: f64| {
            let film = DVec3::new(film.x * share, film.y * share, film.z);
            move |slopes: DVec2| self.on_stop(at, film, slopes)
        };
        let slopes =
            self.chief_slopes_near(at, film, start).or_else(|| follow(shares, DVec2::ZERO, 1.0))?;
        Some(towards_lens(slopes))
    }

    /// The slopes of the chief ray of a point of the sensor (mm), found from slopes that are near or
    /// not at all.
    pub fn chief_slopes_near(
        &self,
        at: &MonochromaticTrain,
        film: DVec3,
        start: DVec2,
    ) -> Option<DVec2> {
        solve(|slopes| self.on_stop(at, film, slopes), start, 1.0)
    }

    /// Point where a ray from the sensor crosses the stop (mm).
    fn on_stop(&self, at: &MonochromaticTrain, film: DVec3, slopes: DVec2) -> Option<DVec2> {
        let ray = Ray::new(film, towards_lens(slopes))?;
        at.crossing(Side::Sensor, self.stop, ray).map(DVec2::from)
    }

    /// A distance from `z` (mm) that is in front of every part of the lens from any direction.
    #[must_use]
    pub fn far_in_front(&self, z: f64) -> f64 {
        2.0 * (self.last_vertex().abs() + self.lateral_scale() + z.abs()) + 10.0
    }

    /// The greatest clear radius (mm), of those that are finite.
    pub fn lateral_scale(&self) -> f64 {
        let radii = self.elements.iter().map(super::Element::clear_radius);
        radii.filter(|r| r.is_finite()).fold(1.0, f64::max)
    }
}

/// The unit vector towards the lens with the given slopes x/−z and y/−z.
pub(crate) fn towards_lens(slopes: DVec2) -> DVec3 {
    DVec3::new(slopes.x, slopes.y, -1.0).normalize()
}

/// The slopes of the ray from a point of the sensor (mm) that crosses an element at a place in the
/// element's own frame (mm), found from slopes that are near, or from the straight line.
pub(crate) fn slopes_to(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    film: DVec3,
    element: usize,
    place: DVec2,
    start: Option<DVec2>,
) -> Option<DVec2> {
    let miss = |film: DVec3, place: DVec2| {
        move |slopes: DVec2| {
            let ray = Ray::new(film, towards_lens(slopes))?;
            at.crossing(Side::Sensor, element, ray).map(|there| DVec2::from(there) - place)
        }
    };
    let target = train.elements[element].frame.point(place.extend(0.0));
    let straight = (target - film).truncate() / (film.z - target.z).max(1e-9);
    let shares =
        |share: f64| miss(DVec3::new(film.x * share, film.y * share, film.z), place * share);
    start
        .and_then(|start| solve(miss(film, place), start, 1.0))
        .or_else(|| solve(miss(film, place), straight, 1.0))
        .or_else(|| follow(shares, DVec2::ZERO, 1.0))
}

/// As [`slopes_to`], from slopes that are near or not at all.
pub(crate) fn slopes_near(
    at: &MonochromaticTrain,
    film: DVec3,
    element: usize,
    place: DVec2,
    start: DVec2,
) -> Option<DVec2> {
    let miss = |slopes: DVec2| {
        let ray = Ray::new(film, towards_lens(slopes))?;
        at.crossing(Side::Sensor, element, ray).map(|there| DVec2::from(there) - place)
    };
    solve(miss, start, 1.0)
}

/// Steps from the axis outwards, each begun where the last two point.
pub(crate) fn follow<F: Fn(DVec2) -> Option<DVec2>>(
    at: impl Fn(f64) -> F,
    start: DVec2,
    scale: f64,
) -> Option<DVec2> {
    const STEPS: u32 = 24;
    let (mut before, mut here) = (start, start);
    for step in 1..=STEPS {
        let guess = if step < 3 { here } else { here + (here - before) };
        let residual = at(f64::from(step) / f64::from(STEPS));
        let found = solve(&residual, guess, scale).or_else(|| solve(&residual, here, scale))?;
        (before, here) = (here, found);
    }
    Some(here)
}

/// A zero of `f`, or `None`. `scale` is the unknowns' own size.
pub(crate) fn solve(f: impl Fn(DVec2) -> Option<DVec2>, start: DVec2, scale: f64) -> Option<DVec2> {
    let (mut x, mut value) = (start, f(start)?);
    for _ in 0..40 {
        if value.length() <= 0.01 * ON_TARGET {
            break;
        }
        let h = 1e-6 * (scale + x.length());
        let partial = |step: DVec2| {
            f(x + step).map(|v| (v - value) / h).or_else(|| f(x - step).map(|v| (value - v) / h))
        };
        let (by_x, by_y) = (partial(DVec2::new(h, 0.0))?, partial(DVec2::new(0.0, h))?);
        let determinant = by_x.perp_dot(by_y);
        if determinant == 0.0 || !determinant.is_finite() {
            break;
        }
        let step = DVec2::new(value.perp_dot(by_y), by_x.perp_dot(value)) / determinant;
        // The first of the steps 1, 1/2, 1/4, … that comes nearer.
        let nearer = (0..24).map(|i| x - step * 0.5_f64.powi(i)).find_map(|candidate| {
            let there = f(candidate)?;
            (there.length() < value.length()).then_some((candidate, there))
        });
        let Some(next) = nearer else { break };
        (x, value) = next;
    }
    (value.length() <= ON_TARGET).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_solver_finds_zeros_and_says_when_there_are_none() {
        let root =
            solve(|p| Some(DVec2::new(p.x * p.x - 2.0, p.y + p.x)), DVec2::ONE, 1.0).unwrap();
        assert!((root - DVec2::new(2.0_f64.sqrt(), -(2.0_f64.sqrt()))).length() < 1e-9);
        assert_eq!(solve(|p| Some(DVec2::new(p.x * p.x + 1.0, p.y)), DVec2::ONE, 1.0), None);
        assert_eq!(solve(|_| None, DVec2::ONE, 1.0), None);
        let half = |p: DVec2| (p.x > 0.1).then_some(DVec2::new(p.x.ln(), p.y));
        assert!((solve(half, DVec2::new(9.0, 1.0), 1.0).unwrap() - DVec2::X).length() < 1e-9);
    }
}
