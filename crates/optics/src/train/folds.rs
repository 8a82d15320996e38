//! Trains with mirrors: where their elements stand in the built lens, and which mirrors are in the way.
//!
//! A train is traced in [unfolded coordinates](crate::element::Mirror): each mirror reflects the space behind it
//! into one in which light goes on. [`Isometry`] takes them back.
//!
//! # Obscuration
//!
//! On its way from one element to the next a ray may meet a mirror that is meant for another part of its way, as the
//! secondary of a telescope on the way to the primary. A mirror with a rim is in the way of each leg along which
//! its vertex lies, or at whose refracting end it does (a spot of silver on a corrector), and stops the rays that
//! meet it outside of its hole. A mirror at which the leg itself begins or ends is not in its way.

use glam::{DMat3, DVec3};

use super::{Element, OpticalTrain};
use crate::element::{CoordinateBreak, Fold, Frame, Part, Shadow};

/// Distance (mm) within which two vertices count as one.
const SAME_PLACE: f64 = 1e-6;

/// A turn, with or without a reflection, and a shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Isometry {
    turn: DMat3,
    shift: DVec3,
}

impl Isometry {
    /// Identity.
    pub const ONE: Self = Self { turn: DMat3::IDENTITY, shift: DVec3::ZERO };

    /// The reflection in the plane through `point` (mm) with the unit normal `normal`.
    #[must_use]
    pub(crate) fn reflection(point: DVec3, normal: DVec3) -> Self {
        let column = |axis: DVec3| axis - 2.0 * normal.dot(axis) * normal;
        let turn = DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z));
        Self { turn, shift: point - turn * point }
    }

    /// From the space behind a break at z (mm) to that before it.
    pub(crate) fn behind(turn: &CoordinateBreak, z: f64) -> Self {
        let vertex = DVec3::new(0.0, 0.0, z);
        Self { turn: turn.turn, shift: vertex + turn.shift - turn.turn * vertex }
    }

    /// The break at z (mm) from whose space behind it takes to that before it; `None` where it is one with a reflection.
    pub(crate) fn to_break(self, z: f64) -> Option<CoordinateBreak> {
        let vertex = DVec3::new(0.0, 0.0, z);
        let shift = self.place(vertex) - vertex;
        (self.turn.determinant() > 0.0).then_some(CoordinateBreak { turn: self.turn, shift })
    }

    /// A shift along z (mm).
    pub(crate) fn along(z: f64) -> Self {
        Self { turn: DMat3::IDENTITY, shift: DVec3::new(0.0, 0.0, z) }
    }

    /// Transforms a position (mm).
    #[must_use]
    pub fn place(&self, place: DVec3) -> DVec3 {
        self.turn * place + self.shift
    }

    /// Transforms a direction.
    #[must_use]
    pub fn direction(&self, direction: DVec3) -> DVec3 {
        self.turn * direction
    }

    /// Transforms a frame; the rotation is one with a reflection where it has one.
    #[must_use]
    pub fn frame(&self, frame: &Frame) -> Frame {
        Frame { vertex: self.place(frame.vertex), rotation: self.turn * frame.rotation }
    }

    /// First `inner`, then `self`.
    #[must_use]
    pub(crate) fn after(&self, inner: &Self) -> Self {
        Self { turn: self.turn * inner.turn, shift: self.place(inner.shift) }
    }

    /// Returns the inverse.
    #[must_use]
    pub(crate) fn inverse(&self) -> Self {
        let turn = self.turn.transpose();
        Self { turn, shift: -(turn * self.shift) }
    }
}

/// A mirror in the way of a leg of light.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Obstruction {
    /// The mirror.
    pub(crate) element: usize,
    /// As it stands in the unfolded space of the leg.
    pub(crate) frame: Frame,
    pub(crate) shadow: Shadow,
}

impl OpticalTrain {
    /// True if the train has mirrors, so that it is traced in unfolded coordinates.
    #[must_use]
    pub fn is_folded(&self) -> bool {
        self.elements.iter().any(|element| element.part.mirror().is_some())
    }

    /// True if something may block the middle of the beam: a mirror in its own way or with a hole,
    /// or an aperture with a disk.
    #[must_use]
    pub fn is_obscured(&self) -> bool {
        self.is_folded()
            || self.elements.iter().any(|element| {
                element.part.opening().is_some_and(crate::element::Opening::is_obscured)
            })
    }

    /// From the unfolded space before each element, and at last from that behind all, to the lens as it is built.
    #[must_use]
    pub fn built(&self) -> Vec<Isometry> {
        built(&self.elements)
    }

