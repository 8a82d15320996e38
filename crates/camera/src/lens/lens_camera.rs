//! A lens with a sensor behind it as a camera: chief rays for data, weighted rays of the whole pupil
//! for pictures.
//!
//! # Weights
//!
//! E = ∫ L cos θ dΩ over the exit pupil is Eq. (1) of Nürnberg et al. (2019). A sample's weight is the
//! projected solid angle that it stands for over that of the pupil seen from the axis, with filters
//! and masks clear and before anything vignettes: cos⁴ and vignetting are in it, nothing is painted
//! on. A filter dims, a mask passes what it leaves open, and losses in glass, where they are asked for,
//! are lost.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use etendue_geometry::RayBatch;
use etendue_spectrum::{Lanes, Outside};
use glam::{DVec2, DVec3};

use super::chief::ChiefTable;
use super::focused::{Focused, View};
use crate::element::{Clip, Fate, Ray, Reflection};
use crate::train::analysis::projected_solid_angle;
use crate::train::pupil::{Window, blocked, lit_radius, without_dimming, without_filters};
use crate::train::{ExitPupil, ExitPupilError, OpticalTrain, Part, Side, TrainAt};
use crate::{CameraError, CameraRays, FilmSamples, Pose};

/// Lanes whose rays run the same way.
#[derive(Debug, Clone, PartialEq)]
pub struct LaneGroup {
    /// The lanes.
    pub lanes: Range<usize>,
    /// What to ask [`Camera::sample_rays`](crate::Camera::sample_rays) for: `None` when all lanes
    /// are in one group.
    pub wavelength: Option<f64>,
}

/// A lens with a sensor behind it.
#[derive(Debug, Clone)]
pub struct LensCamera {
    focused: Focused,
    design: TrainAt,
    chief: ChiefTable,
    /// How far from the axis light arrives (mm), for lenses with rotational symmetry.
    lit: f64,
    /// Projected solid angle of the unvignetted pupil seen from the axis (sr).
    solid_angle: f64,
    opened: OnceLock<Option<Arc<Opened>>>,
}

/// The exit pupil measured at the wavelengths that are wanted.
#[derive(Debug)]
struct Opened {
    lanes: Lanes,
    lenses: Vec<(Option<f64>, TrainAt)>,
    pupil: ExitPupil,
}

impl PartialEq for LensCamera {
    fn eq(&self, other: &Self) -> bool {
        // All else follows from it.
        self.focused == other.focused
    }
}

impl LensCamera {
    /// Solves chief rays and finds out whether there is light at all.
    pub(crate) fn new(focused: Focused) -> Result<Self, CameraError> {
        let dark = |error: ExitPupilError| CameraError::new("", error.to_string());
        let design = focused.at_design()?;
        // A filter may be dark at the design wavelength and pass others.
        let train = &without_filters(focused.train());
        let clear = train
            .at(train.wavelength())
            .map_err(|fault| CameraError::new("", fault.to_string()))?;
        if train.elements().iter().all(|e| e.clear_radius() == f64::INFINITY) {
            return Err(dark(ExitPupilError::Unbounded));
        }
        let half = focused.film().half_size();
        let frame = focused.film().frame;
        let lit_from =
            |film: DVec2| Window::find(train, &clear, frame.point(film.extend(0.0))).is_some();
        let places = [-1.0, 0.0, 1.0].map(|y| [-1.0, 0.0, 1.0].map(|x| DVec2::new(x, y) * half));
        if !lit_from(DVec2::ZERO) && !places.into_iter().flatten().any(lit_from) {
            return Err(dark(blocked(train, &clear, frame.vertex)));
        }
        let lit = match train.is_rotationally_symmetric() {
            true => lit_radius(train, std::slice::from_ref(&clear), frame.vertex.z, half.length()),
            false => f64::INFINITY,
        };
        let solid_angle = unvignetted(focused.train(), &design, &focused);
        let chief = ChiefTable::new(&focused, &design);
        Ok(Self { focused, design, chief, lit, solid_angle, opened: OnceLock::new() })
    }

    /// The lens and its sensor.
    #[must_use]
    pub fn focused(&self) -> &Focused {
        &self.focused
    }

    /// The same on pixels `factor` times as large: what was measured of the pupil holds for them too.
    pub(crate) fn coarser(&self, factor: f64) -> Self {
        Self { focused: self.focused.coarser(factor), ..self.clone() }
    }

    /// The projected solid angle (sr) of the unvignetted pupil seen from the axis: times the mean of
    /// weight times radiance, it is the irradiance.
    #[must_use]
    pub fn solid_angle(&self) -> f64 {
        self.solid_angle
    }

