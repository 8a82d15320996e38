//! Arrays of lenslets behind a lens: how a place on the sensor sees the lens through each of them.
//!
//! All of it is first-order, relative to the axis of one lenslet. From the sensor's point p light goes to
//! the point a of the rearmost array, over the reduced distance B. With c the lenslet's centre, height
//! and slope in front of the array are linear in a − c and c − p:
//!
//! y₀ = Yₐ (a − c) + Yₚ (c − p), s₀ = Sₐ (a − c) + Sₚ (c − p),
//!
//! for a thin lenslet of focal length f at distance b: Yₐ = 1, Yₚ = 0, Sₐ = 1/b − 1/f, Sₚ = 1/b. Slopes
//! are x/−z, as light that is traced from the sensor has them.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::{FocusError, OpticalTrain, Part};
use crate::element::{Abcd, Lenslet, LensletShape, MicrolensArray, Opening, Surface};

/// Multiple of the lenslets' distance to the sensor from which on what they image counts as infinitely far: then
/// they stand in the picture of the lens before them.
const UNFOCUSED: f64 = 50.0;

/// A lens and the lenslets behind it, which is all that bends light between it and the sensor.
#[derive(Debug, Clone)]
pub struct BehindLenslets {
    /// The lens before the lenslets.
    pub main: OpticalTrain,
    /// The first element behind it.
    pub front: usize,
    /// The rearmost array.
    pub rear: usize,
    /// The rearmost array's openings and grid.
    pub array: Arc<MicrolensArray>,
    /// z of the first vertex behind the lens before (mm).
    pub front_z: f64,
    /// z of the rearmost array (mm).
    pub rear_z: f64,
    /// Shift of the arrays across the axis (mm).
    pub decentre: DVec2,
    /// True if something between the rearmost array and the sensor refracts light (flat glass).
    covered: bool,
    /// From the plane of the rearmost array to z (mm), reduced: thickness over index, and index, of
    /// each medium behind it.
    behind: Vec<[f64; 3]>,
    /// Paraxial effect of each type of lenslet, on the way from the rearmost array to the lens
    /// before.
    kinds: Vec<ParaxialLenslet>,
    /// The index before the lenslets.
    index: f64,
}

/// A type of lenslet to first order, traced from the sensor.
#[derive(Debug, Clone)]
struct ParaxialLenslet {
    /// On height and reduced slope, from before the rearmost array to in front of the first element.
    all: Abcd,
    /// Matrices to the other arrays, whose openings the light has to pass.
    to_arrays: Vec<(Abcd, Arc<MicrolensArray>)>,
}

/// View of the lens from a place on the sensor through one type of lenslet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// The reduced distance from the sensor to the rearmost array, over the index before the sensor
    /// (mm): the slope on the sensor is (a − p)/`distance`.
    pub distance: f64,
    /// Yₐ and Yₚ.
    pub height: [f64; 2],
    /// Sₐ and Sₚ (1/mm).
    pub slope: [f64; 2],
}

impl Sight {
    /// The slope in front of a lenslet, per c − p, of the ray through its middle, and a − c per c − p at
    /// which that ray meets the rearmost array: the ray that crosses the front principal plane, at `h`
    /// (mm) in front of the first element, on the lenslet's axis.
    #[must_use]
    pub fn central(&self, h: f64) -> [f64; 2] {
        let [ya, yd] = self.height;
        let [sa, sd] = self.slope;
        let at = -(yd + h * sd) / (ya + h * sa);
        [sd + sa * at, at]
    }
}

impl OpticalTrain {
    /// The first array of lenslets.
    #[must_use]
    pub fn first_array(&self) -> Option<usize> {
        self.elements.iter().position(|e| matches!(e.part, Part::MicrolensArray(_)))
    }

