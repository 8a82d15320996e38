//! Lights that paths choose by where they are, and places on those that need more than their place: lights that throw a
//! pattern, parallel light, skies, and surfaces that shine unevenly or move.

use etendue_geometry::MISS;
use etendue_geometry::block::LANES;
use etendue_geometry::glam::DVec3;

use super::Workspace;
use super::block_lights::{BlockLights, OTHER, SKY, flag};
use super::kernel::{ReceiverColumns, gather_receivers};
use super::lane::{Lane, round, single};
use super::sky::place_on_sky;
use super::surfaces::Surfaces;
use crate::light_sampler::LightQuery;
use crate::light_tree::Choices;
use crate::sampling::GridCell;
use crate::target::TargetKind;
use crate::transport::{Draw, Tracing};

/// Lights that are chosen by where paths are: for points side by side, and by lane.
#[derive(Debug, Default)]
pub(in crate::transport) struct ChosenLights<F> {
    pub(super) choices: Choices,
    /// The lane of each choice.
    pub(super) lanes: Vec<u32>,
    /// The place of each point that chooses, from the blocks' origin (m); empty where no light is [`OTHER`].
    pub(super) points: [Vec<F>; 3],
    pub(super) light: Vec<u32>,
    /// 0 where none was chosen.
    pub(super) chance: Vec<F>,
    /// Of [`OTHER`] lights: where they are from the blocks' origin (m), or unit directions to them, their density, and
    /// their radiance.
    pub(super) place: [Vec<F>; 3],
    pub(super) density: Vec<F>,
    pub(super) radiance: Vec<Vec<F>>,
    /// That of one light, by band.
    pub(super) bands: Vec<f64>,
    pub(super) is_far: Vec<F>,
    pub(super) is_delta: Vec<F>,
    /// Of those that are triangles their normals, what their numbers add to the rounding of the place (m), whether they are
    /// any, and whether they shine to both sides; empty where no light is one.
    pub(super) normal: [Vec<F>; 3],
    pub(super) magnitudes: [Vec<F>; 3],
    pub(super) has_side: Vec<F>,
    pub(super) two_sided: Vec<F>,
    /// The lanes that chose the sky's image with which chances, by which squares, and the patches of the image.
    pub(super) of_sky: Vec<(u32, F)>,
    pub(super) squares: Vec<[f64; 2]>,
    pub(super) cells: Vec<GridCell>,
    /// With which the sky is chosen in each lane; empty without one.
    pub(super) sky_chance: Vec<F>,
}

/// A place on a light of any kind, or a direction to it.
pub(super) struct OtherPlace<F> {
    pub(super) light: u32,
    /// From the blocks' origin (m), or unit.
    pub(super) place: [F; 3],
    pub(super) is_far: bool,
    pub(super) is_delta: bool,
    /// As [`crate::target::Target::density`].
    pub(super) density: F,
    /// Of a triangle.
    pub(super) side: Option<LightSide<F>>,
}

/// The sides of a triangle that shines, where a place on it was chosen.
pub(super) struct LightSide<F> {
    /// Unit, on the front.
    pub(super) normal: [F; 3],
    pub(super) magnitudes: [F; 3],
    pub(super) two_sided: bool,
}

impl<F: Lane> ChosenLights<F> {
    /// Empties it for so many lanes and bands, of which some may choose other lights, triangles and the sky among
    /// them.
    pub(super) fn restart(
        &mut self,
        room: usize,
        count: usize,
        [has_others, has_triangles, has_sky]: [bool; 3],
    ) {
        let Self { light, chance, density, place, radiance, is_far, is_delta, .. } = self;
        self.bands.resize(count, 0.0);
        radiance.resize(count, Vec::new());
        light.clear();
        light.resize(room, 0);
        chance.clear();
        chance.resize(room, F::ZERO);
        self.lanes.resize(room, 0);
        if has_others {
            let rows = place.iter_mut().chain(radiance).chain(&mut self.points);
            rows.chain([density, is_far, is_delta]).for_each(|row| row.resize(room, F::ZERO));
        }
        let of_triangles = if has_triangles { room } else { 0 };
        let rows = self.normal.iter_mut().chain(&mut self.magnitudes);
        let rows = rows.chain([&mut self.has_side, &mut self.two_sided]);
        rows.for_each(|row| row.resize(of_triangles, F::ZERO));
        self.sky_chance.resize(if has_sky { room } else { 0 }, F::ZERO);
        self.of_sky.clear();
        self.squares.clear();
    }

