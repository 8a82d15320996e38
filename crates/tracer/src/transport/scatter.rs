//! The directions in which the hits of a patch scatter light, and the paths along them.

use etendue_geometry::glam::DVec3;

use super::media::{Coincident, Media};
use super::patch::{Away, Compressed, Patch, at};
use super::paths::{Draw, Passage, Step, Way, Workspace};
use super::rays::Rays;
use super::{LightingContext, Tracing, kernels};
use crate::LANES;
use crate::footprint::Cone;
use crate::placed::SurfaceKind;

/// A path that goes on.
pub(super) struct Departure {
    /// Where it starts (m), and its unit direction.
    pub(super) ray: [DVec3; 2],
    pub(super) way: Way,
    /// As wide as at its start; `None` where it was scattered by chance.
    pub(super) cone: Option<Cone>,
    /// What it is in from now on, where media count and it passed a boundary.
    pub(super) media: Option<Media>,
}

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Chooses a direction for each hit, and notes the path along it, but for those that carry nothing or end
    /// by chance.
    pub(super) fn scatter<R: Rays>(
        &self,
        step: &Step<'_>,
        workspace: &mut Workspace<R>,
        patch: &mut Patch,
        kind: SurfaceKind,
    ) {
        let hittable = self.ctx.lights.is_hittable();
        let least = if self.ctx.traits.may_pass() { 0 } else { step.number };
        let is_specular = kind == SurfaceKind::Smooth;
        if self.is_end_unless_specular(least)
            && !hittable
            && matches!(kind, SurfaceKind::Matte | SurfaceKind::Sheet)
        {
            return;
        }
        let numbers = |draw| {
            let mut numbers = [[0.5; 2]; LANES];
            for (&lane, &(_, k)) in workspace.picked.iter().zip(&patch.path) {
                numbers[lane] = workspace.number(draw, k);
            }
            numbers
        };
        let choices = || numbers(Draw::Choice).map(|[_, choice]| choice);
        match kind {
            SurfaceKind::Black => return,
            SurfaceKind::Matte => {
                let squares = numbers(Draw::Direction);
                kernels::scatter(patch, &squares);
            }
            SurfaceKind::Sheet => {
                let (squares, choices) = (numbers(Draw::Direction), choices());
                let Patch { sheets, seen, away, .. } = patch;
                let normals = [&seen.normal, &seen.shading];
                let found = (&mut away.along, &mut away.value);
                sheets.scatter(normals, (&choices, &squares), found);
                kernels::leave(patch);
            }
            SurfaceKind::Smooth => {
                let choices = choices();
                kernels::mirror_or_refract(patch, &choices);
            }
            SurfaceKind::Other => return self.scatter_one_by_one(step, workspace, patch),
        }
        // Where emitters are asked no surface lets paths pass: all have been scattered as often.
        if step.asks_emitters && !is_specular && self.is_end_unless_specular(step.number) {
            self.look_for_emitters(patch);
        }
        let count = self.count();
        let picked = &workspace.picked;
        let going = Compressed::of(picked.len(), |n| patch.away.value[picked[n]] > 0.0);
        for n in going.numbers() {
            let (lane, (i, k)) = (workspace.picked[n], patch.path[n]);
            let pdf = patch.away.value[lane];
            let bounces = workspace.now.bounces(step.number, i);
            let is_last = match is_specular {
                true => self.is_end(bounces),
                false => self.is_end_unless_specular(bounces),
            };
            if is_last && !is_specular && !hittable {
                continue;
            }
            let throughput = &mut workspace.now.carried.throughput[i * count..(i + 1) * count];
            let bands = throughput.iter_mut().enumerate();
            match kind {
                SurfaceKind::Black | SurfaceKind::Other => {}
                SurfaceKind::Matte => self.tinted(&patch.colors[lane], throughput),
                SurfaceKind::Sheet => {
                    let weights = patch.sheets.weights(lane);
                    bands.for_each(|(k, band)| {
                        *band *= self.in_band_of_sheet(patch, lane, weights, k);
                    });
                }
                SurfaceKind::Smooth => {
                    let weights = patch.smooth.weights(lane);
                    bands.for_each(|(k, band)| {
                        *band *= self.in_band_of_sheet(patch, lane, weights, k);
                    });
                }
            }
            let cone = if is_specular { self.cone_at_hit(step, &workspace.now, i) } else { None };
            let normal = at(&patch.seen.shading, lane).as_vec3().into();
            let way = Way { pdf, is_specular, is_last, normal };
            let ray = [at(&patch.away.start, lane), at(&patch.away.along, lane)];
            self.follow(step, workspace, (i, k), Departure { ray, way, cone, media: None });
        }
    }

    /// Leaves out last directions that meet nothing that shines.
    fn look_for_emitters(&self, patch: &mut Patch) {
        let LightingContext { emitters, lights, .. } = self.ctx;
        let Some(emitters) = emitters.filter(|_| !lights.has_environment()) else { return };
        let Away { start, along, value, .. } = &mut patch.away;
        emitters.keep_those_that_may_meet([start, along], value);
    }

    /// The same of surfaces that are worked out one by one.
    fn scatter_one_by_one<R: Rays>(
        &self,
        step: &Step<'_>,
        workspace: &mut Workspace<R>,
        patch: &mut Patch,
    ) {
        let hittable = self.ctx.lights.is_hittable();
        let count = self.count();
        for n in 0..workspace.picked.len() {
            let (lane, (i, k)) = (workspace.picked[n], patch.path[n]);
            let bsdf = patch.bsdfs[lane];
            let bounces = workspace.now.bounces(step.number, i);
            let ends_unless_specular = self.is_end_unless_specular(bounces);
            if ends_unless_specular && !hittable && !bsdf.has_single() {
                continue;
            }
            let choice = workspace.number(Draw::Choice, k)[1];
            let Some(scattered) = bsdf.sample(choice, workspace.number(Draw::Direction, k)) else {
                continue;
            };
            let is_specular = scattered.is_specular;
            let is_last = if is_specular { self.is_end(bounces) } else { ends_unless_specular };
            if is_last && !is_specular && !hittable {
                continue;
            }
            let throughput = &mut workspace.now.carried.throughput[i * count..(i + 1) * count];
            for (k, band) in throughput.iter_mut().enumerate() {
                *band *= self.in_band(&bsdf, scattered.weights, k);
            }
            let direction = scattered.direction;
            // What leaves another surface within a body is still in it.
            let crossing = patch.crossings.get(lane).copied().flatten();
            let media = crossing.map(|c| c.after(direction, workspace.now.rays.hit(i).normal));
            // Seen by chance from one point, a surface is a point.
            let cone = if is_specular { self.cone_at_hit(step, &workspace.now, i) } else { None };
            let (pdf, normal) = (scattered.pdf, bsdf.receiving_normal().as_vec3().into());
            let way = Way { pdf, is_specular, is_last, normal };
            let ray = [patch.leave(lane, direction), direction];
            if is_last && !is_specular && step.asks_emitters && !self.may_shine(ray) {
                continue;
            }
            self.follow(step, workspace, (i, k), Departure { ray, way, cone, media });
        }
    }

    /// Notes a path that goes on from path `i`, the `k`-th of those that do, unless it carries nothing or ends by
    /// chance.
    #[inline(always)]
    fn follow<R: Rays>(
        &self,
        step: &Step<'_>,
        workspace: &mut Workspace<R>,
        (i, k): (usize, usize),
        departure: Departure,
    ) {
        let count = self.count();
        let [_, chance] = workspace.number(Draw::Chance, k);
        let Workspace { now, onward, coincident, .. } = workspace;
        let bounces = now.bounces(step.number, i) + 1;
        let throughput = &mut now.carried.throughput[i * count..(i + 1) * count];
        let larger = |a: f64, &b: &f64| if b > a { b } else { a };
        let most = throughput.iter().fold(0.0, larger);
        let Departure { ray, way, cone, media } = departure;
        let asks = way.is_last && !way.is_specular && step.asks_emitters;
        if most <= 0.0 {
            return;
        }
        if self.rules.roulette.is_some_and(|after| bounces >= after) && !way.is_last {
            // Its root: where few paths come this far, ending them saves little and leaves noise.
            let survival = most.sqrt().min(1.0);
            if chance >= survival {
                return;
            }
            throughput.iter_mut().for_each(|band| *band /= survival);
        }
        let carried = if asks {
            onward.last.push(ray[0], ray[1]);
            onward.of_last.left.push(now.rays.triangle(i));
            &mut onward.of_last
        } else {
            let coplanar = || coincident.get(i).copied().unwrap_or(Coincident::NONE);
            let ends = || [now.rays.triangle(i), coplanar().id()];
            onward.next.rays.push(ray, f64::INFINITY, ends);
            if step.is_mixed {
                onward.next.carried.cones.push(cone);
            }
            &mut onward.next.carried
        };
        carried.ray.push(now.carried.ray[i]);
        carried.ways.push(way);
        carried.throughput.extend_from_slice(&now.carried.throughput[i * count..(i + 1) * count]);
        if self.ctx.traits.may_pass() {
            let surfaces = now.carried.passages.get(i).map_or(0, |passage| passage.surfaces);
            carried.passages.push(Passage { surfaces, from: None });
        }
        self.push_own(now, carried, i);
        if let (Some(media), Some(own)) = (media, carried.media.last_mut()) {
            *own = media;
        }
    }

    /// Notes a path of its own throughput along a direction that only a boundary can give.
    pub(super) fn send<R: Rays>(
        &self,
        workspace: &mut Workspace<R>,
        i: usize,
        (departure, wavelength): (Departure, Option<f64>),
        throughput: &[f64],
    ) {
        let Workspace { now, onward, coincident, .. } = workspace;
        let Departure { ray, way, cone, media } = departure;
        let coplanar = || coincident.get(i).copied().unwrap_or(Coincident::NONE);
        let ends = || [now.rays.triangle(i), coplanar().id()];
        onward.next.rays.push(ray, f64::INFINITY, ends);
        let carried = &mut onward.next.carried;
        carried.ray.push(now.carried.ray[i]);
        carried.ways.push(way);
        carried.cones.push(cone);
        carried.throughput.extend_from_slice(throughput);
        if self.ctx.traits.may_pass() {
            let surfaces = now.carried.passages.get(i).map_or(0, |passage| passage.surfaces);
            carried.passages.push(Passage { surfaces, from: None });
        }
        self.push_own(now, carried, i);
        if let (Some(media), Some(own)) = (media, carried.media.last_mut()) {
            *own = media;
        }
        if let (Some(wavelength), Some(own)) = (wavelength, carried.wavelengths.last_mut()) {
            *own = Some(wavelength);
        }
    }
}
