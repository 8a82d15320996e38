//! Rays to lights: what each brings, and whether anything is in between.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{HitBatch, MISS, PlacedTriangle, RayBatch};

use super::media::{Coincident, Media};
use super::paths::{Paths, State};
use super::{LightingContext, Scratch, Tracing, Traits};
use crate::emitters::Emitters;
use crate::surface::SurfaceInteraction;

/// Rays to lights and what each brings if nothing is in between.
#[derive(Debug, Default)]
pub(super) struct Shadows {
    pub(super) rays: RayBatch,
    /// Where each is summed up ([`super::Parts`]).
    pub(super) row: Vec<u32>,
    /// `[shadow][band]`.
    pub(super) contribution: Vec<f64>,
    /// Their light can be met by no path that panes let through.
    pub(super) is_delta: Vec<bool>,
    /// The media that each starts in; empty where they do not count.
    pub(super) media: Vec<Media>,
    pub(super) blocked: Vec<bool>,
    pub(super) hits: HitBatch,
    coincident: Vec<Coincident>,
    pub(super) again: RayBatch,
    pub(super) open: Vec<u32>,
    order: Vec<u64>,
    sorted: Sorted,
}

/// The same rays in another order.
#[derive(Debug, Default)]
struct Sorted {
    rays: RayBatch,
    row: Vec<u32>,
    contribution: Vec<f64>,
    is_delta: Vec<bool>,
    media: Vec<Media>,
}

impl Shadows {
    pub(super) fn clear(&mut self) {
        self.rays.clear();
        self.row.clear();
        self.contribution.clear();
        self.is_delta.clear();
        self.media.clear();
    }

    /// Notes what a ray brings: `light` times what its path carries and its weight.
    fn note(&mut self, row: u32, light: &[f64], throughput: &[f64], weight: f64) {
        self.row.push(row);
        self.is_delta.push(false);
        self.contribution.extend(light.iter().zip(throughput).map(|(l, t)| l * t * weight));
    }

    /// Puts rays side by side that run in about the same direction, `count` bands each, so that they
    /// are worth tracing as packets: those to a lamp of some size go all over it.
    pub(super) fn sort(&mut self, count: usize) {
        let Self { rays, row, contribution, is_delta, media, order, sorted, .. } = self;
        order.clear();
        order.extend((0_u32..).zip(0..row.len()).map(|(number, i)| {
            u64::from(octant_cell(rays.direction(i))) << 32 | u64::from(number)
        }));
        order.sort_unstable();
        let order = || order.iter().map(|&key| (key & 0xffff_ffff) as usize);
        let Sorted { rays: to, row: number, contribution: light, is_delta: delta, media: around } =
            sorted;
        to.gather(rays, order());
        number.clear();
        number.extend(order().map(|i| row[i]));
        light.clear();
        light.extend(order().flat_map(|i| &contribution[i * count..(i + 1) * count]));
        delta.clear();
        delta.extend(order().map(|i| is_delta[i]));
        if !media.is_empty() {
            around.clear();
            around.extend(order().map(|i| media[i]));
            std::mem::swap(media, around);
        }
        std::mem::swap(is_delta, delta);
        std::mem::swap(rays, to);
        std::mem::swap(row, number);
        std::mem::swap(contribution, light);
    }
}