    /// Returns the lens with arrays that do not refract: openings, or flat surfaces of their size.
    #[must_use]
    pub fn without_arrays(&self) -> Self {
        let mut train = self.clone();
        for element in &mut train.elements {
            if let Part::MicrolensArray(array) = &element.part {
                let radius = array.radius();
                element.part = match array.types.first() {
                    Some(Lenslet::Face(_)) => {
                        Part::Surface(Surface { semi_diameter: radius, ..Surface::sphere(0.0) })
                    }
                    _ => Part::Aperture(Opening::Circle { radius }.into()),
                };
            }
        }
        train
    }

    /// Appends another lens `gap` (mm) behind the last vertex; the sensor stands where `rear` has
    /// it.
    #[must_use]
    pub fn followed_by(mut self, rear: &Self, gap: f64) -> Self {
        let start = self.last_vertex() + gap;
        self.elements.extend(rear.elements.iter().cloned().map(|mut element| {
            element.frame.vertex.z += start;
            element
        }));
        self.media.extend(rear.media.iter().skip(1).cloned());
        self.gradients.extend(rear.gradients.iter().skip(1).cloned());
        self.end = start + rear.end;
        self.notes = self.oddities();
        self
    }

    /// Returns the lens with the sensor `distance` (mm) behind its last vertex.
    #[must_use]
    pub fn with_end(mut self, distance: f64) -> Self {
        self.end = self.last_vertex() + distance;
        self
    }

    /// The part of the lens from element `first` on, its arrays open.
    pub(crate) fn rear_part(&self, first: usize) -> Self {
        let mut train = self.without_arrays();
        train.elements.drain(..first);
        train.media.drain(..first);
        train.gradients.drain(..first);
        train.stop = 0;
        train
    }

    /// The lenslets and the lens before them, where nothing but the lenslets, flat glass and sheets is
    /// behind that lens: all arrays on one grid, nothing tilted, and the stop before them.
    #[must_use]
    pub fn behind_lenslets(&self) -> Option<BehindLenslets> {
        let first = self.first_array()?;
        let indices = self.indices(self.wavelength).ok()?;
        // What is cemented to the array is part of it.
        let in_air = |i: &usize| indices[*i] == indices[0];
        let front = (0..=first).rev().find(in_air)?;
        if front == 0 || self.stop >= front {
            return None;
        }
        let is_array = |i: &usize| matches!(self.elements[*i].part, Part::MicrolensArray(_));
        let rear = (first..self.elements.len()).rev().find(is_array)?;
        let Part::MicrolensArray(array) = &self.elements[rear].part else { return None };
        let decentre = self.elements[rear].frame.vertex.truncate();
        for element in &self.elements[front..] {
            if element.frame.rotation != glam::DMat3::IDENTITY {
                return None;
            }
            let fits = match &element.part {
                Part::MicrolensArray(other) => {
                    other.lattice == array.lattice
                        && other.types.len() == array.types.len()
                        && element.frame.vertex.truncate() == decentre
                }
                part => part.is_plane(),
            };
            if !fits {
                return None;
            }
        }
        let z = |i: usize| self.elements[i].frame.vertex.z;
        let kind = |k| self.lenslet_kind(&indices, front, rear, k);
        Some(BehindLenslets {
            main: self.before(front),
            front,
            rear,
            array: Arc::clone(array),
            front_z: z(front),
            rear_z: z(rear),
            decentre,
            covered: (rear + 1..indices.len()).any(|i| indices[i] != indices[rear + 1]),
            behind: (rear..self.elements.len())
                .map(|i| {
                    let next = self.elements.get(i + 1).map_or(f64::INFINITY, |e| e.frame.vertex.z);
                    [z(i), next, indices[i + 1]]
                })
                .collect(),
            kinds: (0..array.types.len()).map(kind).collect(),
            index: indices[front],
        })
    }

    /// The elements before element `end`.
    fn before(&self, end: usize) -> Self {
        let mut main = self.clone();
        main.elements.truncate(end);
        main.media.truncate(end + 1);
        main.gradients.truncate(end + 1);
        main.sensor = super::SensorMount::default();
        main.end = 0.0;
        main
    }

