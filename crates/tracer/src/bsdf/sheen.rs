//! The sheen of cloth (`KHR_materials_sheen`): fibres that stand up from the surface, over another that gets
//! what they leave.
//!
//! # Sources
//!
//! * Estevez and Kulla, "Production Friendly Microfacet Sheen BRDF", SIGGRAPH 2017: the distribution of the
//!   fibres' normals, a power of the sine ("Charlie"), its fitted masking Λ, and the scaling of what lies
//!   beneath by `1 − c max(E(μₒ), E(μᵢ))`, with the largest part `c` of the sheen's colour.
//! * The Khronos Group, `KHR_materials_sheen`: V = 1 / (4 μₒ μᵢ (1 + Λ(μₒ) + Λ(μᵢ))), and α the square of the
//!   roughness.
//!
//! At grazing angles the model of smooth sheens returns up to three times what falls in. Here it is weighed by
//! `min(1, 1/E(μₒ), 1/E(μᵢ))`, which is reciprocal and leaves roughnesses from 0.25 as they are.

use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;

use etendue_geometry::glam::DVec3;

use super::Weights;
use super::split_sum::place;
use crate::Tint;

/// The least roughness: below, fibres are a rim finer than anything shows.
const SMOOTHEST: f64 = 0.07;

/// Knots of the table in the roughness and in √μ.
const ROUGHNESSES: usize = 32;
const OBLIQUITIES: usize = 64;

/// Directions that an entry is integrated over, in √μ and in azimuth.
const STEPS: [u32; 2] = [64, 32];

/// The share by which entries between knots may be too small: albedos are taken for that much larger.
const EXACT: f64 = 5e-3;

/// A sheen at one hit.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sheen {
    /// Its reflectance; black where there is none.
    pub color: Tint,
    /// Its roughness, 0..=1; the square is α.
    pub roughness: f64,
}

/// The sheen as seen from one direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct SheenView {
    alpha: f64,
    table: SheenAlbedo,
    /// The largest part of the colour.
    peak: f64,
    /// Λ and the albedo for the direction of the viewer.
    lambda: f64,
    albedo: f64,
    /// Probability with which it is sampled.
    pub(super) chance: f64,
}

impl Sheen {
    /// As seen from `wo`; `None` where there is none.
    pub(super) fn seen(&self, wo: DVec3) -> Option<SheenView> {
        let peak = self.color.peak().min(1.0);
        if peak <= 0.0 {
            return None;
        }
        let roughness = self.roughness.clamp(SMOOTHEST, 1.0);
        let (alpha, table) = (roughness * roughness, SheenAlbedo::new(roughness));
        let albedo = table.at(wo.z);
        let chance = peak * albedo.min(1.0);
        Some(SheenView { alpha, table, peak, lambda: lambda(wo.z, alpha), albedo, chance })
    }
}

impl SheenView {
    /// Share of light from `wi` that it leaves on the way to the viewer by what lies beneath.
    pub(super) fn passes(&self, wi: DVec3) -> f64 {
        1.0 - self.peak * self.albedo.max(self.table.at(wi.z.abs())).min(1.0)
    }

    /// Value times cosine and density with the sheen, from those `below` it.
    pub(super) fn over(&self, wo: DVec3, wi: DVec3, below: (Weights, f64)) -> (Weights, f64) {
        let mut weights = below.0.times(self.passes(wi));
        let mut density = below.1 * (1.0 - self.chance);
        if wi.z > 0.0 {
            let most = self.albedo.max(self.table.at(wi.z));
            let value = value([wo.z, wi.z], wo.dot(wi), self.alpha, self.lambda);
            weights.sheen += value * wi.z / most.max(1.0);
            density += self.chance / TAU;
        }
        (weights, density)
    }

    /// A direction that it returns light from, alike over the hemisphere.
    pub(super) fn sample([u, v]: [f64; 2]) -> DVec3 {
        let (sin, cos) = (TAU * v).sin_cos();
        let r = (1.0 - u * u).max(0.0).sqrt();
        DVec3::new(r * cos, r * sin, u)
    }
}

