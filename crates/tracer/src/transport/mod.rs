//! Light transport in batches: what the tracers of light share.
//!
//! All paths of a batch take their next step together: closest hits of all, emission that they meet,
//! then for each that goes on one light to ask (a shadow ray) and one direction to follow. Rays that
//! ended are left out, so each batch that reaches the accelerator is full.
//!
//! # Sources
//!
//! * Estimators of light and of directions, weighed against each other: Veach, *Robust Monte Carlo
//!   Methods for Light Transport Simulation*, 1997, sections 8.3 and 9.2 (power heuristic).
//! * Russian roulette: Arvo and Kirk, "Particle Transport and Image Synthesis", 1990.
//! * Many wavelengths on one path, all but one ending where a glass splits them: Wilkie et al., "Hero
//!   Wavelength Spectral Sampling", 2014.

mod matte;
mod meet;
mod numbers;
mod paths;
mod rules;
mod shadows;

use std::fmt::Debug;
use std::ops::{AddAssign, Range};

use etendue_accel::Accel;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Detail, Geometry, HitBatch, MISS, RayBatch};

use self::matte::Patch;
use self::numbers::{DRAWS, Draw, Numbers};
use self::paths::{Paths, State};
pub use self::rules::{Follow, Rules};
use self::shadows::{Shadows, push_to};
use crate::bsdf::{Bsdf, Weights};
use crate::emitters::Emitters;
use crate::light::{End, Lights};
use crate::reference::SceneView;
use crate::sampling::power_heuristic;
use crate::spawn::Anchor;
use crate::spectral::Spectral;
use crate::surface::SurfaceInteraction;
use crate::{Ior, Material, Scattering};

/// The scene as light sees it.
#[derive(Debug, Clone, Copy)]
pub struct LightingContext<'a> {
    /// What finds the hits.
    pub accel: &'a dyn Accel,
    /// Meshes, materials and images.
    pub surroundings: SceneView<'a>,
    /// Where light comes from.
    pub lights: &'a Lights,
    /// The bands.
    pub spectral: &'a Spectral,
    /// What its surfaces make tracers do.
    pub traits: Traits,
    /// The surfaces that shine, where they are few.
    pub emitters: Option<&'a Emitters>,
}

/// What no surface of a scene asks for is not done.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Traits {
    /// Some surface is not wholly there ([`Material::has_alpha`]).
    pub has_alpha: bool,
    /// Some surface is a smooth pane that light passes straight ([`Material::is_pane`]).
    pub has_panes: bool,
    /// Some surface scatters light in several ways, among which is chosen.
    pub has_choice: bool,
}

impl Traits {
    /// Those of all placed surfaces.
    #[must_use]
    pub fn of(geometry: &Geometry, materials: &[Material]) -> Self {
        let mut traits = Self::default();
        let placed = geometry.placements.iter().filter_map(|p| materials.get(p.material as usize));
        for material in placed {
            traits.has_alpha |= material.has_alpha();
            traits.has_panes |= material.is_pane();
            traits.has_choice |=
                matches!(material.scattering, Scattering::Dielectric(_) | Scattering::Gltf(_));
        }
        traits
    }
}

/// A batch of rays with what they carry.
#[derive(Debug, Clone)]
pub struct RaySamples<'a> {
    /// The rays.
    pub rays: &'a RayBatch,
    /// Random numbers of each ray.
    pub samples: &'a dyn Samples,
    /// The bands that these rays stand for: all, unless the camera sends wavelengths separate ways.
    pub bands: Range<usize>,
}

/// Random numbers by ray and pair of dimensions, many at a time.
pub trait Samples: Debug {
    /// A point of the unit square for each of `wanted`, ray and pair: `out` is refilled. Pairs are
    /// counted from 0, which no ray has used before.
    fn squares(&self, wanted: &[(u32, u32)], out: &mut Vec<[f64; 2]>);
}

/// What became of a batch.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RayStats {
    /// Rays traced for their closest hit.
    pub rays: u64,
    /// Rays traced to a light.
    pub shadow_rays: u64,
    /// Contributions that were not finite, and were left out.
    pub not_finite: u64,
}

