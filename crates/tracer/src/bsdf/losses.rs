//! Losses of single scattering by rough boundaries of glass, and the lobes by which they come out in the end.
//!
//! Facets that reflect and refract once return `E(μ)` of the light, together on both sides; the rest went on to
//! other facets. It is given back by two matte lobes, one on each side (after Kulla and Conty, "Revisiting
//! Physically Based Shading at Imageworks", 2017), with L(μ) = 1 − E(μ), its mean `L̄ = 2 ∫ L μ dμ`, the mean
//! reflectance `F̄` of a smooth boundary, and ′ for the other side, where the index is 1/η:
//!
//! ```text
//! fᵣ = R L(μₒ) L(μᵢ) / (π L̄),   R = 1 − (1 − F̄) min(L̄, L̄′) / L̄
//! fₜ = (1 − F̄) L(μₒ) L′(μᵢ) / (π η² max(L̄, L̄′))
//! ```
//!
//! Both together return L(μₒ). They are reciprocal, as 1 − F̄ = η² (1 − F̄′): what enters a medium fills η² as
//! much of its directions.

use std::sync::OnceLock;

use etendue_geometry::glam::DVec3;

use super::split_sum::place;
use super::{fresnel, ggx};

/// Knots in ln η, from that of 1/[`MOST`] to that of [`MOST`]; in √α; and in √μ.
const INDICES: usize = 33;
const ROUGHNESSES: usize = 20;
const OBLIQUITIES: usize = 32;

/// The largest index of the table.
const MOST: f64 = 4.0;

/// Facets that each entry is averaged over.
const FACETS: u32 = 256;

/// The least α that loses anything.
const SMOOTHEST: f64 = 0.01;

/// Accuracy of interpolated entries: less is not taken for lacking.
const EXACT: f64 = 0.01;

/// The fractional part of the golden ratio.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Albedos of one index.
#[derive(Debug)]
struct Slab {
    /// By roughness, then √μ.
    entries: Vec<f64>,
    /// Their means over directions, by roughness.
    means: Vec<f64>,
    /// Mean share of light that a smooth boundary passes, 1 − F̄.
    passes: f64,
}

/// By index; each made when it is first asked for.
static TABLE: [OnceLock<Slab>; INDICES] = [const { OnceLock::new() }; INDICES];

impl Slab {
    fn of(index: usize) -> &'static Self {
        let [index, last] = [index, INDICES - 1];
        TABLE[index].get_or_init(|| Self::new(MOST.powf(2.0 * index as f64 / last as f64 - 1.0)))
    }

    fn new(eta: f64) -> Self {
        let at = |k: usize, count: usize| k as f64 / (count - 1) as f64;
        let mut entries = Vec::with_capacity(ROUGHNESSES * OBLIQUITIES);
        let mut means = Vec::with_capacity(ROUGHNESSES);
        for i in 0..ROUGHNESSES {
            let alpha = at(i, ROUGHNESSES).powi(2).max(1e-3);
            let row: Vec<f64> =
                (0..OBLIQUITIES).map(|k| entry(at(k, OBLIQUITIES).powi(2), alpha, eta)).collect();
            means.push(mean(|x| {
                let (k, share) = place(x, OBLIQUITIES);
                row[k] * (1.0 - share) + row[k + 1] * share
            }));
            entries.extend(row);
        }
        let passes = mean(|x| 1.0 - fresnel::dielectric(x * x, eta).0);
        Self { entries, means, passes }
    }
}

/// ∫ 2 μ f dμ = ∫ 4 x³ f dx, x = √μ, by the midpoint rule.
fn mean(f: impl Fn(f64) -> f64) -> f64 {
    const STEPS: u32 = 512;
    let at = |step: u32| (f64::from(step) + 0.5) / f64::from(STEPS);
    (0..STEPS).map(|step| 4.0 * at(step).powi(3) * f(at(step))).sum::<f64>() / f64::from(STEPS)
}

