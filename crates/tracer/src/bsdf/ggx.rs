//! The GGX distribution of microfacets, isotropic. Vectors are in the frame of the shading normal.
//!
//! # Sources
//!
//! * Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007 (D).
//! * Heitz, "Understanding the Masking-Shadowing Function", JCGT 2014 (Λ, height-correlated G₂).
//! * Dupuy and Benyoub, "Sampling Visible GGX Normals with Spherical Caps", HPG 2023.

use std::f64::consts::{PI, TAU};

use etendue_geometry::glam::DVec3;

/// Density of facets whose normal is `h`, per area of surface.
#[must_use]
pub fn distribution(h: DVec3, alpha: f64) -> f64 {
    // As Walter's equation 33, written without tan θ: exact near the pole for any roughness.
    let e = (h.x * h.x + h.y * h.y) / (alpha * alpha) + h.z * h.z;
    1.0 / (PI * alpha * alpha * e * e)
}

fn lambda(w: DVec3, alpha: f64) -> f64 {
    let tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
    0.5 * ((1.0 + alpha * alpha * tan2).sqrt() - 1.0)
}

/// Share of facets seen from `w`.
#[must_use]
pub fn masking(w: DVec3, alpha: f64) -> f64 {
    1.0 / (1.0 + lambda(w, alpha))
}

/// Share of facets seen from both.
#[must_use]
pub fn masking_shadowing(a: DVec3, b: DVec3, alpha: f64) -> f64 {
    1.0 / (1.0 + lambda(a, alpha) + lambda(b, alpha))
}

/// A facet's normal by its visible area from `w` (z > 0).
#[must_use]
pub fn sample_visible(w: DVec3, [u, v]: [f64; 2], alpha: f64) -> DVec3 {
    let stretched = DVec3::new(alpha * w.x, alpha * w.y, w.z).normalize();
    let (sin, cos) = (TAU * u).sin_cos();
    let z = (1.0 - v) * (1.0 + stretched.z) - stretched.z;
    let r = (1.0 - z * z).clamp(0.0, 1.0).sqrt();
    let half = DVec3::new(r * cos, r * sin, z) + stretched;
    DVec3::new(alpha * half.x, alpha * half.y, half.z.max(0.0)).normalize_or(DVec3::Z)
}

/// What a sheet of facets of reflectance 1 scatters from `wo` to `wi` (both z > 0), times the cosine
/// of `wi`; and the density of [`sample_visible`]'s reflections. 0 in both below the surface.
#[must_use]
pub fn reflection(wo: DVec3, wi: DVec3, alpha: f64) -> (f64, f64) {
    if wo.z <= 0.0 || wi.z <= 0.0 {
        return (0.0, 0.0);
    }
    let Some(h) = (wo + wi).try_normalize() else { return (0.0, 0.0) };
    let d = distribution(h, alpha) / (4.0 * wo.z);
    (d * masking_shadowing(wo, wi, alpha), d * masking(wo, alpha))
}
