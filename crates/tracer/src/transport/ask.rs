//! Lights that are asked: for each hit of a patch one, a place on it, and a ray to that.

use super::patch::{Compressed, Patch, SheetColors, at};
use super::paths::{Draw, Step, Workspace};
use super::rays::Rays;
use super::{LightingContext, Tracing, kernels};
use crate::LANES;
use crate::bsdf::Weights;
use crate::placed::SurfaceKind;
use crate::sampling::power_heuristic;
use crate::target::Chosen;

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Chooses a light for each hit, and a place on it.
    pub(super) fn choose_lights<R: Rays>(&self, workspace: &mut Workspace<R>, patch: &mut Patch) {
        let LightingContext { lights, scene, spectral, .. } = self.ctx;
        let count = self.count();
        patch.radiance.resize(LANES * count, 0.0);
        let Patch { picks, choices, seen, bsdfs, path, .. } = patch;
        workspace.asked.clear();
        for (&lane, &(_, k)) in workspace.picked.iter().zip(&*path) {
            [picks.square[0][lane], picks.square[1][lane]] = workspace.number(Draw::Light, k);
        }
        // Which light.
        if let Some(below) = lights.few() {
            kernels::pick(picks, below);
        } else {
            // What scatters light of single directions asks none.
            let asks = |lane: &&usize| bsdfs.get(**lane).is_none_or(|bsdf| !bsdf.is_delta());
            lights.restart(choices, LANES);
            for &lane in workspace.picked.iter().filter(asks) {
                choices.push(&seen.receiver(lane, bsdfs.get(lane)), picks.square[0][lane]);
            }
            lights.pick(choices);
            for (number, &lane) in workspace.picked.iter().filter(asks).enumerate() {
                let choice = choices.get(number);
                picks.index[lane] = choice.light;
                // What is left of the number that chose the light chooses the place: both stay even.
                (picks.square[0][lane], picks.chance[lane]) = (choice.u, choice.chance);
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
        if let Some((area_lights, bands)) = lights.few_triangles() {
            kernels::place_on_triangles(patch, area_lights);
            for &lane in &workspace.picked {
                let own = patch.picks.index[lane] as usize * count;
                let radiance = &mut patch.radiance[lane * count..(lane + 1) * count];
                radiance.copy_from_slice(&bands[own..own + count]);
            }
            return;
        }
        let Patch { picks, seen, bsdfs, targets, radiance, path, .. } = patch;
        for (&lane, &(i, _)) in workspace.picked.iter().zip(&*path) {
            let (index, chance) = (picks.index[lane] as usize, picks.chance[lane]);
            let radiance = &mut radiance[lane * count..(lane + 1) * count];
            if chance == 0.0 {
                targets.set(lane, None);
                continue;
            }
            if let Some((area_light, bands)) = lights.plain_triangle(index, count) {
                radiance.copy_from_slice(bands);
                let weights = [picks.square[0][lane], picks.square[1][lane]];
                targets.set_triangle(lane, area_light, weights, chance);
                continue;
            }
            if let Some((point, bands)) = lights.plain_point(index, count) {
                radiance.copy_from_slice(bands);
                targets.set_point(lane, picks.index[lane], point, chance);
                continue;
            }
            let one = ((index, chance), [squares[0][lane], squares[1][lane]]);
            let receiver = seen.receiver(lane, bsdfs.get(lane));
            let ray = workspace.now.carried.ray[i] as usize;
            let time = self.times.get(ray).copied().unwrap_or(0.0);
            match lights.place(scene, spectral, (&receiver, time), one, radiance) {
                Chosen::Dark => targets.set(lane, None),
                Chosen::Place(target) => targets.set(lane, Some(&target)),
                Chosen::Sky { square, chance } => workspace.asked.push(lane, square, chance),
            }
        }
        let Some(sky) = &lights.sky else { return };
        let number = u32::try_from(sky.index).unwrap_or(u32::MAX);
        sky.choose(&mut workspace.asked, |lane, (direction, density), there| {
            targets.set_far(lane, number, direction, density);
            let radiance = &mut radiance[lane * count..(lane + 1) * count];
            lights.spread_sky(spectral, there, radiance);
        });
    }

    /// Notes the rays to the lights that were chosen, and what each brings.
    pub(super) fn ask_lights<R: Rays>(
        &self,
        step: &Step<'_>,
        workspace: &mut Workspace<R>,
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
        let Workspace { now, shadows, picked, .. } = workspace;
        let count = self.count();
        let LightingContext { lights, scene, traits, .. } = self.ctx;
        // Any comparison with NaN is false.
        let lit = Compressed::of(picked.len(), |n| patch.away.value[picked[n]] > 0.0);
        for n in lit.numbers() {
            let Patch { away, targets, radiance, crossings, .. } = &*patch;
            let (lane, (i, _)) = (picked[n], patch.path[n]);
            let value = away.value[lane];
            let along = at(&away.along, lane);
            let ends = || [now.rays.triangle(i), targets.id[lane]];
            shadows.rays.push([at(&away.start, lane), along], away.reach[lane], ends);
            let group = || lights.group_of(scene, [targets.id[lane][0], targets.light[lane]]);
            let bounces = now.bounces(step.number, i);
            let row = self.parts.row(now.carried.ray[i], bounces + 1, group);
            shadows.carried.ray.push(row);
            if traits.has_panes {
                shadows.carried.is_delta.push(targets.is_delta[lane] > 0.0);
            }
            if traits.has_media {
                let own = now.carried.media_of(i);
                let crossing = crossings.get(lane).copied().flatten();
                let media = crossing.map_or(own, |c| c.after(along, now.rays.hit(i).normal));
                shadows.carried.media.push(media);
            }
            let light = radiance[lane * count..(lane + 1) * count].iter();
            let throughput = &now.carried.throughput[i * count..(i + 1) * count];
            let bands = light.zip(throughput);
            let all = &mut shadows.carried.throughput;
            match kind {
                SurfaceKind::Black | SurfaceKind::Smooth => {}
                SurfaceKind::Matte => {
                    let color = &patch.colors[lane];
                    let share = |k| self.band(color, k);
                    all.extend(bands.enumerate().map(|(k, (l, t))| l * t * value * share(k)));
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

    /// Value of the weights of a sheet of facets in band `k`.
    #[inline(always)]
    pub(super) fn in_band_of_sheet(
        &self,
        patch: &Patch,
        lane: usize,
        value: Weights,
        k: usize,
    ) -> f64 {
        let SheetColors { highlight, named } = &patch.sheet_colors[lane];
        if let Some(named) = named {
            return self.in_band_of_metal(*named, patch.sheets.mean[lane], value, k);
        }
        let color = &patch.colors[lane];
        let mut sum = value.white + value.base * self.band(color, k);
        sum += value.highlight * self.band(highlight, k);
        // Smooth surfaces have none.
        if value.deep != 0.0 {
            sum += value.deep * self.deep_band(color, patch.sheets.mean[lane], k);
        }
        sum
    }
}

/// For surfaces that are worked out one by one: the weight of what was aimed at over its density, which is 0 where
/// the surface turns nothing of it to the viewer.
fn weigh(patch: &mut Patch) {
    patch.weights.clear();
    for lane in 0..patch.count {
        let toward = at(&patch.away.toward, lane);
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
