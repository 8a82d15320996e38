//! The lights of a plain scene in single precision, and places that are chosen on them.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use etendue_geometry::block::{Floats as Row, LANES};
use etendue_geometry::glam::DVec3;

use super::kernel::{Hits, Stage, ZERO, double, round, single};
use crate::area_light::AreaLight;
use crate::light::{Light, LightKind};
use crate::light_sampler::{Choices, Receiver};
use crate::lights::Lights;
use crate::sky::Asked;
use crate::target::{Chosen, Target, TargetKind};

/// The largest number below 1.
const ONE_BELOW: f32 = 1.0 - f32::EPSILON / 2.0;

/// A triangle that shines alike all over, or a point, relative to the blocks' origin (m).
#[derive(Debug, Clone, Copy)]
struct Lamp {
    corner: [f32; 3],
    edges: [[f32; 3]; 2],
    normal: [f32; 3],
    magnitudes: [f32; 3],
    /// m²; 1 of a point, whose density is that of its choice.
    area: f32,
    two_sided: bool,
    is_point: bool,
    /// It is neither: places on it are chosen one by one, in double precision.
    is_other: bool,
}

impl Lamp {
    const OTHER: Self = Self {
        corner: [0.0; 3],
        edges: [[0.0; 3]; 2],
        normal: [0.0; 3],
        magnitudes: [0.0; 3],
        area: 1.0,
        two_sided: false,
        is_point: false,
        is_other: true,
    };

    fn bare(light: &Light, origin: DVec3) -> Self {
        match &light.kind {
            LightKind::Point(at) => Self {
                corner: single(*at - origin),
                area: 1.0,
                is_point: true,
                is_other: false,
                ..Self::OTHER
            },
            LightKind::Spot { .. }
            | LightKind::Directional { .. }
            | LightKind::Projector(_)
            | LightKind::Goniometric(_)
            | LightKind::Environment { .. } => Self::OTHER,
        }
    }

    fn triangle(own: Option<&AreaLight>, origin: DVec3) -> Self {
        let Some(own) = own.filter(|own| own.is_plain) else { return Self::OTHER };
        let [corner, rest] = own.corner;
        Self {
            corner: single((corner - origin) + rest),
            edges: own.shape.edges.map(single),
            normal: single(own.shape.normal),
            magnitudes: single(own.magnitudes),
            area: round(own.shape.area),
            two_sided: own.two_sided,
            is_point: false,
            is_other: false,
        }
    }
}

/// The lights of a plain scene, by their numbers.
#[derive(Debug)]
pub(super) struct Lamps {
    lamps: Vec<Lamp>,
    /// The sum of the chances of all before each, and 1 at the end, where they are few, points and triangles alone;
    /// else empty.
    below: Vec<f32>,
    /// Radiance of triangles, intensity of points; and behind the last, 1 for those whose light goes with the ray.
    pub(super) radiance: Vec<[f64; 3]>,
}

impl Lamps {
    pub(super) fn new(lights: &Lights, origin: DVec3) -> Self {
        let bare = lights.bare();
        let triangles = lights.ready_triangles().unwrap_or_default();
        let lamps: Vec<_> = bare
            .iter()
            .map(|light| Lamp::bare(light, origin))
            .chain(triangles.iter().map(|own| Lamp::triangle(own.as_ref(), origin)))
            .collect();
        let of_bare = (0..bare.len()).map(|number| lights.bands_of(number, 3));
        let of_triangles = lights.bands_of_triangles(3);
        let band = |bands: &[f64]| [0, 1, 2].map(|k: usize| bands.get(k).copied().unwrap_or(0.0));
        let radiance = of_bare.chain(of_triangles).map(band).chain([[1.0; 3]]).collect();
        let few = lights.few().filter(|_| !lamps.iter().any(|lamp| lamp.is_other));
        let below = few.unwrap_or_default().iter().map(|&sum| round(sum)).collect();
        Self { lamps, below, radiance }
    }

    /// The number of a light whose radiance goes with the ray.
    #[expect(clippy::cast_possible_truncation, reason = "lights are counted in 32 bits")]
    fn apart(&self) -> u32 {
        self.lamps.len() as u32
    }
}

/// What choosing lights needs, kept between blocks.
#[derive(Debug, Default)]
pub(in crate::transport) struct Asking {
    choices: Choices,
    asked: Asked,
}

