//! First-order optics by ABCD matrices ([`Abcd`]).
//!
//! A gap of graded index has a matrix of its own.
//!
//! Tilts and decentrings are left out. Planes are given by their z in lens coordinates (mm).

use schemars::JsonSchema;
use serde::Serialize;

use super::OpticalTrain;
use super::trace::Indices;
use crate::element::Abcd;
use crate::glass::GlassError;

/// A power this small a share of the powers it is made of is rounding: the lens is afocal.
const AFOCAL: f64 = 1e-12;

/// First-order data of a lens: its effect on rays near the axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Paraxial {
    /// The wavelength (nm).
    pub wavelength: f64,
    /// The effective focal length (mm), 1 over the power; `null` for an afocal lens.
    pub efl: Option<f64>,
    /// The back focal length (mm): from the last vertex to the rear focal point.
    pub bfl: Option<f64>,
    /// z of the front focal point (mm): the front focal length, as it is counted from the first
    /// vertex.
    pub ffl: Option<f64>,
    /// z of the rear focal point (mm): the image of infinity.
    pub image_z: Option<f64>,
    /// z of the front principal plane (mm).
    pub front_principal_z: Option<f64>,
    /// z of the rear principal plane (mm).
    pub rear_principal_z: Option<f64>,
    /// The stop as seen from the object.
    pub entrance_pupil: Pupil,
    /// The stop as seen from the sensor.
    pub exit_pupil: Pupil,
    /// |efl| over the entrance pupil's diameter.
    pub f_number: Option<f64>,
    /// The stop's radius over the entrance pupil's; negative when the pupil is upside down.
    #[serde(skip)]
    pub stop_magnification: Option<f64>,
}

/// An image of the stop.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, JsonSchema)]
pub struct Pupil {
    /// z of its plane (mm); `null` when it is at infinity (telecentric).
    pub z: Option<f64>,
    /// Its diameter (mm), positive also when it is upside down; `null` at infinity, or when nothing
    /// limits the stop.
    pub diameter: Option<f64>,
}

impl OpticalTrain {
    /// First-order data at `wavelength` (nm).
    ///
    /// # Errors
    ///
    /// When a glass has no index there.
    pub fn paraxial(&self, wavelength: f64) -> Result<Paraxial, GlassError> {
        let indices = self.indices(wavelength)?;
        let all = self.matrix(&indices, 0, self.elements.len());
        let (before, behind) = (indices[0], indices[indices.len() - 1]);
        let scale: f64 = (0..self.elements.len()).map(|i| self.power(&indices, i).abs()).sum();
        // A lens has focal points unless its power is lost in rounding.
        let afocal = all.c.abs() <= AFOCAL * scale || all.c == 0.0;
        let focal = |value: f64| (!afocal && value.is_finite()).then_some(value);
        let last = self.last_vertex();
        let efl = focal(-1.0 / all.c);
        let bfl = focal(-behind * all.a / all.c);
        // The entrance pupil is the stop's image by what stands before it.
        let entrance = self.entrance_pupil(&indices);
        let radius = entrance.1.map(|m| self.stop_radius() / m.abs()).filter(|r| r.is_finite());
        let entrance_pupil = Pupil { z: entrance.0, diameter: radius.map(|r| 2.0 * r) };
        let f_number = match (efl, entrance_pupil.diameter) {
            (Some(efl), Some(diameter)) if diameter > 0.0 => Some(efl.abs() / diameter),
            _ => None,
        };
        Ok(Paraxial {
            wavelength,
            efl,
            bfl,
            ffl: focal(before * all.d / all.c),
            image_z: bfl.map(|bfl| last + bfl),
            front_principal_z: focal(before * (all.d - 1.0) / all.c),
            rear_principal_z: focal(last + behind * (1.0 - all.a) / all.c),
            entrance_pupil,
            exit_pupil: self.exit_pupil(&indices),
            f_number,
            stop_magnification: entrance.1,
        })
    }

