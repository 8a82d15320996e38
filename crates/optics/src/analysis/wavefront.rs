//! Optical path differences against a reference sphere.
//!
//! The sphere's centre is the image point and it passes the middle of the paraxial exit pupil. W is
//! the path of the chief ray to the sphere less that of a ray: positive where the wavefront is ahead
//! (W. T. Welford, *Aberrations of Optical Systems*, 1986, ch. 7).

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::Serialize;

use super::AnalysisError;
use super::least_squares::LeastSquares;
use super::object::{Beam, ObjectPoint};
use super::pupil::PupilField;
use crate::train::optical_path::PathEnd;
use crate::train::{MonochromaticTrain, OpticalTrain};

/// Radii beyond are as good as infinite: an exit pupil at infinity gets this (mm).
const FLAT: f64 = 1e5;

/// The least radius that can be worked with (mm).
const LEAST_RADIUS: f64 = 1e-3;

/// The greatest change of a wavefront from one cell to the next at which its phase is known (waves).
pub const NYQUIST: f64 = 0.5;

/// The change from cell to cell that grids are chosen for (waves).
pub(super) const COMFORTABLE: f64 = 0.2;

/// Cells a side of a grid that is chosen, in the least.
pub const USUAL_CELLS: usize = 192;

/// The sphere that a wavefront is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct ReferenceSphere {
    /// The image point (mm).
    pub centre: [f64; 3],
    /// From the exit pupil's middle to the centre (mm); negative when the pupil is behind it, and
    /// 1e5 when it is farther than that.
    pub radius: f64,
    /// The index before the image.
    pub index: f64,
}

impl ReferenceSphere {
    /// About an image point (mm).
    ///
    /// # Errors
    ///
    /// When the exit pupil lies in it, or a glass has no index.
    pub fn about(
        train: &OpticalTrain,
        at: &MonochromaticTrain,
        centre: DVec3,
    ) -> Result<Self, AnalysisError> {
        let pupil = train.paraxial(at.wavelength())?.exit_pupil.z;
        let radius = match pupil {
            Some(z) => {
                let way = centre - DVec3::new(0.0, 0.0, z);
                way.length().copysign(way.z).clamp(-FLAT, FLAT)
            }
            None => FLAT,
        };
        if radius.abs() < LEAST_RADIUS {
            return Err(AnalysisError::no_sphere(centre.z));
        }
        Ok(Self { centre: centre.into(), radius, index: at.index_before_sensor() })
    }

    /// Intersection of a ray with the sphere: the optical direction cosines of the way from there
    /// to the centre, and the optical path to there from where the ray left the lens (mm).
    pub(crate) fn meet(&self, end: &PathEnd) -> Option<(DVec2, f64)> {
        let (from, direction) = (DVec3::from(end.ray.position), DVec3::from(end.ray.direction));
        let way = from - DVec3::from(self.centre);
        let b = way.dot(direction);
        let foot = way - direction * b;
        let half2 = self.radius * self.radius - foot.length_squared();
        if half2 <= 0.0 {
            return None;
        }
        // The crossing on the pupil's side of the centre.
        let half = half2.sqrt().copysign(self.radius);
        let place = foot - direction * half;
        let cosines = place.truncate() * (-self.index / self.radius);
        Some((cosines, self.index * (-b - half)))
    }
}

/// Centre of a reference sphere.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reference {
    /// The point at which the chief ray meets the image plane.
    #[default]
    ChiefRay,
    /// The point near it, also along the axis, at which the root mean square of the waves is least.
    BestFit,
}

/// A wavefront on its reference sphere.
#[derive(Debug, Clone)]
pub struct Wavefront {
    /// Object point that emits the light.
    pub object: ObjectPoint,
    /// Reference sphere of the wavefront errors.
    pub sphere: ReferenceSphere,
    /// The field on the sphere.
    pub pupil: PupilField,
}

/// Number of cells across a pupil.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Cells {
    /// As many as the wavefront needs, at least 192 a side.
    #[default]
    Needed,
    /// A number a side; an error when they are too few.
    Given(usize),
}

impl Wavefront {
    /// Of a field whose cells resolve its phase.
    pub(super) fn resolved(
        object: ObjectPoint,
        sphere: ReferenceSphere,
        pupil: PupilField,
    ) -> Result<Self, AnalysisError> {
        let steepest = pupil.steepest();
        if steepest > NYQUIST {
            let needed = pupil.needed_cells(COMFORTABLE);
            return Err(AnalysisError::Coarse { cells: pupil.cells, steepest, needed });
        }
        Ok(Self { object, sphere, pupil })
    }

    /// Moves the centre of the reference sphere to the point of least root-mean-square wavefront
    /// error.
    ///
    /// # Errors
    ///
    /// When the lit cells do not tell a shift from a turn.
    pub fn best_fit(mut self) -> Result<Self, AnalysisError> {
        let shift = self.best_shift()?;
        let centre = DVec3::from(self.sphere.centre) + shift;
        self.pupil = self.pupil.moved(shift);
        // The sphere still passes the exit pupil: its radius changes by the shift along the way.
        self.sphere.radius = (self.sphere.radius + shift.z).clamp(-FLAT, FLAT);
        self.sphere.centre = centre.into();
        Ok(self)
    }

    /// From the sphere's centre to the point of least root mean square (mm).
    fn best_shift(&self) -> Result<DVec3, AnalysisError> {
        let pupil = &self.pupil;
        let length = pupil.wavelength * 1e-6;
        let mut fit = LeastSquares::new(4);
        let (middle, radius) = pupil.circle();
        let axial = |p: DVec2| (pupil.index * pupil.index - p.length_squared()).max(0.0).sqrt();
        // In units of the pupil's radius, and of the depth of its cap.
        let depth = 0.5 * radius * radius / pupil.index;
        let mut count = 0;
        for i in pupil.lit() {
            let place = pupil.place(i);
            let p = (place - middle) / radius;
            let row = [1.0, p.x, p.y, (axial(place) - axial(middle)) / depth];
            fit.add(&row, pupil.waves[i] * length, pupil.clear[i]);
            count += 1;
        }
        let singular = AnalysisError::Singular { terms: 4, rays: count };
        let found = fit.solve().ok_or(singular)?;
        Ok(DVec3::new(found[1] / radius, found[2] / radius, found[3] / depth))
    }
}

/// Point where a beam's chief ray meets the plane at `z` (mm).
pub(crate) fn chief_point(beam: &Beam<'_>, z: f64) -> DVec3 {
    let ray = beam.chief_end.ray;
    let (from, direction) = (DVec3::from(ray.position), DVec3::from(ray.direction));
    from + direction * ((z - from.z) / direction.z)
}
