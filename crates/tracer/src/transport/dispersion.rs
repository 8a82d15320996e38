//! Glass that parts wavelengths: what is mirrored keeps all bands on one path, what passes goes on as a
//! path of each band, with a wavelength drawn from the band's light.
//!
//! Keeping one band of `n` at random instead, at `n` times its throughput (as Wilkie et al. 2014 do at
//! smooth boundaries), makes a relative variance of `n − 1` of each band by itself; going on with all
//! costs `n` paths and has none. All draw the same random numbers, so that bands do not part by noise.

use etendue_geometry::glam::DVec3;

use super::media::{Coincident, Crossing};
use super::numbers::Draw;
use super::paths::State;
use super::{Scratch, Tracing};
use crate::bsdf::{Bsdf, BsdfSample};
use crate::light_sampler::Receiver;
use crate::spectral::Spectral;
use crate::surface::SurfaceInteraction;

/// The most paths that one is parted into. Of more bands each path keeps one of a few neighbours.
const MOST_PARTS: usize = 32;

/// A boundary as one band meets it.
#[derive(Debug, Clone, Copy)]
struct TransmittedBand {
    band: usize,
    wavelength: f64,
    /// Index behind the surface over the index in front.
    eta: f64,
    reflectance: f64,
}

/// A path at a boundary: its hit, which of those that go on it is, and how its surface scatters.
pub(super) struct Boundary<'a> {
    pub(super) path: (usize, usize),
    pub(super) met: &'a SurfaceInteraction<'a>,
    /// The media on its sides, where they count.
    pub(super) crossing: Option<Crossing>,
    pub(super) bsdf: Bsdf,
}

impl<const RGB: bool> Tracing<'_, RGB> {
    /// The step of a path that still carries several bands at a boundary whose index is each one's own.
    pub(super) fn disperse(&self, boundary: &Boundary<'_>, scratch: &mut Scratch) {
        let (i, k) = boundary.path;
        let [pick, place] = scratch.numbers.of(Draw::Light, k);
        let passages = self.passages(boundary, scratch, [pick, place]);
        let live = passages.len() as f64;
        let mean = passages.iter().map(|passage| passage.reflectance).sum::<f64>() / live;
        let throughput = scratch.now.throughput[i * self.count()..(i + 1) * self.count()].to_vec();
        let choice = scratch.numbers.of(Draw::Choice, k)[1];
        let mut sent = vec![0.0; self.count()];
        if choice < mean {
            let Some(mirrored) = boundary.bsdf.mirrored() else { return };
            for passage in &passages {
                sent[passage.band] = throughput[passage.band] * passage.reflectance / mean;
            }
            return self.send_single(boundary, (&mirrored, None), &mut sent, scratch);
        }
        let parts = passages.len().min(MOST_PARTS);
        for part in 0..parts {
            let stratum = (part as f64 + pick) * live / parts as f64;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range")]
            let passage = &passages[(stratum as usize).min(passages.len() - 1)];
            let passed = (1.0 - passage.reflectance) / (1.0 - mean) * live / parts as f64;
            let Some(refracted) = boundary.bsdf.refracted(passage.eta) else { continue };
            let tint = self.in_band(&boundary.bsdf, refracted.weights, passage.band);
            sent.fill(0.0);
            sent[passage.band] = throughput[passage.band] * passed * tint;
            let way = (&refracted, Some(passage.wavelength));
            self.send_single(boundary, way, &mut sent, scratch);
        }
    }

    /// The boundary as each band meets it that carries anything.
    fn passages(
        &self,
        boundary: &Boundary<'_>,
        scratch: &Scratch,
        [_, place]: [f64; 2],
    ) -> Vec<TransmittedBand> {
        let start = boundary.path.0 * self.count();
        let live = |&band: &usize| scratch.now.throughput[start + band] > 0.0;
        let passage = |band| {
            let wavelength = self.stage.spectral.wavelength_at(band, place);
            let eta = boundary.met.eta(&self.stage.surroundings, wavelength);
            TransmittedBand { band, wavelength, eta, reflectance: boundary.bsdf.reflectance(eta) }
        };
        (0..self.count()).filter(live).map(passage).collect()
    }

    /// Notes a path along a direction that only the boundary can give, unless it carries nothing, ends
    /// by chance, or nothing is left for it to find.
    fn send_single(
        &self,
        boundary: &Boundary<'_>,
        (way, wavelength): (&BsdfSample, Option<f64>),
        throughput: &mut [f64],
        scratch: &mut Scratch,
    ) {
        let (i, k) = boundary.path;
        let Scratch { now, next, hits, coincident, numbers, .. } = scratch;
        let state = now.states[i];
        let bounces = state.bounces + 1;
        let most = throughput.iter().copied().fold(0.0, f64::max);
        if most <= 0.0 {
            return;
        }
        let is_last = bounces >= self.rules.bounces;
        if self.rules.roulette.is_some_and(|after| bounces >= after) && !is_last {
            // As likely for all parts of a path, or those of its dim bands would be noise.
            let survival = most_before(now.throughput_of(i, self.count())).min(0.95);
            if numbers.of(Draw::Chance, k)[1] >= survival {
                return;
            }
            throughput.iter_mut().for_each(|band| *band /= survival);
        }
        let anchor = &boundary.met.anchor;
        let start: DVec3 = anchor.leave(way.direction);
        let state = State {
            steps: state.steps + 1,
            bounces,
            pdf: f64::INFINITY,
            receiver: Receiver::open(anchor.point),
            wavelength: wavelength.or(state.wavelength),
            media: boundary
                .crossing
                .map_or(state.media, |crossing| crossing.after(way.direction, hits.normal(i))),
            is_last,
            cone: state.cone.map(|cone| cone.after(hits.t[i])),
            ..state
        };
        let left = [hits.placement[i], hits.triangle[i]];
        let coplanar = coincident.get(i).copied().unwrap_or(Coincident::NONE);
        next.push_beside(
            (start, way.direction),
            [left, [coplanar.placement, coplanar.triangle]],
            state,
        );
        next.throughput.extend_from_slice(throughput);
    }
}

fn most_before(throughput: &[f64]) -> f64 {
    throughput.iter().copied().fold(0.0, f64::max)
}

/// Keeps one band, chosen by `u` among those that carry anything, at as many times its throughput: at
/// rough boundaries, which scatter every wavelength into all directions.
pub(super) fn keep_one(throughput: &mut [f64], state: &mut State, spectral: &Spectral, u: f64) {
    let live: Vec<usize> = (0..throughput.len()).filter(|&k| throughput[k] > 0.0).collect();
    let scaled = u * live.len() as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "u is in 0..1")]
    let Some(&kept) = live.get(scaled as usize) else { return };
    for (k, band) in throughput.iter_mut().enumerate() {
        *band = if k == kept { *band * live.len() as f64 } else { 0.0 };
    }
    state.wavelength = Some(spectral.wavelength_at(kept, scaled.fract()));
}
