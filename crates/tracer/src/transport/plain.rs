//! Plain scenes: opaque surfaces, matte or rough sheets of facets, in red, green and blue, that stand still. All of a
//! step is done on blocks of sixteen paths in single precision, whose numbers stay in registers between the hit and the
//! rays that leave it; what differs from hit to hit, as textures do, is looked up first where a block has any.
//!
//! The estimators, and the random numbers by use, are those of the other scenes ([`super::trace`]): pictures are the
//! same up to the roundings of single precision. What is rare, such as the light of a lamp that is met, is done there.

mod ask;
mod columns;
mod kernel;
mod lamps;
mod scene;
mod surfaces;

use etendue_geometry::block::LANES;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{HitPrecision, RayBlocks};

use self::columns::{Columns, RayColumns};
use self::kernel::{BlockScratch, Leaving, Numbers, Sphere, Stage, leave_blocks};
pub use self::scene::PlainScene;
pub(crate) use self::scene::SIZES;
use super::paths::{DRAWS, Draw, Step, Way, Workspace};
use super::rays::{Blocks, RayHit};
use super::trace::Encounter;
use super::{Parts, RaySamples, Tracing};
use crate::footprint::Footprint;

/// Memory of one thread, kept between batches.
#[derive(Debug, Default)]
pub(super) struct PlainScratch {
    rays: RayBlocks,
    carried: Columns,
    shadows: RayColumns,
    next: RayColumns,
    shadow_rays: RayBlocks,
    numbers: [[Vec<f32>; 2]; DRAWS as usize],
    /// Hits on what shines, and rays that hit nothing.
    seen: Vec<u32>,
    missed: Vec<u32>,
    block: BlockScratch,
}

