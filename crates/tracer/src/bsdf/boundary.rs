//! Rough boundaries of glass: GGX facets that reflect and refract.
//!
//! # Sources
//!
//! * Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007: equations 16
//!   (half vector), 17 (its Jacobian) and 21 (value).
//! * Radiance is compressed by the square of the index (Veach 1997, section 5.2.2).

use etendue_geometry::glam::DVec3;

use super::{Weights, fresnel, ggx};

/// A rough boundary.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rough {
    /// The square of the roughness, above 0.
    pub(super) alpha: f64,
    /// Index behind the surface over the index in front.
    pub(super) eta: f64,
}

impl Rough {
    /// Value times cosine, and the density of [`Self::sample`]; `wo` is above the surface.
    pub(super) fn evaluate(&self, wo: DVec3, wi: DVec3) -> (Weights, f64) {
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

    /// A direction by a visible facet, which reflects or refracts by Fresnel's share.
    pub(super) fn sample(&self, wo: DVec3, choice: f64, square: [f64; 2]) -> Option<DVec3> {
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