/// The value for the cosines of the two directions to the normal and the one between them; `lambda` is the
/// first one's Λ.
fn value([seen, lit]: [f64; 2], between: f64, alpha: f64, lambda_seen: f64) -> f64 {
    // Of the half vector.
    let length_squared = 2.0 + 2.0 * between;
    let cosine_squared = (seen + lit) * (seen + lit) / length_squared.max(f64::MIN_POSITIVE);
    let sine_squared = (1.0 - cosine_squared).max(0.0);
    let distribution = (2.0 + 1.0 / alpha) * sine_squared.powf(0.5 / alpha) / TAU;
    distribution / (4.0 * seen * lit * (1.0 + lambda_seen + lambda(lit, alpha)))
}

/// Λ of the fibres, by the authors' fit.
fn lambda(cosine: f64, alpha: f64) -> f64 {
    let fit = |x: f64| {
        let share = (1.0 - alpha) * (1.0 - alpha);
        let [a, b, c, d, e] = [
            [21.5473, 25.3245],
            [3.829_87, 3.324_35],
            [0.198_23, 0.168_01],
            [-1.977_60, -1.273_93],
            [-4.320_54, -4.859_67],
        ]
        .map(|[rough, smooth]: [f64; 2]| rough + (smooth - rough) * share);
        a / (1.0 + b * x.powf(c)) + d * x + e
    };
    if cosine < 0.5 { fit(cosine).exp() } else { (2.0 * fit(0.5) - fit(1.0 - cosine)).exp() }
}

/// Albedos of white sheens by roughness, then √μ.
static TABLE: LazyLock<Vec<f64>> = LazyLock::new(|| {
    let at = |k: usize, count: usize| k as f64 / (count - 1) as f64;
    let mut all = Vec::with_capacity(ROUGHNESSES * OBLIQUITIES);
    for i in 0..ROUGHNESSES {
        let roughness = SMOOTHEST + (1.0 - SMOOTHEST) * at(i, ROUGHNESSES);
        let alpha = roughness * roughness;
        for k in 0..OBLIQUITIES {
            all.push(integrated(at(k, OBLIQUITIES).powi(2).max(1e-6), alpha));
        }
    }
    all
});

/// ∫ f μ dω for the cosine `seen`, by the midpoint rule.
fn integrated(seen: f64, alpha: f64) -> f64 {
    let lambda_seen = lambda(seen, alpha);
    let sine = (1.0 - seen * seen).sqrt();
    let [rows, columns] = STEPS;
    let mut sum = 0.0;
    for row in 0..rows {
        let x = (f64::from(row) + 0.5) / f64::from(rows);
        let lit = x * x;
        let across = sine * (1.0 - lit * lit).sqrt();
        for column in 0..columns {
            let azimuth = PI * (f64::from(column) + 0.5) / f64::from(columns);
            let between = seen * lit + across * azimuth.cos();
            sum += value([seen, lit], between, alpha, lambda_seen) * lit * 2.0 * x;
        }
    }
    sum * TAU / f64::from(rows * columns)
}

/// The albedo of one roughness.
#[derive(Debug, Clone, Copy)]
struct SheenAlbedo {
    row: usize,
    share: f64,
}

impl SheenAlbedo {
    fn new(roughness: f64) -> Self {
        let (row, share) = place((roughness - SMOOTHEST) / (1.0 - SMOOTHEST), ROUGHNESSES);
        Self { row, share }
    }

    fn at(&self, cosine: f64) -> f64 {
        let (k, part) = place(cosine.max(0.0).sqrt(), OBLIQUITIES);
        let along = |row: usize| {
            let own = &TABLE[row * OBLIQUITIES + k..];
            own[0] * (1.0 - part) + own[1] * part
        };
        (1.0 + EXACT) * (along(self.row) * (1.0 - self.share) + along(self.row + 1) * self.share)
    }
}
