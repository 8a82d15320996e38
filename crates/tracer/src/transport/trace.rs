//! The steps of all paths of a batch: closest hits, the light that they meet, and what goes on.
//!
//! What is looked up for a hit is gathered first, arithmetic is done on local arrays by the [`kernels`] and, for
//! sheets of facets, by [`crate::bsdf::sheets`], and what goes on is put side by side in new blocks. Where surfaces are
//! of several kinds, hits of one kind are put side by side first. Those of other kinds than matte, sheets and smooth
//! ones are worked out one by one, by [`crate::bsdf::Bsdf`], within the same stages.

use etendue_geometry::PlacedTriangle;
use etendue_geometry::glam::DVec3;

use super::media::Media;
use super::patch::Patch;
use super::paths::{Carried, DRAWS, Draw, KINDS, Passage, Paths, Step, Way, Workspace};
use super::rays::{RayHit, Rays};
use super::{Follow, LightingContext, RaySamples, Tracing, kernels};
use crate::bsdf::Bsdf;
use crate::footprint::{Cone, Footprint};
use crate::light_sampler::Receiver;
use crate::placed::{PlacedSurface, SurfaceKind};
use crate::reference::SurfacePoint;
use crate::{LANES, Scattering, Tint};

/// The most surfaces that a path meets: those that let it pass count, and may be many.
const MOST_STEPS: u32 = 4096;

/// A surface that a path met by itself.
pub(super) struct Encounter {
    pub(super) hit: RayHit,
    /// The ray's start (m) and its unit direction.
    pub(super) ray: (DVec3, DVec3),
    /// Point where the path left the last surface that scattered it, as lights were chosen for it.
    pub(super) receiver: Receiver,
}

