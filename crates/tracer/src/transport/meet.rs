//! What paths come upon by themselves: light, and surfaces to go on from.

use etendue_geometry::HitBatch;

use super::paths::Paths;
use super::{LightingContext, Scratch, Tracing};
use crate::Scattering;
use crate::reference::SurfacePoint;
use crate::surface::SurfaceInteraction;

/// The most steps of a path: surfaces that let it pass count, and may be many.
const MOST_STEPS: u32 = 4096;

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Adds the light that paths met by themselves, and lists those that go on.
    pub(super) fn meet(&mut self, scratch: &mut Scratch, out: &mut [f64]) {
        let Scratch { now, hits, alive, radiance, missed, asked, .. } = scratch;
        alive.clear();
        missed.clear();
        let lit = self.stage.lights.sky.as_ref();
        for (i, state) in now.states.iter().enumerate() {
            let placed = self.stage.placed.get(hits.placement[i]);
            if placed.is_none() && lit.is_some_and(|sky| sky.visible || state.bounces > 0) {
                missed.push(u32::try_from(i).unwrap_or(u32::MAX));
            }
            if placed.is_some_and(|placed| placed.is_seen)
                && let Some(weight) = self.met(now, hits, i, radiance)
            {
                let throughput = now.throughput_of(i, self.count());
                radiance.iter_mut().zip(throughput).for_each(|(r, t)| *r *= t * weight);
                let (lights, around) = (self.stage.lights, &self.stage.surroundings);
                let group = || lights.group_of_placement(around, hits.placement[i]);
                self.add(radiance, self.parts.row(state.ray, state.bounces, group), out);
            }
            // A last ray goes on only where the surface that it met may not be there.
            if placed.is_some_and(|placed| !state.is_last || placed.may_vanish())
                && state.steps < MOST_STEPS
            {
                alive.push(u32::try_from(i).unwrap_or(u32::MAX));
            }
        }
        let (lights, spectral) = (self.stage.lights, self.stage.spectral);
        let wanted = missed.iter().map(|&i| i as usize);
        let wanted = wanted.map(|i| (now.states[i].receiver, now.rays.direction(i)));
        lights.environment(spectral, wanted, asked, radiance, |number, pdf, light| {
            let i = missed[number] as usize;
            let weight = now.states[i].weight_against(pdf);
            let throughput = now.throughput_of(i, self.count());
            light.iter_mut().zip(throughput).for_each(|(r, t)| *r *= t * weight);
            let state = &now.states[i];
            let row = self.parts.row(state.ray, state.bounces, || lights.group_of_sky());
            self.add(light, row, out);
        });
    }

    /// The light of the surface that ray `i` met, and its weight against having asked for it; `None` if
    /// there is none.
    pub(super) fn met(
        &self,
        now: &Paths,
        hits: &HitBatch,
        i: usize,
        radiance: &mut [f64],
    ) -> Option<f64> {
        let LightingContext { lights, surroundings: around, spectral, .. } = self.stage;
        let (state, direction) = (&now.states[i], now.rays.direction(i));
        let spot = around.spot(hits, i)?;
        let front = hits.normal(i).dot(direction) <= 0.0;
        let material = around.material(&spot)?;
        let spot = SurfacePoint { footprint: now.footprint(hits, i), ..spot };
        // A surface that is only partly there shines by as much.
        let there = || match material.has_alpha() {
            true => SurfaceInteraction::new(self.stage, &now.rays, hits, i, None)
                .map_or(1.0, |met| met.opacity()),
            false => 1.0,
        };
        if material.scattering == Scattering::Unlit {
            if state.pdf != f64::INFINITY {
                return None;
            }
            let (tint, _) = around.base_tint(spectral, material, &spot);
            spectral.spread_tint(&tint, radiance);
            return Some(there());
        }
        if !lights.emitted(around, spectral, &spot, front, radiance) {
            return None;
        }
        let pdf =
            lights.pdf_of_surface(around, hits.placement[i], &spot, &state.receiver, direction);
        Some(state.weight_against(pdf) * there())
    }
}
