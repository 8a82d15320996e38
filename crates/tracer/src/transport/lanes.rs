//! Scenes of matte surfaces alone, hit in single precision: paths in blocks of sixteen rays, as the accelerator
//! takes them, from the camera to the last light. All paths of a batch have met equally many surfaces, so what
//! a path remembers is three rows: its ray, the density of its direction and what it carries.
//!
//! The stages are loops over blocks: what is looked up for a hit is gathered first, arithmetic is done by the
//! [`kernels`] on local arrays, and what goes on is put side by side in new blocks.

use etendue_accel::BlockAccel;
use etendue_geometry::block::LANES as BLOCK;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{HitBatch, HitPrecision, RayBatch, RayBlocks};

use super::numbers::{DRAWS, Draw};
use super::patch::{LANES, Patch, Seen, at, put};
use super::{Follow, LightingContext, RaySamples, Samples, Scratch, Tracing, Traits, kernels};
use crate::Scattering;
use crate::footprint::{Cone, Footprint};
use crate::reference::SurfacePoint;
use crate::sampling::power_heuristic;
use crate::sky::Asked;
use crate::target::Chosen;

/// Paths under way that have met equally many surfaces.
#[derive(Debug, Default)]
struct Paths {
    rays: RayBlocks,
    carried: Carried,
}

/// What each path, or each ray to a light, brings.
#[derive(Debug, Default)]
struct Carried {
    /// The camera's ray; or the [row](super::Parts::row) that its light is added to.
    ray: Vec<u32>,
    /// Density (1/sr) of its direction; unused before the first surface.
    pdf: Vec<f64>,
    /// `[path][band]`.
    throughput: Vec<f64>,
}

impl Carried {
    fn clear(&mut self) {
        self.ray.clear();
        self.pdf.clear();
        self.throughput.clear();
    }
}

impl Paths {
    fn clear(&mut self) {
        self.rays.clear();
        self.carried.clear();
    }
}

/// Memory of one thread, kept between batches.
#[derive(Debug, Default)]
pub(super) struct LaneScratch {
    now: Paths,
    next: Paths,
    shadows: Paths,
    /// Last directions, which ask only what shines.
    last: RayBatch,
    of_last: Carried,
    hits: HitBatch,
    /// The camera's rays of the paths that go on, and their random numbers by use.
    alive: Vec<u32>,
    drawn: [Vec<[f64; 2]>; DRAWS as usize],
    /// Paths that met nothing.
    missed: Vec<u32>,
    picked: Vec<usize>,
}

/// What a patch of hits is worked on with.
struct Stage<'a> {
    blocks: &'a dyn BlockAccel,
    /// What coordinates of blocks are relative to (m).
    origin: DVec3,
    /// Surfaces that have scattered the paths.
    bounces: u32,
    /// The paths look for light after this surface and go no farther.
    ends: bool,
    /// Those ask only what shines.
    asks_emitters: bool,
}

