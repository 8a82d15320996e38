//! Rays of a place on the sensor on their way through the lens, to be drawn.

use glam::{DVec2, DVec3};

use super::lens_camera::LensCamera;
use etendue_optics::element::{Clip, RayStatus};
use etendue_optics::train::{MonochromaticTrain, RayPath, Side};

/// Steps on each side of the chief ray in which the ends of a beam are looked for.
const STEPS: u32 = 100;

/// The steepest ray of a beam against its chief ray.
const STEEPEST: f64 = 1.0;

impl LensCamera {
    /// Ways through the lens, at its design wavelength, of rays that arrive at column and row coordinates
    /// `place` (pixels): `count` of them over the beam that the lens lets through, in the plane through the
    /// axis. Each is a line of points (z, height over the axis) in lens coordinates (mm), from the sensor to
    /// a little in front of the lens.
    ///
    /// None where no light arrives.
    #[must_use]
    pub fn paths(&self, place: [f64; 2], count: u32) -> Vec<Vec<[f64; 2]>> {
        // The chief ray, and the plane of the axis and the place.
        let film = self.focused.film();
        let start = film.frame.point(film.place(place[0], place[1]).extend(0.0));
        let lens = self.design();
        let Some(chief) = self.focused.train().chief_direction(lens, start) else {
            return Vec::new();
        };
        let upwards = start.truncate().try_normalize().unwrap_or(DVec2::Y);
        let height = upwards.extend(0.0);
        let Some(across) = (height - chief * height.dot(chief)).try_normalize() else {
            return Vec::new();
        };
        // The steepest rays to both sides that leave the lens.
        let send = |slope: f64| through(lens, start, (chief + across * slope).normalize());
        let edge = |side: f64| {
            let slopes =
                (0..=STEPS).rev().map(|i| side * STEEPEST * f64::from(i) / f64::from(STEPS));
            slopes.into_iter().find(|&slope| send(slope).is_some())
        };
        let (Some(low), Some(high)) = (edge(-1.0), edge(1.0)) else { return Vec::new() };
        // Even slopes between them.
        let share = |i: u32| if count > 1 { f64::from(i) / f64::from(count - 1) } else { 0.5 };
        let lead = 0.3 * (start.z.abs() + self.focused.train().last_vertex().abs());
        (0..count)
            .filter_map(|i| send(low + (high - low) * share(i)))
            .map(|path| {
                let beyond = path.points.last().zip(path.direction).map(|(end, d)| *end + d * lead);
                let points =
                    std::iter::once(start).chain(path.points.iter().copied()).chain(beyond);
                points.map(|point| [point.z, point.truncate().dot(upwards)]).collect()
            })
            .collect()
    }
}

/// The way of a ray that leaves the lens.
fn through(lens: &MonochromaticTrain, start: DVec3, direction: DVec3) -> Option<RayPath> {
    let path = lens.path(Side::Sensor, Clip::On, start, direction);
    (path.status == RayStatus::Exited).then_some(path)
}
