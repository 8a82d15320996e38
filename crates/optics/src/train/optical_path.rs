//! Optical path lengths along rays: Σ n t from where a ray starts to the last surface.
//!
//! # Ideal thin lenses
//!
//! A lens that images every point to a point at any angle has no one phase: what it adds depends on
//! where the light comes from. Of a beam from one point the phase follows from the images being
//! sharp: −n times the path from the point before it to the lens and on to the point behind it. The
//! two points are taken on the beam's chief ray at the paraxial image distances.

use glam::DVec3;

use super::{MonochromaticTrain, OpticalTrain};
use crate::element::{Action, Clip, Ray, RayStatus};
use crate::glass::GlassError;

/// A ray behind the lens with its path.
#[derive(Debug, Clone, Copy)]
pub struct PathEnd {
    /// Outcome of the ray.
    pub status: RayStatus,
    /// Ray that goes on from the point where it left the last surface (mm).
    pub ray: Ray,
    /// The optical path from its start to there (mm).
    pub length: f64,
    /// Share of the ray's light that apertures and filters pass.
    pub throughput: f64,
}

/// Meeting point of the rays of a beam, on one side of a thin lens.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Meeting {
    /// They are parallel.
    Infinity(DVec3),
    /// At a point (mm).
    At(DVec3),
}

/// Phases that thin lenses add to the paths of one beam; empty of a train without any.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ThinLensPhases {
    /// Element, where the chief ray meets it, and the points before and behind.
    lenses: Vec<(usize, DVec3, [Meeting; 2])>,
}

impl ThinLensPhases {
    /// Of the beam from an object at `object_z` (mm; `None` at infinity) with this chief ray.
    ///
    /// # Errors
    ///
    /// When a glass has no index at the wavelength.
    pub fn new(
        train: &OpticalTrain,
        at: &MonochromaticTrain,
        object_z: Option<f64>,
        chief: Ray,
    ) -> Result<Self, GlassError> {
        let mut lenses = Vec::new();
        let indices = train.indices(at.wavelength())?;
        let mut ray = chief;
        for step in at.forward_steps() {
            let traversal = step.run_one(ray, Clip::Off);
            if matches!(step.action, Action::ThinLens { .. })
                && let Some(point) = traversal.point
            {
                let i = step.element;
                let z = train.elements()[i].frame.vertex.z;
                // Height and reduced slope of the axial ray before the lens.
                let to_lens = train.matrix(&indices, 0, i).then(train.gap_before(&indices, i));
                let (height, slope) = match object_z {
                    None => (1.0, 0.0),
                    Some(object) => (-object, indices[0]),
                };
                let y = to_lens.a * height + to_lens.b * slope;
                let before = to_lens.c * height + to_lens.d * slope;
                let behind = before - train.power(&indices, i) * y;
                let index = indices[i];
                let meeting = |slope: f64, ray: Ray| {
                    let distance = -index * y / slope;
                    let direction = DVec3::from(ray.direction);
                    match distance.is_finite() && distance.abs() < 1e12 {
                        true => Meeting::At(
                            DVec3::from(point)
                                + direction * ((z + distance - point[2]) / direction.z),
                        ),
                        false => Meeting::Infinity(direction),
                    }
                };
                let points = [meeting(before, ray), meeting(behind, traversal.ray)];
                lenses.push((i, DVec3::from(point), points));
            }
            ray = traversal.ray;
        }
        Ok(Self { lenses })
    }

    /// Path that the thin lens `element` adds at a place (mm), over the index.
    fn at(&self, element: usize, place: DVec3) -> f64 {
        let Some((_, chief, [before, behind])) = self.lenses.iter().find(|l| l.0 == element) else {
            return 0.0;
        };
        let towards = |place: DVec3| match *before {
            Meeting::Infinity(direction) => direction.dot(place),
            Meeting::At(point) => (place - point).length().copysign(place.z - point.z),
        };
        let onwards = |place: DVec3| match *behind {
            Meeting::Infinity(direction) => -direction.dot(place),
            Meeting::At(point) => (point - place).length().copysign(point.z - place.z),
        };
        towards(*chief) - towards(place) + onwards(*chief) - onwards(place)
    }
}

impl MonochromaticTrain {
    /// One ray of a beam from the object to behind the lens, with its optical path.
    #[must_use]
    pub fn run_with_path(&self, clip: Clip, ray: Ray, phases: &ThinLensPhases) -> PathEnd {
        let mut end = PathEnd { status: RayStatus::Exited, ray, length: 0.0, throughput: 1.0 };
        for step in self.forward_steps() {
            let traversal = step.run_one(end.ray, clip);
            end.status = traversal.status;
            end.throughput *= traversal.transmission;
            if traversal.status != RayStatus::Exited {
                break;
            }
            if let Some(path) = step.graded_path(end.ray) {
                end.length += path;
                if let (true, Some(point)) = (step.moves(), traversal.point) {
                    end.length += step.added_path(point.into());
                }
            } else if let (true, Some(point)) = (step.moves(), traversal.point) {
                let way = DVec3::from(point) - DVec3::from(end.ray.position);
                let index = self.index_before(step.element);
                let mut length = way.dot(DVec3::from(end.ray.direction));
                if matches!(step.action, Action::ThinLens { .. }) {
                    length += phases.at(step.element, traversal.ray.position.into());
                }
                end.length += index * length + step.added_path(point.into());
            }
            end.ray = traversal.ray;
        }
        end
    }
}
