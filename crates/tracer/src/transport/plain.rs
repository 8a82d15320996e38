//! Plain scenes: surfaces that are wholly there and part no media or wavelengths, under lights of all kinds, few or many,
//! in any bands. All of a step is done on blocks of sixteen paths in single precision, whose numbers stay in registers
//! between the hit and the rays that leave it; facets are worked out in double precision, and what is neither matte nor of
//! facets nor smooth is hit by hit.
//!
//! The estimators, and the random numbers by use, are those of the other scenes ([`super::trace`]): pictures are the
//! same up to the roundings of single precision. What is rare, such as the light of a lamp that is met, is done there.

mod ask;
mod choose;
mod compaction;
mod depart;
mod facets;
mod kernel;
mod lamps;
mod single;
mod sky;
mod surfaces;
mod varied;

use std::ops::RangeInclusive;

use etendue_geometry::block::{Floats, LANES};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{HitPrecision, RayBlocks};

use self::facets::BlockFacets;
use self::kernel::{Leaving, Numbers, leave_blocks};
use self::lamps::{ChosenLamps, Lights};
use self::single::SingleHits;
use self::sky::ask_sky;
use self::surfaces::{Surfaces, Varied};
use super::paths::{DRAWS, Draw, Step, Way, Workspace};
use super::rays::{Blocks, RayHit};
use super::trace::Encounter;
use super::{LightingContext, RaySamples, Tracing};
use crate::emitters::Emitters;
use crate::light_sampler::Receiver;
use crate::lights::PlainLightBounds;
use crate::sky::Sky;

/// Single precision holds squares of lengths, and densities over areas, of scenes between these sizes (m).
pub(crate) const SIZES: [f64; 2] = [1e-6, 1e9];

/// The least area of a lamp over the square of the scene's size that it holds.
const LEAST_AREA: f64 = 1e-12;

/// Largest bands of lights whose light single precision holds, however near or far they are (W/sr, W/m² or
/// W/(m² sr)).
const BRIGHTNESS: RangeInclusive<f64> = 1e-12..=1e18;

/// What sixteen and more paths carry, a column a number; behind the last there is room for a block.
#[derive(Debug, Default)]
pub(super) struct Columns {
    pub(super) len: usize,
    pub(super) ray: Vec<u32>,
    /// Density (1/sr) of the direction, unused of the camera's.
    pub(super) pdf: Vec<f32>,
    /// By band.
    pub(super) throughput: Vec<Vec<f32>>,
    /// The normal of the surface that each left, where there are many lamps; unused of the camera's.
    pub(super) normal: [Vec<f32>; 3],
    /// The chance with which the sky was chosen there; unused of the camera's, and without a sky.
    pub(super) sky_chance: Vec<f32>,
    /// What each stands for where it starts, if that is more than a point: a width (m), and by how much that grows per
    /// length. Unused of the camera's, and where no surface is smooth or all are alike all over.
    pub(super) cone: [Vec<f32>; 2],
    /// [`SPECULAR`] and [`LAST`]; empty where no surface is smooth.
    pub(super) flags: Vec<u32>,
}

/// A path came by a mirror or a smooth boundary: no light was asked in its stead.
const SPECULAR: u32 = 1;

/// A path looks for light and goes no farther.
const LAST: u32 = 2;

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
    /// Last directions that ask what shines first.
    last: RayColumns,
    shadow_rays: RayBlocks,
    numbers: [[Vec<f32>; 2]; DRAWS as usize],
    chosen: ChosenLamps,
    /// Hits on what shines, and rays that met nothing.
    seen: Vec<u32>,
    missed: Vec<u32>,
    facets: BlockFacets,
    colors: Vec<Floats>,
    shares: Vec<Floats>,
    singles: SingleHits,
    varied: Varied,
    /// When rays are (s from the frame's time), where that counts.
    times: Vec<f64>,
}

impl Columns {
    /// How many bands there are.
    #[inline(always)]
    pub(super) fn count<const RGB: bool>(&self) -> usize {
        if RGB { 3 } else { self.throughput.len() }
    }