    /// Which of `lanes` need rays of their own: each where the lens tells wavelengths apart and there
    /// are several, else none.
    #[must_use]
    pub fn lane_groups(&self, lanes: &Lanes) -> Vec<LaneGroup> {
        let count = lanes.count();
        if count < 2 || !tells_wavelengths_apart(self.focused.train()) {
            return vec![LaneGroup { lanes: 0..count, wavelength: None }];
        }
        let group = |i| LaneGroup { lanes: i..i + 1, wavelength: Some(lanes.wavelength(i)) };
        (0..count).map(group).collect()
    }

    /// The same camera with its exit pupil measured for `lanes`, which takes a moment when it is not
    /// yet.
    pub(crate) fn opened(&self, lanes: &Lanes) -> Result<Self, CameraError> {
        if let Some(Some(opened)) = self.opened.get()
            && opened.lanes == *lanes
        {
            return Ok(self.clone());
        }
        let opened = OnceLock::from(Some(Arc::new(self.open(lanes)?)));
        Ok(Self { opened, ..self.clone() })
    }

    fn open(&self, lanes: &Lanes) -> Result<Opened, CameraError> {
        let fault = |why: String| CameraError::new("", why);
        let train = self.focused.train();
        let mut lenses = Vec::new();
        for group in self.lane_groups(lanes) {
            let wavelength = group.wavelength.unwrap_or(train.wavelength());
            for (i, element) in train.elements().iter().enumerate() {
                let Part::Filter(filter) = &element.part else { continue };
                for curve in &filter.curves {
                    lanes
                        .from_curve(curve, Outside::Held)
                        .map_err(|error| fault(format!("the filter elements[{i}]: {error}")))?;
                }
            }
            // The mean over the lane, which a wide lane and a narrow filter make another number than
            // the value at its middle.
            let lane = group.lanes.start;
            let passes = |curve: &etendue_spectrum::Curve| {
                lanes.from_curve(curve, Outside::Held).map_or(0.0, |means| means[lane])
            };
            let lens = train.at_with(wavelength, &passes).map_err(|e| fault(e.to_string()))?;
            lenses.push((group.wavelength, lens));
        }
        let wavelengths: Vec<f64> = lenses.iter().map(|(_, lens)| lens.wavelength()).collect();
        let half_size = self.focused.film().half_size().to_array();
        let z = self.focused.sensor_z();
        let pupil = ExitPupil::new(&without_filters(train), &wavelengths, z, half_size)
            .map_err(|error| fault(error.to_string()))?;
        Ok(Opened { lanes: lanes.clone(), lenses, pupil })
    }

    /// The rays of `samples` that leave the lens.
    pub(crate) fn sample_rays(&self, pose: &Pose, samples: &FilmSamples, out: &mut CameraRays) {
        out.clear();
        // Not opened yet: at the design wavelength of RGB.
        let opened = self.opened.get_or_init(|| self.open(&Lanes::Rgb).ok().map(Arc::new));
        let Some(opened) = opened else { return };
        let wanted = opened.lenses.iter().find(|(nm, _)| *nm == samples.wavelength);
        let Some((_, lens)) = wanted.or(opened.lenses.first()) else { return };
        let (film, rays) = (self.focused.film(), &mut out.in_lens);
        rays.clear();
        let places = samples.columns.iter().zip(&samples.rows).zip(&samples.pupil);
        for (i, ((&column, &row), &u)) in (0..).zip(places) {
            let place = film.place(column, row);
            match opened.pupil.sample(place, u) {
                Some(sample) => {
                    let at = opened.pupil.film_point(place);
                    rays.push_weighted(at, sample.direction, sample.weight / self.solid_angle);
                    out.sample.push(i);
                }
                None => out.fates.unlit += 1,
            }
        }
        lens.trace(Side::Sensor, Clip::On, rays);
        out.fates.add_all(rays);
        let mut kept = 0;
        for i in 0..rays.len() {
            let weight = rays.throughput(i);
            if rays.fate(i) == Fate::Exited && weight > 0.0 {
                let (origin, direction) = self.in_world(pose, rays.position(i), rays.direction(i));
                out.rays.push(origin, direction);
                out.weight.push(weight);
                out.sample[kept] = out.sample[i];
                kept += 1;
            }
        }
        out.sample.truncate(kept);
        out.rays.coherent = true;
    }

    fn in_world(&self, pose: &Pose, point: DVec3, direction: DVec3) -> (DVec3, DVec3) {
        let place = pose.position + pose.rotation * self.focused.in_camera(point);
        (place, pose.rotation * direction)
    }

