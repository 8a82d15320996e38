//! The lamps of a plain scene in single precision, and places that are chosen on them.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use std::hint::select_unpredictable;

use etendue_geometry::block::{Floats as Row, LANES};
use etendue_geometry::glam::DVec3;

use super::kernel::{ZERO, round, single};
use crate::area_light::AreaLight;
use crate::lights;

/// The largest number below 1.
const ONE_BELOW: f32 = 1.0 - f32::EPSILON / 2.0;

/// A triangle that shines, or a point, relative to the blocks' origin (m).
#[derive(Debug, Clone, Copy, Default)]
struct Lamp {
    corner: [f32; 3],
    edges: [[f32; 3]; 2],
    normal: [f32; 3],
    magnitudes: [f32; 3],
    /// m²; 1 of a point, whose density is that of its choice.
    area: f32,
    /// 1 where it holds.
    two_sided: f32,
    is_point: f32,
}

impl Lamp {
    fn point(at: DVec3, origin: DVec3) -> Self {
        Self { corner: single(at - origin), area: 1.0, is_point: 1.0, ..Self::default() }
    }

    fn triangle(own: &AreaLight, origin: DVec3) -> Self {
        let [corner, rest] = own.corner;
        Self {
            corner: single((corner - origin) + rest),
            edges: own.shape.edges.map(single),
            normal: single(own.shape.normal),
            magnitudes: single(own.magnitudes),
            area: round(own.shape.area),
            two_sided: f32::from(u8::from(own.two_sided)),
            is_point: 0.0,
        }
    }
}

/// The lamps of a plain scene.
#[derive(Debug)]
pub(in crate::transport) struct Lights<'a> {
    all: &'a lights::Lights,
    /// All of them, and the sum of the chances of all before each with 1 at the end, where they are few and alike from
    /// everywhere; else each point chooses among all ([`lights::Lights::pick`]).
    few: Vec<Lamp>,
    few_bands: Vec<[f64; 3]>,
    below: Vec<f32>,
    /// What blocks' coordinates are relative to (m).
    pub(super) origin: DVec3,
}

impl<'a> Lights<'a> {
    pub(super) fn new(all: &'a lights::Lights, origin: DVec3) -> Self {
        let (few, few_bands) = (Vec::new(), Vec::new());
        let mut own = Self { all, few, few_bands, below: Vec::new(), origin };
        if let Some(below) = all.few() {
            own.few = (0..all.count()).map(|number| own.lamp(number)).collect();
            own.few_bands = (0..all.count()).map(|number| own.bands_of(number)).collect();
            own.below = below.iter().map(|&sum| round(sum)).collect();
        }
        own
    }

    /// Whether each point chooses among all by where it is.
    pub(super) fn are_many(&self) -> bool {
        self.few.is_empty()
    }

    #[inline(always)]
    fn lamp(&self, number: usize) -> Lamp {
        match self.all.plain_light(number) {
            Some(lights::PlainLight::Point(at)) => Lamp::point(at, self.origin),
            Some(lights::PlainLight::Triangle(own)) => Lamp::triangle(own, self.origin),
            None => Lamp::default(),
        }
    }

    /// Radiance of a triangle, intensity of a point.
    #[inline(always)]
    pub(super) fn radiance(&self, lamp: u32) -> [f64; 3] {
        let kept = self.few_bands.get(lamp as usize).copied();
        kept.unwrap_or_else(|| self.bands_of(lamp as usize))
    }

    #[inline(always)]
    fn bands_of(&self, number: usize) -> [f64; 3] {
        self.all.plain_light_bands(number, 3).try_into().unwrap_or_default()
    }
}

/// The lamps that sixteen points chose, and with which chances.
pub(super) type Chosen<'a> = (&'a [u32; LANES], &'a Row);

/// Places on lamps, one for each of sixteen points. Flags are 1 where they hold, else 0.
pub(super) struct Places {
    /// From the point (m).
    pub(super) way: [Row; 3],
    pub(super) normal: [Row; 3],
    /// What its own numbers add to the rounding of the place (m).
    pub(super) magnitudes: [Row; 3],
    /// Of the place (1/m²).
    pub(super) density: Row,
    pub(super) two_sided: Row,
    pub(super) is_point: Row,
    pub(super) lamp: [u32; LANES],
}

impl Places {
    fn nowhere() -> Self {
        Self {
            way: [ZERO; 3],
            normal: [ZERO; 3],
            magnitudes: [ZERO; 3],
            density: ZERO,
            two_sided: ZERO,
            is_point: ZERO,
            lamp: [0; LANES],
        }
    }
}

