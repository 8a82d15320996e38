//! Rays at an array of lenslets: one arithmetic for blocks and for single rays.
//!
//! Openings lie in the array's plane. A block's rays are taken to the faces of the cells in which they
//! cross the plane; those that leave such a cell on the way are left for the single-ray code, which takes
//! them to the face of the cell that they get to.

use std::sync::Arc;

use super::lattice::Grid;
use super::microlens_array::{Gaps, Lenslet, LensletShape, MicrolensArray};
use super::rays::{Block, Clip, Ray};
use super::refract::{RefractedRay, each_lane};
use super::refraction::Refraction;
use super::surface::Surface;

/// Cells that a ray is followed into on its way from the plane to a face.
const MOST_CELLS: u32 = 4;

/// An array at one wavelength, met from one side.
#[derive(Debug, Clone)]
pub(crate) struct Lenslets {
    pub(crate) array: Arc<MicrolensArray>,
    kinds: LensletOptics,
    /// The share of light that each type passes; all of it when empty.
    pub(crate) transmissions: Vec<f64>,
}

/// Optical model of each type of lenslet, in the order of the types.
#[derive(Debug, Clone)]
enum LensletOptics {
    /// Thin lenses of these powers (1/mm).
    Thin(Vec<f64>),
    /// Faces, and what is between them.
    Faces { faces: Vec<Refraction>, flat: Refraction },
}

/// The packing of lenslets, and their shape.
#[derive(Debug, Clone, Copy)]
struct LensletForm {
    grid: Grid,
    shape: LensletShape,
}

/// A point of the array's plane.
struct PlanePoint {
    /// Index of the cell.
    index: [f64; 2],
    /// From the lenslet's centre (mm).
    away: [f64; 2],
    /// The lenslet acts.
    open: bool,
    /// Light goes on.
    clear: bool,
}

impl Lenslets {
    /// `before` and `behind` are indices in the direction of travel; `sign` is −1 for light that is
    /// traced from the sensor.
    pub(crate) fn new(
        array: &Arc<MicrolensArray>,
        [before, behind]: [f64; 2],
        sign: f64,
        transmissions: Vec<f64>,
    ) -> Self {
        let (mut powers, mut faces) = (Vec::new(), Vec::new());
        for one in &array.types {
            match one {
                Lenslet::Thin(power) => powers.push(sign * power),
                Lenslet::Face(face) => faces.push(Refraction::new(face.clone(), before, behind)),
            }
        }
        let flat = Refraction::new(Surface::sphere(0.0), before, behind);
        let kinds = if faces.is_empty() {
            LensletOptics::Thin(powers)
        } else {
            LensletOptics::Faces { faces, flat }
        };
        Self { array: Arc::clone(array), kinds, transmissions }
    }

    /// Takes a block through an array on the axis at `z` (mm); says whether rays are left to be decided
    /// one by one.
    #[inline(always)]
    pub(crate) fn lanes(&self, block: &mut Block, element: usize, z: f64, clip: Clip) -> bool {
        use Grid::{Hexagonal as Hex, Square as Quad};
        use LensletShape::{Hexagonal, Round, Square};
        // A kernel for each packing and shape, in which there is nothing to choose.
        let form = |grid, shape| LensletForm { grid, shape };
        match (self.array.lattice.grid, self.array.shape) {
            (Quad, Square) => self.lanes_of(form(Quad, Square), block, element, z, clip),
            (Quad, Round) => self.lanes_of(form(Quad, Round), block, element, z, clip),
            (Quad, Hexagonal) => self.lanes_of(form(Quad, Hexagonal), block, element, z, clip),
            (Hex, Square) => self.lanes_of(form(Hex, Square), block, element, z, clip),
            (Hex, Round) => self.lanes_of(form(Hex, Round), block, element, z, clip),
            (Hex, Hexagonal) => self.lanes_of(form(Hex, Hexagonal), block, element, z, clip),
        }
    }

