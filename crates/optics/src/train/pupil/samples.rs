//! Samples of an exit pupil, one by one, and its outline for drawings.

use glam::{DVec2, DVec3};

use super::bound::PupilBound;
use super::disk::Disk;
use super::place::turn_of;
use super::{ANGLES, ExitPupil, LensletPupil, NodeLayout, PupilSample};
use crate::element::{LensRays, RayStatus};
use crate::train::aim::towards_lens;
use crate::train::{MonochromaticTrain, OpticalTrain};

impl ExitPupil {
    /// The lenslets through which light comes, if it does.
    #[must_use]
    pub fn lenslets(&self) -> Option<&LensletPupil> {
        self.lenslets.as_deref()
    }

    /// True if one radius of nodes serves the whole sensor; otherwise a coarser grid of nodes does,
    /// and more rays are lost.
    #[must_use]
    pub fn is_radial(&self) -> bool {
        self.layout == NodeLayout::Radial
    }

    /// The pupil in closed form, if it has one.
    pub fn disk(&self) -> Option<&Disk> {
        self.disk.as_ref()
    }

    /// A point of the sensor in lens coordinates (mm), from its place on the sensor: x and y from
    /// the sensor's centre (mm), in the lens' axes. Images are upside down there.
    #[must_use]
    pub fn film_point(&self, film: DVec2) -> DVec3 {
        self.sensor.point(film.extend(0.0))
    }

    /// The direction for the point `u` of the unit square, as seen from `film` on the sensor (mm), for a
    /// ray of `wavelength` (nm): uniform in area over the bound, or towards what a mask passes, in proportion
    /// to it. `None` where no light arrives.
    ///
    /// Neighbouring points of the square give neighbouring directions.
    #[must_use]
    pub fn sample(&self, film: DVec2, u: [f64; 2], wavelength: f64) -> Option<PupilSample> {
        if let Some(lenslets) = &self.lenslets {
            let (slopes, area) = lenslets.draw(self.film_point(film), u)?;
            return Some(self.weigh(slopes, area));
        }
        let bound = self.bound(film)?;
        if let Some(coded) = &self.coded
            && let Ok(aimed) = coded.aim(wavelength, film, u, &bound.rectangle())
        {
            return aimed.map(|aimed| self.weigh(aimed.slopes, 1.0 / aimed.density));
        }
        let (slopes, area) = match self.disk {
            Some(disk) => disk.draw(&self.sensor, self.film_point(film), u),
            None => bound.draw(u)?,
        };
        Some(self.weigh(slopes, area))
    }

    /// The sample along slopes that stands for an area of slopes.
    fn weigh(&self, slopes: DVec2, area: f64) -> PupilSample {
        let direction = towards_lens(slopes);
        let on_sensor = direction.dot(self.sensor.rotation.z_axis).abs();
        let cosine = -direction.z;
        let weight = self.index2 * area * cosine.powi(3) * on_sensor;
        PupilSample { direction, weight }
    }

    /// The bound from a point of the sensor (mm); `None` where no light arrives.
    fn bound(&self, film: DVec2) -> Option<PupilBound<'_>> {
        let bound = if let Some(disk) = &self.disk {
            let (centre, radius) = disk.seen_from(self.film_point(film));
            PupilBound { nodes: &[], place: None, frame: [centre, DVec2::splat(radius)] }
        } else {
            let place = self.place(film)?;
            let mut frame = [DVec2::ZERO; 2];
            for (node, weight) in place.nodes {
                frame[0] += self.nodes[node].centre * weight;
                frame[1] += self.nodes[node].half * weight;
            }
            PupilBound { nodes: &self.nodes, place: Some(place), frame }
        };
        (bound.frame[1].min_element() > 0.0).then_some(bound)
    }

    /// Appends one ray for each point of the sensor (mm) and point of the unit square, ready to be
    /// traced at `wavelength` (nm) from [`Side::Sensor`](crate::train::Side::Sensor); its throughput is its weight.
    /// Where no light arrives the ray has ended and weighs 0.
    pub fn push_rays(&self, film: &[DVec2], u: &[[f64; 2]], wavelength: f64, rays: &mut LensRays) {
        for (&film, &u) in film.iter().zip(u) {
            let at = self.film_point(film);
            match self.sample(film, u, wavelength) {
                Some(sample) => rays.push_weighted(at, sample.direction, sample.weight),
                None => {
                    rays.push_weighted(at, DVec3::NEG_Z, 0.0);
                    rays.set_status(rays.len() - 1, RayStatus::Vignetted { element: 0 });
                }
            }
        }
    }

    /// The direction of the chief ray from `film` (mm), which passes the stop's centre; `None` where
    /// the stop's centre cannot be seen.
    #[must_use]
    pub fn chief_direction(
        &self,
        train: &OpticalTrain,
        at: &MonochromaticTrain,
        film: DVec2,
    ) -> Option<DVec3> {
        let start = self.place(film).and_then(|place| {
            let mut slopes = DVec2::ZERO;
            for (node, weight) in place.nodes {
                slopes += self.nodes[node].chief? * weight;
            }
            Some(place.turned(slopes))
        });
        train.chief_direction_from(at, self.film_point(film), start)
    }

    /// The bound as a polygon of slopes around the passing directions from `film`, for drawing;
    /// empty where no light arrives.
    #[must_use]
    pub fn outline(&self, film: DVec2) -> Vec<DVec2> {
        if let Some(disk) = &self.disk {
            let (centre, radius) = disk.seen_from(self.film_point(film));
            let angle = |i| DVec2::from_angle(turn_of(i) * std::f64::consts::TAU);
            return (0..ANGLES).map(|i| centre + angle(i) * radius).collect();
        }
        let Some(place) = self.place(film) else { return Vec::new() };
        let mut corners = Vec::with_capacity(ANGLES);
        for i in 0..ANGLES {
            let angle = turn_of(i) * std::f64::consts::TAU;
            let mut corner = [DVec2::ZERO, DVec2::ZERO];
            let mut reach = 0.0;
            for (node, weight) in place.nodes {
                let outline = &self.nodes[node];
                corner[0] += outline.centre * weight;
                corner[1] += outline.half * weight;
                reach += outline.reach[i] * weight;
            }
            corners.push(place.turned(corner[0] + DVec2::from_angle(angle) * corner[1] * reach));
        }
        corners
    }
}
