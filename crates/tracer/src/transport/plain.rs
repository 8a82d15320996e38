//! Plain scenes: matte surfaces of one colour each, flat or smooth, under lamps that stand still, few or many. All of a
//! step is done on blocks of sixteen paths in single precision, whose numbers stay in registers between the hit and the
//! rays that leave it.
//!
//! The estimators, and the random numbers by use, are those of the other scenes ([`super::trace`]): pictures are the
//! same up to the roundings of single precision. What is rare, such as the light of a lamp that is met, is done there.

mod compaction;
mod kernel;
mod lamps;
mod surfaces;

use etendue_geometry::block::LANES;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{HitPrecision, RayBlocks};

use self::kernel::{Leaving, Numbers, ask_for_lamps, leave_blocks};
use self::lamps::Lights;
use self::surfaces::Surfaces;
use super::paths::{DRAWS, Draw, Step, Way, Workspace};
use super::rays::{Blocks, RayHit};
use super::trace::Encounter;
use super::{LightingContext, Parts, RaySamples, Tracing};
use crate::light_sampler::Receiver;
use crate::light_tree::Choices;
use crate::lights::PlainLightBounds;

/// Single precision holds squares of lengths, and densities over areas, of scenes between these sizes (m).
pub(crate) const SIZES: [f64; 2] = [1e-6, 1e9];

/// The least area of a lamp over the square of the scene's size that it holds.
const LEAST_AREA: f64 = 1e-12;

/// What sixteen and more paths carry, a column a number; behind the last there is room for a block.
#[derive(Debug, Default)]
pub(super) struct Columns {
    pub(super) len: usize,
    pub(super) ray: Vec<u32>,
    /// Density (1/sr) of the direction, unused of the camera's.
    pub(super) pdf: Vec<f32>,
    pub(super) throughput: [Vec<f32>; 3],
    /// The normal of the surface that each left, where there are many lamps; unused of the camera's.
    pub(super) normal: [Vec<f32>; 3],
}

/// Rays that leave a block's hits, a column a number, with room for a block behind the last.
#[derive(Debug, Default)]
pub(super) struct RayColumns {
    pub(super) len: usize,
    pub(super) start: [Vec<f32>; 3],
    pub(super) along: [Vec<f32>; 3],
    pub(super) reach: Vec<f32>,
    /// The block's lane that each leaves, counted from the first block.
    pub(super) left: Vec<u32>,
    /// The lamp that each is sent to.
    pub(super) lamp: Vec<u32>,
    pub(super) carried: Columns,
}

/// Memory of one thread, kept between batches.
#[derive(Debug, Default)]
pub(super) struct PlainScratch {
    rays: RayBlocks,
    carried: Columns,
    shadows: RayColumns,
    next: RayColumns,
    shadow_rays: RayBlocks,
    numbers: [[Vec<f32>; 2]; DRAWS as usize],
    chosen: ChosenLamps,
    /// Hits on what shines.
    seen: Vec<u32>,
}

/// Lamps that are chosen by where paths are: for points side by side, and by lane.
#[derive(Debug, Default)]
struct ChosenLamps {
    choices: Choices,
    /// The lane of each choice.
    asking: Vec<u32>,
    lamp: Vec<u32>,
    /// 0 where none was chosen.
    chance: Vec<f32>,
}

impl Columns {
    fn resize(&mut self, len: usize) {
        let len = len.next_multiple_of(LANES) + LANES;
        self.ray.resize(len, 0);
        self.pdf.resize(len, 0.0);
        self.throughput.iter_mut().chain(&mut self.normal).for_each(|row| row.resize(len, 0.0));
    }
}

impl RayColumns {
    fn restart(&mut self, most: usize) {
        self.len = 0;
        self.carried.resize(most);
        let len = self.carried.ray.len();
        for axis in self.start.iter_mut().chain(&mut self.along) {
            axis.resize(len, 0.0);
        }
        self.reach.resize(len, 0.0);
        self.left.resize(len, 0);
        self.lamp.resize(len, 0);
    }

