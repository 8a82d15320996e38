//! What paths come upon by themselves: light, and surfaces to go on from.

use etendue_geometry::HitBatch;

use super::paths::Paths;
use super::{LightingContext, Scratch, Tracing};
use crate::Scattering;
use crate::reference::SurfacePoint;
use crate::sampling::power_heuristic;
use crate::surface::SurfaceInteraction;

/// The most steps of a path: surfaces that let it pass count, and may be many.
const MOST_STEPS: u32 = 4096;

impl Tracing<'_> {
    /// Adds the light that paths met by themselves, and lists those that go on.
    pub(super) fn meet(&mut self, scratch: &mut Scratch, out: &mut [f64]) {
        let Scratch { now, hits, alive, radiance, .. } = scratch;
        alive.clear();
        let lit = self.stage.lights.has_environment();
        for (i, state) in now.states.iter().enumerate() {
            let placed = self.stage.placed.get(hits.placement[i]);
            let is_seen = placed.map_or(lit, |placed| placed.is_seen);
            if is_seen && let Some(weight) = self.met(now, hits, i, radiance) {
                let throughput = &now.throughput[i * self.count..(i + 1) * self.count];
                radiance.iter_mut().zip(throughput).for_each(|(r, t)| *r *= t * weight);
                self.add(radiance, state.ray, out);
            }
            // A last ray goes on only where the surface that it met may not be there.
            if placed.is_some_and(|placed| !state.is_last || placed.has_alpha)
                && state.steps < MOST_STEPS
            {
                alive.push(u32::try_from(i).unwrap_or(u32::MAX));
            }
        }
    }

    /// The light that ray `i` met, and its weight against having asked for it; `None` if none.
    pub(super) fn met(
        &self,
        now: &Paths,
        hits: &HitBatch,
        i: usize,
        radiance: &mut [f64],
    ) -> Option<f64> {
        let LightingContext { lights, surroundings: around, spectral, .. } = self.stage;
        let (state, direction) = (&now.states[i], now.rays.direction(i));
        let asked = |pdf: f64| match state.pdf {
            f64::INFINITY => 1.0,
            own => power_heuristic(own, pdf),
        };
        let Some(spot) = around.spot(hits, i) else {
            return lights.environment(spectral, direction, radiance).map(asked);
        };
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
            let [r, g, b, _] = around.base_color(material, &spot);
            spectral.spread(&[r, g, b], radiance);
            return Some(there());
        }
        if !lights.emitted(around, spectral, &spot, front, radiance) {
            return None;
        }
        let pdf = lights.pdf_of_surface(around, hits.placement[i], &spot, state.vertex, direction);
        Some(asked(pdf) * there())
    }
}
