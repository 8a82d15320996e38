//! The lights of a scene in the precision of lanes, and places that are chosen on them.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use std::f64::consts::FRAC_1_PI;
use std::hint::select_unpredictable;

use etendue_geometry::block::{Floats as Row, LANES};
use etendue_geometry::glam::DVec3;

use super::choose::ChosenLights;
use super::depart::cosine_directions;
use super::lane::{Lane, round, single, wide};
use super::sky::SkyView;
use super::surfaces::Hits;
use crate::area_light::AreaLight;
use crate::lights;
use crate::reference::SceneView;
use crate::sampling::sphere_direction;

/// A triangle that shines, or a point, relative to the blocks' origin (m).
#[derive(Debug, Clone, Copy, Default)]
struct BlockLight<F> {
    corner: [F; 3],
    edges: [[F; 3]; 2],
    normal: [F; 3],
    magnitudes: [F; 3],
    /// m²; 1 of a point, whose density is that of its choice.
    area: F,
    /// 1 where it holds.
    two_sided: F,
    is_point: F,
}

impl<F: Lane> BlockLight<F> {
    fn point(at: DVec3, origin: DVec3) -> Self {
        Self { corner: single(at - origin), area: F::ONE, is_point: F::ONE, ..Self::default() }
    }

    fn triangle(own: &AreaLight, origin: DVec3) -> Self {
        let ([corner, rest], [along, across]) = (own.corner, own.shape.edges);
        Self {
            corner: single((corner - origin) + rest),
            edges: [single(along), single(across)],
            normal: single(own.shape.normal),
            magnitudes: single(own.magnitudes),
            area: round(own.shape.area),
            two_sided: flag(own.two_sided),
            is_point: F::ZERO,
        }
    }
}

/// The lights of a scene.
#[derive(Debug)]
pub(in crate::transport) struct BlockLights<'a, F> {
    all: &'a lights::Lights,
    /// All of them, and the sum of the chances of all before each with 1 at the end, where they are few points and
    /// triangles that are alike from everywhere; else each point chooses among all ([`lights::Lights::pick`]).
    few: Vec<BlockLight<F>>,
    few_bands: Vec<f64>,
    below: Vec<F>,
    pub(super) sky: Option<SkyView<'a>>,
    /// All are far away.
    pub(super) are_far: bool,
    /// The point that blocks' coordinates are relative to (m).
    pub(super) origin: DVec3,
    /// Of lights whose rays carry their radiance.
    ones: Vec<f64>,
}

impl<'a, F: Lane> BlockLights<'a, F> {
    pub(super) fn new(all: &'a lights::Lights, origin: DVec3, count: usize) -> Self {
        let (few, few_bands) = (Vec::new(), Vec::new());
        let sky = SkyView::of(all, count);
        let are_far = all.bounds().are_far;
        let (below, ones) = (Vec::new(), vec![1.0; count]);
        let mut own = Self { all, few, few_bands, below, sky, are_far, origin, ones };
        if let Some(below) = all.few().filter(|_| !all.has_others()) {
            own.few = (0..all.count()).map(|number| own.light(number)).collect();
            let bands = (0..all.count()).flat_map(|number| own.bands_of(number));
            own.few_bands = bands.copied().collect();
            own.below = below.iter().map(|&sum| round(sum)).collect();
        }
        own
    }

    /// True if each point chooses among all by where it is.
    pub(super) fn are_many(&self) -> bool {
        self.few.is_empty()
    }

    #[inline(always)]
    fn light(&self, number: usize) -> BlockLight<F> {
        if number >= SKY as usize {
            return BlockLight { area: F::ONE, ..BlockLight::default() };
        }
        match self.all.plain_light(number) {
            Some(lights::PlainLight::Point(at)) => BlockLight::point(at, self.origin),
            Some(lights::PlainLight::Triangle(own)) => BlockLight::triangle(own, self.origin),
            None => BlockLight::default(),
        }
    }

    /// Radiance of a triangle or the sky, intensity of a point; 1 of other lights, whose rays carry it.
    #[inline(always)]
    pub(super) fn radiance(&self, light: u32, count: usize) -> &[f64] {
        if light >= SKY {
            let sky = self.sky.as_ref().filter(|_| light == SKY);
            return sky.map_or(&*self.ones, |sky| sky.bands);
        }
        let first = light as usize * count;
        let kept = self.few_bands.get(first..first + count);
        kept.unwrap_or_else(|| self.bands_of(light as usize))
    }