    /// Turns places on the sensor (pixels from the corner), which stand in the first two arrays of
    /// the directions, into chief rays. They start where they pass the camera's origin, and see what
    /// is in front of the lens.
    pub(crate) fn aim(&self, pose: &Pose, rays: &mut RayBatch) {
        for i in 0..rays.len() {
            let place = self.focused.film().place(rays.direction[0][i], rays.direction[1][i]);
            let chief = self.chief_ray(place);
            let (origin, direction) = match chief {
                Some((point, direction)) => self.in_world(pose, point, direction),
                None => (pose.position, pose.forward()),
            };
            // From the point that is nearest to the entrance pupil; parallel rays, from the plane
            // through it.
            let towards = pose.position - origin;
            let forward = direction.dot(pose.forward());
            let back = match self.focused.view() {
                View::Perspective(_) => towards.dot(direction),
                View::Parallel { .. } if forward > 0.0 => towards.dot(pose.forward()) / forward,
                View::Parallel { .. } => 0.0,
            };
            let start = origin + direction * back;
            for axis in 0..3 {
                rays.origin[axis][i] = start[axis];
                rays.direction[axis][i] = direction[axis];
            }
            rays.t_min[i] = (-back).max(0.0);
            if chief.is_none() {
                // Nothing lies before a negative distance: the ray hits nothing.
                rays.t_max[i] = -1.0;
            }
        }
    }

    /// The chief ray of a place on the sensor (mm) behind the lens, on the object's side: a point on
    /// the last element that it meets, and its direction. `None` outside of the image circle, and
    /// where the stop's centre cannot be seen.
    fn chief_ray(&self, film: DVec2) -> Option<(DVec3, DVec3)> {
        if film.length() > self.lit {
            return None;
        }
        let direction = self.chief.direction(&self.focused, &self.design, film)?;
        let start = self.focused.film().frame.point(film.extend(0.0));
        let end = self.design.run(Side::Sensor, Clip::Off, Ray::new(start, direction)?);
        let ray = end.ray;
        (end.fate == Fate::Exited).then(|| (ray.position.into(), ray.direction.into()))
    }

    /// The slopes (right, down) at which a place of the picture (pixels) is seen; infinite when it is
    /// not seen or is seen 90° or more off the axis.
    pub(crate) fn tangents(&self, column: f64, row: f64) -> [f64; 2] {
        let place = self.focused.film().place(column, row);
        match self.chief_ray(place) {
            Some((_, d)) if d.z < 0.0 => [-d.x / d.z, d.y / d.z],
            _ => {
                let turned = place * self.focused.film().turn;
                [turned.x, -turned.y].map(|x| x.signum() * f64::INFINITY)
            }
        }
    }

    /// What is odd about the lens, and what of it is not known at the wavelengths of `lanes`.
    #[must_use]
    pub fn out_of_range(&self, lanes: &Lanes) -> Vec<String> {
        let train = self.focused.train();
        let mut notes: Vec<String> = Vec::new();
        for group in self.lane_groups(lanes) {
            let wavelength = group.wavelength.unwrap_or(train.wavelength());
            for note in train.outside_of_range(wavelength) {
                if !notes.contains(&note) {
                    notes.push(note);
                }
            }
        }
        notes
    }
}

/// Whether rays of other wavelengths run differently, or lose another share on the way.
fn tells_wavelengths_apart(train: &OpticalTrain) -> bool {
    let filters = train.elements().iter().any(|element| match &element.part {
        Part::Filter(filter) => filter.curves.iter().any(|curve| curve.as_flat().is_none()),
        _ => false,
    });
    let losses = train.losses();
    let coated = matches!(losses.reflection, Some(Reflection::Coated(_)));
    let absorbs = losses.absorption && train.media().iter().any(|g| g.absorption(550.0).is_some());
    filters || coated || absorbs || train.is_dispersive()
}

/// The pupil as seen from the axis with all filters and masks clear; from elsewhere when the axis is
/// dark.
fn unvignetted(train: &OpticalTrain, at: &TrainAt, focused: &Focused) -> f64 {
    let clear = without_dimming(train);
    let lens = clear.at(at.wavelength()).unwrap_or_else(|_| at.clone());
    let z = focused.sensor_z();
    let half = focused.film().half_size();
    let on_axis = projected_solid_angle(&clear, &lens, DVec3::new(0.0, 0.0, z));
    if on_axis > 0.0 {
        return on_axis;
    }
    let mut widest = 0.0_f64;
    for y in [-1.0, -0.5, 0.0, 0.5, 1.0] {
        for x in [-1.0, -0.5, 0.0, 0.5, 1.0] {
            let film = (DVec2::new(x, y) * half).extend(0.0);
            let point = focused.film().frame.point(film);
            widest = widest.max(projected_solid_angle(&clear, &lens, point));
        }
    }
    widest
}