    /// Makes room for at least so many of so many bands; whether surfaces may be smooth.
    fn reserve(&mut self, (len, count): (usize, usize), are_smooth: bool) {
        self.throughput.resize(count, Vec::new());
        let len = len.next_multiple_of(LANES) + LANES;
        if are_smooth {
            grow(&mut self.flags, len);
        } else {
            self.flags.clear();
        }
        grow(&mut self.ray, len);
        grow(&mut self.pdf, len);
        grow(&mut self.sky_chance, len);
        let rows = self.throughput.iter_mut().chain(&mut self.normal).chain(&mut self.cone);
        rows.for_each(|row| grow(row, len));
    }
}

/// Makes a column at least so long.
fn grow<T: Copy + Default>(column: &mut Vec<T>, len: usize) {
    if column.len() < len {
        column.resize(len, T::default());
    }
}

impl RayColumns {
    fn restart(&mut self, most: (usize, usize), are_smooth: bool) {
        self.len = 0;
        self.carried.reserve(most, are_smooth);
        let len = self.carried.ray.len();
        for axis in self.start.iter_mut().chain(&mut self.along) {
            grow(axis, len);
        }
        grow(&mut self.reach, len);
        grow(&mut self.left, len);
        grow(&mut self.lamp, len);
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
        let is_taken = self.ctx.precision == HitPrecision::Single
            && !(traits.may_pass() || traits.has_media || traits.has_panes)
            && !traits.has_dispersion
            && lights.sky.as_ref().is_none_or(Sky::is_of_colors);
        let all = placed.plain().filter(|_| is_taken)?;
        let surfaces = Surfaces { all, geometry: scene.geometry, varied: Varied::NONE };
        let origin = self.ctx.accel.blocks()?.origin();
        let PlainLightBounds { least_area, farthest, brightest, .. } = lights.plain_lights()?;
        let least = LEAST_AREA * placed.size().powi(2);
        let are_near = 2.0 * (farthest + origin.abs().max_element()) < SIZES[1];
        let is_held = brightest == 0.0 || BRIGHTNESS.contains(&brightest);
        let are_taken = least_area > least && are_near && is_held && !lights.is_dark();
        are_taken.then(|| (surfaces, Lights::new(lights, origin, self.count())))
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
        let are_smooth = surfaces.all.are_smooth;
        start(camera, self.count(), are_smooth, &mut plain.carried);
        let mut coherent = camera.rays.coherent;
        let mut is_scattered = true;
        for number in 0..=self.rules.bounces {
            let len = plain.rays.len();
            if len == 0 {
                break;
            }
            self.times_of(&plain.carried.ray[..len], &mut plain.times);
            accel.closest_of_blocks(plain.rays.blocks_mut(), &plain.times, coherent);
            self.tally.rays += len as u64;
            is_scattered &= number < self.rules.bounces;
            self.leave_plain((camera, number), (surfaces, lights), is_scattered, plain);
            self.carry_cones((camera, number), surfaces.all, plain);
            self.meet_plain(number, plain, workspace, out);
            self.add_sky_plain((camera, number), lights, plain, out);
            let nothing_else = self.ctx.emitters.is_some_and(Emitters::is_empty);
            if let Some(sky) = lights.sky.filter(|_| nothing_else) {
                ask_sky::<RGB>(&sky, self.ctx.spectral, &mut plain.last, &mut plain.shadows);
            }
            self.light_plain(plain, lights, (number, coherent), out);
            self.ask_emitters_plain(camera, number, plain, workspace, out);
            // Last directions that do not ask what shines are followed as the others are.
            is_scattered &= !self.is_end_unless_specular(number) || are_smooth;
            plain.next.pack(&mut plain.rays);
            std::mem::swap(&mut plain.carried, &mut plain.next.carried);
            plain.carried.len = plain.next.len;
            coherent = false;
        }
    }

