//! The lights of a plain scene in single precision, and places that are chosen on them.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use std::f32::consts::FRAC_1_PI;
use std::hint::select_unpredictable;

use etendue_geometry::block::{Floats as Row, LANES};
use etendue_geometry::glam::DVec3;

use super::depart::cosine_directions;
use super::kernel::{Hits, ZERO, round, single};
use super::sky::PlainSky;
use crate::area_light::AreaLight;
use crate::light_tree::Choices;
use crate::lights;
use crate::reference::SceneView;
use crate::sampling::{GridCell, sphere_direction};

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
        let ([corner, rest], [along, across]) = (own.corner, own.shape.edges);
        Self {
            corner: single((corner - origin) + rest),
            edges: [single(along), single(across)],
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
    /// All of them, and the sum of the chances of all before each with 1 at the end, where they are few points and
    /// triangles that are alike from everywhere; else each point chooses among all ([`lights::Lights::pick`]).
    few: Vec<Lamp>,
    few_bands: Vec<f64>,
    below: Vec<f32>,
    pub(super) sky: Option<PlainSky<'a>>,
    /// All are far away.
    pub(super) are_far: bool,
    /// What blocks' coordinates are relative to (m).
    pub(super) origin: DVec3,
    /// Of lights whose rays carry their radiance.
    ones: Vec<f64>,
}

