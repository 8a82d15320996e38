//! Scenes hit in single precision: paths in blocks of sixteen rays, as the accelerator takes them, from the camera
//! to the last light. All paths of a batch have met equally many surfaces, so what a path remembers is little: its
//! ray, the density of its direction and what it carries.
//!
//! The stages are loops over blocks: what is looked up for a hit is gathered first, arithmetic is done on local
//! arrays by the [`kernels`] and, for sheets of facets, by [`crate::bsdf::sheets`], and what goes on is put side by
//! side in new blocks. Where surfaces are of several kinds, hits of one kind are put side by side first. Those of
//! other kinds than matte and sheets are worked out one by one, by [`crate::bsdf::Bsdf`], within the same stages.

mod scatter;
mod surfaces;

use etendue_accel::BlockAccel;
use etendue_geometry::block::LANES as BLOCK;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{HitBatch, HitPrecision, RayBatch, RayBlock, RayBlocks};

use super::numbers::{DRAWS, Draw};
use super::patch::{LANES, Patch, SheetColors, at};
use super::step::weigh;
use super::{Follow, LightingContext, RaySamples, Scratch, Tracing, Traits, kernels, metal};
use crate::bsdf::{Bsdf, Weights};
use crate::footprint::{Cone, Footprint};
use crate::light_sampler::Receiver;
use crate::placed::{PlacedSurface, SurfaceKind};
use crate::reference::SurfacePoint;
use crate::sampling::power_heuristic;
use crate::sky::Asked;
use crate::target::Chosen;
use crate::{Scattering, Tint};

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
    /// Of paths alone.
    ways: Vec<Way>,
    /// What each path stands for, as long as it only met mirrors and clear boundaries; as wide as where its ray
    /// starts. Empty before the first surface, and where all surfaces are matte.
    cones: Vec<Option<Cone>>,
    /// `[path][band]`.
    throughput: Vec<f64>,
}

/// How a path came to its direction.
#[derive(Debug, Clone, Copy)]
struct Way {
    /// Density (1/sr) of the direction; unused where it is specular.
    pdf: f64,
    /// No light was asked in its stead: it is the camera's, a mirror's or a smooth boundary's.
    is_specular: bool,
    /// It looks for light and goes no farther.
    is_last: bool,
    /// Of the surface that it left, by which lights were chosen for it ([`Receiver::normal`]).
    normal: [f32; 3],
}

impl Way {
    const CAMERA: Self = Self { pdf: 0.0, is_specular: true, is_last: false, normal: [0.0; 3] };

    /// The point (m) that it left, as lights were chosen for it.
    fn receiver(self, point: DVec3) -> Receiver {
        Receiver { point, normal: self.normal.map(f64::from).into() }
    }

    /// The weight of light that was met against having asked for it with density `pdf` (1/sr).
    fn weight_against(self, pdf: f64) -> f64 {
        if self.is_specular { 1.0 } else { power_heuristic(self.pdf, pdf) }
    }
}

impl Carried {
    fn clear(&mut self) {
        self.ray.clear();
        self.ways.clear();
        self.cones.clear();
        self.throughput.clear();
    }
}

impl Paths {
    fn clear(&mut self) {
        self.rays.clear();
        self.carried.clear();
    }
}

/// The kinds of surfaces that paths go on from, in the order in which they are worked on.
const KINDS: [SurfaceKind; 4] =
    [SurfaceKind::Matte, SurfaceKind::Sheet, SurfaceKind::Smooth, SurfaceKind::Other];

/// Where paths go on.
#[derive(Debug, Default)]
struct Onward {
    next: Paths,
    /// Last directions, which ask only what shines.
    last: RayBatch,
    of_last: Carried,
}

/// Memory of one thread, kept between batches.
#[derive(Debug, Default)]
pub(super) struct LaneScratch {
    now: Paths,
    onward: Onward,
    shadows: Paths,
    hits: HitBatch,
    /// Paths that go on by the kind of surface that they met, in the order of [`KINDS`]; of them one after the
    /// other the camera's rays, and their random numbers by use.
    kinds: [Vec<u32>; KINDS.len()],
    alive: Vec<u32>,
    drawn: [Vec<[f64; 2]>; DRAWS as usize],
    /// Hits of one kind put side by side, and those of sheets that turned out to be smooth: their paths, and which
    /// of those that go on they are.
    side_by_side: Vec<RayBlock>,
    smooth: Vec<(usize, usize)>,
    /// Paths that met nothing.
    missed: Vec<u32>,
    /// Lanes of a patch that are worked on.
    picked: Vec<usize>,
}

