//! A clear coat over another surface (`KHR_materials_clearcoat`): a GGX sheet of index 1.5, which passes on
//! to the surface beneath it what it leaves of light on both ways, `(1 − c E(μₒ)) (1 − c E(μᵢ))` with its
//! albedo `E` ([`super::albedo`]) and its share `c`. That is reciprocal, and returns no more than falls in;
//! light that goes to and fro between both is left out.

use etendue_geometry::glam::DVec3;

use super::albedo::Albedo;
use super::{Weights, fresnel, ggx};

/// Reflectance face on, of index 1.5.
const FACE_ON: f64 = 0.04;

/// The least α: no coat is so smooth that nothing but a single ray comes from it.
const SMOOTHEST: f64 = 1e-3;

/// A coat at one hit.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Coat {
    /// The share of the surface that has it, 0..=1.
    pub share: f64,
    /// The square of its roughness, 0..=1.
    pub alpha: f64,
}

/// The coat as seen from one direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct CoatView {
    share: f64,
    alpha: f64,
    albedo: Albedo,
    /// Share of light from the viewer that it returns, which is also how often it is sampled.
    pub(super) returned: f64,
}

impl Coat {
    /// As seen from `wo`; `None` where there is none.
    pub(super) fn seen(&self, wo: DVec3) -> Option<CoatView> {
        let alpha = self.alpha.max(SMOOTHEST);
        let albedo = Albedo::new(alpha, FACE_ON, 1.0);
        let returned = (self.share * albedo.at(wo)).min(1.0);
        (self.share > 0.0).then_some(CoatView { share: self.share, alpha, albedo, returned })
    }
}

impl CoatView {
    /// Share of light from `wi` that it passes on to the viewer.
    pub(super) fn passes(&self, wi: DVec3) -> f64 {
        (1.0 - self.returned) * (1.0 - self.share * self.albedo.at(wi.abs())).max(0.0)
    }

    /// Value times cosine and density with the coat, from those `below` it.
    pub(super) fn over(&self, wo: DVec3, wi: DVec3, below: (Weights, f64)) -> (Weights, f64) {
        let mut weights = below.0.times(self.passes(wi));
        let mut density = below.1 * (1.0 - self.returned);
        if wi.z > 0.0 {
            let (value, facets) = ggx::reflection(wo, wi, self.alpha);
            let cosine = (wo + wi).try_normalize().map_or(0.0, |h| wo.dot(h));
            let reflected = FACE_ON + (1.0 - FACE_ON) * fresnel::schlick_weight(cosine);
            weights.white += self.share * reflected * value;
            density += self.returned * facets;
        }
        (weights, density)
    }

    /// A direction that it mirrors light from.
    pub(super) fn sample(&self, wo: DVec3, square: [f64; 2]) -> DVec3 {
        let h = ggx::sample_visible(wo, square, self.alpha);
        2.0 * wo.dot(h) * h - wo
    }
}