    fn lenslet_kind(
        &self,
        indices: &[f64],
        front: usize,
        rear: usize,
        kind: usize,
    ) -> ParaxialLenslet {
        let mut all = Abcd::ONE;
        let mut to_arrays = Vec::new();
        for i in (front..=rear).rev() {
            if let Part::MicrolensArray(array) = &self.elements[i].part {
                if i < rear {
                    to_arrays.push((all, Arc::clone(array)));
                }
                let power = match &array.types[kind] {
                    Lenslet::Thin(power) => indices[i] * power,
                    Lenslet::Face(face) => {
                        (indices[i + 1] - indices[i]) * face.paraxial_curvature()
                    }
                };
                all = all.then(Abcd::power(power));
            }
            if i > front {
                let gap = self.elements[i].frame.vertex.z - self.elements[i - 1].frame.vertex.z;
                all = all.then(Abcd::gap(gap / indices[i]));
            }
        }
        ParaxialLenslet { all, to_arrays }
    }

    /// Returns the lens with its lenslets, and all behind them, moved along the axis until objects
    /// at `distance` (m) in front of the entrance pupil are sharp; infinite for infinity. A lens
    /// without lenslets behind it stays as it is.
    ///
    /// # Errors
    ///
    /// When the lens has no image to stand at, or the lenslets would stand in it.
    pub fn with_lenslets_focused(&self, distance: f64) -> Result<Self, FocusError> {
        let Some(array) = self.behind_lenslets() else { return Ok(self.clone()) };
        let image = array.main.sensor_z(super::Focus::Distance(distance))?;
        let offset = array.front_z - array.picture_z(self.end);
        let shift = image + offset - array.front_z;
        if array.front_z + shift <= array.main.last_vertex() {
            return Err(FocusError::virtual_image(distance, image + offset));
        }
        let mut train = self.clone();
        for element in &mut train.elements[array.front..] {
            element.frame.vertex.z += shift;
        }
        train.end += shift;
        Ok(train)
    }
}

impl BehindLenslets {
    /// View through lenslet type `kind` from a sensor plane at `z` (mm).
    #[must_use]
    pub fn sight(&self, kind: usize, z: f64) -> Sight {
        self.sight_by(&self.kinds[kind].all, z)
    }

    /// View from a sensor plane at `z` (mm) past the lenslets, where there is none.
    #[must_use]
    pub fn sight_past(&self, z: f64) -> Sight {
        self.sight_by(&Abcd { a: 1.0, b: self.rear_z - self.front_z, c: 0.0, d: 1.0 }, z)
    }

    fn sight_by(&self, all: &Abcd, z: f64) -> Sight {
        let last = self.behind.len() - 1;
        let reduced: f64 = self
            .behind
            .iter()
            .enumerate()
            .map(|(i, &[from, to, index])| (if i == last { z - from } else { to - from }) / index)
            .sum();
        // Height a − c and reduced slope ((a − c) + (c − p))/B before the rearmost array.
        let over = 1.0 / reduced;
        Sight {
            distance: reduced * self.behind[last][2],
            height: [all.a + all.b * over, all.b * over],
            slope: [(all.c + all.d * over) / self.index, all.d * over / self.index],
        }
    }

