//! How much light rough reflection returns in all: the table that keeps the layer beneath from
//! returning it a second time.
//!
//! A GGX sheet with Schlick's reflectance f₀ (face on) and f₉₀ (grazing) has the directional albedo
//! `E(μ) = f₀ A(μ, α) + f₉₀ B(μ, α)` (Karis, "Real Shading in Unreal Engine 4", 2013, the split of
//! its integral). What lies beneath is lit by what passes on the way in and seen by what passes on
//! the way out, `(1 − E(μᵢ)) (1 − E(μₒ)) / (1 − Ē)`, with the mean albedo `Ē = 2 ∫ E μ dμ`: reciprocal,
//! and both together never return more than falls in (Shirley et al., "A Practitioners' Assessment of
//! Light Reflection Models", 1997; Kelemen and Szirmay-Kalos 2001).

use std::sync::LazyLock;

use etendue_geometry::glam::DVec3;

use super::{fresnel, ggx};

/// Steps in μ, and in √α, of the table.
const STEPS: usize = 48;

/// Facets that each entry is averaged over, a square number of them.
const FACETS: u32 = 24;

#[derive(Debug)]
struct Table {
    /// (A, B) by roughness, then μ.
    entries: Vec<[f64; 2]>,
    /// Their means over directions, by roughness.
    means: Vec<[f64; 2]>,
}

static TABLE: LazyLock<Table> = LazyLock::new(Table::new);

impl Table {
    fn new() -> Self {
        let knot = |k: usize| k as f64 / (STEPS - 1) as f64;
        let mut entries = Vec::with_capacity(STEPS * STEPS);
        let mut means = Vec::with_capacity(STEPS);
        for i in 0..STEPS {
            let alpha = knot(i) * knot(i);
            let row: Vec<[f64; 2]> = (0..STEPS).map(|k| entry(knot(k), alpha)).collect();
            // ∫ 2 μ E dμ of the piecewise linear interpolation, exactly.
            let mean = |c: usize| -> f64 {
                let h = 1.0 / (STEPS - 1) as f64;
                let piece = |k: usize| {
                    let (a, b, m) = (row[k][c], row[k + 1][c], knot(k));
                    2.0 * h * (m * (a + b) / 2.0 + h * (a / 6.0 + b / 3.0))
                };
                (0..STEPS - 1).map(piece).sum()
            };
            means.push([mean(0), mean(1)]);
            entries.extend(row);
        }
        Self { entries, means }
    }
}

/// A and B by the visible facets: each returns G₂/G₁ times its reflectance.
fn entry(mu: f64, alpha: f64) -> [f64; 2] {
    let wo = DVec3::new((1.0 - mu * mu).sqrt(), 0.0, mu.max(1e-6));
    if alpha == 0.0 {
        let w = fresnel::schlick_weight(mu);
        return [1.0 - w, w];
    }
    let mut sum = [0.0; 2];
    for k in 0..FACETS * FACETS {
        let place = |i: u32| (f64::from(i) + 0.5) / f64::from(FACETS);
        let h = ggx::sample_visible(wo, [place(k % FACETS), place(k / FACETS)], alpha);
        let wi = 2.0 * wo.dot(h) * h - wo;
        if wi.z <= 0.0 {
            continue;
        }
        let returned = ggx::masking_shadowing(wo, wi, alpha) / ggx::masking(wo, alpha);
        let w = fresnel::schlick_weight(wo.dot(h));
        sum[0] += returned * (1.0 - w);
        sum[1] += returned * w;
    }
    sum.map(|s| s / f64::from(FACETS * FACETS))
}

/// The albedo of one roughness: rows of the table, interpolated once.
#[derive(Debug, Clone, Copy)]
pub struct Albedo {
    row: usize,
    share: f64,
    f0: f64,
    f90: f64,
}

impl Albedo {
    /// Of a sheet with roughness `alpha` (0..=1) and reflectances `f0` face on and `f90` grazing.
    #[must_use]
    pub fn new(alpha: f64, f0: f64, f90: f64) -> Self {
        let (row, share) = place(alpha.max(0.0).sqrt());
        Self { row, share, f0, f90 }
    }

    /// For the cosine `mu` of the direction.
    #[must_use]
    pub fn at(&self, mu: f64) -> f64 {
        let (k, part) = place(mu);
        let table = &TABLE.entries;
        let at = |row: usize, k: usize| {
            let [a, b] = table[row * STEPS + k];
            self.f0 * a + self.f90 * b
        };
        let along = |row: usize| at(row, k) * (1.0 - part) + at(row, k + 1) * part;
        along(self.row) * (1.0 - self.share) + along(self.row + 1) * self.share
    }

    /// The mean over directions.
    #[must_use]
    pub fn mean(&self) -> f64 {
        let of = |row: usize| {
            let [a, b] = TABLE.means[row];
            self.f0 * a + self.f90 * b
        };
        of(self.row) * (1.0 - self.share) + of(self.row + 1) * self.share
    }
}

/// The knot below `x` in 0..=1 and the share of the next.
fn place(x: f64) -> (usize, f64) {
    let scaled = x.clamp(0.0, 1.0) * (STEPS - 1) as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range")]
    let knot = (scaled as usize).min(STEPS - 2);
    (knot, scaled - knot as f64)
}