    /// The mirrors in the way of each leg: before each element, and at last behind all.
    pub(crate) fn obstructions(&self) -> Vec<Vec<Obstruction>> {
        let count = self.elements.len();
        let mut legs = vec![Vec::new(); count + 1];
        if !self.is_folded() {
            return legs;
        }
        let spaces = self.built();
        let end = self.end_of_light();
        // The elements at which a leg begins and ends, but for sheets, which only look at rays.
        let bends = |i: &usize| {
            !matches!(
                self.elements[*i].part,
                Part::Aperture(_) | Part::Filter(_) | Part::CoordinateBreak(_)
            )
        };
        for (leg, obstructions) in legs.iter_mut().enumerate() {
            let (before, behind) = ((0..leg).rev().find(bends), (leg..count).find(bends));
            let z = |i: usize| self.elements[i].frame.vertex.z;
            // The mirror at an end is not in the way, nor is one that it is seen as once more.
            let slack = |i: Option<usize>| match i.map(|i| self.elements[i].part.mirror()) {
                Some(None) => SAME_PLACE,
                Some(Some(_)) | None => -SAME_PLACE,
            };
            let from = match leg.checked_sub(1) {
                Some(last) => z(last) - slack(before),
                None => f64::NEG_INFINITY,
            };
            let to = if leg < count { z(leg) + slack(behind) } else { end };
            for (element, mirror) in self.elements.iter().enumerate() {
                if mirror.part.mirror().is_none()
                    || before == Some(element)
                    || behind == Some(element)
                {
                    continue;
                }
                let Some(shadow) = mirror.shadow() else { continue };
                let to_leg = spaces[leg].inverse().after(&spaces[element]);
                let frame = to_leg.frame(&mirror.frame);
                if frame.vertex.z > from && frame.vertex.z < to {
                    obstructions.push(Obstruction { element, frame, shadow });
                }
            }
        }
        legs
    }

    /// z up to which light goes behind the last element: the sensor's, or that of the image of infinity.
    fn end_of_light(&self) -> f64 {
        let last = self.last_vertex();
        if self.end > last {
            return self.end;
        }
        let image = self.paraxial(self.wavelength).ok().and_then(|paraxial| paraxial.image_z);
        image.filter(|z| *z > last).unwrap_or(f64::INFINITY)
    }

    /// A sentence on a sensor that stands in the light that is on its way to a mirror.
    pub(crate) fn sensor_in_the_light(&self) -> Option<String> {
        if !self.is_folded() {
            return None;
        }
        let spaces = self.built();
        let end = self.end_of_light();
        let sensor = spaces.last()?.place(DVec3::new(0.0, 0.0, end));
        let widest = self.elements.iter().map(Element::clear_radius).fold(0.0, f64::max);
        (0..self.elements.len())
            .find(|&leg| {
                let there = spaces[leg].inverse().place(sensor);
                let from = match leg.checked_sub(1) {
                    Some(last) => self.elements[last].frame.vertex.z,
                    None => f64::NEG_INFINITY,
                };
                let to = self.elements[leg].frame.vertex.z;
                let is_between = there.z > from + SAME_PLACE && there.z < to - SAME_PLACE;
                is_between && there.truncate().length() < widest
            })
            .map(|leg| {
                format!(
                    "the sensor stands in the light on its way to elements[{leg}], and stops none of it here: fold the \
                     axis by a flat mirror, or put an `annular` aperture before elements[{leg}] for the sensor's shadow"
                )
            })
    }
}

impl Element {
    /// Shadow of the element: what it stops of light that is meant for others; `None` without a
    /// rim.
    fn shadow(&self) -> Option<Shadow> {
        let mount = self.part.mirror()?;
        let radius = self.clear_radius();
        let depth = |r: f64| self.part.sag([0.0, r]);
        let rim = [depth(radius.min(self.part.domain()))?, radius * radius];
        radius.is_finite().then_some(Shadow {
            rim,
            hole: [depth(mount.hole).unwrap_or(0.0), mount.hole * mount.hole],
        })
    }
}

/// From the unfolded space before each element, and at last from that behind all, to the lens as it is built.
pub(super) fn built(elements: &[Element]) -> Vec<Isometry> {
    let mut spaces = Vec::with_capacity(elements.len() + 1);
    let mut here = Isometry::ONE;
    spaces.push(here);
    for Element { part, frame } in elements {
        if let Some(mount) = part.mirror() {
            let (turn, shift) = Fold::new(mount, frame, 1.0).map();
            here = here.after(&Isometry { turn, shift });
        }
        if let Part::CoordinateBreak(turn) = part {
            here = here.after(&Isometry::behind(turn, frame.vertex.z));
        }
        spaces.push(here);
    }
    spaces
}