/// Rays whose transparency is looked through, one surface after the other.
const MOST_LAYERS: u32 = 256;

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Whether paths that only look for light ask what shines before they ask the scene. Through
    /// surfaces that are partly there they have to be followed.
    pub(super) fn traces_emitters(&self) -> bool {
        let Traits { has_alpha, has_nested, .. } = self.stage.traits;
        self.stage.emitters.is_some() && !has_alpha && !has_nested
    }

    /// Whether there may be light along a ray that asks what shines.
    pub(super) fn may_shine(&self, (origin, direction): (DVec3, DVec3)) -> bool {
        let met = |emitters: &Emitters| emitters.may_meet(origin, direction);
        self.stage.lights.has_environment() || self.stage.emitters.is_some_and(met)
    }

    /// Adds the light that the last directions of paths meet.
    pub(super) fn trace_emitters(&mut self, scratch: &mut Scratch, out: &mut [f64]) {
        let Scratch { last, hits, shadows, radiance, missed, asked, .. } = scratch;
        let Some(emitters) = self.stage.emitters.filter(|_| !last.states.is_empty()) else {
            return;
        };
        emitters.closest(&last.rays, hits);
        shadows.clear();
        shadows.rays.coherent = false;
        missed.clear();
        for (i, state) in last.states.iter().enumerate() {
            let (origin, direction) = (last.rays.origin(i), last.rays.direction(i));
            let Some(placed) = self.stage.placed.get(hits.placement[i]) else {
                missed.push(u32::try_from(i).unwrap_or(u32::MAX));
                continue;
            };
            let Some(weight) = self.met(last, hits, i, radiance) else { continue };
            let point = origin + direction * hits.t[i];
            let end = self.stage.anchor(point, hits.normal(i), origin, placed);
            let triangles = [left(last, i), [hits.placement[i], hits.triangle[i]]];
            push_to(&mut shadows.rays, origin, end.leave(-direction), triangles);
            let (lights, around) = (self.stage.lights, &self.stage.surroundings);
            let group = || lights.group_of_placement(around, hits.placement[i]);
            let row = self.parts.row(state.ray, state.bounces, group);
            shadows.note(row, radiance, last.throughput_of(i, self.count()), weight);
            self.note_media(shadows, state);
        }
        let (lights, spectral) = (self.stage.lights, self.stage.spectral);
        let wanted = missed.iter().map(|&i| i as usize);
        let wanted = wanted.map(|i| (last.states[i].receiver, last.rays.direction(i)));
        lights.environment(spectral, wanted, asked, radiance, |number, pdf, light| {
            let i = missed[number] as usize;
            let (origin, direction) = (last.rays.origin(i), last.rays.direction(i));
            let limits = [0.0, f64::INFINITY];
            let triangles = [left(last, i), [MISS; 2]];
            shadows.rays.push_between_triangles(origin, direction, limits, triangles);
            let state = &last.states[i];
            let row = self.parts.row(state.ray, state.bounces, || lights.group_of_sky());
            let weight = state.weight_against(pdf);
            shadows.note(row, light, last.throughput_of(i, self.count()), weight);
            self.note_media(shadows, state);
        });
        self.light(shadows, out);
    }

    /// Notes the media of a path whose light was noted.
    fn note_media(&self, shadows: &mut Shadows, state: &State) {
        if self.stage.traits.has_media {
            shadows.media.push(state.media);
        }
    }

    /// Adds what lights bring along rays that nothing blocks.
    pub(super) fn light(&mut self, shadows: &mut Shadows, out: &mut [f64]) {
        if shadows.rays.is_empty() {
            return;
        }
        shadows.rays.from_surface = true;
        if !self.times.is_empty() {
            let rows = self.parts.count();
            let Shadows { rays, row, .. } = &mut *shadows;
            rays.set_times(row.iter().map(|&row| self.times[row as usize / rows]));
        }
        self.tally.shadow_rays += shadows.rays.len() as u64;
        let Traits { has_alpha, has_nested, has_panes, .. } = self.stage.traits;
        if has_alpha || has_nested || (has_panes && shadows.is_delta.contains(&true)) {
            self.transmittance(shadows);
        } else {
            self.stage.accel.occluded(&shadows.rays, &mut shadows.blocked);
            let Shadows { rays, contribution, media, blocked, .. } = &mut *shadows;
            let lights = contribution.chunks_exact_mut(self.count());
            for (k, (media, light)) in media.iter().zip(lights).enumerate() {
                if !blocked[k] {
                    self.dim_along(media, rays.t_max()[k], light);
                }
            }
        }
        for (k, &row) in shadows.row.iter().enumerate() {
            if !shadows.blocked[k] {
                self.add(&shadows.contribution[k * self.count()..(k + 1) * self.count()], row, out);
            }
        }
    }

    /// Dims what each shadow ray brings by the surfaces on its way: by those that are only partly
    /// there, by the media that they go through, and by panes where the light is a point or parallel. A light
    /// of some size is met through panes by the paths themselves.
    fn transmittance(&mut self, shadows: &mut Shadows) {
        let Shadows {
            rays,
            contribution,
            is_delta,
            media,
            blocked,
            hits,
            coincident,
            again,
            open,
            ..
        } = shadows;
        blocked.clear();
        blocked.resize(rays.len(), true);
        open.clear();
        open.extend(0..u32::try_from(rays.len()).unwrap_or(u32::MAX));
        again.copy_from(rays);
        for layer in 0..MOST_LAYERS {
            self.stage.accel.closest(again, hits);
            self.coincident(again, hits, coincident);
            if layer > 0 {
                self.tally.shadow_rays += again.len() as u64;
            }
            let mut onward = RayBatch::default().from_surfaces();
            onward.precision = again.precision;
            let mut still = Vec::new();
            for (k, &i) in open.iter().enumerate() {
                let coplanar = coincident.get(k).copied().unwrap_or(Coincident::NONE);
                let own = i as usize * self.count()..(i as usize + 1) * self.count();
                let light = &mut contribution[own];
                let hit = SurfaceInteraction::new(self.stage, again, hits, k, None);
                if let Some(media) = media.get(i as usize) {
                    let length = if hit.is_some() { hits.t[k] } else { again.t_max()[k] };
                    self.dim_along(media, length, light);
                }
                let Some(mut met) = hit else {
                    blocked[i as usize] = false;
                    continue;
                };
                let direction = again.direction(k);
                if let Some(media) = media.get_mut(i as usize)
                    && let Some(crossing) =
                        self.cross(*media, (hits.placement[k], coplanar), &mut met)
                {
                    *media = crossing.after(direction, hits.normal(k));
                }
                let pass = Pass { is_delta: is_delta[i as usize], placement: hits.placement[k] };
                if self.dim(&met, pass, light) {
                    let origin = met.anchor.leave(direction);
                    let left = again.t_max()[k] - (origin - again.origin(k)).length();
                    let triangles = match coplanar.placement {
                        MISS => [[MISS; 2]; 2],
                        placement => {
                            let own = [hits.placement[k], hits.triangle[k]];
                            [own, [placement, coplanar.triangle]]
                        }
                    };
                    onward.push_between_triangles(
                        origin,
                        direction,
                        [0.0, left.max(0.0)],
                        triangles,
                    );
                    still.push(i);
                }
            }
            if !rays.times().is_empty() {
                onward.set_times(still.iter().map(|&i| rays.time(i as usize)));
            }
            *again = onward;
            *open = still;
            if open.is_empty() {
                return;
            }
        }
    }

    /// Dims light by what lets it pass a surface; whether any is left.
    fn dim(&self, met: &SurfaceInteraction<'_>, pass: Pass, light: &mut [f64]) -> bool {
        let LightingContext { surroundings: around, spectral, traits, .. } = self.stage;
        let opacity = met.opacity();
        if let Some(vanished) = self.vanishes(pass.placement, met) {
            let tint = met.color();
            for (k, band) in light.iter_mut().enumerate().filter(|_| vanished.is_tinted) {
                *band *= 1.0 - opacity + opacity * self.band(&tint, k);
            }
            return light.iter().any(|band| *band > 0.0);
        }
        let pane = (pass.is_delta && traits.has_panes)
            .then(|| met.bsdf(around, spectral, spectral.wavelength(0)));
        let passed = pane.as_ref().and_then(|pane| Some((pane, pane.straight_through()?)));
        for (k, band) in light.iter_mut().enumerate() {
            let pane = passed.map_or(0.0, |(pane, weights)| self.in_band(pane, weights, k));
            *band *= 1.0 - opacity + opacity * pane;
        }
        light.iter().any(|band| *band > 0.0)
    }
}