/// Places on lights, one for each of sixteen points.
pub(super) struct Places {
    /// From the point (m); the unit direction of what is far away.
    pub(super) way: [Row; 3],
    pub(super) normal: [Row; 3],
    /// What its own numbers add to the rounding of the place (m).
    pub(super) magnitudes: [Row; 3],
    /// Of the place (1/m²), of the direction (1/sr), or of a point the chance; +∞ where nothing was chosen.
    pub(super) density: Row,
    pub(super) two_sided: [bool; LANES],
    /// It has no normal: it is a point, or far away.
    pub(super) is_bare: [bool; LANES],
    pub(super) is_far: [bool; LANES],
    /// No direction comes upon it by chance.
    pub(super) is_delta: [bool; LANES],
    pub(super) lamp: [u32; LANES],
    /// What goes with the rays to lights that are neither points nor triangles of one colour, where there are such.
    pub(super) light: Option<[Row; 3]>,
}

impl Places {
    const NONE: Self = Self {
        way: [ZERO; 3],
        normal: [ZERO; 3],
        magnitudes: [ZERO; 3],
        density: [f32::INFINITY; LANES],
        two_sided: [false; LANES],
        is_bare: [false; LANES],
        is_far: [false; LANES],
        is_delta: [false; LANES],
        lamp: [0; LANES],
        light: None,
    };

    /// Sets that of a lane, which is seen from a point (m).
    fn set(&mut self, lane: usize, target: &Target, from: DVec3) {
        let [place, rest, across] = target.place;
        self.is_far[lane] = matches!(target.kind, TargetKind::Far | TargetKind::Parallel);
        self.is_delta[lane] = matches!(target.kind, TargetKind::Point | TargetKind::Parallel);
        self.is_bare[lane] = !matches!(target.kind, TargetKind::Triangle { .. });
        self.two_sided[lane] = target.kind == TargetKind::Triangle { two_sided: true };
        let way = if self.is_far[lane] { place } else { ((place - from) + rest) + across };
        let (way, normal, magnitudes) =
            (single(way), single(target.normal), single(target.magnitudes));
        for axis in 0..3 {
            self.way[axis][lane] = way[axis];
            self.normal[axis][lane] = normal[axis];
            self.magnitudes[axis][lane] = magnitudes[axis];
        }
        self.density[lane] = round(target.density);
    }

    /// Sets what goes with a lane's ray.
    fn set_light(&mut self, lane: usize, apart: u32, radiance: &[f64]) {
        self.lamp[lane] = apart;
        let light = self.light.get_or_insert([[1.0; LANES]; 3]);
        light.iter_mut().zip(radiance).for_each(|(row, &band)| row[lane] = round(band));
    }
}

/// Chooses a light for each of sixteen hits that asks one, and a place on it.
#[inline(always)]
pub(super) fn place(
    stage: &Stage<'_>,
    hits: &Hits,
    square: [Row; 2],
    asking: &mut Asking,
) -> Places {
    match stage.plain.lamps.below.is_empty() {
        false => place_on_few(&stage.plain.lamps, &hits.point, square),
        true => choose(stage, hits, square, asking),
    }
}

/// The same where lights are few.
#[inline(always)]
fn place_on_few(lamps: &Lamps, points: &[Row; 3], [mut u, v]: [Row; 2]) -> Places {
    let mut places = Places::NONE;
    let below = &*lamps.below;
    let mut chance = [1.0; LANES];
    if lamps.lamps.len() > 1 {
        let (mut start, mut end) = (ZERO, [1.0; LANES]);
        for (number, of_lamp) in (0_u32..).zip(below.windows(2)) {
            for i in 0..LANES {
                let is_in = (of_lamp[0] <= u[i]) & (of_lamp[0] < of_lamp[1]);
                start[i] = if is_in { of_lamp[0] } else { start[i] };
                end[i] = if is_in { of_lamp[1] } else { end[i] };
                places.lamp[i] = if is_in { number } else { places.lamp[i] };
            }
        }
        for i in 0..LANES {
            chance[i] = end[i] - start[i];
            let rest = (u[i] - start[i]) / chance[i];
            let rest = if rest > 0.0 { rest } else { 0.0 };
            u[i] = if rest < ONE_BELOW { rest } else { ONE_BELOW };
        }
    }
    let (second, third) = over_triangle(&u, &v);
    for (number, lamp) in (0_u32..).zip(&lamps.lamps) {
        for axis in 0..3 {
            let (corner, normal) = (lamp.corner[axis], lamp.normal[axis]);
            let (along, across) = (lamp.edges[0][axis], lamp.edges[1][axis]);
            for i in 0..LANES {
                let is_own = places.lamp[i] == number;
                let there = (corner - points[axis][i]) + (along * second[i] + across * third[i]);
                places.way[axis][i] = if is_own { there } else { places.way[axis][i] };
                places.normal[axis][i] = if is_own { normal } else { places.normal[axis][i] };
                let magnitudes = &mut places.magnitudes[axis][i];
                *magnitudes = if is_own { lamp.magnitudes[axis] } else { *magnitudes };
            }
        }
        let inverse = 1.0 / lamp.area;
        for i in 0..LANES {
            let is_own = places.lamp[i] == number;
            places.density[i] = if is_own { chance[i] * inverse } else { places.density[i] };
            places.two_sided[i] = if is_own { lamp.two_sided } else { places.two_sided[i] };
            places.is_bare[i] = if is_own { lamp.is_point } else { places.is_bare[i] };
        }
    }
    places.is_delta = places.is_bare;
    places
}