    /// z of the entrance pupil and the stop's radius over its radius.
    fn entrance_pupil(&self, indices: &Indices) -> (Option<f64>, Option<f64>) {
        let to_stop = self.matrix(indices, 0, self.stop).then(self.gap_before(indices, self.stop));
        if to_stop.a.abs() < 1e-12 {
            return (None, None);
        }
        (Some(indices[0] * to_stop.b / to_stop.a), Some(to_stop.a))
    }

    fn exit_pupil(&self, indices: &Indices) -> Pupil {
        let from_stop = self.matrix(indices, self.stop, self.elements.len());
        if from_stop.d.abs() < 1e-12 {
            return Pupil::default();
        }
        let behind = indices[indices.len() - 1];
        let radius = self.stop_radius() / from_stop.d.abs();
        Pupil {
            z: Some(self.last_vertex() - behind * from_stop.b / from_stop.d),
            diameter: radius.is_finite().then_some(2.0 * radius),
        }
    }

    /// The height at each element of a ray that comes from infinity at height 1.
    pub(crate) fn heights_from_infinity(
        &self,
        wavelength: f64,
    ) -> Result<Vec<f64>, (usize, GlassError)> {
        let index = |(i, glass): (usize, &crate::glass::Glass)| {
            glass.index(wavelength).map_err(|e| (i.saturating_sub(1), e))
        };
        let of = self.media.iter().enumerate().map(index).collect::<Result<Vec<_>, _>>()?;
        let indices = Indices { wavelength, of };
        let heights = (0..self.elements.len())
            .map(|i| self.matrix(&indices, 0, i).then(self.gap_before(&indices, i)).a);
        Ok(heights.collect())
    }

    /// From the first vertex to the plane at `z` (mm) behind the lens, at the design wavelength.
    ///
    /// # Errors
    ///
    /// When a glass has no index there.
    pub fn to_plane(&self, z: f64) -> Result<Abcd, GlassError> {
        let indices = self.indices(self.wavelength)?;
        let all = self.matrix(&indices, 0, self.elements.len());
        let behind = indices[indices.len() - 1];
        Ok(all.then(Abcd::gap((z - self.last_vertex()) / behind)))
    }

    /// From before element `from` to behind the one before `to`: the gaps between, none outside.
    pub(crate) fn matrix(&self, indices: &Indices, from: usize, to: usize) -> Abcd {
        let mut all = Abcd::ONE;
        for i in from..to {
            if i > from {
                all = all.then(self.gap_before(indices, i));
            }
            all = all.then(Abcd::power(self.power(indices, i)));
        }
        all
    }

    pub(crate) fn gap_before(&self, indices: &Indices, i: usize) -> Abcd {
        match i.checked_sub(1) {
            Some(previous) => {
                let gap = self.elements[i].frame.vertex.z - self.elements[previous].frame.vertex.z;
                match &self.gradients[i] {
                    None => Abcd::gap(gap / indices[i]),
                    Some(gradient) => gradient.matrix(indices[i], gap),
                }
            }
            None => Abcd::ONE,
        }
    }

    pub(crate) fn power(&self, indices: &Indices, i: usize) -> f64 {
        let [before, behind] = self.indices_at(indices, i);
        self.elements[i].part.power(before, behind, indices.wavelength)
    }

    /// The indices on the axis at both sides of element `i`.
    pub(crate) fn indices_at(&self, indices: &Indices, i: usize) -> [f64; 2] {
        let z = |i: usize| self.elements[i].frame.vertex.z;
        let before = match (&self.gradients[i], i.checked_sub(1)) {
            (Some(gradient), Some(last)) => gradient.on_axis(indices[i], z(i) - z(last)),
            _ => indices[i],
        };
        let behind = match &self.gradients[i + 1] {
            Some(gradient) => gradient.on_axis(indices[i + 1], 0.0),
            None => indices[i + 1],
        };
        [before, behind]
    }
}
