//! Rays to lights: what each brings, and whether anything is in between.

use etendue_geometry::MISS;
use etendue_geometry::glam::DVec3;

use super::media::Coincident;
use super::paths::{Carried, Paths, Step, Workspace};
use super::rays::{RayHit, Rays};
use super::trace::Encounter;
use super::{LightingContext, Tracing};
use crate::emitters::Emitters;
use crate::reference::SurfacePoint;
use crate::surface::SurfaceInteraction;

/// The most surfaces that a shadow ray passes.
const MOST_LAYERS: u32 = 256;

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Tests whether paths that only look for light ask what shines before they ask the scene.
    /// Through surfaces that are partly there they have to be followed.
    pub(super) fn asks_emitters(&self) -> bool {
        self.ctx.emitters.is_some() && !self.ctx.traits.may_pass()
    }

    /// Tests whether there may be light along a ray that asks what shines.
    pub(super) fn may_shine(&self, [origin, direction]: [DVec3; 2]) -> bool {
        let met = |emitters: &Emitters| emitters.may_meet(origin, direction);
        self.ctx.lights.has_environment() || self.ctx.emitters.is_some_and(met)
    }

    /// Adds what lights bring along shadow rays that nothing blocks.
    pub(super) fn light<R: Rays>(
        &mut self,
        workspace: &mut Workspace<R>,
        coherent: bool,
        out: &mut [f64],
    ) {
        let shadows = &mut workspace.shadows;
        let len = shadows.rays.len();
        if len == 0 {
            return;
        }
        if !self.times.is_empty() {
            let rows = self.parts.count();
            let times = shadows.carried.ray.iter().map(|&row| self.times[row as usize / rows]);
            shadows.rays.set_times(times);
        }
        self.tally.shadow_rays += len as u64;
        if self.ctx.traits.may_pass() || shadows.carried.is_delta.contains(&true) {
            return self.light_through(workspace, coherent, out);
        }
        shadows.rays.occlude(self.ctx, coherent);
        let count = self.count();
        let Paths { rays, carried: Carried { ray, media, throughput, .. } } = shadows;
        for (i, (&row, light)) in ray.iter().zip(throughput.chunks_exact_mut(count)).enumerate() {
            if rays.is_blocked(i) {
                continue;
            }
            if let Some(media) = media.get(i) {
                self.dim_along(media, rays.reach(i), light);
            }
            self.add(light, row, out);
        }
    }

    /// The same where surfaces may let light pass: it is dimmed by those that are only partly there, by the media
    /// that it goes through, and by panes where the light is a point or parallel. A light of some size is met
    /// through panes by the paths themselves.
    fn light_through<R: Rays>(
        &mut self,
        workspace: &mut Workspace<R>,
        coherent: bool,
        out: &mut [f64],
    ) {
        let Workspace { shadows, behind, open, coincident, .. } = workspace;
        let Paths { rays, carried: Carried { ray, media, throughput, is_delta, .. } } = shadows;
        let count = self.count();
        let (own_ray, times, parts) = (&*ray, self.times, self.parts.count());
        open.clear();
        open.extend(0..u32::try_from(own_ray.len()).unwrap_or(u32::MAX));
        let mut reaches = Vec::new();
        for layer in 0..MOST_LAYERS {
            reaches.clear();
            reaches.extend((0..rays.len()).map(|k| rays.reach(k)));
            rays.closest(self.ctx, coherent && layer == 0);
            if layer > 0 {
                self.tally.shadow_rays += rays.len() as u64;
            }
            self.find_coincident(rays, coincident);
            behind.restart(self.ctx);
            let mut still = 0;
            for k in 0..open.len() {
                let i = open[k] as usize;
                let light = &mut throughput[i * count..(i + 1) * count];
                let (hit, direction) = (rays.hit(k), rays.direction(k));
                let (is_hit, reach) = (hit.id[0] != MISS, reaches[k]);
                if let Some(media) = media.get(i) {
                    let length = if is_hit { hit.t } else { reach };
                    self.dim_along(media, length, light);
                }
                let interaction = self.interaction((rays.origin(k), direction), &hit);
                let Some(mut interaction) = interaction.filter(|_| is_hit) else {
                    self.add(light, own_ray[i], out);
                    continue;
                };
                let coplanar = coincident.get(k).copied().unwrap_or(Coincident::NONE);
                if let Some(media) = media.get_mut(i)
                    && let Some(crossing) =
                        self.cross(*media, (hit.id[0], coplanar), &mut interaction)
                {
                    *media = crossing.after(direction, hit.normal);
                }
                let is_delta = is_delta.get(i).copied().unwrap_or(false);
                if !self.dim(&interaction, is_delta, hit.id[0], light) {
                    continue;
                }
                let origin = interaction.anchor.leave(direction);
                let left = reach - (origin - rays.origin(k)).length();
                let ends = match coplanar.placement {
                    MISS => [[MISS; 2]; 2],
                    placement => [hit.id, [placement, coplanar.triangle]],
                };
                behind.push([origin, direction], left.max(0.0), || ends);
                open[still] = open[k];
                still += 1;
            }
            open.truncate(still);
            if open.is_empty() {
                return;
            }
            if !times.is_empty() {
                let when = |&i: &u32| times[own_ray[i as usize] as usize / parts];
                behind.set_times(open.iter().map(when));
            }
            std::mem::swap(rays, behind);
        }
    }

    /// A hit of a ray on a surface, without what it covers of that.
    fn interaction(&self, ray: (DVec3, DVec3), hit: &RayHit) -> Option<SurfaceInteraction<'_>> {
        let geometry = self.ctx.scene.geometry;
        let placement = geometry.placements.get(hit.id[0] as usize)?;
        let corner = SurfacePoint::corner(geometry, placement, hit.id[1] as usize);
        let [u, v] = hit.weights;
        let point = SurfacePoint { weights: [1.0 - u - v, u, v], time: hit.time, ..corner };
        SurfaceInteraction::at(self.ctx, (hit.id[0], point), ray, (hit.t, hit.normal))
    }

    /// Dims light by what lets it pass a placement's surface; whether any is left. `is_delta` says that no path that
    /// panes let through can meet the light.
    fn dim(
        &self,
        interaction: &SurfaceInteraction<'_>,
        is_delta: bool,
        placement: u32,
        light: &mut [f64],
    ) -> bool {
        let LightingContext { scene, spectral, traits, .. } = self.ctx;
        let opacity = interaction.opacity();
        if let Some(vanished) = self.vanishes(placement, interaction) {
            let tint = interaction.color();
            for (k, band) in light.iter_mut().enumerate().filter(|_| vanished.is_tinted) {
                *band *= 1.0 - opacity + opacity * self.band(&tint, k);
            }
            return light.iter().any(|band| *band > 0.0);
        }
        let pane = (is_delta && traits.has_panes)
            .then(|| interaction.bsdf(scene, spectral, spectral.wavelength(0)));
        let passed = pane.as_ref().and_then(|pane| Some((pane, pane.straight_through()?)));
        for (k, band) in light.iter_mut().enumerate() {
            let pane = passed.map_or(0.0, |(pane, weights)| self.in_band(pane, weights, k));
            *band *= 1.0 - opacity + opacity * pane;
        }
        light.iter().any(|band| *band > 0.0)
    }

    /// Adds the light that the last directions of paths meet: what shines is asked first, and the scene only
    /// where that was met.
    pub(super) fn ask_emitters<R: Rays>(
        &mut self,
        step: &Step<'_>,
        workspace: &mut Workspace<R>,
        out: &mut [f64],
    ) {
        let Workspace { onward, hits, shadows, missed, asked, radiance, .. } = workspace;
        let (last, of_last) = (&mut onward.last, &onward.of_last);
        let Some(emitters) = self.ctx.emitters.filter(|_| !last.is_empty()) else { return };
        let LightingContext { lights, spectral, scene, traits, .. } = self.ctx;
        let (count, scatterings) = (self.count(), step.number + 1);
        last.from_surface = true;
        last.coherent = false;
        last.precision = self.ctx.precision;
        hits.detail = etendue_geometry::Detail::Surface;
        emitters.closest(last, hits);
        shadows.restart(self.ctx);
        missed.clear();
        let Carried { ray, ways, throughput, left, .. } = of_last;
        let note = |carried: &mut Carried, row: u32, light: &[f64], (i, weight): (usize, f64)| {
            carried.ray.push(row);
            if traits.has_media {
                carried.media.push(of_last.media_of(i));
            }
            let own = &throughput[i * count..(i + 1) * count];
            carried.throughput.extend(light.iter().zip(own).map(|(l, t)| l * t * weight));
        };
        for i in 0..last.len() {
            let (from, direction) = (last.origin(i), last.direction(i));
            let Some(placed) = self.ctx.placed.get(hits.placement[i]) else {
                missed.push(u32::try_from(i).unwrap_or(u32::MAX));
                continue;
            };
            let hit = RayHit {
                id: [hits.placement[i], hits.triangle[i]],
                weights: [hits.u[i], hits.v[i]],
                t: hits.t[i],
                normal: hits.normal(i),
                time: 0.0,
            };
            let receiver = ways[i].receiver(from);
            let encounter = Encounter { hit, ray: (from, direction), receiver };
            let Some(weight) = self.light_of_hit(&encounter, ways[i], || None, radiance) else {
                continue;
            };
            let end = self.ctx.anchor(from + direction * hit.t, hit.normal, from, placed);
            let offset = end.leave(-direction) - from;
            let distance = offset.length();
            // Points that fall together see each other: a ray of no length meets nothing.
            let along = if distance > 0.0 { offset / distance } else { DVec3::Z };
            shadows.rays.push([from, along], distance, || [left[i], hit.id]);
            let group = || lights.group_of_placement(scene, hit.id[0]);
            let row = self.parts.row(ray[i], scatterings, group);
            note(&mut shadows.carried, row, radiance, (i, weight));
        }
        let wanted = missed.iter().map(|&i| {
            let i = i as usize;
            let receiver = (!ways[i].is_specular).then(|| ways[i].receiver(last.origin(i)));
            (receiver, last.direction(i))
        });
        lights.environment(spectral, wanted, asked, radiance, |number, of_sky, light| {
            let i = missed[number] as usize;
            let ends = [last.origin(i), last.direction(i)];
            shadows.rays.push(ends, f64::INFINITY, || [left[i], [MISS; 2]]);
            let row = self.parts.row(ray[i], scatterings, || lights.group_of_sky());
            note(&mut shadows.carried, row, light, (i, ways[i].weight_against(of_sky)));
        });
        self.light(workspace, false, out);
    }
}