    /// Notes the rays that leave the hits of a step, where these scatter light.
    fn leave_plain(
        &self,
        (camera, number): (&RaySamples<'_>, u32),
        (surfaces, lights): (Surfaces<'_>, &Lights<'_>),
        is_scattered: bool,
        plain: &mut PlainScratch,
    ) {
        let (len, all) = (plain.rays.len(), surfaces.all);
        // Last directions may become rays to the sky.
        let count = self.count();
        plain.shadows.restart((2 * len, count), all.are_smooth);
        plain.next.restart((len, count), all.are_smooth);
        plain.last.restart((len, count), all.are_smooth);
        plain.seen.clear();
        plain.missed.clear();
        let is_last = self.is_end_unless_specular(number);
        // Nobody comes upon points.
        let goes_on = !is_last || self.ctx.lights.is_hittable();
        let roulette = !is_last && self.rules.roulette.is_some_and(|after| number + 1 >= after);
        if is_scattered {
            self.look_up_varied((camera, number), surfaces, plain);
            let needs = [goes_on || all.are_smooth, roulette, all.are_rich()];
            self.draw_plain(camera, number, needs, plain);
            if lights.are_many() {
                self.choose_lamps((surfaces, lights), plain);
            }
        }
        let surfaces = Surfaces { varied: &plain.varied, ..surfaces };
        let chosen = lights.are_many().then_some(&plain.chosen);
        let emitters = self.ctx.emitters.map(|emitters| emitters.sphere(lights.origin));
        let (asks_emitters, drawn) = (emitters.is_some(), &plain.numbers);
        let numbers =
            Numbers { is_scattered, goes_on, roulette, is_last, asks_emitters, drawn, chosen };
        let has_environment = self.ctx.lights.has_environment();
        let leaving = Leaving {
            shadows: &mut plain.shadows,
            next: &mut plain.next,
            last: &mut plain.last,
            seen: &mut plain.seen,
            missed: has_environment.then_some(&mut plain.missed),
            facets: &mut plain.facets,
            singles: &mut plain.singles,
            colors: &mut plain.colors,
            shares: &mut plain.shares,
        };
        let sphere = emitters.filter(|_| is_last && !has_environment);
        let is_rich = all.are_rich() || self.ctx.lights.has_others();
        let leave = match (all.are_tilted, is_rich) {
            (false, false) => leave_blocks::<false, false, RGB>,
            (false, true) => leave_blocks::<false, true, RGB>,
            (true, false) => leave_blocks::<true, false, RGB>,
            (true, true) => leave_blocks::<true, true, RGB>,
        };
        let paths = (plain.rays.blocks(), &plain.carried);
        leave((self, surfaces, lights), paths, (numbers, sphere), leaving);
    }

    /// When a ray of the camera is (s from the frame's time).
    #[inline(always)]
    fn time_of(&self, ray: u32) -> f64 {
        self.times.get(ray as usize).copied().unwrap_or(0.0)
    }

    /// The times of some rays of the camera, where that counts; else none.
    fn times_of(&self, rays: &[u32], times: &mut Vec<f64>) {
        times.clear();
        if !self.times.is_empty() && self.ctx.accel.blocks().is_some_and(|own| own.has_times()) {
            times.extend(rays.iter().map(|&ray| self.time_of(ray)));
        }
    }

    /// Draws what a step needs for all lanes.
    fn draw_plain(
        &self,
        camera: &RaySamples<'_>,
        number: u32,
        [goes_on, roulette, has_choice]: [bool; 3],
        plain: &mut PlainScratch,
    ) {
        let rays = &plain.carried.ray[..plain.rays.len()];
        let padded = rays.len().next_multiple_of(LANES);
        for (draw, needs) in [
            (Draw::Choice, has_choice),
            (Draw::Light, true),
            (Draw::Direction, goes_on),
            (Draw::Chance, roulette),
        ] {
            if needs {
                let drawn = &mut plain.numbers[draw as usize];
                let pair = number * DRAWS + draw as u32;
                camera.samples.floats_of_pair(rays, pair, drawn);
                drawn.iter_mut().for_each(|half| half.resize(padded, 0.5));
            }
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
        let Columns { ray, pdf, throughput, normal, flags, .. } = &plain.carried;
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
                time: self.time_of(ray[i]),
            };
            // Few lamps are chosen with the same chance for all points.
            let own = normal.each_ref().map(|axis| f64::from(axis[i]));
            let receiver = Receiver { point: from, normal: own.into() };
            let encounter = Encounter { hit, ray: (from, vector(&block.direction)), receiver };
            let way = match number {
                0 => Way::CAMERA,
                _ if flags.get(i).is_some_and(|flags| flags & SPECULAR != 0) => Way::CAMERA,
                _ => Way { pdf: f64::from(pdf[i]), is_specular: false, ..Way::CAMERA },
            };
            let light = &mut workspace.radiance;
            let Some(weight) = self.light_of_hit(&encounter, way, || None, light) else { continue };
            for (light, band) in light.iter_mut().zip(throughput) {
                *light *= f64::from(band[i]) * weight;
            }
            let group = || self.ctx.lights.group_of_placement(&self.ctx.scene, hit.id[0]);
            let row = self.parts.row(ray[i], number, group);
            self.add(&workspace.radiance, row, out);
        }
    }

