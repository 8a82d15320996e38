//! Light of emitters that paths meet, and that rays to lights bring.

use etendue_geometry::block::LANES;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Detail, HitBatch, RayBatch};

use super::block_lights::{BlockLights, OTHER};
use super::lane::{Lane, Query, round, single, wide};
use super::sky::ask_sky;
use super::{Columns, RayColumns, SPECULAR, TraceStep, Workspace};
use crate::emitters::Emitters;
use crate::footprint::{Cone, Footprint};
use crate::transport::encounter::{Encounter, RayHit, Way};
use crate::transport::{Parts, Tracing};

/// Last directions, as what shines is asked about them, and what they meet of it.
#[derive(Debug, Default)]
pub(super) struct EmitterQuery {
    rays: RayBatch,
    hits: HitBatch,
    light: Vec<f64>,
}

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Adds the light of emitters that paths met, but for those that may not be there.
    pub(super) fn meet<F: Lane>(
        &mut self,
        step: TraceStep<'_>,
        workspace: &mut Workspace<F>,
        out: &mut [f64],
    ) {
        let seen = std::mem::take(&mut workspace.seen);
        seen.iter().for_each(|&i| self.meet_lane(step, workspace, i as usize, out));
        workspace.seen = seen;
    }

    /// Adds the light of the emitter that the path of a lane met.
    pub(super) fn meet_lane<F: Lane>(
        &mut self,
        step: TraceStep<'_>,
        workspace: &mut Workspace<F>,
        i: usize,
        out: &mut [f64],
    ) {
        let hit = self.hit_of(&workspace.rays, i, workspace.carried.ray[i]);
        let from = workspace.passages.from.get(i).copied().unwrap_or(hit.origin);
        let flags = workspace.carried.flags.get(i);
        let is_specular = step.number == 0 || flags.is_some_and(|flags| flags & SPECULAR != 0);
        let way = if is_specular { Way::CAMERA } else { way_of(&workspace.carried, i) };
        // Few lights are chosen with the same chance for all points.
        let receiver = way_of(&workspace.carried, i).receiver(from);
        let encounter = Encounter { hit, receiver };
        let mut light = std::mem::take(&mut workspace.light);
        let footprint = || {
            let Cone { width, .. } = self.cone(step, workspace, i)?;
            let direction = step.direction(i, || hit.direction);
            Some(Footprint { direction, width })
        };
        light.resize(self.count(), 0.0);
        if let Some(weight) = self.light_of_hit(&encounter, way, footprint, &mut light) {
            for (light, band) in light.iter_mut().zip(&workspace.carried.throughput) {
                *light *= wide(band[i]) * weight;
            }
            let group = || self.ctx.lights.group_of_placement(&self.ctx.scene, hit.id[0]);
            let row = self.parts.row(workspace.carried.ray[i], step.number, group);
            self.add(&light, row, out);
        }
        workspace.light = light;
    }

    /// Adds what lights bring along rays that nothing blocks.
    pub(super) fn light<F: Lane>(
        &mut self,
        step: TraceStep<'_>,
        lights: &BlockLights<'_, F>,
        workspace: &mut Workspace<F>,
        out: &mut [f64],
    ) {
        if workspace.shadows.len == 0 {
            return;
        }
        self.tally.shadow_rays += workspace.shadows.len as u64;
        self.find_ends_of_shadows(workspace);
        let Workspace { shadows, shadow_rays, times, batch, .. } = workspace;
        shadows.pack(shadow_rays);
        if self.may_pass_to_lights(shadows) {
            return self.light_through(step, lights, workspace, out);
        }
        self.times_of::<F>(shadows.carried.ray[..shadows.len].iter().copied(), times);
        let query = Query { times, ends: &shadows.ends, coherent: step.is_coherent() };
        F::occlude(self.ctx, shadow_rays, query, batch);
        let (count, mut three) = (self.count(), [0.0; 3]);
        let mut more = if RGB { Vec::new() } else { vec![0.0; count] };
        let light: &mut [f64] = if RGB { &mut three } else { &mut more };
        let shares = &shadows.carried.throughput[..count];
        let is_plain = RGB && self.parts == Parts::Whole && shadows.carried.media.is_empty();
        for (block, first) in shadow_rays.blocks().iter().zip((0..).step_by(LANES)) {
            for lane in 0..LANES.min(shadows.len - first) {
                if block.is_blocked(lane) {
                    continue;
                }
                let i = first + lane;
                let radiance = &lights.radiance(shadows.light[i], count)[..count];
                if is_plain && let ([r, g, b], [red, green, blue]) = (shares, radiance) {
                    let light = [wide(r[i]) * red, wide(g[i]) * green, wide(b[i]) * blue];
                    self.add_whole(light, shadows.carried.ray[i], out);
                    continue;
                }
                for band in 0..count {
                    light[band] = wide(shares[band][i]) * radiance[band];
                }
                if let Some(media) = shadows.carried.media.get(i) {
                    self.dim_along(media, wide(shadows.reach[i]), light);
                }
                let group = || lights.group_of(&self.ctx.scene, shadows.light[i]);
                let row = self.parts.row(shadows.carried.ray[i], step.number + 1, group);
                self.add(light, row, out);
            }
        }
    }

    /// Makes last directions that meet an emitter, or the sky, rays to it: they bring its light unless something is in
    /// between.
    pub(super) fn ask_emitters<F: Lane>(
        &self,
        emitters: &Emitters,
        lights: &BlockLights<'_, F>,
        workspace: &mut Workspace<F>,
    ) {
        let Workspace { last, shadows, query, .. } = workspace;
        if last.len > 0 && !emitters.is_empty() {
            last.len = self.ask_surfaces(emitters, query, last, shadows);
        }
        if let Some(sky) = &lights.sky {
            ask_sky::<F, RGB>(sky, self.ctx.spectral, last, shadows);
        }
        last.len = 0;
    }

    /// The same of surfaces that shine; the number of directions that meet none, which are put first.
    fn ask_surfaces<F: Lane>(
        &self,
        emitters: &Emitters,
        query: &mut EmitterQuery,
        last: &mut RayColumns<F>,
        shadows: &mut RayColumns<F>,
    ) -> usize {
        let EmitterQuery { rays, hits, light } = query;
        let origin = F::origin(self.ctx.accel);
        rays.clear();
        for i in 0..last.len {
            rays.push(origin + vector_of(&last.start, i), vector_of(&last.along, i).normalize());
        }
        rays.from_surface = true;
        rays.coherent = false;
        rays.precision = self.ctx.precision;
        hits.detail = Detail::Surface;
        emitters.closest(rays, hits);
        light.resize(self.count(), 0.0);
        let mut rest = 0;
        for i in 0..last.len {
            let Some(placed) = self.ctx.placed.get(hits.placement[i]) else {
                last.copy_within(i, rest);
                rest += 1;
                continue;
            };
            let (from, along) = (rays.origin(i), rays.direction(i));
            let hit = RayHit {
                origin: from,
                direction: along,
                id: [hits.placement[i], hits.triangle[i]],
                weights: [hits.u[i], hits.v[i]],
                t: hits.t[i],
                normal: hits.normal(i),
                time: 0.0,
            };
            let way = way_of(&last.carried, i);
            let encounter = Encounter { hit, receiver: way.receiver(from) };
            let Some(weight) = self.light_of_hit(&encounter, way, || None, light) else { continue };
            let Some(number) = self.ctx.lights.index_of(hit.id) else { continue };
            let end = self.ctx.anchor(from + along * hit.t, hit.normal, from, placed);
            let offset = end.leave(-along) - from;
            let distance = offset.length();
            // Points that fall together see each other: a ray of no length meets nothing.
            let along = if distance > 0.0 { offset / distance } else { DVec3::Z };
            let is_plain = self.ctx.lights.plain_light(number).is_some();
            let number = u32::try_from(number).unwrap_or_default();
            let light_number = if is_plain { number } else { OTHER | number };
            let to = shadows.push(last, i, single(along), round(distance), light_number);
            for (k, band) in light.iter().enumerate() {
                let share = if is_plain { weight } else { weight * band };
                let carried = wide(last.carried.throughput[k][i]);
                shadows.carried.throughput[k][to] = round(carried * share);
            }
        }
        rest
    }
}

/// The way in which a path of some columns came to its direction, if not specular.
fn way_of<F: Lane>(carried: &Columns<F>, i: usize) -> Way {
    Way {
        pdf: wide(carried.pdf[i]),
        is_specular: false,
        normal: carried.normal.each_ref().map(|axis| round(wide(axis[i]))),
    }
}

fn vector_of<F: Lane>(columns: &[Vec<F>; 3], i: usize) -> DVec3 {
    DVec3::from_array(columns.each_ref().map(|axis| axis[i].into()))
}