impl AddAssign for RayStats {
    fn add_assign(&mut self, other: Self) {
        self.rays += other.rays;
        self.shadow_rays += other.shadow_rays;
        self.not_finite += other.not_finite;
    }
}

/// Memory of one thread, kept between batches.
#[derive(Debug, Default)]
pub struct Scratch {
    now: Paths,
    next: Paths,
    /// Paths that only look for light.
    last: Paths,
    hits: HitBatch,
    alive: Vec<u32>,
    numbers: Numbers,
    shadows: Shadows,
    radiance: Vec<f64>,
    patch: Box<Patch>,
}

/// Traces `beam` by `rules`.
fn trace(
    rules: Rules,
    stage: &LightingContext<'_>,
    beam: &RaySamples<'_>,
    scratch: &mut Scratch,
    out: &mut Vec<f64>,
) -> RayStats {
    let count = stage.spectral.count();
    out.clear();
    out.resize(beam.rays.len() * count, 0.0);
    let mut tracing = Tracing { rules, stage, count, tally: RayStats::default() };
    scratch.hits.detail = Detail::Surface;
    scratch.shadows.hits.detail = Detail::Surface;
    scratch.radiance.resize(count, 0.0);
    tracing.start(beam, &mut scratch.now);
    while !scratch.now.states.is_empty() {
        stage.accel.closest(&scratch.now.rays, &mut scratch.hits);
        tracing.tally.rays += scratch.now.states.len() as u64;
        tracing.meet(scratch, out);
        let needs = tracing.needs(&scratch.now.states);
        let paths = (&scratch.now.states[..], &scratch.alive[..]);
        scratch.numbers.draw(beam.samples, needs, paths);
        scratch.next.clear();
        scratch.last.clear();
        scratch.shadows.clear();
        // From neighbouring places to lights: as coherent as what they start from.
        scratch.shadows.rays.coherent = scratch.now.rays.coherent;
        tracing.step_all(scratch);
        if stage.lights.is_hittable() {
            scratch.shadows.sort(count);
        }
        tracing.light(&mut scratch.shadows, out);
        tracing.trace_emitters(scratch, out);
        std::mem::swap(&mut scratch.now, &mut scratch.next);
    }
    tracing.tally
}

struct Tracing<'a> {
    rules: Rules,
    stage: &'a LightingContext<'a>,
    count: usize,
    tally: RayStats,
}

