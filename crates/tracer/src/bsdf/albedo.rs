//! How much light rough reflection returns in all: the table that keeps the layer beneath from
//! returning it a second time.
//!
//! A GGX sheet with Schlick's reflectance f₀ (face on) and f₉₀ (grazing) has the directional albedo
//! `E(μ) = f₀ A(μ, α) + f₉₀ B(μ, α)` (Karis, "Real Shading in Unreal Engine 4", 2013, the split of
//! its integral). What lies beneath is lit by what passes on the way in and seen by what passes on
//! the way out, `(1 − E(μᵢ)) (1 − E(μₒ)) / (1 − Ē)`, with the mean albedo `Ē = 2 ∫ E μ dμ`: reciprocal,
//! and both together never return more than falls in (Shirley et al., "A Practitioners' Assessment of
//! Light Reflection Models", 1997; Kelemen and Szirmay-Kalos 2001).
//!
//! Of facets that are rougher along the surface than across it A and B are taken for the larger ones of both
//! roughnesses, and the albedo for no less than a smooth sheet's, so that what lies beneath gets no more than
//! there is.

use std::sync::LazyLock;

use etendue_geometry::glam::DVec3;

use super::fresnel;
use super::ggx::{self, Facets};

/// Knots in α, dense where sheets are smooth.
const ROUGHNESSES: usize = 48;

/// Knots in [`obliquity`].
const OBLIQUITIES: usize = 96;

/// The least roughness of the table; smoother sheets differ at μ < 10⁻⁴ alone.
const SMOOTHEST: f64 = 1e-6;

/// Facets that each entry is averaged over: a lattice by the golden ratio, all of whose points differ along
/// both axes, as the viewer's azimuth changes nothing face on.
const FACETS: u32 = 1024;

#[derive(Debug)]
struct AlbedoTable {
    /// (A, B) by roughness, then [`obliquity`].
    entries: Vec<[f64; 2]>,
    /// Their means over directions, by roughness.
    means: Vec<[f64; 2]>,
}

static TABLE: LazyLock<AlbedoTable> = LazyLock::new(AlbedoTable::new);

impl AlbedoTable {
    fn new() -> Self {
        let mut entries = Vec::with_capacity(ROUGHNESSES * OBLIQUITIES);
        let mut means = Vec::with_capacity(ROUGHNESSES);
        for i in 0..ROUGHNESSES {
            let alpha = knot::<ROUGHNESSES>(i).powi(4).max(SMOOTHEST);
            let row: Vec<[f64; 2]> = (0..OBLIQUITIES)
                .map(|k| entry(cosine(knot::<OBLIQUITIES>(k), alpha), alpha))
                .collect();
            means.push(mean(&row, alpha));
            entries.extend(row);
        }
        Self { entries, means }
    }
}

/// Where the table has the cosine `mu`, from 0 to 1. A sheet's albedo changes with μ/α at the horizon,
/// by the masking of its facets, and with μ elsewhere, by Fresnel: half of the knots are for each.
fn obliquity(mu: f64, alpha: f64) -> f64 {
    let masking = mu / (mu + alpha).max(f64::MIN_POSITIVE) * (1.0 + alpha);
    0.5 * (mu.sqrt() + masking)
}