/// What traces the scene in blocks, where all that it asks for is here.
pub(super) fn block_accel<'a>(stage: &LightingContext<'a>) -> Option<&'a dyn BlockAccel> {
    let Traits { has_alpha, has_panes, has_choice, has_media, has_nested, is_matte } = stage.traits;
    let is_plain = !(has_alpha || has_panes || has_choice || has_media || has_nested);
    let is_taken = is_matte && is_plain && stage.precision == HitPrecision::Single;
    stage.accel.blocks().filter(|_| is_taken)
}

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Traces `beam` in blocks.
    pub(super) fn trace_blocks(
        &mut self,
        blocks: &dyn BlockAccel,
        beam: &RaySamples<'_>,
        scratch: &mut Scratch,
        out: &mut [f64],
    ) {
        let Scratch { lanes, patch, asked, radiance, .. } = scratch;
        let count = self.count();
        self.start_blocks(blocks, beam, &mut lanes.now);
        let (mut bounces, mut coherent) = (0, beam.rays.coherent);
        let follows_none = self.rules.follow == Follow::Single;
        while !lanes.now.rays.is_empty() {
            blocks.closest_of_blocks(lanes.now.rays.blocks_mut(), coherent);
            self.tally.rays += lanes.now.rays.len() as u64;
            let stage = Stage {
                blocks,
                origin: blocks.origin(),
                bounces,
                ends: bounces + 1 >= self.rules.bounces || follows_none,
                asks_emitters: self.traces_emitters(),
            };
            self.met_by_blocks((&stage, beam), lanes, (asked, radiance), out);
            if bounces >= self.rules.bounces || (bounces > 0 && follows_none) {
                break;
            }
            self.draw_for_blocks(beam.samples, &stage, lanes);
            lanes.next.clear();
            lanes.shadows.clear();
            lanes.last.clear();
            lanes.of_last.clear();
            let mut k = 0;
            for first in (0..lanes.now.rays.len()).step_by(LANES) {
                self.step_blocks(&stage, lanes, patch, (first, &mut k), asked, beam);
            }
            self.shadows_of_blocks(blocks, &mut lanes.shadows, coherent, count, out);
            if stage.ends && stage.asks_emitters {
                self.ask_emitters(&stage, lanes, (asked, radiance), out);
            }
            std::mem::swap(&mut lanes.now, &mut lanes.next);
            (bounces, coherent) = (bounces + 1, false);
        }
    }

    fn start_blocks(&self, blocks: &dyn BlockAccel, beam: &RaySamples<'_>, paths: &mut Paths) {
        paths.clear();
        blocks.convert(beam.rays, &mut paths.rays);
        let Carried { ray, pdf, throughput } = &mut paths.carried;
        for i in 0..beam.rays.len() {
            ray.push(u32::try_from(i).unwrap_or(u32::MAX));
            pdf.push(f64::INFINITY);
            let bands = 0..self.count();
            throughput.extend(bands.map(|k| f64::from(u8::from(beam.bands.contains(&k)))));
        }
    }

    /// Adds the light that paths met by themselves, and lists those that go on.
    fn met_by_blocks(
        &mut self,
        (stage, beam): (&Stage<'_>, &RaySamples<'_>),
        lanes: &mut LaneScratch,
        (asked, radiance): (&mut Asked, &mut Vec<f64>),
        out: &mut [f64],
    ) {
        let LaneScratch { now, alive, missed, .. } = lanes;
        let LightingContext { lights, spectral, surroundings: around, .. } = self.stage;
        let (count, bounces) = (self.count(), stage.bounces);
        alive.clear();
        missed.clear();
        let lit = lights.sky.as_ref().is_some_and(|sky| sky.visible || bounces > 0);
        let Carried { ray, pdf, throughput } = &now.carried;
        let carried = |i: usize| &throughput[i * count..(i + 1) * count];
        for (number, block) in now.rays.blocks().iter().enumerate() {
            for lane in 0..BLOCK.min(now.rays.len() - number * BLOCK) {
                let i = number * BLOCK + lane;
                let Some(placed) = self.stage.placed.get(block.placement[lane]) else {
                    if lit {
                        missed.push(u32::try_from(i).unwrap_or(u32::MAX));
                    }
                    continue;
                };
                if placed.is_matte {
                    alive.push(ray[i]);
                }
                if !placed.is_seen {
                    continue;
                }
                let direction = DVec3::from(block.direction.map(|axis| f64::from(axis[lane])));
                let start = DVec3::from(block.origin.map(|axis| f64::from(axis[lane])));
                let normal = DVec3::from(block.normal.map(|axis| f64::from(axis[lane])));
                let hit = LightHit {
                    id: [block.placement[lane], block.triangle[lane]],
                    weights: [block.u[lane], block.v[lane]].map(f64::from),
                    t: f64::from(block.t_max[lane]),
                    from: stage.origin + start,
                    direction,
                    is_front: normal.dot(direction) <= 0.0,
                };
                let own = if bounces == 0 { f64::INFINITY } else { pdf[i] };
                let Some(weight) = self.light_of_hit(&hit, own, radiance) else { continue };
                radiance.iter_mut().zip(carried(i)).for_each(|(r, t)| *r *= t * weight);
                let group = || lights.group_of_placement(around, hit.id[0]);
                self.add(radiance, self.parts.row(ray[i], bounces, group), out);
            }
        }
        let blocks = now.rays.blocks();
        let wanted = missed.iter().map(|&i| {
            let (i, block, lane) = (i as usize, &blocks[i as usize / BLOCK], i as usize % BLOCK);
            // The camera's rays are not all traced: those that cannot hit anything are other ones in blocks.
            if bounces == 0 {
                return (beam.rays.origin(i), beam.rays.direction(i));
            }
            let vector = |axes: &[[f32; BLOCK]; 3]| DVec3::from(axes.map(|a| f64::from(a[lane])));
            (stage.origin + vector(&block.origin), vector(&block.direction))
        });
        lights.environment(spectral, wanted, asked, radiance, |number, of_sky, light| {
            let i = missed[number] as usize;
            let weight = if bounces == 0 { 1.0 } else { power_heuristic(pdf[i], of_sky) };
            light.iter_mut().zip(carried(i)).for_each(|(r, t)| *r *= t * weight);
            self.add(light, self.parts.row(ray[i], bounces, || lights.group_of_sky()), out);
        });
    }

    /// The light of a surface that was met, and its weight against having asked for it; `own` is the density
    /// (1/sr) of the direction, `+inf` of the camera's.
    fn light_of_hit(&self, hit: &LightHit, own: f64, radiance: &mut [f64]) -> Option<f64> {
        let LightingContext { lights, surroundings: around, spectral, .. } = self.stage;
        let weight = |pdf: f64| match own {
            f64::INFINITY => 1.0,
            own => power_heuristic(own, if pdf.is_finite() { pdf } else { 0.0 }),
        };
        let index = lights.index_of(hit.id);
        if let Some(index) = index
            && let Some((lamp, bands)) = lights.plain_triangle(index, self.count())
        {
            if !hit.is_front && !lamp.two_sided {
                return None;
            }
            radiance.copy_from_slice(bands);
            if own == f64::INFINITY {
                return Some(1.0);
            }
            let cosine = hit.direction.dot(lamp.shape.normal).abs();
            let density = hit.t * hit.t / (cosine * lamp.shape.area);
            return Some(weight(lights.chance(hit.from, index) * density));
        }
        let placement = around.geometry.placements.get(hit.id[0] as usize)?;
        let [u, v] = hit.weights;
        let corner = SurfacePoint::corner(around.geometry, placement, hit.id[1] as usize);
        let spot = SurfacePoint { weights: [1.0 - u - v, u, v], ..corner };
        let material = around.material(&spot)?;
        if material.scattering == Scattering::Unlit {
            let [r, g, b, _] = around.base_color(material, &spot);
            spectral.spread(&[r, g, b], radiance);
            return (own == f64::INFINITY).then_some(1.0);
        }
        if !lights.emitted(around, spectral, &spot, hit.is_front, radiance) {
            return None;
        }
        let pdf = lights.pdf_of_surface(around, hit.id[0], &spot, hit.from, hit.direction);
        Some(weight(pdf))
    }

    /// Draws what this step needs for all paths that go on.
    fn draw_for_blocks(&self, samples: &dyn Samples, stage: &Stage<'_>, lanes: &mut LaneScratch) {
        let lights = self.stage.lights;
        let follows = !stage.ends || lights.is_hittable();
        let roulette = self.rules.roulette.is_some_and(|after| stage.bounces + 1 >= after);
        for draw in Draw::ALL {
            let needs = match draw {
                Draw::Choice => false,
                Draw::Light => lights.are_several() || lights.are_extended(),
                Draw::Direction => follows,
                Draw::Chance => roulette && !stage.ends,
            };
            let drawn = &mut lanes.drawn[draw as usize];
            drawn.clear();
            if needs {
                samples.squares_of_pair(&lanes.alive, stage.bounces * DRAWS + draw as u32, drawn);
            }
        }
    }

    /// The step of the hits of one patch, from path `first` on; `alive` counts the paths that go on.
    fn step_blocks(
        &self,
        stage: &Stage<'_>,
        lanes: &mut LaneScratch,
        patch: &mut Patch,
        (first, alive): (usize, &mut usize),
        asked: &mut Asked,
        beam: &RaySamples<'_>,
    ) {
        let count = LANES.min(lanes.now.rays.len() - first);
        let from = *alive;
        patch.clear();
        patch.count = count;
        let blocks = &lanes.now.rays.blocks()[first / BLOCK..];
        kernels::unpack(patch, &blocks[..count.div_ceil(BLOCK)], stage.origin.to_array());
        // What is known of each hit beforehand.
        let picked = &mut lanes.picked;
        picked.clear();
        patch.colors.resize(count, [0.0; 3]);
        let mut is_tilted = false;
        for lane in 0..count {
            let (block, k) = (&blocks[lane / BLOCK], lane % BLOCK);
            let placed = self.stage.placed.get(block.placement[k]);
            let Some(placed) = placed.filter(|placed| placed.is_matte) else { continue };
            put(&mut patch.seen.magnitudes, lane, placed.magnitudes);
            if let (Some(color), false) = (placed.color, placed.is_tilted) {
                patch.colors[lane] = color;
            } else {
                is_tilted |= placed.is_tilted;
                self.look_up(stage, patch, (first + lane, lane), lanes_hit(block, k), beam);
            }
            patch.path.push((first + lane, *alive));
            picked.push(lane);
            *alive += 1;
        }
        let roundings = self.stage.roundings();
        kernels::measure(patch, roundings);
        if is_tilted {
            kernels::bend(patch);
        }
        if !self.stage.lights.is_dark() {
            self.choose_for_blocks(lanes, patch, from, asked);
            kernels::aim(patch, roundings);
            self.ask_for_blocks(stage, lanes, patch);
        }
        if !stage.ends || self.stage.lights.is_hittable() {
            self.scatter_blocks(stage, lanes, patch, from);
        }
    }

    /// Colour and shading normal of a hit where they are not alike all over.
    fn look_up(
        &self,
        stage: &Stage<'_>,
        patch: &mut Patch,
        (path, lane): (usize, usize),
        (id, [u, v]): ([u32; 2], [f64; 2]),
        beam: &RaySamples<'_>,
    ) {
        let around = &self.stage.surroundings;
        let Some(placement) = around.geometry.placements.get(id[0] as usize) else { return };
        let Some(placed) = self.stage.placed.get(id[0]) else { return };
        let corner = SurfacePoint::corner(around.geometry, placement, id[1] as usize);
        // Seen by chance from one point, a surface is a point: the camera's rays alone cover some of it.
        let footprint = (stage.bounces == 0).then(|| {
            let direction = beam.rays.direction(path);
            let Seen { origin, direction: along, t, .. } = &patch.seen;
            let point = at(origin, lane) + at(along, lane) * t[lane];
            let t = (point - beam.rays.origin(path)).dot(direction);
            let cone: Option<Cone> = around.view.cone(direction);
            cone.map(|cone| Footprint { direction, width: cone.after(t).width })
        });
        let weights = [1.0 - u - v, u, v];
        let spot = SurfacePoint { weights, footprint: footprint.flatten(), ..corner };
        let Some(material) = around.material(&spot) else { return };
        if placed.is_tilted {
            let front = at(&patch.seen.normal, lane);
            let tilted = spot.tilted_normal(around, material, placed.turn.as_ref(), front);
            put(&mut patch.seen.shading, lane, tilted);
        }
        patch.colors[lane] = placed.color.unwrap_or_else(|| {
            let [r, g, b, _] = around.base_color(material, &spot);
            [r, g, b].map(|c| c.clamp(0.0, 1.0))
        });
    }

    /// Chooses a light for each hit, and a place on it.
    fn choose_for_blocks(
        &self,
        lanes: &LaneScratch,
        patch: &mut Patch,
        from: usize,
        asked: &mut Asked,
    ) {
        let LightingContext { lights, surroundings: around, spectral, .. } = self.stage;
        let count = self.count();
        let numbers = lanes.drawn[Draw::Light as usize].get(from..);
        patch.radiance.resize(LANES * count, 0.0);
        asked.clear();
        let picks = &mut patch.picks;
        for (k, &lane) in lanes.picked.iter().enumerate() {
            let square = numbers.and_then(|all| all.get(k)).copied().unwrap_or([0.5; 2]);
            [picks.square[0][lane], picks.square[1][lane]] = square;
        }
        // Which light.
        if let Some(below) = lights.few() {
            kernels::pick(picks, below);
        } else {
            for &lane in &lanes.picked {
                let u = &mut picks.square[0][lane];
                match lights.pick(at(&patch.seen.point, lane), *u) {
                    Some((index, rest, chance)) => {
                        picks.index[lane] = u32::try_from(index).unwrap_or(u32::MAX);
                        (*u, picks.chance[lane]) = (rest, chance);
                    }
                    None => picks.chance[lane] = 0.0,
                }
            }
        }
        let squares = picks.square;
        kernels::spread_over_triangles(picks);
        // A place on it.
        for &lane in &lanes.picked {
            let (index, chance) = (picks.index[lane] as usize, picks.chance[lane]);
            let radiance = &mut patch.radiance[lane * count..(lane + 1) * count];
            if chance == 0.0 {
                patch.targets.set(lane, None);
                continue;
            }
            if let Some((lamp, bands)) = lights.plain_triangle(index, count) {
                radiance.copy_from_slice(bands);
                let weights = [picks.square[0][lane], picks.square[1][lane]];
                patch.targets.set_triangle(lane, lamp, weights, chance);
                continue;
            }
            let one = ((index, chance), [squares[0][lane], squares[1][lane]]);
            let point = at(&patch.seen.point, lane);
            match lights.place(around, spectral, point, one, radiance) {
                Chosen::Dark => patch.targets.set(lane, None),
                Chosen::Place(target) => patch.targets.set(lane, Some(&target)),
                Chosen::Sky { square, chance } => asked.push(lane, square, chance),
            }
        }
        let Some(sky) = &lights.sky else { return };
        sky.choose(asked, |lane, target, there| {
            patch.targets.set(lane, target.as_ref());
            let radiance = &mut patch.radiance[lane * count..(lane + 1) * count];
            lights.spread_sky(spectral, there, radiance);
        });
    }

    /// Notes the rays to the lights that were chosen, and what each brings.
    fn ask_for_blocks(&self, stage: &Stage<'_>, lanes: &mut LaneScratch, patch: &mut Patch) {
        let LaneScratch { now, shadows, picked, .. } = lanes;
        let count = self.count();
        kernels::reflect(patch);
        let Patch { away, targets, colors, radiance, path, .. } = patch;
        let (lights, around) = (self.stage.lights, &self.stage.surroundings);
        for (&lane, &(i, _)) in picked.iter().zip(path.iter()) {
            let value = away.value[lane];
            // Any comparison with NaN is false.
            let counts = value > 0.0;
            if !counts {
                continue;
            }
            push(&mut shadows.rays, stage, [&away.start, &away.along], lane, away.reach[lane]);
            let group = || lights.group_of(around, [targets.id[lane][0], targets.light[lane]]);
            let row = self.parts.row(now.carried.ray[i], stage.bounces + 1, group);
            shadows.carried.ray.push(row);
            let light = radiance[lane * count..(lane + 1) * count].iter();
            let throughput = &now.carried.throughput[i * count..(i + 1) * count];
            let bands = light.zip(throughput).enumerate();
            let color = &colors[lane];
            let brought = bands.map(|(k, (l, t))| l * t * value * self.band(color, k));
            shadows.carried.throughput.extend(brought);
        }
    }

    /// Chooses a direction for each hit, and notes the path along it, but for those that carry nothing or end
    /// by chance.
    fn scatter_blocks(
        &self,
        stage: &Stage<'_>,
        lanes: &mut LaneScratch,
        patch: &mut Patch,
        from: usize,
    ) {
        let LaneScratch { now, next, last, of_last, drawn, picked, .. } = lanes;
        let count = self.count();
        let of =
            |draw: Draw, k: usize| drawn[draw as usize].get(from + k).copied().unwrap_or([0.5; 2]);
        let mut squares = [[0.5; 2]; LANES];
        for (k, &lane) in picked.iter().enumerate() {
            squares[lane] = of(Draw::Direction, k);
        }
        kernels::scatter(patch, &squares);
        let asks_emitters = stage.ends && stage.asks_emitters;
        let roulette = self.rules.roulette.filter(|&after| stage.bounces + 1 >= after);
        let Patch { away, colors, path, .. } = patch;
        for ((k, &lane), &(i, _)) in picked.iter().enumerate().zip(path.iter()) {
            let pdf = away.value[lane];
            let goes_on = pdf > 0.0;
            if !goes_on {
                continue;
            }
            let throughput = &mut now.carried.throughput[i * count..(i + 1) * count];
            let mut most = 0.0_f64;
            for (k, band) in throughput.iter_mut().enumerate() {
                *band *= self.band(&colors[lane], k);
                most = most.max(*band);
            }
            let ray = || (at(&away.start, lane), at(&away.along, lane));
            if most <= 0.0 || (asks_emitters && !self.may_shine(ray())) {
                continue;
            }
            if roulette.is_some() && !stage.ends {
                // Its root: where few paths come this far, ending them saves little and leaves noise.
                let survival = most.sqrt().min(1.0);
                if of(Draw::Chance, k)[1] >= survival {
                    continue;
                }
                throughput.iter_mut().for_each(|band| *band /= survival);
            }
            let carried = if asks_emitters {
                let (start, along) = ray();
                last.push(start, along);
                &mut *of_last
            } else {
                push(&mut next.rays, stage, [&away.start, &away.along], lane, f64::INFINITY);
                &mut next.carried
            };
            carried.ray.push(now.carried.ray[i]);
            carried.pdf.push(pdf);
            carried.throughput.extend_from_slice(throughput);
        }
    }

    /// Adds what lights bring along rays that nothing blocks.
    fn shadows_of_blocks(
        &mut self,
        blocks: &dyn BlockAccel,
        shadows: &mut Paths,
        coherent: bool,
        count: usize,
        out: &mut [f64],
    ) {
        self.tally.shadow_rays += shadows.rays.len() as u64;
        blocks.occluded_of_blocks(shadows.rays.blocks_mut(), coherent);
        let Paths { rays, carried } = shadows;
        for (i, (&row, light)) in
            carried.ray.iter().zip(carried.throughput.chunks_exact(count)).enumerate()
        {
            if !rays.blocks()[i / BLOCK].is_blocked(i % BLOCK) {
                self.add(light, row, out);
            }
        }
    }

    /// Adds the light that the last directions of paths meet: what shines is asked first, and the scene only
    /// where that was met.
    fn ask_emitters(
        &mut self,
        stage: &Stage<'_>,
        lanes: &mut LaneScratch,
        (asked, radiance): (&mut Asked, &mut Vec<f64>),
        out: &mut [f64],
    ) {
        let LaneScratch { last, of_last, hits, shadows, missed, .. } = lanes;
        let Some(emitters) = self.stage.emitters.filter(|_| !last.is_empty()) else { return };
        let LightingContext { lights, spectral, surroundings: around, .. } = self.stage;
        let (count, scatterings) = (self.count(), stage.bounces + 1);
        last.from_surface = true;
        last.coherent = false;
        last.precision = HitPrecision::Single;
        hits.detail = etendue_geometry::Detail::Surface;
        emitters.closest(last, hits);
        shadows.clear();
        missed.clear();
        let Carried { ray, pdf, throughput } = of_last;
        let carried = |i: usize| &throughput[i * count..(i + 1) * count];
        let note = |shadows: &mut Paths, row: u32, light: &[f64], (i, weight): (usize, f64)| {
            shadows.carried.ray.push(row);
            let brought = light.iter().zip(carried(i)).map(|(l, t)| l * t * weight);
            shadows.carried.throughput.extend(brought);
        };
        for i in 0..last.len() {
            let (from, direction) = (last.origin(i), last.direction(i));
            let Some(placed) = self.stage.placed.get(hits.placement[i]) else {
                missed.push(u32::try_from(i).unwrap_or(u32::MAX));
                continue;
            };
            let normal = hits.normal(i);
            let hit = LightHit {
                id: [hits.placement[i], hits.triangle[i]],
                weights: [hits.u[i], hits.v[i]],
                t: hits.t[i],
                from,
                direction,
                is_front: normal.dot(direction) <= 0.0,
            };
            let Some(weight) = self.light_of_hit(&hit, pdf[i], radiance) else { continue };
            let end = self.stage.anchor(from + direction * hit.t, normal, from, placed);
            let offset = end.leave(-direction) - from;
            let distance = offset.length();
            // Points that fall together see each other: a ray of no length meets nothing.
            let direction = if distance > 0.0 { offset / distance } else { DVec3::Z };
            push_ray(&mut shadows.rays, stage, [from, direction], distance);
            let group = || lights.group_of_placement(around, hit.id[0]);
            note(shadows, self.parts.row(ray[i], scatterings, group), radiance, (i, weight));
        }
        let wanted = missed.iter().map(|&i| (last.origin(i as usize), last.direction(i as usize)));
        lights.environment(spectral, wanted, asked, radiance, |number, of_sky, light| {
            let i = missed[number] as usize;
            let ends = [last.origin(i), last.direction(i)];
            push_ray(&mut shadows.rays, stage, ends, f64::INFINITY);
            let row = self.parts.row(ray[i], scatterings, || lights.group_of_sky());
            note(shadows, row, light, (i, power_heuristic(pdf[i], of_sky)));
        });
        self.shadows_of_blocks(stage.blocks, shadows, false, count, out);
    }
}