/// Places on the lamps that sixteen points chose, by what was left of the numbers that chose them and others.
#[inline(always)]
pub(super) fn place_on_chosen(
    lights: &Lights<'_>,
    points: &[Row; 3],
    square: &[Row; 2],
    (lamps, chance): Chosen<'_>,
) -> Places {
    let mut places = Places { lamp: *lamps, ..Places::nowhere() };
    // What there is in memory of each.
    let (mut corner, mut edges, mut area) = ([ZERO; 3], [[ZERO; 3]; 2], ZERO);
    for i in 0..LANES {
        let lamp = lights.lamp(lamps[i] as usize);
        for axis in 0..3 {
            corner[axis][i] = lamp.corner[axis];
            edges[0][axis][i] = lamp.edges[0][axis];
            edges[1][axis][i] = lamp.edges[1][axis];
            places.normal[axis][i] = lamp.normal[axis];
            places.magnitudes[axis][i] = lamp.magnitudes[axis];
        }
        (area[i], places.two_sided[i]) = (lamp.area, lamp.two_sided);
        places.is_point[i] = lamp.is_point;
    }
    let [second, third] = corner_weights(square);
    for axis in 0..3 {
        for i in 0..LANES {
            let across = edges[0][axis][i] * second[i] + edges[1][axis][i] * third[i];
            places.way[axis][i] = (corner[axis][i] - points[axis][i]) + across;
        }
    }
    for i in 0..LANES {
        places.density[i] = chance[i] / area[i];
    }
    places
}

/// Weights of the second and third corner by squares, uniform over triangles.
#[inline(always)]
fn corner_weights([u, v]: &[Row; 2]) -> [Row; 2] {
    let (mut second, mut third) = (ZERO, ZERO);
    for i in 0..LANES {
        let root = u[i].sqrt();
        second[i] = root * (1.0 - v[i]);
        third[i] = v[i] * root;
    }
    [second, third]
}

/// Chooses one of few lamps for each of sixteen points, and a place on it.
#[inline(always)]
pub(super) fn place(lights: &Lights<'_>, points: &[Row; 3], [mut u, v]: [Row; 2]) -> Places {
    let mut places = Places::nowhere();
    let below = &*lights.below;
    let mut chance = [1.0; LANES];
    if lights.few.len() > 1 {
        let (mut start, mut end) = (ZERO, [1.0; LANES]);
        for (number, of_lamp) in (0_u32..).zip(below.windows(2)) {
            let (from, to) = (of_lamp[0], of_lamp[1]);
            for i in 0..LANES {
                let is_in = (from <= u[i]) & (from < to);
                start[i] = select_unpredictable(is_in, from, start[i]);
                end[i] = select_unpredictable(is_in, to, end[i]);
                places.lamp[i] = select_unpredictable(is_in, number, places.lamp[i]);
            }
        }
        for i in 0..LANES {
            chance[i] = end[i] - start[i];
            let rest = (u[i] - start[i]) / chance[i];
            let rest = if rest > 0.0 { rest } else { 0.0 };
            u[i] = if rest < ONE_BELOW { rest } else { ONE_BELOW };
        }
    }
    let [second, third] = corner_weights(&[u, v]);
    for (number, lamp) in (0_u32..).zip(&lights.few) {
        for axis in 0..3 {
            let (corner, normal) = (lamp.corner[axis], lamp.normal[axis]);
            let (along, across) = (lamp.edges[0][axis], lamp.edges[1][axis]);
            let magnitude = lamp.magnitudes[axis];
            let (way, normals) = (&mut places.way[axis], &mut places.normal[axis]);
            let magnitudes = &mut places.magnitudes[axis];
            for i in 0..LANES {
                let is_own = places.lamp[i] == number;
                let there = (corner - points[axis][i]) + (along * second[i] + across * third[i]);
                way[i] = select_unpredictable(is_own, there, way[i]);
                normals[i] = select_unpredictable(is_own, normal, normals[i]);
                magnitudes[i] = select_unpredictable(is_own, magnitude, magnitudes[i]);
            }
        }
        let (inverse, two_sided, is_point) = (1.0 / lamp.area, lamp.two_sided, lamp.is_point);
        for i in 0..LANES {
            let is_own = places.lamp[i] == number;
            let density = &mut places.density[i];
            *density = select_unpredictable(is_own, chance[i] * inverse, *density);
            places.two_sided[i] = select_unpredictable(is_own, two_sided, places.two_sided[i]);
            places.is_point[i] = select_unpredictable(is_own, is_point, places.is_point[i]);
        }
    }
    places
}
