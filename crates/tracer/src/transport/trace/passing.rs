//! Obstacles between a path and the surface that scatters it: media that absorb light, surfaces that are
//! partly there, and boundaries between bodies that are not. Rays that pass a surface are traced on within their step, so
//! that all paths of a step have been scattered as often.

use etendue_geometry::RayBlocks;
use etendue_geometry::block::{LANES, vector};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{MISS, PlacedTriangle};

use super::block_lights::{BlockLights, number_of_light};
use super::lane::{Lane, Query, RayEnds, round, single, wide};
use super::single::SingleHits;
use super::{Columns, RayColumns, TraceStep, Workspace};
use crate::footprint::{Cone, Footprint};
use crate::reference::SurfacePoint;
use crate::surface::SurfaceInteraction;
use crate::transport::Draw;
use crate::transport::media::{CoincidentBoundary, Media};
use crate::transport::{LightingContext, RayHit, Tracing};

/// The most surfaces that a path passes within a step, and a ray to a light.
const MOST_PASSED: u32 = 4096;
const MOST_LAYERS: u32 = 256;

/// The passages of paths through surfaces, within a step; memory is kept.
#[derive(Debug, Default)]
pub(super) struct Passages<F> {
    /// The points at which paths left the surfaces that scattered them (m), where some may pass others; else empty.
    pub(super) from: Vec<DVec3>,
    /// Rests of the numbers that decide whether surfaces are there.
    chances: Vec<[f64; 2]>,
    /// Rays behind surfaces that were passed, the triangles that they leave, and whose they are.
    behind: RayBlocks<F>,
    ends: Vec<RayEnds>,
    open: Vec<u32>,
    /// Ends of rays to lights (m), none of those to lights far away, and their light, `[ray][band]`.
    targets: Vec<Option<DVec3>>,
    light: Vec<f64>,
}