/// A surface that shines, met by a path.
struct LightHit {
    /// Placement and triangle.
    id: [u32; 2],
    /// Of the second and the third corner.
    weights: [f64; 2],
    /// m.
    t: f64,
    /// Where the ray started (m).
    from: DVec3,
    direction: DVec3,
    is_front: bool,
}

/// What a lane of a block hit.
fn lanes_hit(block: &etendue_geometry::RayBlock, lane: usize) -> ([u32; 2], [f64; 2]) {
    let weights = [block.u[lane], block.v[lane]].map(|w| f64::from(w.clamp(0.0, 1.0)));
    ([block.placement[lane], block.triangle[lane]], weights)
}

/// Appends the ray of a lane, from its start along its direction.
#[inline(always)]
fn push(
    rays: &mut RayBlocks,
    stage: &Stage<'_>,
    [start, along]: [&[[f64; LANES]; 3]; 2],
    lane: usize,
    reach: f64,
) {
    push_ray(rays, stage, [at(start, lane), at(along, lane)], reach);
}

/// Appends a ray of the world as far as `reach` (m).
#[inline(always)]
fn push_ray(rays: &mut RayBlocks, stage: &Stage<'_>, [start, along]: [DVec3; 2], reach: f64) {
    let local = start - stage.origin;
    let round = |v: DVec3| [v.x, v.y, v.z].map(single);
    rays.push(round(local), round(along), single(reach));
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is the purpose")]
#[inline(always)]
fn single(x: f64) -> f32 {
    x as f32
}
