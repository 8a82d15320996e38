//! Glass that parts wavelengths: what is mirrored keeps all bands on one path, what passes goes on as a
//! path of each band, with a wavelength drawn from the band's light.
//!
//! Keeping one band of `n` at random instead, at `n` times its throughput (as Wilkie et al. 2014 do at
//! smooth boundaries), makes a relative variance of `n − 1` of each band by itself; going on with all
//! costs `n` paths and has none. All draw the same random numbers, so that bands do not part by noise.

use super::Tracing;
use crate::bsdf::{Bsdf, BsdfSample};
use crate::surface::SurfaceInteraction;

/// A boundary as one band meets it.
#[derive(Debug, Clone, Copy)]
struct TransmittedBand {
    band: usize,
    wavelength: f64,
    /// Index behind the surface over the index in front.
    eta: f64,
    reflectance: f64,
}

/// A path at a boundary: its lane, its hit, and how its surface scatters.
pub(super) struct Boundary<'a> {
    pub(super) lane: usize,
    pub(super) interaction: &'a SurfaceInteraction<'a>,
    pub(super) bsdf: Bsdf,
}

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Parts what a path carries to a boundary whose index is each band's own, by three numbers: `each` gets the ways that
    /// leave it, with the wavelength (nm) of the one band that passes, and what goes along them.
    pub(super) fn part_bands(
        &self,
        boundary: &Boundary<'_>,
        throughput: &[f64],
        [pick, place]: [f64; 2],
        choice: f64,
        mut each: impl FnMut(&BsdfSample, Option<f64>, &mut [f64]),
    ) {
        let passages = self.passages(boundary, throughput, place);
        let live = passages.len() as f64;
        let mean = passages.iter().map(|passage| passage.reflectance).sum::<f64>() / live;
        let mut sent = vec![0.0; self.count()];
        if choice < mean {
            let Some(mirrored) = boundary.bsdf.mirrored() else { return };
            for passage in &passages {
                sent[passage.band] = throughput[passage.band] * passage.reflectance / mean;
            }
            return each(&mirrored, None, &mut sent);
        }
        let parts = passages.len().min(self.rules.parts.max(1) as usize);
        for part in 0..parts {
            let stratum = (part as f64 + pick) * live / parts as f64;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range")]
            let passage = &passages[(stratum as usize).min(passages.len() - 1)];
            let passed = (1.0 - passage.reflectance) / (1.0 - mean) * live / parts as f64;
            let Some(refracted) = boundary.bsdf.refracted(passage.eta) else { continue };
            let tint = self.in_band(&boundary.bsdf, refracted.weights, passage.band);
            sent.fill(0.0);
            sent[passage.band] = throughput[passage.band] * passed * tint;
            each(&refracted, Some(passage.wavelength), &mut sent);
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

    /// Tests whether a part of a path, which surfaces have scattered so often, goes on: it carries anything, and does not
    /// end by chance. What it carries is told of that.
    pub(super) fn goes_on(
        &self,
        bounces: u32,
        chance: f64,
        before: &[f64],
        part: &mut [f64],
    ) -> bool {
        if part.iter().copied().fold(0.0, f64::max) <= 0.0 {
            return false;
        }
        let is_last = bounces >= self.rules.bounces;
        if self.rules.roulette.is_some_and(|after| bounces >= after) && !is_last {
            // As likely for all parts of a path, or those of its dim bands would be noise.
            let survival = before.iter().copied().fold(0.0, f64::max).min(0.95);
            if chance >= survival {
                return false;
            }
            part.iter_mut().for_each(|band| *band /= survival);
        }
        true
    }

    /// Keeps one band of what a path carries, chosen by a number among those that carry anything, at as many times as
    /// much: at rough boundaries, which scatter every wavelength into all directions. Its wavelength (nm), unless nothing
    /// is left.
    pub(super) fn keep_one(&self, u: f64, throughput: &mut [f64]) -> Option<f64> {
        let live: Vec<usize> = (0..throughput.len()).filter(|&k| throughput[k] > 0.0).collect();
        let scaled = u * live.len() as f64;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "u is in 0..1")]
        let kept = *live.get(scaled as usize)?;
        for (k, band) in throughput.iter_mut().enumerate() {
            *band = if k == kept { *band * live.len() as f64 } else { 0.0 };
        }
        Some(self.ctx.spectral.wavelength_at(kept, scaled.fract()))
    }
}