/// Share of light from the cosine `mu` that visible facets return to both sides.
fn entry(mu: f64, alpha: f64, eta: f64) -> f64 {
    let mu = mu.max(1e-6);
    let wo = DVec3::new((1.0 - mu * mu).sqrt(), 0.0, mu);
    let seen = ggx::masking(wo, alpha);
    let mut sum = 0.0;
    for k in 0..FACETS {
        let u = ((f64::from(k) + 0.5) * GOLDEN).fract();
        let v = (f64::from(k) + 0.5) / f64::from(FACETS);
        let h = ggx::sample_visible(wo, [u, v], alpha);
        let cosine = wo.dot(h).clamp(0.0, 1.0);
        let (reflected, behind) = fresnel::dielectric(cosine, eta);
        let mirrored = 2.0 * cosine * h - wo;
        if mirrored.z > 0.0 {
            sum += reflected * ggx::masking_shadowing(wo, mirrored, alpha) / seen;
        }
        let Some(behind) = behind else { continue };
        let refracted = (h * cosine - wo) / eta - h * behind;
        if refracted.z < 0.0 {
            let turned = DVec3::new(refracted.x, refracted.y, -refracted.z);
            sum += (1.0 - reflected) * ggx::masking_shadowing(wo, turned, alpha) / seen;
        }
    }
    sum / f64::from(FACETS)
}

/// The losses of one side of a boundary.
#[derive(Debug, Clone, Copy)]
struct BoundarySide {
    index: usize,
    share: f64,
    /// Knot in √α and the share of the next.
    rough: (usize, f64),
    /// L̄.
    mean: f64,
    /// 1 − F̄.
    passes: f64,
}

impl BoundarySide {
    fn new(alpha: f64, eta: f64) -> Self {
        let (index, share) = place(0.5 + 0.5 * eta.ln() / MOST.ln(), INDICES);
        let rough = place(alpha.sqrt(), ROUGHNESSES);
        let mean =
            |slab: &Slab| slab.means[rough.0] * (1.0 - rough.1) + slab.means[rough.0 + 1] * rough.1;
        let [own, next] = [index, index + 1].map(Slab::of);
        let mean = 1.0 - mean(own) * (1.0 - share) - mean(next) * share;
        Self { index, share, rough, mean, passes: passes(eta) }
    }

    /// L for a cosine; 0 where it is less than the table is exact.
    fn at(&self, cosine: f64) -> f64 {
        let (k, part) = place(cosine.max(0.0).sqrt(), OBLIQUITIES);
        let along = |slab: &Slab, row: usize| {
            let own = &slab.entries[row * OBLIQUITIES + k..];
            own[0] * (1.0 - part) + own[1] * part
        };
        let of = |slab: &Slab| {
            let (row, share) = self.rough;
            along(slab, row) * (1.0 - share) + along(slab, row + 1) * share
        };
        let [own, next] = [self.index, self.index + 1].map(|index| of(Slab::of(index)));
        (1.0 - EXACT - own * (1.0 - self.share) - next * self.share).max(0.0)
    }
}

/// 1 − F̄; of the denser side by the law that both sides obey.
fn passes(eta: f64) -> f64 {
    if eta < 1.0 {
        return eta * eta * passes(1.0 / eta);
    }
    let (index, share) = place(0.5 + 0.5 * eta.ln() / MOST.ln(), INDICES);
    Slab::of(index).passes * (1.0 - share) + Slab::of(index + 1).passes * share
}

/// Compensation of the light that a rough boundary lacks, seen from one direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct Compensation {
    own: BoundarySide,
    other: BoundarySide,
    eta: f64,
    /// L for the direction of the viewer: how often the matte lobes are sampled.
    pub(super) seen: f64,
    /// The share of it on the viewer's side.
    pub(super) reflected: f64,
}

impl Compensation {
    /// Of a boundary of roughness `alpha` and relative index `eta`, from the cosine `mu`; `None` where nothing is
    /// lacking.
    pub(super) fn new(alpha: f64, eta: f64, mu: f64) -> Option<Self> {
        let known = eta.is_finite() && (1.0 / MOST..=MOST).contains(&eta);
        if alpha < SMOOTHEST || !known {
            return None;
        }
        let (own, other) = (BoundarySide::new(alpha, eta), BoundarySide::new(alpha, 1.0 / eta));
        if own.mean <= EXACT || other.mean <= EXACT {
            return None;
        }
        let reflected = 1.0 - own.passes * own.mean.min(other.mean) / own.mean;
        Some(Self { own, other, eta, seen: own.at(mu), reflected })
    }

    /// π times the lobe's value on the viewer's side, for the cosine of the light.
    pub(super) fn above(&self, mu: f64) -> f64 {
        self.reflected * self.seen * self.own.at(mu) / self.own.mean
    }

    /// π times the lobe's value behind, for the cosine of the light.
    pub(super) fn below(&self, mu: f64) -> f64 {
        let most = self.own.mean.max(self.other.mean);
        self.own.passes * self.seen * self.other.at(mu) / (most * self.eta * self.eta)
    }
}
