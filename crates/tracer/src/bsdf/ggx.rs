//! The GGX distribution of microfacets, as rough across the surface as along it or not. Vectors are in the frame
//! of the shading normal, whose x axis goes along.
//!
//! # Sources
//!
//! * Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007 (D).
//! * Heitz, "Understanding the Masking-Shadowing Function", JCGT 2014 (Λ, height-correlated G₂).
//! * Dupuy and Benyoub, "Sampling Visible GGX Normals with Spherical Caps", HPG 2023.

use std::f64::consts::PI;

use etendue_geometry::disk;
use etendue_geometry::glam::DVec3;

/// Roughness of a surface: α along x and along y, each the square of a roughness in 0..=1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Facets {
    /// Along x.
    pub x: f64,
    /// Along y.
    pub y: f64,
}

impl From<f64> for Facets {
    fn from(alpha: f64) -> Self {
        Self { x: alpha, y: alpha }
    }
}

/// Density of facets whose normal is `h`, per area of surface.
#[must_use]
#[inline]
pub fn distribution(h: DVec3, alpha: impl Into<Facets>) -> f64 {
    let Facets { x, y } = alpha.into();
    // As Walter's equation 33, written without tan θ: exact near the pole for any roughness.
    let e = h.x * h.x / (x * x) + h.y * h.y / (y * y) + h.z * h.z;
    1.0 / (PI * x * y * e * e)
}

fn lambda(w: DVec3, Facets { x, y }: Facets) -> f64 {
    let squared = (x * x * w.x * w.x + y * y * w.y * w.y) / (w.z * w.z);
    0.5 * ((1.0 + squared).sqrt() - 1.0)
}

/// Share of facets seen from `w`.
#[must_use]
#[inline]
pub fn masking(w: DVec3, alpha: impl Into<Facets>) -> f64 {
    1.0 / (1.0 + lambda(w, alpha.into()))
}

/// Share of facets seen from both.
#[must_use]
#[inline]
pub fn masking_shadowing(a: DVec3, b: DVec3, alpha: impl Into<Facets>) -> f64 {
    let alpha = alpha.into();
    1.0 / (1.0 + lambda(a, alpha) + lambda(b, alpha))
}

/// A facet's normal by its visible area from `w` (z > 0).
#[must_use]
#[inline]
pub fn sample_visible(w: DVec3, [u, v]: [f64; 2], alpha: impl Into<Facets>) -> DVec3 {
    let alpha = alpha.into();
    let stretched = DVec3::new(alpha.x * w.x, alpha.y * w.y, w.z).normalize();
    let (sin, cos) = disk::turn(u);
    let z = (1.0 - v) * (1.0 + stretched.z) - stretched.z;
    let r = (1.0 - z * z).clamp(0.0, 1.0).sqrt();
    let half = DVec3::new(r * cos, r * sin, z) + stretched;
    DVec3::new(alpha.x * half.x, alpha.y * half.y, half.z.max(0.0)).normalize_or(DVec3::Z)
}

/// Value of a sheet of facets of reflectance 1 from `wo` to `wi` (both z > 0), times the cosine of
/// `wi`; and the density of [`sample_visible`]'s reflections. 0 in both below the surface.
#[must_use]
#[inline]
pub fn reflection(wo: DVec3, wi: DVec3, alpha: impl Into<Facets>) -> (f64, f64) {
    let alpha = alpha.into();
    if wo.z <= 0.0 || wi.z <= 0.0 {
        return (0.0, 0.0);
    }
    let Some(h) = (wo + wi).try_normalize() else { return (0.0, 0.0) };
    let d = distribution(h, alpha) / (4.0 * wo.z);
    (d * masking_shadowing(wo, wi, alpha), d * masking(wo, alpha))
}
