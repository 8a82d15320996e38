//! Lights that paths choose by where they are, and places on those that need more than their place: lights that throw a
//! pattern, parallel light and skies.

use etendue_geometry::MISS;
use etendue_geometry::block::LANES;
use etendue_geometry::glam::DVec3;

use super::PlainScratch;
use super::kernel::{ask_for_lamps, round, single};
use super::lamps::{ChosenLamps, Lights, OtherPlace, SKY};
use super::sky::place_on_sky;
use super::surfaces::Surfaces;
use crate::light_sampler::Receiver;
use crate::light_tree::Choice;
use crate::target::{Chosen, TargetKind};
use crate::transport::Tracing;
use crate::transport::paths::Draw;

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Chooses one of many lights for each path that is scattered, and a place on those that need more than one.
    pub(super) fn choose_lamps(
        &self,
        (surfaces, lights): (Surfaces<'_>, &Lights<'_>),
        plain: &mut PlainScratch,
    ) {
        let PlainScratch { rays, carried, numbers, chosen, varied, singles, .. } = plain;
        let surfaces = Surfaces { varied, ..surfaces };
        let [first, second] = &mut numbers[Draw::Light as usize];
        let room = first.len() + LANES;
        let has_others = self.ctx.lights.has_others();
        let has_sky = lights.sky.is_some();
        chosen.restart((room, self.count()), [has_others, has_sky]);
        if lights.are_far {
            self.choose_far(lights, plain);
            return;
        }
        self.ctx.lights.restart(&mut chosen.choices, room);
        let ask = match (surfaces.all.are_tilted, surfaces.all.are_rich()) {
            (false, false) => ask_for_lamps::<false, false>,
            (false, true) => ask_for_lamps::<false, true>,
            (true, false) => ask_for_lamps::<true, false>,
            (true, true) => ask_for_lamps::<true, true>,
        };
        let asked = (&mut chosen.choices, &mut *chosen.asking, &mut chosen.points);
        ask((surfaces, lights.origin, singles), (rays.blocks(), carried), first, asked);
        self.ctx.lights.pick(&mut chosen.choices);
        for number in 0..chosen.choices.len() {
            let (lane, choice) = (chosen.asking[number] as usize, chosen.choices.get(number));
            // What is left of the number that chose the lamp chooses the place: both stay even.
            first[lane] = crate::transport::below_one(choice.u);
            if has_sky {
                let chance = self.ctx.lights.chance_of_sky(&chosen.choices, number);
                chosen.sky_chance[lane] = round(chance);
            }
            if has_others && self.ctx.lights.plain_light(choice.light as usize).is_none() {
                let [x, y, z] = &chosen.points;
                let point = DVec3::new(x[number].into(), y[number].into(), z[number].into());
                let (point, normal) = (lights.origin + point, chosen.choices.normal(number));
                let (lane, square) = (chosen.asking[number], [choice.u, second[lane].into()]);
                let receiver = Receiver { point, normal };
                let time = self.time_of(carried.ray[lane as usize]);
                self.place_on_other(lights, chosen, (lane, receiver, time), (choice, square));
                continue;
            }
            (chosen.lamp[lane], chosen.chance[lane]) = (choice.light, round(choice.chance));
        }
        self.choose_sky(lights, chosen);
    }

    /// The same where all lights are far away: as likely from everywhere, and in the same direction.
    fn choose_far(&self, lights: &Lights<'_>, plain: &mut PlainScratch) {
        let PlainScratch { rays, carried, numbers, chosen, .. } = plain;
        let [first, second] = &mut numbers[Draw::Light as usize];
        let receiver = Receiver { point: DVec3::ZERO, normal: DVec3::ZERO };
        for (lane, number) in (0_u32..).zip(0..carried.len) {
            let block = &rays.blocks()[number / LANES];
            if block.placement[number % LANES] == MISS {
                continue;
            }
            let choice = self.ctx.lights.pick_far(first[number].into());
            first[number] = crate::transport::below_one(choice.u);
            let square = [choice.u, second[number].into()];
            let time = self.time_of(carried.ray[number]);
            self.place_on_other(lights, chosen, (lane, receiver, time), (choice, square));
        }
        if lights.sky.is_some() {
            let chance = self.ctx.lights.chance_of_sky(&chosen.choices, 0);
            chosen.sky_chance.fill(round(chance));
        }
        self.choose_sky(lights, chosen);
    }

    /// Chooses a place on the light that a lane chose, which needs more than its place, or a direction to it; the
    /// directions to a sky are chosen later.
    fn place_on_other(
        &self,
        lights: &Lights<'_>,
        chosen: &mut ChosenLamps,
        (lane, receiver, time): (u32, Receiver, f64),
        (choice, square): (Choice, [f64; 2]),
    ) {
        if choice.chance <= 0.0 {
            return;
        }
        if let Some(sky) = lights.sky.filter(|sky| sky.index == choice.light as usize) {
            let chance = round(choice.chance);
            if sky.map.is_some() {
                chosen.squares.push(square);
                chosen.of_sky.push((lane, chance));
            } else {
                (chosen.lamp[lane as usize], chosen.chance[lane as usize]) = (SKY, chance);
            }
            return;
        }
        let one = ((choice.light as usize, choice.chance), square);
        let (scene, spectral) = (&self.ctx.scene, self.ctx.spectral);
        let mut radiance = std::mem::take(&mut chosen.light);
        let found = self.ctx.lights.place(scene, spectral, (&receiver, time), one, &mut radiance);
        if let Chosen::Place(target) = found {
            let is_far = matches!(target.kind, TargetKind::Far | TargetKind::Parallel);
            let is_delta = matches!(target.kind, TargetKind::Point | TargetKind::Parallel);
            let origin = if is_far { DVec3::ZERO } else { lights.origin };
            let (place, density) = (single(target.place[0] - origin), round(target.density));
            let own = OtherPlace { light: choice.light, place, is_far, is_delta, density };
            chosen.put(lane as usize, &own, &radiance);
        }
        chosen.light = radiance;
    }

    /// Chooses directions to the sky's image for the lanes that chose it.
    fn choose_sky(&self, lights: &Lights<'_>, chosen: &mut ChosenLamps) {
        let Some(sky) = &lights.sky else { return };
        let Some((_, sampler)) = sky.map else { return };
        sampler.cells(chosen.squares.iter().copied(), &mut chosen.cells);
        place_on_sky::<RGB>(sky, self.ctx.spectral, chosen);
    }
}