    /// The slopes on the sensor with which light from a point of it (mm) gets exactly to a point of the
    /// rearmost array, and the area of slopes per area of the array (1/mm²).
    #[must_use]
    pub fn aim(&self, film: DVec3, at: DVec2) -> (DVec2, f64) {
        let away = at - film.truncate();
        let distance = self.sight_past(film.z).distance;
        if !self.covered {
            return (away / distance, 1.0 / (distance * distance));
        }
        // Snell: index times sine is the same in all flat media. Radius and slope by it, and their
        // derivatives.
        let last = self.behind.len() - 1;
        let thickness = |i: usize| {
            let [from, to, _] = self.behind[i];
            (if i == last { film.z } else { to }) - from
        };
        let least = self.behind.iter().map(|medium| medium[2]).fold(f64::INFINITY, f64::min);
        let tangent = |n: f64, sine: f64| sine / (n * n - sine * sine).sqrt();
        let change = |n: f64, sine: f64| n * n / (n * n - sine * sine).powf(1.5);
        let radius = |sine: f64| {
            let sums = (0..=last).map(|i| {
                let n = self.behind[i][2];
                [thickness(i) * tangent(n, sine), thickness(i) * change(n, sine)]
            });
            sums.fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d])
        };
        let r = away.length();
        let index = self.behind[last][2];
        let first = r / distance;
        let mut sine = (index * first / (1.0 + first * first).sqrt()).min(0.999 * least);
        for _ in 0..20 {
            let [there, slope] = radius(sine);
            let next = (sine + (r - there) / slope).clamp(0.0, 0.5 * (sine + least));
            let settled = (next - sine).abs() < 1e-15;
            sine = next;
            if settled {
                break;
            }
        }
        let [_, by_sine] = radius(sine);
        let slope = tangent(index, sine);
        let stretch = change(index, sine) / by_sine;
        let ratio = if r > 0.0 { slope / r } else { stretch };
        (away * ratio, ratio * stretch)
    }

    /// Projected solid angle (sr) of a lenslet's opening from the sensor's point below its middle, for a
    /// sensor square to the axis, before anything vignettes.
    #[must_use]
    pub fn solid_angle(&self, sensor_z: f64) -> f64 {
        /// Cells a side.
        const GRID: u32 = 256;
        let sight = self.sight(0, sensor_z);
        if self.array.shape == LensletShape::Round {
            let r = self.array.reach / sight.distance;
            return std::f64::consts::PI * r * r / (1.0 + r * r);
        }
        let array = &self.array;
        let step = 2.0 * array.lattice.pitch / f64::from(GRID);
        let mut sum = 0.0;
        for k in 0..GRID * GRID {
            let at = |i: u32| (f64::from(i) + 0.5) * step - array.lattice.pitch;
            let (x, y) = (at(k % GRID), at(k / GRID));
            let turned = DVec2::from(array.lattice.turned([x, y]));
            let centred = array
                .lattice
                .cell(turned.x + array.lattice.offset[0], turned.y + array.lattice.offset[1]);
            if centred.index == [0.0; 2] && array.is_open(centred.local) {
                let m2 = (x * x + y * y) / sight.distance.powi(2);
                sum += (1.0 + m2).powi(-2);
            }
        }
        sum * (step / sight.distance).powi(2)
    }

    /// The openings of the other arrays, which the light through a lenslet has to pass as well: Yₐ and
    /// Yₚ at each of them, for the sensor's plane at z (mm).
    pub(crate) fn openings(
        &self,
        kind: usize,
        z: f64,
    ) -> impl Iterator<Item = ([f64; 2], &Arc<MicrolensArray>)> {
        self.kinds[kind]
            .to_arrays
            .iter()
            .map(move |(to, array)| (self.sight_by(to, z).height, array))
    }

    /// Distance of the lenslets' front principal plane in front of the first element (mm).
    #[must_use]
    pub fn principal_distance(&self, kind: usize) -> f64 {
        let all = &self.kinds[kind].all;
        if all.c == 0.0 { 0.0 } else { self.index * (1.0 - all.a) / all.c }
    }

    /// z of the plane that the first type of lenslets sees sharp on a sensor at `sensor_z` (mm); the
    /// lenslets' own front principal plane when that is nearly at infinity.
    #[must_use]
    pub fn picture_z(&self, sensor_z: f64) -> f64 {
        let sight = self.sight(0, sensor_z);
        // The rays of the sensor's point on the axis of a lenslet: c − p = 0.
        let away = -sight.height[0] / sight.slope[0];
        if away.is_finite() && away.abs() < UNFOCUSED * sight.distance.abs() {
            self.front_z - away
        } else {
            self.front_z - self.principal_distance(0)
        }
    }

    /// Sensor distance (mm behind the last vertex) at which the first type of lenslets images onto
    /// the sensor what is `picture` (mm) in front of their front principal plane; infinitely far
    /// for 0, at which they stand in the picture themselves.
    #[must_use]
    pub fn sensor_distance(&self, picture: f64) -> f64 {
        let all = &self.kinds[0].all;
        // Height in front of the first element plus slope times distance must not depend on the slope
        // behind: a + c m + (b + d m)/B = 0, with the reduced distance B from the rearmost array.
        let m = (picture + self.principal_distance(0)) / self.index;
        let reduced = if picture == 0.0 {
            -all.d / all.c
        } else {
            -(all.b + all.d * m) / (all.a + all.c * m)
        };
        let last = self.behind.len() - 1;
        let covers: f64 =
            self.behind[..last].iter().map(|&[from, to, index]| (to - from) / index).sum();
        (reduced - covers) * self.behind[last][2]
    }

    /// The focal length of a type of lenslet (mm).
    #[must_use]
    pub fn focal_length(&self, kind: usize) -> f64 {
        -self.index / self.kinds[kind].all.c
    }

    /// z of the exit pupil of the lens before the lenslets (mm); `None` when it is at infinity.
    #[must_use]
    pub fn exit_pupil_z(&self) -> Option<f64> {
        self.main.paraxial(self.main.wavelength).ok()?.exit_pupil.z
    }

    /// The centre of a lenslet (mm).
    #[must_use]
    pub fn centre(&self, cell: [f64; 2]) -> DVec2 {
        DVec2::from(self.array.lattice.centre(cell)) + self.decentre
    }

    /// The cell of a point of the array (mm).
    #[must_use]
    pub fn cell(&self, at: DVec2) -> [f64; 2] {
        let at = at - self.decentre;
        self.array.lattice.cell(at.x, at.y).index
    }

    /// Centre, on the sensor, of the image that a lenslet makes of the opening before it (mm across
    /// the axis); `chief` gives the slopes of the chief ray of the lens before at a point of the
    /// array.
    pub fn image_centre(
        &self,
        cell: [f64; 2],
        sensor_z: f64,
        chief: impl Fn(DVec2) -> Option<DVec2>,
    ) -> Option<DVec2> {
        let centre = self.centre(cell);
        let kind = self.array.type_at(cell);
        let [slope, _] = self.sight(kind, sensor_z).central(self.principal_distance(kind));
        Some(centre - chief(centre)? / slope)
    }

    /// The cell whose lenslet a point of the sensor (mm) belongs to: that in which the chief ray of the
    /// lens before would cross the array on its way there, were it not bent.
    pub fn own_cell(
        &self,
        film: DVec3,
        chief: impl Fn(DVec2) -> Option<DVec2>,
    ) -> Option<[f64; 2]> {
        let [slope, _] = self.sight(0, film.z).central(self.principal_distance(0));
        let start = film.truncate();
        let mut at = start;
        // Contracts by the distance to the sensor over that to the pupil each time.
        for _ in 0..6 {
            at = start + chief(at)? / slope;
        }
        Some(self.cell(at))
    }

    /// The slopes on the sensor of the ray from a point of it (mm) through the middle of a lenslet.
    #[must_use]
    pub fn central_slopes(&self, film: DVec3, cell: [f64; 2]) -> DVec2 {
        let kind = self.array.type_at(cell);
        let sight = self.sight(kind, film.z);
        let away = self.centre(cell) - film.truncate();
        let [_, at] = sight.central(self.principal_distance(kind));
        (away + away * at) / sight.distance
    }
}
