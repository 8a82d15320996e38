//! Glass that parts wavelengths: what is mirrored keeps all bands on one path, what passes goes on as a
//! path of each band, with a wavelength drawn from the band's light.
//!
//! Keeping one band of `n` at random instead, at `n` times its throughput (as Wilkie et al. 2014 do at
//! smooth boundaries), makes a relative variance of `n − 1` of each band by itself; going on with all
//! costs `n` paths and has none. All draw the same random numbers, so that bands do not part by noise.

use super::Tracing;
use super::media::Crossing;
use super::paths::{Draw, Step, Way, Workspace};
use super::rays::Rays;
use super::scatter::Departure;
use crate::bsdf::{Bsdf, BsdfSample};
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
    pub(super) interaction: &'a SurfaceInteraction<'a>,
    /// The media on its sides, where they count.
    pub(super) crossing: Option<Crossing>,
    pub(super) bsdf: Bsdf,
}

impl<const RGB: bool> Tracing<'_, RGB> {
    /// The step of a path that still carries several bands at a boundary whose index is each one's own.
    pub(super) fn disperse<R: Rays>(
        &self,
        step: &Step<'_>,
        boundary: &Boundary<'_>,
        workspace: &mut Workspace<R>,
    ) {
        let (i, k) = boundary.path;
        let [pick, place] = workspace.number(Draw::Light, k);
        let count = self.count();
        let throughput = workspace.now.carried.throughput[i * count..(i + 1) * count].to_vec();
        let passages = self.passages(boundary, &throughput, place);
        let live = passages.len() as f64;
        let mean = passages.iter().map(|passage| passage.reflectance).sum::<f64>() / live;
        let choice = workspace.number(Draw::Choice, k)[1];
        let mut sent = vec![0.0; count];
        if choice < mean {
            let Some(mirrored) = boundary.bsdf.mirrored() else { return };
            for passage in &passages {
                sent[passage.band] = throughput[passage.band] * passage.reflectance / mean;
            }
            return self.send_single(step, boundary, (&mirrored, None), &mut sent, workspace);
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
            self.send_single(step, boundary, way, &mut sent, workspace);
        }
    }

    /// The boundary as each band meets it that carries anything, at a place (0..1) of its light.
    fn passages(
        &self,
        boundary: &Boundary<'_>,
        throughput: &[f64],
        place: f64,
    ) -> Vec<TransmittedBand> {
        let live = |&band: &usize| throughput[band] > 0.0;
        let passage = |band| {
            let wavelength = self.ctx.spectral.wavelength_at(band, place);
            let eta = boundary.interaction.eta(&self.ctx.scene, wavelength);
            TransmittedBand { band, wavelength, eta, reflectance: boundary.bsdf.reflectance(eta) }
        };
        (0..self.count()).filter(live).map(passage).collect()
    }

    /// Notes a path along a direction that only the boundary can give, unless it carries nothing, ends
    /// by chance, or nothing is left for it to find.
    fn send_single<R: Rays>(
        &self,
        step: &Step<'_>,
        boundary: &Boundary<'_>,
        (way, wavelength): (&BsdfSample, Option<f64>),
        throughput: &mut [f64],
        workspace: &mut Workspace<R>,
    ) {
        let ((i, k), count) = (boundary.path, self.count());
        let bounces = workspace.now.bounces(step.number, i) + 1;
        if throughput.iter().copied().fold(0.0, f64::max) <= 0.0 {
            return;
        }
        let is_last = bounces >= self.rules.bounces;
        if self.rules.roulette.is_some_and(|after| bounces >= after) && !is_last {
            // As likely for all parts of a path, or those of its dim bands would be noise.
            let before = &workspace.now.carried.throughput[i * count..(i + 1) * count];
            let survival = before.iter().copied().fold(0.0, f64::max).min(0.95);
            if workspace.number(Draw::Chance, k)[1] >= survival {
                return;
            }
            throughput.iter_mut().for_each(|band| *band /= survival);
        }
        let normal = workspace.now.rays.hit(i).normal;
        let departure = Departure {
            ray: [boundary.interaction.anchor.leave(way.direction), way.direction],
            way: Way { is_last, ..Way::CAMERA },
            cone: self.cone_at_hit(step, &workspace.now, i),
            media: boundary.crossing.map(|crossing| crossing.after(way.direction, normal)),
        };
        self.send(workspace, i, (departure, wavelength), throughput);
    }

    /// Keeps one band of a path, chosen among those that carry anything, at as many times its throughput: at rough
    /// boundaries, which scatter every wavelength into all directions. Its wavelength (nm), unless nothing is left.
    pub(super) fn keep_one<R: Rays>(
        &self,
        workspace: &mut Workspace<R>,
        (i, k): (usize, usize),
    ) -> Option<f64> {
        let (u, count) = (workspace.number(Draw::Choice, k)[0], self.count());
        let carried = &mut workspace.now.carried;
        let throughput = &mut carried.throughput[i * count..(i + 1) * count];
        let live: Vec<usize> = (0..count).filter(|&k| throughput[k] > 0.0).collect();
        let scaled = u * live.len() as f64;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "u is in 0..1")]
        let kept = *live.get(scaled as usize)?;
        for (k, band) in throughput.iter_mut().enumerate() {
            *band = if k == kept { *band * live.len() as f64 } else { 0.0 };
        }
        let wavelength = self.ctx.spectral.wavelength_at(kept, scaled.fract());
        carried.wavelengths.resize(carried.ray.len(), None);
        carried.wavelengths[i] = Some(wavelength);
        Some(wavelength)
    }
}
