//! Rough metal that keeps its energy: what GGX facets send to one another comes out in the end.
//!
//! Single scattering by facets of reflectance 1 returns `E(μ)` of the light ([`super::albedo`]), at
//! roughness 1 two thirds of it. What is lacking is returned by a matte lobe (Kulla and Conty,
//! "Revisiting Physically Based Shading at Imageworks", 2017):
//!
//! ```text
//! f = Fₘ (1 − E(μₒ)) (1 − E(μᵢ)) / (π (1 − Ē)),  Fₘ = F̄² Ē / (1 − F̄ (1 − Ē))
//! ```
//!
//! It is reciprocal, and with facets of reflectance 1 all light is returned. `F̄ = 2 ∫ F μ dμ` is the
//! facets' mean reflectance, `f₀ + (1 − f₀)/21` by Schlick.
//!
//! Metals of measured index follow Fresnel's equations by a fit in the two reflectances face on and at
//! c = 1/7 (Kutz, Hašan and Edmondson, "Novel Aspects of the Adobe Standard Material", 2021):
//! `F = f₀ + (1 − f₀)(1 − c)⁵ − d c (1 − c)⁶`, whose mean is `f₀ + (1 − f₀)/21 − d/126`.

use std::f64::consts::PI;

use etendue_geometry::glam::DVec3;

use super::albedo::Albedo;
use super::split_sum::lacking;
use super::{Weights, fresnel, ggx};

/// The cosine at which a metal's reflectance is met beside that face on.
pub const SECOND_COSINE: f64 = 1.0 / 7.0;

/// The factor `d` of the fit to reflectances `face_on` and `second` at [`SECOND_COSINE`].
pub(crate) fn dip(face_on: f64, second: f64) -> f64 {
    let w = fresnel::schlick_weight(SECOND_COSINE);
    let schlick = face_on + (1.0 - face_on) * w;
    (schlick - second) / (SECOND_COSINE * (1.0 - SECOND_COSINE) * w)
}

/// The mean reflectance of facets, from their reflectance face on and the fit's `dip`.
#[inline(always)]
pub(crate) fn mean_reflectance(face_on: f64, dip: f64) -> f64 {
    face_on + (1.0 - face_on) / 21.0 - dip / 126.0
}

/// `Fₘ`: what comes out after several facets of the mean reflectance, where `mean` is `Ē`.
#[inline(always)]
pub(crate) fn multiple(reflectance: f64, mean: f64) -> f64 {
    reflectance * reflectance * mean / (1.0 - reflectance * (1.0 - mean))
}

/// Reflectance of facets for the cosine on them: Schlick's of the surface's colour, less the dip.
pub(super) fn facets(cosine: f64) -> Weights {
    let w = fresnel::schlick_weight(cosine);
    let dip = -cosine * (1.0 - cosine) * w;
    Weights { white: w, base: 1.0 - w, dip, ..Weights::default() }
}

/// A rough metal seen from one direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct RoughMetal {
    alpha: f64,
    albedo: Albedo,
    /// `E` for the direction of the viewer, its mean, and the mean of what it lacks.
    seen: f64,
    pub(super) mean: f64,
    lacking: f64,
}

impl RoughMetal {
    pub(super) fn new(alpha: f64, wo: DVec3) -> Self {
        let albedo = Albedo::new(alpha, 1.0, 1.0);
        let ([a, b, lacking], seen) = (albedo.means(), albedo.at(wo).min(1.0));
        Self { alpha, albedo, seen, mean: (a + b).min(1.0), lacking }
    }

    /// Value times cosine, and the density of [`Self::sample`].
    pub(super) fn evaluate(&self, wo: DVec3, wi: DVec3) -> (Weights, f64) {
        let (value, density) = ggx::reflection(wo, wi, self.alpha);
        let cosine = (wo + wi).try_normalize().map_or(0.0, |h| wo.dot(h));
        let mut weights = facets(cosine).times(value);
        weights.deep = self.deep(self.albedo.at(wi)) * wi.z / PI;
        (weights, self.seen * density + (1.0 - self.seen) * wi.z / PI)
    }

    /// The matte lobe's value times π, for `E` of the direction of the light.
    fn deep(&self, lit: f64) -> f64 {
        deep(self.seen, lit, self.lacking)
    }

    /// A direction: of the facets by their share `E`, or of the matte lobe.
    pub(super) fn sample(&self, wo: DVec3, choice: f64, square: [f64; 2]) -> DVec3 {
        if choice >= self.seen {
            return crate::sampling::cosine_direction(square);
        }
        let h = ggx::sample_visible(wo, square, self.alpha);
        2.0 * wo.dot(h) * h - wo
    }
}

/// π times the matte lobe of reflectance 1, from `E` for both directions and the mean of what it lacks: also where that
/// is little, as smooth metal lacks light at grazing angles alone.
#[inline(always)]
pub(super) fn deep(seen: f64, lit: f64, mean: f64) -> f64 {
    if mean <= 0.0 { 0.0 } else { lacking(seen) * lacking(lit) / mean }
}