/// Weights of a triangle's second and third corner by squares, uniform over it
/// ([`crate::sampling::triangle_point`]).
#[inline(always)]
fn over_triangle(u: &Row, v: &Row) -> (Row, Row) {
    let (mut second, mut third) = (ZERO, ZERO);
    for i in 0..LANES {
        let root = u[i].sqrt();
        second[i] = root * (1.0 - v[i]);
        third[i] = v[i] * root;
    }
    (second, third)
}

/// The same where lights are many, or of other kinds.
#[inline(always)]
fn choose(
    stage: &Stage<'_>,
    hits: &Hits,
    [mut u, v]: [Row; 2],
    Asking { choices, asked }: &mut Asking,
) -> Places {
    let (lamps, lights) = (&stage.plain.lamps, stage.ctx.lights);
    choices.all.clear();
    asked.clear();
    for lane in (0..LANES).filter(|&lane| hits.scatters[lane]) {
        let point = stage.plain.origin + double(&hits.point, lane);
        let receiver = Receiver { point, normal: double(&hits.shading, lane) };
        choices.push(receiver, f64::from(u[lane]));
    }
    lights.pick(choices);
    let mut places = Places::NONE;
    let (mut corner, mut edges) = ([ZERO; 3], [[ZERO; 3]; 2]);
    let mut others = [false; LANES];
    let picked = (0..LANES).filter(|&lane| hits.scatters[lane]).zip(&choices.all);
    for (lane, choice) in picked.clone().filter(|(_, choice)| choice.chance > 0.0) {
        let Some(lamp) = lamps.lamps.get(choice.light).filter(|lamp| !lamp.is_other) else {
            others[lane] = true;
            continue;
        };
        // What is left of the number that chose the light chooses the place: both stay even.
        u[lane] = round(choice.u).min(ONE_BELOW);
        for axis in 0..3 {
            corner[axis][lane] = lamp.corner[axis];
            edges[0][axis][lane] = lamp.edges[0][axis];
            edges[1][axis][lane] = lamp.edges[1][axis];
            places.normal[axis][lane] = lamp.normal[axis];
            places.magnitudes[axis][lane] = lamp.magnitudes[axis];
        }
        places.density[lane] = round(choice.chance) / lamp.area;
        places.two_sided[lane] = lamp.two_sided;
        places.is_bare[lane] = lamp.is_point;
        places.lamp[lane] = u32::try_from(choice.light).unwrap_or(0);
    }
    places.is_delta = places.is_bare;
    let (second, third) = over_triangle(&u, &v);
    for axis in 0..3 {
        for i in 0..LANES {
            let across = edges[0][axis][i] * second[i] + edges[1][axis][i] * third[i];
            places.way[axis][i] = (corner[axis][i] - hits.point[axis][i]) + across;
        }
    }
    if others != [false; LANES] {
        let mut radiance = [0.0; 3];
        let image = lights.sky.as_ref().filter(|sky| sky.map.is_some()).map(|sky| sky.index);
        for (lane, choice) in picked.filter(|&(lane, _)| others[lane]) {
            if image == Some(choice.light) {
                asked.push(lane, [choice.u, f64::from(v[lane])], choice.chance);
                continue;
            }
            let one = ((choice.light, choice.chance), [choice.u, f64::from(v[lane])]);
            let (scene, spectral) = (&stage.ctx.scene, stage.ctx.spectral);
            match lights.place(scene, spectral, (&choice.receiver, 0.0), one, &mut radiance) {
                Chosen::Dark => {}
                Chosen::Place(target) => {
                    places.set(lane, &target, choice.receiver.point);
                    places.set_light(lane, lamps.apart(), &radiance);
                }
                Chosen::Sky { square, chance } => asked.push(lane, square, chance),
            }
        }
        ask_sky(stage, asked, &mut places);
    }
    places
}

/// Directions to the sky of the lanes that chose it.
fn ask_sky(stage: &Stage<'_>, asked: &mut Asked, places: &mut Places) {
    let lights = stage.ctx.lights;
    let Some(sky) = &lights.sky else { return };
    let (apart, mut radiance) = (stage.plain.lamps.apart(), [0.0; 3]);
    sky.choose(asked, |lane, (direction, density), there| {
        if density > 0.0 {
            let target = Target::bare(TargetKind::Far, direction, density);
            places.set(lane, &target, DVec3::ZERO);
            lights.spread_sky(stage.ctx.spectral, there, &mut radiance);
            places.set_light(lane, apart, &radiance);
        }
    });
}