    /// The rays as blocks, which are refilled.
    fn pack(&self, blocks: &mut RayBlocks) {
        blocks.refill(self.len, |block, start, count| {
            let run = start..start + LANES;
            for axis in 0..3 {
                block.origin[axis].copy_from_slice(&self.start[axis][run.clone()]);
                block.direction[axis].copy_from_slice(&self.along[axis][run.clone()]);
            }
            block.t_max[..count].copy_from_slice(&self.reach[start..start + count]);
        });
    }
}

impl<'a, const RGB: bool> Tracing<'a, RGB> {
    /// The surfaces and lamps of a plain scene; `None` of any other.
    pub(super) fn plain(&self) -> Option<(Surfaces<'a>, Lights<'a>)> {
        let &LightingContext { lights, placed, traits, scene, .. } = self.ctx;
        let is_taken = RGB
            && self.ctx.precision == HitPrecision::Single
            && self.parts == Parts::Whole
            && self.times.is_empty()
            && traits.is_matte
            && !(traits.may_pass() || traits.has_media || traits.has_panes)
            && !lights.has_environment();
        let all = placed.plain().filter(|_| is_taken)?;
        let surfaces = Surfaces { all, geometry: scene.geometry, are_tilted: placed.are_tilted() };
        let origin = self.ctx.accel.blocks()?.origin();
        let PlainLightBounds { least_area, farthest } = lights.plain_lights()?;
        let least = LEAST_AREA * placed.size().powi(2);
        let are_near = 2.0 * (farthest + origin.abs().max_element()) < SIZES[1];
        let are_taken = least_area > least && are_near && !lights.is_dark();
        are_taken.then(|| (surfaces, Lights::new(lights, origin)))
    }

    /// Traces the camera's rays through a plain scene.
    pub(super) fn trace_plain(
        &mut self,
        camera: &RaySamples<'_>,
        (surfaces, lights): (Surfaces<'_>, &Lights<'_>),
        (plain, workspace): (&mut PlainScratch, &mut Workspace<Blocks>),
        out: &mut [f64],
    ) {
        let Some(accel) = self.ctx.accel.blocks() else { return };
        workspace.radiance.resize(self.count(), 0.0);
        accel.convert(camera.rays, &mut plain.rays);
        start(camera, &mut plain.carried);
        let mut coherent = camera.rays.coherent;
        let emitters = self.ctx.emitters.map(|emitters| emitters.sphere(lights.origin));
        let mut is_scattered = true;
        for number in 0..=self.rules.bounces {
            let len = plain.rays.len();
            if len == 0 {
                break;
            }
            accel.closest_of_blocks(plain.rays.blocks_mut(), &[], coherent);
            self.tally.rays += len as u64;
            is_scattered &= number < self.rules.bounces;
            let is_last = self.is_end_unless_specular(number);
            plain.shadows.restart(len);
            plain.next.restart(len);
            plain.seen.clear();
            // Nobody comes upon points.
            let goes_on = !is_last || self.ctx.lights.is_hittable();
            let roulette = !is_last && self.rules.roulette.is_some_and(|after| number + 1 >= after);
            if is_scattered {
                self.draw_plain(camera, number, [goes_on, roulette], plain);
                if lights.are_many() {
                    self.choose_lamps((surfaces, lights), plain);
                }
            }
            let ChosenLamps { lamp, chance, .. } = &plain.chosen;
            let chosen = lights.are_many().then_some((&**lamp, &**chance));
            let numbers =
                Numbers { is_scattered, goes_on, roulette, drawn: &plain.numbers, chosen };
            let leaving = Leaving {
                shadows: &mut plain.shadows,
                next: &mut plain.next,
                seen: &mut plain.seen,
            };
            let sphere = emitters.filter(|_| is_last);
            let leave =
                if surfaces.are_tilted { leave_blocks::<true> } else { leave_blocks::<false> };
            leave(
                (surfaces, lights),
                (plain.rays.blocks(), &plain.carried),
                (numbers, sphere),
                leaving,
            );
            self.meet_plain(number, plain, workspace, out);
            self.light_plain(plain, lights, coherent, out);
            if is_last && emitters.is_some() {
                self.ask_emitters_plain(camera, number, plain, workspace, out);
                break;
            }
            // Where much of the scene shines, last directions are followed as the others are.
            is_scattered &= !is_last;
            plain.next.pack(&mut plain.rays);
            std::mem::swap(&mut plain.carried, &mut plain.next.carried);
            plain.carried.len = plain.next.len;
            coherent = false;
        }
    }