    /// The group of a light, or of the sky.
    #[inline(always)]
    pub(super) fn group_of(&self, scene: &SceneView<'_>, light: u32) -> u32 {
        if light == SKY {
            self.all.group_of_sky()
        } else {
            self.all.group_of_any(scene, light & !OTHER)
        }
    }

    #[inline(always)]
    fn bands_of(&self, number: usize) -> &'a [f64] {
        self.all.plain_light_bands(number, self.ones.len())
    }
}

/// The bit of the numbers of all lights but points that shine alike to all sides, triangles and [`SKY`].
pub(super) const OTHER: u32 = 1 << 31;

/// The number of a sky that is alike all over.
pub(super) const SKY: u32 = 1 << 30;

/// The light that a ray is sent to, by its number among all but [`SKY`].
pub(super) fn number_of_light(light: u32) -> usize {
    (light & !OTHER) as usize
}

/// Places on lights, one for each of sixteen points. Flags are 1 where they hold, else 0.
pub(super) struct Places<F> {
    /// From the point (m).
    pub(super) way: [Row<F>; 3],
    pub(super) normal: [Row<F>; 3],
    /// Magnitudes of its own numbers, which add to the rounding of the place (m).
    pub(super) magnitudes: [Row<F>; 3],
    /// Of the place (1/m²), of the direction (1/sr).
    pub(super) density: Row<F>,
    pub(super) two_sided: Row<F>,
    /// No direction comes upon it by chance.
    pub(super) is_delta: Row<F>,
    pub(super) light: [u32; LANES],
}

/// Properties of places on lights beyond those on triangles and on points that shine alike to all sides.
#[derive(Debug)]
pub(super) struct OtherPlaces<F> {
    /// It is a direction.
    pub(super) is_far: Row<F>,
    /// It shines to the side of its normal alone, as triangles do, unless they shine to both.
    pub(super) has_side: Row<F>,
    has_others: bool,
}

impl<F: Lane> Places<F> {
    fn nowhere() -> Self {
        Self {
            way: [[F::ZERO; LANES]; 3],
            normal: [[F::ZERO; LANES]; 3],
            magnitudes: [[F::ZERO; LANES]; 3],
            density: [F::ZERO; LANES],
            two_sided: [F::ZERO; LANES],
            is_delta: [F::ZERO; LANES],
            light: [0; LANES],
        }
    }
}