impl<'a> Lights<'a> {
    pub(super) fn new(all: &'a lights::Lights, origin: DVec3, count: usize) -> Self {
        let (few, few_bands) = (Vec::new(), Vec::new());
        let sky = PlainSky::of(all, count);
        let are_far = all.plain_lights().is_some_and(|bounds| bounds.are_far);
        let (below, ones) = (Vec::new(), vec![1.0; count]);
        let mut own = Self { all, few, few_bands, below, sky, are_far, origin, ones };
        if let Some(below) = all.few().filter(|_| !all.has_others()) {
            own.few = (0..all.count()).map(|number| own.lamp(number)).collect();
            let bands = (0..all.count()).flat_map(|number| own.bands_of(number));
            own.few_bands = bands.copied().collect();
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
        if number >= SKY as usize {
            return Lamp { area: 1.0, ..Lamp::default() };
        }
        match self.all.plain_light(number) {
            Some(lights::PlainLight::Point(at)) => Lamp::point(at, self.origin),
            Some(lights::PlainLight::Triangle(own)) => Lamp::triangle(own, self.origin),
            None => Lamp::default(),
        }
    }

    /// Radiance of a triangle or the sky, intensity of a point; 1 of other lights, whose rays carry it.
    #[inline(always)]
    pub(super) fn radiance(&self, lamp: u32, count: usize) -> &[f64] {
        if lamp >= SKY {
            let sky = self.sky.as_ref().filter(|_| lamp == SKY);
            return sky.map_or(&*self.ones, |sky| sky.bands);
        }
        let first = lamp as usize * count;
        let kept = self.few_bands.get(first..first + count);
        kept.unwrap_or_else(|| self.bands_of(lamp as usize))
    }

    /// The group of a light, or of the sky.
    #[inline(always)]
    pub(super) fn group_of(&self, scene: &SceneView<'_>, lamp: u32) -> u32 {
        if lamp == SKY {
            self.all.group_of_sky()
        } else {
            self.all.group_of_any(scene, lamp & !OTHER)
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

/// Lights that are chosen by where paths are: for points side by side, and by lane.
#[derive(Debug, Default)]
pub(in crate::transport) struct ChosenLamps {
    pub(super) choices: Choices,
    /// The lane of each choice.
    pub(super) asking: Vec<u32>,
    /// Where each is that chooses, from the blocks' origin (m); empty where no light is [`OTHER`].
    pub(super) points: [Vec<f32>; 3],
    pub(super) lamp: Vec<u32>,
    /// 0 where none was chosen.
    pub(super) chance: Vec<f32>,
    /// Of [`OTHER`] lights: where they are from the blocks' origin (m), or unit directions to them, their density, and
    /// their radiance.
    pub(super) place: [Vec<f32>; 3],
    pub(super) density: Vec<f32>,
    radiance: Vec<Vec<f32>>,
    /// That of one light, by band.
    pub(super) light: Vec<f64>,
    pub(super) is_far: Vec<f32>,
    pub(super) is_delta: Vec<f32>,
    /// The lanes that chose the sky's image with which chances, by which squares, and the patches of the image.
    pub(super) of_sky: Vec<(u32, f32)>,
    pub(super) squares: Vec<[f64; 2]>,
    pub(super) cells: Vec<GridCell>,
    /// With which the sky is chosen in each lane; empty without one.
    pub(super) sky_chance: Vec<f32>,
}

/// A place on a light of any kind, or a direction to it.
pub(super) struct OtherPlace {
    pub(super) light: u32,
    /// From the blocks' origin (m), or unit.
    pub(super) place: [f32; 3],
    pub(super) is_far: bool,
    pub(super) is_delta: bool,
    /// As [`crate::target::Target::density`].
    pub(super) density: f32,
}

impl ChosenLamps {
    /// Empties it for so many lanes and bands, of which some may choose other lights, the sky among them.
    pub(super) fn restart(
        &mut self,
        (room, count): (usize, usize),
        [has_others, has_sky]: [bool; 2],
    ) {
        let Self { lamp, chance, density, place, radiance, is_far, is_delta, .. } = self;
        self.light.resize(count, 0.0);
        radiance.resize(count, Vec::new());
        lamp.clear();
        lamp.resize(room, 0);
        chance.clear();
        chance.resize(room, 0.0);
        self.asking.resize(room, 0);
        if has_others {
            let rows = place.iter_mut().chain(radiance).chain(&mut self.points);
            rows.chain([density, is_far, is_delta]).for_each(|row| row.resize(room, 0.0));
        }
        self.sky_chance.resize(if has_sky { room } else { 0 }, 0.0);
        self.of_sky.clear();
        self.squares.clear();
    }

    /// Notes what a lane chose, which brings so much of each band.
    #[inline(always)]
    pub(super) fn put(&mut self, lane: usize, own: &OtherPlace, radiance: &[f64]) {
        self.lamp[lane] = OTHER | own.light;
        for axis in 0..3 {
            self.place[axis][lane] = own.place[axis];
        }
        for (row, band) in self.radiance.iter_mut().zip(radiance) {
            row[lane] = round(*band);
        }
        self.density[lane] = own.density;
        self.is_far[lane] = f32::from(u8::from(own.is_far));
        self.is_delta[lane] = f32::from(u8::from(own.is_delta));
    }
}

/// Places on lights, one for each of sixteen points. Flags are 1 where they hold, else 0.
pub(super) struct Places {
    /// From the point (m).
    pub(super) way: [Row; 3],
    pub(super) normal: [Row; 3],
    /// What its own numbers add to the rounding of the place (m).
    pub(super) magnitudes: [Row; 3],
    /// Of the place (1/m²), of the direction (1/sr).
    pub(super) density: Row,
    pub(super) two_sided: Row,
    /// No direction comes upon it by chance.
    pub(super) is_delta: Row,
    pub(super) lamp: [u32; LANES],
}

/// What places on lights have beyond those on triangles and on points that shine alike to all sides.
#[derive(Debug)]
pub(super) struct OtherPlaces {
    /// It is a direction.
    pub(super) is_far: Row,
    /// It shines to the side of its normal alone, as triangles do, unless they shine to both.
    pub(super) has_side: Row,
    has_others: bool,
}

impl Places {
    fn nowhere() -> Self {
        Self {
            way: [ZERO; 3],
            normal: [ZERO; 3],
            magnitudes: [ZERO; 3],
            density: ZERO,
            two_sided: ZERO,
            is_delta: ZERO,
            lamp: [0; LANES],
        }
    }
}

/// Places on the lamps that sixteen points chose, by what was left of the numbers that chose them and others.
#[inline(always)]
pub(super) fn place_on_chosen(
    (lights, chosen): (&Lights<'_>, &ChosenLamps),
    points: &[Row; 3],
    (square, first): (&[Row; 2], usize),
) -> Places {
    let run = first..first + LANES;
    let lamps: &[u32; LANES] = chosen.lamp[run.clone()].try_into().unwrap_or(&[0; LANES]);
    let chance: &Row = chosen.chance[run.clone()].try_into().unwrap_or(&ZERO);
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
        places.is_delta[i] = lamp.is_point;
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

impl OtherPlaces {
    /// Puts the places and directions of lanes that chose other lights in place of what is there.
    #[inline(always)]
    pub(super) fn of<const TILTED: bool>(
        chosen: Option<&ChosenLamps>,
        hits: &Hits,
        (square, first): (&[Row; 2], usize),
        places: &mut Places,
    ) -> Self {
        let mut has_side = ZERO;
        for i in 0..LANES {
            has_side[i] = 1.0 - places.is_delta[i];
        }
        let mut others = Self { is_far: ZERO, has_side, has_others: false };
        let Some(chosen) = chosen else { return others };
        let (mut is_other, mut is_sky) = (false, false);
        for i in 0..LANES {
            is_other |= places.lamp[i] >= OTHER;
            is_sky |= places.lamp[i] == SKY;
        }
        let run = first..first + LANES;
        others.has_others = is_other;
        if is_other {
            others.take_others(chosen, &hits.point, run.clone(), places);
        }
        if is_sky {
            let chance = chosen.chance[run].try_into().unwrap_or(&ZERO);
            others.take_sky(chance, hits.shading::<TILTED>(), square, places);
        }
        others
    }

    /// Takes directions to a sky that is alike all over, by their cosines with the normals.
    #[inline(always)]
    fn take_sky(
        &mut self,
        chance: &Row,
        shading: &[Row; 3],
        square: &[Row; 2],
        places: &mut Places,
    ) {
        let (mut directions, mut density) = cosine_directions(shading, square);
        for i in 0..LANES {
            // To where light comes from both sides any direction is as likely.
            if shading[0][i] == 0.0 && shading[1][i] == 0.0 && shading[2][i] == 0.0 {
                let square = [square[0][i], square[1][i]].map(f64::from);
                let direction = single(sphere_direction(square));
                for axis in 0..3 {
                    directions[axis][i] = direction[axis];
                }
                density[i] = 0.25 * FRAC_1_PI;
            }
        }
        for i in 0..LANES {
            let is_own = places.lamp[i] == SKY;
            for axis in 0..3 {
                let way = &mut places.way[axis][i];
                *way = if is_own { directions[axis][i] } else { *way };
            }
            places.density[i] = if is_own { chance[i] * density[i] } else { places.density[i] };
            self.is_far[i] = if is_own { 1.0 } else { self.is_far[i] };
            self.has_side[i] = if is_own { 0.0 } else { self.has_side[i] };
        }
    }

    /// A band of [`OTHER`] lights that lanes chose, and 1 of all else.
    #[inline(always)]
    pub(super) fn radiance(
        &self,
        (chosen, first): (&ChosenLamps, usize),
        lamps: &[u32; LANES],
        band: usize,
    ) -> Row {
        let mut radiance = [1.0; LANES];
        if self.has_others {
            let own = &chosen.radiance[band][first..first + LANES];
            for i in 0..LANES {
                radiance[i] = if lamps[i] >= OTHER { own[i] } else { 1.0 };
            }
        }
        radiance
    }

    /// Takes places on [`OTHER`] lights, and directions to them.
    #[inline(always)]
    fn take_others(
        &mut self,
        chosen: &ChosenLamps,
        points: &[Row; 3],
        run: std::ops::Range<usize>,
        places: &mut Places,
    ) {
        let row = |column: &[f32]| -> Row { column[run.clone()].try_into().unwrap_or(ZERO) };
        let (density, is_far) = (row(&chosen.density), row(&chosen.is_far));
        let is_delta = row(&chosen.is_delta);
        for axis in 0..3 {
            let place = row(&chosen.place[axis]);
            for i in 0..LANES {
                let is_own = places.lamp[i] >= OTHER;
                let way = if is_far[i] > 0.0 { place[i] } else { place[i] - points[axis][i] };
                places.way[axis][i] = if is_own { way } else { places.way[axis][i] };
                places.normal[axis][i] = if is_own { 0.0 } else { places.normal[axis][i] };
                places.magnitudes[axis][i] = if is_own { 0.0 } else { places.magnitudes[axis][i] };
            }
        }
        for i in 0..LANES {
            let is_own = places.lamp[i] >= OTHER;
            places.density[i] = if is_own { density[i] } else { places.density[i] };
            places.is_delta[i] = if is_own { is_delta[i] } else { places.is_delta[i] };
            self.is_far[i] = if is_own { is_far[i] } else { 0.0 };
            self.has_side[i] = if is_own { 0.0 } else { self.has_side[i] };
        }
    }
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
        let (inverse, two_sided) = (1.0 / lamp.area, lamp.two_sided);
        let is_point = lamp.is_point;
        for i in 0..LANES {
            let is_own = places.lamp[i] == number;
            let density = &mut places.density[i];
            *density = select_unpredictable(is_own, chance[i] * inverse, *density);
            places.two_sided[i] = select_unpredictable(is_own, two_sided, places.two_sided[i]);
            places.is_delta[i] = select_unpredictable(is_own, is_point, places.is_delta[i]);
        }
    }
    places
}