    #[inline(always)]
    fn lanes_of(
        &self,
        form: LensletForm,
        block: &mut Block,
        element: usize,
        z: f64,
        clip: Clip,
    ) -> bool {
        match &self.kinds {
            LensletOptics::Thin(powers) => match powers[..] {
                [power] => each_lane(
                    block,
                    element,
                    z,
                    #[inline(always)]
                    |ray| self.at_thin(form, ray, clip, |_| power),
                ),
                _ => each_lane(
                    block,
                    element,
                    z,
                    #[inline(always)]
                    |ray| self.at_thin(form, ray, clip, |index| powers[self.array.type_at(index)]),
                ),
            },
            LensletOptics::Faces { faces, flat } => match (&faces[..], self.array.gaps) {
                // Where nothing passes, a ray ends in the plane.
                ([one], Gaps::Opaque) if is_sphere(one) => each_lane(
                    block,
                    element,
                    z,
                    #[inline(always)]
                    |ray| self.at_face(form, ray, clip, one, at_end),
                ),
                ([one], Gaps::Clear) if is_sphere(one) => each_lane(
                    block,
                    element,
                    z,
                    #[inline(always)]
                    |ray| {
                        let gap = |_, _| flat.at_plane(ray, f64::INFINITY);
                        self.at_face(form, ray, clip, one, gap)
                    },
                ),
                _ => each_lane(block, element, z, |ray| RefractedRay {
                    hit: false,
                    ..flat.at_plane(ray, f64::INFINITY)
                }),
            },
        }
    }

    #[inline(always)]
    fn place(
        &self,
        LensletForm { grid, shape }: LensletForm,
        [x, y]: [f64; 2],
        clip: Clip,
    ) -> PlanePoint {
        let array = &*self.array;
        let cell = array.lattice.cell_of(grid, x, y);
        let passes_gaps = array.gaps == Gaps::Clear;
        let inside = array.is_open_as(shape, cell.local);
        let off = clip == Clip::Off;
        PlanePoint {
            index: cell.index,
            away: cell.away,
            open: inside | (off & !passes_gaps),
            clear: off | (array.is_inside(x, y) & (inside | passes_gaps)),
        }
    }

    #[inline(always)]
    fn at_thin(
        &self,
        form: LensletForm,
        ray: Ray,
        clip: Clip,
        power: impl Fn([f64; 2]) -> f64,
    ) -> RefractedRay {
        let (there, t) = to_plane(ray);
        let [x, y, _] = there.position;
        let place = self.place(form, [x, y], clip);
        let power = if place.open { power(place.index) } else { 0.0 };
        let [u, v, w] = ray.direction;
        let (u, v) = (u - place.away[0] * power * w, v - place.away[1] * power * w);
        let length = (u * u + v * v + w * w).sqrt();
        let scale = if power == 0.0 { 1.0 } else { 1.0 / length };
        let direction = [u * scale, v * scale, w * scale];
        let hit = goes_there(t) & (length < f64::INFINITY);
        RefractedRay { ray: Ray { direction, ..there }, t, hit, clear: place.clear, through: true }
    }

    /// A ray at the face of the cell in which it crosses the plane; no hit where the face may be met in
    /// another cell. What is between faces gets the ray in the plane, and how far it went.
    #[inline(always)]
    fn at_face(
        &self,
        form: LensletForm,
        ray: Ray,
        clip: Clip,
        face: &Refraction,
        gap: impl Fn(Ray, f64) -> RefractedRay,
    ) -> RefractedRay {
        let (there, t) = to_plane(ray);
        let [x, y, _] = there.position;
        let place = self.place(form, [x, y], clip);
        let centre = [x - place.away[0], y - place.away[1]];
        let local = moved(ray, [-centre[0], -centre[1]]);
        let crossing = face.at_near_root::<true, f64>(local, f64::INFINITY);
        let same = self.array.lattice.is_well_inside(
            form.grid,
            crossing.ray.position[0],
            crossing.ray.position[1],
        );
        let crossing = RefractedRay { hit: crossing.hit & same, ..moved(crossing, centre) };
        let on_face = place.open & place.clear;
        RefractedRay { clear: place.clear, ..if on_face { crossing } else { gap(there, t) } }
    }