/// Places on the lights that sixteen points chose, by what was left of the numbers that chose them and others.
#[inline(always)]
pub(super) fn place_on_chosen<F: Lane>(
    lights: &BlockLights<'_, F>,
    chosen: &ChosenLights<F>,
    points: &[Row<F>; 3],
    square: &[Row<F>; 2],
    first: usize,
) -> Places<F> {
    let run = first..first + LANES;
    let light: &[u32; LANES] = chosen.light[run.clone()].try_into().unwrap_or(&[0; LANES]);
    let chance: Row<F> = chosen.chance[run.clone()].try_into().unwrap_or([F::ZERO; LANES]);
    let mut places = Places { light: *light, ..Places::nowhere() };
    // What there is in memory of each.
    let (mut corner, mut edges, mut area) =
        ([[F::ZERO; LANES]; 3], [[[F::ZERO; LANES]; 3]; 2], [F::ZERO; LANES]);
    for i in 0..LANES {
        let own = lights.light(light[i] as usize);
        for axis in 0..3 {
            corner[axis][i] = own.corner[axis];
            edges[0][axis][i] = own.edges[0][axis];
            edges[1][axis][i] = own.edges[1][axis];
            places.normal[axis][i] = own.normal[axis];
            places.magnitudes[axis][i] = own.magnitudes[axis];
        }
        (area[i], places.two_sided[i]) = (own.area, own.two_sided);
        places.is_delta[i] = own.is_point;
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

impl<F: Lane> OtherPlaces<F> {
    /// Puts the places and directions of lanes that chose other lights in place of what is there.
    #[inline(always)]
    pub(super) fn of<const TILTED: bool>(
        chosen: Option<&ChosenLights<F>>,
        hits: &Hits<F>,
        square: &[Row<F>; 2],
        first: usize,
        places: &mut Places<F>,
    ) -> Self {
        let mut has_side = [F::ZERO; LANES];
        for i in 0..LANES {
            has_side[i] = F::ONE - places.is_delta[i];
        }
        let mut others = Self { is_far: [F::ZERO; LANES], has_side, has_others: false };
        let Some(chosen) = chosen else { return others };
        let (mut is_other, mut is_sky) = (false, false);
        for i in 0..LANES {
            is_other |= places.light[i] >= OTHER;
            is_sky |= places.light[i] == SKY;
        }
        let run = first..first + LANES;
        others.has_others = is_other;
        if is_other {
            others.take_others(chosen, &hits.point, run.clone(), places);
        }
        if is_sky {
            let chance: Row<F> = chosen.chance[run].try_into().unwrap_or([F::ZERO; LANES]);
            others.take_sky(&chance, hits.shading::<TILTED>(), square, places);
        }
        others
    }

    /// Takes directions to a sky that is alike all over, by their cosines with the normals.
    #[inline(always)]
    fn take_sky(
        &mut self,
        chance: &Row<F>,
        shading: &[Row<F>; 3],
        square: &[Row<F>; 2],
        places: &mut Places<F>,
    ) {
        let (mut directions, mut density) = cosine_directions(shading, square);
        for i in 0..LANES {
            // To where light comes from both sides any direction is as likely.
            if shading[0][i] == F::ZERO && shading[1][i] == F::ZERO && shading[2][i] == F::ZERO {
                let square = [square[0][i], square[1][i]].map(wide);
                let direction = single(sphere_direction(square));
                for axis in 0..3 {
                    directions[axis][i] = direction[axis];
                }
                density[i] = F::of(0.25 * FRAC_1_PI);
            }
        }
        for i in 0..LANES {
            let is_own = places.light[i] == SKY;
            for axis in 0..3 {
                let way = &mut places.way[axis][i];
                *way = if is_own { directions[axis][i] } else { *way };
            }
            places.density[i] = if is_own { chance[i] * density[i] } else { places.density[i] };
            self.is_far[i] = if is_own { F::ONE } else { self.is_far[i] };
            self.has_side[i] = if is_own { F::ZERO } else { self.has_side[i] };
        }
    }

    /// A band of [`OTHER`] lights that lanes chose, and 1 of all else.
    #[inline(always)]
    pub(super) fn radiance(
        &self,
        chosen: &ChosenLights<F>,
        first: usize,
        light: &[u32; LANES],
        band: usize,
    ) -> Row<F> {
        let mut radiance = [F::ONE; LANES];
        if self.has_others {
            let own = &chosen.radiance[band][first..first + LANES];
            for i in 0..LANES {
                radiance[i] = if light[i] >= OTHER { own[i] } else { F::ONE };
            }
        }
        radiance
    }

    /// Takes places on [`OTHER`] lights, and directions to them.
    #[inline(always)]
    fn take_others(
        &mut self,
        chosen: &ChosenLights<F>,
        points: &[Row<F>; 3],
        run: std::ops::Range<usize>,
        places: &mut Places<F>,
    ) {
        let row =
            |column: &[F]| -> Row<F> { column[run.clone()].try_into().unwrap_or([F::ZERO; LANES]) };
        let (density, is_far) = (row(&chosen.density), row(&chosen.is_far));
        let is_delta = row(&chosen.is_delta);
        for axis in 0..3 {
            let place = row(&chosen.place[axis]);
            for i in 0..LANES {
                let is_own = places.light[i] >= OTHER;
                let way = if is_far[i] > F::ZERO { place[i] } else { place[i] - points[axis][i] };
                places.way[axis][i] = if is_own { way } else { places.way[axis][i] };
                places.normal[axis][i] = if is_own { F::ZERO } else { places.normal[axis][i] };
                places.magnitudes[axis][i] =
                    if is_own { F::ZERO } else { places.magnitudes[axis][i] };
            }
        }
        for i in 0..LANES {
            let is_own = places.light[i] >= OTHER;
            places.density[i] = if is_own { density[i] } else { places.density[i] };
            places.is_delta[i] = if is_own { is_delta[i] } else { places.is_delta[i] };
            self.is_far[i] = if is_own { is_far[i] } else { F::ZERO };
            self.has_side[i] = if is_own { F::ZERO } else { self.has_side[i] };
        }
        if !chosen.has_side.is_empty() {
            self.take_sides(chosen, run, places);
        }
    }

    /// Takes the sides of places on triangles among them.
    #[inline(always)]
    fn take_sides(
        &mut self,
        chosen: &ChosenLights<F>,
        run: std::ops::Range<usize>,
        places: &mut Places<F>,
    ) {
        let row =
            |column: &[F]| -> Row<F> { column[run.clone()].try_into().unwrap_or([F::ZERO; LANES]) };
        let (has_side, two_sided) = (row(&chosen.has_side), row(&chosen.two_sided));
        let takes = |light: u32, has_side: F| (light >= OTHER) & (has_side > F::ZERO);
        for axis in 0..3 {
            let (normal, magnitudes) = (row(&chosen.normal[axis]), row(&chosen.magnitudes[axis]));
            let (normals, more) = (&mut places.normal[axis], &mut places.magnitudes[axis]);
            for i in 0..LANES {
                let is_own = takes(places.light[i], has_side[i]);
                normals[i] = if is_own { normal[i] } else { normals[i] };
                more[i] = if is_own { magnitudes[i] } else { more[i] };
            }
        }
        for i in 0..LANES {
            let is_own = takes(places.light[i], has_side[i]);
            places.two_sided[i] = if is_own { two_sided[i] } else { places.two_sided[i] };
            self.has_side[i] = if is_own { F::ONE } else { self.has_side[i] };
        }
    }
}

/// 1 where something holds, else 0.
pub(super) fn flag<F: Lane>(holds: bool) -> F {
    if holds { F::ONE } else { F::ZERO }
}

/// Weights of the second and third corner by squares, uniform over triangles.
#[inline(always)]
fn corner_weights<F: Lane>([u, v]: &[Row<F>; 2]) -> [Row<F>; 2] {
    let (mut second, mut third) = ([F::ZERO; LANES], [F::ZERO; LANES]);
    for i in 0..LANES {
        let root = u[i].sqrt();
        second[i] = root * (F::ONE - v[i]);
        third[i] = v[i] * root;
    }
    [second, third]
}

/// Chooses one of few lights for each of sixteen points, and a place on it.
#[inline(always)]
pub(super) fn place<F: Lane>(
    lights: &BlockLights<'_, F>,
    points: &[Row<F>; 3],
    [mut u, v]: [Row<F>; 2],
) -> Places<F> {
    let mut places = Places::nowhere();
    let below = &*lights.below;
    let mut chance = [F::ONE; LANES];
    if lights.few.len() > 1 {
        let (mut start, mut end) = ([F::ZERO; LANES], [F::ONE; LANES]);
        for (number, ends) in (0_u32..).zip(below.windows(2)) {
            let (from, to) = (ends[0], ends[1]);
            for i in 0..LANES {
                let is_in = (from <= u[i]) & (from < to);
                start[i] = select_unpredictable(is_in, from, start[i]);
                end[i] = select_unpredictable(is_in, to, end[i]);
                places.light[i] = select_unpredictable(is_in, number, places.light[i]);
            }
        }
        for i in 0..LANES {
            chance[i] = end[i] - start[i];
            let rest = (u[i] - start[i]) / chance[i];
            let rest = if rest > F::ZERO { rest } else { F::ZERO };
            u[i] = if rest < F::ONE_BELOW { rest } else { F::ONE_BELOW };
        }
    }
    let [second, third] = corner_weights(&[u, v]);
    for (number, light) in (0_u32..).zip(&lights.few) {
        for axis in 0..3 {
            let (corner, normal) = (light.corner[axis], light.normal[axis]);
            let (along, across) = (light.edges[0][axis], light.edges[1][axis]);
            let magnitude = light.magnitudes[axis];
            let (way, normals) = (&mut places.way[axis], &mut places.normal[axis]);
            let magnitudes = &mut places.magnitudes[axis];
            for i in 0..LANES {
                let is_own = places.light[i] == number;
                let there = (corner - points[axis][i]) + (along * second[i] + across * third[i]);
                way[i] = select_unpredictable(is_own, there, way[i]);
                normals[i] = select_unpredictable(is_own, normal, normals[i]);
                magnitudes[i] = select_unpredictable(is_own, magnitude, magnitudes[i]);
            }
        }
        let (inverse, two_sided) = (F::ONE / light.area, light.two_sided);
        let is_point = light.is_point;
        for i in 0..LANES {
            let is_own = places.light[i] == number;
            let density = &mut places.density[i];
            *density = select_unpredictable(is_own, chance[i] * inverse, *density);
            places.two_sided[i] = select_unpredictable(is_own, two_sided, places.two_sided[i]);
            places.is_delta[i] = select_unpredictable(is_own, is_point, places.is_delta[i]);
        }
    }
    places
}