    /// Draws what a step needs for all lanes.
    fn draw_plain(
        &self,
        camera: &RaySamples<'_>,
        number: u32,
        [goes_on, roulette]: [bool; 2],
        plain: &mut PlainScratch,
    ) {
        let rays = &plain.carried.ray[..plain.rays.len()];
        let padded = rays.len().next_multiple_of(LANES);
        for (draw, needs) in
            [(Draw::Light, true), (Draw::Direction, goes_on), (Draw::Chance, roulette)]
        {
            if needs {
                let drawn = &mut plain.numbers[draw as usize];
                let pair = number * DRAWS + draw as u32;
                camera.samples.floats_of_pair(rays, pair, drawn);
                drawn.iter_mut().for_each(|half| half.resize(padded, 0.5));
            }
        }
    }

    /// Chooses one of many lamps for each path that is scattered.
    fn choose_lamps(
        &self,
        (surfaces, lights): (Surfaces<'_>, &Lights<'_>),
        plain: &mut PlainScratch,
    ) {
        let PlainScratch { rays, carried, numbers, chosen, .. } = plain;
        let ChosenLamps { choices, asking, lamp, chance } = chosen;
        let [first, _] = &mut numbers[Draw::Light as usize];
        let room = first.len() + LANES;
        self.ctx.lights.restart(choices, room);
        asking.resize(room, 0);
        let ask = if surfaces.are_tilted { ask_for_lamps::<true> } else { ask_for_lamps::<false> };
        ask((surfaces, lights.origin), (rays.blocks(), carried), first, (choices, asking));
        self.ctx.lights.pick(choices);
        lamp.clear();
        lamp.resize(room, 0);
        chance.clear();
        chance.resize(room, 0.0);
        for (number, &lane) in asking[..choices.len()].iter().enumerate() {
            let (lane, choice) = (lane as usize, choices.get(number));
            (lamp[lane], chance[lane]) = (choice.light, kernel::round(choice.chance));
            // What is left of the number that chose the lamp chooses the place: both stay even.
            first[lane] = super::below_one(choice.u);
        }
    }

    /// Adds the light of lamps that paths met.
    fn meet_plain(
        &mut self,
        number: u32,
        plain: &PlainScratch,
        workspace: &mut Workspace<Blocks>,
        out: &mut [f64],
    ) {
        let Columns { ray, pdf, throughput, normal, .. } = &plain.carried;
        for &i in &plain.seen {
            let i = i as usize;
            let (block, lane) = (&plain.rays.blocks()[i / LANES], i % LANES);
            let vector = |axes| etendue_geometry::block::vector(axes, lane);
            let origin = self.ctx.accel.blocks().map_or(DVec3::ZERO, |blocks| blocks.origin());
            let from = origin + vector(&block.origin);
            let hit = RayHit {
                id: [block.placement[lane], block.triangle[lane]],
                weights: [block.u[lane], block.v[lane]].map(f64::from),
                t: f64::from(block.t_max[lane]),
                normal: vector(&block.normal).normalize(),
                time: 0.0,
            };
            // Few lamps are chosen with the same chance for all points.
            let own = normal.each_ref().map(|axis| f64::from(axis[i]));
            let receiver = Receiver { point: from, normal: own.into() };
            let encounter = Encounter { hit, ray: (from, vector(&block.direction)), receiver };
            let way = match number {
                0 => Way::CAMERA,
                _ => Way { pdf: f64::from(pdf[i]), is_specular: false, ..Way::CAMERA },
            };
            let light = &mut workspace.radiance;
            let Some(weight) = self.light_of_hit(&encounter, way, || None, light) else { continue };
            for (light, band) in light.iter_mut().zip(throughput) {
                *light *= f64::from(band[i]) * weight;
            }
            self.add(&workspace.radiance, ray[i], out);
        }
    }