impl<const RGB: bool> Tracing<'_, RGB> {
    /// The hit of a lane, which is that of a ray of the camera.
    pub(super) fn hit_of<F: Lane>(&self, rays: &RayBlocks<F>, lane: usize, ray: u32) -> RayHit {
        let (block, i) = (&rays.blocks()[lane / LANES], lane % LANES);
        RayHit {
            origin: F::origin(self.ctx.accel) + vector(&block.origin, i),
            direction: vector(&block.direction, i),
            id: [block.placement[i], block.triangle[i]],
            weights: [block.u[i], block.v[i]].map(|weight| wide(weight).clamp(0.0, 1.0)),
            t: wide(block.t_max[i]),
            normal: vector(&block.normal, i).normalize(),
            time: self.time_of(ray),
        }
    }

    /// A hit as light meets its surface, of which the path of a lane sees some; of a path that came straight from the
    /// camera in the direction that this had.
    pub(super) fn interaction_of<'s, F: Lane>(
        &'s self,
        step: TraceStep<'_>,
        workspace: &Workspace<F>,
        lane: usize,
        hit: &RayHit,
    ) -> Option<SurfaceInteraction<'s>> {
        let geometry = self.ctx.scene.geometry;
        let placement = geometry.placements.get(hit.id[0] as usize)?;
        let direction = step.direction(lane, || hit.direction);
        let cone = self.cone(step, workspace, lane);
        let footprint = cone.map(|Cone { width, .. }| Footprint { direction, width });
        let corner = SurfacePoint::corner(geometry, placement, hit.id[1] as usize);
        let [u, v] = hit.weights;
        let weights = [1.0 - u - v, u, v];
        let point = SurfacePoint { weights, time: hit.time, footprint, ..corner };
        SurfaceInteraction::at(self.ctx, point, &RayHit { direction, ..*hit })
    }

    /// The boundary of another body in the place of a hit.
    pub(super) fn coincident_of(&self, hit: &RayHit) -> CoincidentBoundary {
        if self.ctx.placed.touching.is_empty() || hit.id[0] == MISS {
            return CoincidentBoundary::NONE;
        }
        self.coincident_at(hit.origin + hit.direction * hit.t, hit.direction, hit.id)
    }

    /// Takes paths, whose closest hits were found, to surfaces that are there, through what absorbs their light; adds the
    /// light of surfaces that may not be there.
    pub(super) fn pass<F: Lane>(
        &mut self,
        step: TraceStep<'_>,
        workspace: &mut Workspace<F>,
        out: &mut [f64],
    ) {
        let traits = self.ctx.traits;
        if !(traits.may_pass() || traits.has_media) {
            return;
        }
        let (len, origin) = (workspace.rays.len(), F::origin(self.ctx.accel));
        let mut open = std::mem::take(&mut workspace.passages.open);
        let mut behind = std::mem::take(&mut workspace.passages.behind);
        open.clear();
        open.extend(0..u32::try_from(len).unwrap_or(u32::MAX));
        workspace.passages.from.clear();
        if traits.may_pass() {
            let start = |i: usize| vector(&workspace.rays.blocks()[i / LANES].origin, i % LANES);
            workspace.passages.from.extend((0..len).map(|i| origin + start(i)));
        }
        if traits.has_alpha {
            let (rays, pair) = (&workspace.carried.ray[..len], Draw::Chance.pair(step.number));
            step.camera.samples.squares_of_pair(rays, pair, &mut workspace.passages.chances);
        }
        for _ in 0..MOST_PASSED {
            open.iter().for_each(|&i| self.absorb(workspace, i as usize));
            behind.clear();
            workspace.passages.ends.clear();
            let mut still = 0;
            for k in 0..open.len() {
                let i = open[k] as usize;
                let passed = self.pass_lane(step, workspace, i, out);
                let Some((start, ends)) = passed else { continue };
                workspace.passages.ends.push(ends);
                let (block, lane) = (&workspace.rays.blocks()[i / LANES], i % LANES);
                let along = block.direction.each_ref().map(|axis| axis[lane]);
                behind.push(single(start - origin), along, F::INFINITY);
                open[still] = open[k];
                still += 1;
            }
            open.truncate(still);
            if open.is_empty() {
                break;
            }
            let rays = open.iter().map(|&i| workspace.carried.ray[i as usize]);
            self.times_of::<F>(rays, &mut workspace.times);
            let query =
                Query { times: &workspace.times, ends: &workspace.passages.ends, coherent: false };
            F::closest(self.ctx, &mut behind, query, &mut workspace.batch);
            self.tally.rays += open.len() as u64;
            for (k, i) in open.iter().map(|&i| i as usize).enumerate() {
                let (found, lane) = (&behind.blocks()[k / LANES], k % LANES);
                workspace.rays.blocks_mut()[i / LANES].copy_hit(i % LANES, found, lane);
            }
        }
        (workspace.passages.open, workspace.passages.behind) = (open, behind);
    }

    /// The point at which the path of a lane goes on (m) if it passes the surface that it met, and the triangles that it
    /// leaves.
    fn pass_lane<F: Lane>(
        &mut self,
        step: TraceStep<'_>,
        workspace: &mut Workspace<F>,
        i: usize,
        out: &mut [f64],
    ) -> Option<(DVec3, RayEnds)> {
        let placement = workspace.rays.blocks()[i / LANES].placement[i % LANES];
        let placed = self.ctx.placed.get(placement).filter(|placed| placed.may_vanish())?;
        if placed.is_seen {
            self.meet_lane(step, workspace, i, out);
        }
        let hit = &self.hit_of(&workspace.rays, i, workspace.carried.ray[i]);
        let mut interaction = self.interaction_of(step, workspace, i, hit)?;
        if interaction.material.has_alpha() {
            let chance = &mut workspace.passages.chances[i][0];
            let (is_there, left) = decide(*chance, interaction.opacity());
            *chance = left;
            if !is_there {
                return Some((interaction.anchor.leave(hit.direction), [hit.id, [MISS; 2]]));
            }
        }
        let coplanar = self.coincident_of(hit);
        let own = workspace.carried.media_of(i);
        let crossing = self.cross(own, placement, coplanar, &mut interaction);
        let vanished = self.vanishes(placement, &interaction)?;
        if vanished.is_tinted {
            let tint = interaction.color();
            for (k, column) in workspace.carried.throughput.iter_mut().enumerate() {
                column[i] = round(wide(column[i]) * self.band(&tint, k));
            }
        }
        if let (Some(crossing), Some(own)) = (crossing, workspace.carried.media.get_mut(i)) {
            *own = crossing.after(hit.direction, hit.normal);
        }
        Some((interaction.anchor.leave(hit.direction), [hit.id, coplanar.id()]))
    }

    /// Takes from the path of a lane what the medium absorbs on the way to its hit.
    fn absorb<F: Lane>(&self, workspace: &mut Workspace<F>, i: usize) {
        let media = workspace.carried.media_of(i);
        let (block, lane) = (&workspace.rays.blocks()[i / LANES], i % LANES);
        if media == Media::NONE || block.placement[lane] == MISS {
            return;
        }
        let (t, light) = (wide(block.t_max[lane]), &mut workspace.light);
        light.clear();
        light.extend(workspace.carried.throughput.iter().map(|column| wide(column[i])));
        self.dim_along(&media, t, light);
        for (column, band) in workspace.carried.throughput.iter_mut().zip(light) {
            column[i] = round(*band);
        }
    }

    /// Notes which triangles paths leave.
    pub(super) fn find_ends_of_paths<F: Lane>(&self, workspace: &mut Workspace<F>) {
        if !F::HAS_ENDS {
            return;
        }
        let mut ends = std::mem::take(&mut workspace.next.ends);
        ends.clear();
        let may_touch = !self.ctx.placed.touching.is_empty();
        for &left in &workspace.next.left[..workspace.next.len] {
            let left = left as usize;
            let (block, lane) = (&workspace.rays.blocks()[left / LANES], left % LANES);
            let mut own = [[block.placement[lane], block.triangle[lane]], [MISS; 2]];
            if may_touch {
                let hit = self.hit_of(&workspace.rays, left, workspace.carried.ray[left]);
                own[1] = self.coincident_of(&hit).id();
            }
            ends.push(own);
        }
        workspace.next.ends = ends;
    }

    /// Notes which triangles rays to lights leave and end on.
    pub(super) fn find_ends_of_shadows<F: Lane>(&self, workspace: &mut Workspace<F>) {
        if !F::HAS_ENDS {
            return;
        }
        let Workspace { shadows, rays, .. } = workspace;
        shadows.ends.clear();
        for i in 0..shadows.len {
            let left = shadows.left[i] as usize;
            let (block, lane) = (&rays.blocks()[left / LANES], left % LANES);
            let target = self.ctx.lights.triangle_of(number_of_light(shadows.light[i]));
            shadows.ends.push([[block.placement[lane], block.triangle[lane]], target]);
        }
    }

    /// Notes the media of rays that leave hits, and the one wavelength that is left to each.
    pub(super) fn carry_media<F: Lane>(
        &self,
        rays: &RayBlocks<F>,
        singles: &SingleHits,
        carried: &Columns<F>,
        leaving: &mut RayColumns<F>,
    ) {
        if self.ctx.traits.has_media {
            leaving.carried.media.clear();
            for k in 0..leaving.len {
                let left = leaving.left[k] as usize;
                let (block, lane) = (&rays.blocks()[left / LANES], left % LANES);
                let [x, y, z] = leaving.along.each_ref().map(|axis| wide(axis[k]));
                let after = singles.crossing(left).map(|crossing| {
                    crossing.after(DVec3::new(x, y, z), vector(&block.normal, lane))
                });
                leaving.carried.media.push(after.unwrap_or_else(|| carried.media_of(left)));
            }
        }
        if self.ctx.traits.has_dispersion {
            let own = &mut leaving.carried.wavelengths;
            for k in own.len()..leaving.len {
                own.push(carried.wavelength_of(leaving.left[k] as usize));
            }
        }
    }

    /// Tests whether rays to lights may pass surfaces.
    pub(super) fn may_pass_to_lights<F: Lane>(&self, shadows: &RayColumns<F>) -> bool {
        let is_delta = |light: &u32| self.ctx.lights.is_delta(number_of_light(*light));
        self.ctx.traits.may_pass()
            || (self.ctx.traits.has_panes && shadows.light[..shadows.len].iter().any(is_delta))
    }

    /// Adds what lights bring along rays that surfaces may let pass: those that are partly there dim it, media that it goes
    /// through, and panes where the light is a point or parallel. A light of some size is met through panes by the paths
    /// themselves.
    pub(super) fn light_through<F: Lane>(
        &mut self,
        step: TraceStep<'_>,
        lights: &BlockLights<'_, F>,
        workspace: &mut Workspace<F>,
        out: &mut [f64],
    ) {
        let (count, origin) = (self.count(), F::origin(self.ctx.accel));
        let Workspace { shadows, shadow_rays, times, passages, batch, .. } = workspace;
        let Passages { open, behind, targets, light, ends, .. } = passages;
        ends.clone_from(&shadows.ends);
        light.clear();
        for i in 0..shadows.len {
            let radiance = lights.radiance(shadows.light[i], count);
            let shares = shadows.carried.throughput.iter().map(|column| wide(column[i]));
            light.extend(shares.zip(radiance).map(|(share, band)| share * band));
        }
        open.clear();
        open.extend(0..u32::try_from(shadows.len).unwrap_or(u32::MAX));
        // Rays go on to where they were sent, just before their light: what each surface moves them by would else add up.
        targets.clear();
        targets.extend((0..shadows.len).map(|i| {
            let (block, lane, reach) =
                (&shadow_rays.blocks()[i / LANES], i % LANES, wide(shadows.reach[i]));
            let along = vector(&block.direction, lane);
            reach.is_finite().then(|| origin + vector(&block.origin, lane) + along * reach)
        }));
        for layer in 0..MOST_LAYERS {
            self.times_of::<F>(open.iter().map(|&i| shadows.carried.ray[i as usize]), times);
            let query = Query { times, ends, coherent: step.is_coherent() && layer == 0 };
            F::closest(self.ctx, shadow_rays, query, batch);
            ends.clear();
            self.tally.shadow_rays += if layer > 0 { open.len() as u64 } else { 0 };
            behind.clear();
            let mut still = 0;
            for k in 0..open.len() {
                let i = open[k] as usize;
                let ray = shadows.carried.ray[i];
                let number = number_of_light(shadows.light[i]);
                let own = &mut light[i * count..(i + 1) * count];
                let hit = self.hit_of(shadow_rays, k, ray);
                let media = shadows.carried.media.get_mut(i);
                match self.pass_to_light(&hit, media, self.ctx.lights.is_delta(number), own) {
                    LightVisibility::Unoccluded => {
                        let group = || lights.group_of(&self.ctx.scene, shadows.light[i]);
                        let row = self.parts.row(ray, step.number + 1, group);
                        self.add(own, row, out);
                    }
                    LightVisibility::Occluded => {}
                    LightVisibility::Passed(start, coplanar) => {
                        let target = self.ctx.lights.triangle_of(number);
                        let is_alone = coplanar == [MISS; 2];
                        ends.push([hit.id, if is_alone { target } else { coplanar }]);

                        let (along, left) = match targets[i] {
                            Some(target) => way_to(target, start, hit.direction),
                            None => (hit.direction, f64::INFINITY),
                        };
                        behind.push(single(start - origin), single(along), round(left));
                        open[still] = open[k];
                        still += 1;
                    }
                }
            }
            open.truncate(still);
            if open.is_empty() {
                return;
            }
            std::mem::swap(shadow_rays, behind);
        }
    }

    /// Dims the light of a ray by what it goes through as far as its hit, and tells its media of a boundary there.
    fn pass_to_light(
        &self,
        hit: &RayHit,
        mut media: Option<&mut Media>,
        is_delta: bool,
        light: &mut [f64],
    ) -> LightVisibility {
        if let Some(media) = &media {
            self.dim_along(media, hit.t, light);
        }
        let interaction = self.interaction(hit).filter(|_| hit.id[0] != MISS);
        let Some(mut interaction) = interaction else { return LightVisibility::Unoccluded };
        let coplanar = self.coincident_of(hit);
        if let Some(media) = &mut media
            && let Some(crossing) = self.cross(**media, hit.id[0], coplanar, &mut interaction)
        {
            **media = crossing.after(hit.direction, hit.normal);
        }
        match self.dim(&interaction, is_delta, hit.id[0], light) {
            true => LightVisibility::Passed(interaction.anchor.leave(hit.direction), coplanar.id()),
            false => LightVisibility::Occluded,
        }
    }

    /// A hit of a ray on a surface, without what it covers of that.
    pub(super) fn interaction(&self, hit: &RayHit) -> Option<SurfaceInteraction<'_>> {
        let geometry = self.ctx.scene.geometry;
        let placement = geometry.placements.get(hit.id[0] as usize)?;
        let corner = SurfacePoint::corner(geometry, placement, hit.id[1] as usize);
        let [u, v] = hit.weights;
        let point = SurfacePoint { weights: [1.0 - u - v, u, v], time: hit.time, ..corner };
        SurfaceInteraction::at(self.ctx, point, hit)
    }

    /// Dims light by what lets it pass a placement's surface; true if any is left. `is_delta` says that no path that
    /// panes let through can meet the light.
    pub(super) fn dim(
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
        let is_gltf = interaction.material.scattering.gltf().is_some();
        let pane = (is_delta && traits.has_panes && is_gltf)
            .then(|| interaction.bsdf(scene, spectral, spectral.wavelength(0)))
            .flatten();
        let passed = pane.as_ref().and_then(|pane| Some((pane, pane.straight_through()?)));
        for (k, band) in light.iter_mut().enumerate() {
            let pane = passed.map_or(0.0, |(pane, weights)| self.in_band(pane, weights, k));
            *band *= 1.0 - opacity + opacity * pane;
        }
        light.iter().any(|band| *band > 0.0)
    }
}

/// The unit direction and the length of what is left of a ray to its target from where it goes on; none where it is there.
fn way_to(target: DVec3, start: DVec3, along: DVec3) -> (DVec3, f64) {
    let left = (target - start).length();
    let ahead = (target - start).dot(along);
    if ahead > 0.0 { ((target - start) / left, left) } else { (along, 0.0) }
}

/// Decides by a number in 0..1 whether a surface of some opacity is there; with the rest of the number, again in 0..1 and
/// alike all over.
pub(super) fn decide(chance: f64, opacity: f64) -> (bool, f64) {
    let is_there = chance < opacity;
    (is_there, if is_there { chance / opacity } else { (chance - opacity) / (1.0 - opacity) })
}

/// Visibility of a light along a ray to it.
enum LightVisibility {
    Unoccluded,
    Occluded,
    /// The next surface lets some of its light pass: the ray goes on from here (m); and another triangle in its place.
    Passed(DVec3, PlacedTriangle),
}