    /// A ray in the array's frame, exactly by the rule, and the type of lenslet that it meets.
    pub(crate) fn exactly(&self, ray: Ray, clip: Clip) -> (RefractedRay, Option<usize>) {
        let form = LensletForm { grid: self.array.lattice.grid, shape: self.array.shape };
        let (there, _) = to_plane(ray);
        let [x, y, _] = there.position;
        let place = self.place(form, [x, y], clip);
        let kind = self.array.type_at(place.index);
        let acting = place.open.then_some(kind);
        match &self.kinds {
            LensletOptics::Thin(powers) => {
                (self.at_thin(form, ray, clip, |index| powers[self.array.type_at(index)]), acting)
            }
            LensletOptics::Faces { flat, .. } if !(place.open && place.clear) => {
                (RefractedRay { clear: place.clear, ..flat.at_plane(ray, f64::INFINITY) }, acting)
            }
            LensletOptics::Faces { faces, .. } => {
                let centre = [x - place.away[0], y - place.away[1]];
                (self.on_faces(faces, ray, place.index, centre), acting)
            }
        }
    }

    /// A ray at the faces, from the cell on in which it crosses the plane.
    fn on_faces(
        &self,
        faces: &[Refraction],
        ray: Ray,
        mut index: [f64; 2],
        mut centre: [f64; 2],
    ) -> RefractedRay {
        let array = &*self.array;
        let mut last = None;
        for _ in 0..MOST_CELLS {
            let face = &faces[array.type_at(index)];
            let local = moved(ray, [-centre[0], -centre[1]]);
            let crossing = moved(face.exactly(local, f64::INFINITY), centre);
            if !crossing.hit {
                return RefractedRay { clear: true, ..crossing };
            }
            let [x, y, _] = crossing.ray.position;
            let found = array.lattice.cell(x, y).index;
            if found == index {
                return RefractedRay { clear: true, ..crossing };
            }
            (last, index, centre) = (Some(crossing), found, array.lattice.centre(found));
        }
        // It runs into a wall between two faces.
        let blocked = RefractedRay { ray, t: 0.0, hit: true, clear: false, through: true };
        last.map_or(blocked, |crossing| RefractedRay { clear: false, ..crossing })
    }
}

#[inline(always)]
fn goes_there(t: f64) -> bool {
    (t > -super::refract::TOUCH) & (t < f64::INFINITY)
}

fn is_sphere(face: &Refraction) -> bool {
    face.surface.curvature != 0.0 && face.surface.conic == 0.0
}

/// A ray that ends in the array's plane.
#[inline(always)]
fn at_end(there: Ray, t: f64) -> RefractedRay {
    RefractedRay { ray: there, t, hit: goes_there(t), clear: false, through: true }
}

#[inline(always)]
fn to_plane(ray: Ray) -> (Ray, f64) {
    let t = -ray.position[2] / ray.direction[2];
    let mut there = ray.advanced(t);
    there.position[2] = 0.0;
    (there, t)
}

/// Geometry that can be shifted across the axis.
trait Across {
    fn across(self, by: [f64; 2]) -> Self;
}

impl Across for Ray {
    #[inline(always)]
    fn across(mut self, by: [f64; 2]) -> Self {
        self.position[0] += by[0];
        self.position[1] += by[1];
        self
    }
}

impl Across for RefractedRay {
    #[inline(always)]
    fn across(self, by: [f64; 2]) -> Self {
        Self { ray: self.ray.across(by), ..self }
    }
}

#[inline(always)]
fn moved<T: Across>(what: T, by: [f64; 2]) -> T {
    what.across(by)
}
