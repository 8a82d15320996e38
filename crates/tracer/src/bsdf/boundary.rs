//! Rough boundaries of glass: GGX facets that reflect and refract, and what they send to one another
//! ([`super::losses`]).
//!
//! # Sources
//!
//! * Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007: equations 16
//!   (half vector), 17 (its Jacobian) and 21 (value).
//! * Radiance is compressed by the square of the index (Veach 1997, section 5.2.2).

use std::f64::consts::PI;

use etendue_geometry::glam::DVec3;

use super::losses::Compensation;
use super::{Weights, fresnel, ggx};
use crate::sampling::cosine_direction;

/// A rough boundary, seen from one direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct RoughBoundary {
    /// The square of the roughness, above 0.
    alpha: f64,
    /// Index behind the surface over the index in front.
    eta: f64,
    lacking: Option<Compensation>,
}

impl RoughBoundary {
    pub(super) fn new(alpha: f64, eta: f64, wo: DVec3) -> Self {
        Self { alpha, eta, lacking: Compensation::new(alpha, eta, wo.z) }
    }

    /// Value times cosine, and the density of [`Self::sample`]; `wo` is above the surface.
    pub(super) fn evaluate(&self, wo: DVec3, wi: DVec3) -> (Weights, f64) {
        let (mut weights, mut density) = self.once(wo, wi);
        if let Some(lacking) = &self.lacking {
            let cosine = wi.z.abs() / PI;
            let share = if wi.z > 0.0 {
                weights.white += lacking.above(wi.z) * cosine;
                lacking.reflected
            } else {
                weights.base += lacking.below(-wi.z) * cosine;
                1.0 - lacking.reflected
            };
            density = (1.0 - lacking.seen) * density + lacking.seen * share * cosine;
        }
        (weights, density)
    }

    /// Of light that met one facet.
    fn once(&self, wo: DVec3, wi: DVec3) -> (Weights, f64) {
        let black = (Weights::default(), 0.0);
        if wi.z > 0.0 {
            let Some(h) = (wo + wi).try_normalize() else { return black };
            let (value, density) = ggx::reflection(wo, wi, self.alpha);
            let (reflected, _) = fresnel::dielectric(wo.dot(h).clamp(0.0, 1.0), self.eta);
            return (Weights::white(reflected * value), reflected * density);
        }
        let Some(half) = (wo + self.eta * wi).try_normalize() else { return black };
        let h = if half.z < 0.0 { -half } else { half };
        let (seen, lit) = (wo.dot(h), wi.dot(h));
        if seen <= 0.0 || lit >= 0.0 {
            return black;
        }
        let (reflected, _) = fresnel::dielectric(seen.min(1.0), self.eta);
        let path = seen + self.eta * lit;
        // Facets seen, times the Jacobian from half vectors to directions.
        let facets = ggx::distribution(h, self.alpha) * seen / wo.z;
        let density = facets * self.eta * self.eta * -lit / (path * path) * (1.0 - reflected);
        let turned = DVec3::new(wi.x, wi.y, -wi.z);
        let shown = ggx::masking_shadowing(wo, turned, self.alpha);
        let value = density * shown / (self.eta * self.eta);
        (Weights::base(value), density * ggx::masking(wo, self.alpha))
    }

    /// A direction: of the matte lobes by what is lacking, or by a visible facet, which reflects or refracts by
    /// Fresnel's share.
    pub(super) fn sample(&self, wo: DVec3, choice: f64, square: [f64; 2]) -> Option<DVec3> {
        let lacking = self.lacking.map_or(0.0, |lacking| lacking.seen);
        if let Some(own) = self.lacking.filter(|own| choice < own.seen) {
            let up = cosine_direction(square);
            let reflects = choice < own.seen * own.reflected;
            return Some(if reflects { up } else { DVec3::new(up.x, up.y, -up.z) });
        }
        let choice = (choice - lacking) / (1.0 - lacking);
        let h = ggx::sample_visible(wo, square, self.alpha);
        let cosine = wo.dot(h).clamp(0.0, 1.0);
        let (reflected, behind) = fresnel::dielectric(cosine, self.eta);
        match behind {
            Some(behind) if choice >= reflected => {
                let wi = (h * cosine - wo) / self.eta - h * behind;
                (wi.z < 0.0).then_some(wi)
            }
            _ => {
                let wi = 2.0 * cosine * h - wo;
                (wi.z > 0.0).then_some(wi)
            }
        }
    }
}