    /// Adds what lamps bring along shadow rays that nothing blocks.
    fn light_plain(
        &mut self,
        plain: &mut PlainScratch,
        lights: &Lights<'_>,
        (number, coherent): (u32, bool),
        out: &mut [f64],
    ) {
        let PlainScratch { shadows, shadow_rays, times, .. } = plain;
        let Some(accel) = self.ctx.accel.blocks().filter(|_| shadows.len > 0) else { return };
        self.tally.shadow_rays += shadows.len as u64;
        shadows.pack(shadow_rays);
        self.times_of(&shadows.carried.ray[..shadows.len], times);
        accel.occluded_of_blocks(shadow_rays.blocks_mut(), times, coherent);
        let (count, mut three) = (self.count(), [0.0; 3]);
        let mut more = if RGB { Vec::new() } else { vec![0.0; count] };
        let light: &mut [f64] = if RGB { &mut three } else { &mut more };
        let shares = &shadows.carried.throughput[..count];
        for (block, first) in shadow_rays.blocks().iter().zip((0..).step_by(LANES)) {
            for lane in 0..LANES.min(shadows.len - first) {
                if block.is_blocked(lane) {
                    continue;
                }
                let i = first + lane;
                let radiance = &lights.radiance(shadows.lamp[i], count)[..count];
                for band in 0..count {
                    light[band] = f64::from(shares[band][i]) * radiance[band];
                }
                let group = || lights.group_of(&self.ctx.scene, shadows.lamp[i]);
                let row = self.parts.row(shadows.carried.ray[i], number + 1, group);
                self.add(light, row, out);
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
        let (last, onward) = (&plain.last, &mut workspace.onward);
        if last.len == 0 {
            return;
        }
        onward.last.clear();
        onward.of_last.clear();
        let origin = self.ctx.accel.blocks().map_or(DVec3::ZERO, |blocks| blocks.origin());
        for i in 0..last.len {
            let vector = |axes: &[Vec<f32>; 3]| {
                DVec3::from_array(axes.each_ref().map(|axis| f64::from(axis[i])))
            };
            onward.last.push(origin + vector(&last.start), vector(&last.along).normalize());
            let left = last.left[i] as usize;
            let (block, lane) = (&plain.rays.blocks()[left / LANES], left % LANES);
            let of_last = &mut onward.of_last;
            of_last.left.push([block.placement[lane], block.triangle[lane]]);
            of_last.ray.push(last.carried.ray[i]);
            of_last.ways.push(Way {
                pdf: f64::from(last.carried.pdf[i]),
                is_specular: false,
                is_last: true,
                normal: last.carried.normal.each_ref().map(|axis| axis[i]),
            });
            of_last
                .throughput
                .extend(last.carried.throughput.iter().map(|band| f64::from(band[i])));
        }
        let step = Step { camera, number, asks_emitters: true, is_mixed: false };
        self.ask_emitters(&step, workspace, out);
    }
}

/// The camera's rays as paths.
fn start(camera: &RaySamples<'_>, count: usize, are_smooth: bool, carried: &mut Columns) {
    let len = camera.rays.len();
    carried.reserve((len, count), are_smooth);
    carried.flags.fill(SPECULAR);
    carried.len = len;
    for (number, ray) in (0..).zip(&mut carried.ray) {
        *ray = number;
    }
    for (k, band) in carried.throughput.iter_mut().enumerate() {
        band.fill(if camera.bands.contains(&k) { 1.0 } else { 0.0 });
    }
}
