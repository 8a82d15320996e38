//! What paths come upon by themselves: light, and surfaces to go on from.

use etendue_geometry::{HitBatch, MISS};

use super::paths::{Paths, State};
use super::{LightingContext, Scratch, Tracing};
use crate::reference::SurfacePoint;
use crate::sampling::power_heuristic;
use crate::surface::SurfaceInteraction;
use crate::{Material, Scattering};

/// The most steps of a path: surfaces that let it pass count, and may be many.
const MOST_STEPS: u32 = 4096;

impl Tracing<'_> {
    /// Adds the light that paths met by themselves, and lists those that go on.
    pub(super) fn meet(&mut self, scratch: &mut Scratch, out: &mut [f64]) {
        let Scratch { now, hits, alive, radiance, .. } = scratch;
        alive.clear();
        let mut start = 0;
        for run in hits.placement.chunk_by(|a, b| a == b) {
            let range = start..start + run.len();
            start = range.end;
            let is_plain = self.is_plain(run[0]);
            for i in range {
                let state = &now.states[i];
                let throughput = &now.throughput[i * self.count..(i + 1) * self.count];
                if !is_plain && let Some(weight) = self.met(now, hits, i, radiance) {
                    radiance.iter_mut().zip(throughput).for_each(|(r, t)| *r *= t * weight);
                    self.add(radiance, state.ray, out);
                }
                if run[0] != MISS && self.goes_on(hits, i, state) {
                    alive.push(u32::try_from(i).unwrap_or(u32::MAX));
                }
            }
        }
    }

    /// Whether nothing is to be seen at a placement but what it scatters.
    fn is_plain(&self, placement: u32) -> bool {
        let around = &self.stage.surroundings;
        let Some(placement) = around.geometry.placements.get(placement as usize) else {
            return !self.stage.lights.has_environment();
        };
        around.materials.get(placement.material as usize).is_some_and(|material| {
            material.emission.is_none() && material.scattering != Scattering::Unlit
        })
    }

    /// A last ray goes on only where the surface that it met may not be there.
    fn goes_on(&self, hits: &HitBatch, i: usize, state: &State) -> bool {
        if state.steps >= MOST_STEPS {
            return false;
        }
        let around = &self.stage.surroundings;
        let has_alpha = || {
            let spot = around.spot(hits, i);
            spot.and_then(|spot| around.material(&spot)).is_some_and(Material::has_alpha)
        };
        !state.is_last || (self.stage.traits.has_alpha && has_alpha())
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
            let shines = lights.environment(spectral, direction, radiance);
            return shines.then(|| asked(lights.pdf_of_environment(direction)));
        };
        let front = hits.normal(i).dot(direction) <= 0.0;
        let material = around.material(&spot)?;
        let spot = SurfacePoint { footprint: now.footprint(hits, i), ..spot };
        // A surface that is only partly there shines by as much.
        let there = || match material.has_alpha() {
            true => SurfaceInteraction::new(around, &now.rays, hits, i, None)
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
