//! The two sums of Karis' split that tables of albedo hold, A and B, and where the tables have their knots.

use etendue_geometry::glam::DVec3;

use super::fresnel;
use super::ggx::{self, Facets};

/// Place of the cosine `mu` in the table, from 0 to 1. A sheet's albedo changes with μ/α at the horizon, by the masking
/// of its facets, and with μ elsewhere, by Fresnel: half of the knots are for each.
#[inline(always)]
pub(super) fn obliquity(mu: f64, alpha: f64) -> f64 {
    let masking = mu / (mu + alpha).max(f64::MIN_POSITIVE) * (1.0 + alpha);
    0.5 * (mu.sqrt() + masking)
}

/// The cosine at `place` of [`obliquity`], by bisection.
pub(super) fn cosine(place: f64, alpha: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if obliquity(middle, alpha) < place { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Accuracy of the table: less is not taken for lacking.
pub(super) const EXACT: f64 = 1e-3;

/// Share of light that facets of reflectance 1 lack when they return so much.
#[inline(always)]
pub(super) fn lacking(returned: f64) -> f64 {
    (1.0 - EXACT - returned).max(0.0)
}

/// The fractional part of the golden ratio.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// A and B for light from `wo`, by so many visible facets: each returns G₂/G₁ times its reflectance.
pub(super) fn entry(wo: DVec3, alpha: impl Into<Facets>, facets: u32) -> [f64; 2] {
    let alpha = alpha.into();
    let mut sum = [0.0; 2];
    for k in 0..facets {
        let u = (f64::from(k) + 0.5) * GOLDEN;
        let v = (f64::from(k) + 0.5) / f64::from(facets);
        let h = ggx::sample_visible(wo, [u.fract(), v], alpha);
        let wi = 2.0 * wo.dot(h) * h - wo;
        if wi.z <= 0.0 {
            continue;
        }
        let returned = ggx::masking_shadowing(wo, wi, alpha) / ggx::masking(wo, alpha);
        let w = fresnel::schlick_weight(wo.dot(h));
        sum[0] += returned * (1.0 - w);
        sum[1] += returned * w;
    }
    sum.map(|s| s / f64::from(facets))
}

/// The knot of `count` below `x` in 0..=1 and the share of the next.
pub(super) fn place(x: f64, count: usize) -> (usize, f64) {
    let scaled = x.clamp(0.0, 1.0) * (count - 1) as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range")]
    let knot = (scaled as usize).min(count - 2);
    (knot, scaled - knot as f64)
}