impl Tracing<'_> {
    fn start(&self, beam: &RaySamples<'_>, paths: &mut Paths) {
        paths.clear();
        paths.rays.copy_from(beam.rays);
        paths.rays.from_surface = false;
        for i in 0..beam.rays.len() {
            paths.states.push(State {
                ray: u32::try_from(i).unwrap_or(u32::MAX),
                steps: 0,
                bounces: 0,
                pdf: f64::INFINITY,
                vertex: beam.rays.origin(i),
                band: None,
                is_last: false,
                cone: self.stage.surroundings.view.cone(beam.rays.direction(i)),
            });
            let bands = 0..self.count;
            paths.throughput.extend(bands.map(|k| f64::from(u8::from(beam.bands.contains(&k)))));
        }
    }

    /// What the next step of any of `states` may draw.
    fn needs(&self, states: &[State]) -> impl Fn(Draw) -> bool {
        let LightingContext { lights, traits, .. } = self.stage;
        let most = states.iter().map(|state| state.bounces + 1).max().unwrap_or(0);
        let least = states.iter().map(|state| state.bounces + 1).min().unwrap_or(0);
        let goes_on = self.rules.follow == Follow::All && least < self.rules.bounces;
        let follows = goes_on || lights.is_hittable() || traits.has_choice;
        let roulette = self.rules.roulette.is_some_and(|after| most >= after);
        let [several, extended] = [lights.are_several(), lights.is_hittable()];
        move |draw| match draw {
            Draw::Choice => several || traits.has_choice,
            Draw::Light => extended || traits.has_choice,
            Draw::Direction => follows,
            Draw::Chance => roulette || traits.has_alpha,
        }
    }

    /// The step of all paths that go on.
    fn step_all(&mut self, scratch: &mut Scratch) {
        let mut start = 0;
        while let Some(&first) = scratch.alive.get(start) {
            let placement = scratch.hits.placement[first as usize];
            let met = |i: &u32| scratch.hits.placement[*i as usize] == placement;
            let run = scratch.alive[start..].iter().take_while(|i| met(i)).count();
            let which = start..start + run;
            start = which.end;
            match self.matte(placement) {
                Some(matte) => self.step_matte(scratch, &matte, which),
                None => which.for_each(|k| self.step(scratch, k)),
            }
        }
    }

    /// One path's step at the surface that it met: a light is asked, a direction is chosen.
    fn step(&mut self, scratch: &mut Scratch, k: usize) {
        let Scratch { now, next, last, hits, alive, numbers, shadows, radiance, .. } = scratch;
        let i = alive[k] as usize;
        let around = &self.stage.surroundings;
        let footprint = now.footprint(hits, i);
        let Some(met) = SurfaceInteraction::new(around, &now.rays, hits, i, footprint) else {
            return;
        };
        let numbers = numbers.of(k);
        let left = [hits.placement[i], hits.triangle[i]];
        let mut state = now.states[i];
        state.steps += 1;
        state.cone = state.cone.map(|cone| cone.after(hits.t[i]));
        let throughput = &mut now.throughput[i * self.count..(i + 1) * self.count];
        if met.material.has_alpha() && numbers[Draw::Chance as usize][0] >= met.opacity() {
            let direction = now.rays.direction(i);
            next.push((met.anchor.leave(direction), direction), left, state);
            next.throughput.extend_from_slice(throughput);
            return;
        }
        if state.is_last || state.bounces >= self.rules.bounces {
            return;
        }
        if let Scattering::Dielectric(Ior::Dispersive(_)) = met.material.scattering
            && self.count > 1
        {
            // A boundary asks no light: its numbers are free.
            split(throughput, &mut state, numbers[Draw::Light as usize][0]);
        }
        let wavelength = self.stage.spectral.wavelength(state.band.unwrap_or(0) as usize);
        let bsdf = met.bsdf(around, wavelength);
        state.bounces += 1;
        if !bsdf.is_delta() {
            let path = (&*throughput, state.ray);
            self.sample_light(&bsdf, (&met.anchor, left), path, &numbers, shadows, radiance);
        }
        self.scatter(&bsdf, (&met.anchor, left), throughput, state, &numbers, [next, last]);
    }

    /// Chooses a light and notes the ray to it.
    fn sample_light(
        &mut self,
        bsdf: &Bsdf,
        (anchor, left): (&Anchor, [u32; 2]),
        (throughput, ray): (&[f64], u32),
        numbers: &[[f64; 2]; DRAWS as usize],
        shadows: &mut Shadows,
        radiance: &mut [f64],
    ) {
        let LightingContext { lights, surroundings: around, spectral, .. } = self.stage;
        let toward = lights.sample(
            around,
            spectral,
            anchor,
            numbers[Draw::Choice as usize][0],
            numbers[Draw::Light as usize],
            radiance,
        );
        let Some(toward) = toward else { return };
        let (value, pdf) = bsdf.evaluate(toward.direction);
        if value.is_zero() {
            return;
        }
        let balance = if toward.is_delta { 1.0 } else { power_heuristic(toward.pdf, pdf) };
        let factor = balance / toward.pdf;
        let origin = anchor.leave(toward.direction);
        let rays = &mut shadows.rays;
        match toward.end {
            End::Far => {
                let limits = [0.0, f64::INFINITY];
                let triangles = [left, [MISS; 2]];
                rays.push_between_triangles(origin, toward.direction, limits, triangles);
            }
            End::Point(at) => push_to(rays, origin, at, [left, [MISS; 2]]),
            End::Surface(end, triangle) => {
                push_to(rays, origin, end.leave(-toward.direction), [left, triangle]);
            }
        }
        shadows.ray.push(ray);
        shadows.is_delta.push(toward.is_delta);
        let bands = radiance.iter().zip(throughput).enumerate();
        let contribution =
            bands.map(|(k, (l, t))| l * t * factor * in_band(spectral, bsdf, value, k));
        shadows.contribution.extend(contribution);
    }

    /// Chooses a direction and notes the path along it.
    fn scatter(
        &self,
        bsdf: &Bsdf,
        (anchor, left): (&Anchor, [u32; 2]),
        throughput: &mut [f64],
        mut state: State,
        numbers: &[[f64; 2]; DRAWS as usize],
        [next, last]: [&mut Paths; 2],
    ) {
        let ends = state.bounces >= self.rules.bounces;
        if (ends || self.rules.follow == Follow::Single)
            && !self.stage.lights.is_hittable()
            && !bsdf.has_single()
        {
            return;
        }
        let choice = numbers[Draw::Choice as usize][1];
        let Some(scattered) = bsdf.sample(choice, numbers[Draw::Direction as usize]) else {
            return;
        };
        let single = scattered.pdf == f64::INFINITY;
        let follows = single || self.rules.follow == Follow::All;
        state.is_last = ends || !follows;
        if state.is_last && !single && !self.stage.lights.is_hittable() {
            return;
        }
        for (k, band) in throughput.iter_mut().enumerate() {
            *band *= in_band(self.stage.spectral, bsdf, scattered.weights, k);
        }
        if !single {
            // Seen by chance from one point, a surface is a point.
            state.cone = None;
        }
        state.pdf = scattered.pdf;
        state.vertex = anchor.point;
        let ray = (anchor.leave(scattered.direction), scattered.direction);
        let chance = numbers[Draw::Chance as usize][1];
        self.follow(ray, left, throughput, (state, chance), [next, last]);
    }

    /// Notes a path along a ray that leaves a placement's triangle, unless it carries nothing or ends
    /// by `chance`.
    fn follow(
        &self,
        ray: (DVec3, DVec3),
        left: [u32; 2],
        throughput: &mut [f64],
        (state, chance): (State, f64),
        [next, last]: [&mut Paths; 2],
    ) {
        let single = state.pdf == f64::INFINITY;
        let traces_emitters = state.is_last && !single && self.traces_emitters();
        let most = throughput.iter().copied().fold(0.0, f64::max);
        if most <= 0.0 || (traces_emitters && !self.may_shine(ray)) {
            return;
        }
        if self.rules.roulette.is_some_and(|after| state.bounces >= after) && !state.is_last {
            let survival = most.min(0.95);
            if chance >= survival {
                return;
            }
            throughput.iter_mut().for_each(|band| *band /= survival);
        }
        let next = if traces_emitters { last } else { next };
        next.push(ray, left, state);
        next.throughput.extend_from_slice(throughput);
    }

    fn add(&mut self, light: &[f64], ray: u32, out: &mut [f64]) {
        if !light.iter().all(|band| band.is_finite()) {
            self.tally.not_finite += 1;
            return;
        }
        let start = ray as usize * self.count;
        out[start..start + self.count].iter_mut().zip(light).for_each(|(sum, band)| *sum += band);
    }
}

/// The value in band `k`.
fn in_band(spectral: &Spectral, bsdf: &Bsdf, value: Weights, k: usize) -> f64 {
    let mut sum = value.white;
    if value.base != 0.0 {
        sum += value.base * spectral.band(&bsdf.base, k);
    }
    if value.highlight != 0.0 {
        sum += value.highlight * spectral.band(&bsdf.highlight, k);
    }
    sum
}

/// Keeps one band, chosen by `u` among those that carry anything, at as many times its throughput.
fn split(throughput: &mut [f64], state: &mut State, u: f64) {
    if state.band.is_some() {
        return;
    }
    let live: Vec<usize> = (0..throughput.len()).filter(|&k| throughput[k] > 0.0).collect();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "u is in 0..1")]
    let Some(&kept) = live.get((u * live.len() as f64) as usize) else { return };
    for (k, band) in throughput.iter_mut().enumerate() {
        *band = if k == kept { *band * live.len() as f64 } else { 0.0 };
    }
    state.band = u32::try_from(kept).ok();
}