/// What passes a surface on its way to a light.
#[derive(Debug, Clone, Copy)]
struct Pass {
    /// No path that panes let through can meet the light.
    is_delta: bool,
    /// The surface's placement.
    placement: u32,
}

/// The triangle that a path left.
fn left(paths: &Paths, i: usize) -> PlacedTriangle {
    paths.rays.endpoint_triangles().map_or([MISS; 2], |ends| ends[i][0])
}

/// A ray from one point to another (m), on the triangles at its ends.
fn push_to(rays: &mut RayBatch, origin: DVec3, end: DVec3, triangles: [PlacedTriangle; 2]) {
    let offset = end - origin;
    let distance = offset.length();
    // Points that fall together see each other: a ray of no length meets nothing.
    let direction = if distance > 0.0 { offset / distance } else { DVec3::Z };
    rays.push_between_triangles(origin, direction, [0.0, distance], triangles);
}

/// A cell of directions, of 64 by 64 over the unfolded octahedron (Meyer et al., "On Floating-Point
/// Normal Vectors", 2010), along a Z-order curve: about two degrees.
fn octant_cell(direction: DVec3) -> u32 {
    let size = direction.x.abs() + direction.y.abs() + direction.z.abs();
    let (mut x, mut y) = (direction.x / size, direction.y / size);
    if direction.z < 0.0 {
        (x, y) = ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y));
    }
    let spread = |x: f64| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "0 to 63; the cast saturates"
        )]
        let cell = (32.0 * (x + 1.0)).min(63.0) as u32;
        let cell = (cell | cell << 4) & 0x0f0f;
        let cell = (cell | cell << 2) & 0x3333;
        (cell | cell << 1) & 0x5555
    };
    spread(x) | spread(y) << 1
}