/// The cosine at `place` of [`obliquity`], by bisection.
fn cosine(place: f64, alpha: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if obliquity(middle, alpha) < place { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// ∫ 2 μ E dμ = ∫ 4 x³ E dx, x = √μ, of the interpolation, by the midpoint rule.
fn mean(row: &[[f64; 2]], alpha: f64) -> [f64; 2] {
    const STEPS: u32 = 512;
    let mut sum = [0.0; 2];
    for step in 0..STEPS {
        let x = (f64::from(step) + 0.5) / f64::from(STEPS);
        let (k, share) = place::<OBLIQUITIES>(obliquity(x * x, alpha));
        for (c, sum) in sum.iter_mut().enumerate() {
            *sum += 4.0 * x.powi(3) * (row[k][c] * (1.0 - share) + row[k + 1][c] * share);
        }
    }
    sum.map(|sum| sum / f64::from(STEPS))
}

/// The place in 0..=1 of knot `k` of `COUNT`.
fn knot<const COUNT: usize>(k: usize) -> f64 {
    k as f64 / (COUNT - 1) as f64
}

/// The fractional part of the golden ratio.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// A and B by the visible facets: each returns G₂/G₁ times its reflectance.
fn entry(mu: f64, alpha: f64) -> [f64; 2] {
    let wo = DVec3::new((1.0 - mu * mu).sqrt(), 0.0, mu.max(1e-12));
    let mut sum = [0.0; 2];
    for k in 0..FACETS {
        let u = (f64::from(k) + 0.5) * (GOLDEN);
        let v = (f64::from(k) + 0.5) / f64::from(FACETS);
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
    sum.map(|s| s / f64::from(FACETS))
}

/// The albedo of one roughness, or of two at right angles.
#[derive(Debug, Clone, Copy)]
pub struct Albedo {
    rows: AlbedoRows,
    /// Of the other roughness.
    across: Option<AlbedoRows>,
    f0: f64,
    f90: f64,
}

/// Rows of the table, interpolated once.
#[derive(Debug, Clone, Copy)]
struct AlbedoRows {
    alpha: f64,
    row: usize,
    share: f64,
}

impl AlbedoRows {
    fn new(alpha: f64) -> Self {
        let (row, share) = place::<ROUGHNESSES>(alpha.max(0.0).sqrt().sqrt());
        Self { alpha, row, share }
    }

    fn terms(&self, mu: f64) -> [f64; 2] {
        let (k, part) = place::<OBLIQUITIES>(obliquity(mu.max(0.0), self.alpha));
        let at = |row: usize, term: usize| {
            let entry = row * OBLIQUITIES + k;
            TABLE.entries[entry][term] * (1.0 - part) + TABLE.entries[entry + 1][term] * part
        };
        [0, 1].map(|term| {
            at(self.row, term) * (1.0 - self.share) + at(self.row + 1, term) * self.share
        })
    }

    fn mean_terms(&self) -> [f64; 2] {
        let [own, next] = [self.row, self.row + 1].map(|row| TABLE.means[row]);
        [0, 1].map(|term| own[term] * (1.0 - self.share) + next[term] * self.share)
    }
}

impl Albedo {
    /// Of a sheet with roughness `alpha` (0..=1) and reflectances `f0` face on and `f90` grazing.
    #[must_use]
    pub fn new(alpha: impl Into<Facets>, f0: f64, f90: f64) -> Self {
        let Facets { x, y } = alpha.into();
        let across = (x.to_bits() != y.to_bits()).then(|| AlbedoRows::new(x));
        Self { rows: AlbedoRows::new(y), across, f0, f90 }
    }

    /// For the cosine `mu` of the direction.
    #[must_use]
    pub fn at(&self, mu: f64) -> f64 {
        self.of(self.terms(mu))
    }

    /// The mean over directions.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.of(self.mean_terms())
    }

    /// From A and B of some direction, or their means.
    pub(super) fn of(&self, [a, b]: [f64; 2]) -> f64 {
        self.f0 * a + self.f90 * b
    }

    /// The albedo for the cosine `mu` of the direction, whose A and B are known; of facets rougher one way than the
    /// other no less than that of a smooth sheet, which they may exceed both roughnesses' by at grazing
    /// angles.
    pub(super) fn bound(&self, terms: [f64; 2], mu: f64) -> f64 {
        let own = self.of(terms);
        if self.across.is_none() {
            return own;
        }
        let w = fresnel::schlick_weight(mu.abs());
        own.max(self.f0 * (1.0 - w) + self.f90 * w)
    }

    /// A and B for the cosine `mu` of the direction. Their sum is what facets of reflectance 1 return.
    pub(super) fn terms(&self, mu: f64) -> [f64; 2] {
        self.larger(|rows| rows.terms(mu))
    }

    /// Their means over directions.
    pub(super) fn mean_terms(&self) -> [f64; 2] {
        self.larger(AlbedoRows::mean_terms)
    }

    fn larger(&self, terms: impl Fn(&AlbedoRows) -> [f64; 2]) -> [f64; 2] {
        let own = terms(&self.rows);
        let Some(across) = &self.across else { return own };
        let [a, b] = terms(across);
        [own[0].max(a), own[1].max(b)]
    }
}

/// The knot of `COUNT` below `x` in 0..=1 and the share of the next.
fn place<const COUNT: usize>(x: f64) -> (usize, f64) {
    let scaled = x.clamp(0.0, 1.0) * (COUNT - 1) as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range")]
    let knot = (scaled as usize).min(COUNT - 2);
    (knot, scaled - knot as f64)
}