    /// Adds what lamps bring along shadow rays that nothing blocks.
    fn light_plain(
        &mut self,
        plain: &mut PlainScratch,
        lights: &Lights<'_>,
        coherent: bool,
        out: &mut [f64],
    ) {
        let PlainScratch { shadows, shadow_rays, .. } = plain;
        let Some(accel) = self.ctx.accel.blocks().filter(|_| shadows.len > 0) else { return };
        self.tally.shadow_rays += shadows.len as u64;
        shadows.pack(shadow_rays);
        accel.occluded_of_blocks(shadow_rays.blocks_mut(), &[], coherent);
        let [red, green, blue] = &shadows.carried.throughput;
        for (number, block) in shadow_rays.blocks().iter().enumerate() {
            let first = number * LANES;
            for lane in 0..LANES.min(shadows.len - first) {
                if block.is_blocked(lane) {
                    continue;
                }
                let i = first + lane;
                let radiance = lights.radiance(shadows.lamp[i]);
                let light = [
                    f64::from(red[i]) * radiance[0],
                    f64::from(green[i]) * radiance[1],
                    f64::from(blue[i]) * radiance[2],
                ];
                self.add(&light, shadows.carried.ray[i], out);
            }
        }
    }

    /// Follows last directions, which are few: those that may meet what shines.
    fn ask_emitters_plain(
        &mut self,
        camera: &RaySamples<'_>,
        number: u32,
        plain: &PlainScratch,
        workspace: &mut Workspace<Blocks>,
        out: &mut [f64],
    ) {
        let (next, onward) = (&plain.next, &mut workspace.onward);
        onward.last.clear();
        onward.of_last.clear();
        let origin = self.ctx.accel.blocks().map_or(DVec3::ZERO, |blocks| blocks.origin());
        for i in 0..next.len {
            let vector = |axes: &[Vec<f32>; 3]| {
                DVec3::from_array(axes.each_ref().map(|axis| f64::from(axis[i])))
            };
            onward.last.push(origin + vector(&next.start), vector(&next.along).normalize());
            let left = next.left[i] as usize;
            let (block, lane) = (&plain.rays.blocks()[left / LANES], left % LANES);
            let of_last = &mut onward.of_last;
            of_last.left.push([block.placement[lane], block.triangle[lane]]);
            of_last.ray.push(next.carried.ray[i]);
            of_last.ways.push(Way {
                pdf: f64::from(next.carried.pdf[i]),
                is_specular: false,
                is_last: true,
                normal: next.carried.normal.each_ref().map(|axis| axis[i]),
            });
            of_last
                .throughput
                .extend(next.carried.throughput.iter().map(|band| f64::from(band[i])));
        }
        let step = Step { camera, number, asks_emitters: true, is_mixed: false };
        self.ask_emitters(&step, workspace, out);
    }
}

/// The camera's rays as paths.
fn start(camera: &RaySamples<'_>, carried: &mut Columns) {
    let len = camera.rays.len();
    carried.resize(len);
    carried.len = len;
    for (number, ray) in (0..).zip(&mut carried.ray) {
        *ray = number;
    }
    for (k, band) in carried.throughput.iter_mut().enumerate() {
        band.fill(if camera.bands.contains(&k) { 1.0 } else { 0.0 });
    }
}
