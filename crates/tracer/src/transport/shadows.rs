//! Rays to lights: what each brings, and whether anything is in between.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{HitBatch, RayBatch};

use super::{Scratch, Tracing};
use crate::spawn::Anchor;
use crate::surface::Met;

/// Rays to lights and what each brings if nothing is in between.
#[derive(Debug, Default)]
pub(super) struct Shadows {
    pub(super) rays: RayBatch,
    pub(super) ray: Vec<u32>,
    /// `[shadow][lane]`.
    pub(super) brought: Vec<f64>,
    pub(super) blocked: Vec<bool>,
    pub(super) passed: Vec<f64>,
    pub(super) hits: HitBatch,
    pub(super) again: RayBatch,
    pub(super) open: Vec<u32>,
}

impl Shadows {
    pub(super) fn clear(&mut self) {
        self.rays.clear();
        self.ray.clear();
        self.brought.clear();
    }
}

/// Rays whose transparency is looked through, one surface after the other.
const MOST_LAYERS: u32 = 256;

impl Tracing<'_> {
    /// Whether paths that only look for light ask what shines before they ask the scene. Through
    /// surfaces that are partly there they have to be followed.
    pub(super) fn glimpses(&self) -> bool {
        self.stage.emitters.is_some() && !self.stage.traits.is_pierced
    }

    /// Adds the light that the last directions of paths meet.
    pub(super) fn glimpse(&mut self, scratch: &mut Scratch, out: &mut [f64]) {
        let Scratch { last, hits, shadows, radiance, .. } = scratch;
        let Some(emitters) = self.stage.emitters.filter(|_| !last.states.is_empty()) else {
            return;
        };
        emitters.closest(&last.rays, hits);
        shadows.clear();
        shadows.rays.coherent = false;
        for (i, state) in last.states.iter().enumerate() {
            let Some(weight) = self.met(last, hits, i, radiance) else { continue };
            let (origin, direction) = (last.rays.origin(i), last.rays.direction(i));
            match self.stage.surroundings.spot(hits, i) {
                None => shadows.rays.push(origin, direction),
                Some(spot) => {
                    let point = origin + direction * hits.t[i];
                    let end = Anchor::new(point, hits.normal(i), origin, spot.placement, spot.mesh);
                    push_to(&mut shadows.rays, origin, end.leave(-direction));
                }
            }
            let throughput = &last.throughput[i * self.count..(i + 1) * self.count];
            shadows.rays.left.push(last.rays.left[i]);
            shadows.ray.push(state.ray);
            shadows.brought.extend(radiance.iter().zip(throughput).map(|(r, t)| r * t * weight));
        }
        self.light(shadows, out);
    }

    /// Adds what lights bring along rays that nothing blocks.
    pub(super) fn light(&mut self, shadows: &mut Shadows, out: &mut [f64]) {
        if shadows.rays.is_empty() {
            return;
        }
        shadows.rays.from_surface = true;
        self.tally.shadow_rays += shadows.rays.len() as u64;
        if self.stage.traits.is_pierced {
            self.look_through(shadows);
        } else {
            self.stage.accel.occluded(&shadows.rays, &mut shadows.blocked);
        }
        for (k, &ray) in shadows.ray.iter().enumerate() {
            let brought = &mut shadows.brought[k * self.count..(k + 1) * self.count];
            if self.stage.traits.is_pierced {
                brought.iter_mut().for_each(|lane| *lane *= shadows.passed[k]);
            } else if shadows.blocked[k] {
                continue;
            }
            self.add(brought, ray, out);
        }
    }

    /// What share of each shadow ray passes the surfaces on its way.
    fn look_through(&mut self, shadows: &mut Shadows) {
        let Shadows { rays, passed, hits, again, open, .. } = shadows;
        passed.clear();
        passed.resize(rays.len(), 1.0);
        open.clear();
        open.extend(0..u32::try_from(rays.len()).unwrap_or(u32::MAX));
        again.copy_from(rays);
        for layer in 0..MOST_LAYERS {
            self.stage.accel.closest(again, hits);
            if layer > 0 {
                self.tally.shadow_rays += again.len() as u64;
            }
            let mut onward = RayBatch { from_surface: true, ..RayBatch::default() };
            let mut still = Vec::new();
            for (k, &i) in open.iter().enumerate() {
                let Some(met) = Met::new(&self.stage.surroundings, again, hits, k, None) else {
                    continue;
                };
                let share = &mut passed[i as usize];
                *share *= 1.0 - met.opacity();
                if *share > 0.0 {
                    let direction = again.direction(k);
                    let origin = met.anchor.leave(direction);
                    let left = again.t_max[k] - (origin - again.origin(k)).length();
                    onward.push_between(origin, direction, 0.0, left.max(0.0));
                    still.push(i);
                }
            }
            *again = onward;
            *open = still;
            if open.is_empty() {
                return;
            }
        }
        open.iter().for_each(|&i| passed[i as usize] = 0.0);
    }
}

/// A ray from one point to another (m).
pub(super) fn push_to(rays: &mut RayBatch, origin: DVec3, end: DVec3) {
    let offset = end - origin;
    let distance = offset.length();
    // Points that fall together see each other: a ray of no length meets nothing.
    let direction = if distance > 0.0 { offset / distance } else { DVec3::Z };
    rays.push_between(origin, direction, 0.0, distance);
}
