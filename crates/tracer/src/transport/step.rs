//! The step of all paths that go on, side by side: at each surface that was met a light is asked and a
//! direction is followed. Matte surfaces are worked out in loops that vectorise, whatever they are of;
//! what scatters in other ways shares with them all but its own formula.

use etendue_geometry::HitPrecision;
use etendue_geometry::glam::DVec3;

use super::dispersion::{Boundary, keep_one};
use super::media::Coincident;
use super::numbers::Draw;
use super::patch::{LANES, Patch, at, put};
use super::paths::State;
use super::{Follow, Scratch, Tracing, kernels};
use crate::bsdf::Weights;
use crate::placed::{PlacedSurface, SurfaceKind};
use crate::reference::SurfacePoint;
use crate::sampling::power_heuristic;
use crate::surface::SurfaceInteraction;
use crate::target::Chosen;
use crate::{Scattering, Tint};

impl<const RGB: bool> Tracing<'_, RGB> {
    /// The step of all paths that go on.
    pub(super) fn step_all(&mut self, scratch: &mut Scratch) {
        let mut patch = std::mem::take(&mut scratch.patch);
        for is_matte in [true, false] {
            patch.clear();
            for k in 0..scratch.alive.len() {
                let i = scratch.alive[k] as usize;
                let Some(placed) = self.stage.placed.get(scratch.hits.placement[i]) else {
                    continue;
                };
                if (placed.kind == SurfaceKind::Matte) != is_matte {
                    continue;
                }
                if is_matte {
                    self.gather_matte(scratch, &mut patch, (i, k), placed);
                } else {
                    self.gather_other(scratch, &mut patch, (i, k), placed);
                }
                if patch.count == LANES {
                    self.step_patch(scratch, &mut patch);
                }
            }
            if patch.count > 0 {
                self.step_patch(scratch, &mut patch);
            }
        }
        scratch.patch = patch;
    }

    /// The step of the paths of a patch, which is emptied.
    fn step_patch(&mut self, scratch: &mut Scratch, patch: &mut Patch) {
        let roundings = self.stage.roundings();
        kernels::measure(patch, roundings);
        if patch.bsdfs.is_empty() {
            kernels::bend(patch);
        }
        if !self.stage.lights.is_dark() {
            self.choose(scratch, patch);
            kernels::aim(patch, roundings);
            self.ask(scratch, patch);
        }
        self.scatter(scratch, patch);
        patch.clear();
    }

    /// Adds a hit on a matte surface.
    #[inline]
    fn gather_matte(
        &self,
        scratch: &Scratch,
        patch: &mut Patch,
        (i, k): (usize, usize),
        placed: &PlacedSurface,
    ) {
        let Scratch { now, hits, .. } = scratch;
        let state = &now.states[i];
        if state.is_last || state.bounces >= self.rules.bounces {
            return;
        }
        let lane = patch.push((now, hits), (i, k), placed);
        if let (Some(color), false) = (placed.color, placed.is_tilted) {
            patch.colors.push(color);
            return;
        }
        let around = &self.stage.surroundings;
        let footprint = now.footprint(hits, i);
        let surface = around.spot(hits, i).map(|spot| SurfacePoint { footprint, ..spot });
        let surface = surface.and_then(|spot| Some((spot, around.material(&spot)?)));
        let Some((spot, material)) = surface else { return patch.colors.push(Tint::BLACK) };
        if placed.is_tilted {
            let front = hits.normal(i);
            let tilted = spot.tilted_normal(around, material, placed.turn.as_ref(), front);
            put(&mut patch.seen.shading, lane, tilted);
        }
        patch.colors.push(
            placed.color.unwrap_or_else(|| {
                around.base_tint(self.stage.spectral, material, &spot).0.clamped()
            }),
        );
    }

    /// Adds a hit on a surface that may scatter light in any way, or not be there.
    fn gather_other(
        &self,
        scratch: &mut Scratch,
        patch: &mut Patch,
        (i, k): (usize, usize),
        placed: &PlacedSurface,
    ) {
        let Scratch { now, next, hits, coincident, numbers, .. } = scratch;
        let footprint = now.footprint(hits, i);
        let Some(mut met) = SurfaceInteraction::new(self.stage, &now.rays, hits, i, footprint)
        else {
            return;
        };
        let bands = i * self.count()..(i + 1) * self.count();
        if met.material.has_alpha() && numbers.of(Draw::Chance, k)[0] >= met.opacity() {
            let direction = now.rays.direction(i);
            let mut state = now.states[i];
            state.steps += 1;
            state.cone = state.cone.map(|cone| cone.after(hits.t[i]));
            let left = [hits.placement[i], hits.triangle[i]];
            next.push((met.anchor.leave(direction), direction), left, state);
            next.throughput.extend_from_slice(&now.throughput[bands]);
            return;
        }
        let coplanar = coincident.get(i).copied().unwrap_or(Coincident::NONE);
        let crossing = self.cross(now.states[i].media, (hits.placement[i], coplanar), &mut met);
        if let Some(vanished) = self.vanishes(hits.placement[i], &met) {
            let direction = now.rays.direction(i);
            let mut state = now.states[i];
            state.steps += 1;
            state.cone = state.cone.map(|cone| cone.after(hits.t[i]));
            let after = crossing.map(|crossing| crossing.after(direction, hits.normal(i)));
            state.media = after.unwrap_or(state.media);
            let left = [hits.placement[i], hits.triangle[i]];
            let ray = (met.anchor.leave(direction), direction);
            next.push_beside(ray, [left, [coplanar.placement, coplanar.triangle]], state);
            let tint = vanished.is_tinted.then(|| met.color());
            let carried = now.throughput[bands].iter().enumerate();
            let share = |k| tint.as_ref().map_or(1.0, |tint| self.band(tint, k));
            next.throughput.extend(carried.map(|(k, band)| band * share(k)));
            return;
        }
        let state = &mut now.states[i];
        if state.is_last || state.bounces >= self.rules.bounces {
            return;
        }
        let middle = || self.stage.spectral.wavelength(0);
        let spectral = self.stage.spectral;
        let around = &self.stage.surroundings;
        let mut bsdf = met.bsdf(around, spectral, state.wavelength.unwrap_or_else(middle));
        if let Scattering::Dielectric(glass) = &met.material.scattering
            && state.wavelength.is_none()
            && met.disperses(&self.stage.surroundings)
        {
            if glass.roughness == 0.0 {
                let boundary = Boundary { path: (i, k), met: &met, crossing, bsdf };
                return self.disperse(&boundary, scratch);
            }
            let throughput = &mut now.throughput[bands];
            keep_one(throughput, state, self.stage.spectral, numbers.of(Draw::Choice, k)[0]);
            let wavelength = state.wavelength.unwrap_or_else(middle);
            bsdf = met.bsdf(around, spectral, wavelength);
        }
        patch.push((now, hits), (i, k), placed);
        patch.bsdfs.push(bsdf);
        patch.crossings.push(crossing);
    }

    /// Chooses a light for each hit, and a place on it.
    fn choose(&self, scratch: &mut Scratch, patch: &mut Patch) {
        let super::LightingContext { lights, surroundings: around, spectral, .. } = self.stage;
        let (numbers, asked, count) = (&scratch.numbers, &mut scratch.asked, self.count());
        patch.radiance.resize(LANES * count, 0.0);
        asked.clear();
        for lane in 0..patch.count {
            let (_, k) = patch.path[lane];
            let square = numbers.of(Draw::Light, k);
            let asks = patch.bsdfs.get(lane).is_none_or(|bsdf| !bsdf.is_delta());
            let receiver = patch.receiver(lane);
            let radiance = &mut patch.radiance[lane * count..(lane + 1) * count];
            let chosen = match asks {
                true => lights.choose(around, spectral, &receiver, square, radiance),
                false => Chosen::Dark,
            };
            match chosen {
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
    fn ask(&self, scratch: &mut Scratch, patch: &mut Patch) {
        let Scratch { now, hits, shadows, .. } = scratch;
        if patch.bsdfs.is_empty() {
            kernels::reflect(patch);
        } else {
            weigh(patch);
        }
        let Patch {
            count,
            path,
            away,
            targets,
            colors,
            bsdfs,
            weights,
            crossings,
            radiance,
            picked,
            ..
        } = patch;
        picked.clear();
        picked.extend((0..*count).filter(|&lane| away.value[lane] > 0.0));
        shadows.rays.extend_picked(&away.start, &away.along, &away.reach, picked);
        if self.stage.precision == HitPrecision::Double {
            shadows.rays.end_on_triangles(picked.iter().map(|&lane| {
                let (i, _) = path[lane];
                [[hits.placement[i], hits.triangle[i]], targets.id[lane]]
            }));
        }
        shadows.row.extend(picked.iter().map(|&lane| {
            let state = &now.states[path[lane].0];
            let (lights, around) = (self.stage.lights, &self.stage.surroundings);
            let group = || lights.group_of(around, [targets.id[lane][0], targets.light[lane]]);
            self.parts.row(state.ray, state.bounces + 1, group)
        }));
        shadows.is_delta.extend(picked.iter().map(|&lane| targets.is_delta[lane] > 0.0));
        if self.stage.traits.has_media {
            let after = |&lane: &usize| {
                let (i, _) = path[lane];
                let crossing = crossings.get(lane).copied().flatten();
                let media = now.states[i].media;
                crossing.map_or(media, |c| c.after(at(&away.along, lane), hits.normal(i)))
            };
            shadows.media.extend(picked.iter().map(after));
        }
        for &lane in picked.iter() {
            let start = path[lane].0 * self.count();
            let throughput = &now.throughput[start..start + self.count()];
            let light =
                radiance[lane * self.count()..(lane + 1) * self.count()].iter().zip(throughput);
            let value = away.value[lane];
            match bsdfs.get(lane) {
                None => {
                    let all = &mut shadows.contribution;
                    let start = all.len();
                    all.extend(light.map(|(l, t)| l * t * value));
                    self.tinted(&colors[lane], &mut all[start..]);
                }
                Some(bsdf) => {
                    let weights = weights[lane];
                    shadows.contribution.extend(
                        light
                            .enumerate()
                            .map(|(k, (l, t))| l * t * value * self.in_band(bsdf, weights, k)),
                    );
                }
            }
        }
    }

    /// Chooses a direction for each hit, and notes the path along it.
    fn scatter(&self, scratch: &mut Scratch, patch: &mut Patch) {
        if patch.bsdfs.is_empty() {
            self.scatter_matte(scratch, patch);
        } else {
            self.scatter_others(scratch, patch);
        }
    }

    fn scatter_matte(&self, scratch: &mut Scratch, patch: &mut Patch) {
        let Scratch { now, numbers, .. } = scratch;
        let hittable = self.stage.lights.is_hittable();
        let follows_any = self.rules.follow == Follow::All;
        let ends = |state: &State| state.bounces + 1 >= self.rules.bounces || !follows_any;
        if !hittable && patch.path.iter().all(|&(i, _)| ends(&now.states[i])) {
            return;
        }
        let mut squares = [[0.5; 2]; LANES];
        for (square, &(_, k)) in squares.iter_mut().zip(&patch.path) {
            *square = numbers.of(Draw::Direction, k);
        }
        kernels::scatter(patch, &squares);
        patch.picked.clear();
        for lane in 0..patch.count {
            let (i, _) = patch.path[lane];
            let state = &mut now.states[i];
            let is_last = ends(state);
            let pdf = patch.away.value[lane];
            if pdf <= 0.0 || (is_last && !hittable) {
                continue;
            }
            let throughput = &mut now.throughput[i * self.count()..(i + 1) * self.count()];
            self.tinted(&patch.colors[lane], throughput);
            state.cone = None;
            state.pdf = pdf;
            state.is_last = is_last;
            patch.picked.push(lane);
        }
        self.follow(scratch, patch);
    }

    fn scatter_others(&self, scratch: &mut Scratch, patch: &mut Patch) {
        let Scratch { now, hits, numbers, .. } = scratch;
        let hittable = self.stage.lights.is_hittable();
        patch.picked.clear();
        for lane in 0..patch.count {
            let (i, k) = patch.path[lane];
            let bsdf = patch.bsdfs[lane];
            let state = &mut now.states[i];
            let ends = state.bounces + 1 >= self.rules.bounces;
            if (ends || self.rules.follow == Follow::Single) && !hittable && !bsdf.has_single() {
                continue;
            }
            let choice = numbers.of(Draw::Choice, k)[1];
            let Some(scattered) = bsdf.sample(choice, numbers.of(Draw::Direction, k)) else {
                continue;
            };
            let single = scattered.pdf == f64::INFINITY;
            state.is_last = ends || !(single || self.rules.follow == Follow::All);
            if state.is_last && !single && !hittable {
                continue;
            }
            let throughput = &mut now.throughput[i * self.count()..(i + 1) * self.count()];
            for (k, band) in throughput.iter_mut().enumerate() {
                *band *= self.in_band(&bsdf, scattered.weights, k);
            }
            // Seen by chance from one point, a surface is a point.
            state.cone = state.cone.filter(|_| single).map(|cone| cone.after(hits.t[i]));
            state.pdf = scattered.pdf;
            // What leaves another surface within a body is still in it.
            if let Some(crossing) = &patch.crossings[lane] {
                state.media = crossing.after(scattered.direction, hits.normal(i));
            }
            let start = patch.leave(lane, scattered.direction);
            patch.send(lane, (start, scattered.direction));
            patch.picked.push(lane);
        }
        self.follow(scratch, patch);
    }

    /// Notes the paths along the rays that leave the picked lanes, but for those that carry nothing or
    /// end by chance.
    fn follow(&self, scratch: &mut Scratch, patch: &mut Patch) {
        let Scratch { now, next, last, hits, coincident, numbers, .. } = scratch;
        let traces_emitters = self.traces_emitters();
        for is_last in [false, true] {
            let paths = if is_last { &mut *last } else { &mut *next };
            let first = paths.states.len();
            let mut kept: Vec<usize> = std::mem::take(&mut paths.kept);
            kept.clear();
            for &lane in &patch.picked {
                let (i, k) = patch.path[lane];
                let state = &now.states[i];
                let asks = state.is_last && state.pdf != f64::INFINITY && traces_emitters;
                if asks != is_last {
                    continue;
                }
                let throughput = &mut now.throughput[i * self.count()..(i + 1) * self.count()];
                let most = throughput.iter().copied().fold(0.0, f64::max);
                let ray = || (at(&patch.away.start, lane), at(&patch.away.along, lane));
                if most <= 0.0 || (asks && !self.may_shine(ray())) {
                    continue;
                }
                let bounces = state.bounces + 1;
                if self.rules.roulette.is_some_and(|after| bounces >= after) && !state.is_last {
                    // Its root: where few paths come this far, ending them saves little and leaves noise.
                    let survival = most.sqrt().min(1.0);
                    if numbers.of(Draw::Chance, k)[1] >= survival {
                        continue;
                    }
                    throughput.iter_mut().for_each(|band| *band /= survival);
                }
                kept.push(lane);
                let (steps, receiver) = (state.steps + 1, patch.receiver(lane));
                paths.states.push(State { steps, bounces, receiver, ..*state });
                paths.throughput.extend_from_slice(throughput);
            }
            let away = &patch.away;
            paths.rays.extend_picked(&away.start, &away.along, &UNLIMITED, &kept);
            if self.stage.precision == HitPrecision::Double {
                paths.rays.end_on_triangles(kept.iter().map(|&lane| {
                    let (i, _) = patch.path[lane];
                    let coplanar = coincident.get(i).copied().unwrap_or(Coincident::NONE);
                    [[hits.placement[i], hits.triangle[i]], [coplanar.placement, coplanar.triangle]]
                }));
            }
            debug_assert_eq!(paths.states.len() - first, kept.len());
            paths.kept = kept;
        }
    }
}

const UNLIMITED: [f64; LANES] = [f64::INFINITY; LANES];

/// For surfaces that are not matte: the weight of what was aimed at over its density, which is 0 where
/// the surface turns nothing of it to the viewer.
pub(super) fn weigh(patch: &mut Patch) {
    patch.weights.clear();
    for lane in 0..patch.count {
        let toward: DVec3 = at(&patch.away.toward, lane);
        let pdf = patch.away.pdf[lane];
        let (value, own) = match pdf < f64::INFINITY {
            true => patch.bsdfs[lane].evaluate(toward),
            false => (Weights::default(), 0.0),
        };
        let is_delta = patch.targets.is_delta[lane] > 0.0;
        let balance = if is_delta { 1.0 } else { power_heuristic(pdf, own) };
        patch.away.value[lane] = if value.is_zero() { 0.0 } else { balance / pdf };
        patch.weights.push(value);
    }
}