impl<'a, const RGB: bool> Tracing<'a, RGB> {
    /// The scene, if it is plain and so are the rays.
    pub(super) fn plain(&self) -> Option<&'a PlainScene> {
        let is_taken = self.ctx.precision == HitPrecision::Single
            && self.parts == Parts::Whole
            && self.times.is_empty();
        self.ctx.plain.filter(|_| is_taken)
    }

    /// Traces the camera's rays through a plain scene.
    pub(super) fn trace_plain(
        &mut self,
        camera: &RaySamples<'_>,
        scene: &PlainScene,
        (plain, workspace): (&mut PlainScratch, &mut Workspace<Blocks>),
        out: &mut [f64],
    ) {
        let Some(accel) = self.ctx.accel.blocks() else { return };
        workspace.radiance.resize(self.count(), 0.0);
        accel.convert(camera.rays, &mut plain.rays);
        plain.carried.start(camera);
        let mut coherent = camera.rays.coherent;
        // Last directions are followed to what they hit where what shines is not asked by itself.
        let mut is_over = false;
        for number in 0..=self.rules.bounces {
            if plain.rays.is_empty() {
                break;
            }
            accel.closest_of_blocks(plain.rays.blocks_mut(), &[], coherent);
            self.tally.rays += plain.rays.len() as u64;
            let is_scattered = !is_over && number < self.rules.bounces;
            self.step_plain(camera, (scene, number, is_scattered), plain);
            self.meet_plain(camera, number, plain, workspace, out);
            self.meet_sky(camera, number, plain, workspace, out);
            self.light_plain(plain, scene, coherent, out);
            is_over = self.is_end_unless_specular(number);
            if is_over && self.ctx.emitters.is_some() {
                self.ask_emitters_plain(camera, number, plain, workspace, out);
                break;
            }
            plain.next.pack(&mut plain.rays);
            std::mem::swap(&mut plain.carried, &mut plain.next.carried);
            plain.carried.len = plain.next.len;
            coherent = false;
        }
    }

    /// Notes the rays that leave the hits of all paths, which surfaces have scattered so often.
    fn step_plain(
        &self,
        camera: &RaySamples<'_>,
        (scene, number, is_scattered): (&PlainScene, u32, bool),
        plain: &mut PlainScratch,
    ) {
        let len = plain.rays.len();
        plain.shadows.restart(len);
        plain.next.restart(len);
        plain.seen.clear();
        plain.missed.clear();
        let is_last = self.is_end_unless_specular(number);
        // Nobody comes upon points.
        let goes_on = !is_last || self.ctx.lights.is_hittable();
        let roulette = !is_last && self.rules.roulette.is_some_and(|after| number + 1 >= after);
        if is_scattered {
            let has_choice = scene.has_sheets && goes_on;
            self.draw_plain(camera, number, [has_choice, goes_on, roulette], plain);
        }
        let numbers = Numbers { is_scattered, goes_on, roulette, drawn: &plain.numbers };
        let mut leaving = Leaving {
            shadows: &mut plain.shadows,
            next: &mut plain.next,
            seen: &mut plain.seen,
            missed: &mut plain.missed,
        };
        let stage =
            Stage { ctx: self.ctx, plain: scene, camera: (number == 0).then_some(camera.rays) };
        leave_blocks(
            &stage,
            (plain.rays.blocks(), &plain.carried),
            (&numbers, self.around_emitters(is_last, scene.origin)),
            &mut leaving,
            &mut plain.block,
        );
    }

    /// What last directions have to meet to be followed; `None` where they may meet anything.
    fn around_emitters(&self, is_last: bool, origin: DVec3) -> Option<Sphere> {
        let asks = is_last && !self.ctx.lights.has_environment();
        self.ctx.emitters.filter(|_| asks).map(|emitters| emitters.sphere(origin))
    }

    /// Draws what a step needs for all lanes.
    fn draw_plain(
        &self,
        camera: &RaySamples<'_>,
        number: u32,
        [has_choice, goes_on, roulette]: [bool; 3],
        plain: &mut PlainScratch,
    ) {
        let rays = &plain.carried.ray[..plain.rays.len()];
        let padded = rays.len().next_multiple_of(LANES);
        let needed = [
            (Draw::Choice, has_choice),
            (Draw::Light, true),
            (Draw::Direction, goes_on),
            (Draw::Chance, roulette),
        ];
        for (draw, needs) in needed {
            let drawn = &mut plain.numbers[draw as usize];
            if needs {
                let pair = number * DRAWS + draw as u32;
                camera.samples.floats_of_pair(rays, pair, drawn);
            }
            drawn.iter_mut().for_each(|half| half.resize(padded, 0.5));
        }
    }

    /// Adds the light of lamps that paths met.
    fn meet_plain(
        &mut self,
        camera: &RaySamples<'_>,
        number: u32,
        plain: &PlainScratch,
        workspace: &mut Workspace<Blocks>,
        out: &mut [f64],
    ) {
        let Columns { ray, throughput, .. } = &plain.carried;
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
            let way = way_of(&plain.carried, number, i);
            let receiver = way.receiver(from);
            let encounter = Encounter { hit, ray: (from, vector(&block.direction)), receiver };
            let footprint = || {
                let direction = camera.rays.direction(i);
                let hit = from + encounter.ray.1 * encounter.hit.t;
                let along = (hit - camera.rays.origin(i)).dot(direction);
                let cone = self.ctx.scene.view.cone(direction)?.after(along);
                Some(Footprint { direction, width: cone.width })
            };
            let footprint = || if number == 0 { footprint() } else { None };
            let light = &mut workspace.radiance;
            let Some(weight) = self.light_of_hit(&encounter, way, footprint, light) else {
                continue;
            };
            for (light, band) in light.iter_mut().zip(throughput) {
                *light *= f64::from(band[i]) * weight;
            }
            self.add(&workspace.radiance, ray[i], out);
        }
    }

    /// Adds the light of the sky, which paths met that hit nothing.
    fn meet_sky(
        &mut self,
        camera: &RaySamples<'_>,
        number: u32,
        plain: &PlainScratch,
        workspace: &mut Workspace<Blocks>,
        out: &mut [f64],
    ) {
        let lights = self.ctx.lights;
        let is_seen = lights.sky.as_ref().is_some_and(|sky| sky.visible || number > 0);
        if !is_seen || plain.missed.is_empty() {
            return;
        }
        let Columns { ray, throughput, .. } = &plain.carried;
        let origin = self.ctx.accel.blocks().map_or(DVec3::ZERO, |blocks| blocks.origin());
        let wanted = plain.missed.iter().map(|&i| {
            let i = i as usize;
            // The camera's rays are not all traced: those that cannot hit anything are other ones in blocks.
            if number == 0 {
                return (None, camera.rays.direction(i));
            }
            let (block, lane) = (&plain.rays.blocks()[i / LANES], i % LANES);
            let vector = |axes| etendue_geometry::block::vector(axes, lane);
            let receiver =
                way_of(&plain.carried, number, i).receiver(origin + vector(&block.origin));
            (Some(receiver), vector(&block.direction))
        });
        let Workspace { asked, radiance, .. } = workspace;
        lights.environment(self.ctx.spectral, wanted, asked, radiance, |k, of_sky, light| {
            let i = plain.missed[k] as usize;
            let weight = way_of(&plain.carried, number, i).weight_against(of_sky);
            for (light, band) in light.iter_mut().zip(throughput) {
                *light *= f64::from(band[i]) * weight;
            }
            self.add(light, ray[i], out);
        });
    }

    /// Adds what lights bring along shadow rays that nothing blocks.
    fn light_plain(
        &mut self,
        plain: &mut PlainScratch,
        scene: &PlainScene,
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
                let radiance = scene.lamps.radiance[shadows.lamp[i] as usize];
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
                normal: next.carried.normal(i),
            });
            of_last
                .throughput
                .extend(next.carried.throughput.iter().map(|band| f64::from(band[i])));
        }
        let step = Step { camera, number, asks_emitters: true, is_mixed: false };
        self.ask_emitters(&step, workspace, out);
    }
}

/// How a path came to its direction, after so many surfaces.
fn way_of(carried: &Columns, number: u32, i: usize) -> Way {
    match number {
        0 => Way::CAMERA,
        _ => Way {
            pdf: f64::from(carried.pdf[i]),
            is_specular: false,
            is_last: false,
            normal: carried.normal(i),
        },
    }
}