impl Encounter {
    /// Tests whether it is the front of the triangle that was met.
    pub(super) fn is_front(&self) -> bool {
        self.hit.normal.dot(self.ray.1) <= 0.0
    }
}

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Traces the camera's rays.
    pub(super) fn trace<R: Rays>(
        &mut self,
        camera: &RaySamples<'_>,
        workspace: &mut Workspace<R>,
        patch: &mut Patch,
        out: &mut [f64],
    ) {
        workspace.radiance.resize(self.count(), 0.0);
        self.start(camera, &mut workspace.now);
        let mut coherent = camera.rays.coherent;
        for number in 0..MOST_STEPS {
            if workspace.now.rays.len() == 0 {
                break;
            }
            let step = Step {
                camera,
                number,
                asks_emitters: self.asks_emitters(),
                is_mixed: !self.ctx.traits.is_matte,
            };
            self.find_hits(workspace, coherent);
            self.meet(&step, workspace, out);
            if workspace.alive.is_empty() {
                break;
            }
            self.draw(&step, workspace);
            workspace.onward.next.restart(self.ctx);
            workspace.onward.last.clear();
            workspace.onward.of_last.clear();
            workspace.shadows.restart(self.ctx);
            if step.is_mixed {
                self.step_kinds(&step, workspace, patch);
            } else {
                self.step_matte(&step, workspace, patch);
            }
            // From neighbouring places to lights: as coherent as what they start from.
            self.light(workspace, coherent, out);
            self.ask_emitters(&step, workspace, out);
            std::mem::swap(&mut workspace.now, &mut workspace.onward.next);
            coherent = false;
        }
    }

    /// The camera's rays as paths.
    fn start<R: Rays>(&self, camera: &RaySamples<'_>, paths: &mut Paths<R>) {
        paths.carried.clear();
        paths.rays.take(self.ctx, camera.rays);
        let Carried { ray, ways, throughput, media, .. } = &mut paths.carried;
        *media = self.media_at_origins(camera.rays);
        for i in 0..camera.rays.len() {
            ray.push(u32::try_from(i).unwrap_or(u32::MAX));
            ways.push(Way::CAMERA);
            let bands = 0..self.count();
            throughput.extend(bands.map(|k| f64::from(u8::from(camera.bands.contains(&k)))));
        }
    }

    /// Finds the closest hit of each path, and takes what media absorb on the way.
    fn find_hits<R: Rays>(&mut self, workspace: &mut Workspace<R>, coherent: bool) {
        let Workspace { now, placements, coincident, .. } = workspace;
        if !self.times.is_empty() {
            now.rays.set_times(now.carried.ray.iter().map(|&ray| self.times[ray as usize]));
        }
        now.rays.closest(self.ctx, coherent);
        now.rays.placements(placements);
        self.tally.rays += now.rays.len() as u64;
        if self.ctx.traits.has_media {
            self.absorb(now);
        }
        self.find_coincident(&now.rays, coincident);
    }

    /// As what the hits of a surface are worked on in this scene.
    #[inline(always)]
    fn kind_of(&self, placed: &PlacedSurface) -> SurfaceKind {
        let traits = &self.ctx.traits;
        let parts_media = traits.has_media || traits.has_dispersion;
        match placed.kind {
            SurfaceKind::Smooth if parts_media && !placed.is_opaque => SurfaceKind::Other,
            kind => kind,
        }
    }

    /// Adds the light that paths met by themselves, and lists those that go on.
    fn meet<R: Rays>(&mut self, step: &Step<'_>, workspace: &mut Workspace<R>, out: &mut [f64]) {
        let Workspace { now, placements, kinds, alive, missed, asked, radiance, .. } = workspace;
        let LightingContext { lights, spectral, scene, .. } = self.ctx;
        let count = self.count();
        alive.clear();
        kinds.iter_mut().for_each(Vec::clear);
        missed.clear();
        let sky = lights.sky.as_ref();
        let Carried { ray, ways, throughput, .. } = &now.carried;
        let carried = |i: usize| &throughput[i * count..(i + 1) * count];
        for ((number, i), &placement) in (0_u32..).zip(0..).zip(&*placements) {
            let bounces = now.bounces(step.number, i);
            let Some(placed) = self.ctx.placed.get(placement) else {
                if sky.is_some_and(|sky| sky.visible || bounces > 0) {
                    missed.push(number);
                }
                continue;
            };
            // A last ray goes on only where the surface that it met may not be there.
            let scatters = !ways[i].is_last && bounces < self.rules.bounces;
            if scatters || placed.may_vanish() {
                let kind = self.kind_of(placed);
                match KINDS.iter().position(|&own| own == kind) {
                    Some(kind) if step.is_mixed => kinds[kind].push(number),
                    Some(_) => alive.push(ray[i]),
                    None => {}
                }
            }
            if !placed.is_seen {
                continue;
            }
            let ends = (now.rays.origin(i), now.rays.direction(i));
            let receiver = ways[i].receiver(now.from(i));
            let encounter = Encounter { hit: now.rays.hit(i), ray: ends, receiver };
            let footprint = || self.footprint(step, now, i);
            let Some(weight) = self.light_of_hit(&encounter, ways[i], footprint, radiance) else {
                continue;
            };
            radiance.iter_mut().zip(carried(i)).for_each(|(r, t)| *r *= t * weight);
            let group = || lights.group_of_placement(scene, encounter.hit.id[0]);
            self.add(radiance, self.parts.row(ray[i], bounces, group), out);
        }
        let wanted = missed.iter().map(|&i| {
            let i = i as usize;
            // The camera's rays are not all traced: those that cannot hit anything are other ones in blocks.
            if step.number == 0 {
                return (None, step.camera.rays.direction(i));
            }
            let receiver = (!ways[i].is_specular).then(|| ways[i].receiver(now.from(i)));
            (receiver, now.rays.direction(i))
        });
        lights.environment(spectral, wanted, asked, radiance, |number, of_sky, light| {
            let i = missed[number] as usize;
            let weight = ways[i].weight_against(of_sky);
            light.iter_mut().zip(carried(i)).for_each(|(r, t)| *r *= t * weight);
            let bounces = now.bounces(step.number, i);
            self.add(light, self.parts.row(ray[i], bounces, || lights.group_of_sky()), out);
        });
        if step.is_mixed {
            alive.extend(kinds.iter().flatten().map(|&i| ray[i as usize]));
        }
    }

    /// Cone that path `i` stands for where it hit, as wide as there; a point where it was scattered by chance.
    pub(super) fn cone_at_hit<R: Rays>(
        &self,
        step: &Step<'_>,
        now: &Paths<R>,
        i: usize,
    ) -> Option<Cone> {
        let t = now.rays.t(i);
        if step.number > 0 {
            return Some((*now.carried.cones.get(i)?)?.after(t));
        }
        let hit = now.rays.origin(i) + now.rays.direction(i) * t;
        // A block's ray may start nearer.
        let (origin, direction) = (step.camera.rays.origin(i), step.camera.rays.direction(i));
        let cone = self.ctx.scene.view.cone(direction)?;
        Some(cone.after((hit - origin).dot(direction)))
    }

    /// Footprint of path `i` where it hit.
    pub(super) fn footprint<R: Rays>(
        &self,
        step: &Step<'_>,
        now: &Paths<R>,
        i: usize,
    ) -> Option<Footprint> {
        let Cone { width, .. } = self.cone_at_hit(step, now, i)?;
        let direction = match step.number {
            0 => step.camera.rays.direction(i),
            _ => now.rays.direction(i),
        };
        Some(Footprint { direction, width })
    }

    /// The light of a surface that was met, and its weight against having asked for it; `None` if there is none.
    pub(super) fn light_of_hit(
        &self,
        encounter: &Encounter,
        way: Way,
        footprint: impl Fn() -> Option<Footprint>,
        radiance: &mut [f64],
    ) -> Option<f64> {
        let LightingContext { lights, scene, spectral, .. } = self.ctx;
        let Encounter { hit, ray: (origin, direction), receiver } = encounter;
        let is_front = encounter.is_front();
        let weight = |pdf: f64| way.weight_against(if pdf.is_finite() { pdf } else { 0.0 });
        if let Some(index) = lights.index_of(hit.id)
            && let Some((area_light, bands)) = lights.plain_triangle(index, self.count())
        {
            if !is_front && !area_light.two_sided {
                return None;
            }
            radiance.copy_from_slice(bands);
            if way.is_specular {
                return Some(1.0);
            }
            let cosine = direction.dot(area_light.shape.normal).abs();
            let distance = hit.t + (*origin - receiver.point).length();
            let density = distance * distance / (cosine * area_light.shape.area);
            return Some(weight(lights.chance(receiver, index) * density));
        }
        let placement = scene.geometry.placements.get(hit.id[0] as usize)?;
        let [u, v] = hit.weights;
        let corner = SurfacePoint::corner(scene.geometry, placement, hit.id[1] as usize);
        let (weights, footprint) = ([1.0 - u - v, u, v], footprint());
        let point = SurfacePoint { weights, time: hit.time, footprint, ..corner };
        let material = scene.material(&point)?;
        if material.scattering == Scattering::Unlit {
            let (tint, alpha) = scene.base_tint(spectral, material, &point);
            spectral.spread_tint(&tint, radiance);
            let is_there = is_front || !material.one_sided;
            return (way.is_specular && is_there).then(|| material.alpha.opacity(alpha));
        }
        if !lights.emitted(scene, spectral, &point, is_front, radiance) {
            return None;
        }
        let pdf = lights.pdf_of_surface(scene, hit.id[0], &point, receiver, *direction);
        Some(weight(pdf))
    }

    /// Draws what this step needs for all paths that go on.
    fn draw<R: Rays>(&self, step: &Step<'_>, workspace: &mut Workspace<R>) {
        let LightingContext { lights, traits, .. } = self.ctx;
        // Paths that passed surfaces have been scattered less often.
        let [least, most] = if traits.may_pass() { [0, step.number] } else { [step.number; 2] };
        let follows = self.rules.follow == Follow::All && !self.is_end(least);
        let roulette = self.rules.roulette.is_some_and(|after| most + 1 >= after);
        for draw in Draw::ALL {
            let needs = match draw {
                Draw::Choice => traits.has_choice,
                Draw::Light => {
                    lights.are_several() || lights.are_extended() || traits.has_dispersion
                }
                Draw::Direction => follows || lights.is_hittable() || traits.has_choice,
                Draw::Chance => (roulette && !self.is_end(least)) || traits.has_alpha,
            };
            let drawn = &mut workspace.drawn[draw as usize];
            drawn.clear();
            if needs {
                let pair = step.number * DRAWS + draw as u32;
                step.camera.samples.squares_of_pair(&workspace.alive, pair, drawn);
            }
        }
    }

    /// Tests whether the next surface that scatters a path is its last.
    #[inline(always)]
    pub(super) fn is_end(&self, bounces: u32) -> bool {
        bounces + 1 >= self.rules.bounces
    }

    /// The same unless it is specular.
    #[inline(always)]
    pub(super) fn is_end_unless_specular(&self, bounces: u32) -> bool {
        self.is_end(bounces) || self.rules.follow == Follow::Single
    }

    /// The step of all paths where all surfaces are matte: hits stay where they are, among those of paths that end.
    fn step_matte<R: Rays>(
        &self,
        step: &Step<'_>,
        workspace: &mut Workspace<R>,
        patch: &mut Patch,
    ) {
        let (mut alive, len) = (0, workspace.now.rays.len());
        for first in (0..len).step_by(LANES) {
            let run = first..len.min(first + LANES);
            workspace.now.rays.unpack_run(patch, run.clone());
            patch.colors.resize(patch.count, Tint::BLACK);
            workspace.picked.clear();
            for (lane, i) in run.enumerate() {
                let placed = self.ctx.placed.get(workspace.placements[i]);
                let is_matte = |placed: &&PlacedSurface| placed.kind == SurfaceKind::Matte;
                let Some(placed) = placed.filter(is_matte) else { continue };
                if workspace.now.carried.ways[i].is_last {
                    continue;
                }
                self.look_up_matte(step, &workspace.now, patch, (i, lane), placed);
                patch.path.push((i, alive));
                workspace.picked.push(lane);
                alive += 1;
            }
            self.step_patch(step, workspace, patch, SurfaceKind::Matte);
        }
    }

    /// The step of all paths where surfaces are of several kinds: those of one side by side.
    fn step_kinds<R: Rays>(
        &self,
        step: &Step<'_>,
        workspace: &mut Workspace<R>,
        patch: &mut Patch,
    ) {
        workspace.smooth.clear();
        let mut alive = 0;
        for (number, kind) in KINDS.into_iter().enumerate() {
            let paths = std::mem::take(&mut workspace.kinds[number]);
            for chunk in paths.chunks(LANES) {
                let numbered = (alive..).zip(chunk).map(|(k, &i)| (i as usize, k));
                alive += chunk.len();
                self.step_side_by_side(step, workspace, patch, (kind, numbered));
            }
            workspace.kinds[number] = paths;
        }
        let smooth = std::mem::take(&mut workspace.smooth);
        for chunk in smooth.chunks(LANES) {
            let own = (SurfaceKind::Other, chunk.iter().copied());
            self.step_side_by_side(step, workspace, patch, own);
        }
        workspace.smooth = smooth;
    }

    /// The step of paths that met surfaces of one kind, at most as many as a patch has lanes: their numbers, and
    /// which of those that go on they are.
    fn step_side_by_side<R: Rays>(
        &self,
        step: &Step<'_>,
        workspace: &mut Workspace<R>,
        patch: &mut Patch,
        (kind, paths): (SurfaceKind, impl Iterator<Item = (usize, usize)> + Clone),
    ) {
        let Workspace { now, side_by_side, picked, .. } = workspace;
        now.rays.unpack_picked(patch, side_by_side, paths.clone().map(|(i, _)| i));
        patch.colors.resize(patch.count, Tint::BLACK);
        picked.clear();
        for (lane, (i, k)) in paths.enumerate() {
            let now = &workspace.now;
            let Some(placed) = self.ctx.placed.get(workspace.placements[i]) else { continue };
            match kind {
                SurfaceKind::Black => continue,
                SurfaceKind::Matte => self.look_up_matte(step, now, patch, (i, lane), placed),
                SurfaceKind::Sheet => {
                    if !self.look_up_sheet(step, now, patch, (i, lane), placed) {
                        workspace.smooth.push((i, k));
                        continue;
                    }
                }
                SurfaceKind::Smooth => self.look_up_smooth(step, now, patch, (i, lane), placed),
                SurfaceKind::Other => {
                    if !self.look_up_other(step, workspace, patch, ((i, k), lane), placed) {
                        continue;
                    }
                }
            }
            patch.path.push((i, k));
            workspace.picked.push(lane);
        }
        self.step_patch(step, workspace, patch, kind);
    }

    /// The step of the hits that were picked of a patch, all of one kind.
    fn step_patch<R: Rays>(
        &self,
        step: &Step<'_>,
        workspace: &mut Workspace<R>,
        patch: &mut Patch,
        kind: SurfaceKind,
    ) {
        if workspace.picked.is_empty() {
            return;
        }
        let roundings = self.ctx.roundings();
        kernels::measure(patch, roundings);
        if patch.is_tilted {
            kernels::bend(patch);
        }
        if kind == SurfaceKind::Sheet {
            patch.sheets.view(&patch.seen.shading, &patch.seen.direction);
        }
        let is_delta = |bsdf: &Bsdf| bsdf.is_delta();
        // What scatters light of single directions asks none.
        let asks = match kind {
            SurfaceKind::Matte | SurfaceKind::Sheet => true,
            SurfaceKind::Black | SurfaceKind::Smooth => false,
            SurfaceKind::Other => !patch.bsdfs.iter().all(is_delta),
        };
        if asks && !self.ctx.lights.is_dark() {
            self.choose_lights(workspace, patch);
            kernels::aim(patch, roundings);
            self.ask_lights(step, workspace, patch, kind);
        }
        self.scatter(step, workspace, patch, kind);
    }

    /// A path that goes straight on, as the surface that it met is not there, from `start` (m) beside the triangles
    /// in that place; into `media`, where it parts any.
    pub(super) fn pass<R: Rays>(
        &self,
        step: &Step<'_>,
        workspace: &mut Workspace<R>,
        i: usize,
        (start, ends): (DVec3, [PlacedTriangle; 2]),
        media: Option<Media>,
    ) {
        let Workspace { now, onward, .. } = workspace;
        let cone = self.cone_at_hit(step, now, i);
        let surfaces = now.carried.passages.get(i).map_or(0, |passage| passage.surfaces);
        let passage = Passage { surfaces: surfaces + 1, from: Some(now.from(i)) };
        onward.next.rays.push([start, now.rays.direction(i)], f64::INFINITY, || ends);
        let to = &mut onward.next.carried;
        to.ray.push(now.carried.ray[i]);
        to.ways.push(now.carried.ways[i]);
        to.cones.push(cone);
        to.passages.push(passage);
        let bands = i * self.count()..(i + 1) * self.count();
        to.throughput.extend_from_slice(&now.carried.throughput[bands]);
        self.push_own(now, to, i);
        if let (Some(media), Some(own)) = (media, to.media.last_mut()) {
            *own = media;
        }
    }

    /// The media and the wavelength of path `i`, where they count.
    pub(super) fn push_own<R: Rays>(&self, now: &Paths<R>, to: &mut Carried, i: usize) {
        if self.ctx.traits.has_media {
            to.media.push(now.carried.media_of(i));
        }
        if self.ctx.traits.has_dispersion {
            to.wavelengths.push(now.carried.wavelength_of(i));
        }
    }
}