    /// Notes what a lane chose, which brings so much of each band.
    #[inline(always)]
    pub(super) fn put(&mut self, lane: usize, own: &OtherPlace<F>, radiance: &[f64]) {
        self.light[lane] = OTHER | own.light;
        for axis in 0..3 {
            self.place[axis][lane] = own.place[axis];
        }
        for (row, band) in self.radiance.iter_mut().zip(radiance) {
            row[lane] = round(*band);
        }
        self.density[lane] = own.density;
        self.is_far[lane] = flag(own.is_far);
        self.is_delta[lane] = flag(own.is_delta);
        let Some(has_side) = self.has_side.get_mut(lane) else { return };
        *has_side = flag(own.side.is_some());
        let Some(side) = &own.side else { return };
        for axis in 0..3 {
            self.normal[axis][lane] = side.normal[axis];
            self.magnitudes[axis][lane] = side.magnitudes[axis];
        }
        self.two_sided[lane] = flag(side.two_sided);
    }
}

/// A number in precision, which stays below 1.
fn below_one<F: Lane>(x: f64) -> F {
    let own = F::of(x);
    if own < F::ONE_BELOW { own } else { F::ONE_BELOW }
}

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Chooses one of many lights for each path that is scattered, and a place on those that need more than one.
    pub(super) fn choose_lights<F: Lane>(
        &self,
        surfaces: Surfaces<'_, F>,
        lights: &BlockLights<'_, F>,
        workspace: &mut Workspace<F>,
    ) {
        let Workspace { rays, carried, numbers, chosen, varied, singles, .. } = workspace;
        let surfaces = Surfaces { varied, ..surfaces };
        let [first, second] = &mut numbers[Draw::Light as usize];
        let room = first.len() + LANES;
        let has_others = self.ctx.lights.has_others();
        let has_triangles = self.ctx.lights.bounds().has_other_triangles;
        let has_sky = lights.sky.is_some();
        chosen.restart(room, self.count(), [has_others, has_triangles, has_sky]);
        if lights.are_far {
            self.choose_far(lights, workspace);
            return;
        }
        self.ctx.lights.restart(&mut chosen.choices, room);
        let gather = match (surfaces.all.are_tilted, surfaces.all.are_rich()) {
            (false, false) => gather_receivers::<F, false, false>,
            (false, true) => gather_receivers::<F, false, true>,
            (true, false) => gather_receivers::<F, true, false>,
            (true, true) => gather_receivers::<F, true, true>,
        };
        let receivers = ReceiverColumns {
            choices: &mut chosen.choices,
            lanes: &mut chosen.lanes,
            points: &mut chosen.points,
        };
        gather(surfaces, lights.origin, singles, rays.blocks(), carried, first, receivers);
        self.ctx.lights.pick(&mut chosen.choices);
        for number in 0..chosen.choices.len() {
            let (lane, choice) = (chosen.lanes[number] as usize, chosen.choices.get(number));
            // What is left of the number that chose the light chooses the place: both stay even.
            first[lane] = below_one(choice.u);
            if has_sky {
                let chance = self.ctx.lights.chance_of_sky(&chosen.choices, number);
                chosen.sky_chance[lane] = round(chance);
            }
            if has_others && self.ctx.lights.plain_light(choice.light as usize).is_none() {
                let [x, y, z] = &chosen.points;
                let point = DVec3::new(x[number].into(), y[number].into(), z[number].into());
                let (lane, square) = (chosen.lanes[number], [choice.u, second[lane].into()]);
                let time = self.time_of(carried.ray[lane as usize]);
                let query = LightQuery { from: lights.origin + point, time, choice, square };
                self.place_on_other(lights, chosen, lane, &query);
                continue;
            }
            (chosen.light[lane], chosen.chance[lane]) = (choice.light, round(choice.chance));
        }
        self.choose_sky(lights, chosen);
    }

    /// The same where all lights are far away: as likely from everywhere, and in the same direction.
    fn choose_far<F: Lane>(&self, lights: &BlockLights<'_, F>, workspace: &mut Workspace<F>) {
        let Workspace { rays, carried, numbers, chosen, .. } = workspace;
        let [first, second] = &mut numbers[Draw::Light as usize];
        for (lane, number) in (0_u32..).zip(0..carried.len) {
            let block = &rays.blocks()[number / LANES];
            if block.placement[number % LANES] == MISS {
                continue;
            }
            let choice = self.ctx.lights.pick_far(first[number].into());
            first[number] = below_one(choice.u);
            let square = [choice.u, second[number].into()];
            let time = self.time_of(carried.ray[number]);
            let query = LightQuery { from: DVec3::ZERO, time, choice, square };
            self.place_on_other(lights, chosen, lane, &query);
        }
        if lights.sky.is_some() {
            let chance = self.ctx.lights.chance_of_sky(&chosen.choices, 0);
            chosen.sky_chance.fill(round(chance));
        }
        self.choose_sky(lights, chosen);
    }

    /// Chooses a place on the light that a lane chose, which needs more than its place, or a direction to it; the
    /// directions to a sky are chosen later.
    fn place_on_other<F: Lane>(
        &self,
        lights: &BlockLights<'_, F>,
        chosen: &mut ChosenLights<F>,
        lane: u32,
        query: &LightQuery,
    ) {
        let choice = query.choice;
        if choice.chance <= 0.0 {
            return;
        }
        if let Some(sky) = lights.sky.filter(|sky| sky.index == choice.light as usize) {
            let chance = round(choice.chance);
            if sky.map.is_some() {
                chosen.squares.push(query.square);
                chosen.of_sky.push((lane, chance));
            } else {
                (chosen.light[lane as usize], chosen.chance[lane as usize]) = (SKY, chance);
            }
            return;
        }
        let (scene, spectral) = (&self.ctx.scene, self.ctx.spectral);
        let mut radiance = std::mem::take(&mut chosen.bands);
        let found = self.ctx.lights.place(scene, spectral, query, &mut radiance);
        if let Some(target) = found {
            let is_far = target.kind == TargetKind::Parallel;
            let is_delta = matches!(target.kind, TargetKind::Point | TargetKind::Parallel);
            let origin = if is_far { DVec3::ZERO } else { lights.origin };
            let [start, rest, across] = target.place;
            let place = single((start - origin) + rest + across);
            let side = match target.kind {
                TargetKind::Triangle { two_sided } => {
                    let (normal, magnitudes) = (single(target.normal), single(target.magnitudes));
                    Some(LightSide { normal, magnitudes, two_sided })
                }
                TargetKind::Point | TargetKind::Parallel => None,
            };
            let (light, density) = (choice.light, round(target.density));
            let own = OtherPlace { light, place, is_far, is_delta, density, side };
            chosen.put(lane as usize, &own, &radiance);
        }
        chosen.bands = radiance;
    }

    /// Chooses directions to the sky's image for the lanes that chose it.
    fn choose_sky<F: Lane>(&self, lights: &BlockLights<'_, F>, chosen: &mut ChosenLights<F>) {
        let Some(sky) = &lights.sky else { return };
        let Some((_, sampler)) = sky.map else { return };
        sampler.cells(chosen.squares.iter().copied(), &mut chosen.cells);
        place_on_sky::<F, RGB>(sky, self.ctx.spectral, chosen);
    }
}
