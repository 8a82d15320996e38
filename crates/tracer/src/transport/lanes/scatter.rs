//! The directions in which the hits of a patch scatter light, and the paths along them.

use super::super::numbers::Draw;
use super::super::patch::{LANES, Patch, at};
use super::super::{Tracing, kernels};
use super::{LaneScratch, Stage, Way, push};
use crate::bsdf::Weights;
use crate::footprint::Cone;
use crate::placed::SurfaceKind;

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Chooses a direction for each hit, and notes the path along it, but for those that carry nothing or end
    /// by chance.
    pub(super) fn scatter_blocks(
        &self,
        stage: &Stage<'_>,
        lanes: &mut LaneScratch,
        patch: &mut Patch,
        kind: SurfaceKind,
    ) {
        let hittable = self.stage.lights.is_hittable();
        let ends = stage.ends_unless_specular;
        if ends && !hittable && matches!(kind, SurfaceKind::Matte | SurfaceKind::Sheet) {
            return;
        }
        let squares = || {
            let mut squares = [[0.5; 2]; LANES];
            for (&lane, &(_, k)) in lanes.picked.iter().zip(&patch.path) {
                squares[lane] = lanes.number(Draw::Direction, k);
            }
            squares
        };
        let choices = || {
            let mut choices = [0.5; LANES];
            for (&lane, &(_, k)) in lanes.picked.iter().zip(&patch.path) {
                choices[lane] = lanes.number(Draw::Choice, k)[1];
            }
            choices
        };
        match kind {
            SurfaceKind::Black => return,
            SurfaceKind::Matte => {
                let squares = squares();
                kernels::scatter(patch, &squares);
            }
            SurfaceKind::Sheet => {
                let (squares, choices) = (squares(), choices());
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
            SurfaceKind::Other => return self.scatter_one_by_one(stage, lanes, patch),
        }
        let count = self.count();
        for n in 0..lanes.picked.len() {
            let (lane, (i, k)) = (lanes.picked[n], patch.path[n]);
            let pdf = patch.away.value[lane];
            let goes_on = pdf > 0.0;
            if !goes_on {
                continue;
            }
            let throughput = &mut lanes.now.carried.throughput[i * count..(i + 1) * count];
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
                    let (white, base) = (patch.smooth.white[lane], patch.smooth.base[lane]);
                    let weights =
                        Weights { white, base, dip: patch.smooth.dip[lane], ..Weights::default() };
                    bands.for_each(|(k, band)| {
                        *band *= self.in_band_of_sheet(patch, lane, weights, k);
                    });
                }
            }
            let is_specular = kind == SurfaceKind::Smooth;
            let is_last = if is_specular { stage.ends } else { ends };
            let cone = if is_specular { self.cone_at_hit(stage, &lanes.now, i) } else { None };
            let normal = at(&patch.seen.shading, lane).as_vec3().into();
            let way = Way { pdf, is_specular, is_last, normal };
            self.follow_blocks(stage, lanes, patch, (lane, (i, k)), (way, cone));
        }
    }

    /// The same of surfaces that are worked out one by one.
    fn scatter_one_by_one(&self, stage: &Stage<'_>, lanes: &mut LaneScratch, patch: &mut Patch) {
        let hittable = self.stage.lights.is_hittable();
        let count = self.count();
        for n in 0..lanes.picked.len() {
            let (lane, (i, k)) = (lanes.picked[n], patch.path[n]);
            let bsdf = patch.bsdfs[lane];
            if stage.ends_unless_specular && !hittable && !bsdf.has_single() {
                continue;
            }
            let choice = lanes.number(Draw::Choice, k)[1];
            let Some(scattered) = bsdf.sample(choice, lanes.number(Draw::Direction, k)) else {
                continue;
            };
            let is_specular = scattered.pdf == f64::INFINITY;
            let is_last = if is_specular { stage.ends } else { stage.ends_unless_specular };
            if is_last && !is_specular && !hittable {
                continue;
            }
            let throughput = &mut lanes.now.carried.throughput[i * count..(i + 1) * count];
            for (k, band) in throughput.iter_mut().enumerate() {
                *band *= self.in_band(&bsdf, scattered.weights, k);
            }
            let start = patch.leave(lane, scattered.direction);
            patch.send(lane, (start, scattered.direction));
            let cone = if is_specular { self.cone_at_hit(stage, &lanes.now, i) } else { None };
            let (pdf, normal) = (scattered.pdf, bsdf.receiving_normal().as_vec3().into());
            let way = Way { pdf, is_specular, is_last, normal };
            self.follow_blocks(stage, lanes, patch, (lane, (i, k)), (way, cone));
        }
    }

    /// Notes the path along the ray that leaves a lane, unless it carries nothing or ends by chance.
    #[inline(always)]
    fn follow_blocks(
        &self,
        stage: &Stage<'_>,
        lanes: &mut LaneScratch,
        patch: &Patch,
        (lane, (i, k)): (usize, (usize, usize)),
        (way, cone): (Way, Option<Cone>),
    ) {
        let count = self.count();
        let [_, chance] = lanes.number(Draw::Chance, k);
        let LaneScratch { now, onward, .. } = lanes;
        let throughput = &mut now.carried.throughput[i * count..(i + 1) * count];
        let most = throughput.iter().copied().fold(0.0, f64::max);
        let ray = || (at(&patch.away.start, lane), at(&patch.away.along, lane));
        let asks = way.is_last && !way.is_specular && stage.asks_emitters;
        if most <= 0.0 || (asks && !self.may_shine(ray())) {
            return;
        }
        if self.rules.roulette.is_some_and(|after| stage.bounces + 1 >= after) && !way.is_last {
            // Its root: where few paths come this far, ending them saves little and leaves noise.
            let survival = most.sqrt().min(1.0);
            if chance >= survival {
                return;
            }
            throughput.iter_mut().for_each(|band| *band /= survival);
        }
        let carried = if asks {
            let (start, along) = ray();
            onward.last.push(start, along);
            &mut onward.of_last
        } else {
            let [start, along] = [&patch.away.start, &patch.away.along];
            push(&mut onward.next.rays, stage, [start, along], lane, f64::INFINITY);
            if stage.is_mixed {
                onward.next.carried.cones.push(cone);
            }
            &mut onward.next.carried
        };
        carried.ray.push(now.carried.ray[i]);
        carried.ways.push(way);
        carried.throughput.extend_from_slice(throughput);
    }
}