impl LaneScratch {
    /// The numbers of the `k`-th path that goes on, for one use.
    #[inline(always)]
    fn number(&self, draw: Draw, k: usize) -> [f64; 2] {
        self.drawn[draw as usize].get(k).copied().unwrap_or([0.5; 2])
    }
}

/// What a patch of hits is worked on with.
struct Stage<'a> {
    blocks: &'a dyn BlockAccel,
    /// What coordinates of blocks are relative to (m).
    origin: DVec3,
    beam: &'a RaySamples<'a>,
    /// Surfaces that have scattered the paths.
    bounces: u32,
    /// The paths look for light after this surface and go no farther; or do so unless it is specular.
    ends: bool,
    ends_unless_specular: bool,
    /// Those ask only what shines, but for specular ones.
    asks_emitters: bool,
    /// Hits may be of several kinds.
    is_mixed: bool,
}

/// What traces the scene in blocks, where all that it asks for is here.
pub(super) fn block_accel<'a>(stage: &LightingContext<'a>) -> Option<&'a dyn BlockAccel> {
    let Traits { has_alpha, has_panes, has_media, has_nested, has_dispersion, .. } = stage.traits;
    let is_plain = !(has_alpha || has_panes || has_media || has_nested || has_dispersion);
    stage.accel.blocks().filter(|_| is_plain && stage.precision == HitPrecision::Single)
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
        while !lanes.now.rays.is_empty() {
            blocks.closest_of_blocks(lanes.now.rays.blocks_mut(), coherent);
            self.tally.rays += lanes.now.rays.len() as u64;
            let ends = bounces + 1 >= self.rules.bounces;
            let stage = Stage {
                blocks,
                origin: blocks.origin(),
                beam,
                bounces,
                ends,
                ends_unless_specular: ends || self.rules.follow == Follow::Single,
                asks_emitters: self.traces_emitters(),
                is_mixed: !self.stage.traits.is_matte,
            };
            self.met_by_blocks(&stage, lanes, (asked, radiance), out);
            if bounces >= self.rules.bounces || lanes.alive.is_empty() {
                break;
            }
            self.draw_for_blocks(&stage, lanes);
            lanes.onward.next.clear();
            lanes.onward.last.clear();
            lanes.onward.of_last.clear();
            lanes.shadows.clear();
            if stage.is_mixed {
                self.step_kinds(&stage, lanes, patch, asked);
            } else {
                self.step_matte(&stage, lanes, patch, asked);
            }
            self.shadows_of_blocks(blocks, &mut lanes.shadows, coherent, count, out);
            self.ask_emitters(&stage, lanes, (asked, radiance), out);
            std::mem::swap(&mut lanes.now, &mut lanes.onward.next);
            (bounces, coherent) = (bounces + 1, false);
        }
    }

    fn start_blocks(&self, blocks: &dyn BlockAccel, beam: &RaySamples<'_>, paths: &mut Paths) {
        paths.clear();
        blocks.convert(beam.rays, &mut paths.rays);
        let Carried { ray, ways, throughput, .. } = &mut paths.carried;
        for i in 0..beam.rays.len() {
            ray.push(u32::try_from(i).unwrap_or(u32::MAX));
            ways.push(Way::CAMERA);
            let bands = 0..self.count();
            throughput.extend(bands.map(|k| f64::from(u8::from(beam.bands.contains(&k)))));
        }
    }

    /// Adds the light that paths met by themselves, and lists those that go on.
    fn met_by_blocks(
        &mut self,
        stage: &Stage<'_>,
        lanes: &mut LaneScratch,
        (asked, radiance): (&mut Asked, &mut Vec<f64>),
        out: &mut [f64],
    ) {
        let LaneScratch { now, kinds, alive, missed, .. } = lanes;
        let LightingContext { lights, spectral, surroundings: scene, .. } = self.stage;
        let (count, bounces) = (self.count(), stage.bounces);
        alive.clear();
        kinds.iter_mut().for_each(Vec::clear);
        missed.clear();
        let lit = lights.sky.as_ref().is_some_and(|sky| sky.visible || bounces > 0);
        let Carried { ray, ways, throughput, .. } = &now.carried;
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
                if !ways[i].is_last {
                    match KINDS.iter().position(|&kind| kind == placed.kind) {
                        Some(kind) if stage.is_mixed => {
                            kinds[kind].push(u32::try_from(i).unwrap_or(u32::MAX));
                        }
                        Some(_) => alive.push(ray[i]),
                        None => {}
                    }
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
                let footprint = || self.footprint(stage, now, i);
                let Some(weight) = self.light_of_hit(&hit, ways[i], footprint, radiance) else {
                    continue;
                };
                radiance.iter_mut().zip(carried(i)).for_each(|(r, t)| *r *= t * weight);
                let group = || lights.group_of_placement(scene, hit.id[0]);
                self.add(radiance, self.parts.row(ray[i], bounces, group), out);
            }
        }
        let blocks = now.rays.blocks();
        let wanted = missed.iter().map(|&i| {
            let (i, block, lane) = (i as usize, &blocks[i as usize / BLOCK], i as usize % BLOCK);
            // The camera's rays are not all traced: those that cannot hit anything are other ones in blocks.
            if bounces == 0 {
                let origin = Receiver::open(stage.beam.rays.origin(i));
                return (origin, stage.beam.rays.direction(i));
            }
            let vector = |axes: &[[f32; BLOCK]; 3]| DVec3::from(axes.map(|a| f64::from(a[lane])));
            let origin = stage.origin + vector(&block.origin);
            (ways[i].receiver(origin), vector(&block.direction))
        });
        lights.environment(spectral, wanted, asked, radiance, |number, of_sky, light| {
            let i = missed[number] as usize;
            let weight = ways[i].weight_against(of_sky);
            light.iter_mut().zip(carried(i)).for_each(|(r, t)| *r *= t * weight);
            self.add(light, self.parts.row(ray[i], bounces, || lights.group_of_sky()), out);
        });
        if stage.is_mixed {
            alive.extend(kinds.iter().flatten().map(|&i| ray[i as usize]));
        }
    }

    /// What path `i` stands for where it hit, which is a point where it was scattered by chance: a cone as wide as
    /// there.
    fn cone_at_hit(&self, stage: &Stage<'_>, now: &Paths, i: usize) -> Option<Cone> {
        let (block, lane) = (&now.rays.blocks()[i / BLOCK], i % BLOCK);
        let t = f64::from(block.t_max[lane]);
        if stage.bounces > 0 {
            return Some((*now.carried.cones.get(i)?)?.after(t));
        }
        let vector = |axes: &[[f32; BLOCK]; 3]| DVec3::from(axes.map(|a| f64::from(a[lane])));
        let hit = stage.origin + vector(&block.origin) + vector(&block.direction) * t;
        // A block's ray may start nearer.
        let (origin, direction) = (stage.beam.rays.origin(i), stage.beam.rays.direction(i));
        let cone = self.stage.surroundings.view.cone(direction)?;
        Some(cone.after((hit - origin).dot(direction)))
    }

    /// How much path `i` covers where it hit.
    fn footprint(&self, stage: &Stage<'_>, now: &Paths, i: usize) -> Option<Footprint> {
        let Cone { width, .. } = self.cone_at_hit(stage, now, i)?;
        let (block, lane) = (&now.rays.blocks()[i / BLOCK], i % BLOCK);
        let direction = match stage.bounces {
            0 => stage.beam.rays.direction(i),
            _ => DVec3::from(block.direction.map(|axis| f64::from(axis[lane]))),
        };
        Some(Footprint { direction, width })
    }

    /// The light of a surface that was met, and its weight against having asked for it.
    fn light_of_hit(
        &self,
        hit: &LightHit,
        way: Way,
        footprint: impl Fn() -> Option<Footprint>,
        radiance: &mut [f64],
    ) -> Option<f64> {
        let LightingContext { lights, surroundings: scene, spectral, .. } = self.stage;
        let weight = |pdf: f64| way.weight_against(if pdf.is_finite() { pdf } else { 0.0 });
        let index = lights.index_of(hit.id);
        if let Some(index) = index
            && let Some((lamp, bands)) = lights.plain_triangle(index, self.count())
        {
            if !hit.is_front && !lamp.two_sided {
                return None;
            }
            radiance.copy_from_slice(bands);
            if way.is_specular {
                return Some(1.0);
            }
            let cosine = hit.direction.dot(lamp.shape.normal).abs();
            let density = hit.t * hit.t / (cosine * lamp.shape.area);
            return Some(weight(lights.chance(&way.receiver(hit.from), index) * density));
        }
        let placement = scene.geometry.placements.get(hit.id[0] as usize)?;
        let [u, v] = hit.weights;
        let corner = SurfacePoint::corner(scene.geometry, placement, hit.id[1] as usize);
        let weights = [1.0 - u - v, u, v];
        let surface_point = SurfacePoint { weights, footprint: footprint(), ..corner };
        let material = scene.material(&surface_point)?;
        if material.scattering == Scattering::Unlit {
            let (tint, _) = scene.base_tint(spectral, material, &surface_point);
            spectral.spread_tint(&tint, radiance);
            return way.is_specular.then_some(1.0);
        }
        if !lights.emitted(scene, spectral, &surface_point, hit.is_front, radiance) {
            return None;
        }
        let receiver = way.receiver(hit.from);
        let pdf = lights.pdf_of_surface(scene, hit.id[0], &surface_point, &receiver, hit.direction);
        Some(weight(pdf))
    }

    /// Draws what this step needs for all paths that go on.
    fn draw_for_blocks(&self, stage: &Stage<'_>, lanes: &mut LaneScratch) {
        let LightingContext { lights, traits, .. } = self.stage;
        let follows = !stage.ends_unless_specular || lights.is_hittable() || traits.has_choice;
        let roulette = self.rules.roulette.is_some_and(|after| stage.bounces + 1 >= after);
        for draw in Draw::ALL {
            let needs = match draw {
                Draw::Choice => traits.has_choice,
                Draw::Light => lights.are_several() || lights.are_extended(),
                Draw::Direction => follows,
                Draw::Chance => roulette && !stage.ends,
            };
            let drawn = &mut lanes.drawn[draw as usize];
            drawn.clear();
            if needs {
                let pair = stage.bounces * DRAWS + draw as u32;
                stage.beam.samples.squares_of_pair(&lanes.alive, pair, drawn);
            }
        }
    }

    /// The step of all paths where all surfaces are matte: hits stay where they are, among those of paths that end.
    fn step_matte(
        &self,
        stage: &Stage<'_>,
        lanes: &mut LaneScratch,
        patch: &mut Patch,
        asked: &mut Asked,
    ) {
        let mut alive = 0;
        for first in (0..lanes.now.rays.len()).step_by(LANES) {
            let count = LANES.min(lanes.now.rays.len() - first);
            let blocks = &lanes.now.rays.blocks()[first / BLOCK..];
            self.unpack(stage, patch, (blocks, count));
            lanes.picked.clear();
            for lane in 0..count {
                let placed = self.stage.placed.get(blocks[lane / BLOCK].placement[lane % BLOCK]);
                let is_matte = |placed: &&PlacedSurface| placed.kind == SurfaceKind::Matte;
                let Some(placed) = placed.filter(is_matte) else { continue };
                if lanes.now.carried.ways[first + lane].is_last {
                    continue;
                }
                self.look_up_matte(stage, &lanes.now, patch, (first + lane, lane), placed);
                patch.path.push((first + lane, alive));
                lanes.picked.push(lane);
                alive += 1;
            }
            self.step_blocks(stage, lanes, patch, SurfaceKind::Matte, asked);
        }
    }

    /// The step of all paths where surfaces are of several kinds: those of one side by side.
    fn step_kinds(
        &self,
        stage: &Stage<'_>,
        lanes: &mut LaneScratch,
        patch: &mut Patch,
        asked: &mut Asked,
    ) {
        lanes.smooth.clear();
        let mut alive = 0;
        for (number, kind) in KINDS.into_iter().enumerate() {
            let paths = std::mem::take(&mut lanes.kinds[number]);
            for chunk in paths.chunks(LANES) {
                let numbered = (alive..).zip(chunk).map(|(k, &i)| (i as usize, k));
                alive += chunk.len();
                self.step_side_by_side(stage, lanes, patch, (kind, numbered), asked);
            }
            lanes.kinds[number] = paths;
        }
        let smooth = std::mem::take(&mut lanes.smooth);
        for chunk in smooth.chunks(LANES) {
            let own = (SurfaceKind::Other, chunk.iter().copied());
            self.step_side_by_side(stage, lanes, patch, own, asked);
        }
        lanes.smooth = smooth;
    }

    /// The step of paths that met surfaces of one kind, at most as many as a patch has lanes: their numbers, and
    /// which of those that go on they are.
    fn step_side_by_side(
        &self,
        stage: &Stage<'_>,
        lanes: &mut LaneScratch,
        patch: &mut Patch,
        (kind, paths): (SurfaceKind, impl Iterator<Item = (usize, usize)> + Clone),
        asked: &mut Asked,
    ) {
        let LaneScratch { now, side_by_side, smooth, picked, .. } = lanes;
        side_by_side.resize(LANES / BLOCK, RayBlock::EMPTY);
        let mut count = 0;
        for (i, _) in paths.clone() {
            let from = &now.rays.blocks()[i / BLOCK];
            side_by_side[count / BLOCK].copy_hit(count % BLOCK, from, i % BLOCK);
            count += 1;
        }
        self.unpack(stage, patch, (side_by_side, count));
        picked.clear();
        for (lane, (i, k)) in paths.enumerate() {
            let placement = side_by_side[lane / BLOCK].placement[lane % BLOCK];
            let Some(placed) = self.stage.placed.get(placement) else { continue };
            match kind {
                SurfaceKind::Black => continue,
                SurfaceKind::Matte => self.look_up_matte(stage, now, patch, (i, lane), placed),
                SurfaceKind::Sheet => {
                    if !self.look_up_sheet(stage, now, patch, (i, lane), placed) {
                        smooth.push((i, k));
                        continue;
                    }
                }
                SurfaceKind::Smooth => self.look_up_smooth(stage, now, patch, (i, lane), placed),
                SurfaceKind::Other => self.look_up_other(stage, now, patch, (i, lane), placed),
            }
            patch.path.push((i, k));
            picked.push(lane);
        }
        self.step_blocks(stage, lanes, patch, kind, asked);
    }

    /// Begins a patch with the rays and hits of blocks.
    fn unpack(&self, stage: &Stage<'_>, patch: &mut Patch, (blocks, count): (&[RayBlock], usize)) {
        patch.clear();
        patch.count = count;
        kernels::unpack(patch, &blocks[..count.div_ceil(BLOCK)], stage.origin.to_array());
        patch.colors.resize(count, Tint::BLACK);
    }

    /// The step of the hits that were picked of a patch, all of one kind.
    fn step_blocks(
        &self,
        stage: &Stage<'_>,
        lanes: &mut LaneScratch,
        patch: &mut Patch,
        kind: SurfaceKind,
        asked: &mut Asked,
    ) {
        if lanes.picked.is_empty() {
            return;
        }
        let roundings = self.stage.roundings();
        kernels::measure(patch, roundings);
        if patch.is_tilted {
            kernels::bend(patch);
        }
        if kind == SurfaceKind::Sheet {
            patch.sheets.view(&patch.seen.shading, &patch.seen.direction);
            for &lane in &lanes.picked {
                let mean = patch.sheets.mean[lane];
                let deep = |c| metal::multiple(metal::mean_reflectance(c, 0.0), mean);
                if patch.sheets.metallic[lane] > 0.0 {
                    patch.sheet_colors[lane].deep = patch.colors[lane].color.map(deep);
                }
            }
        }
        let is_delta = |bsdf: &Bsdf| bsdf.is_delta();
        // What scatters light of single directions asks none.
        let asks = match kind {
            SurfaceKind::Matte | SurfaceKind::Sheet => true,
            SurfaceKind::Black | SurfaceKind::Smooth => false,
            SurfaceKind::Other => !patch.bsdfs.iter().all(is_delta),
        };
        if asks && !self.stage.lights.is_dark() {
            self.choose_for_blocks(lanes, patch, asked);
            kernels::aim(patch, roundings);
            self.ask_for_blocks(stage, lanes, patch, kind);
        }
        self.scatter_blocks(stage, lanes, patch, kind);
    }

    /// Chooses a light for each hit, and a place on it.
    fn choose_for_blocks(&self, lanes: &LaneScratch, patch: &mut Patch, asked: &mut Asked) {
        let LightingContext { lights, surroundings: scene, spectral, .. } = self.stage;
        let count = self.count();
        let Patch { picks, seen, bsdfs, targets, radiance, path, .. } = patch;
        radiance.resize(LANES * count, 0.0);
        asked.clear();
        for (&lane, &(_, k)) in lanes.picked.iter().zip(&*path) {
            [picks.square[0][lane], picks.square[1][lane]] = lanes.number(Draw::Light, k);
        }
        // Which light.
        if let Some(below) = lights.few() {
            kernels::pick(picks, below);
        } else {
            // What scatters light of single directions asks none.
            let asks = |lane: &&usize| bsdfs.get(**lane).is_none_or(|bsdf| !bsdf.is_delta());
            for &lane in lanes.picked.iter().filter(asks) {
                let u = &mut picks.square[0][lane];
                match lights.pick(&seen.receiver(lane, bsdfs.get(lane)), *u) {
                    Some((index, rest, chance)) => {
                        picks.index[lane] = u32::try_from(index).unwrap_or(u32::MAX);
                        (*u, picks.chance[lane]) = (rest, chance);
                    }
                    None => picks.chance[lane] = 0.0,
                }
            }
        }
        for (lane, bsdf) in bsdfs.iter().enumerate() {
            if bsdf.is_delta() {
                picks.chance[lane] = 0.0;
            }
        }
        let squares = picks.square;
        kernels::spread_over_triangles(picks);
        // A place on it.
        for &lane in &lanes.picked {
            let (index, chance) = (picks.index[lane] as usize, picks.chance[lane]);
            let radiance = &mut radiance[lane * count..(lane + 1) * count];
            if chance == 0.0 {
                targets.set(lane, None);
                continue;
            }
            if let Some((lamp, bands)) = lights.plain_triangle(index, count) {
                radiance.copy_from_slice(bands);
                let weights = [picks.square[0][lane], picks.square[1][lane]];
                targets.set_triangle(lane, lamp, weights, chance);
                continue;
            }
            let one = ((index, chance), [squares[0][lane], squares[1][lane]]);
            let receiver = seen.receiver(lane, bsdfs.get(lane));
            match lights.place(scene, spectral, &receiver, one, radiance) {
                Chosen::Dark => targets.set(lane, None),
                Chosen::Place(target) => targets.set(lane, Some(&target)),
                Chosen::Sky { square, chance } => asked.push(lane, square, chance),
            }
        }
        let Some(sky) = &lights.sky else { return };
        sky.choose(asked, |lane, target, there| {
            targets.set(lane, target.as_ref());
            let radiance = &mut radiance[lane * count..(lane + 1) * count];
            lights.spread_sky(spectral, there, radiance);
        });
    }

    /// Notes the rays to the lights that were chosen, and what each brings.
    fn ask_for_blocks(
        &self,
        stage: &Stage<'_>,
        lanes: &mut LaneScratch,
        patch: &mut Patch,
        kind: SurfaceKind,
    ) {
        match kind {
            SurfaceKind::Black | SurfaceKind::Smooth => return,
            SurfaceKind::Matte => kernels::reflect(patch),
            SurfaceKind::Sheet => {
                let Patch { sheets, seen, away, targets, .. } = patch;
                let normals = [&seen.normal, &seen.shading];
                let asked = (&away.toward, &away.pdf, &targets.is_delta);
                sheets.reflect(normals, asked, &mut away.value);
            }
            SurfaceKind::Other => weigh(patch),
        }
        let LaneScratch { now, shadows, picked, .. } = lanes;
        let count = self.count();
        let (lights, scene) = (self.stage.lights, &self.stage.surroundings);
        for (&lane, &(i, _)) in picked.iter().zip(patch.path.iter()) {
            let Patch { away, targets, radiance, .. } = &*patch;
            let value = away.value[lane];
            // Any comparison with NaN is false.
            let counts = value > 0.0;
            if !counts {
                continue;
            }
            push(&mut shadows.rays, stage, [&away.start, &away.along], lane, away.reach[lane]);
            let group = || lights.group_of(scene, [targets.id[lane][0], targets.light[lane]]);
            let row = self.parts.row(now.carried.ray[i], stage.bounces + 1, group);
            shadows.carried.ray.push(row);
            let light = radiance[lane * count..(lane + 1) * count].iter();
            let throughput = &now.carried.throughput[i * count..(i + 1) * count];
            let bands = light.zip(throughput);
            let all = &mut shadows.carried.throughput;
            match kind {
                SurfaceKind::Black | SurfaceKind::Smooth => {}
                SurfaceKind::Matte => {
                    let start = all.len();
                    all.extend(bands.map(|(l, t)| l * t * value));
                    self.tinted(&patch.colors[lane], &mut all[start..]);
                }
                SurfaceKind::Sheet => {
                    let weights = patch.sheets.weights(lane);
                    let share = |k| self.in_band_of_sheet(patch, lane, weights, k);
                    all.extend(bands.enumerate().map(|(k, (l, t))| l * t * value * share(k)));
                }
                SurfaceKind::Other => {
                    let share = |k| self.in_band(&patch.bsdfs[lane], patch.weights[lane], k);
                    all.extend(bands.enumerate().map(|(k, (l, t))| l * t * value * share(k)));
                }
            }
        }
    }

    /// What a sheet of facets has of light in band `k`.
    #[inline(always)]
    fn in_band_of_sheet(&self, patch: &Patch, lane: usize, value: Weights, k: usize) -> f64 {
        let SheetColors { highlight, deep, named } = &patch.sheet_colors[lane];
        if let Some(named) = named {
            return self.in_band_of_metal(*named, patch.sheets.mean[lane], value, k);
        }
        value.white
            + value.base * self.band(&patch.colors[lane], k)
            + value.highlight * self.band(highlight, k)
            + value.deep * self.deep_band((&patch.colors[lane], deep), patch.sheets.mean[lane], k)
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
        let LaneScratch { onward: Onward { last, of_last, .. }, hits, shadows, missed, .. } = lanes;
        let Some(emitters) = self.stage.emitters.filter(|_| !last.is_empty()) else { return };
        let LightingContext { lights, spectral, surroundings: scene, .. } = self.stage;
        let (count, scatterings) = (self.count(), stage.bounces + 1);
        last.from_surface = true;
        last.coherent = false;
        last.precision = HitPrecision::Single;
        hits.detail = etendue_geometry::Detail::Surface;
        emitters.closest(last, hits);
        shadows.clear();
        missed.clear();
        let Carried { ray, ways, throughput, .. } = of_last;
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
            let Some(weight) = self.light_of_hit(&hit, ways[i], || None, radiance) else {
                continue;
            };
            let end = self.stage.anchor(from + direction * hit.t, normal, from, placed);
            let offset = end.leave(-direction) - from;
            let distance = offset.length();
            // Points that fall together see each other: a ray of no length meets nothing.
            let direction = if distance > 0.0 { offset / distance } else { DVec3::Z };
            push_ray(&mut shadows.rays, stage, [from, direction], distance);
            let group = || lights.group_of_placement(scene, hit.id[0]);
            note(shadows, self.parts.row(ray[i], scatterings, group), radiance, (i, weight));
        }
        let wanted = missed.iter().map(|&i| {
            let i = i as usize;
            (ways[i].receiver(last.origin(i)), last.direction(i))
        });
        lights.environment(spectral, wanted, asked, radiance, |number, of_sky, light| {
            let i = missed[number] as usize;
            let ends = [last.origin(i), last.direction(i)];
            push_ray(&mut shadows.rays, stage, ends, f64::INFINITY);
            let row = self.parts.row(ray[i], scatterings, || lights.group_of_sky());
            note(shadows, row, light, (i, ways[i].weight_against(of_sky)));
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
